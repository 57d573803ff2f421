/* One body: its unknowns, what acts on them, what is shown of it. A body is filled by a model (effect_list.h), advanced
 * by a solver and read by components. Memory is the world's arena unless a field says otherwise; components borrow
 * pointers into it. Positions and velocities are in the body frame, relative to the mesh's origin_m. Thread: [load] to
 * build, [sim] else. */
#ifndef PAL_SIM_CORE_BODY_H
#define PAL_SIM_CORE_BODY_H
#include "server/base/arena.h"
#include "server/mesh/geometry/surface.h"
#include "server/mesh/geometry/tets.h"
#include "server/mesh/volume/hexes.h"
#include "server/mesh/volume/skin.h"
#include "server/num/interpolation.h"
#include "server/sim/core/dofs.h"
#include "server/sim/core/safeguards.h"
#include "server/sim/core/simd_blocks.h"
#include "server/sim/core/tuning.h"

struct pal_body;
struct pal_step;
struct pal_team;

/* The static answer of the body to a load at its present shape, from an implicit solver with a static factor
 * (implicit/compliance.h), or for an explicit one beside it (implicit/tissue_compliance.h) */
typedef struct pal_compliance {
    void *self;
    /* displacement [n_node][3] that the forces [n_node][3] (N, zero at most nodes) would cause once all is at rest
     * again; false: not known (no supports, no factor). No heap. [sim] */
    bool (*solve)(void *self, const struct pal_body *body, const double *force_N, double *move_m);
    /* explicit solvers only, else NULL: in the last sub-step of a step, before it is asked; the body is back at rest;
     * frees heap memory. step->body is written to and restored by solve */
    void (*begin)(void *self, struct pal_step *step);
    void (*reset)(void *self);
    void (*destroy)(void *self);
} pal_compliance;

/* quantities that can be shown in colour; computed only while a client asks for one (component field_output) */
typedef enum pal_field {
    PAL_FIELD_NONE,
    PAL_FIELD_DISPLACEMENT_M,
    PAL_FIELD_VON_MISES_PA,
    PAL_FIELD_ENERGY_J_M3,
    PAL_FIELD_STIFFNESS_J,   /* mean constant k_d of the edges at a node, paper B fig. 13 f */
    PAL_FIELD_STRAIN,        /* largest principal stretch - 1, paper A fig. 13              */
    PAL_FIELD_DISTORTION,    /* volume over volume at rest - 1                              */
    PAL_FIELD_YOUNG_PA,      /* Young's modulus of the material there, paper A figs. 8b, 9b */
    PAL_FIELD_DENSITY_KG_M3, /* of the material there                                     */
    PAL_FIELD_DAMPING_1_S,   /* drag over momentum (component viscous)                    */
    PAL_FIELD_COUNT
} pal_field;
/* "displacement", "von_mises", "energy", "stiffness", "strain", "distortion", "young", "density",
 * "damping", "none"; never NULL [any] */
const char *pal_field_name(pal_field field);
pal_field pal_field_find(const char *name);   /* NONE: there is no field of that name [any] */
const char *pal_field_title(pal_field field); /* for sentences: "von Mises stress" [any]    */

/* values of a field at the shown vertices, written by its component and valid while that exists */
typedef struct pal_shown_field {
    float *value;                /* SI                                    [n_shown] */
    double *node;                /* the same at the nodes                     [n_node] */
    float *moved;                /* m, displacement of the nodes then         [n_node][3] */
    uint64_t revision;           /* different for every set of values               */
    double time_s;               /* simulated time at which they were computed      */
    double kinetic_J, elastic_J; /* of the body then; of the field energy only   */
} pal_shown_field;

/* who moves a dof: the solver, nobody, or a component that gives its velocity */
typedef enum pal_support { PAL_FREE, PAL_FIXED, PAL_PRESCRIBED } pal_support;

