/* Components without support where scenes are made ready: from a surface, a scene file, a prepared mesh, control cells,
 * another configuration. What a scene holds and what it asks for decides. */
#include "server/mesh/cells/cell_file.h"
#include "server/mesh/cells/cell_lattice.h"
#include "server/scene/scene_file.h"
#include "server/sim/core/configuration.h"
#include "server/sim/world/world.h"
#include "tests/check.h"

static char folder[] = "/tmp/palpate_loose_XXXXXX";
static pal_diagnostic diag;

static char *in_folder(const char *name)
{
    static char path[4][512];
    static int turn;
    char *out = path[turn++ & 3];
    snprintf(out, 512, "%s/%s", folder, name);
    return out;
}

/* boxes of whole centimetres, low x y z and high x y z, as an OBJ in millimetres */
static bool write_boxes(const char *name, int n, const int box[][6])
{
    static const int side[6][4] = {{1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {2, 4, 8, 6}};
    FILE *file = fopen(in_folder(name), "wb");
    if (!file) return false;
    for (int k = 0; k < n; k++) {
        for (int c = 0; c < 8; c++)
            fprintf(file, "v %d %d %d\n", 10 * box[k][3 * (c & 1)], 10 * box[k][1 + 3 * (c >> 1 & 1)],
                    10 * box[k][2 + 3 * (c >> 2)]);
        for (int s = 0; s < 6; s++)
            fprintf(file, "f %d %d %d %d\n", 8 * k + side[s][0], 8 * k + side[s][1], 8 * k + side[s][2],
                    8 * k + side[s][3]);
    }
    return fclose(file) == 0;
}

/* a voxel of 1 cm that meets a body of 1000 in an edge, and a body above another one */
static const int speck[2][6] = {{0, 0, 0, 10, 10, 10}, {10, 10, 4, 11, 11, 5}},
                 stack[2][6] = {{0, 0, 0, 4, 4, 4}, {0, 0, 8, 3, 4, 12}};
static const pal_surface_scene wanted_speck = {.unit_m = 1e-3, .resolution = 11, .label = -1, .fem = true},
                               wanted_stack = {.unit_m = 1e-3, .resolution = 12, .label = -1, .fem = true};

/* every tetrahedron reaches a held node through shared faces */
static void check_held(const pal_scene *scene, int body)
{
    const pal_body_def *def = &scene->body[body];
    const pal_tets *tets = &def->mesh->tets;
    uint8_t *fixed = calloc((size_t)tets->n_node, 1), *reached = NULL;
    int32_t *label = malloc((size_t)tets->n_tet * sizeof *label);
    int n = 0;
    REQUIRE(fixed && label && !pal_tets_components(tets, label, &n));
    REQUIRE((reached = calloc((size_t)n, 1)) != NULL);
    pal_body_def_mark_fixed(def, scene->up, tets->x, tets->n_node, fixed);
    for (int i = 0; i < 4 * tets->n_tet; i++) reached[label[i / 4]] |= fixed[tets->tet[i]];
    for (int k = 0; k < n; k++) CHECK_INT(reached[k], 1);
    free(fixed), free(label), free(reached);
}

/* a state of rest exists: static_newton refuses a body of which a part keeps a rigid motion */
static pal_err try_static(const pal_scene *from)
{
    pal_scene *scene = malloc(sizeof *scene);
    pal_world *world = NULL;
    if (!scene) return PAL_ERR_MEMORY;
    *scene = *from;
    pal_entry_init(&scene->body[0].solver, "solver", "static_newton");
    scene->body[0].n_effect = 0;
    pal_err err = pal_world_create(scene, &diag, &world);
    if (!err) pal_world_destroy(world);
    free(scene);
    return err;
}

/* the same scene on all voxels of its surface, as it was made before components were looked at */
static pal_err try_static_with_all(const pal_loaded_scene *loaded, int n_hex)
{
    pal_voxel_options options = {.resolution = 11, .border = true, .min_fill = 0.1};
    pal_scene *scene = malloc(sizeof *scene);
    pal_prepared whole = {0};
    pal_err err = scene ? pal_prepared_make(&loaded->mesh[0].surface, &options, &whole, NULL, &diag) : PAL_ERR_MEMORY;
    if (!err) {
        CHECK_INT(whole.hexes.n_hex, n_hex);
        *scene = loaded->scene;
        scene->body[0].mesh = &whole;
        err = try_static(scene);
    }
    pal_prepared_free(&whole);
    free(scene);
    return err;
}

static void a_loose_voxel_of_a_surface_is_left_out(void)
{
    /* in an edge of the body, and one that touches nothing */
    static const int detached[2][6] = {{0, 0, 0, 9, 9, 9}, {10, 4, 4, 11, 5, 5}};
    for (int k = 0; k < 2; k++) {
        const int n_hex = k == 0 ? 1000 : 729;
        pal_loaded_scene *loaded = NULL;
        pal_surface_scene_report report;
        REQUIRE(write_boxes("speck.obj", 2, k == 0 ? speck : detached));
        REQUIRE(!pal_scene_from_surface(in_folder("speck.obj"), &wanted_speck, &loaded, &report, &diag));
        CHECK_INT(loaded->loose[0].n_component, 2);
        CHECK_INT(loaded->loose[0].n_dropped, 1);
        CHECK_NEAR(loaded->loose[0].dropped_m3, 1e-6, 1e-12);
        CHECK_INT(report.prepare.voxel.n_component, 1);
        CHECK_INT(report.prepare.n_voxel, n_hex);
        CHECK_NEAR(report.prepare.volume_m3, 1e-6 * n_hex, 1e-9);
        check_held(&loaded->scene, 0);
        CHECK_INT(try_static(&loaded->scene), PAL_ERR_OK);
        if (k == 1) CHECK_INT(try_static_with_all(loaded, n_hex + 1), PAL_ERR_REFUSED);
        /* what is saved has nothing loose any more */
        REQUIRE(!pal_scene_save(loaded, in_folder("saved"), &diag));
        pal_scene_free(loaded);
        REQUIRE(!pal_scene_load(in_folder("saved/scene.json"), &loaded, &diag));
        CHECK_INT(loaded->loose[0].n_component, 1);
        CHECK_INT(loaded->loose[0].n_dropped, 0);
        pal_scene_free(loaded);
    }
}

static void springs_are_treated_alike(void)
{
    /* borders of voxels bridge an edge, so there are three voxels between */
    static const int far[2][6] = {{0, 0, 0, 20, 20, 20}, {24, 4, 10, 25, 5, 11}};
    pal_loaded_scene *loaded = NULL;
    pal_surface_scene wanted = {.unit_m = 1e-3, .resolution = 25, .label = -1};
    REQUIRE(write_boxes("far.obj", 2, far));
    REQUIRE(!pal_scene_from_surface(in_folder("far.obj"), &wanted, &loaded, NULL, &diag));
    CHECK_TEXT(loaded->scene.body[0].model.name, "tet_springs");
    CHECK_INT(loaded->loose[0].n_dropped, 1);
    CHECK_NEAR(loaded->loose[0].dropped_m3, 7e-6, 1e-12);
    check_held(&loaded->scene, 0);
    pal_scene_free(loaded);
}

static void a_large_one_of_a_surface_is_refused_and_the_largest_can_be_kept(void)
{
    pal_loaded_scene *loaded = NULL;
    pal_surface_scene_report report;
    pal_surface_scene wanted = wanted_stack;
    REQUIRE(write_boxes("stack.obj", 2, stack));
    CHECK_INT(pal_scene_from_surface(in_folder("stack.obj"), &wanted, &loaded, NULL, &diag), PAL_ERR_REFUSED);
    CHECK(loaded == NULL);
    CHECK(strstr(diag.text, "stack.obj: line "));
    CHECK(strstr(diag.text,
                 "body \"stack\": 1 of 2 components has no support, the largest of 48 ml (42.9 % of the body)"));
    CHECK(strstr(diag.text, "--largest") && strstr(diag.text, "by a support") && strstr(diag.text, "now 12"));
    wanted.largest_only = true;
    REQUIRE(!pal_scene_from_surface(in_folder("stack.obj"), &wanted, &loaded, &report, &diag));
    CHECK_INT(report.prepare.voxel.n_component, 1);
    CHECK_INT(loaded->mesh[0].hexes.n_hex, 64);
    check_held(&loaded->scene, 0);
    pal_scene_free(loaded);
}

/* ---- scene files ---- */

static pal_loaded_scene *parse(const char *body)
{
    char text[1024];
    pal_loaded_scene *loaded = NULL;
    snprintf(text, sizeof text, "{\"bodies\": [{\"name\": \"b\", %s}]}", body);
    diag.text[0] = 0;
    return pal_scene_parse("s.json", text, strlen(text), folder, &loaded, &diag) ? NULL : loaded;
}

#define FEM      ", \"model\": {\"name\": \"fem\", \"fill\": true}"
#define SURFACE  "\"surface\": \"stack.obj\", \"units\": \"mm\", \"resolution\": 12" FEM
#define MESH     "\"mesh\": \"stack.palmesh\"" FEM
#define LOW      "{\"box\": {\"low_m\": [-1, -1, -1], \"high_m\": [1, 1, -0.059]}}"
#define HIGH     "{\"box\": {\"low_m\": [-1, -1, 0.059], \"high_m\": [1, 1, 1]}}"
#define HIGH_ROW "\"low_m\": [-1, -1, 0.059], \"high_m\": [1, 1, 1]}"

/* bodies of two components that a scene may have, and how many hexahedra are left: 0, it is refused */
static void check_scenes(const char *thing)
{
    static const struct {
        const char *keys;
        int n_hex;
    } turn[] = {{"", 0},
                {", \"supports\": [" LOW "]", 0},
                {", \"supports\": [" HIGH "]", 0},
                {", \"supports\": [" LOW ", " HIGH "]", 112},
                {", \"supports\": [{\"lowest\": 1}]", 112},
                {", \"supports\": []", 112},
                {", \"effects\": [{\"name\": \"moving_support\", " HIGH_ROW "]", 112},
                {", \"supports\": [], \"effects\": [{\"name\": \"moving_support\", " HIGH_ROW "]", 0},
                {", \"effects\": [{\"name\": \"penalty\", " HIGH_ROW "]", 112},
                {", \"effects\": [{\"name\": \"penalty\"}]", 0},
                {", \"largest\": false", 0},
                {", \"largest\": true", 64},
                {", \"largest\": true, \"supports\": []", 64}};
    for (size_t k = 0; k < sizeof turn / sizeof *turn; k++) {
        char body[700];
        snprintf(body, sizeof body, "%s%s", thing, turn[k].keys);
        pal_loaded_scene *loaded = parse(body);
        int n_hex = loaded ? loaded->mesh[0].hexes.n_hex : 0;
        if (n_hex != turn[k].n_hex)
            CHECK_FAIL("%s: %d hexahedra, wanted %d (%s)", body, n_hex, turn[k].n_hex, diag.text);
        static const char sentence[] = "s.json: bodies[0]: body \"b\": 1 of 2 components has no support";
        if (!loaded && strncmp(diag.text, sentence, strlen(sentence)) != 0) CHECK_FAIL("%s: \"%s\"", body, diag.text);
        if (!loaded) CHECK(strstr(diag.text, "or keep only the largest one (--largest, \"largest\": true in a scene)"));
        pal_scene_free(loaded);
    }
}

static void a_scene_says_what_is_held(void)
{
    pal_loaded_scene *loaded;
    REQUIRE(write_boxes("stack.obj", 2, stack));
    check_scenes(SURFACE);
    /* the same prepared before, by a program that kept all */
    REQUIRE((loaded = parse(SURFACE ", \"supports\": []")) != NULL);
    REQUIRE(!pal_prepared_save(&loaded->mesh[0], in_folder("stack.palmesh"), &diag));
    pal_scene_free(loaded);
    check_scenes(MESH);
}

static void two_bodies_may_be_one_held_and_one_free(void)
{
    static const char text[] = "{\"bodies\": [{\"name\": \"a\", " SURFACE
                               ", \"largest\": true}, {\"name\": \"b\", " SURFACE ", \"supports\": []}]}";
    pal_loaded_scene *loaded = NULL;
    REQUIRE(!pal_scene_parse("s.json", text, strlen(text), folder, &loaded, &diag));
    CHECK_INT(loaded->mesh[0].hexes.n_hex, 64);
    CHECK_INT(loaded->mesh[1].hexes.n_hex, 112);
    CHECK_INT(loaded->loose[1].n_dropped, 0);
    pal_scene_free(loaded);
}

/* the anchors of a surface hold its pieces: none is dropped, none refused */
static void pieces_of_an_adaptive_surface_all_stay(void)
{
    pal_loaded_scene *loaded =
        parse("\"surface\": \"stack.obj\", \"units\": \"mm\", \"model\": {\"name\": \"adaptive_springs\"}");
    if (!loaded) CHECK_FAIL("%s", diag.text);
    REQUIRE(loaded != NULL);
    CHECK_INT(loaded->loose[0].n_component, 0);
    CHECK_INT(loaded->mesh[0].surface.n_tri, 24);
    pal_world *world = NULL;
    REQUIRE(!pal_world_create(&loaded->scene, &diag, &world));
    for (int k = 0; k < 60; k++) REQUIRE(!pal_world_step(world, loaded->scene.step_s));
    const pal_body *body = pal_world_body(world, 0);
    double max = 0;
    for (int i = 0; i < body->n_node; i++) max = fmax(max, fabs(body->d[3 * i + 2] - body->node_rest[3 * i + 2]));
    /* a second of free fall is 4.9 m */
    CHECK_LE(max, 0.05);
    pal_world_destroy(world);
    pal_scene_free(loaded);
}

/* ---- control cells ---- */

static double last_width;
static void narrow(const double at[3], double x[3])
{
    for (int c = 0; c < 3; c++) x[c] = 0.01 * at[c];
    if (at[2] > 2) x[2] = 0.01 * (2 + last_width * (at[2] - 2));
}

/* two cells, and another one above that meets them in an edge, as a file */
static bool write_cells(double width)
{
    pal_cell_lattice lattice = {.n = {2, 2, 3}, .rows = "#./.. #./.. .#/..", .place = narrow};
    pal_cells cells;
    last_width = width;
    if (pal_cell_lattice_make(&lattice, &cells, &diag)) return false;
    pal_err err = pal_cell_file_save(&cells, in_folder("c.palcells"), &diag);
    pal_cells_free(&cells);
    return !err;
}

static void control_cells_are_treated_alike(void)
{
    static const char plain[] = "\"cells\": \"c.palcells\", \"model\": {\"name\": \"subdivision_fem\", \"levels\": 1}";
    char body[256];
    pal_loaded_scene *loaded = NULL;
    pal_surface_scene options = {.label = -1};
    REQUIRE(write_cells(1));
    CHECK(!parse(plain));
    CHECK(strstr(diag.text, "s.json: bodies[0]: body \"b\": 1 of 2 components has no support, the largest of 1 ml"));
    CHECK_INT(pal_scene_from_cells(in_folder("c.palcells"), &options, &loaded, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "c.palcells: body \"c\": 1 of 2 components"));
    options.largest_only = true;
    REQUIRE(!pal_scene_from_cells(in_folder("c.palcells"), &options, &loaded, &diag));
    CHECK_INT(loaded->cells[0].n_cell, 2);
    CHECK_INT(loaded->mesh[0].surface.n_tri, 20);
    pal_scene_free(loaded);
    snprintf(body, sizeof body, "%s, \"supports\": []", plain);
    REQUIRE((loaded = parse(body)) != NULL);
    CHECK_INT(loaded->cells[0].n_cell, 3);
    pal_scene_free(loaded);
    REQUIRE(write_cells(0.01));
    REQUIRE((loaded = parse(plain)) != NULL);
    CHECK_INT(loaded->cells[0].n_cell, 2);
    CHECK_INT(loaded->loose[0].n_dropped, 1);
    CHECK_NEAR(loaded->loose[0].dropped_m3, 1e-8, 1e-14);
    pal_world *world = NULL;
    CHECK_INT(pal_world_create(&loaded->scene, &diag, &world), PAL_ERR_OK);
    pal_world_destroy(world);
    pal_scene_free(loaded);
}

/* ---- other configurations ---- */

/* voxels of another size are made while the server runs: what is loose in them goes by the same rule */
static void another_configuration_leaves_out_what_is_loose_in_its_voxels(void)
{
    pal_loaded_scene *loaded = NULL;
    pal_configured_scene *set = NULL;
    pal_configuration to;
    pal_surface_scene springs = wanted_speck;
    springs.fem = false;
    REQUIRE(write_boxes("speck.obj", 2, speck));
    REQUIRE(!pal_scene_from_surface(in_folder("speck.obj"), &springs, &loaded, NULL, &diag));
    CHECK_INT(loaded->loose[0].n_dropped, 0);
    pal_configuration_of(&loaded->scene, 0, &to);
    snprintf(to.model, sizeof to.model, "fem");
    snprintf(to.element, sizeof to.element, "hex8_bbar");
    snprintf(to.law, sizeof to.law, "corotational");
    snprintf(to.solver, sizeof to.solver, "implicit_euler");
    to.size = 22;
    to.k_distance_J = to.k_volume_J = to.k_area_J = 0;
    pal_err err = pal_configuration_make(&loaded->scene, 0, &to, &diag, &set);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK_INT(set->scene.body[0].mesh->hexes.n_hex, 8000);
    check_held(&set->scene, 0);
    pal_configured_scene_free(set);
    pal_scene_free(loaded);
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    RUN(a_loose_voxel_of_a_surface_is_left_out);
    RUN(springs_are_treated_alike);
    RUN(a_large_one_of_a_surface_is_refused_and_the_largest_can_be_kept);
    RUN(a_scene_says_what_is_held);
    RUN(two_bodies_may_be_one_held_and_one_free);
    RUN(pieces_of_an_adaptive_surface_all_stay);
    RUN(control_cells_are_treated_alike);
    RUN(another_configuration_leaves_out_what_is_loose_in_its_voxels);
    char command[256];
    snprintf(command, sizeof command, "rm -r %s", folder);
    return check_report() || system(command) != 0;
}
