/* Model subdivision_fem: counts, masses, supports, what is shown, gravity, the world's steps and edits, refusals. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/plan/plan.h"
#include "server/sim/subdivision/subdivision_mass.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "server/sim/world/world.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/solids.h"
#include "tests/heap_calls.h"

/* a scene of one solid, its plan or its world */
typedef struct clay {
    pal_cells cells;
    pal_prepared mesh;
    pal_scene *scene;
    pal_body_def *def;
    pal_arena *arena;
    pal_plan plan;
    pal_world *world;
    pal_body *body;
    pal_diagnostic diag;
} clay;

/* takes the cells */
static void clay_take(clay *c, pal_cells cells)
{
    pal_surface surface = {0};
    memset(c, 0, sizeof *c);
    c->cells = cells;
    c->scene = calloc(1, sizeof *c->scene);
    if (!c->scene || pal_cells_boundary(&c->cells, &surface, NULL, NULL) || pal_prepared_surface(&surface, &c->mesh))
        abort();
    pal_surface_free(&surface);
    pal_scene_default(c->scene);
    c->scene->n_body = 1;
    c->def = &c->scene->body[0];
    pal_body_default_cells(c->def, "clay", &c->mesh, &c->cells);
}

static void clay_block(clay *c, int n, double length_scale_m)
{
    clay_take(c, solid_bricks(n, n, n, length_scale_m / n, length_scale_m / n, length_scale_m / n));
}

/* a cube of six pyramids: pyramids are left whatever the levels */
static void clay_pyramids(clay *c, double length_scale_m)
{
    pal_cells cells = solid_pyramids();
    for (int32_t i = 0; i < 3 * cells.n_vertex; i++) cells.x[i] *= length_scale_m / 2;
    clay_take(c, cells);
}

static void clay_number(clay *c, const char *key, double number)
{
    if (pal_entry_put_number(&c->def->model, key, number, NULL)) abort();
}

static bool clay_plan(clay *c)
{
    c->arena = pal_arena_create(1 << 20, true);
    if (pal_plan_build(c->scene, c->arena, &c->diag, &c->plan)) CHECK_FAIL("%s", c->diag.text);
    c->body = c->plan.body;
    return c->body != NULL;
}

static bool clay_start(clay *c)
{
    if (pal_world_create(c->scene, &c->diag, &c->world)) CHECK_FAIL("%s", c->diag.text);
    if (c->world) c->body = pal_world_body(c->world, 0);
    return c->world != NULL;
}

static void clay_close(clay *c)
{
    pal_world_destroy(c->world);
    pal_plan_free(&c->plan);
    pal_arena_destroy(c->arena);
    pal_cells_free(&c->cells);
    pal_prepared_free(&c->mesh);
    free(c->scene);
}

static const pal_component *clay_row(const clay *c, const char *name)
{
    for (int i = 0; i < c->plan.n_component; i++)
        if (!strcmp(c->plan.component[i].effect->name, name)) return &c->plan.component[i];
    CHECK_FAIL("there is no row %s", name);
    return NULL;
}

/* Table 1 of paper A: 3^3 cells give 1728 elements after two levels, 58 % of them cubic; 4^3 give 512 after one
 * (erratum A14), and 216 of them cubic */
static void blocks_have_the_elements_of_the_paper(void)
{
    static const struct {
        int n, level, all, cubic, shown;
    } block[] = {{3, 2, 1728, 1000, 866}, {4, 1, 512, 216, 386}};
    for (int k = 0; k < 2; k++) {
        clay c;
        clay_block(&c, block[k].n, 0.1);
        clay_number(&c, "levels", block[k].level);
        REQUIRE(clay_plan(&c));
        const pal_cell_elements *e = &c.body->model.solid->elements;
        CHECK_INT(pal_cell_elements_count(e), block[k].all);
        CHECK_INT(e->n[PAL_CELL_CUBIC], block[k].cubic);
        CHECK_INT(e->n[PAL_CELL_HEX], block[k].all - block[k].cubic);
        CHECK_NEAR(pal_cell_elements_percent(e, PAL_CELL_CUBIC), k ? 42 : 58, 0.5);
        CHECK_INT(c.body->n_dof, (block[k].n + 1) * (block[k].n + 1) * (block[k].n + 1));
        CHECK_INT(c.body->display.n_shown, block[k].shown);
        CHECK_INT(c.body->display.surface->n_tri, 2 * (block[k].shown - 2));
        CHECK_NEAR(c.body->edge_m, cbrt(pal_subdivision_solid_volume_m3(c.body->model.solid) / block[k].all), 1e-15);
        clay_close(&c);
    }
}

