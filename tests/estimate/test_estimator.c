/* Estimates of a running session: nothing of them exists while nobody looks, they change nothing, they go from one
 * session to the next that follows it. What they say: test_estimate_parts. */
#include "server/base/clock.h"
#include "server/session/session.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/fixtures/estimate_scene.h"

#include <dirent.h>

static const uint64_t timeout_ns = 120000000000u; /* sanitizers on a busy machine */

static int threads(void)
{
    int n = 0;
    DIR *folder = opendir("/proc/self/task");
    while (folder && readdir(folder)) n++;
    if (folder) closedir(folder);
    return n;
}

static void sleep_ms(unsigned ms)
{
    pal_clock_sleep_until_ns(pal_clock_ns() + (uint64_t)ms * 1000000);
}

static void ask(pal_session *s, bool wanted)
{
    CHECK(!pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_ESTIMATE, .body = 0, .wanted = wanted}));
}

/* the first estimate, or one of a later tick; gives up after two minutes */
static bool wait_estimate(pal_session *s, uint64_t after, pal_estimate *out)
{
    uint64_t until = pal_clock_ns() + timeout_ns;
    while (!(pal_session_estimate(s, 0, out) && out->tick >= after)) {
        if (pal_clock_ns() > until) return false;
        sleep_ms(5);
    }
    return true;
}

static bool wait_threads(int n)
{
    uint64_t until = pal_clock_ns() + timeout_ns;
    while (pal_estimator_threads() != n) {
        if (pal_clock_ns() > until) return false;
        sleep_ms(2);
    }
    return true;
}

static void nothing_exists_while_nobody_looks(void)
{
    pal_scene *fem = fem_scene();
    pal_session *s = NULL;
    pal_diagnostic diag = {""};
    pal_estimate estimate;
    REQUIRE(!pal_session_open(fem, NULL, &diag, &s));
    int before = threads();
    uint64_t made = pal_estimator_count();
    sleep_ms(60);
    CHECK_INT(pal_estimator_threads(), 0);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT((long long)(pal_estimator_count() - made), 0);
    /* two look: one estimator; one looks away: still there; both: gone */
    ask(s, true);
    ask(s, true);
    CHECK(wait_estimate(s, 1, &estimate));
    CHECK_INT(pal_estimator_threads(), 1);
    CHECK(estimate.ms > 0 && estimate.estimate_ms > 0 && estimate.time_s > 0);
    ask(s, false);
    sleep_ms(30);
    CHECK_INT(pal_estimator_threads(), 1);
    ask(s, false);
    CHECK(wait_threads(0));
    sleep_ms(30);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT(threads(), before);
    made = pal_estimator_count();
    sleep_ms(300);
    CHECK_INT((long long)(pal_estimator_count() - made), 0);
    pal_session_close(s);
    free(fem);
}

