/* Golden hashes of four scenes: the same bits from every compiler, optimization level and thread count on IEEE
 * doubles. A change of a hash means that the answer of a step has changed: say why in the commit that changes it. */
#include "server/sim/core/tuning.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/adaptive_worlds.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/subdivision_scene.h"

/* scenes that threads share run with one thread to this many */
enum { THREADS = 3 };

static pal_diagnostic diag;

static uint64_t run(pal_prepared *box, pal_scene *scene, void (*drive)(pal_world *, int), int n_step)
{
    pal_world *world;
    if (pal_world_create(scene, &diag, &world)) {
        printf("  %s\n", diag.text);
        return 0;
    }
    for (int i = 0; i < n_step; i++) {
        drive(world, i);
        if (pal_world_step(world, scene->step_s)) return 0;
    }
    uint64_t hash = pal_world_hash(world);
    printf("  hash %016llx after %d steps of %d sub-steps\n", (unsigned long long)hash, n_step,
           pal_world_substeps(world));
    pal_world_destroy(world);
    free(scene);
    box_free(box);
    return hash;
}

/* a block that sags, is pulled at an edge for half a second and stiffened while it swings back */
static void pull_and_stiffen(pal_world *world, int tick)
{
    for (int j = 0; j <= 4; j++)
        if (tick == 10 || tick == 40)
            pal_world_load(world, 0, box_node((const int[]){6, 4, 4}, 6, j, 4),
                           (const double[3]){tick == 10 ? 0.08 : 0, 0, tick == 10 ? 0.03 : 0});
    if (tick == 60) {
        pal_material stiff = {.young_Pa = 9000, .poisson = 0.4, .density_kg_m3 = 1100, .damping_1_s = 2};
        pal_world_material(world, 0, &stiff, &diag);
    }
}

