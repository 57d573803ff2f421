/* Estimates of a running session: without subscribers nothing of them exists, they change nothing, they continue in the
 * session that follows. Their values: test_estimation. The estimator works at its own pace: tests wait for the wakes of
 * its clock. */
#include "server/session/session.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/estimate/hold_estimates.h"
#include "tests/fixtures/estimate_scene.h"
#include "tests/session/stepped_session.h"

#include <stdatomic.h>

/* threads that exist: those started less those joined */
static atomic_int n_thread;
int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*run)(void *), void *user);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*run)(void *), void *user);
int __real_pthread_join(pthread_t thread, void **result);
int __wrap_pthread_join(pthread_t thread, void **result);

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*run)(void *), void *user)
{
    atomic_fetch_add(&n_thread, 1);
    return __real_pthread_create(thread, attr, run, user);
}

int __wrap_pthread_join(pthread_t thread, void **result)
{
    int err = __real_pthread_join(thread, result);
    atomic_fetch_sub(&n_thread, 1);
    return err;
}

enum { PERIOD_NS = 250000000 }; /* of estimates */

/* steps of one period */
static int period_steps(const pal_session *s)
{
    return (int)(PERIOD_NS / stepped_ns(s)) + 1;
}

static void subscribe(pal_session *s, bool wanted)
{
    CHECK(!pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_ESTIMATE, .body = 0, .wanted = wanted}));
}

static bool has_estimate(pal_session *s, pal_estimate *out)
{
    return pal_session_estimate(s, 0, out) && out->tick > 0;
}

/* steps, until there is an estimate of a body in motion */
static void wait_estimate(pal_session *s, pal_estimate *out)
{
    for (;;) {
        uint64_t n_wake = manual_clock_wakes(&stepped_clock);
        stepped_steps(s, period_steps(s));
        if (has_estimate(s, out)) return;
        manual_clock_wait_wake(&stepped_clock, n_wake);
    }
}

static void wait_threads(pal_session *s, int n)
{
    for (;;) {
        uint64_t n_wake = manual_clock_wakes(&stepped_clock);
        stepped_steps(s, 1);
        if (pal_estimator_threads() == n) return;
        manual_clock_wait_wake(&stepped_clock, n_wake);
    }
}

static void nothing_exists_without_subscribers(void)
{
    pal_scene *fem = fem_scene();
    pal_estimate estimate;
    pal_session *s = stepped_open(fem, (pal_session_options){0});
    REQUIRE(s);
    int before = atomic_load(&n_thread);
    uint64_t made = pal_estimator_count();
    stepped_steps(s, 60);
    CHECK_INT(pal_estimator_threads(), 0);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT((long long)(pal_estimator_count() - made), 0);
    /* two subscribe: one estimator; one leaves: still there; both: gone */
    subscribe(s, true);
    subscribe(s, true);
    wait_estimate(s, &estimate);
    CHECK_INT(pal_estimator_threads(), 1);
    CHECK(estimate.ms > 0 && estimate.estimate_ms > 0 && estimate.time_s > 0);
    subscribe(s, false);
    stepped_steps(s, 5);
    CHECK_INT(pal_estimator_threads(), 1);
    subscribe(s, false);
    wait_threads(s, 0);
    stepped_steps(s, 1);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT(atomic_load(&n_thread), before);
    made = pal_estimator_count();
    stepped_steps(s, 60);
    CHECK_INT((long long)(pal_estimator_count() - made), 0);
    pal_session_close(s);
    free(fem);
}

static void what_does_not_exist_is_refused(void)
{
    pal_estimate estimate;
    pal_session *s = stepped_open(&scene, (pal_session_options){0});
    REQUIRE(s);
    for (int body = -1; body < 9; body++) {
        pal_command command = {.kind = PAL_COMMAND_ESTIMATE, .body = body, .wanted = false};
        CHECK_INT(pal_session_command(s, &command), body == 0 ? PAL_ERR_OK : PAL_ERR_REFUSED);
        CHECK(!pal_session_estimate(s, body, &estimate));
    }
    stepped_steps(s, 4);
    CHECK_INT(pal_estimator_threads(), 0);
    /* closing does not wait for a subscriber to leave, nor for worlds to be made */
    subscribe(s, true);
    stepped_steps(s, 1);
    CHECK_INT(pal_estimator_threads(), 1);
    pal_session_close(s);
    CHECK_INT(pal_estimator_threads(), 0);
}

