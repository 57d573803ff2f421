/* The workshop's thread: sleeps until there is something to clear or to make. */
#include "server/net/workshop.h"

#include "server/base/clock.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>

enum { MOST_CLEAR = 8 };

struct pal_workshop {
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    void (*wake)(void *user);
    void *user;
    pal_work work;
    enum { IDLE, GIVEN, DONE } state;
    pal_waste waste[MOST_CLEAR];
    int n_waste;
    bool leaving;
};

static void make(pal_work *w)
{
    if (w->kind == PAL_WORK_SWITCH)
        w->err = pal_switch_prepare(w->scene, w->was, w->body, &w->setting, &w->diag, &w->change);
    else
        w->err = pal_sculptor_prepare(w->sculptor, w->scene, &w->command, &w->diag, &w->turn);
    if (!w->err) {
        const pal_scene *scene = w->change ? pal_switch_scene(w->change) : pal_sculpt_scene(w->turn);
        w->err = pal_session_open_after(w->session, scene, &w->diag, &w->next);
    }
    if (!w->err) w->err = pal_stream_open(w->next, w->error_m, &w->diag, &w->stream);
    if (!w->err && w->change) {
        pal_session_rehearse(w->next, w->session, pal_switch_look, pal_switch_rehearse, w->change);
        pal_session_carry_over(w->next, w->session, pal_switch_carry, w->change);
        pal_switch_report_of(w->change, &w->report);
    } else if (!w->err) {
        pal_session_carry_over(w->next, w->session, pal_sculpt_carry, w->turn);
    }
    w->made_ns = pal_clock_ns();
}

static void clear(pal_waste *w)
{
    pal_stream_close(w->stream);
    pal_session_close(w->session);
    pal_sculpt_free(w->turn);
    pal_switch_free(w->change);
    *w = (pal_waste){.stream = NULL};
}

static void *work(void *user)
{
    pal_workshop *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->leaving || s->n_waste > 0) {
        if (s->n_waste > 0) {
            pal_waste w = s->waste[--s->n_waste];
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

pal_err pal_workshop_open(void (*wake)(void *user), void *user, pal_workshop **out)
{
    pal_workshop *s = calloc(1, sizeof *s);
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

void pal_workshop_close(pal_workshop *workshop)
{
    pal_workshop *s = workshop;
    if (!s) return;
    pthread_mutex_lock(&s->lock);
    s->leaving = true;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    pthread_join(s->thread, NULL);
    pal_work_free(&s->work);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->changed);
    free(s);
}

bool pal_workshop_busy(const pal_workshop *workshop)
{
    pal_workshop *s = (pal_workshop *)(uintptr_t)workshop;
    pthread_mutex_lock(&s->lock);
    bool busy = s->state != IDLE;
    pthread_mutex_unlock(&s->lock);
    return busy;
}

void pal_workshop_give(pal_workshop *workshop, const pal_work *work)
{
    pthread_mutex_lock(&workshop->lock);
    workshop->work = *work;
    workshop->state = GIVEN;
    pthread_cond_signal(&workshop->changed);
    pthread_mutex_unlock(&workshop->lock);
}

bool pal_workshop_take(pal_workshop *workshop, pal_work *out)
{
    pthread_mutex_lock(&workshop->lock);
    bool done = workshop->state == DONE;
    if (done) {
        *out = workshop->work;
        workshop->work = (pal_work){.err = PAL_ERR_OK};
        workshop->state = IDLE;
    }
    pthread_mutex_unlock(&workshop->lock);
    return done;
}

void pal_workshop_clear(pal_workshop *workshop, const pal_waste *waste)
{
    pal_waste w = *waste;
    pthread_mutex_lock(&workshop->lock);
    bool room = workshop->n_waste < MOST_CLEAR;
    if (room) workshop->waste[workshop->n_waste++] = w;
    pthread_cond_signal(&workshop->changed);
    pthread_mutex_unlock(&workshop->lock);
    if (!room) clear(&w);
}

void pal_work_free(pal_work *work)
{
    pal_stream_close(work->stream);
    pal_session_close(work->next);
    pal_sculpt_free(work->turn);
    pal_switch_free(work->change);
    free(work->scene);
    free(work->base);
    free(work->point_m);
    *work = (pal_work){.err = PAL_ERR_OK};
}
