/* The estimator's thread and its two exchanges. A state goes in when the thread is idle and a quarter of a second
 * has passed. An estimate comes out under a lock that the simulation never takes.
 *
 * The thread owns the state while `owner` is BUSY, the simulation while it is FREE. The owner passes it on, so
 * neither waits. */
#include "server/estimate/estimator.h"

#include "server/base/thread.h"
#include "server/estimate/estimation.h"
#include "server/estimate/tuning.h"

#include <math.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { BUSY, FREE };
static const int niceness = 10; /* the simulation has priority */

static _Atomic int n_thread;
static _Atomic uint64_t n_made;

struct pal_estimator {
    const pal_scene *scene;
    const pal_clock *clock;
    int body;
    pthread_t thread;
    sem_t wake;
    _Atomic bool stop, gone;
    _Atomic int owner;
    pal_estimation *work;      /* owned by the thread */
    pal_estimate_state *state; /* of work; `owner` gives its owner */
    pthread_mutex_t lock;
    pal_estimate newest; /* tick 0: none yet */
    bool there, refused;
    unsigned newest_life; /* `life` of the body at that time; refused: any */
    /* how often the body was frozen and reset: odd while frozen */
    _Atomic unsigned life;
    _Atomic uint64_t frozen_tick;
    unsigned copied_life;     /* `life` of the state; owned with the state */
    uint64_t copied_awake;    /* n_awake of the state; owned with the state */
    uint64_t newest_awake;    /* of newest; guarded by the lock */
    _Atomic uint64_t n_awake; /* steps in which the body was awake: these age an estimate */
    /* owned by the simulation thread */
    uint64_t copied_ns, copied_tick;
    pal_estimate_cost cost[PAL_ESTIMATE_STEPS];
    uint64_t n_cost;
    double step_s;
    bool slept; /* copied since it fell asleep */
};

static void publish(pal_estimator *e, const pal_estimate *estimate, bool refused)
{
    pthread_mutex_lock(&e->lock);
    e->newest = *estimate;
    e->there = true, e->refused = refused;
    e->newest_life = e->copied_life;
    e->newest_awake = e->copied_awake;
    pthread_mutex_unlock(&e->lock);
    atomic_fetch_add_explicit(&n_made, 1, memory_order_relaxed);
    pal_clock_wake(e->clock);
}

/* an estimate with all values unknown, and the reason */
static pal_estimate nothing(const char *reason)
{
    pal_estimate none = pal_estimate_unknown();
    snprintf(none.diag, sizeof none.diag, "%.159s", reason);
    return none;
}

static bool wait_state(pal_estimator *e)
{
    atomic_store_explicit(&e->owner, FREE, memory_order_release);
    pal_clock_wake(e->clock);
    while (!atomic_load_explicit(&e->stop, memory_order_acquire)) {
        if (atomic_load_explicit(&e->owner, memory_order_acquire) == BUSY) return true;
        while (sem_wait(&e->wake)) continue;
    }
    return false;
}

static void *estimate(void *user)
{
    pal_estimator *e = user;
    pal_diagnostic diag = {""};
    (void)setpriority(PRIO_PROCESS, (id_t)syscall(SYS_gettid), niceness);
    pal_err err = pal_estimation_open(e->scene, e->body, &e->stop, &diag, &e->work);
    if (!err) e->state = pal_estimation_state(e->work);
    if (err && err != PAL_ERR_STATE) {
        pal_estimate none = nothing(diag.text);
        publish(e, &none, true);
    }
    while (!err && wait_state(e)) {
        pal_estimate out;
        uint64_t before = pal_clock_thread_ns();
        bool whole = pal_estimation_run(e->work, &out);
        out.estimate_ms = 1e-6 * (double)(pal_clock_thread_ns() - before);
        if (whole) publish(e, &out, false);
    }
    pal_estimation_close(e->work);
    e->work = NULL;
    atomic_fetch_sub_explicit(&n_thread, 1, memory_order_relaxed);
    atomic_store_explicit(&e->gone, true, memory_order_release);
    pal_clock_wake(e->clock);
    return NULL;
}

static void release(pal_estimator *e)
{
    sem_destroy(&e->wake);
    pthread_mutex_destroy(&e->lock);
    free(e);
}

pal_err pal_estimator_open(const pal_scene *scene, int body, const pal_clock *clock, pal_diagnostic *diag,
                           pal_estimator **out)
{
    if (body < 0 || body >= scene->n_body)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body %d does not exist: the scene has %d", body,
                                  scene->n_body);
    pal_estimator *e = calloc(1, sizeof *e);
    if (!e) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for an estimator");
    e->scene = scene, e->body = body, e->step_s = scene->step_s;
    e->clock = clock ? clock : &pal_clock_monotonic;
    pthread_mutex_init(&e->lock, NULL);
    sem_init(&e->wake, 0, 0);
    atomic_fetch_add_explicit(&n_thread, 1, memory_order_relaxed);
    if (pal_thread_start(&e->thread, estimate, e)) {
        atomic_fetch_sub_explicit(&n_thread, 1, memory_order_relaxed);
        release(e);
        return pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "the estimator's thread cannot be started");
    }
    *out = e;
    return PAL_ERR_OK;
}

