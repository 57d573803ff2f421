/* Model adaptive_springs: what it derives, its rows, live edits, and what it refuses. */
#include "tests/fixtures/adaptive_plan.h"

static const char *row_names(const pal_world *world, char text[256])
{
    text[0] = 0;
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info info;
        pal_world_component_info(world, i, &info);
        snprintf(text + strlen(text), 256 - strlen(text), "%s%s", i ? " " : "", info.name);
    }
    return text;
}

static void open_stomach(shell_scene *s)
{
    pal_stomach stomach = {0};
    if (pal_stomach_make(&stomach)) abort();
    shell_scene_take(s, &stomach.surface);
    pal_surface_free(&stomach.surface);
}

static void rows_are_those_that_the_keys_ask_for(void)
{
    char text[256];
    shell_scene s;
    open_stomach(&s);
    s.scene->body[0].material.damping_1_s = 4;
    REQUIRE(shell_scene_start(&s));
    CHECK_TEXT(row_names(s.world, text), "edge_spring shape_spring viscous rk4 refine surface_output");
    shell_scene_close(&s);

    open_stomach(&s);
    shell_scene_number(&s, "k_shape_N_m", 0);
    pal_entry_put_bool(shell_scene_model(&s), "refine", false, NULL);
    REQUIRE(shell_scene_start(&s));
    CHECK_TEXT(row_names(s.world, text), "edge_spring rk4 surface_output");
    shell_scene_close(&s);

    open_stomach(&s);
    shell_scene_number(&s, "levels", 1);
    REQUIRE(shell_scene_start(&s));
    CHECK_TEXT(row_names(s.world, text), "edge_spring shape_spring rk4 surface_output");
    shell_scene_close(&s);

    /* the default output needs a skin, which a surface has not */
    open_stomach(&s);
    shell_scene_number(&s, "levels", 1);
    pal_entry_init(&s.scene->body[0].output, "output", "skin_output");
    REQUIRE(shell_scene_start(&s));
    CHECK_TEXT(row_names(s.world, text), "edge_spring shape_spring rk4 surface_output");
    shell_scene_close(&s);
}

/* k_0 = sqrt(3)/2 E t, c_0 = 0.02 sqrt(k_0 m_0), anchors k_0/10 with damping ratio 0.3, M = density t A */
static void constants_follow_from_material_and_thickness(void)
{
    shell_plan p;
    shell_plan_stomach(&p);
    shell_scene_number(&p.s, "thickness_m", 0.004);
    double area = pal_surface_area(&p.s.mesh.surface), mass = 0;
    p.s.scene->body[0].material = (pal_material){.young_Pa = 8000, .poisson = 0.45, .density_kg_m3 = 1100};
    REQUIRE(shell_plan_open(&p));
    for (int i = 0; i < p.body->n_node; i++) mass += p.body->mass_kg[i];
    CHECK_NEAR(mass / (1100 * 0.004 * area), 1, 1e-12);
    double k = sqrt(3) / 2 * 8000 * 0.004, m = mass / 188, bound[2] = {0}, want[2] = {0};
    double *sum = calloc(2 * (size_t)p.body->n_node, sizeof *sum), *damp = sum + p.body->n_node;
    const pal_component *row[2] = {shell_plan_row(&p, "edge_spring"), shell_plan_row(&p, "shape_spring")};
    row[0]->effect->bounds.stiffness(row[0]->self, p.body, sum);
    row[0]->effect->bounds.damping(row[0]->self, p.body, damp);
    for (int i = 0; i < p.body->n_node; i++) bound[0] += sum[i], bound[1] += damp[i];
    /* every spring counts 2 at both ends */
    want[0] = 4 * 558 * k, want[1] = 4 * 558 * 0.02 * sqrt(k * m);
    for (int i = 0; i < 2; i++) CHECK_NEAR(bound[i] / want[i], 1, 1e-6);
    free(sum);
    /* all nodes but one at rest: its anchor is the only force beside its springs */
    for (int way = 0; way < 2; way++) {
        double moved[3] = {0}, *x = way ? p.body->v : p.body->x;
        x[0] += 1e-9 * (way ? sqrt(k / m) : 1);
        shell_plan_force(&p, row[1]);
        pal_copy3(moved, p.body->f);
        double anchor = way ? 0.6 * sqrt(0.3 * k * m) * sqrt(k / m) : 0.3 * k;
        /* the frame moves along by about a node's share of the mass */
        CHECK_NEAR(-moved[0] / (1e-9 * anchor), 1, 0.05);
        memcpy(p.body->x, p.body->x_rest, 3 * sizeof(double) * (size_t)p.body->n_node);
        memset(p.body->v, 0, 3 * sizeof(double) * (size_t)p.body->n_node);
    }
    shell_plan_close(&p);

    shell_plan_stomach(&p);
    shell_scene_number(&p.s, "mass_kg", 0.25);
    REQUIRE(shell_plan_open(&p));
    mass = 0;
    for (int i = 0; i < p.body->n_node; i++) mass += p.body->mass_kg[i];
    CHECK_NEAR(mass, 0.25, 1e-13);
    shell_plan_close(&p);
}