/* what is shown of a body, set by the OUTPUT component in make; read by tools, output and broadcast */
typedef struct pal_display {
    const pal_surface *surface; /* shown surface at rest                                                           */
    const pal_skin *skin;       /* of the surface on nodes; NULL: shown vertices are nodes                         */
    double *skin_axes;          /* current frames of the skin                                         [n_frame][9] */
    int n_shown;                /* shown vertices; 0: nothing is shown                                             */
    float *shown;               /* m, body frame                                                      [n_shown][3] */
    const int32_t *shown_node;  /* node of each shown vertex when skin is NULL                           [n_shown] */
    const int32_t *shown_face;  /* of solids: control face of each shown triangle, -1: inside a cut; NULL: another
                                   body                                                                    [n_tri] */
    /* of solids: 1 where a shown triangle was not on the boundary at load; NULL: all were [n_tri] */
    const uint8_t *shown_inside;
    /* tetrahedra of nodes that fill a solid, for sections; NULL: those of the mesh do, or nothing [n_tet][4] */
    const int32_t *tet;
    int n_tet;
    /* while a change of method is blended in: the surface shown before less the present one, of which offset_part is
     * added to what is shown and to every point that tools touch; NULL: no blend */
    const float *offset_m;                         /* m, body frame                                   [n_shown][3] */
    double offset_part;                            /* 1 at the change, falls to 0                                  */
    uint64_t n_output;                             /* times the OUTPUT components ran since load                   */
    uint64_t revision;                             /* grows with every change of the shown topology                */
    const pal_shown_field *field[PAL_FIELD_COUNT]; /* NULL: no client asks for it                                  */
    uint64_t field_revision;                       /* sets of values computed so far, of all fields                */
} pal_display;

