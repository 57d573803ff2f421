/* The computation of an estimator, without its thread: the parts of the error of one body in one state
 * (estimator.h). Allocates heap memory; every function is slow. Thread: one at a time. */
#ifndef PAL_ESTIMATE_ESTIMATION_H
#define PAL_ESTIMATE_ESTIMATION_H
#include "server/estimate/estimate.h"

typedef struct pal_estimation pal_estimation;
/* Makes meshes and worlds for one body of a scene. Borrows the scene. Errors: STATE: *stop was set (NULL: never
 * stops); REFUSED: no such body, or nothing can be estimated for it (diag: one sentence); MEMORY. */
pal_err pal_estimation_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_diagnostic *diag,
                            pal_estimation **out);
void pal_estimation_close(pal_estimation *work); /* accepts NULL */
pal_estimate_state *pal_estimation_state(pal_estimation *work);
/* Estimates the error of the state. False: stopped. */
bool pal_estimation_run(pal_estimation *work, pal_estimate *out);
#endif
