/* A configuration: the method, resolution, step and tolerance of one body of a scene. What a study sweeps, what a
 * session switches to while it runs, what a scene is written with. Thread: [load] unless stated.
 *
 * Models that fit a body: with control cells, subdivision_fem and fem (on the voxels of the cells' boundary); a surface
 * without tetrahedra, adaptive_springs alone, since a hollow organ is another body than a full one; otherwise
 * tet_springs and fem. */
#ifndef PAL_SIM_CORE_CONFIGURATION_H
#define PAL_SIM_CORE_CONFIGURATION_H
#include "server/sim/core/definition.h"

enum { PAL_CONFIGURATION_TEXT = 120 };

typedef struct pal_configuration {
    char model[PAL_NAME];   /* "fem", "tet_springs", "adaptive_springs", "subdivision_fem"                     */
    char element[PAL_NAME]; /* fem: "hex8_bbar", "hex8", "tet4", "tet10"; "": the model's own choice;
                             * adaptive_springs: "refined": wholly on its finest level, "": it adapts             */
    char law[PAL_NAME];     /* fem: "corotational", "neo_hookean", "linear"; "": the model's own choice        */
    char solver[PAL_NAME];  /* "implicit_euler", "sdirk2", "verlet", "rk4", "central_cg"; "": the model's own  */
    int size;      /* voxels on the longest axis (fem, tet_springs), levels (the others; subdivision_fem: -1 for none);
                    * 0: as it is                                                                                      */
    double step_s; /* of the whole scene; 0: as it is                                                  */
    double tolerance; /* of an implicit solver's residual or of CG; 0: the solver's own                   */
    /* calibrated springs, weighted by volume (spring_law.h), for this size alone; k_distance_J 0: all from the
     * material; k_area_J 0: no area springs, -1: those from the material */
    double k_distance_J, k_area_J, k_volume_J;
} pal_configuration;

/* a configuration with its cost and error as a study measured them (study/study.h) */
typedef struct pal_measured_configuration {
    pal_configuration configuration;
    double ms; /* median time of a step of the studied scene under load on that machine; of a configuration with a step
                * of its own, of as many as make one step of the scene: ms below the scene's step is real time */
    double error_m;       /* largest distance from the reference in the study                */
    double force_percent; /* RMS error of the force felt in the study's press at 60 Hz and 50 ms; 0: not judged */
    bool front;           /* on the Pareto front: none is both cheaper and nearer            */
} pal_measured_configuration;

/* the present configuration of a body; size is that of the prepared mesh (0 when it was made elsewhere) */
void pal_configuration_of(const pal_scene *scene, int body, pal_configuration *out);
/* does the model fit the body? REFUSED with the reason in one sentence; so is a word that is no model */
pal_err pal_configuration_check_model(const pal_body_def *body, const char *model, pal_diagnostic *diag);
/* "fem hex8_bbar corotational, 16 voxels, implicit_euler, 16.7 ms": only what is given. Returns text. [any] */
const char *pal_configuration_text(const pal_configuration *configuration, char text[PAL_CONFIGURATION_TEXT]);
bool pal_configuration_equal(const pal_configuration *a, const pal_configuration *b); /* [any] */

/* a scene with one body in another configuration, and the mesh made for it */
typedef struct pal_configured_scene {
    pal_scene scene;   /* borrows what `from` borrows, but for `mesh` */
    pal_prepared mesh; /* of the changed body; n_node 0: it kept its own */
    int body;
} pal_configured_scene;
/* The part that a support of the kind `lowest` fixes, as a box, so that another mesh fixes the same part; false:
 * another kind, or `up` is along no axis */
bool pal_configuration_support_box(const pal_scene *scene, int body, int support, pal_support_def *out);
/* Makes the scene of a configuration. It keeps material, supports, regions, effects, tools and the keys of model and
 * solver that a configuration does not have. Voxels are prepared again from the body's shown surface when the size
 * differs, or when finite elements replace another model and there is no measured fill: cut voxels count by their
 * filled share (PAL_VOXEL_DROP_FILL), and the planes of the voxels pass through the border of the first support or
 * region that cuts the body. A support of the lowest part becomes a box. *out: heap, pal_configured_scene_free; borrows
 * from `from`, which outlives it. REFUSED: a model that does not fit the body, an unknown word, a size or number out of
 * range; BUDGET, MEMORY */
pal_err pal_configuration_make(const pal_scene *from, int body, const pal_configuration *to, pal_diagnostic *diag,
                               pal_configured_scene **out);
/* The voxels of a body whose cut voxels count by their filled share: those with less than PAL_VOXEL_DROP_FILL inside
 * are dropped where that keeps the volume, else those below PAL_FILL_MIN; sets voxel->min_fill. As pal_prepared_make */
pal_err pal_filled_voxels_make(const pal_surface *surface, pal_voxel_options *voxel, pal_prepared *out,
                               pal_prepare_report *report, pal_diagnostic *diag);
void pal_configured_scene_free(pal_configured_scene *scene); /* NULL is fine */
/* Estimate of the nodes that pal_configuration_make would make: of voxels from volume and area of the shown surface
 * (within 25 % from 8 voxels on), of tet10 7 times as many, of an adaptive surface 4 times its vertices a level. 0: the
 * mesh stays, or it has levels of control cells, which have a budget of their own */
double pal_configuration_estimate_nodes(const pal_scene *from, int body, const pal_configuration *to);

/* largest mesh that is made while sessions run, nodes: it keeps their memory bounded (tests/session) */
enum { PAL_CONFIGURATION_LIVE_NODES = 100000 };
/* The checks of pal_configuration_make that need no mesh, and REFUSED for a mesh of more than
 * PAL_CONFIGURATION_LIVE_NODES nodes. Asked before a configuration is offered to a running session. [any] */
pal_err pal_configuration_check_live(const pal_scene *scene, int body, const pal_configuration *to,
                                     pal_diagnostic *diag);
#endif