static void components_are_those_that_the_material_asks_for(void)
{
    static const char *const want[2][9] = {
        {"tool_push", "tool_grasp", "cell_elastic", "gravity", "central_cg", "finite_guard", "surface_output"},
        {"tool_push", "tool_grasp", "cell_elastic", "viscous", "gravity", "central_cg", "finite_guard",
         "surface_output"}};
    for (int k = 0; k < 2; k++) {
        clay c;
        clay_block(&c, 2, 0.1);
        c.def->material.damping_1_s = k ? 4 : 0;
        pal_entry_put_text(&c.def->model, "operator", "edges", NULL);
        /* the default of other bodies, which needs a skin */
        if (k) pal_entry_init(&c.def->output, "output", "skin_output");
        REQUIRE(clay_plan(&c));
        CHECK_INT(c.plan.n_component, 7 + k);
        for (int i = 0; i < c.plan.n_component; i++) CHECK_TEXT(c.plan.component[i].effect->name, want[k][i]);
        clay_close(&c);
    }
}

static void masses_of_points_and_of_nodes_sum_up_to_the_solids(void)
{
    for (int shape = 0; shape < 2; shape++) {
        clay c;
        double point = 0, node = 0, entry = 0;
        if (shape)
            clay_pyramids(&c, 0.1);
        else
            clay_block(&c, 3, 0.1);
        c.def->material.density_kg_m3 = 1100;
        REQUIRE(clay_plan(&c));
        double mass = solid_mass_kg(c.body->model.solid);
        for (int i = 0; i < c.body->n_dof; i++) point += c.body->mass_kg[i];
        for (int i = 0; i < c.body->n_node; i++) node += c.body->node_mass_kg[i];
        for (int i = 0; i < c.body->mass_operator->n_entry; i++) entry += c.body->mass_operator->mass_kg[i];
        CHECK_NEAR(point / mass, 1, 1e-12);
        CHECK_NEAR(node / mass, 1, 1e-12);
        CHECK_NEAR(entry / mass, 1, 1e-12);
        CHECK_NEAR(mass / (1100 * pal_subdivision_solid_volume_m3(c.body->model.solid)), 1, 1e-6);
        clay_close(&c);
    }
}

static void supports_hold_control_points(void)
{
    clay c;
    int n_fixed = 0;
    clay_block(&c, 3, 0.1);
    REQUIRE(clay_plan(&c));
    for (int i = 0; i < c.body->n_dof; i++) {
        n_fixed += c.body->support[i];
        CHECK_INT(c.body->support[i], c.body->x_rest[3 * i + 2] < -0.049);
    }
    CHECK_INT(n_fixed, 16);
    clay_close(&c);

    clay_block(&c, 3, 0.1);
    c.def->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {-0.04, -0.04, 1}};
    REQUIRE(clay_plan(&c));
    n_fixed = 0;
    for (int i = 0; i < c.body->n_dof; i++) n_fixed += c.body->support[i];
    CHECK_INT(n_fixed, 4);
    clay_close(&c);
}

