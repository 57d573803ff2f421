/* Scene files: every fault has its one sentence that names file and entry; what is saved loads to the same world. */
#include "server/sim/core/effect.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/scene_files.h"
#include "tests/session/session_scene.h"

#include <sys/stat.h>

static pal_scene plain;
static pal_prepared mesh;

/* body of a scene around `inner`, which replaces the text after "mesh" */
static void expect_refusal(const char *text, const char *sentence)
{
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_scene_parse("s.json", text, strlen(text), folder, &loaded, &diag);
    CHECK(err != PAL_ERR_OK);
    CHECK(loaded == NULL);
    if (!err) {
        CHECK_FAIL("taken: %s", text);
        pal_scene_free(loaded);
    }
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    if (strncmp(diag.text, "s.json: ", 8) != 0) CHECK_FAIL("\"%s\" does not name the file first", diag.text);
    if (strchr(diag.text, '\n')) CHECK_FAIL("\"%s\" has a line end", diag.text);
}

static void what_is_not_json_is_refused_with_its_line(void)
{
    expect_refusal("", "not JSON");
    expect_refusal("{\n\n\"name\": \n}", "line 4: not JSON");
    expect_refusal("[1]", "not a JSON object");
    expect_refusal("7", "not a JSON object");
    expect_refusal("{} {}", "line 1: more text behind the end");
    expect_refusal("{\"name\": \"a\xff\"}", "line 1: byte 11 is not UTF-8");
    expect_refusal("[[[[[[[[[[[[[[[[[[[[[[", "nested deeper than 16");
    expect_refusal("{\"a\":[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]}", "nested deeper than 16");
    expect_refusal("{\"name\": \"[[[[[[[[[[[[[[[[[[[[[[[[[[\"}", "name: has other characters");
}

static void big_files_are_refused_before_they_are_parsed(void)
{
    size_t n = (1 << 20) + 1;
    char *text = malloc(n + 1);
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(text != NULL);
    memset(text, ' ', n);
    text[n] = 0;
    CHECK_INT(pal_scene_parse("s.json", text, n, folder, &loaded, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "more than 1048576") != NULL);
    free(text);
}

typedef struct refusal {
    const char *text, *sentence;
} refusal;

static void expect_refusals(size_t n, const refusal *bad)
{
    for (size_t k = 0; k < n; k++) expect_refusal(bad[k].text, bad[k].sentence);
}

