/* Hard cases (catalogue.txt) for adaptive surface springs and their refinement: whatever is done to a surface,
 * its state stays finite, its energy does not grow, its mass stays, and with anchors it comes back. Bodies run coarse,
 * refined and adapting: refinement must not make any of it worse. */
#include "tests/fixtures/adaptive_worlds.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/random.h"
#include "tests/stability/hard_case.h"

enum { STEPS_A_SECOND = 60 };
static const double recover_s = 1.2;

typedef enum run_kind { COARSE, REFINED, ADAPTIVE, KINDS } run_kind;
static const char *const kind_name[KINDS] = {"coarse", "refined", "adaptive"};
static const double radius_m = 0.05;

static uint64_t seed;
static double uniform(void) /* in [-1, 1) */
{
    return random_signed(&seed);
}

/* a sphere with its lowest part held, anchors on its rest place, damped */
static bool take_sphere(shell_scene *s, run_kind kind)
{
    pal_surface surface;
    if (pal_sphere_make(radius_m, &surface)) return false;
    seed = 7;
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", 3);
    if (kind == REFINED) shell_scene_number(s, "start_level", 1);
    if (kind != ADAPTIVE) pal_entry_put_bool(shell_scene_model(s), "refine", false, NULL);
    shell_scene_hold(s, (const double[3]){-1, -1, -1}, (const double[3]){1, 1, -0.9 * radius_m});
    s->scene->body[0].material.damping_1_s = 4;
    return true;
}

static double total_mass(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < body->n_node; i++) sum += body->mass_kg[i];
    return sum;
}

/* runs and checks after every step that all is finite, energy is never above that of the start (and 1 %), mass stays;
 * returns the distance from rest at the end over the size */
static double run_bounded(shell_scene *s, double seconds)
{
    double start = pal_world_energy_J(s->world), max = 0, mass = total_mass(s->body), off = 0;
    for (int i = 0; i < (int)(seconds * STEPS_A_SECOND); i++) {
        if (pal_world_step(s->world, 1.0 / STEPS_A_SECOND) || !pal_body_finite(s->body)) return NAN;
        max = fmax(max, pal_world_energy_J(s->world));
        off = fmax(off, fabs(total_mass(s->body) / mass - 1));
    }
    CHECK_LE(max, 1.01 * start);
    CHECK_LE(off, 1e-12);
    CHECK(!s->body->frozen);
    return shell_scene_rms(s) / s->body->length_scale_m;
}

typedef enum trial_case { FLAT, POINT, MIRRORED, SHUFFLED, BLOWN_UP, INVERTED, TOUCHING, CASES } trial_case;
static const char *const case_name[CASES] = {"flat",     "on a point",        "mirrored",      "shuffled in its box",
                                             "blown up", "turned inside out", "walls touching"};

static const char *const case_case[CASES] = {"plane", "point", "mirror", "shuffle", "blown_up", "inverted", "inverted"};

static void case_node(const double *rest, trial_case kind, double *x)
{
    switch (kind) {
    case FLAT:
        x[2] = 0;
        break;
    case POINT:
        pal_set3(x, 0.001, 0.002, 0.003);
        break;
    case MIRRORED:
        x[0] = -rest[0];
        break;
    case SHUFFLED:
        for (int c = 0; c < 3; c++) x[c] = radius_m * uniform();
        break;
    case BLOWN_UP:
        pal_scale3(x, 100, rest);
        break;
    case INVERTED: /* the upper half goes through the lower one */
        if (rest[2] > 0) x[2] = -1.5 * rest[2];
        break;
    case TOUCHING: /* the wall on top comes down on the one below */
        if (rest[2] > 0) x[2] = -rest[2] + 1e-6;
        break;
    default:
        break;
    }
}

