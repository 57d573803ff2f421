/* The workshop's thread: sleeps until there is something to clear or to make. */
#include "server/net/job_worker.h"

#include "server/base/clock.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>

enum { MOST_CLEAR = 8 };

struct pal_job_worker {
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    void (*wake)(void *user);
    void *user;
    pal_job work;
    enum { IDLE, GIVEN, DONE } state;
    pal_retired retired[MOST_CLEAR];
    int n_waste;
    bool leaving;
};

static void make(pal_job *w)
{
    if (w->kind == PAL_JOB_SWITCH)
        w->err = pal_configuration_switch_prepare(w->scene, w->was, w->body, &w->setting, &w->diag, &w->change);
    else
        w->err = pal_sculptor_prepare(w->sculptor, w->scene, &w->command, &w->diag, &w->turn);
    if (!w->err) {
        const pal_scene *scene = w->change ? pal_configuration_switch_scene(w->change) : pal_sculpt_edit_scene(w->turn);
        w->err = pal_session_open_after(w->session, scene, &w->diag, &w->next);
    }
    if (!w->err) w->err = pal_stream_open(w->next, w->error_m, &w->diag, &w->stream);
    if (!w->err && w->change) {
        pal_session_rehearse(w->next, w->session, pal_configuration_switch_snapshot, pal_configuration_switch_rehearse,
                             w->change);
        pal_session_transfer_begin(w->next, w->session, pal_configuration_switch_transfer, w->change);
        pal_configuration_switch_get_report(w->change, &w->report);
    } else if (!w->err) {
        pal_session_transfer_begin(w->next, w->session, pal_sculpt_transfer, w->turn);
    }
    w->made_ns = pal_clock_ns();
}

static void clear(pal_retired *w)
{
    pal_stream_close(w->stream);
    pal_session_close(w->session);
    pal_sculpt_edit_free(w->turn);
    pal_configuration_switch_free(w->change);
    *w = (pal_retired){.stream = NULL};
}

static void *work(void *user)
{
    pal_job_worker *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->leaving || s->n_waste > 0) {
        if (s->n_waste > 0) {
            pal_retired w = s->retired[--s->n_waste];
            pthread_mutex_unlock(&s->lock);
            clear(&w);
            pthread_mutex_lock(&s->lock);
        } else if (s->state == GIVEN) {
            pthread_mutex_unlock(&s->lock);
            make(&s->work); /* nobody else looks at it until it is done */
            pthread_mutex_lock(&s->lock);
            s->state = DONE;
            s->wake(s->user);
        } else {
            pthread_cond_wait(&s->changed, &s->lock);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

pal_err pal_job_worker_open(void (*wake)(void *user), void *user, pal_job_worker **out)
{
    pal_job_worker *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    sigset_t all, old;
    s->wake = wake, s->user = user;
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    /* signals belong to the thread that waits for them */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    int failed = pthread_create(&s->thread, NULL, work, s);
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    if (failed) {
        free(s);
        return PAL_ERR_MEMORY;
    }
    *out = s;
    return PAL_ERR_OK;
}

void pal_job_worker_close(pal_job_worker *job_worker)
{
    pal_job_worker *s = job_worker;
    if (!s) return;
    pthread_mutex_lock(&s->lock);
    s->leaving = true;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    pthread_join(s->thread, NULL);
    pal_job_free(&s->work);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->changed);
    free(s);
}

bool pal_job_worker_busy(const pal_job_worker *job_worker)
{
    pal_job_worker *s = (pal_job_worker *)(uintptr_t)job_worker;
    pthread_mutex_lock(&s->lock);
    bool busy = s->state != IDLE;
    pthread_mutex_unlock(&s->lock);
    return busy;
}

void pal_job_worker_submit(pal_job_worker *job_worker, const pal_job *work)
{
    pthread_mutex_lock(&job_worker->lock);
    job_worker->work = *work;
    job_worker->state = GIVEN;
    pthread_cond_signal(&job_worker->changed);
    pthread_mutex_unlock(&job_worker->lock);
}

bool pal_job_worker_collect(pal_job_worker *job_worker, pal_job *out)
{
    pthread_mutex_lock(&job_worker->lock);
    bool done = job_worker->state == DONE;
    if (done) {
        *out = job_worker->work;
        job_worker->work = (pal_job){.err = PAL_ERR_OK};
        job_worker->state = IDLE;
    }
    pthread_mutex_unlock(&job_worker->lock);
    return done;
}

void pal_job_worker_retire(pal_job_worker *job_worker, const pal_retired *retired)
{
    pal_retired w = *retired;
    pthread_mutex_lock(&job_worker->lock);
    bool room = job_worker->n_waste < MOST_CLEAR;
    if (room) job_worker->retired[job_worker->n_waste++] = w;
    pthread_cond_signal(&job_worker->changed);
    pthread_mutex_unlock(&job_worker->lock);
    if (!room) clear(&w);
}

void pal_job_free(pal_job *work)
{
    pal_stream_close(work->stream);
    pal_session_close(work->next);
    pal_sculpt_edit_free(work->turn);
    pal_configuration_switch_free(work->change);
    free(work->scene);
    free(work->base);
    free(work->point_m);
    *work = (pal_job){.err = PAL_ERR_OK};
}
