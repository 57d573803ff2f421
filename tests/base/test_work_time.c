/* Processor time of those on whom a step waits: the mean of a team, and spare threads while they are waited for. What
 * the clocks of other threads say is told here. */
#include "server/base/clock.h"
#include "server/base/spare_thread.h"
#include "server/base/team.h"
#include "tests/check.h"

#include <semaphore.h>
#include <stdatomic.h>

static _Atomic uint64_t other_ns, reading_ns; /* of every other thread, and from one reading to the next */
static sem_t main_waits;
static pthread_t main_thread;

uint64_t __wrap_pal_clock_thread_of_ns(pthread_t thread);
uint64_t __wrap_pal_clock_thread_of_ns(pthread_t thread)
{
    CHECK(!pthread_equal(thread, main_thread));
    return atomic_fetch_add(&other_ns, atomic_load(&reading_ns));
}

int __real_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock);
int __wrap_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock);
int __wrap_pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock)
{
    if (pthread_equal(pthread_self(), main_thread)) sem_post(&main_waits);
    return __real_pthread_cond_wait(condition, lock);
}

static void a_team_takes_the_mean_of_its_threads(void)
{
    pal_team *team = NULL;
    atomic_store(&other_ns, 700), atomic_store(&reading_ns, 0);
    CHECK_INT(pal_team_mean_ns(NULL, 100), 100);
    REQUIRE(!pal_team_create(1, &team));
    CHECK_INT(pal_team_mean_ns(team, 100), 100);
    pal_team_destroy(team);
    REQUIRE(!pal_team_create(3, &team));
    CHECK_INT(pal_team_mean_ns(team, 100), (100 + 700 + 700) / 3);
    pal_team_destroy(team);
}

static void job(void *user)
{
    (void)user;
    while (sem_wait(&main_waits)) continue;
}

/* from the first of two readings to the second; a thread that has ended its job is not waited for */
static void a_spare_thread_counts_while_it_is_waited_for(void)
{
    pal_spare_thread spare;
    pal_spare_thread_init(&spare);
    atomic_store(&other_ns, 5000), atomic_store(&reading_ns, 70);
    const uint64_t before = pal_spare_thread_waited_ns();
    for (int k = 1; k <= 2; k++) {
        REQUIRE(!pal_spare_thread_run(&spare, job, NULL));
        pal_spare_thread_wait(&spare);
        CHECK_INT(pal_spare_thread_waited_ns() - before, 70 * k);
        pal_spare_thread_wait(&spare);
        CHECK_INT(pal_spare_thread_waited_ns() - before, 70 * k);
    }
    pal_spare_thread_destroy(&spare);
}

int main(void)
{
    sem_init(&main_waits, 0, 0);
    main_thread = pthread_self();
    RUN(a_team_takes_the_mean_of_its_threads);
    RUN(a_spare_thread_counts_while_it_is_waited_for);
    return check_report();
}