static void disturbed(trial_case kind, double seconds, double back)
{
    for (int run = 0; run < KINDS; run++) {
        shell_scene s;
        REQUIRE(take_sphere(&s, (run_kind)run));
        shell_scene_text(&s, "frame", "world");
        REQUIRE(shell_scene_start(&s));
        for (int k = 0; k < s.body->n_active; k++) {
            int i = pal_body_point(s.body, k);
            if (!s.body->support[i]) case_node(s.body->x_rest + 3 * i, kind, s.body->x + 3 * i);
        }
        pal_world_invalidate_limits(s.world, 0);
        double left = run_bounded(&s, seconds);
        printf("  %s, %s: %.3g of its size left, %d nodes\n", case_name[kind], kind_name[run], left, s.body->n_active);
        CHECK_LE(left, back);
        HARD_CASE(case_case[kind], "adaptive_springs", "off rest after 1.2 s", 100 * left, 0.1, "% S");
        shell_scene_close(&s);
    }
}

static void a_flattened_shell_opens_again(void)
{
    disturbed(FLAT, recover_s, 1e-3);
}
static void a_shell_on_a_point_opens_again(void)
{
    disturbed(POINT, recover_s, 1e-3);
}
static void a_mirrored_shell_comes_back(void)
{
    disturbed(MIRRORED, recover_s, 1e-3);
}
static void a_shuffled_shell_comes_back(void)
{
    disturbed(SHUFFLED, recover_s, 1e-3);
}
static void a_shell_blown_up_a_hundredfold_comes_back(void)
{
    disturbed(BLOWN_UP, recover_s, 1e-3);
}
static void a_shell_turned_inside_out_comes_back(void)
{
    disturbed(INVERTED, recover_s, 1e-3);
}
static void a_shell_whose_walls_touch_comes_back(void)
{
    disturbed(TOUCHING, recover_s, 1e-3);
}

/* every second edge of level 0 without length: both its ends on one place */
static void edges_without_length_open_again(void)
{
    for (int run = 0; run < KINDS; run++) {
        shell_scene s;
        REQUIRE(take_sphere(&s, (run_kind)run));
        REQUIRE(shell_scene_start(&s));
        const pal_adaptive_surface *adaptive = s.body->model.adaptive;
        int n = 0;
        for (int k = 0; k < adaptive->n_spring; k += 5) {
            const int32_t *end = adaptive->levels.edge[adaptive->spring[k]].vertex;
            if (s.body->support[end[0]] || s.body->support[end[1]]) continue;
            pal_copy3(s.body->x + 3 * end[1], s.body->x + 3 * end[0]);
            n++;
        }
        CHECK(n > 20);
        pal_world_invalidate_limits(s.world, 0);
        HARD_CASE("no_length", "adaptive_springs", "off rest after 1.2 s", 100 * run_bounded(&s, recover_s), 0.1,
                  "% S");
        shell_scene_close(&s);
    }
}

/* a lasting load far beyond any tissue: shortened to the node's cap, and gone again */
static void a_million_newtons_on_a_node_for_a_second_leave_nothing(void)
{
    for (int run = 0; run < KINDS; run++) {
        shell_scene s;
        const double top[3] = {0, 0, radius_m};
        REQUIRE(take_sphere(&s, (run_kind)run));
        REQUIRE(shell_scene_start(&s));
        int node = shell_scene_nearest(&s, top);
        REQUIRE(!pal_world_load(s.world, 0, node, (const double[3]){0, 0, -1e6}));
        for (int i = 0; i < STEPS_A_SECOND; i++) {
            REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
            REQUIRE(pal_body_finite(s.body));
        }
        CHECK(s.body->safeguards.n_capped > 0);
        REQUIRE(!pal_world_load(s.world, 0, node, (const double[3]){0, 0, 0}));
        HARD_CASE("meganewton", "adaptive_springs", "off rest 1.2 s after", 100 * run_bounded(&s, recover_s), 0.1,
                  "% S");
        shell_scene_close(&s);
    }
}