static void entry_of_that_name_takes_the_place_of_the_models_row(void)
{
    shell_plan p;
    shell_plan_sphere(&p);
    shell_scene_number(&p.s, "thickness_m", 0.006);
    pal_config_entry *entry = shell_scene_effect(&p.s, "edge_spring");
    pal_entry_put_number(entry, "c_Ns_m", 0, NULL);
    REQUIRE(shell_plan_open(&p));
    const pal_component *row = shell_plan_row(&p, "edge_spring");
    double *bound = calloc(2 * (size_t)p.body->n_node, sizeof *bound), k = 0, c = 0;
    row->effect->bounds.stiffness(row->self, p.body, bound);
    row->effect->bounds.damping(row->self, p.body, bound + p.body->n_node);
    for (int i = 0; i < p.body->n_node; i++) k += bound[i], c += bound[p.body->n_node + i];
    /* derived with the model's thickness still */
    CHECK_NEAR(k / (4 * 336 * sqrt(3) / 2 * 5000 * 0.006), 1, 1e-6);
    CHECK(c == 0);
    free(bound);
    shell_plan_close(&p);
}

/* E times 1000 in one edit, while it swings: finite, and the sub-steps grow as its root */
static void thousandfold_stiffness_is_borne(void)
{
    shell_scene s;
    open_stomach(&s);
    pal_entry_put_bool(shell_scene_model(&s), "refine", false, NULL);
    shell_scene_text(&s, "frame", "world");
    REQUIRE(shell_scene_start(&s));
    const double force[3] = {0, 0, -0.3};
    CHECK(shell_scene_press(&s, s.body->x_rest, 0.04, force) > 3);
    for (int i = 0; i < 10; i++) CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
    int before = pal_world_substeps(s.world);
    double limit = pal_world_limit_s(s.world);
    pal_material to = s.scene->body[0].material;
    to.young_Pa *= 1000;
    CHECK_INT(pal_world_material(s.world, 0, &to, &s.diag), 0);
    CHECK_NEAR(limit / pal_world_limit_s(s.world) / sqrt(1000), 1, 1e-3);
    for (int i = 0; i < CHECK_REPEATS(20, 5); i++) {
        CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
        CHECK(pal_body_finite(s.body));
        CHECK_INT(s.body->safeguards.n_clamped, 0);
    }
    CHECK(pal_world_substeps(s.world) > 15 * before);
    CHECK_LE(shell_scene_rms(&s), 0.05 * s.body->length_scale_m);
    shell_scene_close(&s);
}

/* derived damping is 0.02 sqrt(k_0 m_0) of the edited masses too, so that the limit goes as sqrt(density) */
static void density_edits_reach_the_damping(void)
{
    shell_scene s;
    open_stomach(&s);
    pal_entry_put_bool(shell_scene_model(&s), "refine", false, NULL);
    REQUIRE(shell_scene_start(&s));
    double bound[2] = {0}, *sum = calloc((size_t)s.body->n_node, sizeof *sum);
    const pal_component *row = pal_world_component(s.world, 0);
    CHECK_TEXT(row->effect->name, "edge_spring");
    for (int way = 0; way < 2; way++) {
        memset(sum, 0, sizeof *sum * (size_t)s.body->n_node);
        row->effect->bounds.damping(row->self, s.body, sum);
        for (int i = 0; i < s.body->n_node; i++) bound[way] += sum[i];
        pal_material to = s.scene->body[0].material;
        to.density_kg_m3 *= 4;
        CHECK_INT(pal_world_material(s.world, 0, &to, &s.diag), 0);
    }
    CHECK_NEAR(bound[1] / bound[0], 2, 1e-12);
    free(sum);
    shell_scene_close(&s);
}

