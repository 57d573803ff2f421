/* The world: what a scene becomes, how a step runs, what is refused, and that a step neither depends on its
 * surroundings nor touches the heap. */
#include "server/sim/plan/plan.h"
#include "server/sim/springs/spring_law.h"
#include "server/sim/transfer/transfer_world.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"
#include "tests/heap_calls.h"

#include <pthread.h>

static pal_diagnostic diag;

static bool has_row(const pal_world *world, const char *name)
{
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        if (!strcmp(info.name, name)) return true;
    }
    return false;
}

static void sags_and_comes_to_rest_under_its_weight(void)
{
    pal_prepared box;
    REQUIRE(!box_make(6, 4, 4, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    for (int i = 0; i < 240; i++) CHECK_INT(pal_world_step(world, scene->step_s), 0);
    pal_body *body = pal_world_body(world, 0);
    double low = 0;
    for (int i = 0; i < body->n_dof; i++) low = fmin(low, body->x[3 * i + 2] - body->x_rest[3 * i + 2]);
    printf("  sag %.3g mm, %d sub-steps of at most %.3g ms\n", -1e3 * low, pal_world_substeps(world),
           1e3 * pal_world_limit_s(world));
    CHECK(low < 0 && low > -0.01);
    CHECK_LE(pal_body_kinetic_J(body), 1e-9);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

static void has_rows_only_for_what_the_scene_calls_for(void)
{
    pal_prepared box;
    REQUIRE(!box_make(2, 2, 2, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, false);
    pal_entry_put_number(&scene->body[0].model, "k_area_J", 0, NULL);
    scene->body[0].material.damping_1_s = 0;
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    CHECK(has_row(world, "edge_distance"));
    CHECK(has_row(world, "tet_volume"));
    CHECK(has_row(world, "verlet"));
    CHECK(!has_row(world, "face_area"));
    CHECK(!has_row(world, "viscous"));
    CHECK(!has_row(world, "gravity"));
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

/* the plan of a spring scene as it was before finite elements came: rows, and their bytes but for a pointer or two;
 * since then tools have springs of contact and the body a static compliance, for what a haptic bridge renders, and
 * tools are told the force at the end of a sub-step */
static void spring_scenes_pay_nothing_for_finite_elements(void)
{
    static const struct {
        const char *name;
        size_t n_byte;
    } was[] = {{"tool_push", 2126912}, {"tool_grasp", 6144},    {"edge_distance", 19264}, {"face_area", 29312},
               {"tet_volume", 14336},  {"viscous", 64},         {"gravity", 64},          {"verlet", 4032},
               {"finite_guard", 3904}, {"surface_output", 4800}};
    enum { N_ROW = sizeof was / sizeof was[0], WORLD = 3290300, POINTERS = 256 };
    pal_prepared box;
    REQUIRE(!box_make(4, 3, 3, 0.01, &box));
    pal_scene *scene = calloc(1, sizeof *scene);
    REQUIRE(scene);
    pal_scene_default(scene);
    scene->n_body = 1;
    pal_body_default(&scene->body[0], "box", &box);
    /* what untangles springs is theirs, and is not there where it is not asked for */
    pal_entry_put_bool(&scene->body[0].model, "recover", false, NULL);
    pal_entry_init(&scene->body[0].output, "output", "surface_output");
    pal_tools_default(scene, 3);
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    REQUIRE(pal_world_component_count(world) == N_ROW);
    for (int i = 0; i < N_ROW; i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        CHECK(!strcmp(info.name, was[i].name));
        CHECK(info.n_byte <= was[i].n_byte + POINTERS);
        if (info.n_byte != was[i].n_byte)
            printf("  %s: %zu bytes, %zu before\n", info.name, info.n_byte, was[i].n_byte);
    }
    /* the body's own struct has grown as well, and there are three fields more that a row may come for */
    size_t field = 3 * (2 * PAL_BODY_MAX * sizeof(void *) + sizeof(pal_component));
    CHECK(pal_world_bytes(world) <= (size_t)WORLD + 2 * POINTERS + sizeof(pal_body) + field);
    CHECK(!pal_world_body(world, 0)->implicit && pal_world_body(world, 0)->compliance->begin);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

/* a held box with every default effect and two tools: one presses, one grabs and pulls */
static pal_world *open_touched(pal_prepared *box, pal_scene **scene)
{
    if (box_make(6, 4, 4, 0.01, box)) return NULL;
    *scene = box_scene(box, true, true);
    pal_body_def *def = &(*scene)->body[0];
    pal_entry_init(&def->effect[def->n_effect++], "effects[2]", "tool_push");
    pal_entry_init(&def->effect[def->n_effect++], "effects[3]", "tool_grasp");
    pal_tools_default(*scene, 2);
    (*scene)->tool[0].radius_m = (*scene)->tool[1].radius_m = 0.008;
    pal_world *world;
    pal_diagnostic reason;
    if (!pal_world_create(*scene, &reason, &world)) return world;
    printf("  %s\n", reason.text);
    return NULL;
}

static void move_tools(pal_world *world, int tick)
{
    double t = tick / 60.0;
    pal_pose press = {.position_m = {0.02, 0.02, 0.06 - 0.04 * t}, .quat = {1, 0, 0, 0}};
    pal_pose pull = {.position_m = {0.05, 0.02 + 0.01 * t, 0.044 + 0.01 * t}, .quat = {1, 0, 0, 0}, .buttons = 1};
    pal_world_pose(world, 0, &press);
    pal_world_pose(world, 1, &pull);
}

static void touches_no_heap_in_a_step_with_tools_pressing(void)
{
    pal_prepared box;
    pal_scene *scene;
    pal_world *world = open_touched(&box, &scene);
    REQUIRE(world);
    pal_frame *frame = pal_frame_create(world);
    REQUIRE(frame);
    bool touched = false, fixed = false;
    /* the counter counts */
    counting = true;
    void *volatile one = malloc(1);
    free(one);
    counting = false;
    CHECK_INT(n_heap_call, 2);
    n_heap_call = 0;
    for (int i = 0; i < 100; i++) {
        move_tools(world, i);
        counting = true;
        pal_err err = pal_world_step(world, scene->step_s);
        pal_world_frame(world, frame);
        uint64_t hash = pal_world_hash(world);
        counting = false;
        CHECK_INT(err, 0);
        CHECK(hash != 0);
        touched = touched || frame->tool[0].touching;
        fixed = fixed || frame->tool[1].holding;
    }
    CHECK(touched);
    CHECK(fixed);
    CHECK_INT(n_heap_call, 0);
    pal_frame_destroy(frame);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

static void *run_alone(void *out)
{
    pal_prepared box;
    pal_scene *scene;
    pal_world *world = open_touched(&box, &scene);
    if (!world) return NULL;
    for (int i = 0; i < 60; i++) {
        move_tools(world, i);
        pal_world_step(world, scene->step_s);
    }
    *(uint64_t *)out = pal_world_hash(world);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
    return NULL;
}

static void gives_the_same_hash_whatever_runs_beside_it(void)
{
    uint64_t alone = 0;
    run_alone(&alone);
    CHECK(alone != 0);
    for (int n = 2; n <= 4; n += 2) {
        pthread_t thread[4];
        uint64_t hash[4] = {0};
        for (int i = 0; i < n; i++) REQUIRE(!pthread_create(&thread[i], NULL, run_alone, &hash[i]));
        for (int i = 0; i < n; i++) pthread_join(thread[i], NULL);
        for (int i = 0; i < n; i++) CHECK(hash[i] == alone);
    }
}

static void starts_again_after_a_reset_as_if_new(void)
{
    pal_prepared box;
    pal_scene *scene;
    pal_world *world = open_touched(&box, &scene);
    REQUIRE(world);
    uint64_t hash[2];
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < 40; i++) {
            move_tools(world, i);
            REQUIRE(!pal_world_step(world, scene->step_s));
        }
        hash[turn] = pal_world_hash(world);
        pal_world_reset(world);
    }
    CHECK(hash[0] == hash[1]);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

static void derives_constants_again_after_a_material_edit(void)
{
    pal_prepared box;
    REQUIRE(!box_make(3, 3, 3, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    double sag[2];
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < 300; i++) REQUIRE(!pal_world_step(world, scene->step_s));
        const pal_body *body = pal_world_body(world, 0);
        sag[turn] = body->x_rest[3 * body->n_dof - 1] - body->x[3 * body->n_dof - 1];
        pal_material stiff = scene->body[0].material;
        stiff.young_Pa *= 10;
        REQUIRE(!pal_world_material(world, 0, &stiff, &diag));
    }
    CHECK_NEAR(sag[0] / sag[1], 10, 0.5);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

/* with area springs and without, whose share the other rows then bear */
static void an_edited_material_is_that_of_a_world_made_with_it(void)
{
    pal_prepared box;
    REQUIRE(!box_make(3, 3, 3, 0.01, &box));
    for (int without = 0; without < 2; without++) {
        uint64_t hash[3];
        for (int k = 0; k < 3; k++) {
            pal_scene *scene = box_scene(&box, true, true);
            pal_material first = scene->body[0].material, then = first;
            then.young_Pa *= 3, then.poisson = 0.3, then.damping_1_s = 7;
            if (without) pal_entry_put_number(&scene->body[0].model, "k_area_J", 0, NULL);
            /* edited; made so; left as it was */
            if (k == 1) scene->body[0].material = then;
            pal_world *world;
            REQUIRE(!pal_world_create(scene, &diag, &world));
            if (k == 0) CHECK_INT(pal_world_material(world, 0, &then, &diag), 0);
            for (int i = 0; i < 30; i++) REQUIRE(!pal_world_step(world, scene->step_s));
            hash[k] = pal_world_hash(world);
            pal_world_destroy(world);
            free(scene);
        }
        CHECK(hash[0] == hash[1]);
        CHECK(hash[0] != hash[2]);
    }
    box_free(&box);
}

static void refuses_poses_that_are_no_poses(void)
{
    pal_prepared box;
    pal_scene *scene;
    pal_world *world = open_touched(&box, &scene);
    REQUIRE(world);
    uint64_t before = pal_world_hash(world);
    pal_pose good = {.position_m = {0.02, 0.02, 0.2}, .quat = {1, 0, 0, 0}}, bad = good;
    CHECK_INT(pal_world_pose(world, 0, &good), 0);
    bad.position_m[1] = NAN;
    CHECK_INT(pal_world_pose(world, 0, &bad), PAL_ERR_REFUSED);
    bad = good, bad.position_m[0] = 1e300;
    CHECK_INT(pal_world_pose(world, 0, &bad), PAL_ERR_REFUSED);
    bad = good, bad.velocity_m_s[2] = INFINITY;
    CHECK_INT(pal_world_pose(world, 0, &bad), PAL_ERR_REFUSED);
    bad = good, bad.quat[0] = 0;
    CHECK_INT(pal_world_pose(world, 0, &bad), PAL_ERR_REFUSED);
    CHECK_INT(pal_world_pose(world, 2, &good), PAL_ERR_REFUSED);
    CHECK_INT(pal_world_pose(world, -1, NULL), PAL_ERR_REFUSED);
    CHECK(before == pal_world_hash(world));
    CHECK_INT(pal_world_step(world, scene->step_s), 0);
    CHECK(pal_body_finite(pal_world_body(world, 0)));
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

static void refuses_scenes_by_the_name_of_the_entry(void)
{
    pal_prepared box;
    REQUIRE(!box_make(2, 2, 2, 0.01, &box));
    pal_world *world = NULL;
    for (int kind = 0; kind < 8; kind++) {
        static const char *const expect[] = {"there is no effect \"gravitation\"",
                                             "unknown key \"stronger\"",
                                             "a second row of \"gravity\"",
                                             "is not of stage output",
                                             "there is no model \"jelly\"",
                                             "young_Pa: -1 is outside",
                                             "step_s: 0 is outside",
                                             "bodies: 0, wanted 1 to 8"};
        pal_scene *scene = box_scene(&box, true, true);
        pal_body_def *def = &scene->body[0];
        if (kind == 0) pal_entry_init(&def->effect[0], "effects[0]", "gravitation");
        if (kind == 1) pal_entry_put_number(&def->effect[0], "stronger", 1, NULL);
        if (kind == 2) def->effect[def->n_effect++] = def->effect[0];
        if (kind == 3) pal_entry_init(&def->output, "output", "viscous");
        if (kind == 4) pal_entry_init(&def->model, "model", "jelly");
        if (kind == 5) def->material.young_Pa = -1;
        if (kind == 6) scene->step_s = 0;
        if (kind == 7) scene->n_body = 0;
        CHECK_INT(pal_world_create(scene, &diag, &world), PAL_ERR_REFUSED);
        if (!strstr(diag.text, expect[kind])) CHECK_TEXT(diag.text, expect[kind]);
        free(scene);
    }
    CHECK(!world);
    box_free(&box);
}

static void orders_its_plan_as_a_step_runs(void)
{
    pal_prepared box;
    REQUIRE(!box_make(2, 2, 2, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    pal_arena *arena = pal_arena_create(1 << 16, true);
    pal_plan plan;
    REQUIRE(!pal_plan_build(scene, arena, &diag, &plan));
    const char *order[] = {"edge_distance", "face_area", "tet_volume",   "viscous",
                           "gravity",       "verlet",    "finite_guard", "surface_output"};
    CHECK_INT(plan.n_component, 8);
    for (int i = 0; i < 8 && i < plan.n_component; i++) CHECK(!strcmp(plan.component[i].effect->name, order[i]));
    pal_plan_free(&plan);
    pal_arena_destroy(arena);
    free(scene);
    box_free(&box);
}

static void shows_two_bodies_in_the_frame_of_the_first(void)
{
    pal_prepared one, two;
    REQUIRE(!box_make(2, 2, 2, 0.01, &one));
    REQUIRE(!box_make(2, 2, 2, 0.01, &two));
    two.tets.origin_m[0] = 0.5;
    pal_scene *scene = box_scene(&one, true, false);
    scene->n_body = 2;
    scene->body[1] = scene->body[0];
    scene->body[1].mesh = &two;
    pal_world *world;
    CHECK_INT(pal_world_create(scene, &diag, &world), PAL_ERR_REFUSED);
    snprintf(scene->body[1].name, PAL_NAME, "other");
    REQUIRE(!pal_world_create(scene, &diag, &world));
    REQUIRE(!pal_world_step(world, scene->step_s));
    pal_frame *frame = pal_frame_create(world);
    pal_world_frame(world, frame);
    CHECK_INT(frame->n_part, 2);
    CHECK_INT(frame->tick, 1);
    for (int i = 0; i < frame->part[0].n_vertex; i++)
        CHECK_NEAR(frame->part[1].position_m[3 * i] - frame->part[0].position_m[3 * i], 0.5, 1e-6);
    pal_shown shown;
    pal_world_shown(world, 1, &shown);
    CHECK_TEXT(shown.name, "other");
    CHECK_INT(shown.n_tri, two.tets.n_face);
    CHECK_NEAR(shown.rest_m[0], 0.5, 1e-6);
    pal_frame_destroy(frame);
    pal_world_destroy(world);
    free(scene);
    box_free(&one);
    box_free(&two);
}

/* a world that follows another half way comes to the same bits as one that went on alone */
static void goes_on_where_another_world_was(void)
{
    pal_prepared box;
    REQUIRE(!box_make(3, 3, 3, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    pal_world *alone, *before, *next;
    REQUIRE(!pal_world_create(scene, &diag, &alone));
    REQUIRE(!pal_world_create(scene, &diag, &before));
    REQUIRE(!pal_world_create(scene, &diag, &next));
    for (int i = 0; i < 30; i++) CHECK_INT(pal_world_step(alone, scene->step_s), 0);
    for (int i = 0; i < 12; i++) CHECK_INT(pal_world_step(before, scene->step_s), 0);
    CHECK(pal_world_hash(before) != pal_world_hash(next));
    pal_world_transfer(next, before, -1, NULL, NULL);
    CHECK(pal_world_hash(before) == pal_world_hash(next));
    for (int i = 0; i < 18; i++) CHECK_INT(pal_world_step(next, scene->step_s), 0);
    CHECK(pal_world_hash(alone) == pal_world_hash(next));
    /* a body of another state: as given */
    pal_body *body = pal_world_body(before, 0);
    pal_world_transfer(next, alone, 0, body->x, NULL);
    pal_body *to = pal_world_body(next, 0);
    CHECK(!memcmp(to->x, body->x, 3 * sizeof(double) * (size_t)body->n_dof));
    pal_world_destroy(alone);
    pal_world_destroy(before);
    pal_world_destroy(next);
    free(scene);
    box_free(&box);
}

/* 10 E h^2 is what a voxel bears: a node that stands for a third of a voxel's corner bears a third of it */
static void a_sliver_bears_less_of_a_lasting_load(void)
{
    pal_prepared box;
    REQUIRE(!box_make(3, 3, 3, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, false);
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    pal_body *body = pal_world_body(world, 0);
    int thin = -1, full = -1;
    for (int i = 0; i < body->n_dof; i++) {
        if (body->support[i]) continue;
        if (thin < 0 || body->mass_kg[i] < body->mass_kg[thin]) thin = i;
        if (full < 0 || body->mass_kg[i] > body->mass_kg[full]) full = i;
    }
    const double h = 0.01, cap_N = 10 * scene->body[0].material.young_Pa * h * h;
    CHECK_NEAR(body->full_corner_kg, scene->body[0].material.density_kg_m3 * h * h * h / 8, 1e-15);
    CHECK_NEAR(body->mass_kg[thin] / body->full_corner_kg, 1.0 / 3, 1e-9);
    REQUIRE(!pal_world_load(world, 0, thin, (const double[3]){1e6, 0, 0}));
    REQUIRE(!pal_world_load(world, 0, full, (const double[3]){0, 0, -1e6}));
    REQUIRE(!pal_world_step(world, 1e-4));
    CHECK_NEAR(body->load[3 * thin] / cap_N, 1.0 / 3, 1e-9);
    CHECK_NEAR(body->load[3 * full + 2] / cap_N, -1, 1e-9);
    CHECK(body->safeguards.n_capped >= 2);
    /* twice as dense and as stiff: the part stays, the cap goes with E */
    pal_material to = scene->body[0].material;
    to.density_kg_m3 *= 2, to.young_Pa *= 2;
    REQUIRE(!pal_world_material(world, 0, &to, &diag));
    REQUIRE(!pal_world_step(world, 1e-4));
    CHECK_NEAR(body->load[3 * thin] / cap_N, 2.0 / 3, 1e-9);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

/* what nodes bear goes by the E that edges stand for: the material's where they are derived, whatever volumes are, and
 * what was given where they are given, which no edit of E changes */
static void nodes_of_springs_bear_what_their_edges_stand_for(void)
{
    static const char *const key[] = {"k_distance_J", "k_area_J", "k_volume_J"};
    static const struct {
        int kind;      /* -1: none is given */
        double times;  /* of the derived constant */
        double cap[2]; /* over 10 E h^2, before and after E is four times as high */
    } cases[] = {{-1, 0, {1, 4}},
                 {PAL_SPRING_DISTANCE, 1, {1, 1}},
                 {PAL_SPRING_DISTANCE, 3, {3, 3}},
                 {PAL_SPRING_AREA, 3, {1, 4}},
                 {PAL_SPRING_VOLUME, 3, {1, 4}}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        box_bench b;
        double factor[3];
        REQUIRE(box_bench_make(&b, (const int[3]){3, 4, 3}, 0.01, true, false));
        pal_material to = b.scene->body[0].material;
        pal_config_entry *model = &b.scene->body[0].model;
        const double unit_N = 10 * to.young_Pa * 1e-4;
        pal_spring_factors(to.poisson, false, factor);
        if (cases[k].kind >= 0) {
            const double k_J = cases[k].times * factor[cases[k].kind] * to.young_Pa * 1e-6;
            REQUIRE(!pal_entry_put_number(model, key[cases[k].kind], k_J, NULL));
            REQUIRE(!pal_entry_put_text(model, "weights", "volume", NULL));
        }
        REQUIRE(box_bench_start(&b));
        CHECK_NEAR(b.body->load_cap_N / unit_N, cases[k].cap[0], 1e-12 * cases[k].cap[0]);
        to.young_Pa *= 4;
        REQUIRE(!pal_world_material(b.world, 0, &to, &diag));
        CHECK_NEAR(b.body->load_cap_N / unit_N, cases[k].cap[1], 1e-12 * cases[k].cap[1]);
        box_bench_close(&b);
    }
}

/* the load of a node after a step that begins with the whole body so many S off its rest places, over the cap */
static double borne_at(pal_world *world, int node, double far_S)
{
    pal_body *body = pal_world_body(world, 0);
    memset(body->v, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    for (int i = 0; i < 3 * body->n_dof; i++)
        body->x[i] = body->x_rest[i] + (i % 3 == 1 ? far_S * body->length_scale_m : 0);
    pal_world_invalidate_limits(world, 0);
    CHECK(!pal_world_step(world, 1e-5) && pal_world_substeps(world) == 1);
    return body->load[3 * node] / body->load_cap_N;
}

/* what many loads pull out of a body that stands still, each within its cap, lets go of them on its way */
static void a_node_that_strays_bears_less_of_a_lasting_load(void)
{
    pal_prepared box;
    REQUIRE(!box_make(3, 3, 3, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, false);
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    pal_body *body = pal_world_body(world, 0);
    int full = 0;
    for (int i = 0; i < body->n_dof; i++)
        if (!body->support[i] && body->mass_kg[i] >= body->full_corner_kg) full = i;
    REQUIRE(!pal_world_load(world, 0, full, (const double[3]){1e6, 0, 0}));
    CHECK_NEAR(borne_at(world, full, 1.99), 1, 1e-9);
    CHECK_NEAR(borne_at(world, full, 2.5), 0.75, 1e-9);
    CHECK_NEAR(borne_at(world, full, 3), 0.5, 1e-9);
    CHECK_NEAR(borne_at(world, full, 6), 0.01, 1e-9);
    /* one that is led, or held by nothing, may be anywhere */
    int fixed = 0;
    while (!body->support[fixed]) fixed++;
    body->support[fixed] = PAL_PRESCRIBED;
    CHECK_NEAR(borne_at(world, full, 3), 1, 1e-9);
    for (int i = 0; i < body->n_dof; i++) body->support[i] = PAL_FREE;
    CHECK_NEAR(borne_at(world, full, 3), 1, 1e-9);
    body->support[fixed] = PAL_FIXED;
    CHECK_NEAR(borne_at(world, full, 3), 0.5, 1e-9);
    /* what is little is borne wherever it is */
    REQUIRE(!pal_world_load(world, 0, full, (const double[3]){0.009 * body->load_cap_N, 0, 0}));
    CHECK_NEAR(borne_at(world, full, 6), 0.009, 1e-12);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

int main(void)
{
    RUN(goes_on_where_another_world_was);
    RUN(touches_no_heap_in_a_step_with_tools_pressing);
    RUN(gives_the_same_hash_whatever_runs_beside_it);
    RUN(starts_again_after_a_reset_as_if_new);
    RUN(derives_constants_again_after_a_material_edit);
    RUN(an_edited_material_is_that_of_a_world_made_with_it);
    RUN(refuses_poses_that_are_no_poses);
    RUN(refuses_scenes_by_the_name_of_the_entry);
    RUN(orders_its_plan_as_a_step_runs);
    RUN(shows_two_bodies_in_the_frame_of_the_first);
    RUN(sags_and_comes_to_rest_under_its_weight);
    RUN(has_rows_only_for_what_the_scene_calls_for);
    RUN(spring_scenes_pay_nothing_for_finite_elements);
    RUN(a_sliver_bears_less_of_a_lasting_load);
    RUN(a_node_that_strays_bears_less_of_a_lasting_load);
    RUN(nodes_of_springs_bear_what_their_edges_stand_for);
    return check_report();
}
