/* Poses of tools in a session: which one a step takes, edges of a grasp, leases, a pause, and a session that goes on
 * where one was. The clock is the test's own, so that numbers are exact. */
#include "server/session/session.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"
#include "tests/session/stepped_session.h"

enum { STEP_NS = 5000000 };

static pal_scene scene;
static pal_prepared mesh;

static pal_session *open_with(pal_session_options options)
{
    return stepped_open(&scene, options);
}

static pal_pose pose_at(double x, double z, uint32_t seq)
{
    return (pal_pose){.position_m = {x, 0, z}, .quat = {1, 0, 0, 0}, .seq = seq, .stamp_us = 1000 + seq};
}

/* steps in which the tool is there while it goes to and fro by way_m in each of n steps of 5 ms */
static int present_steps(double way_m, int n)
{
    pal_session *s = open_with((pal_session_options){.lease_s = 10});
    int there = 0;
    for (int k = 0; s && k < n; k++) {
        const pal_pose pose = {
            .position_m = {way_m * (k % 2), 0, 0.3}, .quat = {1, 0, 0, 0}, .buttons = 1, .seq = (uint32_t)k + 1};
        CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
        there += stepped_steps(s, 1)->tool[0].present;
    }
    pal_session_close(s);
    return there;
}

/* 5 m/s for 10 ms are 50 mm, and 20 sizes of the body a second less than 200 mm */
static void a_tool_that_jumps_is_lifted_until_it_rests(void)
{
    CHECK_INT(present_steps(0.049, 40), 40);
    CHECK_INT(present_steps(0.2, 40), 1);
    /* one jump: lifted for 100 ms, 20 steps, then put down there */
    pal_session *s = open_with((pal_session_options){.lease_s = 10});
    REQUIRE(s != NULL);
    pal_pose pose = {.position_m = {0, 0, 0.3}, .quat = {1, 0, 0, 0}};
    for (int k = 0; k < 50; k++) {
        pose.seq++;
        pose.position_m[0] = k < 10 ? 0 : 0.2;
        CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
        const pal_frame *f = stepped_steps(s, 1);
        CHECK_INT(f->tool[0].present, k < 10 || k >= 30);
        if (k >= 30) CHECK_NEAR(f->tool[0].pose.position_m[0], 0.2, 1e-12);
    }
    /* a tool that was away is no jump, however far it comes back */
    CHECK_INT(pal_session_request_pose(s, 0, NULL), 0);
    CHECK(!stepped_steps(s, 1)->tool[0].present);
    pose.position_m[0] = -0.2;
    CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
    CHECK(stepped_steps(s, 1)->tool[0].present);
    pal_session_close(s);
}

static void the_newest_pose_wins_and_is_echoed_with_its_arrival_time(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    manual_clock_advance(&stepped_clock, 1234);
    uint64_t arrived = stepped_clock.now_ns;
    for (uint32_t seq = 1; seq <= 50; seq++) {
        pal_pose pose = pose_at(0.2, 0.001 * seq, seq);
        CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
    }
    const pal_frame *f = stepped_steps(s, 1);
    CHECK_INT(f->tick, 1);
    CHECK_INT(f->tool[0].pose.seq, 50);
    CHECK_INT(f->tool[0].pose.stamp_us, 1050);
    CHECK_INT(f->tool[0].pose_ns, arrived);
    CHECK_NEAR(f->tool[0].pose.position_m[2], 0.05, 1e-12);
    CHECK(f->tool[0].present && !f->tool[1].present);
    CHECK_INT(pal_session_request_pose(s, 0, NULL), 0);
    CHECK(!stepped_steps(s, 1)->tool[0].present);
    pal_session_close(s);
}

/* ---- edges of a grasp ---- */

static const double AWAY = NAN;

/* a pose at x, 0.05 outside the ball, arrives between two steps; AWAY: the tool leaves */
static void arrive(pal_session *s, double x, bool grasps)
{
    pal_pose pose = pose_at(x, 0.1, 0);
    pose.buttons = grasps ? PAL_POSE_GRASP : 0;
    CHECK_INT(pal_session_request_pose(s, 0, isnan(x) ? NULL : &pose), 0);
}

/* where the tool is in the next step, and whether it grasps */
static void check_step(pal_session *s, double x, bool grasps)
{
    const pal_frame_tool *tool = &stepped_steps(s, 1)->tool[0];
    CHECK_INT(tool->present, !isnan(x));
    if (isnan(x)) return;
    CHECK_NEAR(tool->pose.position_m[0], x, 1e-12);
    CHECK_INT((tool->pose.buttons & PAL_POSE_GRASP) != 0, grasps);
}

