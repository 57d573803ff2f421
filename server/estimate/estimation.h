/* What an estimator computes, without its thread: the parts of the error of one body in one state (estimator.h). Heap
 * memory; everything here is slow. Thread: one at a time. */
#ifndef PAL_ESTIMATE_ESTIMATION_H
#define PAL_ESTIMATE_ESTIMATION_H
#include "server/estimate/display_error.h"
#include "server/estimate/estimate_cost_model.h"
#include "server/estimate/estimate_hierarchy.h"

#include <stdatomic.h>

typedef struct pal_estimation pal_estimation;
/* meshes and worlds for one body of a scene, which is borrowed; ends early with STATE when *stop is set (NULL: never).
 * REFUSED: no such body, or one of which nothing can be estimated (one sentence); MEMORY */
pal_err pal_estimation_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_diagnostic *diag,
                            pal_estimation **out);
void pal_estimation_close(pal_estimation *work); /* NULL is fine */
pal_estimate_state *pal_estimation_state(pal_estimation *work);
/* estimates the state; false: it was stopped */
bool pal_estimation_run(pal_estimation *work, pal_estimate *out);

/* ---- private to estimation.c and estimation_setup.c ---- */

/* tolerance of the solver that leaves next to nothing */
static const double pal_estimate_tight = 1e-9;
/* of displacements at nodes: 1.2 to 2.1 is observed (tests/accuracy/test_effectivity.c). Taken for anything from 1 to 2
 * the first is off by a factor of 0.55 to 1.64; the order that three meshes tell was farther off, as the coarsest is
 * four times as coarse as a live one. Where changes still grow from mesh to mesh (few voxels across, most of them cut)
 * there is no order yet: the first left 0.2 of the truth there, the second half of it to twice as much */
static const double pal_usual_order = 1.5, pal_early_order = 1;

struct pal_estimation {
    const _Atomic bool *stop;
    pal_scene *scene; /* the body alone, without tools and what is shown */
    pal_scene *exact_scene;
    pal_estimate_state state;
    pal_world *live;        /* as it runs                                                     */
    pal_world *exact;       /* the same with a solver that leaves next to nothing; NULL: it solves nothing */
    double *first, *second; /* [n_dof][3] */
    /* springs: voxels that finite elements may stand on; n_hex 0: those of the scene's mesh */
    pal_prepared voxels;
    bool springs, locks;
    bool cut, thin;                                  /* many voxels are cut; there are two across, or one */
    bool skinned;                                    /* what is shown hangs on nodes */
    pal_rest_solution fine, coarse, coarsest, model; /* world NULL: there is none */
    pal_display_error shown;                         /* n 0: nothing is, or nodes are */
    pal_prediction prediction;
    pal_estimate_hierarchy family; /* of cut voxels */
    bool measured;                 /* what more nodes cost has been measured, or cannot be */
    double awake_ms;               /* of a step of a body that was never seen awake; 0: not measured yet */
    char diag[160];
};

static inline bool pal_estimate_stopped(const pal_estimation *w)
{
    return w->stop && atomic_load_explicit(w->stop, memory_order_acquire);
}
/* a key of the model, a text; otherwise: where the scene does not give it */
const char *pal_estimate_model_text(const pal_body_def *def, const char *key, const char *otherwise);
#endif