/* finite elements that a tool can press: an estimate of them is made in a tenth of the time that springs take */
static pal_scene *pressed_scene(void)
{
    pal_scene *fem = fem_scene();
    fem->body[0].n_effect = scene.body[0].n_effect;
    return fem;
}

/* a world that an estimator observes has the bits of one that none observes */
static uint64_t run(const pal_scene *at, bool observed)
{
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    CHECK(!pal_world_create(at, NULL, &w));
    if (!w) return 0;
    manual_clock_init(&stepped_clock, 1);
    if (observed) CHECK(!pal_estimator_open(at, 0, &stepped_clock.clock, NULL, &e));
    for (int i = 0; i < 100; i++) {
        pal_pose pose = {.position_m = {0, 0, 0.06 - 0.0002 * i}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_world_pose(w, 0, &pose));
        CHECK(!pal_world_step(w, at->step_s));
        if (e) pal_estimator_observe(e, w, 1);
        if (!e || i % 40 != 10) continue;
        manual_clock_advance(&stepped_clock, PERIOD_NS);
        for (uint64_t made = pal_estimator_count();;) {
            uint64_t n_wake = manual_clock_wakes(&stepped_clock);
            pal_estimator_observe(e, w, NAN);
            if (pal_estimator_count() > made) break;
            manual_clock_wait_wake(&stepped_clock, n_wake);
        }
    }
    if (e) CHECK(pal_estimator_read(e, &estimate) && estimate.tick > 0);
    uint64_t hash = pal_world_hash(w);
    pal_estimator_close(e);
    pal_world_destroy(w);
    return hash;
}

static void an_estimator_changes_nothing(void)
{
    pal_scene *fem = pressed_scene();
    uint64_t without = run(fem, false), with = run(fem, true);
    CHECK(without == with && without != 0);
    free(fem);
}

static void transfer_world(void *user, pal_world *next, const pal_world *before)
{
    (void)user;
    pal_world_transfer(next, before, -1, NULL, NULL);
}

static void a_subscription_continues_in_the_session_that_follows(void)
{
    pal_session *next = NULL;
    pal_scene *fem = fem_scene(), *other = fem_scene();
    pal_estimate estimate;
    pal_session *before = stepped_open(fem, (pal_session_options){0});
    REQUIRE(before);
    subscribe(before, true);
    wait_estimate(before, &estimate);
    REQUIRE(!pal_session_open_after(before, other, NULL, &next));
    REQUIRE(stepped_transfer(next, before, transfer_world, NULL));
    pal_session_close(before);
    wait_estimate(next, &estimate);
    CHECK_INT(pal_estimator_threads(), 1);
    subscribe(next, false);
    wait_threads(next, 0);
    pal_session_close(next);
    free(fem);
    free(other);
}

/* one step of the body in each period, until there is one estimate more */
static void step_until_estimate(pal_estimator *e, pal_world *w)
{
    for (uint64_t made = pal_estimator_count();;) {
        uint64_t n_wake = manual_clock_wakes(&stepped_clock);
        manual_clock_advance(&stepped_clock, PERIOD_NS);
        CHECK(!pal_world_step(w, scene.step_s));
        pal_estimator_observe(e, w, 1);
        if (pal_estimator_count() > made) return;
        manual_clock_wait_wake(&stepped_clock, n_wake);
    }
}

/* the newest estimate is of the state at tick, n steps of the body awake ago */
static void check_age(pal_estimator *e, uint64_t tick, int n, double step_s)
{
    pal_estimate estimate;
    REQUIRE(pal_estimator_read(e, &estimate));
    CHECK_INT(estimate.tick, tick);
    CHECK_NEAR(estimate.age_s, n * step_s, 1e-12);
    CHECK(estimate.asleep);
    CHECK((strstr(estimate.diag, "asleep") != NULL) == (n == 0));
}

