/* Estimates of a running session: nothing of them exists while nobody looks, they change nothing, they go from one
 * session to the next that follows it. */
#include "server/base/clock.h"
#include "server/session/session.h"
#include "tests/check.h"
#include "tests/session/small_scene.h"

#include <dirent.h>

static pal_scene scene;
static pal_prepared mesh;

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

/* the first estimate, or one of a later tick; gives up after 20 s */
static bool wait_estimate(pal_session *s, uint64_t after, pal_estimate *out)
{
    uint64_t until = pal_clock_ns() + 20000000000u;
    while (!(pal_session_estimate(s, 0, out) && out->tick >= after)) {
        if (pal_clock_ns() > until) return false;
        sleep_ms(5);
    }
    return true;
}

static bool wait_threads(int n)
{
    uint64_t until = pal_clock_ns() + 20000000000u;
    while (pal_estimator_threads() != n) {
        if (pal_clock_ns() > until) return false;
        sleep_ms(2);
    }
    return true;
}

static void nothing_exists_while_nobody_looks(void)
{
    pal_session *s = NULL;
    pal_note note = {""};
    pal_estimate estimate;
    REQUIRE(!pal_session_open(&scene, NULL, &note, &s));
    int before = threads();
    uint64_t made = pal_estimator_made();
    sleep_ms(60);
    CHECK_INT(pal_estimator_threads(), 0);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT((long long)(pal_estimator_made() - made), 0);
    /* two look: one estimator; one looks away: still there; both: gone */
    ask(s, true);
    ask(s, true);
    CHECK(wait_estimate(s, 1, &estimate));
    CHECK_INT(pal_estimator_threads(), 1);
    CHECK(estimate.ms > 0 && estimate.own_ms > 0 && estimate.time_s > 0);
    ask(s, false);
    sleep_ms(30);
    CHECK_INT(pal_estimator_threads(), 1);
    ask(s, false);
    CHECK(wait_threads(0));
    sleep_ms(30);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT(threads(), before);
    made = pal_estimator_made();
    sleep_ms(300);
    CHECK_INT((long long)(pal_estimator_made() - made), 0);
    pal_session_close(s);
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

/* a world that is looked at by an estimator has the bits of one that is not */
static uint64_t run(bool looked_at)
{
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    CHECK(!pal_world_create(&scene, NULL, &w));
    if (!w) return 0;
    if (looked_at) CHECK(!pal_estimator_open(&scene, 0, NULL, &e));
    uint64_t made = pal_estimator_made();
    for (int i = 0; i < 100; i++) {
        pal_pose pose = {.position_m = {0, 0, 0.06 - 0.0002 * i}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_world_pose(w, 0, &pose));
        CHECK(!pal_world_step(w, scene.step_s));
        if (e) pal_estimator_look(e, w, 1);
        for (int k = 0; e && i % 20 == 10 && k < 4000 && pal_estimator_made() == made; k++) {
            sleep_ms(5);
            pal_estimator_look(e, w, NAN);
        }
        made = pal_estimator_made();
    }
    if (e) CHECK(pal_estimator_read(e, &estimate) && estimate.tick > 0);
    uint64_t hash = pal_world_hash(w);
    pal_estimator_close(e);
    pal_world_destroy(w);
    return hash;
}

static void looking_changes_nothing(void)
{
    uint64_t without = run(false), with = run(true);
    CHECK(without == with);
}

static void carry(void *user, pal_world *next, const pal_world *before)
{
    (void)user;
    pal_world_follow(next, before, -1, NULL, NULL);
}

static void who_looks_goes_on_looking_at_what_follows(void)
{
    pal_session *before = NULL, *next = NULL;
    pal_scene other = scene;
    pal_estimate estimate;
    REQUIRE(!pal_session_open(&scene, NULL, NULL, &before));
    ask(before, true);
    CHECK(wait_estimate(before, 1, &estimate));
    REQUIRE(!pal_session_open_after(before, &other, NULL, &next));
    CHECK(!pal_session_follow(next, before, carry, NULL, NULL));
    pal_session_close(before);
    CHECK(wait_estimate(next, 1, &estimate));
    CHECK_INT(pal_estimator_threads(), 1);
    ask(next, false);
    CHECK(wait_threads(0));
    pal_session_close(next);
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 8)) return 1;
    RUN(nothing_exists_while_nobody_looks);
    RUN(what_is_not_there_is_refused);
    RUN(looking_changes_nothing);
    RUN(who_looks_goes_on_looking_at_what_follows);
    pal_prepared_free(&mesh);
    return check_report();
}
