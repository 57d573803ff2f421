/* Tools on a body with an implicit solver: jumps and a start inside. */
#include "tests/fixtures/fem_tools.h"

static void a_tool_that_jumps_does_not_strike(void)
{
    for (int grasp = 0; grasp < 2; grasp++) {
        fem_scene f;
        REQUIRE(fem_ball(&f, 8, 1, 0.008, 15) && tool_scene_open(&f.s));
        double S = f.s.body->length_scale_m, rise = 0, force = 0, max_J = 15 * 0.02 * S;
        move_tool(&f.s, 0, 0, 0, 0.062, false);
        follow(&f.s, 15, &rise, &force);
        move_tool(&f.s, 0, 0, 0, 0.055, grasp);
        follow(&f.s, 15, &rise, &force);
        /* through the body, out at the side, far away, back */
        const double to[5][3] = {{0, 0, 0.055 - S}, {S, 0, 0}, {0, 0, 3 * S}, {0.01, 0, 0}, {0, 0, 0.055}};
        for (int i = 0; i < 5; i++) {
            move_tool(&f.s, 0, to[i][0], to[i][1], to[i][2], grasp);
            follow(&f.s, 12, &rise, &force);
        }
        printf("  %s: at most %.3g N, energy rose %.3g J in a step, %.3g allowed\n", grasp ? "grasp" : "push", force,
               rise, max_J);
        CHECK_LE(rise, max_J);
        CHECK_LE(force, 15 * (1 + 1e-9));
        CHECK(force > 0.1);
        pal_world_pose(f.s.world, 0, NULL);
        follow(&f.s, 120, &rise, &force);
        CHECK_LE(rms_displacement(f.s.body), 1e-3 * S);
        fem_close(&f);
    }
}

static void starts_inside_without_harm(void)
{
    fem_scene f;
    REQUIRE(fem_ball(&f, 10, 1, 0.008, 15));
    CHECK_INT(pal_entry_put_text(&f.s.scene->body[0].model, "element", "tet4", NULL), 0);
    REQUIRE(tool_scene_open(&f.s));
    double rise = 0, force = 0;
    move_tool(&f.s, 0, 0.005, 0, 0.03, false);
    follow(&f.s, 150, &rise, &force);
    double still = tremble(&f.s, 30);
    printf("  %.3g N, energy rose by %.3g J in a step at most, kinetic %.2g of elastic\n", force, rise, still);
    CHECK_LE(rise, 15 * 0.02 * f.s.body->length_scale_m);
    CHECK(force > 0.1);
    CHECK_LE(still, 1e-6);
    fem_close(&f);
}

int main(void)
{
    RUN(a_tool_that_jumps_does_not_strike);
    RUN_LONG(starts_inside_without_harm);
    return check_report();
}