/* stiffness jumps by a thousand and back while the body is bent: sub-steps are chosen anew, nothing breaks */
static void a_thousandfold_jump_of_stiffness_is_borne(void)
{
    for (int run = 0; run < KINDS; run++) {
        shell_scene s;
        const double top[3] = {0, 0, radius_m};
        REQUIRE(take_sphere(&s, (run_kind)run));
        REQUIRE(shell_scene_start(&s));
        for (int i = 0; i < 12; i++) {
            shell_scene_press(&s, top, 0.02, (const double[3]){0, 0, -0.5});
            REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        }
        pal_material material = s.scene->body[0].material;
        int before = pal_world_substeps(s.world);
        material.young_Pa *= 1000;
        REQUIRE(!pal_world_material(s.world, 0, &material, &s.diag));
        for (int i = 0; i < 12; i++) {
            shell_scene_press(&s, top, 0.02, (const double[3]){0, 0, -0.5});
            REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
            REQUIRE(pal_body_finite(s.body));
        }
        CHECK(pal_world_substeps(s.world) > 5 * before);
        material.young_Pa /= 1000;
        REQUIRE(!pal_world_material(s.world, 0, &material, &s.diag));
        shell_scene_press(&s, top, 0.02, (const double[3]){0, 0, 0});
        CHECK_LE(run_bounded(&s, recover_s), 1e-3);
        shell_scene_close(&s);
    }
}

/* a patch a thousand times as stiff as the rest moves with it and does not blow up */
static void a_patch_a_thousand_times_as_stiff_is_borne(void)
{
    for (int run = 0; run < KINDS; run++) {
        shell_scene s;
        const double side[3] = {radius_m, 0, 0};
        REQUIRE(take_sphere(&s, (run_kind)run));
        /* two levels: the stiff part asks for 30 times as many sub-steps already */
        shell_scene_model(&s)->n_value = 0;
        s.scene->body[0].material.damping_1_s = 12;
        shell_scene_number(&s, "levels", 2);
        if (run == REFINED) shell_scene_number(&s, "start_level", 1);
        if (run != ADAPTIVE) pal_entry_put_bool(shell_scene_model(&s), "refine", false, NULL);
        pal_body_def *def = &s.scene->body[0];
        def->n_region = 1;
        def->region[0] = (pal_region){.kind = PAL_REGION_BOX,
                                      .young_Pa = 1000 * def->material.young_Pa,
                                      .poisson = NAN,
                                      .density_kg_m3 = NAN,
                                      .low_m = {-1, -1, 0.6 * radius_m},
                                      .high_m = {1, 1, 1}};
        REQUIRE(shell_scene_start(&s));
        const int pressed = run == REFINED ? 6 : CHECK_REPEATS(12, 6);
        for (int i = 0; i < pressed; i++) {
            shell_scene_press(&s, side, 0.02, (const double[3]){-0.5, 0, 0});
            REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        }
        /* the stiff cap keeps its shape: distances within it hardly change */
        double max = 0;
        const pal_body *b = s.body;
        for (int i = 0; i < s.mesh.surface.n_vertex; i++)
            for (int j = 0; j < i; j++) {
                const double *p = b->x_rest + 3 * i, *q = b->x_rest + 3 * j;
                if (p[2] < 0.62 * radius_m || q[2] < 0.62 * radius_m) continue;
                max = fmax(max, fabs(pal_dist3(b->x + 3 * i, b->x + 3 * j) / pal_dist3(p, q) - 1));
            }
        CHECK_LE(max, 0.02);
        shell_scene_press(&s, side, 0.02, (const double[3]){0, 0, 0});
        /* wholly refined only as long as it takes to see that it is bounded */
        double left = run_bounded(&s, run == REFINED ? 0.1 : CHECK_REPEATS(0.7, 0.2));
        CHECK_LE(left, run == REFINED ? 0.1 : CHECK_REPEATS(1e-3, 0.1));
        shell_scene_close(&s);
    }
}

/* the same body a millionth and a million times as large, soft and stiff as can be; densities so that times stay: the
 * same motion, levels included */