static void the_same_scene_gives_the_same_hash(void)
{
    uint64_t hash[2];
    for (int way = 0; way < 2; way++) {
        shell_scene s;
        open_stomach(&s);
        REQUIRE(shell_scene_start(&s));
        const double force[3] = {0.1, 0, -0.3};
        CHECK(shell_scene_press(&s, s.body->x_rest, 0.04, force) > 3);
        for (int i = 0; i < 20; i++) CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
        hash[way] = pal_world_hash(s.world);
        shell_scene_close(&s);
    }
    CHECK(hash[0] == hash[1]);
}

/* what a scene with one other key or surface is told */
static void check_refused(const char *key, double number, const char *text, const char *want)
{
    shell_plan p;
    shell_plan_sphere(&p);
    if (text)
        shell_scene_text(&p.s, key, text);
    else
        shell_scene_number(&p.s, key, number);
    p.arena = pal_arena_create(1 << 20, true);
    CHECK(pal_plan_build(p.s.scene, p.arena, &p.s.diag, &p.plan) == PAL_ERR_REFUSED);
    CHECK_TEXT(p.s.diag.text, want);
    shell_plan_close(&p);
}

static void keys_out_of_range_are_refused_in_a_sentence(void)
{
    check_refused("levels", 0, NULL, "model.levels: 0 is outside [1, 10]");
    check_refused("levels", 11, NULL, "model.levels: 11 is outside [1, 10]");
    check_refused("levels", 2.5, NULL, "model.levels: 2.5 is not a whole number");
    check_refused("start_level", 2, NULL, "model.start_level: 2, wanted 0 to 1 as levels is 2");
    check_refused("start_level", -1, NULL, "model.start_level: -1 is outside [0, 10]");
    check_refused("thickness_m", 0, NULL, "model.thickness_m: 0 is outside [1e-09, 1e+09]");
    check_refused("thickness_m", NAN, NULL, "model.thickness_m: nan is outside [1e-09, 1e+09]");
    check_refused("mass_kg", 0, NULL, "model.mass_kg: 0 is outside [1e-30, 1e+30]");
    check_refused("mass_kg", -1, NULL, "model.mass_kg: -1 is outside [1e-30, 1e+30]");
    check_refused("k_spring_N_m", 0, NULL, "model.k_spring_N_m: 0 is outside [1e-30, 1e+60]");
    check_refused("c_shape_Ns_m", -1, NULL, "model.c_shape_Ns_m: -1 is outside [0, 1e+60]");
    check_refused("law", 0, "sponge", "model.law: \"sponge\", wanted \"membrane\" or \"paper\"");
    check_refused("place", 0, "left", "model.place: \"left\", wanted \"linear\" or \"butterfly\"");
    check_refused("frame", 0, "sky", "model.frame: \"sky\", wanted \"body\" or \"world\"");
    check_refused("colour", 1, NULL, "model (adaptive_springs): unknown key \"colour\"");
}

static void surfaces_that_cannot_be_split_are_refused_with_another_way(void)
{
    /* two tetrahedra that share an edge, as one surface */
    static const double x[6][3] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 1, 0.5}, {-1, 0, 0}, {-1, -1, 0.5}};
    static const int32_t tri[8][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
                                      {0, 4, 1}, {0, 1, 5}, {0, 5, 4}, {1, 4, 5}};
    pal_surface surface = {.n_vertex = 6, .n_tri = 8};
    surface.x = malloc(sizeof x), surface.tri = malloc(sizeof tri);
    if (!surface.x || !surface.tri) abort();
    memcpy(surface.x, x, sizeof x), memcpy(surface.tri, tri, sizeof tri);
    shell_plan p;
    memset(&p, 0, sizeof p);
    shell_scene_take(&p.s, &surface);
    p.arena = pal_arena_create(1 << 20, true);
    CHECK_INT(pal_plan_build(p.s.scene, p.arena, &p.s.diag, &p.plan), PAL_ERR_REFUSED);
    CHECK(!strncmp(p.s.diag.text, "body \"shell\" model: ", 20));
    CHECK(strstr(p.s.diag.text, "edge") &&
          strstr(p.s.diag.text, "(model tet_springs takes any surface: it fills voxels)"));
    /* triangles that are none, and no triangles */
    p.s.mesh.surface.tri[5] = 6;
    CHECK_INT(pal_plan_build(p.s.scene, p.arena, &p.s.diag, &p.plan), PAL_ERR_REFUSED);
    CHECK_TEXT(p.s.diag.text, "body \"shell\" model: triangle 1 has corner 6 of 6 vertices");
    p.s.mesh.surface.n_tri = 0;
    CHECK_INT(pal_plan_build(p.s.scene, p.arena, &p.s.diag, &p.plan), PAL_ERR_REFUSED);
    CHECK_TEXT(p.s.diag.text,
               "body \"shell\" model: a mesh with 0 surface triangles; \"adaptive_springs\" is made of them");
    shell_plan_close(&p);

    /* more than the stated memory: both numbers */
    shell_plan_sphere(&p);
    shell_scene_number(&p.s, "levels", 8);
    shell_scene_number(&p.s, "memory_MB", 1);
    p.arena = pal_arena_create(1 << 20, true);
    CHECK_INT(pal_plan_build(p.s.scene, p.arena, &p.s.diag, &p.plan), PAL_ERR_BUDGET);
    CHECK(!strncmp(p.s.diag.text, "body \"shell\" model: ", 20));
    CHECK(!strstr(p.s.diag.text, "tet_springs"));
    shell_plan_close(&p);
}

