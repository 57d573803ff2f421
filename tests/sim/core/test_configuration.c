/* Configurations: that of a scene, put into it again, into other models and sizes, and what is refused. */
#include "server/sim/core/configuration.h"

#include "server/mesh/geometry/procedural.h"
#include "server/sim/world/world.h"
#include "tests/fixtures/subdivision_scene.h"

/* an ellipsoid as large as a liver, full: 12 voxels with their fill, held by a box that cuts it */
typedef struct organ {
    pal_surface surface;
    pal_prepared mesh;
    pal_scene *scene;
    pal_diagnostic diag;
} organ;

static void organ_make(organ *o, bool full)
{
    const double length_scale_m[3] = {0.2, 0.14, 0.09};
    double low[3], high[3];
    memset(o, 0, sizeof *o);
    o->scene = calloc(1, sizeof *o->scene);
    if (!o->scene || pal_sphere_make(0.1, &o->surface)) abort();
    pal_surface_box(&o->surface, low, high);
    for (int i = 0; i < 3 * o->surface.n_vertex; i++)
        o->surface.x[i] = (o->surface.x[i] - low[i % 3]) / (high[i % 3] - low[i % 3]) * length_scale_m[i % 3];
    pal_voxel_options voxel = {.resolution = 12, .border = true, .min_fill = 0.25, .fill = true};
    pal_err err = full ? pal_prepared_make(&o->surface, &voxel, &o->mesh, NULL, &o->diag)
                       : pal_prepared_surface(&o->surface, &o->mesh);
    if (err) printf("  %s\n", o->diag.text), abort();
    pal_scene_default(o->scene);
    o->scene->n_body = 1;
    pal_body_def *def = &o->scene->body[0];
    pal_body_default(def, "organ", &o->mesh);
    def->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {0.031, 1, 1}};
    if (full) pal_entry_put_number(&def->model, "k_area_J", 0, NULL);
    if (!full) pal_entry_init(&def->model, "model", "adaptive_springs");
    pal_tools_default(o->scene, 1);
}

static void organ_free(organ *o)
{
    pal_prepared_free(&o->mesh);
    pal_surface_free(&o->surface);
    free(o->scene);
}

/* made, opened, a few steps: finite, something held, the model and size that were asked for */
static void check_runs(const pal_scene *from, const pal_configuration *to)
{
    char name[PAL_CONFIGURATION_TEXT];
    pal_configured_scene *set = NULL;
    pal_world *world = NULL;
    pal_diagnostic diag = {{0}};
    pal_configuration now;
    printf("  %s\n", pal_configuration_text(to, name));
    pal_err err = pal_configuration_make(from, 0, to, &diag, &set);
    if (!err) err = pal_world_create(&set->scene, &diag, &world);
    CHECK(!err);
    if (err) printf("  %s\n", diag.text);
    if (!err) {
        int n_fixed = 0;
        const pal_body *body = pal_world_body(world, 0);
        for (int k = 0; k < 3; k++) CHECK(!pal_world_step(world, set->scene.step_s));
        CHECK(pal_body_finite(body) && !body->frozen);
        for (int i = 0; i < body->n_dof; i++) n_fixed += body->support[i];
        CHECK(n_fixed > 3 && n_fixed < body->n_dof / 2);
        pal_configuration_of(&set->scene, 0, &now);
        CHECK(pal_configuration_equal(&now, to));
    }
    pal_world_destroy(world);
    pal_configured_scene_free(set);
}

/* what a scene has, put into it: the same entries, its own mesh */
static void check_round(const pal_scene *from)
{
    pal_configuration now, again;
    pal_configured_scene *set = NULL;
    pal_diagnostic diag = {{0}};
    pal_configuration_of(from, 0, &now);
    CHECK(!pal_configuration_make(from, 0, &now, &diag, &set));
    if (!set) return;
    pal_configuration_of(&set->scene, 0, &again);
    CHECK(pal_configuration_equal(&now, &again));
    CHECK(set->mesh.tets.n_node == 0 && set->scene.body[0].mesh == from->body[0].mesh);
    CHECK(set->scene.body[0].model.n_value == from->body[0].model.n_value);
    CHECK(!strcmp(set->scene.body[0].model.name, from->body[0].model.name));
    CHECK(set->scene.body[0].solver.n_value == from->body[0].solver.n_value);
    pal_configured_scene_free(set);
}

