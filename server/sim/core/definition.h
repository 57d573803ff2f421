/* A scene as plain structs, from which a world is built. pal_scene_default gives the defaults; the room scene fills
 * them from a file, tests by hand. All SI. A scene borrows its prepared meshes, which outlive every world made from it.
 * Thread: [load]. */
#ifndef PAL_SIM_CORE_DEFINITION_H
#define PAL_SIM_CORE_DEFINITION_H
#include "server/mesh/cells/maccracken_joy.h"
#include "server/mesh/files/image_file.h"
#include "server/mesh/volume/prepared.h"
#include "server/sim/core/anatomical_axes.h"
#include "server/sim/core/config_entry.h"
#include "server/sim/core/tools.h"
#include "server/sim/core/tuning.h"

enum { PAL_NAME = 48, PAL_BODY_MAX = 8, PAL_ENTRIES_MAX = 16, PAL_SUPPORT_MAX = 8, PAL_REGION_MAX = 32 };

/* isotropic material of a body; defaults: soft abdominal tissue */
typedef struct pal_material {
    double young_Pa;      /* 5000           */
    double poisson;       /* 0.45; above PAL_POISSON_CLAMP it is taken as that */
    double density_kg_m3; /* 1000           */
    /* viscous damping rate c/m of the effect `viscous`; 0: no such component; PAL_DAMPING_DERIVED (the default): from
     * the body's lowest frequency w1, see pal_material_damping_1_s */
    double damping_1_s;
    double damping_ratio; /* 1: of a derived rate, over the critical damping 2 w1 of the slowest mode */
} pal_material;
enum { PAL_DAMPING_DERIVED = -1 };

/* another material in a part of the body; the last region that contains a point wins. Numbers that are NaN keep the
 * body's */
typedef enum pal_region_kind { PAL_REGION_BOX, PAL_REGION_LABEL, PAL_REGION_GRID } pal_region_kind;
typedef struct pal_region {
    pal_region_kind kind;
    double young_Pa, poisson, density_kg_m3; /* GRID: NaN where the grid gives them                            */
    double low_m[3], high_m[3];              /* BOX, and the extent of GRID; body frame                        */
    /* LABEL: voxels of a label volume, GRID: values at nodes, trilinear between; x fastest; borrowed           */
    int n[3];
    double spacing_m[3];  /* LABEL: of its voxels; low_m: centre of the first             */
    const uint8_t *label; /* [n2][n1][n0]; the region is where it equals `is`               */
    int is;
    const double *grid_young_Pa, *grid_poisson, *grid_density_kg_m3; /* NULL: not given                          */
} pal_region;

/* Constants of springs that vary over the body (model tet_springs, paper B section 3.5): values at the nodes of a grid,
 * trilinear between them, the border's values beyond. A spring takes the mean over its corners at rest. At most
 * PAL_SPRING_GRID_NODES_MAX nodes. Numbers are borrowed, x fastest */
typedef struct pal_spring_grid {
    int n[3];                   /* nodes; n[0] 0: no grid                               */
    double low_m[3], high_m[3]; /* body frame                                          */
    const double *k_J[3];       /* of edges, faces, tetrahedra; NULL: not given, faces: no such component */
} pal_spring_grid;

/* fixed nodes: those inside a box (body frame, relative to the mesh's origin_m), in the lowest fraction of the body's
 * height along `up`, or on open edges of the surface (model adaptive_springs) */
typedef struct pal_support_def {
    bool lowest;     /* true: `fraction`                 */
    bool rim;        /* true: the open edges; both false: the box */
    double fraction; /* 0.05                              */
    double low_m[3], high_m[3];
} pal_support_def;

/* A stroke of a soft brush over the material at rest (painting, paper A section 4.1; model subdivision_fem). Within
 * radius_m of at_m, Young's modulus and density are multiplied by factor^w; w is 1 up to (1 - softness) radius_m and
 * falls smoothly to 0 at radius_m. Strokes multiply. Ranges: factors 1 / PAL_FACTOR_MAX to
 * PAL_FACTOR_MAX, softness 0 to 1, radius_m above 0 */
typedef struct pal_stroke {
    double at_m[3], radius_m, softness; /* body frame, rest shape */
    double young_factor, density_factor;
} pal_stroke;
enum { PAL_STROKE_MAX = 4096 };

/* what a body may look like (clients/viewer/src/tissue_looks.js draws each); no effect on its mechanics */
#define PAL_APPEARANCES                                                                                                \
    "liver|gall_bladder|stomach|intestine|kidney|spleen|pancreas|heart|lung|brain|vessel|bone|fat|muscle|skin|plastic"