static void the_surface_is_the_boundary_of_the_subdivided_cells(void)
{
    for (int shape = 0; shape < 2; shape++) {
        clay c;
        pal_surface_topology facts;
        if (shape)
            clay_pyramids(&c, 0.1);
        else
            clay_block(&c, 3, 0.1);
        REQUIRE(clay_plan(&c));
        const pal_body *b = c.body;
        CHECK(!pal_surface_check(b->display.surface, &facts));
        CHECK(facts.closed && facts.manifold && facts.oriented);
        CHECK_NEAR(pal_surface_volume(b->display.surface) / pal_subdivision_solid_volume_m3(b->model.solid), 1, 0.01);
        for (int i = 0; i < b->display.n_shown; i++) {
            CHECK(b->display.shown_node[i] < b->model.solid->elements.n_vertex);
            CHECK_NEAR(pal_dist3(b->display.surface->x + 3 * i, b->node_rest + 3 * b->display.shown_node[i]), 0, 1e-16);
            for (int a = 0; a < 3; a++)
                CHECK(b->display.shown[3 * i + a] == (float)b->d[3 * b->display.shown_node[i] + a]);
        }
        /* every control face is shown, by as many triangles as the others of the block: 2 * 16 after two levels */
        int n_control[54] = {0}, n_face = 0;
        for (int t = 0; t < b->display.surface->n_tri && !shape; t++) {
            int32_t face = b->display.shown_face[t];
            CHECK(face >= 0 && pal_cells_face_boundary(&c.cells, face));
            n_control[face % 54]++;
        }
        for (int f = 0; f < 54 && !shape; f++) n_face += n_control[f];
        CHECK_INT(n_face, shape ? 0 : 54 * 32);
        clay_close(&c);
    }
}

/* half of the block away: the shown volume is that of the cells left, inner faces have no control face */
static void a_cut_shows_what_it_hid(void)
{
    clay c;
    pal_surface_topology facts;
    int n_inner = 0;
    double low[3], high[3];
    clay_block(&c, 4, 0.1);
    clay_number(&c, "levels", 1);
    c.def->cut = true;
    c.def->cut_normal[0] = 1;
    REQUIRE(clay_plan(&c));
    CHECK(!pal_surface_check(c.body->display.surface, &facts));
    CHECK(facts.closed && facts.manifold && facts.oriented);
    CHECK_NEAR(pal_surface_volume(c.body->display.surface) / pal_subdivision_solid_volume_m3(c.body->model.solid), 0.5,
               1e-3);
    pal_surface_box(c.body->display.surface, low, high);
    CHECK_NEAR(high[0], 0, 1e-6);
    for (int t = 0; t < c.body->display.surface->n_tri; t++) n_inner += c.body->display.shown_face[t] < 0;
    /* 8 x 8 quads on the cut, all of them between two control cells */
    CHECK_INT(n_inner, 128);
    clay_close(&c);

    clay_block(&c, 2, 0.1);
    c.def->cut = true;
    c.def->cut_normal[0] = 1, c.def->cut_m = -1;
    c.arena = pal_arena_create(1 << 20, true);
    CHECK_INT(pal_plan_build(c.scene, c.arena, &c.diag, &c.plan), PAL_ERR_REFUSED);
    CHECK_TEXT(c.diag.text, "body \"clay\" model: the cut leaves nothing of it");
    clay_close(&c);
}

/* on points and on nodes, pyramids with their virtual nodes too: the weight of all of the body */
static void gravity_pulls_with_the_bodys_weight(void)
{
    for (int shape = 0; shape < 2; shape++) {
        clay c;
        double sum[3] = {0}, nodes[3] = {0};
        if (shape)
            clay_pyramids(&c, 0.1);
        else
            clay_block(&c, 3, 0.1);
        REQUIRE(clay_plan(&c));
        const pal_component *row = clay_row(&c, "gravity");
        REQUIRE(row != NULL);
        pal_step step = {.body = c.body, .force = (pal_component *)(uintptr_t)row, .n_force = 1, .dt_s = 1e-3};
        CHECK(!pal_assemble_forces(&step));
        for (int i = 0; i < c.body->n_dof; i++) pal_add3(sum, sum, c.body->g + 3 * i);
        for (int i = 0; i < c.body->n_node; i++) pal_add3(nodes, nodes, c.body->f + 3 * i);
        double weight = 9.81 * solid_mass_kg(c.body->model.solid);
        CHECK_NEAR(sum[2] / weight, -1, 1e-12);
        CHECK_NEAR(nodes[2] / weight, -1, 1e-12);
        CHECK_NEAR(fabs(sum[0]) + fabs(sum[1]), 0, 1e-15 * weight);
        /* a lift of 1 cm costs m g h */
        double before = row->effect->energy(row->self, c.body);
        for (int i = 0; i < c.body->n_dof; i++) c.body->x[3 * i + 2] += 0.01;
        pal_body_update_nodes(c.body);
        CHECK_NEAR((row->effect->energy(row->self, c.body) - before) / (0.01 * weight), 1, 1e-10);
        clay_close(&c);
    }
}