static void check_refused(const pal_scene *from, int body, const pal_configuration *to, const char *word)
{
    pal_configured_scene *set = (pal_configured_scene *)(uintptr_t)1;
    pal_diagnostic diag = {{0}};
    CHECK(pal_configuration_make(from, body, to, &diag, &set) == PAL_ERR_REFUSED);
    CHECK(set == NULL && strstr(diag.text, word));
    if (!strstr(diag.text, word)) printf("  \"%s\" has no \"%s\"\n", diag.text, word);
}

static void a_solid_body_runs_in_every_configuration(void)
{
    organ o;
    organ_make(&o, true);
    check_round(o.scene);
    pal_configuration now;
    pal_configuration_of(o.scene, 0, &now);
    CHECK(!strcmp(now.model, "tet_springs") && now.size == 12 && now.k_distance_J == 0 && now.k_area_J == 0);
    const pal_configuration list[] = {
        {.model = "fem", .size = 10, .step_s = 1.0 / 60},
        {.model = "fem",
         .element = "hex8_bbar",
         .law = "corotational",
         .solver = "implicit_euler",
         .size = 14,
         .step_s = 1.0 / 120,
         .tolerance = 1e-3},
        {.model = "fem", .element = "tet4", .law = "neo_hookean", .solver = "sdirk2", .size = 8, .step_s = 1.0 / 60},
        {.model = "fem",
         .element = "tet10",
         .law = "linear",
         .solver = "implicit_euler",
         .size = 6,
         .step_s = 1.0 / 60},
        {.model = "tet_springs", .solver = "verlet", .size = 9, .step_s = 1.0 / 240},
        {.model = "tet_springs", .size = 8, .step_s = 1.0 / 60, .k_distance_J = 1e-3, .k_volume_J = 4e-3},
        {.model = "tet_springs", .size = 12, .step_s = 1.0 / 60, .k_area_J = -1},
    };
    for (size_t k = 0; k < sizeof list / sizeof *list; k++) check_runs(o.scene, &list[k]);
    organ_free(&o);
}

/* keys that a configuration does not speak of stay, those it does are replaced */
static void keys_outside_a_configuration_stay(void)
{
    organ o;
    pal_configured_scene *set = NULL;
    pal_diagnostic diag = {{0}};
    organ_make(&o, true);
    pal_body_def *def = &o.scene->body[0];
    pal_entry_init(&def->model, "model", "fem");
    pal_entry_put_bool(&def->model, "fill", false, NULL);
    pal_entry_put_text(&def->model, "law", "linear", NULL);
    pal_entry_init(&def->solver, "solver", "implicit_euler");
    pal_entry_put_number(&def->solver, "iterations", 33, NULL);
    pal_entry_put_number(&def->solver, "tolerance", 0.02, NULL);
    check_round(o.scene);
    pal_configuration to;
    pal_configuration_of(o.scene, 0, &to);
    CHECK(to.tolerance == 0.02 && !strcmp(to.law, "linear") && to.size == 12);
    to.tolerance = 1e-4;
    snprintf(to.law, sizeof to.law, "corotational");
    CHECK(!pal_configuration_make(o.scene, 0, &to, &diag, &set));
    pal_config_entry *model = &set->scene.body[0].model, *solver = &set->scene.body[0].solver;
    const char *law = "";
    bool fill = true;
    double tolerance = 0;
    int iterations = 0;
    CHECK(!pal_entry_read_text(model, "law", &law, &diag) && !strcmp(law, "corotational"));
    CHECK(!pal_entry_read_bool(model, "fill", &fill, &diag) && !fill);
    CHECK(!pal_entry_read_number(solver, "tolerance", 0, 1, &tolerance, &diag) && tolerance == 1e-4);
    CHECK(!pal_entry_read_count(solver, "iterations", 0, 99, &iterations, &diag) && iterations == 33);
    CHECK(set->mesh.tets.n_node == 0);
    pal_configured_scene_free(set);
    /* elements that run on voxels as they are go on on them, in place of springs they have them measured */
    o.mesh.hexes.measured = false;
    CHECK(!pal_configuration_make(o.scene, 0, &to, &diag, &set));
    CHECK(set->mesh.tets.n_node == 0);
    pal_configured_scene_free(set);
    pal_entry_init(&def->model, "model", "tet_springs");
    CHECK(!pal_configuration_make(o.scene, 0, &to, &diag, &set));
    CHECK(set->mesh.tets.n_node > 0 && set->mesh.hexes.measured);
    pal_configured_scene_free(set);
    organ_free(&o);
}

