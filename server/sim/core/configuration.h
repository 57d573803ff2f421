/* A setting: one choice on the knobs of accuracy for one body of a scene: method, resolution, step, tolerance. What a
 * study sweeps, what a session switches to while it runs, what a scene is written with. Thread: [load] unless said.
 *
 * Which models fit a body: with control cells subdivision_fem and fem (on the voxels of the cells' boundary); a surface
 * without tetrahedra adaptive_springs alone (a hollow organ is another thing than a full one); else tet_springs and
 * fem. */
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
    /* calibrated springs, weighted by volume (spring_law.h), of this very size; k_distance_J 0: all from the material;
     * k_area_J 0: no such row, -1: that from the material as well */
    double k_distance_J, k_area_J, k_volume_J;
} pal_configuration;

/* a setting with what it costs and how far off it is, as a study found (lab/study.h) */
typedef struct pal_measured_configuration {
    pal_configuration setting;
    double ms;      /* what a step of the scene as it was studied takes under load, median, on that machine; a setting
                     * with a step of its own is priced by as many of them as go into that one: ms below the scene's
                     * step is real time for all */
    double error_m; /* largest distance from the reference that the study saw         */
    bool front;     /* nothing else is both cheaper and nearer                         */
} pal_measured_configuration;

/* the setting that a body of a scene has now; size is that of the prepared mesh (0 when it was made elsewhere) */
void pal_configuration_of(const pal_scene *scene, int body, pal_configuration *out);
/* does a body take a model? REFUSED (one sentence why), or a word that is no model */
pal_err pal_configuration_check_model(const pal_body_def *body, const char *model, pal_diagnostic *diag);
/* "fem hex8_bbar corotational, 16 voxels, implicit_euler, 16.7 ms": only what is given. Returns text. [any] */
const char *pal_configuration_text(const pal_configuration *setting, char text[PAL_CONFIGURATION_TEXT]);
bool pal_configuration_equal(const pal_configuration *a, const pal_configuration *b); /* [any] */

/* a scene with one body in another setting, and the mesh made for it */
typedef struct pal_configured_scene {
    pal_scene scene;   /* borrows what `from` borrows, but for `mesh` */
    pal_prepared mesh; /* of the changed body; n_node 0: it kept its own */
    int body;
} pal_configured_scene;
/* What a support of the kind `lowest` holds now as a box, so that another mesh holds the same part of the body; false:
 * it is of another kind, or up is along no axis */
bool pal_configuration_support_box(const pal_scene *scene, int body, int support, pal_support_def *out);
/* What pal_configuration_make refuses before it makes anything: a body that does not take it, an unknown word, a size
 * or number out of range. [any] */
pal_err pal_configuration_check(const pal_scene *from, int body, const pal_configuration *to, pal_diagnostic *diag);
/* Makes it: keeps material, supports, regions, effects, tools and the keys of model and solver that a setting does not
 * speak of; prepares voxels anew from the body's shown surface when the size differs, or when finite elements take
 * over from another model and find no measured fill. Cut voxels count by their filled share, those less than a quarter
 * full are dropped unless more than 2.5 % of the volume would go, and the voxels' planes go through the border of the
 * first support or region that cuts the body, as lab/load_case.h has it; a support of the lowest part becomes a box
 * there. *out heap, pal_configured_scene_free; borrows from `from`, which outlives it. REFUSED: a model that does not
 * fit the body (one sentence why), an unknown word, a size or number out of range; BUDGET, MEMORY
 */
pal_err pal_configuration_make(const pal_scene *from, int body, const pal_configuration *to, pal_diagnostic *diag,
                               pal_configured_scene **out);
void pal_configured_scene_free(pal_configured_scene *scene); /* NULL is fine */
/* About how many nodes the mesh would have that pal_configuration_make makes, before anything is made: of voxels from
 * volume and area of the shown surface (within 25 % from 8 voxels on), of tet10 7 times as many; of an adaptive surface
 * four times its vertices with each level. 0: it keeps the mesh that it has, or takes levels of cells, whose making has
 * a budget of its own */
double pal_configuration_estimate_nodes(const pal_scene *from, int body, const pal_configuration *to);

/* most nodes of a mesh that is made while sessions run, for the sake of their memory */
enum { PAL_CONFIGURATION_LIVE_NODES = 100000 };
/* What pal_configuration_switch_prepare refuses before it makes anything: pal_configuration_check, and a mesh of more
 * than PAL_CONFIGURATION_LIVE_NODES nodes (pal_configuration_estimate_nodes). Who offers a setting asks this first.
 * [any] */
pal_err pal_configuration_check_live(const pal_scene *scene, int body, const pal_configuration *to,
                                     pal_diagnostic *diag);
#endif