static double scaled_way(double scale, double stiffer, int *n_node)
{
    shell_scene s;
    pal_surface surface;
    if (pal_sphere_make(radius_m * scale, &surface)) return NAN;
    shell_scene_take(&s, &surface);
    shell_scene_number(&s, "thickness_m", 0.003 * scale);
    shell_scene_text(&s, "frame", "world");
    s.scene->body[0].material.young_Pa *= stiffer;
    s.scene->body[0].material.density_kg_m3 *= stiffer / (scale * scale);
    if (!shell_scene_start(&s)) return NAN;
    const double top[3] = {0, 0, radius_m * scale};
    double way = 0;
    int node = shell_scene_nearest(&s, top);
    for (int i = 0; i < 30; i++) {
        shell_scene_press(&s, top, 0.03 * scale, (const double[3]){0, 0, -0.3 * stiffer * scale * scale});
        if (pal_world_step(s.world, 1.0 / STEPS_A_SECOND)) return NAN;
        way = pal_dist3(s.body->x + 3 * node, s.body->x_rest + 3 * node) / scale;
    }
    *n_node = s.body->n_active;
    shell_scene_close(&s);
    return way;
}

static void size_does_not_matter(void)
{
    int n = 0, m = 0;
    double way = scaled_way(1, 1, &n);
    CHECK(way > 1e-3 && n > 114);
    for (int k = 0; k < 2; k++) {
        HARD_CASE("scales", "adaptive_springs", "scaled answers differ by",
                  fabs(scaled_way(k ? 1e6 : 1e-6, k ? 2e8 : 2e-7, &m) / way - 1), 1e-4, "of the way");
        CHECK_INT(m, n);
    }
}

/* free in space, no supports, anchors on the body: pushed for a moment it flies on as it should */
static void a_free_shell_keeps_its_momentum(void)
{
    shell_scene s;
    const double top[3] = {0, 0, radius_m};
    double before[3], after[3];
    REQUIRE(take_sphere(&s, ADAPTIVE));
    s.scene->body[0].n_support = 0;
    s.scene->body[0].material.damping_1_s = 0;
    REQUIRE(shell_scene_start(&s));
    for (int i = 0; i < 6; i++) {
        shell_scene_press(&s, top, 0.02, (const double[3]){0.2, 0, -0.3});
        REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
    }
    shell_scene_press(&s, top, 0.02, (const double[3]){0, 0, 0});
    body_momentum(s.body, before);
    CHECK_NEAR(before[0], 0.2 * 0.1, 1e-6);
    CHECK_NEAR(before[2], -0.3 * 0.1, 1e-6);
    int min = s.body->n_active, max = min;
    double energy = pal_world_energy_J(s.world), high = energy;
    uint64_t revision = 0;
    for (int i = 0; i < CHECK_REPEATS(10000, 360); i++) {
        REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        if (i == 2 * STEPS_A_SECOND) revision = s.body->display.revision;
        /* after six seconds what is left is a steady turn, and that changes nothing */
        if (i == 6 * STEPS_A_SECOND - 1) CHECK_INT(s.body->display.revision, revision);
        min = s.body->n_active < min ? s.body->n_active : min;
        max = s.body->n_active > max ? s.body->n_active : max;
        high = fmax(high, pal_world_energy_J(s.world));
    }
    body_momentum(s.body, after);
    HARD_CASE("momentum", "adaptive_springs", "drift of momentum in 10,000 steps, levels changing",
              pal_dist3(before, after) / pal_norm3(before), 1e-4, "");
    HARD_CASE("no_drag", "adaptive_springs", "levels changing: energy over the first", high / energy, 1.01, "");
    printf("  %d to %d nodes while it flew\n", min, max);
    CHECK(max > min);
    shell_scene_close(&s);
}