static void every_bad_scene_has_its_sentence(void)
{
    static const refusal bad[] = {
        {"{}", "bodies: a scene needs at least one body"},
        {"{\"bodies\": []}", "bodies: a scene needs at least one body"},
        {"{\"bodies\": {}}", "bodies: is not a list"},
        {"{\"bodies\": [1]}", "bodies[0]: is not an object"},
        {"{\"nme\": \"x\"}", "nme: unknown key; known are name, title"},
        {"{\"name\": \"x\", \"name\": \"x\"}", "name: the key is there twice"},
        {"{\"name\": 4}", "name: is not a text"},
        {"{\"name\": \"\"}", "name: is empty"},
        {"{\"name\": \"Liver\"}", "name: has other characters"},
        {"{\"name\": \"0123456789012345678901234567890123456789012345678\"}", "name: 49 bytes of text, more than 47"},
        {"{\"title\": \"a\\u0007\"}", "title: has a control character"},
        {"{\"title\": \"a\\u202e\"}", "title: has a control character"},
        {"{\"accuracy\": 2.1}", "accuracy: is not a text"},
        {"{\"accuracy\": \"a\\n\"}", "accuracy: has a control character"},
        {"{\"accuracy\": \"0123456789012345678901234567890123456789012345678901234567890123"
         "0123456789012345678901234567890123456789012345678901234567890123\"}",
         "accuracy: 128 bytes of text, more than 127"},
        {"{\"accuracy\": \"x\"}", "accuracy: \"x\" is no sentence on how far off"},
        {"{\"accuracy\": \"within 1 mm\"}", "\"within 1 mm\" is no sentence"},
        {"{\"accuracy\": \"1 mm\"}", "an accuracy is asked for by {\"max_error_mm\": 1}"},
        {"{\"accuracy\": {}}", "accuracy: has no max_error_mm"},
        {"{\"accuracy\": {\"max_error_mm\": 0}}", "accuracy.max_error_mm: 0 is outside"},
        {"{\"accuracy\": {\"max_error_mm\": \"1\"}}", "accuracy.max_error_mm: is not a number"},
        {"{\"accuracy\": {\"max_error_mm\": 1, \"text\": 1}}", "accuracy.text: is not a text"},
        {"{\"accuracy\": {\"max_error_m\": 1}}", "accuracy.max_error_m: unknown key; known are max_error_mm, text"},
        {"{\"budget\": 4}", "budget: is not an object"},
        {"{\"budget\": {}}", "budget: has no step_ms"},
        {"{\"budget\": {\"step_ms\": -4}}", "budget.step_ms: -4 is outside"},
        {"{\"budget\": {\"step_ms\": 1e999}}", "budget.step_ms: inf is outside"},
        {"{\"step_s\": \"fast\"}", "step_s: is not a number"},
        {"{\"step_s\": 1}", "step_s: 1 is outside 0.0001 .. 0.1"},
        {"{\"step_s\": 1e999}", "step_s: inf is outside"},
        {"{\"gravity_m_s2\": null}", "gravity_m_s2: is not a number"},
        {"{\"max_substep\": 1.5}", "max_substep: 1.5 is not whole"},
        {"{\"max_substep\": 0}", "max_substep: 0 is outside 1 .. 1e+06"},
        {"{\"up\": [0, 1]}", "up: is not a list of three numbers"},
        {"{\"up\": [0, 1, 2, 3]}", "up: is not a list of three numbers"},
        {"{\"up\": [0, 1, \"z\"]}", "up: is not a list of three numbers"},
        {"{\"tools\": 3}", "tools: is not a list"},
        {"{\"tools\": [{}, {\"radius\": 1}]}", "tools[1].radius: unknown key"},
        {"{\"tools\": [{\"radius_m\": -1}]}", "tools[0].radius_m: -1 is outside 0 .. 1"},
        {"{\"tools\": [{\"force_cap_N\": 0}]}", "tools[0].force_cap_N: 0 is outside"},
        {"{\"tools\": [{\"instrument\": \"spoon\"}]}",
         "tools[0].instrument: \"spoon\" is no instrument; known are ball, probe, grasper, scissors, hook, retractor"},
        {"{\"tools\": [{\"instrument\": 3}]}", "tools[0].instrument: is not a text"},
        {"{\"tools\": [{}, {\"trocar_m\": [0, 1]}]}", "tools[1].trocar_m: is not a list of three numbers"},
        {"{\"tools\": [{\"trocar_m\": [0, 0, 11]}]}", "tools[0].trocar_m: 11 is outside -10 .. 10"},
        {"{\"tools\": [{},{},{},{},{},{},{},{},{}]}", "tools: 9 entries, more than 8"},
        {"{\"bodies\": [{},{},{},{},{},{},{},{},{}]}", "bodies: 9 entries, more than 8"},
    };
    expect_refusals(sizeof bad / sizeof bad[0], bad);
}