void pal_estimator_request_stop(pal_estimator *e)
{
    atomic_store_explicit(&e->stop, true, memory_order_release);
    sem_post(&e->wake);
}

bool pal_estimator_has_stopped(const pal_estimator *e)
{
    return atomic_load_explicit(&e->gone, memory_order_acquire);
}

void pal_estimator_close(pal_estimator *e)
{
    if (!e) return;
    pal_estimator_request_stop(e);
    pthread_join(e->thread, NULL);
    release(e);
}

static uint64_t n_awake(const pal_estimator *e)
{
    return atomic_load_explicit(&e->n_awake, memory_order_relaxed);
}

/* copies the times of the last second's steps */
static void copy_costs(const pal_estimator *e, pal_estimate_state *to)
{
    uint64_t n = e->n_cost < PAL_ESTIMATE_STEPS ? e->n_cost : PAL_ESTIMATE_STEPS;
    double second = e->step_s > 0 ? ceil(1 / e->step_s) : 1;
    to->n_cost = second < (double)n ? (int)second : (int)n;
    for (int i = 0; i < to->n_cost; i++) to->cost[i] = e->cost[(e->n_cost - 1 - (uint64_t)i) % PAL_ESTIMATE_STEPS];
}

/* A frozen body invalidates what was known; after a reset it counts as a new one. */
static void note_frozen(pal_estimator *e, const pal_world *world, bool frozen)
{
    unsigned life = atomic_load_explicit(&e->life, memory_order_relaxed);
    if ((life % 2 == 1) == frozen) return;
    if (frozen) atomic_store_explicit(&e->frozen_tick, pal_world_tick(world), memory_order_relaxed);
    atomic_store_explicit(&e->life, life + 1, memory_order_release);
}

void pal_estimator_observe(pal_estimator *e, const pal_world *world, double step_ms)
{
    const pal_body *body = pal_world_view_body(world, e->body);
    note_frozen(e, world, body->frozen);
    if (!isnan(step_ms) && !body->asleep) {
        e->cost[e->n_cost++ % PAL_ESTIMATE_STEPS] = pal_estimate_cost_of(world, e->body, step_ms);
        atomic_fetch_add_explicit(&e->n_awake, 1, memory_order_relaxed);
    }
    if (!body->asleep) e->slept = false;
    if (e->slept || atomic_load_explicit(&e->owner, memory_order_acquire) != FREE) return;
    uint64_t now = pal_clock_now_ns(e->clock), tick = pal_world_tick(world);
    /* unchanged since the last copy */
    if (e->copied_ns && tick == e->copied_tick && isnan(step_ms)) return;
    if (e->copied_ns && now - e->copied_ns < PAL_ESTIMATE_PERIOD_NS) return;
    if (!pal_estimate_copy(e->state, world, e->body)) return;
    e->copied_ns = now, e->copied_tick = tick;
    e->slept = body->asleep;
    e->copied_life = atomic_load_explicit(&e->life, memory_order_relaxed);
    e->copied_awake = n_awake(e);
    copy_costs(e, e->state);
    atomic_store_explicit(&e->owner, BUSY, memory_order_release);
    sem_post(&e->wake);
}

/* n_step: awake steps since the state was copied */
static void grow_old(pal_estimate *e, uint64_t n_step, double step_s)
{
    e->age_s = (double)n_step * step_s;
    if (!e->asleep || n_step == 0) return;
    char *summary = strstr(e->diag, PAL_ESTIMATE_ASLEEP);
    if (!summary) return;
    const char *rest = summary + strlen(PAL_ESTIMATE_ASLEEP);
    rest += 2 * !strncmp(rest, "; ", 2);
    memmove(summary, rest, strlen(rest) + 1);
    size_t n = strlen(e->diag);
    if (n > 1 && !strcmp(e->diag + n - 2, "; ")) e->diag[n - 2] = 0;
}

bool pal_estimator_read(pal_estimator *e, pal_estimate *out)
{
    unsigned life = atomic_load_explicit(&e->life, memory_order_acquire);
    pthread_mutex_lock(&e->lock);
    bool there = e->there && (e->refused || e->newest_life == life), frozen = life % 2 == 1;
    if (there) *out = e->newest;
    uint64_t since = e->refused ? n_awake(e) : e->newest_awake;
    pthread_mutex_unlock(&e->lock);
    if (there) grow_old(out, n_awake(e) - since, e->step_s);
    if (there || !frozen) return there;
    *out = nothing("the body is frozen: nothing is known of it until it is reset");
    out->tick = atomic_load_explicit(&e->frozen_tick, memory_order_relaxed);
    return true;
}

int pal_estimator_threads(void)
{
    return atomic_load_explicit(&n_thread, memory_order_relaxed);
}

uint64_t pal_estimator_count(void)
{
    return atomic_load_explicit(&n_made, memory_order_relaxed);
}
