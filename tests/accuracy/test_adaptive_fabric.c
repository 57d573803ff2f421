/* Figs. 9 and 10 of paper C: a rectangle of stiff fabric, coarse and wholly refined, pressed in its middle for a
 * second. With the membrane law both move alike; with the paper's law (erratum C4) the refined one is too soft. And the
 * two halves of that statement on their own: how far a sheet is stretched by a force on its border, how deep it is
 * pressed. */
#include "tests/fixtures/adaptive_worlds.h"

enum { STEPS_A_SECOND = 60, STEPS = 2 * STEPS_A_SECOND };

static const double side_m = 0.2;

/* n x n vertices, held along its border */
static bool take_sheet(shell_scene *s, int n, int levels, int level, const char *law)
{
    pal_surface surface;
    if (pal_sheet_make(n, n, side_m, side_m, &surface, NULL)) return false;
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", levels);
    shell_scene_number(s, "start_level", level);
    shell_scene_number(s, "k_shape_N_m", 0);
    shell_scene_number(s, "thickness_m", 1e-3);
    shell_scene_text(s, "law", law);
    pal_entry_put_bool(shell_scene_model(s), "refine", false, NULL);
    s->scene->body[0].material.young_Pa = 2e5;
    s->scene->body[0].material.damping_1_s = 30;
    return true;
}

static void hold_border(shell_scene *s)
{
    double edge = 0.5 * side_m, out = edge + 1e-4, in = edge - 1e-4;
    const double side[4][2][3] = {{{-out, -out, -1}, {out, -in, 1}},
                                  {{-out, in, -1}, {out, out, 1}},
                                  {{-out, -out, -1}, {-in, out, 1}},
                                  {{in, -out, -1}, {out, out, 1}}};
    for (int k = 0; k < 4; k++) shell_scene_hold(s, side[k][0], side[k][1]);
}

static bool press_curve(int level, const char *law, double curve[STEPS])
{
    shell_scene s;
    const double at[3] = {0, 0, 0}, press[3] = {0, 0, -0.5}, none[3] = {0, 0, 0};
    if (!take_sheet(&s, 9, 2, level, law)) return false;
    hold_border(&s);
    if (!shell_scene_start(&s)) return false;
    int node = shell_scene_nearest(&s, at);
    for (int step = 0; step < STEPS; step++) {
        shell_scene_press(&s, at, 0.075, step < STEPS_A_SECOND ? press : none);
        if (pal_world_step(s.world, 1.0 / STEPS_A_SECOND)) return false;
        curve[step] = -s.body->x[3 * node + 2];
    }
    shell_scene_close(&s);
    return true;
}

static void compare(const char *law, double *worst, double *ratio)
{
    double coarse[STEPS], fine[STEPS], max = 0;
    *worst = 0;
    REQUIRE(press_curve(0, law, coarse) && press_curve(1, law, fine));
    for (int i = 0; i < STEPS; i++) max = fmax(max, fabs(coarse[i]));
    for (int i = 0; i < STEPS; i++) *worst = fmax(*worst, fabs(coarse[i] - fine[i]) / max);
    *ratio = fine[STEPS_A_SECOND - 1] / coarse[STEPS_A_SECOND - 1];
    printf("  %s law: pressed %.1f mm, curves %.2f %% apart at most, refined over coarse at one second %.3f\n", law,
           1e3 * max, 100 * *worst, *ratio);
}

static void coarse_and_refined_fabric_move_alike(void)
{
    double worst, ratio;
    compare("membrane", &worst, &ratio);
    CHECK_LE(worst, 0.05);
}

static void the_papers_law_softens_refined_fabric(void)
{
    double worst, ratio;
    compare("paper", &worst, &ratio);
    /* erratum C4: 1.27 pressed, computed for another sheet and load */
    CHECK(ratio > 1.15 && ratio < 1.4);
}

/* one end held, the other pulled along x with the same force on every level */
static double stretch(int level, const char *law)
{
    shell_scene s;
    const double low[3] = {-1, -1, -1}, high[3] = {-0.5 * side_m + 1e-4, 1, 1};
    if (!take_sheet(&s, 9, 2, level, law)) return NAN;
    shell_scene_hold(&s, low, high);
    if (!shell_scene_start(&s)) return NAN;
    /* an even traction: corners bear half */
    double sum = 0, all = 0, edge = 0.5 * side_m;
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < s.body->n_active; k++) {
            int i = pal_body_point(s.body, k);
            double weight = fabs(s.body->x_rest[3 * i + 1]) > edge - 1e-4 ? 0.5 : 1;
            if (s.body->x_rest[3 * i] < edge - 1e-4) continue;
            if (pass == 0)
                all += weight;
            else
                pal_world_load(s.world, 0, i, (const double[3]){0.5 * weight / all, 0, 0});
        }
    for (int step = 0; step < 3 * STEPS_A_SECOND; step++)
        if (pal_world_step(s.world, 1.0 / STEPS_A_SECOND)) return NAN;
    for (int k = 0; k < s.body->n_active; k++) {
        int i = pal_body_point(s.body, k);
        double weight = fabs(s.body->x_rest[3 * i + 1]) > edge - 1e-4 ? 0.5 : 1;
        if (s.body->x_rest[3 * i] > edge - 1e-4) sum += weight / all * (s.body->x[3 * i] - s.body->x_rest[3 * i]);
    }
    shell_scene_close(&s);
    return sum;
}

static void refinement_keeps_the_stretch_of_a_sheet(void)
{
    double coarse = stretch(0, "membrane"), fine = stretch(1, "membrane"), paper = stretch(1, "paper"),
           soft = stretch(0, "paper");
    /* squares cut alike have Young's modulus k along x, k = sqrt(3)/2 E t, when the strip may shear freely */
    double plain = 0.5 / (0.5 * sqrt(3) * 2e5 * 1e-3);
    printf("  stretched by %.3f (coarse) and %.3f mm, %.3f of it; a strip that shears freely %.3f mm; the paper's law "
           "%.3f of it\n",
           1e3 * coarse, 1e3 * fine, fine / coarse, 1e3 * plain, paper / soft);
    CHECK_NEAR(fine / coarse, 1, 0.05);
    CHECK_NEAR(coarse / plain, 1, 0.03);
    /* C4: 1.81 for all edges alike */
    CHECK(paper / soft > 1.6 && paper / soft < 2.1);
}

int main(void)
{
    RUN(coarse_and_refined_fabric_move_alike);
    RUN(the_papers_law_softens_refined_fabric);
    RUN(refinement_keeps_the_stretch_of_a_sheet);
    return check_report();
}
