/* Tools between poses and contact: they sweep, appear and fade without a jump, and only numbers pass. */
#include "server/sim/core/tools.h"
#include "tests/check.h"

static pal_pose pose_at(double x)
{
    return (pal_pose){.position_m = {x, 0, 0}, .quat = {1, 0, 0, 0}};
}

static void moves_in_equal_parts_and_ends_on_the_pose(void)
{
    pal_tools tools = {.n_tool = 1};
    pal_pose a = pose_at(0), b = pose_at(0.3);
    pal_tool_begin_step(&tools.tool[0], &a, 1.0 / 60);
    pal_tools_end_step(&tools, 1);
    pal_tool_begin_step(&tools.tool[0], &b, 1.0 / 60);
    for (int sub = 0; sub < 7; sub++) {
        pal_tools_begin_substep(&tools, sub, 7, 0.001);
        CHECK_NEAR(tools.tool[0].here_m[0], 0.3 * (sub + 1) / 7, 1e-15);
        CHECK_NEAR(tools.tool[0].velocity_m_s[0], 0.3 / 7 / 0.001, 1e-9);
    }
    CHECK_NEAR(tools.tool[0].here_m[0], 0.3, 0);
    pal_tools_end_step(&tools, 7);
    CHECK_NEAR(tools.tool[0].last.position_m[0], 0.3, 0);
}

static void ends_on_the_pose_when_substeps_are_added_on_the_way(void)
{
    pal_tools tools = {.n_tool = 1};
    pal_pose a = pose_at(0), b = pose_at(1);
    pal_tool_begin_step(&tools.tool[0], &a, 1.0 / 60);
    pal_tools_end_step(&tools, 1);
    pal_tool_begin_step(&tools.tool[0], &b, 1.0 / 60);
    for (int sub = 0, n_sub = 3; sub < n_sub; sub++) {
        if (sub == 2) n_sub = 6;
        double before = tools.tool[0].here_m[0];
        pal_tools_begin_substep(&tools, sub, n_sub, 0.01);
        CHECK(tools.tool[0].here_m[0] > before);
    }
    CHECK_NEAR(tools.tool[0].here_m[0], 1, 0);
}

static void a_tool_that_appears_is_not_swept_from_elsewhere(void)
{
    pal_tools tools = {.n_tool = 1};
    pal_pose far = pose_at(5);
    pal_tool_begin_step(&tools.tool[0], &far, 1.0 / 60);
    pal_tools_begin_substep(&tools, 0, 4, 0.001);
    CHECK_NEAR(tools.tool[0].here_m[0], 5, 0);
    CHECK_NEAR(tools.tool[0].velocity_m_s[0], 0, 0);
    CHECK(tools.tool[0].present);
}

static void a_tool_that_returns_elsewhere_while_fading_starts_again(void)
{
    pal_tools tools = {.n_tool = 1};
    pal_pose a = pose_at(0), b = pose_at(1);
    for (int i = 0; i < 10; i++) pal_tool_begin_step(&tools.tool[0], &a, 1.0 / 60);
    pal_tool_begin_step(&tools.tool[0], NULL, 1.0 / 60);
    CHECK_NEAR(tools.tool[0].ramp, 0.9, 1e-12);
    pal_tool_begin_step(&tools.tool[0], &b, 1.0 / 60);
    pal_tools_begin_substep(&tools, 0, 2, 0.001);
    CHECK_NEAR(tools.tool[0].ramp, 0.1, 1e-12);
    CHECK_NEAR(tools.tool[0].here_m[0], 1, 0);
    CHECK_NEAR(tools.tool[0].velocity_m_s[0], 0, 0);
}

static void forces_ramp_up_over_a_sixth_of_a_second_and_down_when_released(void)
{
    pal_tools tools = {.n_tool = 1};
    pal_pose a = pose_at(0.1);
    a.buttons = 1;
    for (int i = 1; i <= 12; i++) {
        pal_tool_begin_step(&tools.tool[0], &a, 1.0 / 60);
        CHECK_NEAR(tools.tool[0].ramp, fmin(1, i / 10.0), 1e-12);
        CHECK(tools.tool[0].grasp);
        pal_tools_end_step(&tools, 1);
    }
    for (int i = 1; i <= 12; i++) {
        pal_tool_begin_step(&tools.tool[0], NULL, 1.0 / 60);
        CHECK_NEAR(tools.tool[0].ramp, fmax(0, 1 - i / 10.0), 1e-12);
        CHECK(!tools.tool[0].present);
        CHECK(!tools.tool[0].grasp);
        CHECK_NEAR(tools.tool[0].requested.position_m[0], 0.1, 0);
        pal_tools_end_step(&tools, 1);
    }
    CHECK_NEAR(tools.tool[0].ramp, 0, 0);
}

static void reports_the_mean_force_of_its_substeps(void)
{
    pal_tools tools = {.n_tool = 1};
    pal_pose a = pose_at(0);
    pal_tool_begin_step(&tools.tool[0], &a, 1.0 / 60);
    for (int sub = 0; sub < 4; sub++) {
        pal_tools_begin_substep(&tools, sub, 4, 0.001);
        CHECK_NEAR(tools.tool[0].force_N[2], 0, 0);
        tools.tool[0].force_N[2] += sub;
    }
    pal_tools_end_step(&tools, 4);
    CHECK_NEAR(tools.tool[0].mean_force_N[2], 1.5, 1e-15);
}

static void passes_only_poses_that_are_numbers_within_reach(void)
{
    pal_pose good = pose_at(1), bad;
    CHECK(pal_pose_ok(&good, 2));
    CHECK(!pal_pose_ok(&good, 0.5));
    const double wrong[] = {NAN, INFINITY, -INFINITY, 1e300};
    for (int i = 0; i < 4; i++) {
        for (int c = 0; c < 3; c++) {
            bad = good, bad.position_m[c] = wrong[i];
            CHECK(!pal_pose_ok(&bad, 2));
            bad = good, bad.velocity_m_s[c] = wrong[i];
            CHECK(!pal_pose_ok(&bad, 2));
        }
        bad = good, bad.quat[i] = wrong[i];
        CHECK(!pal_pose_ok(&bad, 2));
    }
    bad = good, bad.quat[0] = 0.5;
    CHECK(!pal_pose_ok(&bad, 2));
}

int main(void)
{
    RUN(moves_in_equal_parts_and_ends_on_the_pose);
    RUN(ends_on_the_pose_when_substeps_are_added_on_the_way);
    RUN(a_tool_that_appears_is_not_swept_from_elsewhere);
    RUN(a_tool_that_returns_elsewhere_while_fading_starts_again);
    RUN(forces_ramp_up_over_a_sixth_of_a_second_and_down_when_released);
    RUN(reports_the_mean_force_of_its_substeps);
    RUN(passes_only_poses_that_are_numbers_within_reach);
    return check_report();
}
