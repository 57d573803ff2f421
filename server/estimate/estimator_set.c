/* Estimators that open and close with their subscribers. */
#include "server/estimate/estimator_set.h"

#include <string.h>

void pal_estimator_set_init(pal_estimator_set *w, const pal_scene *scene, const pal_clock *clock)
{
    memset(w, 0, sizeof *w);
    w->scene = scene, w->clock = clock;
    pthread_mutex_init(&w->lock, NULL);
}

void pal_estimator_set_request(pal_estimator_set *w, int body, bool wanted)
{
    uint32_t *n = &w->n_subscriber[body];
    if (wanted) ++*n, w->refused[body] = false;
    if (!wanted && *n > 0) --*n;
    w->busy = true;
}

/* Opens and closes the estimator of a body as requested. True: an estimator exists or is wanted. */
static bool open_or_close(pal_estimator_set *w, int b, pal_diagnostic *diag, bool *failed)
{
    pal_estimator **e = &w->estimator[b];
    if (*e && w->leaving[b] && pal_estimator_has_stopped(*e)) {
        pal_estimator_close(*e);
        *e = NULL;
        w->leaving[b] = false;
    }
    if (*e && !w->leaving[b] && w->n_subscriber[b] == 0) {
        pal_estimator_request_stop(*e);
        w->leaving[b] = true;
    }
    if (!*e && w->n_subscriber[b] > 0 && !w->refused[b] && pal_estimator_open(w->scene, b, w->clock, diag, e))
        w->refused[b] = *failed = true;
    return *e != NULL || w->n_subscriber[b] > 0;
}

bool pal_estimator_set_step(pal_estimator_set *w, const pal_world *world, double step_ms, pal_diagnostic *diag)
{
    bool busy = false, failed = false;
    if (!w->busy || pthread_mutex_trylock(&w->lock)) return false;
    for (int b = 0; b < w->scene->n_body; b++) {
        busy = open_or_close(w, b, diag, &failed) || busy;
        if (w->estimator[b] && !w->leaving[b]) pal_estimator_observe(w->estimator[b], world, step_ms);
    }
    w->busy = busy;
    pthread_mutex_unlock(&w->lock);
    return failed;
}

bool pal_estimator_set_read(pal_estimator_set *w, int body, pal_estimate *out)
{
    if (body < 0 || body >= w->scene->n_body) return false;
    pthread_mutex_lock(&w->lock);
    bool there = w->estimator[body] && !w->leaving[body] && pal_estimator_read(w->estimator[body], out);
    pthread_mutex_unlock(&w->lock);
    return there;
}

void pal_estimator_set_transfer(pal_estimator_set *to, pal_estimator_set *from)
{
    pthread_mutex_lock(&from->lock);
    for (int b = 0; b < from->scene->n_body; b++) {
        if (from->estimator[b] && !from->leaving[b]) pal_estimator_request_stop(from->estimator[b]);
        from->leaving[b] = from->estimator[b] != NULL;
        if (b < to->scene->n_body) to->n_subscriber[b] = from->n_subscriber[b];
    }
    pthread_mutex_unlock(&from->lock);
    to->busy = true;
}

void pal_estimator_set_close(pal_estimator_set *w)
{
    for (int b = 0; b < w->scene->n_body; b++) pal_estimator_close(w->estimator[b]);
    pthread_mutex_destroy(&w->lock);
}