/* a plane of the voxels goes through the border of the support, whatever the size: what is held ends there */
static void voxels_end_where_the_support_does(void)
{
    organ o;
    organ_make(&o, true);
    for (int size = 9; size <= 15; size += 2) {
        pal_configured_scene *set = NULL;
        pal_configuration to = {.model = "fem", .size = size};
        CHECK(!pal_configuration_make(o.scene, 0, &to, &o.diag, &set));
        if (!set) continue;
        double nearest = 1;
        for (int i = 0; i < set->mesh.tets.n_node; i++) {
            double behind = 0.031 - set->mesh.tets.x[3 * i];
            if (behind >= 0) nearest = fmin(nearest, behind);
        }
        CHECK(nearest >= 0 && nearest < 1e-5 * set->mesh.tets.edge_m);
        pal_configured_scene_free(set);
    }
    organ_free(&o);
}

/* another mesh holds the same part of the body, its border in a plane of nodes */
static void the_lowest_part_is_fixed_as_a_box(void)
{
    organ o;
    organ_make(&o, true);
    o.scene->body[0].support[0] = (pal_support_def){.lowest = true, .fraction = 0.2};
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < o.mesh.surface.n_vertex; i++)
        low = fmin(low, o.mesh.surface.x[3 * i + 2]), high = fmax(high, o.mesh.surface.x[3 * i + 2]);
    for (int size = 7; size <= 15; size += 4) {
        pal_configured_scene *set = NULL;
        double nearest = 1, top = low + 0.2 * (high - low);
        CHECK(!pal_configuration_make(o.scene, 0, &(pal_configuration){.model = "fem", .size = size}, &o.diag, &set));
        if (!set) continue;
        const pal_support_def *box = &set->scene.body[0].support[0];
        CHECK(!box->lowest && box->low_m[2] < low - 0.1 && box->low_m[0] < -0.1 && box->high_m[1] > 0.2);
        CHECK_NEAR(box->high_m[2], top, 1e-8);
        for (int i = 0; i < set->mesh.tets.n_node; i++) {
            double below = box->high_m[2] - set->mesh.tets.x[3 * i + 2];
            if (below >= 0) nearest = fmin(nearest, below);
        }
        CHECK(nearest < 1e-5 * set->mesh.tets.edge_m);
        pal_configured_scene_free(set);
    }
    /* upside down, and along no axis */
    pal_support_def box;
    pal_set3(o.scene->up, 0, 0, -1);
    CHECK(pal_configuration_support_box(o.scene, 0, 0, &box));
    CHECK_NEAR(box.low_m[2], high - 0.2 * (high - low), 1e-8);
    pal_set3(o.scene->up, 0.6, 0, 0.8);
    CHECK(!pal_configuration_support_box(o.scene, 0, 0, &box));
    organ_free(&o);
}

/* springs' own meshes keep every voxel that the surface touches: nodes up to a voxel below it are no reason to hold
 * nothing on another mesh */
static void the_lowest_part_of_whole_voxels_is_fixed_on_every_mesh(void)
{
    organ o;
    organ_make(&o, true);
    pal_prepared_free(&o.mesh);
    pal_voxel_options voxel = {.resolution = 12, .border = true};
    REQUIRE(!pal_prepared_make(&o.surface, &voxel, &o.mesh, NULL, &o.diag));
    o.scene->body[0].support[0] = (pal_support_def){.lowest = true, .fraction = 0.05};
    for (int k = 0; k < 6; k++) {
        pal_configured_scene *set = NULL;
        pal_world *world = NULL;
        pal_configuration to = {.model = "fem", .size = k % 3 == 0 ? 8 : k % 3 == 1 ? 16 : 24};
        if (k > 2) snprintf(to.model, sizeof to.model, "tet_springs");
        CHECK(!pal_configuration_make(o.scene, 0, &to, &o.diag, &set));
        CHECK(set && !pal_world_create(&set->scene, &o.diag, &world));
        int n_fixed = 0;
        for (int i = 0; world && i < pal_world_body(world, 0)->n_dof; i++)
            n_fixed += pal_world_body(world, 0)->support[i];
        CHECK(n_fixed >= 4);
        pal_world_destroy(world);
        pal_configured_scene_free(set);
    }
    organ_free(&o);
}