static void every_bad_body_has_its_sentence(void)
{
    static const refusal bad[] = {
        {"{\"bodies\": [{}]}", "bodies[0]: needs either mesh or surface"},
        {"{\"bodies\": [{\"mesh\": \"a\", \"surface\": \"b\"}]}", "bodies[0]: needs either mesh or surface"},
        {"{\"bodies\": [{\"mesh\": \"none.palmesh\"}]}", "bodies[0].mesh: "},
        {"{\"bodies\": [{\"mesh\": \"none.palmesh\"}]}", "none.palmesh"},
        {"{\"bodies\": [{\"mesh\": 4}]}", "bodies[0].mesh: is not a text"},
        {"{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"units\": \"mm\"}]}", "bodies[0].units: only goes with surface"},
        {"{\"bodies\": [{\"surface\": \"x.stl\", \"units\": \"mile\"}]}", "bodies[0].units: is not m, cm, mm"},
        {"{\"bodies\": [{\"surface\": \"x.stl\", \"resolution\": 2000}]}", "bodies[0].resolution: 2000 is outside"},
        {"{\"bodies\": [{\"surface\": \"x.stl\", \"largest\": 1}]}", "bodies[0].largest: is not true or false"},
        {"{\"bodies\": [{\"surface\": \"x.stl\"}]}", "bodies[0].surface: "},
        {"{\"bodies\": [{\"surface\": \"scene.json\"}]}", "bodies[0].surface: "},
        {"{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"x\": 1}]}", "bodies[0].x: unknown key"},
        {"{\"bodies\": [{\"appearance\": \"livr\"}]}",
         "bodies[0].appearance: \"livr\" is not one of liver|gall_bladder|stomach"},
        {"{\"bodies\": [{\"appearance\": \"\"}]}", "bodies[0].appearance: is empty"},
        {"{\"bodies\": [{\"colour\": \"red\"}]}", "bodies[0].colour: \"red\" is not a colour as #82352b"},
        {"{\"bodies\": [{\"colour\": \"#12345g\"}]}", "bodies[0].colour: \"#12345g\" is not a colour"},
        {"{\"bodies\": [{\"colour\": \"#1234567\"}]}", "bodies[0].colour: 8 bytes of text, more than 7"},
        {"{\"bodies\": [{\"material\": []}]}", "bodies[0].material: is not an object"},
        {"{\"bodies\": [{\"material\": {\"E\": 1}}]}", "bodies[0].material.E: unknown key; known are young_Pa"},
        {"{\"bodies\": [{\"material\": {\"young_Pa\": 0}}]}", "bodies[0].material.young_Pa: 0 is outside"},
        {"{\"bodies\": [{\"material\": {\"young_Pa\": 1e16}}]}", "bodies[0].material.young_Pa: 1e+16 is outside"},
        {"{\"bodies\": [{\"material\": {\"poisson\": 0.6}}]}", "bodies[0].material.poisson: 0.6 is outside"},
        {"{\"bodies\": [{\"material\": {\"density_kg_m3\": -1}}]}", "bodies[0].material.density_kg_m3: -1 is outside"},
        {"{\"bodies\": [{\"material\": {\"damping_1_s\": true}}]}", "bodies[0].material.damping_1_s: is not a number"},
        {"{\"bodies\": [{\"model\": \"tet_springs\"}]}", "bodies[0].model: is not an object"},
        {"{\"bodies\": [{\"model\": {}}]}", "bodies[0].model: has no name"},
        {"{\"bodies\": [{\"model\": {\"name\": \"a\", \"k\": {}}}]}", "bodies[0].model.k: is not a number, text"},
        {"{\"bodies\": [{\"model\": {\"name\": \"a\", \"k\": 1, \"k\": 2}}]}",
         "bodies[0].model.k: the key is there twice"},
        {"{\"bodies\": [{\"effects\": [{\"name\": \"gravity\"}, {\"nam\": 1}]}]}", "bodies[0].effects[1]: has no name"},
        {"{\"bodies\": [{\"effects\": [{\"name\": \"a\", \"k\": [1, \"b\"]}]}]}",
         "bodies[0].effects[0].k: is not a list of numbers"},
        {"{\"bodies\": [{\"effects\": [{\"name\": \"a\", \"k\": [1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1]}]}]}",
         "bodies[0].effects[0].k: more than 16 numbers"},
        {"{\"bodies\": [{\"supports\": [{}]}]}", "bodies[0].supports[0]: needs either lowest, box or boundary"},
        {"{\"bodies\": [{\"supports\": [{\"lowest\": 2}]}]}", "bodies[0].supports[0].lowest: 2 is outside 0 .. 1"},
        {"{\"bodies\": [{\"supports\": [{\"box\": {\"low_m\": [0,0,0]}}]}]}",
         "bodies[0].supports[0].box.high_m: is missing"},
        {"{\"bodies\": [{\"supports\": [{\"box\": {\"low_m\": [0,2,0], \"high_m\": [1,1,1]}}]}]}",
         "bodies[0].supports[0].box: low_m[1] 2 is above high_m[1] 1"},
        {"{\"bodies\": [{\"supports\": [{\"lowest\":0},{\"lowest\":0},{\"lowest\":0},{\"lowest\":0},{\"lowest\":0},"
         "{\"lowest\":0},{\"lowest\":0},{\"lowest\":0},{\"lowest\":0}]}]}",
         "bodies[0].supports: 9 entries, more than 8"},
        {"{\"up\": [0, 0, 2], \"bodies\": [{\"mesh\": \"ball.palmesh\"}]}", "up: length 2"},
        {"{\"bodies\": [{\"name\": \"a\", \"mesh\": \"ball.palmesh\"}, {\"name\": \"a\", \"mesh\": \"ball.palmesh\"}]}",
         "bodies[1]: the name \"a\" is there twice"},
    };
    expect_refusals(sizeof bad / sizeof bad[0], bad);
}

