/* Scenes of control cells: where they stand, what is painted on them, what is refused; what is saved loads to the same
 * bits. */
#include "server/mesh/cells/cell_file.h"
#include "server/mesh/cells/cell_models.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "tests/fixtures/cell_check.h"
#include "tests/fixtures/scene_files.h"
#include "tests/fixtures/solids.h"

#include <sys/stat.h>

/* 3 x 2 x 2 bricks of odd sizes, one corner sharp, away from zero */
static pal_cells bricks(void)
{
    pal_cells c = solid_bricks(3, 2, 2, 0.031, 0.027, 0.019);
    for (int32_t i = 0; i < c.n_vertex; i++) {
        c.x[3 * (size_t)i] += 1.0 / 3;
        c.x[3 * (size_t)i + 1] -= 0.7;
        c.x[3 * (size_t)i + 2] += 1e-3 * sin(i);
    }
    c.vertex_sharpness[0] = 2.5f;
    return c;
}

static bool write_bricks(const char *name)
{
    pal_diagnostic diag = {""};
    pal_cells c = bricks();
    pal_err err = pal_cell_file_save(&c, in_folder(name), &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    pal_cells_free(&c);
    return !err;
}

static pal_err parse(const char *text, pal_loaded_scene **out, pal_diagnostic *diag)
{
    *out = NULL;
    diag->text[0] = 0;
    return pal_scene_parse("scene.json", text, strlen(text), folder, out, diag);
}

static pal_loaded_scene *load(const char *text)
{
    pal_loaded_scene *loaded;
    pal_diagnostic diag;
    if (parse(text, &loaded, &diag)) CHECK_FAIL("%s", diag.text);
    return loaded;
}

static void box_of(const pal_cells *c, double low[3], double high[3])
{
    for (int a = 0; a < 3; a++) low[a] = INFINITY, high[a] = -INFINITY;
    for (int32_t i = 0; i < 3 * c->n_vertex; i++) {
        low[i % 3] = fmin(low[i % 3], c->x[i]);
        high[i % 3] = fmax(high[i % 3], c->x[i]);
    }
}

static void cells_stand_about_the_middle_of_their_box(void)
{
    double low[3], high[3];
    pal_cells from = bricks();
    REQUIRE(write_bricks("bricks.palcells"));
    pal_loaded_scene *loaded = load("{\"bodies\": [{\"name\": \"b\", \"cells\": \"bricks.palcells\"}]}");
    REQUIRE(loaded != NULL);
    const pal_body_def *def = &loaded->scene.body[0];
    const double *origin = def->mesh->surface.origin_m;
    box_of(def->cells, low, high);
    for (int a = 0; a < 3; a++) CHECK_NEAR(low[a] + high[a], 0, 1e-15);
    for (int32_t i = 0; i < from.n_vertex; i++)
        for (int a = 0; a < 3; a++) CHECK_NEAR(def->cells->x[3 * i + a] + origin[a], from.x[3 * i + a], 1e-15);
    CHECK_NEAR(origin[1], -0.7, 1e-12);
    CHECK(def->cells->vertex_sharpness[0] == 2.5f);
    /* 32 boundary quads */
    CHECK_INT(def->mesh->surface.n_tri, 64);
    CHECK_INT(def->mesh->tets.n_node, 0);
    CHECK_TEXT(def->model.name, "subdivision_fem");
    CHECK_TEXT(def->output.name, "surface_output");
    CHECK_INT(def->n_support, 1);
    CHECK(def->support[0].lowest);
    CHECK_INT(def->n_effect, 4);
    CHECK_TEXT(def->effect[1].path, "bodies[0].effects[1]");
    pal_scene_free(loaded);
    pal_cells_free(&from);
}

static void units_and_other_formats_are_read(void)
{
    double low[3], high[3];
    pal_diagnostic diag = {""};
    pal_cells c = solid_bricks(2, 1, 1, 40, 30, 20);
    REQUIRE(!pal_cell_file_save(&c, in_folder("mm.vtk"), &diag));
    pal_cells_free(&c);
    pal_loaded_scene *loaded = load("{\"bodies\": [{\"cells\": \"mm.vtk\", \"units\": \"mm\"}]}");
    REQUIRE(loaded != NULL);
    box_of(loaded->scene.body[0].cells, low, high);
    CHECK_NEAR(high[0] - low[0], 0.08, 1e-15);
    CHECK_NEAR(high[2] - low[2], 0.02, 1e-15);
    pal_scene_free(loaded);
}

static const char whole[] =
    "{\"name\": \"s\", \"step_s\": 0.01, \"bodies\": [{\"name\": \"block\", \"cells\": \"bricks.palcells\","
    " \"material\": {\"young_Pa\": 7000, \"damping_1_s\": 3},"
    " \"model\": {\"name\": \"subdivision_fem\", \"levels\": 1, \"rule\": \"averaging\"},"
    " \"supports\": [{\"box\": {\"low_m\": [-1, -1, -1], \"high_m\": [-0.03, 1, 1]}}],"
    " \"regions\": [{\"box\": {\"low_m\": [0, 0, 0], \"high_m\": [1, 1, 1]}, \"young_Pa\": 9000}],"
    " \"cut\": {\"normal\": [1, 2, -0.3], \"offset_m\": 0.012345678901234567},"
    " \"strokes\": [{\"at_m\": [0.01, 0.1, -0.2], \"radius_m\": 0.03, \"young_factor\": 10},"
    "  {\"at_m\": [0.3, 1e-7, 0.1], \"radius_m\": 0.1, \"softness\": 0.123456789012345678, \"young_factor\": 0.3,"
    "   \"density_factor\": 1.1}]}]}";

static void what_is_saved_loads_to_the_same_bits(void)
{
    pal_diagnostic diag = {""};
    pal_loaded_scene *a = load(whole), *b = NULL, *c = NULL;
    REQUIRE(a != NULL);
    REQUIRE(!pal_scene_save(a, in_folder("saved"), &diag));
    if (pal_scene_load(in_folder("saved/scene.json"), &b, &diag)) CHECK_FAIL("%s", diag.text);
    REQUIRE(b != NULL);
    /* cut down since, so that the box's middle is elsewhere: the frame stays */
    for (int32_t i = 0; i < b->cells[0].n_vertex; i++) b->cells[0].x[3 * i] *= b->cells[0].x[3 * i] > 0 ? 0.7 : 1;
    REQUIRE(!pal_scene_save(b, in_folder("again"), &diag));
    if (pal_scene_load(in_folder("again/scene.json"), &c, &diag)) CHECK_FAIL("%s", diag.text);
    REQUIRE(c != NULL);
    CHECK(cells_equal(&b->cells[0], &c->cells[0]));
    for (int32_t i = 0; i < b->cells[0].n_vertex; i++) b->cells[0].x[3 * i] = a->cells[0].x[3 * i];
    CHECK(cells_equal(&a->cells[0], &b->cells[0]));
    CHECK(!memcmp(a->cells[0].x, b->cells[0].x, sizeof(double) * 3 * (size_t)a->cells[0].n_vertex));
    pal_loaded_scene *all[2] = {b, c};
    for (int k = 0; k < 2; k++) {
        const pal_body_def *p = &a->scene.body[0], *q = &all[k]->scene.body[0];
        CHECK_INT(q->n_stroke, 2);
        for (int i = 0; i < 2 && q->n_stroke == 2; i++) {
            CHECK(!memcmp(p->stroke[i].at_m, q->stroke[i].at_m, sizeof p->stroke[i].at_m));
            CHECK(p->stroke[i].radius_m == q->stroke[i].radius_m && p->stroke[i].softness == q->stroke[i].softness);
            CHECK(p->stroke[i].young_factor == q->stroke[i].young_factor);
            CHECK(p->stroke[i].density_factor == q->stroke[i].density_factor);
        }
        CHECK(!memcmp(p->mesh->surface.origin_m, q->mesh->surface.origin_m, sizeof p->mesh->surface.origin_m));
        CHECK_TEXT(q->model.name, "subdivision_fem");
        CHECK_INT(q->model.n_value, 2);
        CHECK(q->cut && p->cut && q->cut_m == p->cut_m);
        CHECK(!memcmp(q->cut_normal, p->cut_normal, sizeof p->cut_normal));
        CHECK_INT(q->n_region, 1);
        CHECK_NEAR(q->support[0].high_m[0], -0.03, 0);
    }
    CHECK_NEAR(a->scene.body[0].stroke[0].softness, 0.5, 0);
    CHECK_NEAR(a->scene.body[0].cut_normal[1], 2 / sqrt(5.09), 1e-15);
    CHECK(a->scene.body[0].cut_m == 0.012345678901234567);
    pal_scene_free(a), pal_scene_free(b), pal_scene_free(c);
}

static void bare_cells_become_a_scene(void)
{
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    const pal_surface_scene options = {.label = -1, .material = {9000, 0.4, 1100, 2, 0}, .hold = 0.2, .up = {0, 1, 0}};
    REQUIRE(write_bricks("My Bricks.palcells"));
    if (pal_scene_from_cells(in_folder("My Bricks.palcells"), &options, &loaded, &diag)) CHECK_FAIL("%s", diag.text);
    REQUIRE(loaded != NULL);
    CHECK_TEXT(loaded->scene.name, "my_bricks");
    CHECK_TEXT(loaded->scene.title, "My Bricks");
    CHECK_TEXT(loaded->scene.source, "My Bricks.palcells");
    CHECK_TEXT(loaded->scene.body[0].appearance, "plastic");
    const pal_body_def *def = &loaded->scene.body[0];
    CHECK_TEXT(def->model.name, "subdivision_fem");
    CHECK_NEAR(def->model.value[0].number[0], 2, 0);
    CHECK_NEAR(def->material.young_Pa, 9000, 0);
    CHECK_NEAR(def->support[0].fraction, 0.2, 0);
    CHECK_NEAR(loaded->scene.up[1], 1, 0);
    CHECK_INT(def->n_effect, 4);
    CHECK_TEXT(def->effect[3].name, "sleep");
    CHECK(loaded->scene.tool[2].radius_m > 0);
    CHECK(!pal_scene_rename(loaded, "liver", "Liver", "us", &diag));
    CHECK_TEXT(loaded->scene.body[0].name, "liver");
    pal_scene_free(loaded);
    CHECK_INT(pal_scene_from_cells(in_folder("none.palcells"), &options, &loaded, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "none.palcells") != NULL);
}

/* the kidney's ureter has 12 of its 198 vertices: held there alone it would sway for half a minute */
static void enough_of_a_solid_is_held(void)
{
    static const struct {
        const char *name;
        double fraction;
    } wanted[] = {{"kidney", 0.392}, {"chair", 0.137}, {"block3", 0.05}};
    const pal_surface_scene options = {.label = -1};
    for (int k = 0; k < 3; k++) {
        pal_diagnostic diag = {""};
        pal_cells cells;
        pal_loaded_scene *loaded = NULL;
        REQUIRE(pal_cell_model_make(pal_cell_model_find(wanted[k].name), &cells, &diag) == PAL_ERR_OK);
        CHECK(!pal_cell_file_save(&cells, in_folder("stands.palcells"), &diag));
        if (pal_scene_from_cells(in_folder("stands.palcells"), &options, &loaded, &diag)) CHECK_FAIL("%s", diag.text);
        REQUIRE(loaded != NULL);
        double fraction = loaded->scene.body[0].support[0].fraction, low = INFINITY, high = -INFINITY;
        int n_fixed = 0;
        CHECK_NEAR(fraction, wanted[k].fraction, 1e-3);
        for (int i = 0; i < cells.n_vertex; i++)
            low = fmin(low, cells.x[3 * i + 2]), high = fmax(high, cells.x[3 * i + 2]);
        for (int i = 0; i < cells.n_vertex; i++)
            n_fixed += cells.x[3 * i + 2] <= low + (fraction + 1e-9) * (high - low);
        CHECK_LE(cells.n_vertex, 8 * n_fixed + 7);
        pal_scene_free(loaded);
        pal_cells_free(&cells);
    }
}

/* with /BODY/ for what stands in the only body beside its cells */
static void expect(const char *body, const char *sentence)
{
    char text[2048];
    pal_loaded_scene *loaded;
    pal_diagnostic diag;
    snprintf(text, sizeof text, "{\"bodies\": [{%s}]}", body);
    if (!parse(text, &loaded, &diag)) CHECK_FAIL("taken: %s", body);
    CHECK(loaded == NULL);
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    if (strncmp(diag.text, "scene.json: ", 12) != 0 || strchr(diag.text, '\n'))
        CHECK_FAIL("\"%s\" is no sentence with the file", diag.text);
    pal_scene_free(loaded);
}

#define CELLS  "\"cells\": \"bricks.palcells\""
#define STROKE "\"at_m\": [0, 0, 0], \"radius_m\": 0.1"

static void what_does_not_fit_is_refused_in_a_sentence(void)
{
    FILE *bad = fopen(in_folder("bad.palcells"), "w");
    REQUIRE(bad != NULL && fputs("palcells 1\nv 0 0 0\nv 1 0 x\n", bad) > 0 && !fclose(bad));
    expect(CELLS ", \"mesh\": \"a.palmesh\"", "bodies[0].mesh: does not go with cells");
    expect(CELLS ", \"surface\": \"a.stl\"", "bodies[0].surface: does not go with cells");
    expect(CELLS ", \"resolution\": 4", "bodies[0].resolution: does not go with cells");
    expect("\"cells\": 4", "bodies[0].cells: is not a text");
    expect("\"cells\": \"none.palcells\"", "bodies[0].cells: ");
    expect("\"cells\": \"none.palcells\"", "none.palcells");
    expect("\"cells\": \"bad.palcells\"", "bad.palcells: line 3: ");
    expect(CELLS ", \"units\": \"mile\"", "bodies[0].units: is not m, cm, mm");
    expect(CELLS ", \"origin_m\": [1, 2]", "bodies[0].origin_m: is not a list of three numbers");
    expect(CELLS ", \"origin_m\": [1e999, 0, 0]", "bodies[0].origin_m");
    expect("\"surface\": \"a.stl\", \"origin_m\": [0, 0, 0]", "bodies[0]: origin_m only goes with cells");
    expect(CELLS ", \"model\": {\"name\": \"fem\"}",
           "bodies[0].cells: model \"fem\" does not take control cells; \"subdivision_fem\" does");
    expect("\"surface\": \"a.stl\", \"strokes\": [{" STROKE "}]",
           "bodies[0].strokes: model \"tet_springs\" cannot be painted; \"subdivision_fem\" can");
    expect("\"surface\": \"a.stl\", \"cut\": {\"normal\": [1, 0, 0]}",
           "bodies[0].cut: model \"tet_springs\" cannot be cut away; \"subdivision_fem\" can");
    expect(CELLS ", \"cut\": true", "bodies[0].cut: is not an object");
    expect(CELLS ", \"cut\": {\"offset_m\": 0}", "bodies[0].cut.normal: is missing");
    expect(CELLS ", \"cut\": {\"normal\": [0, 0, 0]}", "bodies[0].cut.normal: has no direction");
    expect(CELLS ", \"cut\": {\"normal\": [0, 1e999, 0]}", "bodies[0].cut.normal");
    expect(CELLS ", \"cut\": {\"normal\": [0, 1, 0], \"offset_m\": 1e10}", "bodies[0].cut.offset_m");
    expect(CELLS ", \"cut\": {\"normal\": [0, 1, 0], \"depth\": 1}", "bodies[0].cut.depth: unknown key");
    expect(CELLS ", \"strokes\": {}", "bodies[0].strokes: is not a list");
    expect(CELLS ", \"strokes\": [3]", "bodies[0].strokes[0]: is not an object");
    expect(CELLS ", \"strokes\": [{\"radius_m\": 1}]", "bodies[0].strokes[0].at_m: is missing");
    expect(CELLS ", \"strokes\": [{\"at_m\": [0, 0, 0]}]", "bodies[0].strokes[0].radius_m: is missing");
    expect(CELLS ", \"strokes\": [{" STROKE "}, {" STROKE ", \"colour\": 1}]",
           "bodies[0].strokes[1].colour: unknown key");
    expect(CELLS ", \"strokes\": [{" STROKE ", \"softness\": 1.5}]",
           "bodies[0].strokes[0].softness: 1.5, wanted 0 to 1");
    expect(CELLS ", \"strokes\": [{" STROKE ", \"young_factor\": 0}]",
           "bodies[0].strokes[0].young_factor: 0, wanted 1e-6 to 1e6");
    expect(CELLS ", \"strokes\": [{" STROKE ", \"density_factor\": 1e7}]",
           "bodies[0].strokes[0].density_factor: 1e+07, wanted 1e-6 to 1e6");
    expect(CELLS ", \"strokes\": [{\"at_m\": [0, 0, 0], \"radius_m\": -1}]",
           "bodies[0].strokes[0].radius_m: -1, wanted more than 0");
    expect(CELLS ", \"strokes\": [{\"at_m\": [0, 1e999, 0], \"radius_m\": 1}]", "bodies[0].strokes[0].at_m");
}

static void more_strokes_than_there_may_be_are_refused(void)
{
    size_t room = (PAL_STROKE_MAX + 1) * 48 + 256;
    char *text = malloc(room), *at = text;
    pal_loaded_scene *loaded;
    pal_diagnostic diag;
    REQUIRE(text != NULL);
    at += sprintf(at, "{\"bodies\": [{" CELLS ", \"strokes\": [");
    for (int k = 0; k <= PAL_STROKE_MAX; k++) at += sprintf(at, "%s{" STROKE "}", k ? "," : "");
    sprintf(at, "]}]}");
    CHECK_INT(parse(text, &loaded, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, "bodies[0].strokes: 4097 entries, more than 4096")) CHECK_FAIL("%s", diag.text);
    pal_scene_free(loaded);
    free(text);
}

/* cells so far away that a double cannot hold their edges */
static void cells_that_lose_their_shape_are_refused(void)
{
    pal_diagnostic diag = {""};
    pal_cells c = solid_bricks(2, 1, 1, 1e-9, 1e-9, 1e-9);
    REQUIRE(!pal_cell_file_save(&c, in_folder("tiny.palcells"), &diag));
    pal_cells_free(&c);
    pal_loaded_scene *loaded = load("{\"bodies\": [{\"cells\": \"tiny.palcells\"}]}");
    CHECK(loaded != NULL);
    pal_scene_free(loaded);
}

static void a_scene_of_cells_steps(void)
{
    pal_diagnostic diag = {""};
    pal_world *world = NULL;
    pal_loaded_scene *loaded = load(whole);
    REQUIRE(loaded != NULL);
    if (pal_world_create(&loaded->scene, &diag, &world)) CHECK_FAIL("%s", diag.text);
    REQUIRE(world != NULL);
    const pal_body *body = pal_world_body(world, 0);
    int n_fixed = 0;
    for (int i = 0; i < body->n_dof; i++) n_fixed += body->support[i];
    CHECK_INT(body->n_dof, 36);
    CHECK_INT(n_fixed, 9);
    CHECK_INT(pal_cell_elements_count(&body->model.solid->elements), 96);
    for (int k = 0; k < 10; k++) CHECK_INT(pal_world_step(world, 0.01), 0);
    CHECK(pal_body_finite(body));
    /* gravity is on by default */
    CHECK(pal_world_energy_J(world) > 0 || pal_world_energy_J(world) < 0);
    pal_world_destroy(world);
    pal_scene_free(loaded);
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    RUN(cells_stand_about_the_middle_of_their_box);
    RUN(units_and_other_formats_are_read);
    RUN(what_is_saved_loads_to_the_same_bits);
    RUN(bare_cells_become_a_scene);
    RUN(enough_of_a_solid_is_held);
    RUN(what_does_not_fit_is_refused_in_a_sentence);
    RUN(more_strokes_than_there_may_be_are_refused);
    RUN(cells_that_lose_their_shape_are_refused);
    RUN(a_scene_of_cells_steps);
    return check_report();
}