enum { PAL_APPEARANCE_BYTES = 16, PAL_COLOUR_BYTES = 8 };

/* Ground that parts of elements stick to, for static problems: the penalty (k/2) int |u - move|^2 dS over surfaces
 * through voxel hexahedra, which fixes no node. Items ascend by element; move_m may change between steps. */
typedef struct pal_ground_item {
    int32_t element, support; /* hexahedron, in which several items may be; whose the surface is */
    double k_N_m[36];         /* k int N_c N_d dS of its corners c <= d (pal_hex_pair) */
    double move_m[3];
} pal_ground_item;
typedef struct pal_ground {
    int n;
    pal_ground_item *item; /* [n] */
} pal_ground;

typedef struct pal_body_def {
    char name[PAL_NAME];
    char appearance[PAL_APPEARANCE_BYTES]; /* a word of PAL_APPEARANCES; "": unknown */
    char colour[PAL_COLOUR_BYTES];         /* "#rrggbb" in place of the appearance's own; "": its own */
    const pal_prepared *mesh;              /* borrowed                                                        */
    /* shown on mesh->surface, whose image_at has their numbers; borrowed [n_image] */
    int n_image;
    const pal_image *image;
    /* model subdivision_fem: control cells, body frame, borrowed; NULL for other models. mesh then has the triangles of
     * the control cells' boundary alone (surface), for size, origin and messages */
    const pal_cells *cells;
    int n_stroke;
    const pal_stroke *stroke; /* painted so far, borrowed [n_stroke] */
    /* cut: cells with cut_normal . x > cut_m at their middle at rest are not shown, and what they hid is */
    bool cut;
    double cut_normal[3], cut_m; /* unit; body frame */
    pal_material material;
    int n_region;
    pal_region region[PAL_REGION_MAX];
    pal_spring_grid spring_grid; /* k_distance_J, k_area_J, k_volume_J of the model in place of its keys  */
    pal_config_entry model;      /* name: "tet_springs" ...; keys: the model's own (k_distance_J ...) */
    pal_config_entry solver;     /* name: "verlet"; empty name: the model's own choice               */
    pal_config_entry
        output; /* "skin_output" (default) or "surface_output"; a body without skin has the latter either way */
    int n_support;
    pal_support_def support[PAL_SUPPORT_MAX];
    const pal_ground *ground; /* model fem of hexahedra; NULL: none; borrowed */
    int n_effect;             /* gravity, tool_push, tool_grasp, finite_guard, viscous ...         */
    pal_config_entry effect[PAL_ENTRIES_MAX];
} pal_body_def;

/* what a client draws for a tool. Contact and grasp are those of the sphere of its radius, whatever its instrument */
typedef enum pal_instrument {
    PAL_INSTRUMENT_BALL,
    PAL_INSTRUMENT_PROBE,
    PAL_INSTRUMENT_GRASPER,
    PAL_INSTRUMENT_SCISSORS,
    PAL_INSTRUMENT_HOOK,
    PAL_INSTRUMENT_RETRACTOR,
    PAL_INSTRUMENT_COUNT
} pal_instrument;
/* "ball", "probe" ..., by pal_instrument; NULL-terminated */
extern const char *const pal_instrument_names[PAL_INSTRUMENT_COUNT + 1];

typedef struct pal_tool_def {
    char name[PAL_NAME]; /* "probe 1"                                      */
    double radius_m;     /* 0: 4 % of the first body's box diagonal         */
    double force_cap_N;  /* largest force that the tool exerts or feels; 15 */
    pal_instrument instrument;
    bool has_trocar;
    double trocar_m[3]; /* the point that the shaft passes; for clients, the simulation takes any pose */
} pal_tool_def;

enum { PAL_THREADS_MAX = 64 };

/* s: limits of step_s */
#define PAL_STEP_MIN_S 1e-4
#define PAL_STEP_MAX_S 0.1