static void what_begins_or_ends_a_grasp_has_a_step_of_its_own(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    /* pressed at 2 mm, and moved on before the step */
    for (int k = 0; k < 5; k++) arrive(s, 0.001 * k, k >= 2);
    check_step(s, 0.002, true);
    check_step(s, 0.004, true);
    /* let go, and pressed again elsewhere */
    arrive(s, 0.005, false), arrive(s, 0.006, false), arrive(s, 0.007, true), arrive(s, 0.008, true);
    check_step(s, 0.005, false);
    check_step(s, 0.007, true);
    check_step(s, 0.008, true);
    /* one step takes the first, more come, and the rest is not lost */
    arrive(s, 0.009, false), arrive(s, 0.010, true);
    check_step(s, 0.009, false);
    arrive(s, 0.011, true), arrive(s, 0.012, false);
    check_step(s, 0.010, true);
    check_step(s, 0.012, false);
    /* it leaves, comes back and grasps: that is another grasp */
    arrive(s, 0.013, true);
    check_step(s, 0.013, true);
    arrive(s, AWAY, false), arrive(s, 0.014, false), arrive(s, 0.015, true), arrive(s, 0.016, true);
    check_step(s, AWAY, false);
    check_step(s, 0.015, true);
    check_step(s, 0.016, true);
    /* of seven edges the last four, and the end is the newest pose */
    for (int k = 0; k < 7; k++) arrive(s, 0.017 + 0.001 * k, k % 2), arrive(s, 0.03, k % 2);
    for (int k = 3; k < 7; k++) check_step(s, 0.017 + 0.001 * k, k % 2);
    check_step(s, 0.03, false);
    pal_session_close(s);
}

/* who takes a tool that another let go begins anew, and the other tool sees nothing of it */
static void another_holder_does_not_keep_a_grasp(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    arrive(s, 0.001, true);
    check_step(s, 0.001, true);
    pal_pose other = pose_at(0.2, 0, 9);
    CHECK_INT(pal_session_request_pose(s, 1, &other), 0);
    arrive(s, AWAY, false), arrive(s, 0.04, true);
    check_step(s, AWAY, false);
    CHECK_INT(stepped_newest(s)->tool[1].pose.seq, 9);
    check_step(s, 0.04, true);
    pal_session_close(s);
}

/* steps that take longer than the lease: who still sends is there, with all that came; who does not is not */
static void an_edge_older_than_the_lease_counts_while_poses_come(void)
{
    pal_session *s = open_with((pal_session_options){.lease_s = 0.4 * scene.step_s});
    REQUIRE(s != NULL);
    arrive(s, 0.001, true);
    manual_clock_advance(&stepped_clock, STEP_NS - STEP_NS / 5);
    arrive(s, 0.002, true);
    manual_clock_advance(&stepped_clock, STEP_NS / 5);
    manual_clock_settle(&stepped_clock, 1);
    CHECK_NEAR(stepped_newest(s)->tool[0].pose.position_m[0], 0.001, 1e-12);
    CHECK(stepped_newest(s)->tool[0].present);
    check_step(s, AWAY, false);
    arrive(s, 0.003, false), arrive(s, 0.004, true);
    check_step(s, AWAY, false);
    pal_session_close(s);
}

/* tools are shown where they are held (below), so that after a pause a grasp begins where the hand is */
static void a_pause_keeps_no_edge(void)
{
    pal_session *s = open_with((pal_session_options){.start_paused = true});
    REQUIRE(s != NULL);
    arrive(s, 0.001, true), arrive(s, 0.002, true);
    check_step(s, 0.001, true);
    check_step(s, 0.002, true);
    arrive(s, 0.003, true);
    CHECK_INT(stepped_order(s, PAL_COMMAND_RESUME), 0);
    check_step(s, 0.003, true);
    CHECK_INT(stepped_newest(s)->tick, 1);
    pal_session_close(s);
}

/* the tool was at the ball's top when the button was pressed, and 30 mm above it by the next step */
static void a_press_holds_the_tissue_where_it_was_pressed(void)
{
    pal_session *s = open_with((pal_session_options){0});
    REQUIRE(s != NULL);
    for (int k = 0; k < 3; k++) {
        pal_pose pose = pose_at(0, 0.05 + (k > 1 ? 0.03 : 0), (uint32_t)k + 1);
        pose.buttons = k > 0 ? PAL_POSE_GRASP : 0;
        CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
    }
    CHECK(stepped_steps(s, 1)->tool[0].holding);
    CHECK_NEAR(stepped_newest(s)->tool[0].pose.position_m[2], 0.05, 1e-12);
    CHECK(stepped_steps(s, 1)->tool[0].holding);
    CHECK_NEAR(stepped_newest(s)->tool[0].pose.position_m[2], 0.08, 1e-12);
    pal_session_close(s);
}