static void what_is_not_there_is_refused(void)
{
    pal_session *s = NULL;
    pal_estimate estimate;
    REQUIRE(!pal_session_open(&scene, NULL, NULL, &s));
    for (int body = -1; body < 9; body++) {
        pal_command command = {.kind = PAL_COMMAND_ESTIMATE, .body = body, .wanted = false};
        CHECK_INT(pal_session_command(s, &command), body == 0 ? PAL_ERR_OK : PAL_ERR_REFUSED);
        CHECK(!pal_session_estimate(s, body, &estimate));
    }
    sleep_ms(20);
    CHECK_INT(pal_estimator_threads(), 0);
    /* closing does not wait for somebody to look away, nor for worlds to be made */
    ask(s, true);
    sleep_ms(6);
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

/* a world that is looked at by an estimator has the bits of one that is not */
static uint64_t run(const pal_scene *at, bool looked_at)
{
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    CHECK(!pal_world_create(at, NULL, &w));
    if (!w) return 0;
    if (looked_at) CHECK(!pal_estimator_open(at, 0, NULL, &e));
    uint64_t made = pal_estimator_count();
    for (int i = 0; i < 100; i++) {
        pal_pose pose = {.position_m = {0, 0, 0.06 - 0.0002 * i}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_world_pose(w, 0, &pose));
        CHECK(!pal_world_step(w, at->step_s));
        if (e) pal_estimator_observe(e, w, 1);
        for (int k = 0; e && i % 40 == 10 && k < 4000 && pal_estimator_count() == made; k++) {
            sleep_ms(5);
            pal_estimator_observe(e, w, NAN);
        }
        made = pal_estimator_count();
    }
    if (e) CHECK(pal_estimator_read(e, &estimate) && estimate.tick > 0);
    uint64_t hash = pal_world_hash(w);
    pal_estimator_close(e);
    pal_world_destroy(w);
    return hash;
}

static void looking_changes_nothing(void)
{
    pal_scene *fem = pressed_scene();
    uint64_t without = run(fem, false), with = run(fem, true);
    CHECK(without == with && without != 0);
    free(fem);
}

static void carry(void *user, pal_world *next, const pal_world *before)
{
    (void)user;
    pal_world_transfer(next, before, -1, NULL, NULL);
}

static void who_looks_goes_on_looking_at_what_follows(void)
{
    pal_session *before = NULL, *next = NULL;
    pal_scene *fem = fem_scene(), *other = fem_scene();
    pal_estimate estimate;
    REQUIRE(!pal_session_open(fem, NULL, NULL, &before));
    ask(before, true);
    CHECK(wait_estimate(before, 1, &estimate));
    REQUIRE(!pal_session_open_after(before, other, NULL, &next));
    CHECK(!pal_session_transfer(next, before, carry, NULL, NULL));
    pal_session_close(before);
    CHECK(wait_estimate(next, 1, &estimate));
    CHECK_INT(pal_estimator_threads(), 1);
    ask(next, false);
    CHECK(wait_threads(0));
    pal_session_close(next);
    free(fem);
    free(other);
}

/* looks until there are so many estimates, or a while has gone by */
static uint64_t look_for(pal_estimator *e, pal_world *w, uint64_t n, uint64_t while_ns)
{
    uint64_t made = pal_estimator_count(), until = pal_clock_ns() + while_ns;
    while (pal_estimator_count() - made < n && pal_clock_ns() < until) {
        CHECK(!pal_world_step(w, scene.step_s));
        pal_estimator_observe(e, w, 1);
        sleep_ms(5);
    }
    return pal_estimator_count() - made;
}

/* says it of the state at tick that it was made n steps awake ago? A newer one may have come meanwhile */
static void check_age(pal_estimator *e, const pal_world *w, uint64_t tick, int n, double step_s)
{
    pal_estimate estimate;
    REQUIRE(pal_estimator_read(e, &estimate));
    bool newer = estimate.tick > tick;
    double age_s = (newer ? (double)(pal_world_tick(w) - estimate.tick) : n) * step_s;
    CHECK_NEAR(estimate.age_s, age_s, 1e-12);
    CHECK(estimate.asleep == !newer);
    CHECK((strstr(estimate.diag, "asleep") != NULL) == (!newer && n == 0));
}

static void a_sleeping_body_is_looked_at_once(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    pal_entry_init(&fem->body[0].effect[0], "effect", "sleep");
    fem->body[0].n_effect = 1;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    for (int i = 0; i < 200 && !pal_world_view_body(w, 0)->asleep; i++) CHECK(!pal_world_step(w, fem->step_s));
    REQUIRE(pal_world_view_body(w, 0)->asleep);
    REQUIRE(!pal_estimator_open(fem, 0, NULL, &e));
    CHECK_INT((long long)look_for(e, w, 1, timeout_ns), 1);
    uint64_t tick = pal_estimator_read(e, &estimate) ? estimate.tick : 0;
    CHECK(strstr(estimate.diag, "asleep") && estimate.error_m == 0 && estimate.ms != 1);
    CHECK_INT((long long)look_for(e, w, 1, 600000000), 0);
    CHECK(pal_estimator_read(e, &estimate) && estimate.tick == tick && pal_world_tick(w) > tick);
    check_age(e, w, tick, 0, fem->step_s);
    /* a load wakes it: what was said of its sleep is of a while ago, and says so */
    CHECK(!pal_world_load(w, 0, 0, (double[3]){1e-3, 0, 0}));
    pal_estimator_pause_all(true);
    for (int n = 1; n <= 5; n++) {
        CHECK(!pal_world_step(w, fem->step_s));
        pal_estimator_observe(e, w, 1);
        check_age(e, w, tick, n, fem->step_s);
    }
    pal_estimator_pause_all(false);
    CHECK_INT((long long)look_for(e, w, 1, timeout_ns), 1);
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
    REQUIRE(!pal_world_create(fem, NULL, &w));
    REQUIRE(!pal_estimator_open(fem, 0, NULL, &e));
    CHECK_INT((long long)look_for(e, w, 1, timeout_ns), 1);
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
    CHECK_INT((long long)look_for(e, w, 1, timeout_ns), 1);
    for (int k = 0; k < 100 && !pal_estimator_read(e, &estimate); k++) look_for(e, w, 1, timeout_ns);
    CHECK(pal_estimator_read(e, &estimate) && estimate.error_m >= 0);
    pal_estimator_close(e);
    pal_world_destroy(w);
    free(fem);
}

/* pressed by a tool: its contact is among the loads */
static void a_pressed_body_is_estimated_while_it_runs(void)
{
    pal_scene *fem = pressed_scene();
    pal_session *s = NULL;
    pal_estimate e = {.tick = 0};
    REQUIRE(!pal_session_open(fem, NULL, NULL, &s));
    ask(s, true);
    uint64_t until = pal_clock_ns() + timeout_ns;
    while (pal_clock_ns() < until && !(e.max_m > 1e-4 && e.discretisation_m > 0)) {
        const pal_pose pose = {.position_m = {0.048, 0, 0.01}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_session_put_pose(s, 0, &pose));
        sleep_ms(10);
        (void)pal_session_estimate(s, 0, &e);
    }
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
    RUN(nothing_exists_while_nobody_looks);
    RUN(what_is_not_there_is_refused);
    RUN_SERIAL(looking_changes_nothing);
    RUN(who_looks_goes_on_looking_at_what_follows);
    RUN(a_pressed_body_is_estimated_while_it_runs);
    RUN_SERIAL(a_sleeping_body_is_looked_at_once);
    RUN(nothing_is_known_of_a_frozen_body);
    pal_prepared_free(&mesh);
    return check_report();
}