static void a_hollow_body_adapts_or_is_refined(void)
{
    organ o;
    organ_make(&o, false);
    check_round(o.scene);
    check_runs(o.scene, &(pal_configuration){.model = "adaptive_springs", .size = 3, .step_s = 1.0 / 120});
    pal_configuration refined = {.model = "adaptive_springs", .element = "refined", .size = 2, .step_s = 1.0 / 60};
    check_runs(o.scene, &refined);
    pal_configured_scene *set = NULL;
    CHECK(!pal_configuration_make(o.scene, 0, &refined, &o.diag, &set));
    if (set) {
        check_round(&set->scene);
        CHECK(set->scene.body[0].model.n_value == 3); /* levels, start_level, refine */
    }
    pal_configured_scene_free(set);
    check_refused(o.scene, 0, &(pal_configuration){.model = "fem", .size = 10}, "surface alone");
    check_refused(o.scene, 0, &(pal_configuration){.model = "adaptive_springs", .size = 11}, "size: 11");
    check_refused(o.scene, 0, &(pal_configuration){.model = "adaptive_springs", .tolerance = 0.1}, "tolerance");
    organ_free(&o);
}

static void cells_go_into_voxels(void)
{
    const int32_t n[3] = {4, 2, 2};
    const double length_scale_m[3] = {0.2, 0.1, 0.1};
    solid_scene s;
    solid_scene_take(&s, solid_scene_box(n, length_scale_m, true), 1, "central_cg", "polar");
    solid_scene_hold(&s, 0, 1e-9);
    check_round(s.scene);
    check_runs(
        s.scene,
        &(pal_configuration){
            .model = "subdivision_fem", .solver = "implicit_euler", .size = -1, .step_s = 1.0 / 60, .tolerance = 1e-3});
    check_runs(s.scene, &(pal_configuration){
                            .model = "subdivision_fem", .solver = "central_cg", .size = 1, .step_s = 1.0 / 240});
    check_runs(s.scene, &(pal_configuration){.model = "fem", .size = 8, .step_s = 1.0 / 60});
    pal_configured_scene *set = NULL;
    /* crisp cells stay a box: their voxels have its volume */
    CHECK(!pal_configuration_make(s.scene, 0, &(pal_configuration){.model = "fem", .size = 8}, &s.diag, &set));
    if (set) CHECK_NEAR(pal_surface_volume(&set->mesh.surface), 0.002, 1e-9);
    if (set) CHECK(set->scene.body[0].cells == NULL && s.def->cells != NULL);
    pal_configured_scene_free(set);
    check_refused(s.scene, 0, &(pal_configuration){.model = "fem"}, "how many");
    check_refused(s.scene, 0, &(pal_configuration){.model = "tet_springs", .size = 8}, "control cells");
    pal_stroke stroke = {.radius_m = 0.1, .young_factor = 2, .density_factor = 1};
    s.def->n_stroke = 1, s.def->stroke = &stroke;
    check_refused(s.scene, 0, &(pal_configuration){.model = "fem", .size = 8}, "painted");
    solid_scene_close(&s);
}

static void models_that_do_not_fit_are_refused_in_a_sentence(void)
{
    organ o;
    organ_make(&o, true);
    const struct {
        pal_configuration to;
        int body;
        const char *word;
    } list[] = {
        {{.model = "jelly"}, 0, "jelly"},
        {{.model = "fem"}, 1, "body 1"},
        {{.model = "fem", .element = "hex20", .size = 8}, 0, "hex20"},
        {{.model = "fem", .law = "hookean", .size = 8}, 0, "hookean"},
        {{.model = "fem", .solver = "euler", .size = 8}, 0, "euler"},
        {{.model = "fem", .size = 401}, 0, "401"},
        {{.model = "fem", .size = -1}, 0, "-1"},
        {{.model = "fem", .size = 8, .step_s = 0.2}, 0, "0.2"},
        {{.model = "fem", .size = 8, .step_s = NAN}, 0, "step_s"},
        {{.model = "fem", .size = 8, .tolerance = 0.7}, 0, "0.7"},
        {{.model = "fem", .size = 8, .k_distance_J = 1}, 0, "k_distance_J"},
        {{.model = "tet_springs", .size = 8, .k_volume_J = -3}, 0, "k_volume_J"},
        {{.model = "tet_springs", .law = "linear", .size = 8}, 0, "law"},
        {{.model = "tet_springs", .solver = "verlet", .tolerance = 0.1}, 0, "verlet"},
        {{.model = "subdivision_fem", .size = 1}, 0, "subdivision_fem"},
    };
    for (size_t k = 0; k < sizeof list / sizeof *list; k++)
        check_refused(o.scene, list[k].body, &list[k].to, list[k].word);
    pal_configured_scene_free(NULL);
    organ_free(&o);
}

