/* Hard cases (catalogue.txt) for model fem: tools that jump, appear inside, press against one another, and poses
 * and loads that are no numbers. */
#include "tests/fixtures/fem_tools.h"
#include "tests/stability/fem_case.h"
#include "tests/stability/hard_case.h"

static bool open_tools(fem_scene *f, const hard_kind *kind)
{
    pal_config_entry *model = &f->s.scene->body[0].model;
    pal_entry_put_text(model, "element", kind->element, NULL);
    pal_entry_put_text(model, "law", kind->law, NULL);
    return tool_scene_open(&f->s);
}

static void check_caps(const tool_scene *s)
{
    for (int t = 0; t < pal_world_tools(s->world)->n_tool; t++) {
        const pal_tool *tool = tool_of(s, t);
        CHECK(pal_finite3(tool->force_N));
        CHECK(pal_norm3(tool->force_N) <= tool->force_cap_N * (1 + 1e-9));
    }
}

/* tools are gone: within 5 s at rest for half a second */
static void check_comes_back(tool_scene *s)
{
    for (int t = 0; t < pal_world_tools(s->world)->n_tool; t++) pal_world_pose(s->world, t, NULL);
    int n_at_rest = 0;
    for (int i = 0; i < 300 && n_at_rest < 30; i++) {
        REQUIRE(step_world(s, 1));
        n_at_rest = rms_displacement(s->body) <= 1e-3 * s->body->length_scale_m ? n_at_rest + 1 : 0;
    }
    CHECK(!s->body->frozen);
    CHECK_INT(n_at_rest, 30);
}

/* fewer voxels for elements of ten nodes */
static int resolution_of(int kind)
{
    return kind >= HARD_TET10 ? 4 : CHECK_REPEATS(6, 4);
}

static void poses_and_loads_that_are_no_numbers_are_refused(void)
{
    static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    fem_scene f;
    REQUIRE(fem_slab(&f, 4, 4, 2, 0.01, 1, 0.01, 15) && open_tools(&f, &hard_kinds[0]));
    tool_scene *s = &f.s;
    move_tool(s, 0, 0.02, 0.02, 0.025, false);
    REQUIRE(step_world(s, 10));
    uint64_t hash = pal_world_hash(s->world);
    for (int k = 0; k < 5; k++) {
        for (int c = 0; c < 3; c++) {
            pal_pose pose = {.position_m = {0.02, 0.02, 0.025}, .quat = {1, 0, 0, 0}};
            pose.position_m[c] = bad[k];
            CHECK_INT(pal_world_pose(s->world, 0, &pose), PAL_ERR_REFUSED);
            pal_pose turned = {.position_m = {0.02, 0.02, 0.025}, .quat = {1, 0, 0, 0}};
            turned.quat[c + 1] = k < 3 ? bad[k] : NAN;
            CHECK_INT(pal_world_pose(s->world, 0, &turned), PAL_ERR_REFUSED);
            double force[3] = {0, 0, 0};
            force[c] = k < 3 ? bad[k] : NAN;
            CHECK_INT(pal_world_load(s->world, 0, 3, force), PAL_ERR_REFUSED);
        }
        CHECK_INT(pal_world_step(s->world, k < 3 ? bad[k] : -1e300), PAL_ERR_REFUSED);
    }
    CHECK(hash == pal_world_hash(s->world));
    /* 1e300 N is a number: it is capped */
    REQUIRE(!pal_world_load(s->world, 0, 30, (const double[3]){0, 0, 1e300}));
    REQUIRE(step_world(s, 10));
    CHECK(pal_body_finite(s->body) && s->body->safeguards.n_capped > 0);
    fem_close(&f);
}

