/* Tools on a body with an implicit solver: soft and hard ones, stirred and left alone. */
#include "tests/fixtures/fem_tools.h"

/* soft and hard bodies, a tool of 2.5 % of the body that stirs half a radius deep (tets: three radii), then rests: what
 * still moves dies away, and after the tool has left all goes back (the softest rocks on its foot for seconds) */
static void stays_calm_whatever_the_stiffness(void)
{
    const double modulus[2][2] = {{1e3, 1e6}, {1e3, 1e5}};
    for (int tets = CHECK_REPEATS(0, 1); tets < 2; tets++)
        for (int k = 0; k < CHECK_REPEATS(2, 1); k++) {
            fem_scene f;
            double young = modulus[tets][k];
            int rate = 60;
            REQUIRE(fem_ball(&f, 10, 1, 0.025 * 0.17, 15));
            f.s.scene->step_s = 1.0 / rate;
            f.s.scene->body[0].material.young_Pa = young;
            CHECK_INT(pal_entry_put_text(&f.s.scene->body[0].model, "element", tets ? "tet4" : "hex8_bbar", NULL), 0);
            REQUIRE(tool_scene_open(&f.s));
            double S = f.s.body->length_scale_m, rise = 0, force = 0, deep_m = tets ? 0.012 : 0.002;
            for (int i = 0; i < 2 * rate / 3; i++) {
                double t = (double)i / rate;
                move_tool(&f.s, 0, 0.015 * sin(6 * t), 0.01 * sin(17 * t), 0.054 - fmin(1, 3 * t) * deep_m, false);
                follow(&f.s, 1, &rise, &force);
            }
            follow(&f.s, rate / 3, &rise, &force);
            double early = tremble(&f.s, 12);
            follow(&f.s, rate, &rise, &force);
            double late = tremble(&f.s, 12);
            printf("  %s, E %.0e Pa: up to %.3g N, energy rose %.2g of what a step may, kinetic %.2g, later %.2g of "
                   "elastic\n",
                   tets ? "tets" : "hexahedra", young, force, rise / (15 * 0.02 * S), early, late);
            CHECK_LE(rise, 15 * 0.02 * S);
            CHECK_LE(force, 15 * (1 + 1e-9));
            CHECK(force > 0);
            CHECK_LE(late, fmax(1e-5, 0.5 * early));
            CHECK_INT((int)f.s.body->frozen, 0);
            pal_world_pose(f.s.world, 0, NULL);
            follow(&f.s, rate, &rise, &force);
            CHECK_LE(rms_displacement(f.s.body), (young < 1e4 ? 2e-2 : 1e-3) * S);
            fem_close(&f);
        }
}

int main(void)
{
    RUN(stays_calm_whatever_the_stiffness);
    return check_report();
}