/* 1 Ns on a node alone, all points free: M~ v = a, and the node moves with a'v. Among them those far from others */
static void mobility_is_the_velocity_from_an_impulse(void)
{
    clay c;
    clay_block(&c, 2, 0.1);
    c.def->n_support = 0;
    REQUIRE(clay_plan(&c));
    const pal_body *b = c.body;
    const pal_mass_operator *m = b->mass_operator;
    const int n = b->n_dof;
    for (int k = 0; k < b->display.n_shown; k += 37) {
        const int node = b->display.shown_node[k];
        double v[27] = {0}, r[27] = {0}, p[27], q[27], rr = 0, inverse_mass = 0;
        REQUIRE(n == 27);
        for (int32_t i = b->interpolation->start[node]; i < b->interpolation->start[node + 1]; i++)
            r[b->interpolation->point[i]] = b->interpolation->weight[i];
        memcpy(p, r, sizeof p);
        for (int i = 0; i < n; i++) rr += r[i] * r[i];
        for (int turn = 0; turn < 200 && rr > 1e-28; turn++) {
            double pq = 0, next = 0;
            for (int i = 0; i < n; i++) {
                q[i] = 0;
                for (int32_t j = m->start[i]; j < m->start[i + 1]; j++) q[i] += m->mass_kg[j] * p[m->point[j]];
                pq += p[i] * q[i];
            }
            for (int i = 0; i < n; i++) v[i] += rr / pq * p[i], r[i] -= rr / pq * q[i], next += r[i] * r[i];
            for (int i = 0; i < n; i++) p[i] = r[i] + next / rr * p[i];
            rr = next;
        }
        for (int32_t i = b->interpolation->start[node]; i < b->interpolation->start[node + 1]; i++)
            inverse_mass += b->interpolation->weight[i] * v[b->interpolation->point[i]];
        CHECK_NEAR(b->node_inverse_mass_1_kg[node] / inverse_mass, 1, 1e-6);
        /* a node is never heavier than the body */
        CHECK_LE(1 / solid_mass_kg(b->model.solid), inverse_mass * (1 + 1e-9));
    }
    clay_close(&c);
}

/* denser and stiffer where it was painted, and a live edit keeps that */
static void edits_of_material_reach_masses_and_samples(void)
{
    static const pal_stroke stroke = {
        .at_m = {0.05, 0.05, 0.05}, .radius_m = 0.05, .softness = 0.5, .young_factor = 10, .density_factor = 2};
    clay c;
    clay_block(&c, 2, 0.1);
    c.def->n_stroke = 1, c.def->stroke = &stroke;
    REQUIRE(clay_start(&c));
    const pal_subdivision_solid *solid = c.body->model.solid;
    double mass = solid_mass_kg(solid), inverse_mass = c.body->node_inverse_mass_1_kg[c.body->display.shown_node[0]];
    CHECK(mass > 1000 * pal_subdivision_solid_volume_m3(solid) * (1 + 1e-3));
    float young = 0;
    for (int e = 0; e < 64 * solid->elements.n[PAL_CELL_HEX]; e++)
        young = fmaxf(young, solid->samples[PAL_CELL_HEX].young_Pa[e]);
    CHECK_NEAR((double)young, 50000, 1e-2);
    pal_material to = c.def->material;
    to.young_Pa = 8000, to.density_kg_m3 = 1500;
    CHECK_INT(pal_world_material(c.world, 0, &to, &c.diag), 0);
    CHECK_NEAR(solid_mass_kg(solid) / mass, 1.5, 1e-6);
    CHECK_NEAR(c.body->node_inverse_mass_1_kg[c.body->display.shown_node[0]] * 1.5 / inverse_mass, 1, 1e-6);
    double sum = 0;
    for (int i = 0; i < c.body->n_dof; i++) sum += c.body->mass_kg[i];
    CHECK_NEAR(sum / mass, 1.5, 1e-6);
    young = 0;
    for (int e = 0; e < 64 * solid->elements.n[PAL_CELL_HEX]; e++)
        young = fmaxf(young, solid->samples[PAL_CELL_HEX].young_Pa[e]);
    CHECK_NEAR((double)young, 80000, 1e-2);
    /* the scene's own entry is not the world's */
    CHECK_NEAR(c.def->material.young_Pa, 5000, 0);
    for (int i = 0; i < 5; i++) CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
    clay_close(&c);
}