static void a_sleeping_body_is_estimated_once(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    pal_entry_init(&fem->body[0].effect[0], "effect", "sleep");
    fem->body[0].n_effect = 1;
    manual_clock_init(&stepped_clock, 1);
    REQUIRE(!pal_world_create(fem, NULL, &w));
    for (int i = 0; i < 200 && !pal_world_view_body(w, 0)->asleep; i++) CHECK(!pal_world_step(w, fem->step_s));
    REQUIRE(pal_world_view_body(w, 0)->asleep);
    REQUIRE(!pal_estimator_open(fem, 0, &stepped_clock.clock, NULL, &e));
    step_until_estimate(e, w);
    uint64_t tick = pal_estimator_read(e, &estimate) ? estimate.tick : 0, made = pal_estimator_count();
    CHECK(strstr(estimate.diag, "asleep") && estimate.error_m == 0 && estimate.ms != 1);
    for (int i = 0; i < 20; i++) {
        manual_clock_advance(&stepped_clock, PERIOD_NS);
        CHECK(!pal_world_step(w, fem->step_s));
        pal_estimator_observe(e, w, 1);
    }
    check_age(e, tick, 0, fem->step_s);
    /* a load wakes it: until the next state is taken, the estimate is of its sleep and grows old */
    const int free_node = pal_world_view_body(w, 0)->n_node - 1;
    REQUIRE(!pal_world_view_body(w, 0)->support[free_node]);
    CHECK(!pal_world_load(w, 0, free_node, (double[3]){1e-3, 0, 0}));
    hold_estimates = true;
    for (int n = 1; n <= 5; n++) {
        CHECK(!pal_world_step(w, fem->step_s));
        pal_estimator_observe(e, w, 1);
        check_age(e, tick, n, fem->step_s);
    }
    hold_estimates = false;
    /* the one of the awake body is the only new one */
    step_until_estimate(e, w);
    CHECK_INT((long long)(pal_estimator_count() - made), 1);
    CHECK(pal_estimator_read(e, &estimate) && estimate.tick > tick && estimate.max_m > 0);
    pal_estimator_close(e);
    pal_world_destroy(w);
    free(fem);
}

static void nothing_is_known_of_a_frozen_body(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    manual_clock_init(&stepped_clock, 1);
    REQUIRE(!pal_world_create(fem, NULL, &w));
    REQUIRE(!pal_estimator_open(fem, 0, &stepped_clock.clock, NULL, &e));
    step_until_estimate(e, w);
    CHECK(pal_estimator_read(e, &estimate) && estimate.error_m >= 0);
    pal_world_body(w, 0)->frozen = true;
    pal_estimator_observe(e, w, 1);
    REQUIRE(pal_estimator_read(e, &estimate));
    CHECK(isnan(estimate.error_m) && isnan(estimate.max_m) && estimate.tick == pal_world_tick(w));
    CHECK(strstr(estimate.diag, "frozen") != NULL);
    /* what was known before is not what is known after */
    CHECK(!pal_world_reset_body(w, 0));
    pal_estimator_observe(e, w, NAN);
    CHECK(!pal_estimator_read(e, &estimate));
    /* the first estimate may still be of a state before the reset */
    do step_until_estimate(e, w);
    while (!pal_estimator_read(e, &estimate));
    CHECK(estimate.error_m >= 0 && estimate.tick > 0);
    pal_estimator_close(e);
    pal_world_destroy(w);
    free(fem);
}

/* pressed by a tool: its contact is among the loads */
static void a_pressed_body_is_estimated_while_it_runs(void)
{
    pal_scene *fem = pressed_scene();
    pal_estimate e = {.tick = 0};
    pal_session *s = stepped_open(fem, (pal_session_options){.lease_s = 60});
    REQUIRE(s);
    const pal_pose pose = {.position_m = {0.048, 0, 0.01}, .quat = {1, 0, 0, 0}};
    CHECK(!pal_session_request_pose(s, 0, &pose));
    stepped_steps(s, 60);
    subscribe(s, true);
    wait_estimate(s, &e);
    printf("  pressed by %.3g mm: discretisation %.3g mm, all %.3g mm, zz %.3g %%, own %.3g ms, a step %.3g ms\n",
           1e3 * e.max_m, 1e3 * e.discretisation_m, 1e3 * e.error_m, e.energy_error_percent, e.estimate_ms, e.ms);
    CHECK(e.max_m > 1e-4 && e.discretisation_m > 0 && e.energy_error_percent > 0);
    pal_session_close(s);
    CHECK_INT(pal_estimator_threads(), 0);
    free(fem);
}

int main(void)
{
    if (!estimate_scene(CHECK_REPEATS(8, 4))) return 1;
    RUN(nothing_exists_without_subscribers);
    RUN(what_does_not_exist_is_refused);
    RUN_SERIAL(an_estimator_changes_nothing);
    RUN(a_subscription_continues_in_the_session_that_follows);
    RUN(a_pressed_body_is_estimated_while_it_runs);
    RUN_SERIAL(a_sleeping_body_is_estimated_once);
    RUN(nothing_is_known_of_a_frozen_body);
    pal_prepared_free(&mesh);
    return check_report();
}