static void a_tool_that_jumps_through_the_shell_is_borne(void)
{
    for (int run = 0; run < KINDS; run++) {
        shell_scene s;
        REQUIRE(take_sphere(&s, (run_kind)run));
        shell_scene_effect(&s, "tool_push");
        shell_scene_effect(&s, "finite_guard");
        pal_tools_default(s.scene, 1);
        REQUIRE(shell_scene_start(&s));
        pal_pose pose = {.position_m = {0, 0, 2 * radius_m}, .quat = {1, 0, 0, 0}};
        double rise = 0;
        for (int i = 0; i < 2 * STEPS_A_SECOND; i++) {
            /* to the other side and back, every quarter of a second; a NaN now and then is refused */
            pose.position_m[2] = i / 15 % 2 ? -2 * radius_m : 2 * radius_m;
            pose.position_m[0] = i % 7 == 3 ? NAN : 0.2 * radius_m;
            pal_err err = pal_world_pose(s.world, 0, &pose);
            CHECK_INT(err != 0, i % 7 == 3);
            const double before = pal_world_energy_J(s.world);
            REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
            REQUIRE(pal_body_finite(s.body));
            /* in the step of a jump */
            if (i % 15 == 0)
                rise = fmax(rise, (pal_world_energy_J(s.world) - before) /
                                      (s.scene->tool[0].force_cap_N * 0.02 * s.body->length_scale_m));
        }
        CHECK(!s.body->frozen);
        HARD_CASE("teleport", "adaptive_springs", "every 0.25 s through it: rise in a step over what is allowed", rise,
                  1, "");
        REQUIRE(!pal_world_pose(s.world, 0, NULL));
        /* ramped out in ten steps */
        for (int i = 0; i < 12; i++) REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        CHECK_LE(run_bounded(&s, recover_s), 1e-3);
        shell_scene_close(&s);
    }
}

static void two_tools_that_press_one_place_are_borne(void)
{
    shell_scene s;
    REQUIRE(take_sphere(&s, ADAPTIVE));
    shell_scene_effect(&s, "tool_push");
    shell_scene_effect(&s, "tool_grasp");
    pal_tools_default(s.scene, 2);
    REQUIRE(shell_scene_start(&s));
    for (int i = 0; i < 2 * STEPS_A_SECOND; i++) {
        double in = fmin(0.6 * radius_m, 1e-3 * i);
        pal_pose from = {.position_m = {1.4 * radius_m - in, 0, 0}, .quat = {1, 0, 0, 0}};
        pal_pose grasp = {.position_m = {radius_m + 0.5 * in, 0, 0}, .quat = {1, 0, 0, 0}, .buttons = 1};
        REQUIRE(!pal_world_pose(s.world, 0, &from) && !pal_world_pose(s.world, 1, &grasp));
        REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        REQUIRE(pal_body_finite(s.body));
    }
    CHECK(!pal_world_pose(s.world, 0, NULL) && !pal_world_pose(s.world, 1, NULL));
    for (int i = 0; i < 12; i++) REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
    HARD_CASE("two_tools", "adaptive_springs", "one pushes, one pulls: off rest 1.2 s after",
              100 * run_bounded(&s, recover_s), 0.1, "% S");
    shell_scene_close(&s);
}

/* a load that lasts: after it has come to rest nothing drifts, and levels do not change any more */
static void at_rest_under_load_nothing_drifts(void)
{
    shell_scene s;
    const double top[3] = {0, 0, radius_m};
    REQUIRE(take_sphere(&s, ADAPTIVE));
    REQUIRE(shell_scene_start(&s));
    int node = shell_scene_nearest(&s, top);
    double x[3];
    uint64_t revision = 0;
    const int body_arena = CHECK_REPEATS(10, 5) * STEPS_A_SECOND, settled = 5 * STEPS_A_SECOND;
    for (int i = 0; i < settled + body_arena; i++) {
        if (i < settled) shell_scene_press(&s, top, 0.02, (const double[3]){0, 0, -0.2});
        REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        if (i == settled) {
            pal_copy3(x, s.body->x + 3 * node);
            revision = s.body->display.revision;
        }
    }
    CHECK_LE(pal_dist3(x, s.body->x + 3 * node), 1e-6 * s.body->length_scale_m);
    CHECK_INT(s.body->display.revision, revision);
    shell_scene_close(&s);
}