#define GRID(grid)                                                                                                     \
    "{\"bodies\": [{\"mesh\": \"ball.palmesh\", \"model\": {\"name\": \"tet_springs\", \"grid\": " grid "}}]}"
#define CELL "\"n\": [2, 1, 1], \"low_m\": [0, 0, 0], \"high_m\": [1, 0, 0]"

static void every_bad_grid_of_springs_has_its_sentence(void)
{
    static const refusal bad[] = {
        {GRID("7"), "bodies[0].model.grid: is not an object"},
        {GRID("{}"), "bodies[0].model.grid.n: number 1, 0, is not a count"},
        {GRID("{" CELL ", \"k_J\": [1]}"), "bodies[0].model.grid.k_J: unknown key; known are n, low_m"},
        {GRID("{" CELL "}"), "bodies[0].model.grid: needs k_distance_J, k_area_J or k_volume_J"},
        {GRID("{\"n\": [2, 1.5, 1]}"), "bodies[0].model.grid.n: number 2, 1.5, is not a count"},
        {GRID("{\"n\": [2, 1, -1]}"), "bodies[0].model.grid.n: number 3, -1, is not a count"},
        {GRID("{\"n\": [2, 1]}"), "bodies[0].model.grid.n: is not a list of three numbers"},
        {GRID("{\"n\": [300, 300, 1]}"), "bodies[0].model.grid.n: 90000 values, more than 65536"},
        {GRID("{\"n\": [2, 1, 1]}"), "bodies[0].model.grid.low_m: is missing"},
        {GRID("{\"n\": [2, 1, 1], \"low_m\": [0, 0, 0], \"high_m\": [0, 0, 0]}"),
         "bodies[0].model.grid: low_m[0] 0 is not below high_m[0] 0"},
        {GRID("{" CELL ", \"k_distance_J\": 1}"), "bodies[0].model.grid.k_distance_J: is not a list"},
        {GRID("{" CELL ", \"k_distance_J\": [1]}"), "bodies[0].model.grid.k_distance_J: 1 numbers, wanted 2"},
        {GRID("{" CELL ", \"k_distance_J\": [1, 2, 3]}"), "bodies[0].model.grid.k_distance_J: 3 numbers, wanted 2"},
        {GRID("{" CELL ", \"k_volume_J\": [1, \"x\"]}"), "bodies[0].model.grid.k_volume_J: entry 2 is not a number"},
        {GRID("{" CELL ", \"k_area_J\": [-1, 1]}"), "bodies[0].model.grid.k_area_J: number 1, -1, is outside"},
        {GRID("{" CELL ", \"k_area_J\": [1, 0]}"), "bodies[0].model.grid.k_area_J: number 2, 0, is outside"},
        {GRID("{" CELL ", \"k_area_J\": [1, 1e999]}"), "bodies[0].model.grid.k_area_J: number 2, inf, is outside"},
        {"{\"bodies\": [{\"model\": {\"name\": \"fem\", \"grid\": {" CELL "}}}]}",
         "bodies[0].model.grid: model \"fem\" has no springs"},
        {"{\"bodies\": [{\"model\": {\"name\": \"tet_springs\", \"k_area_J\": 1, \"grid\": {" CELL
         ", \"k_area_J\": [1, 1]}}}]}",
         "bodies[0].model.k_area_J: stands beside a grid that gives the same"},
        {"{\"bodies\": [{\"solver\": {\"name\": \"verlet\", \"grid\": {}}}]}",
         "bodies[0].solver.grid: is not a number, text"},
    };
    expect_refusals(sizeof bad / sizeof bad[0], bad);
}

