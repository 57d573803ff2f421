/* A team of threads: every piece once, one piece a worker, really side by side, asleep between runs. */
#include "server/base/team.h"
#include "tests/check.h"

#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>

enum { MAX_PIECE = 4096 };

static int threads_left = INT_MAX; /* so many may still be made */

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*run)(void *), void *user);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*run)(void *), void *user);

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*run)(void *), void *user)
{
    if (threads_left <= 0) return EAGAIN;
    threads_left--;
    return __real_pthread_create(thread, attr, run, user);
}

/* threads that wait for a condition of the team */
static pthread_mutex_t asleep_lock = PTHREAD_MUTEX_INITIALIZER;
static sem_t asleep_changed;
static int n_asleep;

int __real_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock);
int __wrap_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock);

static void count_asleep(int by)
{
    pthread_mutex_lock(&asleep_lock);
    n_asleep += by;
    pthread_mutex_unlock(&asleep_lock);
    sem_post(&asleep_changed);
}

int __wrap_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock)
{
    count_asleep(1);
    int result = __real_pthread_cond_wait(condition, lock);
    count_asleep(-1);
    return result;
}

/* until n threads wait; a team whose threads never sleep never gets there */
static void wait_asleep(int n)
{
    for (;;) {
        pthread_mutex_lock(&asleep_lock);
        bool reached = n_asleep == n;
        pthread_mutex_unlock(&asleep_lock);
        if (reached) return;
        while (sem_wait(&asleep_changed)) continue;
    }
}

typedef struct board {
    int size;
    uint8_t taken[MAX_PIECE]; /* plain memory: the thread sanitizer sees whether two pieces meet */
    double value[MAX_PIECE];
    atomic_int busy[PAL_TEAM_MAX];
    atomic_int wrong;
    int64_t sum[PAL_TEAM_MAX]; /* of a worker, plain */
} board;

static void piece(void *user, int worker, int i)
{
    board *b = user;
    if (worker < 0 || worker >= b->size) {
        atomic_fetch_add(&b->wrong, 1);
        return;
    }
    if (atomic_fetch_add(&b->busy[worker], 1) != 0) atomic_fetch_add(&b->wrong, 1);
    b->taken[i]++;
    b->sum[worker] += i;
    double x = i;
    for (int k = 0; k < 20; k++) x = cos(x + i);
    b->value[i] = x;
    atomic_fetch_sub(&b->busy[worker], 1);
}

static void does_every_piece_once_and_one_at_a_time_per_worker(void)
{
    static double alone[MAX_PIECE];
    static board b;
    for (int size = 1; size <= 5; size++) {
        pal_team *team = NULL;
        REQUIRE(pal_team_create(size, &team) == PAL_ERR_OK);
        CHECK_INT(pal_team_size(team), size);
        const int count[] = {0, 1, 2, 3, 7, 100, MAX_PIECE, -5};
        for (int c = 0; c < 8; c++) {
            memset(&b, 0, sizeof b);
            b.size = size;
            pal_team_run(team, count[c], piece, &b);
            int64_t sum = 0, n = count[c] > 0 ? count[c] : 0, bad = 0;
            for (int i = 0; i < MAX_PIECE; i++) bad += b.taken[i] != (i < n);
            for (int w = 0; w < size; w++) sum += b.sum[w];
            CHECK_INT(bad, 0);
            CHECK_INT(atomic_load(&b.wrong), 0);
            CHECK_INT(sum, n * (n - 1) / 2);
            if (n < MAX_PIECE) continue;
            if (size == 1) memcpy(alone, b.value, sizeof alone);
            CHECK(memcmp(alone, b.value, sizeof alone) == 0);
        }
        pal_team_destroy(team);
    }
}

static void add_one(void *user, int worker, int i)
{
    (void)worker;
    ((int *)user)[i]++;
}

static void hands_over_thousands_of_short_runs(void)
{
    pal_team *team = NULL;
    REQUIRE(pal_team_create(3, &team) == PAL_ERR_OK);
    int count[6] = {0}, wanted[6] = {0};
    for (int run = 0; run < 6000; run++) {
        int n = run % 7;
        pal_team_run(team, n, add_one, count);
        for (int i = 0; i < n; i++) wanted[i]++;
        for (int i = 0; i < 6; i++) count[i] += 3, wanted[i] += 3; /* the caller's turn: nobody else touches it */
    }
    for (int i = 0; i < 6; i++) CHECK_INT(count[i], wanted[i]);
    pal_team_destroy(team);
}

/* held for some runs of each ten, so that workers pass from watching to sleep and back */
static void hands_over_as_well_while_held(void)
{
    pal_team *team = NULL;
    REQUIRE(pal_team_create(3, &team) == PAL_ERR_OK);
    int count[6] = {0}, wanted[6] = {0};
    for (int run = 0; run < 3000; run++) {
        if (run % 10 == 2) pal_team_hold(team);
        int n = run % 7;
        pal_team_run(team, n, add_one, count);
        for (int i = 0; i < n; i++) wanted[i]++;
        for (int i = 0; i < 6; i++) count[i] += 3, wanted[i] += 3;
        if (run % 10 == 8) pal_team_release(team);
    }
    pal_team_hold(team); /* and destroyed while held */
    for (int i = 0; i < 6; i++) CHECK_INT(count[i], wanted[i]);
    pal_team_destroy(team);
    pal_team_run(NULL, 6, add_one, count); /* without a team the caller does all */
    for (int i = 0; i < 6; i++) CHECK_INT(count[i], wanted[i] + 1);
    pal_team_hold(NULL);
    pal_team_release(NULL);
}