static void everything_held_or_tiny_is_fine(void)
{
    shell_scene s;
    REQUIRE(take_sphere(&s, ADAPTIVE));
    shell_scene_hold(&s, (const double[3]){-1, -1, -1}, (const double[3]){1, 1, 1});
    REQUIRE(shell_scene_start(&s));
    uint64_t hash = 0;
    for (int i = 0; i < 10; i++) {
        REQUIRE(!pal_world_load(s.world, 0, 3, (const double[3]){1, 2, 3}));
        REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        hash ^= pal_world_hash(s.world);
    }
    CHECK(hash != 0);
    HARD_CASE("all_held", "adaptive_springs", "moves by", shell_scene_rms(&s), 0, "m");
    shell_scene_close(&s);

    /* a tetrahedron: 4 faces */
    pal_surface four = {.n_vertex = 4, .n_tri = 4};
    static const double x[12] = {0, 0, 0, 0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01};
    static const int32_t tri[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
    four.x = malloc(sizeof x);
    four.tri = malloc(sizeof tri);
    REQUIRE(four.x && four.tri);
    memcpy(four.x, x, sizeof x);
    memcpy(four.tri, tri, sizeof tri);
    shell_scene_take(&s, &four);
    shell_scene_number(&s, "levels", 4);
    REQUIRE(shell_scene_start(&s));
    REQUIRE(!pal_world_load(s.world, 0, 3, (const double[3]){0, 0, 0.02}));
    for (int i = 0; i < 60; i++) {
        REQUIRE(!pal_world_step(s.world, 1.0 / STEPS_A_SECOND));
        REQUIRE(pal_body_finite(s.body));
    }
    shell_scene_close(&s);
}

/* the solver splits a step of any length by its limit: ten and a hundred times as long, the same way */
static double way_by_steps(run_kind kind, double step_s)
{
    shell_scene s;
    const double top[3] = {0, 0, radius_m};
    if (!take_sphere(&s, kind) || !shell_scene_start(&s)) return NAN;
    int node = shell_scene_nearest(&s, top);
    shell_scene_press(&s, top, 0.03, (const double[3]){0, 0, -0.2});
    for (int i = 0; i < (int)lround(5 / step_s); i++)
        if (pal_world_step(s.world, step_s) || !pal_body_finite(s.body)) return NAN;
    double way = s.body->frozen ? NAN : pal_dist3(s.body->x + 3 * node, s.body->x_rest + 3 * node);
    shell_scene_close(&s);
    return way;
}

static void steps_ten_and_a_hundred_times_as_long_come_to_the_same_place(void)
{
    for (int run = COARSE; run <= REFINED; run++) {
        double way = way_by_steps((run_kind)run, 1.0 / STEPS_A_SECOND);
        CHECK(way > 1e-3);
        for (int times = 10; times <= 100; times *= 10)
            HARD_CASE("long_step", "adaptive_springs", "x 10, x 100: the place it comes to differs by",
                      fabs(way_by_steps((run_kind)run, (double)times / STEPS_A_SECOND) / way - 1), 1e-4, "of the way");
    }
}

int main(void)
{
    RUN(steps_ten_and_a_hundred_times_as_long_come_to_the_same_place);
    RUN(a_flattened_shell_opens_again);
    RUN(a_shell_on_a_point_opens_again);
    RUN(a_mirrored_shell_comes_back);
    RUN(a_shuffled_shell_comes_back);
    RUN(a_shell_blown_up_a_hundredfold_comes_back);
    RUN(a_shell_turned_inside_out_comes_back);
    RUN(a_shell_whose_walls_touch_comes_back);
    RUN(edges_without_length_open_again);
    RUN(a_million_newtons_on_a_node_for_a_second_leave_nothing);
    RUN(a_thousandfold_jump_of_stiffness_is_borne);
    RUN_LONG(a_patch_a_thousand_times_as_stiff_is_borne);
    RUN(size_does_not_matter);
    RUN(a_free_shell_keeps_its_momentum);
    RUN(a_tool_that_jumps_through_the_shell_is_borne);
    RUN(two_tools_that_press_one_place_are_borne);
    RUN(at_rest_under_load_nothing_drifts);
    RUN(everything_held_or_tiny_is_fine);
    return check_report();
}