static void a_pulled_and_stiffened_block_has_its_golden_hash(void)
{
    pal_prepared box;
    REQUIRE(!box_make(6, 4, 4, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    CHECK(run(&box, scene, pull_and_stiffen, 120) == 0xa98d3ed6ec58644du);
}

/* a block with nodes enough for every thread sags */
static void a_large_block_has_the_same_hash_with_any_number_of_threads(void)
{
    static const int n[3] = {16, 12, 10};
    uint64_t first = 0;
    for (int threads = 1; threads <= THREADS; threads++) {
        pal_prepared box;
        REQUIRE(!box_make(n[0], n[1], n[2], 0.01, &box));
        CHECK_LE(THREADS * PAL_PART_NODES, box.tets.n_node);
        pal_scene *scene = box_scene(&box, true, true);
        scene->threads = threads;
        const uint64_t hash = run(&box, scene, pull_and_stiffen, 2);
        if (threads == 1) first = hash;
        CHECK(hash != 0 && hash == first);
    }
}

/* a body collapsed into a point that springs open, and beside it a free one that tumbles without drag */
static void collapse(pal_world *world, int tick)
{
    if (tick > 0) return;
    pal_body *body = pal_world_body(world, 0), *other = pal_world_body(world, 1);
    for (int i = 0; i < body->n_dof; i++)
        for (int c = 0; c < 3 && !body->support[i]; c++) body->x[3 * i + c] = 0.0625;
    for (int i = 0; i < other->n_dof; i++) {
        other->v[3 * i] = 0.125 + 16 * other->x[3 * i + 1];
        other->v[3 * i + 1] = -16 * other->x[3 * i];
    }
    pal_world_invalidate_limits(world, 0);
}

static void a_collapsed_and_a_tumbling_body_have_their_golden_hash(void)
{
    /* springs alone open again by their weight, and without it by their recovery */
    static const uint64_t golden[] = {0x5f23d55a8654e4bau, 0x9aa2df1f4f6c2e79u};
    for (int recover = 0; recover < 2; recover++) {
        pal_prepared box;
        REQUIRE(!box_make(4, 3, 3, 0.01, &box));
        pal_scene *scene = box_scene(&box, true, !recover);
        pal_entry_put_number(&scene->body[0].model, "c_area_Js", 1e-7, NULL);
        if (!recover) pal_entry_put_bool(&scene->body[0].model, "recover", false, NULL);
        scene->n_body = 2;
        pal_body_default(&scene->body[1], "other", &box);
        scene->body[1].output.name[0] = 0;
        scene->body[1].n_support = scene->body[1].n_effect = 0;
        scene->body[1].material.damping_1_s = 0;
        pal_entry_put_number(&scene->body[1].model, "k_area_J", 0, NULL);
        CHECK(run(&box, scene, collapse, 40) == golden[recover]);
    }
}

/* a block with damped springs, turned inside out at one corner by a grabbed tool, pressed by another */
static void press_and_grasp(pal_world *world, int tick)
{
    double t = tick / 60.0;
    pal_pose press = {.position_m = {0.012, 0.012, 0.05 - 0.02 * t}, .quat = {1, 0, 0, 0}};
    pal_pose pull = {.position_m = {0.04, 0.03 - 0.03 * t, 0.03}, .quat = {1, 0, 0, 0}, .buttons = 1};
    pal_world_pose(world, 0, &press);
    pal_world_pose(world, 1, tick < 70 ? &pull : NULL);
}

static void a_pressed_and_grasped_block_has_its_golden_hash(void)
{
    pal_prepared box;
    REQUIRE(!box_make(4, 3, 3, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    pal_body_def *def = &scene->body[0];
    pal_entry_put_number(&def->model, "c_distance_Js", 2e-7, NULL);
    pal_entry_init(&def->effect[def->n_effect++], "effects[2]", "tool_push");
    pal_entry_init(&def->effect[def->n_effect++], "effects[3]", "tool_grasp");
    pal_tools_default(scene, 2);
    scene->tool[0].radius_m = scene->tool[1].radius_m = 0.006;
    CHECK(run(&box, scene, press_and_grasp, 100) == 0x603d40674ffbb7c7u);
}

/* our stomach, held at one end, on three levels: pressed at the front and grabbed beside it, both let go; levels come
 * and go */
static void a_pressed_and_grasped_stomach_that_adapts_has_its_golden_hash(void)
{
    pal_stomach stomach;
    REQUIRE(!pal_stomach_make(&stomach));
    const double *x = stomach.surface.x;
    int front = 0, max = 0;
    for (int i = 0; i < stomach.surface.n_vertex; i++)
        if (x[3 * i + 2] > x[3 * front + 2]) front = i;
    double top[3], low[3], high[3];
    pal_copy3(top, x + 3 * front);
    const double *cap = x + 3 * stomach.oesophagus_cap;
    for (int c = 0; c < 3; c++) low[c] = cap[c] - 0.02, high[c] = cap[c] + 0.02;
    shell_scene s;
    shell_scene_take(&s, &stomach.surface);
    shell_scene_number(&s, "levels", 3);
    shell_scene_hold(&s, low, high);
    pal_entry_put_text(shell_scene_effect(&s, "inflate"), "kind", "fluid", NULL);
    shell_scene_effect(&s, "tool_push");
    shell_scene_effect(&s, "tool_grasp");
    pal_tools_default(s.scene, 2);
    s.scene->tool[0].radius_m = s.scene->tool[1].radius_m = 0.015;
    REQUIRE(shell_scene_start(&s));
    const uint64_t start = pal_world_hash(s.world);
    for (int i = 0; i < 90; i++) {
        double t = i / 60.0;
        pal_pose press = {.position_m = {top[0], top[1], top[2] + 0.015 - 0.02 * t}, .quat = {1, 0, 0, 0}};
        pal_pose pull = {.position_m = {top[0] + 0.04, top[1], top[2] + 0.02 * t}, .quat = {1, 0, 0, 0}, .buttons = 1};
        CHECK(!pal_world_pose(s.world, 0, i < 60 ? &press : NULL));
        CHECK(!pal_world_pose(s.world, 1, i < 70 ? &pull : NULL));
        REQUIRE(!pal_world_step(s.world, 1.0 / 60));
        if (s.body->n_active > max) max = s.body->n_active;
    }
    CHECK(max > 250);
    uint64_t hash = pal_world_hash(s.world);
    printf("  hash %016llx, %d nodes at most\n", (unsigned long long)hash, max);
    CHECK(hash == 0xe8d9dfea18c923f1u);
    pal_world_reset(s.world);
    CHECK(pal_world_hash(s.world) == start);
    shell_scene_close(&s);
}

/* surfaces for which each thread has nodes enough: what differs in their steps */
enum { HELD, FREE, FILLED, COLLAPSED, N_SURFACE };

/* our stomach from its third level of four on, pressed by a tool; it moves freely unless it is held */
static uint64_t run_surface(int kind, int threads)
{
    pal_stomach stomach;
    if (pal_stomach_make(&stomach)) return 0;
    double low[3], high[3];
    pal_surface_box(&stomach.surface, low, high);
    const double top_m = high[2], middle_m[2] = {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2};
    high[2] = low[2] + 0.1 * (high[2] - low[2]);
    shell_scene s;
    shell_scene_take(&s, &stomach.surface);
    shell_scene_number(&s, "levels", 4);
    shell_scene_number(&s, "start_level", 2);
    if (kind == HELD) shell_scene_hold(&s, low, high);
    if (kind == FILLED) pal_entry_put_text(shell_scene_effect(&s, "inflate"), "kind", "fluid", NULL);
    pal_entry_put_number(shell_scene_effect(&s, "refine"), "most_node", 4000, NULL);
    shell_scene_effect(&s, "tool_push");
    pal_tools_default(s.scene, 1);
    s.scene->tool[0].radius_m = 0.02;
    s.scene->threads = threads;
    if (!shell_scene_start(&s)) return 0;
    const int n_first = s.body->n_active;
    CHECK_LE(THREADS * PAL_PART_ACTIVE, n_first);
    for (int i = 0; i < s.body->n_dof && kind == COLLAPSED; i++)
        pal_set3(s.body->x + 3 * i, middle_m[0], middle_m[1], top_m);
    if (kind == COLLAPSED) pal_world_invalidate_limits(s.world, 0);
    /* nodes with a lasting load stay */
    shell_scene_press(&s, (const double[]){middle_m[0], middle_m[1], top_m}, 1, (const double[]){0, 0, -1e-3});
    for (int i = 0; i < 5; i++) {
        pal_pose press = {.position_m = {middle_m[0], middle_m[1], top_m + 0.015 - 0.004 * i}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_world_pose(s.world, 0, &press));
        CHECK(!pal_world_step(s.world, 1.0 / 60));
    }
    const uint64_t hash = pal_world_hash(s.world);
    printf("  %d to %d nodes\n", n_first, s.body->n_active);
    CHECK_LE(THREADS * PAL_PART_ACTIVE, s.body->n_active);
    if (kind == HELD) CHECK(s.body->n_active != n_first);
    shell_scene_close(&s);
    return hash;
}

static void a_surface_that_adapts_has_the_same_hash_with_any_number_of_threads(void)
{
    for (int kind = 0; kind < N_SURFACE; kind++) {
        const uint64_t first = run_surface(kind, 1);
        for (int threads = 2; threads <= THREADS; threads++) CHECK(first != 0 && run_surface(kind, threads) == first);
    }
}

/* A block of control cells with cubic and trilinear elements, whose volumes are averaged, sags and recovers from a
 * corner that is pushed through it: no golden hash, as their solvers have factors, which differ from machine to machine
 */
static uint64_t run_cells(const char *solver, const char *operator, int threads)
{
    solid_scene s;
    solid_scene_take(&s, solid_scene_box((const int32_t[]){2, 2, 2}, (const double[]){0.1, 0.1, 0.1}, false), 2,
                     solver, operator);
    solid_scene_hold(&s, 2, 0.01);
    s.scene->threads = threads;
    s.scene->max_substep = 100000;
    pal_entry_init(&s.def->effect[s.def->n_effect++], "effects[0]", "gravity");
    if (!solid_scene_open(&s)) return 0;
    const uint64_t start = pal_world_hash(s.world);
    for (int i = 0; i < 2; i++) {
        /* a corner is pushed through the block, so that its elements recover */
        if (i == 1)
            for (int c = 0; c < 3; c++) s.body->x[3 * (s.body->n_dof - 1) + c] -= 0.08;
        if (i == 1) pal_world_invalidate_limits(s.world, 0);
        CHECK(!pal_world_step(s.world, 1.0 / 120));
    }
    const uint64_t hash = pal_world_hash(s.world);
    CHECK(hash != start);
    solid_scene_close(&s);
    return hash;
}

static void control_cells_have_the_same_hash_with_any_number_of_threads(void)
{
    static const char *const with[][2] = {
        {"central_cg", "polar"}, {"central_cg", "edges"}, {"implicit_euler", "polar"}};
    for (int k = 0; k < 3; k++) {
        const uint64_t first = run_cells(with[k][0], with[k][1], 1);
        printf("  %s, %s: hash %016llx\n", with[k][0], with[k][1], (unsigned long long)first);
        for (int threads = 2; threads <= THREADS; threads++) CHECK(run_cells(with[k][0], with[k][1], threads) == first);
    }
}

int main(void)
{
    RUN(control_cells_have_the_same_hash_with_any_number_of_threads);
    RUN(a_large_block_has_the_same_hash_with_any_number_of_threads);
    RUN(a_surface_that_adapts_has_the_same_hash_with_any_number_of_threads);
    RUN(a_pressed_and_grasped_stomach_that_adapts_has_its_golden_hash);
    RUN(a_pulled_and_stiffened_block_has_its_golden_hash);
    RUN(a_collapsed_and_a_tumbling_body_have_their_golden_hash);
    RUN(a_pressed_and_grasped_block_has_its_golden_hash);
    return check_report();
}