/* a ball of that many levels, bare or with all that tools need, within that memory */
static pal_err make_within(shell_scene *s, int levels, bool tools, double memory_MB)
{
    pal_surface surface;
    if (pal_sphere_make(0.05, &surface)) return PAL_ERR_MEMORY;
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", levels);
    shell_scene_number(s, "memory_MB", memory_MB);
    if (tools) {
        shell_scene_effect(s, "tool_push");
        shell_scene_effect(s, "tool_grasp");
        shell_scene_effect(s, "finite_guard");
        pal_tools_default(s->scene, 4);
    }
    return pal_world_create(s->scene, &s->diag, &s->world);
}

/* memory_MB is of the whole body as it runs: what the world tells of itself, lasting loads among it, keeps to it */
static void memory_of_the_world_keeps_to_its_bound(void)
{
    static const double MiB = 1048576, push[3] = {0, 0, -1e-3};
    for (int levels = 3; levels <= 4; levels++)
        for (int tools = 0; tools < 2; tools++) {
            shell_scene s;
            REQUIRE(!make_within(&s, levels, tools, 1000));
            REQUIRE(!pal_world_load(s.world, 0, 3, push));
            const double whole = (double)pal_world_bytes(s.world) / MiB;
            const int n_node = pal_world_body(s.world, 0)->n_node;
            shell_scene_close(&s);
            /* what fits with an eighth of a MiB to spare, the world's own, keeps to it */
            REQUIRE(!make_within(&s, levels, tools, whole + 0.125));
            REQUIRE(!pal_world_load(s.world, 0, 3, push));
            CHECK_LE((double)pal_world_bytes(s.world), (whole + 0.125) * MiB);
            shell_scene_close(&s);
            /* a hundredth less than it takes is refused, with what it takes and what it may */
            CHECK_INT(make_within(&s, levels, tools, 0.99 * whole), PAL_ERR_BUDGET);
            double needs = 0, may = 0;
            const char *text = strstr(s.diag.text, "tools and display ");
            CHECK(text && sscanf(text, "tools and display %lf MiB, the budget is %lf MiB", &needs, &may) == 2);
            CHECK_NEAR(needs, whole + 0.0625, 0.0625 + 1e-3 * whole);
            CHECK_NEAR(may, 0.99 * whole, 1e-3 * whole);
            CHECK(!strncmp(s.diag.text, "body \"shell\" model: ", 20) && !s.world);
            printf("  %d nodes: %.0f bytes each\n", n_node, whole * MiB / n_node);
            shell_scene_close(&s);
        }
}

int main(void)
{
    RUN(memory_of_the_world_keeps_to_its_bound);
    RUN(rows_are_those_that_the_keys_ask_for);
    RUN(constants_follow_from_material_and_thickness);
    RUN(entry_of_that_name_takes_the_place_of_the_models_row);
    RUN(thousandfold_stiffness_is_borne);
    RUN(density_edits_reach_the_damping);
    RUN(the_same_scene_gives_the_same_hash);
    RUN(keys_out_of_range_are_refused_in_a_sentence);
    RUN(surfaces_that_cannot_be_split_are_refused_with_another_way);
    return check_report();
}