/* energy may rise by no more than cap x 0.02 S in the step of the jump */
static void a_tool_that_jumps_into_the_body_gives_no_more_than_cap_times_clamp(void)
{
    const double to[3][3] = {{0, 0, 0}, {0, 0, -0.1}, {0.02, 0.01, 0.03}};
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_scene f;
        double worst = 0;
        REQUIRE(fem_ball(&f, resolution_of(k), 1, 0.01, 15) && open_tools(&f, &hard_kinds[k]));
        for (int way = 0; way < CHECK_REPEATS(3, 1); way++) {
            pal_world_reset(f.s.world);
            move_tool(&f.s, 0, 0, 0, f.s.body->length_scale_m - 0.05, false);
            REQUIRE(step_world(&f.s, 12));
            double before = pal_world_energy_J(f.s.world), max = 15 * 0.02 * f.s.body->length_scale_m;
            move_tool(&f.s, 0, to[way][0], to[way][1], to[way][2], false);
            REQUIRE(step_world(&f.s, 1));
            double rise = pal_world_energy_J(f.s.world) - before;
            worst = fmax(worst, rise / max);
            HARD_CASE("teleport", "fem", "rise of energy over what is allowed", rise / max, 1, "");
            check_caps(&f.s);
            for (int i = 0; i < 30; i++) {
                REQUIRE(step_world(&f.s, 1));
                check_caps(&f.s);
            }
            CHECK(pal_body_finite(f.s.body) && !f.s.body->frozen);
        }
        check_comes_back(&f.s);
        printf("  %-11s rises by %.2g of what is allowed, back within %.2g S\n", hard_kinds[k].shown, worst,
               rms_displacement(f.s.body) / f.s.body->length_scale_m);
        fem_close(&f);
    }
}

static void a_tool_that_appears_inside_pushes_out_gently(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_scene f;
        REQUIRE(fem_ball(&f, resolution_of(k), 1, 0.01, 15) && open_tools(&f, &hard_kinds[k]));
        move_tool(&f.s, 0, 0.025, 0, 0.005, false);
        double first = 0, max = 0, rise = 0;
        for (int i = 0; i < 30; i++) {
            REQUIRE(step_world(&f.s, 1));
            check_caps(&f.s);
            double now = pal_world_energy_J(f.s.world);
            if (i == 0) first = pal_norm3(tool_of(&f.s, 0)->mean_force_N), rise = now;
            max = fmax(max, pal_body_kinetic_J(f.s.body));
        }
        printf("  %-11s begins with %.2g N, energy rises by %.2g of what is allowed\n", hard_kinds[k].shown, first,
               rise / (15 * 0.02 * f.s.body->length_scale_m));
        HARD_CASE("tool_inside", "fem", "rise of energy over what is allowed",
                  rise / (15 * 0.02 * f.s.body->length_scale_m), 1, "");
        CHECK_LE(max, 15 * 0.02 * f.s.body->length_scale_m);
        CHECK(!f.s.body->frozen);
        check_comes_back(&f.s);
        fem_close(&f);
    }
}

/* two hands press one sheet against one another: forces in balance, calm, and back when they are gone */
static void two_tools_press_against_one_another(void)
{
    for (int k = 0; k < HARD_KINDS; k++) {
        fem_scene f;
        REQUIRE(fem_slab(&f, 6, 6, 2, 0.01, 2, 0.012, 15));
        f.s.scene->body[0].support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {0.001, 1, 1}};
        REQUIRE(open_tools(&f, &hard_kinds[k]));
        for (int i = 0; i < 180; i++) {
            double close = fmin(0.006, 0.0001 * i);
            move_tool(&f.s, 0, 0.04, 0.03, 0.032 - close, false);
            move_tool(&f.s, 1, 0.04, 0.03, -0.012 + close, false);
            REQUIRE(step_world(&f.s, 1));
            check_caps(&f.s);
        }
        const double *up = tool_of(&f.s, 0)->mean_force_N, *down = tool_of(&f.s, 1)->mean_force_N;
        double kinetic = pal_body_kinetic_J(f.s.body);
        printf("  %-11s %.3g and %.3g N, kinetic energy %.2g of what is stored\n", hard_kinds[k].shown, up[2], down[2],
               kinetic / elastic_J(&f.s));
        CHECK(up[2] > 0.1 && down[2] < -0.1);
        HARD_CASE("two_tools", "fem", "forces differ by", 100 * fabs(up[2] + down[2]) / up[2], 10, "%");
        CHECK_LE(kinetic, 1e-3 * elastic_J(&f.s));
        check_comes_back(&f.s);
        fem_close(&f);
    }
}

int main(void)
{
    RUN(poses_and_loads_that_are_no_numbers_are_refused);
    RUN_LONG(a_tool_that_jumps_into_the_body_gives_no_more_than_cap_times_clamp);
    RUN(a_tool_that_appears_inside_pushes_out_gently);
    RUN_LONG(two_tools_press_against_one_another);
    return check_report();
}