typedef struct meeting {
    sem_t come[3];
    atomic_int met;
} meeting;

/* each waits for the two others: none can end before all have begun */
static void meet(void *user, int worker, int i)
{
    (void)worker;
    meeting *m = user;
    for (int k = 0; k < 2; k++) sem_post(&m->come[i]);
    for (int k = 1; k < 3; k++)
        while (sem_wait(&m->come[(i + k) % 3])) continue;
    atomic_fetch_add(&m->met, 1);
}

static void works_side_by_side(void)
{
    pal_team *team = NULL;
    meeting m = {.met = 0};
    for (int i = 0; i < 3; i++) sem_init(&m.come[i], 0, 0);
    REQUIRE(pal_team_create(3, &team) == PAL_ERR_OK);
    for (int turn = 1; turn <= 50; turn++) {
        pal_team_run(team, 3, meet, &m);
        REQUIRE(atomic_load(&m.met) == 3 * turn);
    }
    pal_team_destroy(team);
    for (int i = 0; i < 3; i++) sem_destroy(&m.come[i]);
}

static void sleeps_between_runs(void)
{
    pal_team *team = NULL;
    int count[6] = {0};
    REQUIRE(pal_team_create(6, &team) == PAL_ERR_OK);
    for (int run = 1; run <= 20; run++) {
        if (run % 2) pal_team_hold(team);
        pal_team_run(team, 6, add_one, count);
        pal_team_release(team);
        wait_asleep(5);
    }
    for (int i = 0; i < 6; i++) CHECK_INT(count[i], 20);
    pal_team_destroy(team);
}

static void is_as_large_as_the_cores_that_it_may_use(void)
{
    cpu_set_t all, one;
    REQUIRE(sched_getaffinity(0, sizeof all, &all) == 0);
    pal_team *team = NULL;
    REQUIRE(pal_team_create(0, &team) == PAL_ERR_OK);
    CHECK_INT(pal_team_size(team), CPU_COUNT(&all) < PAL_TEAM_MAX ? CPU_COUNT(&all) : PAL_TEAM_MAX);
    pal_team_destroy(team);
    int first = 0;
    while (!CPU_ISSET(first, &all)) first++;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    REQUIRE(sched_setaffinity(0, sizeof one, &one) == 0);
    pal_err err = pal_team_create(-1, &team);
    CHECK(sched_setaffinity(0, sizeof all, &all) == 0);
    REQUIRE(err == PAL_ERR_OK);
    CHECK_INT(pal_team_size(team), 1);
    pal_team_destroy(team);
    REQUIRE(pal_team_create(100000, &team) == PAL_ERR_OK);
    CHECK_INT(pal_team_size(team), PAL_TEAM_MAX);
    static board b;
    memset(&b, 0, sizeof b);
    b.size = PAL_TEAM_MAX;
    pal_team_run(team, MAX_PIECE, piece, &b);
    CHECK_INT(atomic_load(&b.wrong), 0);
    pal_team_destroy(team);
    pal_team_destroy(NULL);
}

static void makes_do_with_the_threads_that_it_gets(void)
{
    pal_team *team = NULL;
    threads_left = 0;
    CHECK_INT(pal_team_create(4, &team), PAL_ERR_MEMORY);
    CHECK(team == NULL);
    CHECK_INT(pal_team_create(1, &team), PAL_ERR_OK);
    pal_team_destroy(team);
    threads_left = 2;
    pal_err err = pal_team_create(8, &team);
    threads_left = INT_MAX;
    REQUIRE(err == PAL_ERR_OK);
    CHECK_INT(pal_team_size(team), 3);
    int count[50] = {0}, sum = 0;
    pal_team_run(team, 50, add_one, count);
    for (int i = 0; i < 50; i++) sum += count[i] == 1;
    CHECK_INT(sum, 50);
    pal_team_destroy(team);
}

static atomic_int n_masked;

static void meet_masked(void *user, int worker, int i)
{
    meet(user, worker, i);
    sigset_t mask;
    pthread_sigmask(SIG_SETMASK, NULL, &mask);
    if (worker > 0 && sigismember(&mask, SIGINT) == 1 && sigismember(&mask, SIGTERM) == 1)
        atomic_fetch_add(&n_masked, 1);
}

static void leaves_signals_to_the_program(void)
{
    sigset_t before, after;
    pthread_sigmask(SIG_SETMASK, NULL, &before);
    pal_team *team = NULL;
    REQUIRE(pal_team_create(3, &team) == PAL_ERR_OK);
    pthread_sigmask(SIG_SETMASK, NULL, &after);
    for (int s = 1; s < 32; s++) CHECK_INT(sigismember(&after, s), sigismember(&before, s));
    meeting m = {.met = 0};
    for (int i = 0; i < 3; i++) sem_init(&m.come[i], 0, 0);
    pal_team_run(team, 3, meet_masked, &m);
    CHECK_INT(atomic_load(&n_masked), 2);
    pal_team_destroy(team);
    for (int i = 0; i < 3; i++) sem_destroy(&m.come[i]);
}

int main(void)
{
    sem_init(&asleep_changed, 0, 0);
    RUN(does_every_piece_once_and_one_at_a_time_per_worker);
    RUN(hands_over_thousands_of_short_runs);
    RUN(hands_over_as_well_while_held);
    RUN(works_side_by_side);
    RUN(sleeps_between_runs);
    RUN(is_as_large_as_the_cores_that_it_may_use);
    RUN(makes_do_with_the_threads_that_it_gets);
    RUN(leaves_signals_to_the_program);
    return check_report();
}