static void nodes_stand_where_points_carry_them_after_steps_and_resets(void)
{
    clay c;
    double max = 0;
    clay_block(&c, 2, 0.1);
    REQUIRE(clay_start(&c));
    double *d = calloc(3 * (size_t)c.body->n_node, sizeof *d);
    for (int way = 0; way < 3; way++) {
        if (way == 0)
            for (int i = 0; i < 10; i++) CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
        if (way == 1) {
            c.body->x[3 * (c.body->n_dof - 1)] += 0.01;
            pal_world_invalidate_limits(c.world, 0);
        }
        if (way == 2) pal_world_reset(c.world);
        pal_interpolation_apply(c.body->interpolation, c.body->x, d);
        for (int i = 0; i < 3 * c.body->n_node; i++) max = fmax(max, fabs(d[i] - c.body->d[i]));
        CHECK(max == 0);
        for (int i = 0; i < c.body->display.n_shown && way != 1; i++)
            for (int a = 0; a < 3; a++)
                CHECK(c.body->display.shown[3 * i + a] == (float)d[3 * c.body->display.shown_node[i] + a]);
    }
    CHECK(!memcmp(c.body->d, c.body->node_rest, 3 * sizeof *d * (size_t)c.body->n_node));
    free(d);
    clay_close(&c);
}

/* hangs by its top and sways; the same again, after a reset and in another world */
static void the_same_steps_give_the_same_hash_and_a_reset_the_start(void)
{
    uint64_t hash[3], start[2];
    clay c;
    for (int way = 0; way < 2; way++) {
        clay_block(&c, 3, 0.1);
        clay_number(&c, "levels", 1);
        pal_tools_default(c.scene, 1);
        c.scene->tool[0].radius_m = 0.01;
        c.scene->up[2] = -1;
        REQUIRE(clay_start(&c));
        start[0] = pal_world_hash(c.world);
        for (int again = 0; again < 2; again++) {
            const double force[3] = {0.2, 0, 0};
            CHECK_INT(pal_world_load(c.world, 0, c.body->n_node - 1, force), 0);
            const int n = CHECK_REPEATS(12, 4);
            for (int i = 0; i < n; i++) {
                pal_pose pose = {.position_m = {0, 0, 0.07 - 0.033 * i / (n - 1)}, .quat = {1, 0, 0, 0}};
                CHECK_INT(pal_world_pose(c.world, 0, &pose), 0);
                CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
            }
            hash[way + again] = pal_world_hash(c.world);
            CHECK(pal_body_finite(c.body) && !c.body->frozen);
            CHECK(pal_norm3(pal_world_tools(c.world)->tool[0].mean_force_N) > 0.01);
            pal_world_reset(c.world);
            start[1] = pal_world_hash(c.world);
            CHECK(start[0] == start[1]);
            CHECK(!memcmp(c.body->x, c.body->x_rest, 3 * sizeof(double) * (size_t)c.body->n_dof));
        }
        clay_close(&c);
    }
    CHECK(hash[0] == hash[1] && hash[1] == hash[2] && hash[0] != start[0]);
}

/* a sphere of 10 mm is pressed 10 mm into a block of 5 kPa: the force is that of the implicit solver, whose contact is
 * of the end of the step, and it stands still */