typedef struct pal_body {
    const char *name;

    /* ---- unknowns. Without interpolation, nodes are dofs and d, dv, f, node_mass_kg, node_rest alias x, v, g,
     * mass_kg, x_rest ---- */
    int n_dof;            /* points that the solver moves: control points (paper A) or mass nodes        */
    int n_node;           /* points on which forces act                                                  */
    double *x, *v;        /* dof position m, velocity m/s                                [n_dof][3]      */
    double *d, *dv;       /* node position m, velocity m/s                               [n_node][3]     */
    double *mass_kg;      /* lumped                                                      [n_dof]         */
    double *x_rest;       /* m                                                           [n_dof][3]      */
    double *node_mass_kg; /* lumped                                                      [n_node]        */
    double *node_rest;    /* m                                                           [n_node][3]     */
    uint8_t *support;     /* pal_support                                                 [n_dof]         */
    const pal_interpolation *interpolation; /* d = A x (paper A eq. 1); NULL: nodes are dofs                */
    /* consistent mass matrix between dofs, of which mass_kg has the row sums; NULL: masses are lumped */
    struct pal_mass_operator *mass_operator;
    /* velocity that a shown node gains from an impulse of 1 Ns on it alone, m/s; NULL: 1 / mass_kg. Bounds explicit
     * contact [n_node] */
    double *node_inverse_mass_1_kg;
    /* active dofs: those of `active`, or all when it is NULL: for (k < n_active) i = pal_body_point(body, k). A body
     * that adapts has arrays for its finest level; inactive dofs are at x_rest with v, f, load and mass 0, so that a
     * sum over all dofs is right and one over the active ones fast. Forces are added at active nodes only, since f is
     * cleared there only */
    const int32_t *active; /* [n_active] */
    int n_active;
    pal_dofs dofs; /* what else differs from model to model (dofs.h) */
    /* state of the model, for its own room and components; everybody else reads dofs. NULL: another model */
    struct {
        struct pal_adaptive_surface *adaptive;
        struct pal_subdivision_solid *solid; /* heap, freed by dofs.destroy */
        struct pal_spring_lattice *springs;  /* NULL also: springs without recovery from inversion */
    } model;

    /* ---- forces ---- */
    double *load; /* N, from CONTACT components and external_force, constant in a sub-step [n_node][3] */
    /* N/m, a diagonal bound of the stiffness of `load` that the solver takes implicitly: contact then needs no shorter
     * sub-steps. NULL: it does not. CONTACT components add, and `settle` (effect.h) takes from `load` what it cost
     * [n_node] */
    double *load_stiffness;
    double *external_force; /* N, lasting loads set by pal_world_load; NULL: none                    [n_node][3] */
    double *f;              /* N, load and the FORCE components                                      [n_node][3] */
    double *g;              /* N, A' f                                                               [n_dof][3]  */

    /* ---- geometry at rest, borrowed from the scene's prepared mesh; NULL: the model has none ---- */
    double length_scale_m;  /* diagonal of the box at rest, "S" in comments                                    */
    double edge_m;          /* typical edge of an element, "h" in comments                                     */
    double offset_m[3];     /* scene frame = body frame + offset_m; the scene frame is the first body's        */
    double full_corner_kg;  /* mass of a corner of a full voxel, or of a solid's mean cell; 0: another model   */
    double spring_young_Pa; /* E for which springs have their given constants; 0: the material's               */
    const pal_tets *tets;   /* its nodes are the body's first ones                                             */
    const pal_hexes *hexes; /* the same nodes as cubes                                                         */
    /* elements of model fem, for evaluation through shape functions; corners as in num/shape_functions.h
     * [n_element][n_corner] */
    const int32_t *element;
    int n_element, n_corner;
    const int8_t *own_corner; /* corner with PAL_OWN_CORNER_MASS of each tetrahedron, -1: none; NULL: equal parts */
    bool moment_fitting;      /* cut hexahedra have the weights of hexes; false: their inside is spread evenly */
    const struct pal_ground *ground; /* definition.h; NULL: none */
    const float *fill;          /* share of material in each element, or tetrahedron where element is NULL; NULL: 1 */
    pal_node_order *node_order; /* memory order of the nodes for kernels; NULL: none made        */
    struct pal_active_nodes *active_nodes; /* packed working arrays (active_nodes.h); NULL: none made       */

    /* ---- solver ---- */
    struct pal_team *team; /* threads that share the work of a step; NULL: the caller's alone              */
    bool implicit;         /* the solver takes stiffness implicitly: contact need not suit explicit steps            */
    bool wants_compliance; /* set by CONTACT components in make; the SOLVE component is made after all others       */
    const pal_compliance *compliance; /* NULL: none                                                                   */
    double dt_limit_s; /* largest stable sub-step; infinite when unconditional                                  */
    double load_cap_N; /* largest load on a node (pal_body_load_cap_N); larger ones are shortened               */

    /* ---- motion near rest ---- */
    double lowest_1_s;   /* lowest angular frequency of the supported body at rest, 1/s; 0: not known              */
    double lowest_error; /* relative, of lowest_1_s, by which it may be too high                                  */
    double damping_1_s;  /* drag over mass that acts, 1/s                                                          */

    /* ---- state and safeguards ---- */
    bool frozen;                  /* stopped (pal_body_stop): it no longer moves                                    */
    bool asleep;                  /* at rest: no component runs until something comes near (component sleep)        */
    bool stale;                   /* x has changed since the OUTPUT components ran                                  */
    pal_safeguards safeguards;    /* since the last reset                                              */
    char reason[PAL_REASON_TEXT]; /* one sentence while frozen, else empty                             */

    pal_display display;
} pal_body;

/* the k-th active dof; k of a body with interpolation, for dofs and for nodes */
static inline int pal_body_point(const pal_body *body, int k)
{
    return body->active ? body->active[k] : k;
}
/* nodes in use: for (k < pal_body_nodes(body)) i = pal_body_point(body, k) */
static inline int pal_body_nodes(const pal_body *body)
{
    return body->interpolation ? body->n_node : body->n_active;
}
/* load_cap_N of a body with this modulus: a node's E h^2 times PAL_LOAD_CAP_FACTOR */
static inline double pal_body_load_cap_N(const pal_body *body, double young_Pa)
{
    return PAL_LOAD_CAP_FACTOR * (body->spring_young_Pa > 0 ? body->spring_young_Pa : young_Pa) * body->edge_m *
           body->edge_m;
}
/* largest lasting load on a node, N: load_cap_N times its part of a full corner's mass, as a sliver is softer by as
 * much */