static void absent_keys_take_the_defaults(void)
{
    const char *text = "{\"bodies\": [{\"mesh\": \"ball.palmesh\"}]}";
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    pal_scene want;
    pal_body_def body;
    pal_err err = pal_scene_parse("s.json", text, strlen(text), folder, &loaded, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    pal_scene_default(&want);
    pal_body_default(&body, "body 1", NULL);
    const pal_scene *got = &loaded->scene;
    CHECK_TEXT(got->name, want.name);
    CHECK_NEAR(got->step_s, want.step_s, 0);
    CHECK_NEAR(got->gravity_m_s2, want.gravity_m_s2, 0);
    CHECK_INT(got->n_tool, 3);
    CHECK_TEXT(got->tool[2].name, "probe 3");
    CHECK(got->tool[2].instrument == PAL_INSTRUMENT_BALL && !got->tool[2].has_trocar);
    CHECK_TEXT(got->body[0].name, "body 1");
    CHECK_NEAR(got->body[0].material.young_Pa, 5000, 0);
    CHECK_NEAR(got->body[0].material.damping_1_s, PAL_DAMPING_DERIVED, 0);
    CHECK_NEAR(got->body[0].material.damping_ratio, 1, 0);
    CHECK_INT(got->body[0].n_effect, body.n_effect);
    CHECK_TEXT(got->body[0].effect[1].path, "bodies[0].effects[1]");
    CHECK_INT(got->body[0].n_support, 1);
    CHECK_NEAR(got->body[0].support[0].fraction, 0.05, 0);
    CHECK_INT(got->body[0].mesh->tets.n_tet, mesh.tets.n_tet);
    pal_scene_free(loaded);
}

static void given_keys_arrive(void)
{
    const char *text =
        "{\"name\": \"two-1\", \"title\": \"Zwei K\xc3\xb6rper\", \"source\": \"here\", \"accuracy\": \"2 %\", "
        "\"step_s\": 0.002, \"up\": [0, "
        "1, "
        "0], \"gravity_m_s2\": 1.62, \"max_substep\": 77, \"tools\": [{\"name\": \"hook\", \"radius_m\": 0.003, "
        "\"force_cap_N\": 2, \"instrument\": \"hook\", \"trocar_m\": [0.1, 0.2, -0.3]}], \"bodies\": [{\"name\": \"a "
        "b\", \"mesh\": \"ball.palmesh\", \"material\": "
        "{\"young_Pa\": "
        "9000, \"poisson\": 0.3, \"density_kg_m3\": 1100, \"damping_1_s\": 0}, \"model\": {\"name\": \"tet_springs\", "
        "\"k_distance_J\": 0.5}, \"solver\": {\"name\": \"verlet\"}, \"output\": {\"name\": \"surface_output\"}, "
        "\"supports\": [{\"lowest\": 0.2}, {\"box\": {\"low_m\": [-1, -2, -3], \"high_m\": [1, 2, 3]}}], \"effects\": "
        "[{\"name\": \"x\", \"yes\": true, \"word\": \"w\", \"list\": [1, 2.5], \"number\": -3}]}]}";
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    pal_err err = pal_scene_parse("s.json", text, strlen(text), folder, &loaded, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    const pal_scene *s = &loaded->scene;
    const pal_body_def *b = &s->body[0];
    CHECK_TEXT(s->name, "two-1");
    CHECK_TEXT(s->title, "Zwei K\xc3\xb6rper");
    CHECK_TEXT(s->accuracy, "2 %");
    CHECK_NEAR(s->step_s, 0.002, 0);
    CHECK_NEAR(s->up[1], 1, 0);
    CHECK_NEAR(s->gravity_m_s2, 1.62, 0);
    CHECK_INT(s->max_substep, 77);
    CHECK_INT(s->n_tool, 1);
    CHECK_TEXT(s->tool[0].name, "hook");
    CHECK_NEAR(s->tool[0].radius_m, 0.003, 0);
    CHECK_NEAR(s->tool[0].force_cap_N, 2, 0);
    CHECK_INT(s->tool[0].instrument, PAL_INSTRUMENT_HOOK);
    CHECK(s->tool[0].has_trocar && s->tool[0].trocar_m[2] == -0.3);
    CHECK_TEXT(b->name, "a b");
    CHECK_NEAR(b->material.damping_1_s, 0, 0);
    CHECK_TEXT(b->solver.name, "verlet");
    CHECK_TEXT(b->output.name, "surface_output");
    CHECK_INT(b->n_support, 2);
    CHECK(b->support[0].lowest && !b->support[1].lowest);
    CHECK_NEAR(b->support[1].low_m[2], -3, 0);
    REQUIRE(b->n_effect == 1 && b->effect[0].n_value == 4);
    CHECK(b->effect[0].value[0].flag);
    CHECK_TEXT(b->effect[0].value[1].text, "w");
    CHECK_INT(b->effect[0].value[2].n_number, 2);
    CHECK_NEAR(b->effect[0].value[3].number[0], -3, 0);
    pal_config_entry model = b->model;
    double k = 0;
    CHECK_INT(pal_entry_read_number(&model, "k_distance_J", 0, 1, &k, &diag), 0);
    CHECK_NEAR(k, 0.5, 0);
    pal_scene_free(loaded);
}

static void a_saved_scene_loads_to_the_same_world_step_by_step(void)
{
    pal_loaded_scene *in = calloc(1, sizeof *in), *out = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(in != NULL);
    in->scene = plain;
    in->scene.body[0].material = (pal_material){6543.21, 0.41, 1030, 3, 0};
    in->scene.tool[0].radius_m = 0.1 / 3;
    in->scene.tool[0].instrument = PAL_INSTRUMENT_SCISSORS;
    in->scene.tool[0].has_trocar = true, in->scene.tool[0].trocar_m[1] = 0.1 / 7;
    snprintf(in->scene.body[0].appearance, PAL_APPEARANCE_BYTES, "liver");
    snprintf(in->scene.body[0].colour, PAL_COLOUR_BYTES, "#82352b");
    pal_entry_put_number(&in->scene.body[0].model, "k_distance_J", 0.1 / 7, NULL);
    in->scene.body[0].n_support = 2;
    in->scene.body[0].support[1] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {-0.04, 1, 1}};
    char where[600];
    snprintf(where, sizeof where, "%s/a/b/saved", folder);
    CHECK_INT(pal_scene_save(in, where, &diag), 0);
    snprintf(where, sizeof where, "%s/a/b/saved/scene.json", folder);
    pal_err err = pal_scene_load(where, &out, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    uint64_t before = hash_after(&in->scene, CHECK_REPEATS(100, 20));
    CHECK(before != 0);
    CHECK(hash_after(&out->scene, CHECK_REPEATS(100, 20)) == before);
    CHECK_TEXT(out->scene.title, in->scene.title);
    CHECK_INT(out->scene.tool[0].instrument, PAL_INSTRUMENT_SCISSORS);
    CHECK(out->scene.tool[0].has_trocar && !out->scene.tool[1].has_trocar);
    CHECK_NEAR(out->scene.tool[0].trocar_m[1], 0.1 / 7, 0);
    CHECK_TEXT(out->scene.body[0].appearance, "liver");
    CHECK_TEXT(out->scene.body[0].colour, "#82352b");
    CHECK_NEAR(out->scene.body[0].material.damping_1_s, 3, 0);
    /* a damping that is derived stays one */
    pal_scene_free(out);
    in->scene.body[0].material.damping_1_s = PAL_DAMPING_DERIVED, in->scene.body[0].material.damping_ratio = 1.0 / 3;
    snprintf(where, sizeof where, "%s/a/b/derived", folder);
    CHECK_INT(pal_scene_save(in, where, &diag), 0);
    snprintf(where, sizeof where, "%s/a/b/derived/scene.json", folder);
    REQUIRE(!pal_scene_load(where, &out, &diag));
    CHECK_NEAR(out->scene.body[0].material.damping_1_s, PAL_DAMPING_DERIVED, 0);
    CHECK_NEAR(out->scene.body[0].material.damping_ratio, 1.0 / 3, 0);
    pal_scene_free(out);
    snprintf(where, sizeof where, "%s/a/b/saved/scene.json", folder);
    REQUIRE(!pal_scene_load(where, &out, &diag));
    /* and the hash does depend on what was saved */
    out->scene.body[0].material.young_Pa *= 1.0001;
    CHECK(hash_after(&out->scene, CHECK_REPEATS(100, 20)) != before);
    pal_scene_free(out);
    free(in);
}

/* numbers without a short decimal: thirds, neighbours of 0.1, the largest and least allowed */
static void constants_of_springs_come_back_bit_for_bit(void)
{
    enum { N = 3 * 2 * 2 };
    pal_loaded_scene *in = calloc(1, sizeof *in), *out = NULL;
    pal_diagnostic diag = {""};
    double k_J[2][N];
    REQUIRE(in != NULL);
    in->scene = plain;
    pal_body_def *def = &in->scene.body[0];
    uint64_t seed = 1;
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < N; i++) {
            k_J[k][i] = 1e-4 * pow(2, random_unit(&seed) * 8);
        }
    k_J[1][0] = 1e-60, k_J[1][1] = 1e60, k_J[1][2] = nextafter(0.1, 1), k_J[1][3] = nextafter(0.1, 0),
    k_J[1][4] = 1.0 / 3, k_J[1][5] = nextafter(1, 2), k_J[1][6] = 3;
    def->spring_grid = (pal_spring_grid){
        {3, 2, 2}, {-0.05, -0.1 / 3, nextafter(-0.05, 0)}, {0.05, 0.1 / 3, 0.05}, {k_J[0], NULL, k_J[1]}};
    pal_entry_put_text(&def->model, "weights", "volume", NULL);
    pal_entry_put_number(&def->model, "k_area_J", nextafter(0.002, 1), NULL);
    snprintf(in->scene.accuracy, sizeof in->scene.accuracy, "2.1 %% RMS \xc2\xb1 \"0.3\"");
    in->scene.max_error_m = 0.1 / 1000, in->scene.budget_ms = 1.0 / 3;
    char where[600];
    snprintf(where, sizeof where, "%s/springs", folder);
    CHECK_INT(pal_scene_save(in, where, &diag), 0);
    snprintf(where, sizeof where, "%s/springs/scene.json", folder);
    pal_err err = pal_scene_load(where, &out, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    const pal_spring_grid *a = &def->spring_grid, *b = &out->scene.body[0].spring_grid;
    CHECK_TEXT(out->scene.accuracy, in->scene.accuracy);
    CHECK_NEAR(out->scene.max_error_m, 0.1 / 1000, 0);
    CHECK_NEAR(out->scene.budget_ms, 1.0 / 3, 0);
    CHECK(memcmp(a->n, b->n, sizeof a->n) == 0);
    CHECK(memcmp(a->low_m, b->low_m, sizeof a->low_m) == 0 && memcmp(a->high_m, b->high_m, sizeof a->high_m) == 0);
    REQUIRE(b->k_J[0] && !b->k_J[1] && b->k_J[2]);
    CHECK(memcmp(b->k_J[0], k_J[0], sizeof k_J[0]) == 0 && memcmp(b->k_J[2], k_J[1], sizeof k_J[1]) == 0);
    double area_J = 0;
    CHECK_INT(pal_entry_read_number(&out->scene.body[0].model, "k_area_J", 0, 1, &area_J, &diag), 0);
    CHECK_NEAR(area_J, nextafter(0.002, 1), 0);
    /* and both make the same body */
    k_J[1][0] = k_J[1][1] = 1e-3;
    double *k_volume_J = out->spring_grid[0] + 2 * N;
    k_volume_J[0] = k_volume_J[1] = 1e-3;
    for (int i = 0; i < N; i++) k_J[1][i] = k_volume_J[i] = fmin(k_J[1][i], 2e-3);
    uint64_t before = hash_after(&in->scene, 20);
    CHECK(before != 0);
    CHECK(hash_after(&out->scene, 20) == before);
    k_volume_J[3] *= 1.01;
    CHECK(hash_after(&out->scene, 20) != before);
    pal_scene_free(out);

    /* what could not be read again is not written */
    def->spring_grid.n[0] = 1 << 15;
    CHECK_INT(pal_scene_save(in, where, &diag), PAL_ERR_IO); /* a file stands where the folder would */
    snprintf(where, sizeof where, "%s/too_many", folder);
    CHECK_INT(pal_scene_save(in, where, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "model.grid.n: 131072 nodes, more than 65536") != NULL);
    double *many = malloc(sizeof *many << 16);
    REQUIRE(many != NULL);
    for (int i = 0; i < 1 << 16; i++) many[i] = 1.0 / 3;
    def->spring_grid.n[0] = 1 << 14;
    def->spring_grid.k_J[0] = def->spring_grid.k_J[2] = many;
    CHECK_INT(pal_scene_save(in, where, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "scene.json: would have 2") != NULL);
    struct stat facts;
    snprintf(where, sizeof where, "%s/too_many/ball.palmesh", folder);
    CHECK(stat(where, &facts) != 0);
    free(many);
    free(in);
}

static void two_bodies_of_like_names_get_two_files(void)
{
    pal_loaded_scene *in = calloc(1, sizeof *in), *out = NULL;
    pal_diagnostic diag = {""};
    REQUIRE(in != NULL);
    in->scene = plain;
    in->scene.n_body = 2;
    in->scene.body[1] = in->scene.body[0];
    snprintf(in->scene.body[0].name, PAL_NAME, "Left/../ lobe");
    snprintf(in->scene.body[1].name, PAL_NAME, "left.. lobe");
    char where[600];
    snprintf(where, sizeof where, "%s/two", folder);
    CHECK_INT(pal_scene_save(in, where, &diag), 0);
    snprintf(where, sizeof where, "%s/two/scene.json", folder);
    pal_err err = pal_scene_load(where, &out, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK_INT(out->scene.n_body, 2);
    CHECK_TEXT(out->scene.body[0].name, "Left/../ lobe");
    CHECK_TEXT(out->scene.body[1].name, "left.. lobe");
    pal_scene_free(out);
    free(in);
}

static void a_save_that_fails_leaves_nothing(void)
{
    pal_loaded_scene *in = calloc(1, sizeof *in);
    pal_diagnostic diag = {""};
    struct stat facts;
    REQUIRE(in != NULL);
    in->scene = plain;
    CHECK_INT(pal_scene_save(in, "/proc/no/such", &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/proc/no") != NULL);
    /* scene.json cannot be written because a folder has its name */
    char where[600], there[700];
    snprintf(where, sizeof where, "%s/blocked", folder);
    snprintf(there, sizeof there, "%s/scene.json", where);
    REQUIRE(mkdir(where, 0777) == 0 && mkdir(there, 0777) == 0);
    CHECK_INT(pal_scene_save(in, where, &diag), PAL_ERR_IO);
    snprintf(there, sizeof there, "%s/ball.palmesh", where);
    CHECK(stat(there, &facts) != 0);
    free(in);
}

int main(void)
{
    char command[128];
    pal_diagnostic diag = {""};
    if (!mkdtemp(folder) || !small_scene(&plain, &mesh, CHECK_REPEATS(8, 5))) return 1;
    if (pal_prepared_save(&mesh, in_folder("ball.palmesh"), &diag)) return 1;
    RUN(what_is_not_json_is_refused_with_its_line);
    RUN(big_files_are_refused_before_they_are_parsed);
    RUN(every_bad_scene_has_its_sentence);
    RUN(every_bad_body_has_its_sentence);
    RUN(every_bad_grid_of_springs_has_its_sentence);
    RUN(absent_keys_take_the_defaults);
    RUN(given_keys_arrive);
    RUN(a_saved_scene_loads_to_the_same_world_step_by_step);
    RUN(constants_of_springs_come_back_bit_for_bit);
    RUN(two_bodies_of_like_names_get_two_files);
    RUN(a_save_that_fails_leaves_nothing);
    pal_prepared_free(&mesh);
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return check_report() || system(command) != 0;
}
