/* Workers take pieces from an atomic word that names its run as well, without a lock: a worker that comes late, to a
 * run without pieces or to the next one, sees by the name what it has got. A run ends when all its pieces are done, so
 * nobody waits for a thread that has none. The lock is for sleep alone.
 *
 * Where a held team has a worker for each piece, piece i is worker i's, run after run, so that the memory of a piece
 * stays in the caches of one core (`palpate bench adaptive`: steps of surfaces are a tenth faster). The caller takes
 * over the pieces of workers that do not come.
 */
#include "server/base/team.h"

#include "server/base/clock.h"
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
/* most looks of the caller for workers that have not yet taken their pieces, as one may just be giving others a chance;
 * fewer after each time that one did not come, since its core may be another program's */
enum { MAX_LOOKS = 512 };
/* pieces of a run of which each is one worker's, at most; and the mark of such a run in `span` */
enum { MAX_OWN = 31 };
static const uint32_t OWN = (uint32_t)1 << 31;

typedef struct worker {
    pal_team *team;
    pthread_t thread;
    int number;
} worker;

struct pal_team {
    pthread_mutex_t lock;
    pthread_cond_t begun, left; /* sleeping workers wait for begun, the sleeping caller for left */
    bool quit;                  /* under the lock */
    _Atomic bool held;          /* workers watch for the next run instead of sleeping, and the caller for its end */
    _Atomic uint64_t next;      /* run << 32, plus its next piece, or the bits of those taken in a run marked OWN */
    _Atomic uint64_t span;      /* run << 32, plus the number of its pieces and OWN: written before `next` */
    _Atomic int n_done;         /* pieces of this run */
    /* of a run, for who has got a piece of it */
    unsigned mode; /* of the caller's numbers, which workers take over */
    void (*piece)(void *user, int worker, int index);
    void *user;
    int size, n_thread; /* size = n_thread + 1 */
    int looks;          /* of the caller for workers that have not come, at most */
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

static inline void pause_core(void)
{
#ifdef __SSE2__
    __builtin_ia32_pause();
#endif
}

/* takes a piece of the present run, the worker's own of a run marked OWN; -1: there is none. span: of that run. Returns
 * the run in *run: `next` is read first, so that a run that begins meanwhile is not taken for one that was seen */
static int take(pal_team *team, int number, uint64_t *run, uint64_t *span)
{
    uint64_t at = atomic_load(&team->next), to;
    int piece;
    do {
        *run = at >> 32;
        *span = atomic_load(&team->span);
        const bool own = (uint32_t)*span & OWN;
        piece = own ? number : (int)(uint32_t)at;
        if (*run != *span >> 32 || (uint32_t)piece >= ((uint32_t)*span & ~OWN) || (own && at >> piece & 1)) return -1;
        to = own ? at | (uint64_t)1 << piece : at + 1;
    } while (!atomic_compare_exchange_weak(&team->next, &at, to));
    return piece;
}

/* counts pieces that were done. Who does the last one wakes a caller that sleeps; it may be gone, or have begun the
 * next run, by then */
static void count_done(pal_team *team, int n, int n_done)
{
    if (n_done == 0 || atomic_fetch_add(&team->n_done, n_done) + n_done < n || atomic_load(&team->held)) return;
    pthread_mutex_lock(&team->lock);
    pthread_cond_signal(&team->left);
    pthread_mutex_unlock(&team->lock);
}

/* does pieces until there are none; returns the run that had none left */
static uint64_t work(pal_team *team, int number)
{
    uint64_t run, span;
    int n_done = 0, n = 0;
    for (int piece; (piece = take(team, number, &run, &span)) >= 0; n_done++) {
        if (number > 0 && n_done == 0) pal_subnormals_restore(team->mode);
        n = (int)((uint32_t)span & ~OWN);
        team->piece(team->user, number, piece);
    }
    count_done(team, n, n_done);
    return run;
}

/* the caller does the pieces of workers that have not taken them */
static void run_missed(pal_team *team, int n)
{
    const uint64_t all = ((uint64_t)1 << n) - 1;
    uint64_t run, span;
    int n_done = 0;
    for (int k = 0; k < team->looks && (atomic_load(&team->next) & all) != all; k++) pause_core();
    for (int piece = 1; piece < n; piece++) {
        if (take(team, piece, &run, &span) < 0) continue;
        team->piece(team->user, 0, piece);
        n_done++;
    }
    team->looks = n_done > 0 ? team->looks / 4 : MAX_LOOKS;
    count_done(team, n, n_done);
}

static bool is_last(pal_team *team, uint64_t run)
{
    return atomic_load(&team->next) >> 32 == run;
}

/* watches or sleeps while `seen` is the last run; false: the team ends */
static bool wait_for_run(pal_team *team, uint64_t seen)
{
    for (int k = 1; atomic_load(&team->held) && is_last(team, seen); k++) {
        pause_core();
        if (k % WATCHES == 0) sched_yield();
    }
    if (!is_last(team, seen)) return true;
    pthread_mutex_lock(&team->lock);
    while (!team->quit && !atomic_load(&team->held) && is_last(team, seen))
        pthread_cond_wait(&team->begun, &team->lock);
    const bool quit = team->quit;
    pthread_mutex_unlock(&team->lock);
    return !quit;
}

static void *live(void *self)
{
    worker *w = self;
    for (uint64_t seen = 0; wait_for_run(w->team, seen);) seen = work(w->team, w->number);
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
    team->size = team->n_thread + 1, team->looks = MAX_LOOKS;
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

uint64_t pal_team_mean_ns(const pal_team *team, uint64_t own_ns)
{
    uint64_t sum = own_ns;
    if (!team) return own_ns;
    for (int i = 0; i < team->n_thread; i++) sum += pal_clock_thread_of_ns(team->worker[i].thread);
    return sum / (uint64_t)team->size;
}

static void wake_workers(pal_team *team, int n)
{
    pthread_mutex_lock(&team->lock);
    if (n >= team->n_thread)
        pthread_cond_broadcast(&team->begun);
    else
        for (int i = 0; i < n; i++) pthread_cond_signal(&team->begun);
    pthread_mutex_unlock(&team->lock);
}

void pal_team_run(pal_team *team, int n, void (*piece)(void *user, int worker, int index), void *user)
{
    if (n <= 1 || !team || team->n_thread == 0) {
        for (int i = 0; i < n; i++) piece(user, 0, i);
        return;
    }
    const uint64_t run = (uint64_t)(uint32_t)((atomic_load(&team->next) >> 32) + 1) << 32;
    team->piece = piece, team->user = user, team->mode = pal_subnormals_mode();
    const bool held = atomic_load(&team->held), own = held && n <= team->n_thread + 1 && n <= MAX_OWN;
    atomic_store(&team->n_done, 0);
    atomic_store(&team->span, run | (uint32_t)n | (own ? OWN : 0));
    atomic_store(&team->next, run);
    if (!held) wake_workers(team, n - 1);
    (void)work(team, 0);
    if (own) run_missed(team, n);
    for (int k = 1; held && atomic_load(&team->n_done) < n; k++) {
        pause_core();
        if (k % WATCHES == 0) sched_yield();
    }
    if (held) return;
    pthread_mutex_lock(&team->lock);
    while (atomic_load(&team->n_done) < n) pthread_cond_wait(&team->left, &team->lock);
    pthread_mutex_unlock(&team->lock);
}

void pal_team_hold(pal_team *team)
{
    if (!team || team->n_thread == 0) return;
    pthread_mutex_lock(&team->lock);
    atomic_store(&team->held, true);
    pthread_cond_broadcast(&team->begun);
    pthread_mutex_unlock(&team->lock);
}

void pal_team_release(pal_team *team)
{
    if (team) atomic_store(&team->held, false);
}