static void a_pressed_solid_pushes_back_calmly(void)
{
    double force[2], change = 0, deepest = 0;
    for (int way = 0; way < 2; way++) {
        clay c;
        clay_block(&c, 3, 0.1);
        clay_number(&c, "levels", 1);
        pal_entry_init(&c.def->solver, "solver", way ? "implicit_euler" : "");
        pal_tools_default(c.scene, 1);
        c.scene->tool[0].radius_m = 0.01;
        c.scene->gravity_m_s2 = 0;
        REQUIRE(clay_start(&c));
        const pal_tool *tool = &pal_world_tools(c.world)->tool[0];
        for (int i = 0; i < 60; i++) {
            double was = tool->mean_force_N[2];
            pal_pose pose = {.position_m = {0.002, 0.001, 0.0575 - 0.01 * fmin(1, i / 20.0)}, .quat = {1, 0, 0, 0}};
            CHECK_INT(pal_world_pose(c.world, 0, &pose), 0);
            CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
            force[way] = tool->mean_force_N[2];
            if (i >= 50 && !way) change = fmax(change, fabs(force[way] - was));
            for (int k = 0; k < c.body->display.n_shown && !way; k++)
                deepest =
                    fmax(deepest, 0.01 - pal_dist3(c.body->d + 3 * c.body->display.shown_node[k], pose.position_m));
        }
        CHECK_INT(c.body->safeguards.n_capped, 0);
        clay_close(&c);
    }
    printf("  %.3f N, implicit %.3f N, vertices up to %.2f mm inside, changes by %.2g N a step\n", force[0], force[1],
           1e3 * deepest, change);
    CHECK_NEAR(force[0] / force[1], 1, 0.15);
    CHECK_LE(change, 0.02 * force[0]);
    CHECK_LE(deepest, 0.004);
}

static void a_step_takes_no_heap(void)
{
    clay c;
    clay_block(&c, 3, 0.1);
    clay_number(&c, "levels", 1);
    pal_tools_default(c.scene, 2);
    c.scene->tool[0].radius_m = c.scene->tool[1].radius_m = 0.01;
    REQUIRE(clay_start(&c));
    CHECK_INT(pal_world_field(c.world, 0, PAL_FIELD_DISPLACEMENT_M, true, &c.diag), 0);
    for (int i = 0; i < CHECK_REPEATS(20, 6); i++) {
        pal_pose push = {.position_m = {0, 0, 0.06 - 0.001 * i}, .quat = {1, 0, 0, 0}};
        pal_pose pull = {.position_m = {0.05 + 0.002 * i, 0, 0}, .quat = {1, 0, 0, 0}, .buttons = i > 2};
        CHECK_INT(pal_world_pose(c.world, 0, &push), 0);
        CHECK_INT(pal_world_pose(c.world, 1, &pull), 0);
        counting = true;
        pal_err err = pal_world_step(c.world, 1.0 / 60);
        counting = false;
        CHECK_INT(err, 0);
    }
    CHECK(pal_world_tools(c.world)->tool[1].holding);
    CHECK_INT(n_heap_call, 0);
    clay_close(&c);
}

/* what a scene with one other key is told */
static void check_refused(const char *key, double number, const char *text, const char *want)
{
    clay c;
    clay_block(&c, 2, 0.1);
    if (text)
        pal_entry_put_text(&c.def->model, key, text, NULL);
    else
        clay_number(&c, key, number);
    pal_err err = pal_world_create(c.scene, &c.diag, &c.world);
    CHECK(err == PAL_ERR_REFUSED || err == PAL_ERR_BUDGET);
    CHECK_TEXT(c.diag.text, want);
    clay_close(&c);
}

static void check_row_refused(const char *effect, const char *want)
{
    clay c;
    clay_block(&c, 2, 0.1);
    pal_entry_init(&c.def->effect[c.def->n_effect++], "effects[4]", effect);
    pal_err err = pal_world_create(c.scene, &c.diag, &c.world);
    CHECK_INT(err, PAL_ERR_REFUSED);
    CHECK_TEXT(c.diag.text, want);
    clay_close(&c);
}

