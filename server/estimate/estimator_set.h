/* The estimators of a session: one per subscribed body (estimator.h), opened with the first subscriber and closed
 * after the last. Owned by the session. Without subscribers it is only a struct of counters. */
#ifndef PAL_ESTIMATE_ESTIMATOR_SET_H
#define PAL_ESTIMATE_ESTIMATOR_SET_H
#include "server/estimate/estimator.h"

#include <pthread.h>

typedef struct pal_estimator_set {
    const pal_scene *scene;
    const pal_clock *clock;
    /* owned by the simulation thread */
    uint32_t n_subscriber[PAL_BODY_MAX];
    bool leaving[PAL_BODY_MAX];
    bool refused[PAL_BODY_MAX]; /* could not be opened: retried when the next subscriber asks */
    bool busy;                  /* there is a subscriber or an estimator */
    /* Guards `estimator` between readers and the simulation, which only tries the lock and retries after the next
     * step. */
    pthread_mutex_t lock;
    pal_estimator *estimator[PAL_BODY_MAX];
} pal_estimator_set;

/* borrows scene and clock. [load] */
void pal_estimator_set_init(pal_estimator_set *set, const pal_scene *scene, const pal_clock *clock);
/* Adds or removes one subscriber of a body. The estimator opens or closes at the next pal_estimator_set_step. [sim] */
void pal_estimator_set_request(pal_estimator_set *set, int body, bool wanted);
/* Call between steps, also while paused; only tests `busy` if there are no subscribers. step_ms NaN: no step was
 * made. Never waits. True: an estimator could not be opened; diag gives the reason. [sim] */
bool pal_estimator_set_step(pal_estimator_set *set, const pal_world *world, double step_ms, pal_diagnostic *diag);
/* Copies the newest estimate of a body. False: no subscriber, or none yet. [any] */
bool pal_estimator_set_read(pal_estimator_set *set, int body, pal_estimate *out);
/* Moves the subscriptions of `from` to `to`; both simulation threads must be stopped. The estimators of `from` are
 * asked to end, without waiting. They reopen if its thread continues. */
void pal_estimator_set_transfer(pal_estimator_set *to, pal_estimator_set *from);
void pal_estimator_set_close(
    pal_estimator_set *set); /* waits for the estimators; the simulation thread must have ended. [load] */
#endif
