/* Workers take the next piece from an atomic counter. A run is open from its call until the caller finds no more
 * pieces; a worker that wakes later does not enter it, so nobody waits for a thread that has no work. */
#include "server/base/team.h"

#include "server/base/subnormals.h"
#include "server/base/thread.h"

#include <errno.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <unistd.h>

/* looks of a thread that waits without sleeping, between two chances for others on its core: some ten microseconds */
enum { WATCHES = 512 };

typedef struct worker {
    pal_team *team;
    pthread_t thread;
    int number;
} worker;

struct pal_team {
    pthread_mutex_t lock;
    pthread_cond_t begun, left; /* workers wait for begun, the caller for left            */
    bool open, quit;
    _Atomic bool held;     /* workers watch for the next run instead of sleeping */
    _Atomic int n_inside;  /* workers at work on this run, without the caller        */
    _Atomic uint64_t run;  /* number of the run: a worker enters a run once */
    _Atomic int64_t next;  /* next piece; each worker increments it once past n */
    unsigned mode;         /* of the caller's numbers, which workers take over  */
    int n, size, n_thread; /* size = n_thread + 1                                    */
    void (*piece)(void *user, int worker, int index);
    void *user;
    worker worker[];
};

/* cores that this process may use; the set grows until it holds the mask of the system */
static int count_cores(void)
{
    for (int max = 1024; max <= 1 << 20; max *= 4) {
        cpu_set_t *set = CPU_ALLOC((size_t)max);
        if (!set) break;
        size_t byte = CPU_ALLOC_SIZE((size_t)max);
        CPU_ZERO_S(byte, set);
        bool known = sched_getaffinity(0, byte, set) == 0, small = !known && errno == EINVAL;
        int n = known ? CPU_COUNT_S(byte, set) : 0;
        CPU_FREE(set);
        if (n > 0) return n;
        if (!small) break;
    }
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > PAL_TEAM_MAX ? PAL_TEAM_MAX : (int)n;
}

static void work(pal_team *team, int number)
{
    for (;;) {
        int64_t i = atomic_fetch_add_explicit(&team->next, 1, memory_order_relaxed);
        if (i >= team->n) return;
        team->piece(team->user, number, (int)i);
    }
}

static inline void pause_core(void)
{
#ifdef __SSE2__
    __builtin_ia32_pause();
#endif
}

/* watches the team, outside the lock, which it leaves and takes again, while it is held and `run` is its last run */
static void watch(pal_team *team, uint64_t run)
{
    pthread_mutex_unlock(&team->lock);
    for (int k = 1; atomic_load(&team->held) && atomic_load(&team->run) == run; k++) {
        pause_core();
        if (k % WATCHES == 0) sched_yield();
    }
    pthread_mutex_lock(&team->lock);
}

static void *live(void *self)
{
    worker *w = self;
    pal_team *team = w->team;
    uint64_t seen = 0;
    pthread_mutex_lock(&team->lock);
    for (;;) {
        while (!team->quit && !(team->open && team->run != seen)) {
            if (!team->held) {
                pthread_cond_wait(&team->begun, &team->lock);
                continue;
            }
            seen = team->run; /* a run that ended before it was seen */
            watch(team, seen);
        }
        if (team->quit) break;
        seen = team->run;
        team->n_inside++;
        const unsigned mode = team->mode;
        pthread_mutex_unlock(&team->lock);
        pal_subnormals_restore(mode);
        work(team, w->number);
        pthread_mutex_lock(&team->lock);
        if (--team->n_inside == 0) pthread_cond_signal(&team->left);
    }
    pthread_mutex_unlock(&team->lock);
    return NULL;
}

pal_err pal_team_create(int n_worker, pal_team **out)
{
    int size = n_worker > 0 ? n_worker : count_cores();
    if (size > PAL_TEAM_MAX) size = PAL_TEAM_MAX;
    pal_team *team = calloc(1, sizeof *team + sizeof team->worker[0] * (size_t)(size - 1));
    if (!team) return PAL_ERR_MEMORY;
    pthread_mutex_init(&team->lock, NULL);
    pthread_cond_init(&team->begun, NULL);
    pthread_cond_init(&team->left, NULL);
    for (int i = 0; i < size - 1; i++) {
        team->worker[i] = (worker){.team = team, .number = i + 1};
        if (pal_thread_start(&team->worker[i].thread, live, &team->worker[i])) break;
        team->n_thread++;
    }
    team->size = team->n_thread + 1;
    if (size > 1 && team->n_thread == 0) {
        pal_team_destroy(team);
        return PAL_ERR_MEMORY;
    }
    *out = team;
    return PAL_ERR_OK;
}

void pal_team_destroy(pal_team *team)
{
    if (!team) return;
    pal_team_release(team);
    pthread_mutex_lock(&team->lock);
    team->quit = true;
    pthread_cond_broadcast(&team->begun);
    pthread_mutex_unlock(&team->lock);
    for (int i = 0; i < team->n_thread; i++) pthread_join(team->worker[i].thread, NULL);
    pthread_cond_destroy(&team->left);
    pthread_cond_destroy(&team->begun);
    pthread_mutex_destroy(&team->lock);
    free(team);
}

int pal_team_size(const pal_team *team)
{
    return team->size;
}

void pal_team_run(pal_team *team, int n, void (*piece)(void *user, int worker, int index), void *user)
{
    if (n <= 1 || !team || team->n_thread == 0) {
        for (int i = 0; i < n; i++) piece(user, 0, i);
        return;
    }
    pthread_mutex_lock(&team->lock);
    team->piece = piece;
    team->user = user;
    team->n = n;
    team->mode = pal_subnormals_mode();
    atomic_store_explicit(&team->next, 0, memory_order_relaxed);
    team->run++;
    team->open = true;
    if (n > team->n_thread)
        pthread_cond_broadcast(&team->begun);
    else
        for (int i = 0; i < n - 1; i++) pthread_cond_signal(&team->begun);
    pthread_mutex_unlock(&team->lock);
    work(team, 0);
    pthread_mutex_lock(&team->lock);
    team->open = false;
    while (team->n_inside > 0) {
        if (!team->held) {
            pthread_cond_wait(&team->left, &team->lock);
            continue;
        }
        pthread_mutex_unlock(&team->lock);
        for (int k = 1; atomic_load(&team->n_inside) > 0; k++) {
            pause_core();
            if (k % WATCHES == 0) sched_yield();
        }
        pthread_mutex_lock(&team->lock);
    }
    pthread_mutex_unlock(&team->lock);
}

void pal_team_hold(pal_team *team)
{
    if (!team || team->n_thread == 0) return;
    pthread_mutex_lock(&team->lock);
    team->held = true;
    pthread_cond_broadcast(&team->begun);
    pthread_mutex_unlock(&team->lock);
}

void pal_team_release(pal_team *team)
{
    if (team) atomic_store(&team->held, false);
}