static void configurations_have_a_text(void)
{
    char text[PAL_CONFIGURATION_TEXT];
    const pal_configuration fem = {.model = "fem",
                                   .element = "hex8_bbar",
                                   .law = "corotational",
                                   .solver = "implicit_euler",
                                   .size = 16,
                                   .step_s = 1.0 / 60};
    CHECK_TEXT(pal_configuration_text(&fem, text), "fem hex8_bbar corotational, 16 voxels, implicit_euler, 16.7 ms");
    pal_configuration other = fem;
    CHECK(pal_configuration_equal(&fem, &other));
    other.step_s = 0.01;
    CHECK(!pal_configuration_equal(&fem, &other));
    pal_configuration springs = {.model = "tet_springs", .size = 20, .k_distance_J = 1};
    CHECK_TEXT(pal_configuration_text(&springs, text), "tet_springs calibrated, 20 voxels");
    pal_configuration cells = {.model = "subdivision_fem", .size = -1, .tolerance = 1e-3};
    CHECK_TEXT(pal_configuration_text(&cells, text), "subdivision_fem, 0 levels, tolerance 0.001");
    /* the longest words still end in a 0 */
    memset(&other, 'x', sizeof other);
    other.model[PAL_NAME - 1] = other.element[PAL_NAME - 1] = other.law[PAL_NAME - 1] = other.solver[PAL_NAME - 1] = 0;
    other.size = -2000000000, other.step_s = 1e300, other.tolerance = 1e-300, other.k_distance_J = 1;
    CHECK(strlen(pal_configuration_text(&other, text)) < PAL_CONFIGURATION_TEXT);
}

static void nodes_are_known_before_they_are_made(void)
{
    const pal_configuration list[] = {{.model = "fem", .size = 8},
                                      {.model = "fem", .size = 20},
                                      {.model = "tet_springs", .size = 30, .k_distance_J = 1e-3, .k_volume_J = 4e-3},
                                      {.model = "fem", .element = "tet10", .size = 10}};
    organ o;
    organ_make(&o, true);
    for (size_t k = 0; k < sizeof list / sizeof *list; k++) {
        pal_configuration to = list[k];
        pal_configured_scene *set = NULL;
        double n = pal_configuration_estimate_nodes(o.scene, 0, &to);
        REQUIRE(!pal_configuration_make(o.scene, 0, &to, &o.diag, &set));
        double made = set->mesh.tets.n_node;
        if (to.element[0]) {
            pal_world *w = NULL;
            REQUIRE(!pal_world_create(&set->scene, &o.diag, &w));
            made = pal_world_body(w, 0)->n_node;
            pal_world_destroy(w);
        }
        printf("  %s %d: %.0f nodes said, %.0f made\n", to.element[0] ? to.element : to.model, to.size, n, made);
        CHECK_NEAR(n / made, 1, 0.25);
        pal_configured_scene_free(set);
    }
    CHECK(pal_configuration_estimate_nodes(o.scene, 0, &(pal_configuration){.model = "tet_springs", .size = 12}) == 0);
    /* nobody has to wait for these */
    CHECK(pal_configuration_estimate_nodes(o.scene, 0, &(pal_configuration){.model = "fem", .size = 400}) > 1e7);
    organ_free(&o);
}

int main(void)
{
    RUN(configurations_have_a_text);
    RUN(nodes_are_known_before_they_are_made);
    RUN(a_solid_body_runs_in_every_configuration);
    RUN(keys_outside_a_configuration_stay);
    RUN(voxels_end_where_the_support_does);
    RUN(the_lowest_part_is_fixed_as_a_box);
    RUN(the_lowest_part_of_whole_voxels_is_fixed_on_every_mesh);
    RUN(a_hollow_body_adapts_or_is_refined);
    RUN(cells_go_into_voxels);
    RUN(models_that_do_not_fit_are_refused_in_a_sentence);
    return check_report();
}
