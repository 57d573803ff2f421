/* Scenes that are made from a bare surface or the procedural organ: size, names, looks, gravity. */
#include "tests/fixtures/scene_files.h"
#include "tests/session/session_scene.h"

/* an OBJ of a ball, in millimetres */
static bool write_ball(const char *path, int rings)
{
    pal_surface ball;
    FILE *file = fopen(path, "w");
    if (!file || !small_ball(&ball, 50, rings)) return false;
    for (int k = 0; k < ball.n_vertex; k++)
        fprintf(file, "v %.9g %.9g %.9g\n", ball.x[3 * k] + 300, ball.x[3 * k + 1], ball.x[3 * k + 2]);
    for (int k = 0; k < ball.n_tri; k++)
        fprintf(file, "f %d %d %d\n", ball.tri[3 * k] + 1, ball.tri[3 * k + 1] + 1, ball.tri[3 * k + 2] + 1);
    pal_surface_free(&ball);
    return fclose(file) == 0;
}

static void a_bare_surface_becomes_a_scene_of_about_13000_tets(void)
{
    pal_surface_scene options = {.label = -1};
    pal_surface_scene_report report;
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(write_ball(in_folder("Ball \xc3\xa9\x01 7.obj"), 40));
    pal_err err = pal_scene_from_surface(in_folder("Ball \xc3\xa9\x01 7.obj"), &options, &loaded, &report, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    const pal_scene *s = &loaded->scene;
    CHECK_NEAR(s->body[0].mesh->tets.n_tet, 13000, 2600);
    CHECK_TEXT(report.unit_name, "mm");
    CHECK(report.unit_guessed && report.label == -1);
    CHECK_NEAR(report.unit_m, 1e-3, 0);
    CHECK_NEAR(report.prepare.voxel.surface_volume_m3, 4.0 / 3 * M_PI * 1.25e-4, 4e-6);
    CHECK_TEXT(s->name, "ball__7");
    CHECK_TEXT(s->title, "Ball \xc3\xa9 7");
    CHECK_TEXT(s->source, "Ball \xc3\xa9 7.obj");
    CHECK_INT(s->n_tool, 3);
    CHECK_TEXT(s->tool[0].name, "grasper");
    CHECK(s->tool[0].instrument == PAL_INSTRUMENT_GRASPER && s->tool[1].instrument == PAL_INSTRUMENT_RETRACTOR);
    CHECK_INT(s->body[0].n_support, 1);
    CHECK(hash_after(s, 2) != 0);
    pal_scene_free(loaded);
    options.unit_m = 1;
    options.resolution = 10;
    options.material = (pal_material){1e6, 0.3, 1200, 1, 0};
    REQUIRE(!pal_scene_from_surface(in_folder("Ball \xc3\xa9\x01 7.obj"), &options, &loaded, &report, &diag));
    CHECK_NEAR(report.prepare.voxel.surface_volume_m3, 4.0 / 3 * M_PI * 1.25e5, 4e3);
    CHECK(!report.unit_guessed);
    CHECK_INT(report.resolution, 10);
    CHECK_NEAR(loaded->scene.body[0].material.young_Pa, 1e6, 0);
    pal_scene_free(loaded);
}

static void flat_thin_and_long_shapes_also_get_about_13000_tets(void)
{
    const double size[][3] = {{100, 100, 2}, {200, 4, 4}, {10, 10, 10}};
    for (int k = 0; k < 3; k++) {
        FILE *file = fopen(in_folder("box.obj"), "w");
        REQUIRE(file != NULL);
        for (int c = 0; c < 8; c++)
            fprintf(file, "v %g %g %g\n", c & 1 ? size[k][0] : 0, c & 2 ? size[k][1] : 0, c & 4 ? size[k][2] : 0);
        fputs("f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n", file);
        fclose(file);
        pal_surface_scene options = {.label = -1, .unit_m = 1e-3};
        pal_loaded_scene *loaded = NULL;
        pal_diagnostic diag = {""};
        pal_err err = pal_scene_from_surface(in_folder("box.obj"), &options, &loaded, NULL, &diag);
        if (err) CHECK_FAIL("%s", diag.text);
        REQUIRE(!err);
        CHECK_NEAR(log(loaded->scene.body[0].mesh->tets.n_tet / 13000.0), 0, 0.5);
        pal_scene_free(loaded);
    }
}

static void overlapping_shapes_also_get_about_13000_tets(void)
{
    /* nearly the same ball eight times: volume and area eight times too large for a first guess */
    pal_surface ball;
    FILE *file = fopen(in_folder("balls.obj"), "w");
    REQUIRE(file && small_ball(&ball, 50, 20));
    for (int copy = 0; copy < 8; copy++) {
        for (int k = 0; k < ball.n_vertex; k++)
            fprintf(file, "v %.9g %.9g %.9g\n", ball.x[3 * k] + 0.5 * copy, ball.x[3 * k + 1], ball.x[3 * k + 2]);
        for (int k = 0; k < ball.n_tri; k++)
            fprintf(file, "f %d %d %d\n", ball.tri[3 * k] - ball.n_vertex, ball.tri[3 * k + 1] - ball.n_vertex,
                    ball.tri[3 * k + 2] - ball.n_vertex);
    }
    pal_surface_free(&ball);
    fclose(file);
    pal_surface_scene options = {.label = -1};
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_scene_from_surface(in_folder("balls.obj"), &options, &loaded, NULL, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK_NEAR(loaded->scene.body[0].mesh->tets.n_tet, 13000, 2600);
    pal_scene_free(loaded);
}

static void a_scene_may_name_a_surface(void)
{
    const char *text = "{\"bodies\": [{\"surface\": \"b.obj\", \"units\": \"cm\", \"resolution\": 9}]}";
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(write_ball(in_folder("b.obj"), 10));
    REQUIRE(write_text(in_folder("surface.json"), text));
    pal_err err = pal_scene_load(in_folder("surface.json"), &loaded, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK_NEAR(pal_tets_volume(&loaded->mesh[0].tets) / (4.0 / 3 * M_PI * 0.125), 1.5, 0.6);
    pal_scene_free(loaded);
}

static void what_is_no_surface_is_refused_and_names_the_file(void)
{
    pal_surface_scene options = {.label = -1};
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    CHECK_INT(pal_scene_from_surface("/no/file.stl", &options, &loaded, NULL, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/no/file.stl") != NULL);
    REQUIRE(write_text(in_folder("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
    CHECK_INT(pal_scene_from_surface(in_folder("flat.obj"), &options, &loaded, NULL, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "flat.obj") != NULL);
    REQUIRE(write_ball(in_folder("b.obj"), 10));
    options.label = 3;
    CHECK_INT(pal_scene_from_surface(in_folder("b.obj"), &options, &loaded, NULL, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "label 3") != NULL);
    CHECK(loaded == NULL);
}

static void the_procedural_organ_is_a_scene(void)
{
    pal_surface_scene options = {.target_tri = 5000};
    pal_surface_scene_report report;
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_scene_procedural(&options, &loaded, &report, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK_NEAR(loaded->scene.body[0].mesh->tets.n_tet, 13000, 2600);
    CHECK_TEXT(loaded->scene.title, "Procedural organ");
    CHECK(strstr(loaded->scene.source, "not from a patient") != NULL);
    CHECK_INT(pal_scene_rename(loaded, "ok", "T", NULL, &diag), 0);
    CHECK_TEXT(loaded->scene.name, "ok");
    CHECK_TEXT(loaded->scene.title, "T");
    CHECK_INT(pal_scene_rename(loaded, "Not ok", NULL, NULL, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_scene_rename(loaded, NULL, "a\x1b[31m", NULL, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(loaded->scene.title, "T");
    pal_scene_free(loaded);
    pal_scene_free(NULL);
}

static bool has_effect(const pal_body_def *body, const char *name)
{
    for (int k = 0; k < body->n_effect; k++)
        if (!strcmp(body->effect[k].name, name)) return true;
    return false;
}

static void a_shape_as_it_lies_is_pulled_down_only_when_asked(void)
{
    for (int asked = 0; asked < 2; asked++) {
        pal_surface_scene options = {
            .target_tri = 2000, .resolution = 8, .gravity = asked, .up = {0, -asked, 0}, .hold = 0.12 * asked};
        pal_loaded_scene *loaded = NULL;
        REQUIRE(!pal_scene_procedural(&options, &loaded, NULL, NULL));
        CHECK_INT(has_effect(&loaded->scene.body[0], "gravity"), asked);
        CHECK_NEAR(loaded->scene.up[1], -asked, 0);
        CHECK_NEAR(loaded->scene.up[2], !asked, 0);
        CHECK_NEAR(loaded->scene.body[0].support[0].fraction, asked ? 0.12 : 0.05, 1e-12);
        CHECK(has_effect(&loaded->scene.body[0], "tool_push") && has_effect(&loaded->scene.body[0], "tool_grasp"));
        pal_scene_free(loaded);
    }
}

static void a_name_says_what_a_body_looks_like(void)
{
    static const char *const name[][2] = {{"stomach_human_11k", "stomach"},
                                          {"large_intestine", "intestine"},
                                          {"Gall bladder 2", "gall_bladder"},
                                          {"gallbladder_ct", "gall_bladder"},
                                          {"ct-Liver", "liver"},
                                          {"liver2", "liver"},
                                          {"delivery", ""},
                                          {"livers", ""},
                                          {"gall", ""},
                                          {"gall_", ""},
                                          {"", ""}};
    for (size_t k = 0; k < sizeof name / sizeof name[0]; k++) {
        char look[PAL_APPEARANCE_BYTES];
        pal_scene_guess_appearance(name[k][0], look);
        CHECK_TEXT(look, name[k][1]);
    }
}

static void a_body_looks_as_asked_for_or_as_it_is_named(void)
{
    static const struct {
        const char *shape, *asked, *found;
    } shape[] = {{NULL, NULL, "liver"},
                 {NULL, "spleen", "spleen"},
                 {"stomach", NULL, "stomach"},
                 {"sphere", NULL, ""},
                 {"sphere", "fat", "fat"}};
    for (size_t k = 0; k < sizeof shape / sizeof shape[0]; k++) {
        pal_loaded_scene *made = NULL;
        pal_diagnostic diag = {""};
        pal_surface_scene options = {.label = -1,
                                     .resolution = shape[k].shape ? 0 : 6,
                                     .target_tri = 400,
                                     .shape = shape[k].shape,
                                     .adaptive = shape[k].shape != NULL,
                                     .appearance = shape[k].asked};
        pal_err err = pal_scene_procedural(&options, &made, NULL, &diag);
        if (err) CHECK_FAIL("%s", diag.text);
        if (!err) CHECK_TEXT(made->scene.body[0].appearance, shape[k].found);
        pal_scene_free(made);
    }
}

int main(void)
{
    char command[128];
    if (!mkdtemp(folder)) return 1;
    RUN(a_name_says_what_a_body_looks_like);
    RUN(a_body_looks_as_asked_for_or_as_it_is_named);
    RUN(a_bare_surface_becomes_a_scene_of_about_13000_tets);
    RUN(flat_thin_and_long_shapes_also_get_about_13000_tets);
    RUN(overlapping_shapes_also_get_about_13000_tets);
    RUN(a_scene_may_name_a_surface);
    RUN(what_is_no_surface_is_refused_and_names_the_file);
    RUN(the_procedural_organ_is_a_scene);
    RUN(a_shape_as_it_lies_is_pulled_down_only_when_asked);
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return check_report() || system(command) != 0;
}
