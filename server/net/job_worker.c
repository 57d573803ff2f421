/* The worker thread: sleeps until there is a job to run or an object to free. */
#include "server/net/job_worker.h"

#include "server/base/thread.h"

#include <stdlib.h>

enum { RETIRED_MAX = 8 };

struct pal_job_worker {
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    void (*wake)(void *user);
    void *user;
    pal_job job;
    enum { IDLE, SUBMITTED, DONE } state;
    pal_retired retired[RETIRED_MAX];
    int n_retired;
    bool leaving;
};

static void make(pal_job *job)
{
    const pal_scene *scene = NULL;
    job->err = job->type->prepare(job, &scene);
    if (!job->err) job->err = pal_session_open_after(job->session, scene, &job->diag, &job->next);
    if (!job->err) job->err = pal_stream_open(job->next, job->error_m, &job->diag, &job->stream);
    if (!job->err) job->type->transfer(job);
    job->made_ns = pal_clock_now_ns(pal_session_clock(job->session));
}

static void clear(pal_retired *w)
{
    pal_stream_close(w->stream);
    pal_session_close(w->session);
    pal_sculpt_edit_free(w->edit);
    pal_configuration_switch_free(w->change);
    *w = (pal_retired){.stream = NULL};
}

static void *run(void *user)
{
    pal_job_worker *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->leaving || s->n_retired > 0) {
        if (s->n_retired > 0) {
            pal_retired w = s->retired[--s->n_retired];
            pthread_mutex_unlock(&s->lock);
            clear(&w);
            pthread_mutex_lock(&s->lock);
        } else if (s->state == SUBMITTED) {
            pthread_mutex_unlock(&s->lock);
            make(&s->job); /* no other thread uses it until it is done */
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
    s->wake = wake, s->user = user;
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    if (pal_thread_start(&s->thread, run, s)) {
        free(s);
        return PAL_ERR_MEMORY;
    }
    *out = s;
    return PAL_ERR_OK;
}

void pal_job_worker_close(pal_job_worker *s)
{
    if (!s) return;
    pthread_mutex_lock(&s->lock);
    s->leaving = true;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    pthread_join(s->thread, NULL);
    pal_job_free(&s->job);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->changed);
    free(s);
}

bool pal_job_worker_busy(pal_job_worker *s)
{
    pthread_mutex_lock(&s->lock);
    bool busy = s->state != IDLE;
    pthread_mutex_unlock(&s->lock);
    return busy;
}

void pal_job_worker_submit(pal_job_worker *worker, const pal_job *job)
{
    pthread_mutex_lock(&worker->lock);
    worker->job = *job;
    worker->state = SUBMITTED;
    pthread_cond_signal(&worker->changed);
    pthread_mutex_unlock(&worker->lock);
}

bool pal_job_worker_collect(pal_job_worker *worker, pal_job *out)
{
    pthread_mutex_lock(&worker->lock);
    bool done = worker->state == DONE;
    if (done) {
        *out = worker->job;
        worker->job = (pal_job){.err = PAL_ERR_OK};
        worker->state = IDLE;
    }
    pthread_mutex_unlock(&worker->lock);
    return done;
}

void pal_job_worker_retire(pal_job_worker *worker, const pal_retired *retired)
{
    pal_retired w = *retired;
    pthread_mutex_lock(&worker->lock);
    bool room = worker->n_retired < RETIRED_MAX;
    if (room) worker->retired[worker->n_retired++] = w;
    pthread_cond_signal(&worker->changed);
    pthread_mutex_unlock(&worker->lock);
    if (!room) clear(&w);
}

void pal_job_free(pal_job *job)
{
    pal_stream_close(job->stream);
    pal_session_close(job->next);
    pal_sculpt_edit_free(job->edit);
    pal_configuration_switch_free(job->change);
    free(job->scene);
    free(job->base);
    free(job->point_m);
    *job = (pal_job){.err = PAL_ERR_OK};
}