static void what_makes_no_sense_is_refused_in_a_sentence(void)
{
    check_refused("levels", 9, NULL, "model.levels: 9 is outside [0, 8]");
    check_refused("levels", 1.5, NULL, "model.levels: 1.5 is not a whole number");
    check_refused("memory_MB", 0, NULL, "model.memory_MB: 0 is outside [1, 1e+06]");
    check_refused("rule", 0, "catmull", "model.rule: \"catmull\", wanted \"maccracken_joy\" or \"averaging\"");
    check_refused("operator", 0, "sum", "model.operator: \"sum\", wanted \"polar\" or \"edges\"");
    check_refused("colour", 1, NULL, "model (subdivision_fem): unknown key \"colour\"");
    check_row_refused("tet_volume", "effects[4]: \"tet_volume\" needs a body of tetrahedra");
    check_row_refused("edge_distance", "effects[4]: \"edge_distance\" needs a body of tetrahedra");
    check_row_refused("face_area", "effects[4]: \"face_area\" needs a body of tetrahedra");
    check_row_refused("tet_elastic", "effects[4]: body \"clay\" has no elements of 4 nodes");
    check_row_refused("inflate", "effects[4]: \"inflate\" needs a body of model adaptive_springs");
    check_row_refused("edge_spring", "effects[4]: \"edge_spring\" needs a body of model adaptive_springs");
    check_row_refused("refine", "effects[4]: refine needs a surface of levels, model adaptive_springs");
    check_row_refused("verlet", "effects[4]: \"verlet\" moves nodes, those of this body are carried by control points; "
                                "take \"central_cg\" or \"implicit_euler\"");
    check_row_refused("rk4", "effects[4]: \"rk4\" moves nodes, those of this body are carried by control points; take "
                             "\"central_cg\" or \"implicit_euler\"");

    clay c;
    clay_block(&c, 2, 0.1);
    c.def->cells = NULL;
    CHECK_INT(pal_world_create(c.scene, &c.diag, &c.world), PAL_ERR_REFUSED);
    CHECK_TEXT(c.diag.text, "body \"clay\" model: \"subdivision_fem\" works on control cells, and the body has none");
    c.def->cells = &c.cells;
    pal_entry_init(&c.def->model, "model", "fem");
    CHECK_INT(pal_world_create(c.scene, &c.diag, &c.world), PAL_ERR_REFUSED);
    CHECK_TEXT(c.diag.text, "body \"clay\" model: \"fem\" does not take control cells; \"subdivision_fem\" does");
    clay_close(&c);

    /* a stroke without a radius */
    static const pal_stroke stroke = {.young_factor = 1, .density_factor = 1};
    clay_block(&c, 2, 0.1);
    c.def->n_stroke = 1, c.def->stroke = &stroke;
    CHECK_INT(pal_world_create(c.scene, &c.diag, &c.world), PAL_ERR_REFUSED);
    CHECK_TEXT(c.diag.text, "body \"clay\" strokes[0].radius_m: 0, wanted more than 0");
    clay_close(&c);

    /* more than the stated memory, with both numbers */
    clay_block(&c, 3, 0.1);
    clay_number(&c, "levels", 4);
    clay_number(&c, "memory_MB", 20);
    CHECK_INT(pal_world_create(c.scene, &c.diag, &c.world), PAL_ERR_BUDGET);
    CHECK(!strncmp(c.diag.text, "body \"clay\" model: ", 19));
    CHECK(strstr(c.diag.text, "20") != NULL);
    clay_close(&c);
}

int main(void)
{
    RUN(blocks_have_the_elements_of_the_paper);
    RUN(components_are_those_that_the_material_asks_for);
    RUN(masses_of_points_and_of_nodes_sum_up_to_the_solids);
    RUN(supports_hold_control_points);
    RUN(the_surface_is_the_boundary_of_the_subdivided_cells);
    RUN(a_cut_shows_what_it_hid);
    RUN(gravity_pulls_with_the_bodys_weight);
    RUN(mobility_is_the_velocity_from_an_impulse);
    RUN(edits_of_material_reach_masses_and_samples);
    RUN(nodes_stand_where_points_carry_them_after_steps_and_resets);
    RUN(the_same_steps_give_the_same_hash_and_a_reset_the_start);
    RUN_LONG(a_pressed_solid_pushes_back_calmly);
    RUN(a_step_takes_no_heap);
    RUN(what_makes_no_sense_is_refused_in_a_sentence);
    return check_report();
}