static inline double pal_body_node_load_cap_N(const pal_body *body, int node)
{
    double part = body->full_corner_kg > 0 ? body->node_mass_kg[node] / body->full_corner_kg : 1;
    return part < 1 ? part * body->load_cap_N : body->load_cap_N;
}
/* mobility of a node, 1/kg; 0: it is fixed or prescribed */
static inline double pal_body_inverse_mass_1_kg(const pal_body *body, int node)
{
    if (body->node_inverse_mass_1_kg) return body->node_inverse_mass_1_kg[node];
    return body->support[node] ? 0 : 1 / body->mass_kg[node];
}

/* time constant of the slowest mode of a body near rest, s: the larger of c / w1^2, which holds above critical damping
 * (c > 2 w1), and 1 / w1; 0: lowest_1_s is not known */
static inline double pal_body_return_s(const pal_body *body)
{
    if (!(body->lowest_1_s > 0)) return 0;
    const double creep_s = body->damping_1_s / (body->lowest_1_s * body->lowest_1_s), inverse_s = 1 / body->lowest_1_s;
    return creep_s > inverse_s ? creep_s : inverse_s;
}

/* arrays for n_node dofs without interpolation, all active, zeroed; MEMORY. [load] */
pal_err pal_body_allocate(pal_body *body, pal_arena *arena, int n_node);
/* arrays for the dofs and nodes of an interpolation, which is borrowed; MEMORY. [load] */
pal_err pal_body_allocate_interpolated(pal_body *body, pal_arena *arena, const pal_interpolation *rows);
/* d = A x and dv = A v after x and v were set; nothing without interpolation. [sim] */
void pal_body_update_nodes(pal_body *body);
/* adds the display offset to what is shown, after the OUTPUT components. [sim] */
void pal_body_add_display_offset(pal_body *body);
/* sums over the body. [sim] */
double pal_body_kinetic_J(const pal_body *body);
bool pal_body_finite(const pal_body *body); /* are x and v? */
/* volume at rest of an element with these nodes (box of 8 corners, else tetrahedron), and the share of its mass that a
 * corner takes. [load] [sim] */
double pal_body_element_volume_m3(const pal_body *body, const int32_t *corner);
static inline double pal_body_corner_share(int n_corner, int corner)
{
    return n_corner < 10 ? 1.0 / n_corner : corner < 4 ? 1.0 / 36 : 4.0 / 27;
}
/* share of a tetrahedron's mass at a corner, where own is the corner that it has for itself in its voxel, -1: none */
static inline double pal_body_tet_share(int own, int corner)
{
    return own < 0 ? 0.25 : corner == own ? PAL_OWN_CORNER_MASS : (1 - PAL_OWN_CORNER_MASS) / 3;
}
/* What each corner of element e (of the body's own, else a tetrahedron) has of the element's whole volume: its part of
 * the material. Cut hexahedra have the weights of their Gauss points. share [n_corner] [load, sim] */
void pal_body_corner_shares(const pal_body *body, int e, double *share);
/* Density of a body whose mass is lumped from elements, as the hook `measure` adds it: mass and filled volume of each
 * node. [sim] */
void pal_body_measure_density(const pal_body *body, double *mass_kg, double *volume_m3);
/* Freezes the body with one sentence as its reason; a frozen body keeps its first reason. dof: named in the sentence
 * together with the smallest element around it and its place at rest (scene frame, mm); -1: none. No heap. [sim] */
void pal_body_stop(pal_body *body, int dof, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* The same for the first position, velocity or force that is not finite; `otherwise` is the sentence when all are.
 * [sim] */
void pal_body_stop_bad(pal_body *body, const char *otherwise);
#endif
