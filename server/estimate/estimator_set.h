/* The estimators of a session: one per body that somebody looks at (estimator.h), opened with the first who looks and
 * gone with the last. The session owns it; a struct of counts while nobody looks. */
#ifndef PAL_ESTIMATE_ESTIMATOR_SET_H
#define PAL_ESTIMATE_ESTIMATOR_SET_H
#include "server/estimate/estimator.h"

#include <pthread.h>

typedef struct pal_estimator_set {
    const pal_scene *scene;
    /* the simulation thread's */
    uint32_t n_look[PAL_BODY_MAX];
    bool leaving[PAL_BODY_MAX];
    bool refused[PAL_BODY_MAX]; /* could not be opened: not tried again until the next one asks */
    bool busy;                  /* somebody looks or an estimator is there */
    /* readers and the simulation meet here; it only tries the lock and comes again after the next step */
    pthread_mutex_t lock;
    pal_estimator *estimator[PAL_BODY_MAX];
} pal_estimator_set;

void pal_estimator_set_init(pal_estimator_set *watch, const pal_scene *scene); /* [load] */
/* one more or one less who looks at a body; the estimator comes and goes with the next pal_estimator_set_step. [sim] */
void pal_estimator_set_request(pal_estimator_set *watch, int body, bool wanted);
/* between steps, also while paused; nothing but a look at `busy` while nobody looks. step_ms: NaN: no step was made.
 * Never waits; true: an estimator could not be opened, note says why. [sim] */
bool pal_estimator_set_step(pal_estimator_set *watch, const pal_world *world, double step_ms, pal_diagnostic *diag);
/* newest estimate of a body; false: nobody looks, or there is none yet. Copies. [any] */
bool pal_estimator_set_read(pal_estimator_set *watch, int body, pal_estimate *out);
/* who looks at `from` looks at `to` from now on; both threads stand. The estimators of `from` end without being waited
 * for and come again if its thread goes on */
void pal_estimator_set_transfer(pal_estimator_set *to, pal_estimator_set *from);
void pal_estimator_set_close(
    pal_estimator_set *watch); /* waits for what is there; the simulation thread has ended. [load] */
#endif