/* 0.25 s are 50 steps: the pose is as old as the lease at the 50th and older at the next one */
static void a_silent_holder_loses_the_tool_after_its_lease(void)
{
    pal_session *s = open_with((pal_session_options){.lease_s = 0.25});
    REQUIRE(s != NULL);
    pal_pose pose = pose_at(0.2, 0, 1);
    CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
    CHECK(stepped_steps(s, 50)->tool[0].present);
    CHECK(!stepped_steps(s, 1)->tool[0].present);
    pal_session_close(s);
}

static void while_paused_tools_are_shown_where_they_are_held(void)
{
    pal_session *s = open_with((pal_session_options){.start_paused = true});
    REQUIRE(s != NULL);
    for (uint32_t seq = 1; seq < 4; seq++) {
        pal_pose pose = pose_at(0.2, 0.01 * seq, seq);
        CHECK_INT(pal_session_request_pose(s, 0, &pose), 0);
        const pal_frame *f = stepped_steps(s, 1);
        CHECK_INT(f->tick, 0);
        CHECK_INT(f->tool[0].pose.seq, seq);
        CHECK_NEAR(f->tool[0].pose.position_m[2], 0.01 * seq, 1e-12);
    }
    pal_session_close(s);
}

static void transfer_all(void *user, pal_world *next, const pal_world *before)
{
    *(uint64_t *)user = pal_world_hash(before);
    pal_world_transfer(next, before, -1, NULL, NULL);
    CHECK(pal_world_hash(next) == *(uint64_t *)user);
}

/* the tool stays in its holder's hand, time and steps go on, and the session that was left only closes */
static void another_session_goes_on_where_one_was(void)
{
    uint64_t hash = 0;
    pal_session *before = open_with((pal_session_options){0}), *next = NULL;
    REQUIRE(before && !pal_session_open_after(before, &scene, NULL, &next));
    pal_pose pose = pose_at(0, 0.2, 5);
    CHECK_INT(pal_session_request_pose(before, 1, &pose), 0);
    pose = pose_at(0, 0.3, 7);
    CHECK_INT(pal_session_request_pose(before, 0, &pose), 0);
    const pal_frame *f = stepped_steps(before, 4);
    CHECK_INT(f->tool[0].pose.seq, 7);
    CHECK(pal_session_take_frame(next) == NULL);
    REQUIRE(stepped_transfer(next, before, transfer_all, &hash));
    CHECK(hash != 0);
    CHECK_INT(stepped_newest(next)->tick, 4);
    pose = pose_at(0, 0.25, 8);
    CHECK_INT(pal_session_request_pose(next, 0, &pose), 0);
    f = stepped_steps(next, 3);
    CHECK_INT(f->tick, 7);
    CHECK_NEAR(f->time_s, 7 * scene.step_s, 1e-9);
    CHECK(f->tool[0].present && f->tool[1].present);
    CHECK_INT(f->tool[0].pose.seq, 8);
    pal_session_close(before);
    CHECK_INT(stepped_order(next, PAL_COMMAND_PAUSE), 0);
    CHECK(stepped_steps(next, 1)->paused);
    pal_session_close(next);
}

/* poses that no step has taken yet are those of the next session */
static void so_do_the_edges_of_a_grasp(void)
{
    uint64_t hash = 0;
    pal_session *before = open_with((pal_session_options){0}), *next = NULL;
    REQUIRE(before && !pal_session_open_after(before, &scene, NULL, &next));
    arrive(before, 0.001, true), arrive(before, 0.002, false), arrive(before, 0.003, true), arrive(before, 0.004, true);
    check_step(before, 0.001, true);
    REQUIRE(stepped_transfer(next, before, transfer_all, &hash));
    arrive(next, 0.005, true);
    check_step(next, 0.002, false);
    check_step(next, 0.003, true);
    check_step(next, 0.005, true);
    pal_session_close(before);
    pal_session_close(next);
}

int main(void)
{
    if (!small_scene(&scene, &mesh, CHECK_REPEATS(6, 4))) return 1;
    RUN(a_tool_that_jumps_is_lifted_until_it_rests);
    RUN(the_newest_pose_wins_and_is_echoed_with_its_arrival_time);
    RUN(what_begins_or_ends_a_grasp_has_a_step_of_its_own);
    RUN(another_holder_does_not_keep_a_grasp);
    RUN(an_edge_older_than_the_lease_counts_while_poses_come);
    RUN(a_pause_keeps_no_edge);
    RUN(a_press_holds_the_tissue_where_it_was_pressed);
    RUN(a_silent_holder_loses_the_tool_after_its_lease);
    RUN(while_paused_tools_are_shown_where_they_are_held);
    RUN(another_session_goes_on_where_one_was);
    RUN(so_do_the_edges_of_a_grasp);
    pal_prepared_free(&mesh);
    return check_report();
}