typedef struct pal_scene {
    char name[PAL_NAME]; /* session name, [a-z0-9_-]                                  */
    char title[128];     /* shown to people: "Liver, abdominal CT"                    */
    char source[256];    /* where the organ comes from and its licence, shown as well */
    char accuracy[128];  /* distance from its reference, shown beside the title: "2.1 % RMS of finite elements"; may be
                            empty */
    /* configuration asked for, of those that a study has measured: the cheapest within max_error_m of the reference, or
     * the most accurate with a step of at most budget_ms, or the cheapest that meets both; 0: none. The world reads
     * neither */
    double max_error_m, budget_ms;
    double step_s;                        /* one step of the world; sub-steps are the solver's own: 1/60 */
    double up[3];                         /* unit, against gravity: (0, 0, 1)                          */
    char anatomical_axes[PAL_AXES_BYTES]; /* where x, y and z point in the patient, "RAS"; "": not known */
    double gravity_m_s2;                  /* 9.81; acts on bodies with the effect `gravity`            */
    bool keep_real_time; /* a server gives up accuracy before time (server/net/hub_watch.h); no effect elsewhere */
    int threads;         /* that share a step, the same results with any number; 0: one, or the server's choice */
    int max_substep;     /* budget of sub-steps per step, refused beyond: 2000        */
    int n_body;
    pal_body_def body[PAL_BODY_MAX];
    int n_tool;
    pal_tool_def tool[PAL_TOOL_MAX];
} pal_scene;

int pal_scene_find_body(const pal_scene *scene, const char *name); /* -1: none has that name */
/* an empty scene with defaults, and a body with defaults: material above, model tet_springs, output skin_output, lowest
 * 5 % fixed, effects gravity, tool_push, tool_grasp, finite_guard */
void pal_scene_default(pal_scene *scene);
void pal_body_default(pal_body_def *body, const char *name, const pal_prepared *mesh);
/* the same with control cells: model subdivision_fem, output surface_output; mesh: the triangles of their boundary */
void pal_body_default_cells(pal_body_def *body, const char *name, const pal_prepared *mesh, const pal_cells *cells);
/* the three tools of a scene that names none */
void pal_tools_default(pal_scene *scene, int n_tool);
/* fixed [n] = 1 for the points x [n][3] (body frame) in the box or lowest part of the support; rim: none */
void pal_support_mark_fixed(const pal_support_def *support, const double up[3], const double *x, int n, uint8_t *fixed);
/* reads the part that an effect supports: keys low_m and high_m (a box, body frame) or lowest (share of the body's
 * height along `up`, 0.05); REFUSED */
pal_err pal_support_read(pal_config_entry *entry, pal_support_def *out, pal_diagnostic *diag);
/* the part of the body that an effect supports (moving_support, penalty); false: it supports nothing, or is refused */
bool pal_support_of_effect(const pal_config_entry *effect, pal_support_def *out);
/* fixed [n] = 1 for all points that the body's supports, rims excepted, and its effects support */
void pal_body_def_mark_fixed(const pal_body_def *def, const double up[3], const double *x, int n, uint8_t *fixed);
/* The rate that is given, or the derived one: min(4, 2 ratio w1). At ratio 1 the slowest mode returns as fast as it
 * can, with the time constant 1 / w1. lowest_1_s 0: w1 is not known, and the rate is 4 */
static inline double pal_material_damping_1_s(const pal_material *material, double lowest_1_s)
{
    const double critical = 2 * material->damping_ratio * lowest_1_s;
    if (material->damping_1_s != PAL_DAMPING_DERIVED) return material->damping_1_s;
    return lowest_1_s > 0 && critical < PAL_DAMPING_1_S ? critical : PAL_DAMPING_1_S;
}
/* REFUSED names the key of a number that is not finite or out of range (tuning.h). A Poisson ratio above
 * PAL_POISSON_CLAMP is taken as that, and diag reports it */
pal_err pal_material_check(pal_material *material, pal_diagnostic *diag);
/* the material at x (body frame): the body's, overridden by its regions in order */
void pal_material_at(const pal_body_def *def, const double x[3], pal_material *out);
/* the same over another material than the body's; NaN in `base` stays where no region gives the number */
void pal_material_overlay(const pal_body_def *def, const pal_material *base, const double x[3], pal_material *out);
/* weight of a stroke at x, 0..1 */
double pal_stroke_weight(const pal_stroke *stroke, const double x[3]);
/* the material at x (body frame) with regions and strokes */
void pal_material_painted(const pal_body_def *def, const double x[3], pal_material *out);
/* REFUSED names the number out of range */
pal_err pal_stroke_check(const pal_stroke *stroke, pal_diagnostic *diag);
/* REFUSED names body, regions[index], key and number: an empty box or grid, numbers out of range or not given */
pal_err pal_region_check(const pal_body_def *def, int index, pal_diagnostic *diag);
/* REFUSED names body, axis or list, index and number: an empty grid, constants that are not above 0, a model without
 * such a grid. A body without a grid passes */
pal_err pal_spring_grid_check(const pal_body_def *def, pal_diagnostic *diag);
/* REFUSED names the entry: no body, numbers out of range, two bodies of one name, a step outside [1e-4, 0.1] s */
pal_err pal_scene_check(const pal_scene *scene, pal_diagnostic *diag);
#endif
