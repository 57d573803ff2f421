/* The computation of an estimator, without its thread: the parts of the error of one body in one state
 * (estimator.h). Allocates heap memory; every function is slow. Thread: one at a time. */
#ifndef PAL_ESTIMATE_ESTIMATION_H
#define PAL_ESTIMATE_ESTIMATION_H
#include "server/estimate/display_error.h"
#include "server/estimate/estimate_cost_model.h"
#include "server/estimate/estimate_hierarchy.h"
#include "server/estimate/tuning.h"

#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

typedef struct pal_estimation pal_estimation;
/* Makes meshes and worlds for one body of a scene. Borrows the scene. Errors: STATE: *stop was set (NULL: never
 * stops); REFUSED: no such body, or nothing can be estimated for it (diag: one sentence); MEMORY. */
pal_err pal_estimation_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_diagnostic *diag,
                            pal_estimation **out);
void pal_estimation_close(pal_estimation *work); /* accepts NULL */
pal_estimate_state *pal_estimation_state(pal_estimation *work);
/* Estimates the error of the state. False: stopped. */
bool pal_estimation_run(pal_estimation *work, pal_estimate *out);

/* ---- private to estimation.c and estimation_setup.c ---- */

struct pal_estimation {
    const _Atomic bool *stop;
    pal_scene *scene; /* the body alone, without tools and display */
    pal_scene *exact_scene;
    pal_estimate_state state;
    pal_world *live;        /* the body as it runs */
    pal_world *exact;       /* the same with PAL_TOLERANCE_EXACT; NULL: its method solves no system */
    double *first, *second; /* [n_dof][3] */
    /* springs: voxels for finite elements; n_hex 0: use those of the scene's mesh */
    pal_prepared voxels;
    bool springs, locks;
    bool cut, thin;                                  /* many voxels are cut; the body is one or two voxels across */
    bool skinned;                                    /* a skin displays the body */
    pal_rest_solution fine, coarse, coarsest, model; /* world NULL: absent */
    pal_display_error shown;                         /* n 0: no displayed vertices, or nodes are used */
    pal_prediction prediction;
    pal_estimate_hierarchy family; /* for cut voxels */
    bool measured;                 /* the cost of more nodes is measured, or cannot be */
    double awake_ms;               /* time of a step of a body never seen awake; 0: not measured yet */
    char diag[160];
};

/* appends a clause to a diagnostic */
static inline void pal_estimate_remark(char diag[160], const char *text)
{
    size_t n = strlen(diag);
    snprintf(diag + n, 160 - n, "%s%s", n > 0 ? "; " : "", text);
}
static inline bool pal_estimate_stopped(const pal_estimation *w)
{
    return w->stop && atomic_load_explicit(w->stop, memory_order_acquire);
}
/* Text value of a model key, or `otherwise` if the scene does not set it. */
const char *pal_estimate_model_text(const pal_body_def *def, const char *key, const char *otherwise);
#endif
