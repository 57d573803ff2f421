/* Studies kept in files: every number comes back with its bits, what is not one is refused by its place, and what a
 * study is of changes with the body and not with its configuration. */
#include "server/mesh/volume/prepared.h"
#include "server/study/studied_scene.h"
#include "server/study/study_store.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#include <stdint.h>

static char folder[] = "/tmp/palpate_store_XXXXXX";
static char path[64];
static uint64_t seed = 1;

static double random01(void)
{
    return random_unit(&seed);
}

/* over many powers of ten, with all bits of a double in use */
static double random_size(void)
{
    return (0.1 + random01()) * pow(10, 30 * random01() - 20);
}

static pal_study_file *random_file(int n)
{
    static const char *const model[] = {"fem", "tet_springs", "adaptive_springs"};
    pal_study_file *f = calloc(1, sizeof *f);
    if (!f) return NULL;
    pal_study *s = &f->study;
    snprintf(s->name, sizeof s->name, "liver");
    snprintf(s->machine, sizeof s->machine, "Some processor \"x\", 2 cores");
    snprintf(s->reference, sizeof s->reference, "fem hex8_bbar, 48 voxels \xc2\xb1");
    s->reference_m = random_size(), s->max_m = random_size(), s->length_scale_m = NAN, s->step_s = 1.0 / 60;
    snprintf(f->body, sizeof f->body, "the liver");
    snprintf(f->shape, sizeof f->shape, "0123456789abcdef");
    snprintf(f->loads, sizeof f->loads, "three presses, 0.5 s");
    snprintf(f->digest, sizeof f->digest, "fedcba9876543210");
    snprintf(f->methods, sizeof f->methods, "fem,tet_springs");
    snprintf(f->command, sizeof f->command, "palpate study 'a b' --quick");
    f->index = 3, f->n_total = 200, f->whole = false;
    s->n_point = n;
    for (int k = 0; k < n; k++) {
        pal_study_point *p = &s->point[k];
        snprintf(p->measured.configuration.model, PAL_NAME, "%s", model[k % 3]);
        if (k % 3 == 0) snprintf(p->measured.configuration.element, PAL_NAME, "hex8_bbar");
        if (k % 2) snprintf(p->measured.configuration.solver, PAL_NAME, "sdirk2");
        p->measured.configuration.size = k;
        p->measured.configuration.step_s = k % 4 ? 0.1 * random01() : 0;
        p->measured.configuration.tolerance = random01();
        p->measured.configuration.k_distance_J = random_size(), p->measured.configuration.k_area_J = random_size();
        p->measured.configuration.k_volume_J = random_size();
        bool measured = k % 7 != 0;
        p->measured.ms = measured ? 1e3 * random01() : NAN;
        p->measured.error_m = measured ? random_size() : NAN;
        p->measured.front = measured && k % 5 == 0;
        p->err = measured ? PAL_ERR_OK : PAL_ERR_BUDGET;
        if (!measured) snprintf(p->reason, sizeof p->reason, "needs 8,000 sub-steps, \"2,000\" are allowed");
        p->n_node = 100 * k, p->n_substep = k % 30;
        p->ms_p95 = random_size() * 1e-12, p->static_rms_m = random_size(), p->static_max_m = random_size();
        p->trajectory_rms_m = random_size(), p->trajectory_max_m = k % 11 ? random_size() : NAN,
        p->prepare_s = random01();
        p->predicted_ms = NAN, p->predicted_m = random_size();
    }
    return f;
}

static char *slurp(size_t *n)
{
    FILE *in = fopen(path, "rb");
    char *text = calloc(1, 1 << 21);
    *n = in && text ? fread(text, 1, (1 << 21) - 1, in) : 0;
    if (in) fclose(in);
    return text;
}

static void every_number_comes_back_with_its_bits(void)
{
    pal_diagnostic diag = {""};
    pal_study_file *in = random_file(PAL_STUDY_POINTS), *out = NULL;
    REQUIRE(in);
    pal_err err = pal_study_file_write(in, path, &diag);
    if (!err) err = pal_study_file_read(path, &out, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    REQUIRE(!err);
    CHECK_INT(out->study.n_point, PAL_STUDY_POINTS);
    /* both come from calloc, so that what lies between the fields is zero in both */
    CHECK(memcmp(&in->study, &out->study, offsetof(pal_study, point)) == 0);
    for (int k = 0; k < in->study.n_point; k++)
        CHECK(memcmp(&in->study.point[k], &out->study.point[k], sizeof in->study.point[k]) == 0);
    CHECK(memcmp(in->body, out->body, sizeof *in - offsetof(pal_study_file, body)) == 0);
    /* and a second time the same bytes */
    size_t n[2] = {0};
    char *first = slurp(&n[0]);
    CHECK_INT(pal_study_file_write(out, path, &diag), 0);
    char *second = slurp(&n[1]);
    REQUIRE(first && second);
    CHECK_INT(n[0], n[1]);
    CHECK(n[0] > 100000 && n[0] < 1 << 20 && memcmp(first, second, n[0]) == 0);
    free(first);
    free(second);
    free(in);
    free(out);
}

/* the text of a study of two points with one piece of it replaced */
static char *with(const char *old, const char *new)
{
    size_t n;
    pal_diagnostic diag = {""};
    pal_study_file *f = random_file(2);
    if (!f || pal_study_file_write(f, path, &diag)) return NULL;
    free(f);
    char *text = slurp(&n), *at = text ? strstr(text, old) : NULL;
    char *out = at ? malloc(n + strlen(new) + 1) : NULL;
    if (out) sprintf(out, "%.*s%s%s", (int)(at - text), text, new, at + strlen(old));
    if (!at) CHECK_FAIL("\"%s\" is not there", old);
    free(text);
    return out;
}

static void what_is_no_study_is_refused_by_its_place(void)
{
    static const struct {
        const char *old, *new, *sentence;
    } bad[] = {
        {"palpate-study-1", "palpate-study-2", "s.json: format: is \"palpate-study-2\", wanted \"palpate-study-1\""},
        {"\"format\"", "\"formed\"", "s.json: formed: unknown key; known are format"},
        {"\"n_total\":\t200,", "", "s.json: n_total: is not there"},
        {"\"n_total\":\t200", "\"n_total\": 257", "n_total: 257 is outside 0 .. 256"},
        {"\"n_total\":\t200", "\"n_total\": 1.5", "n_total: 1.5 is not whole"},
        {"\"complete\":\tfalse", "\"complete\": 0", "complete: is not true or false"},
        {"\"index\":\t3", "\"index\": 8", "subject.index: 8 is outside 0 .. 7"},
        {"0123456789abcdef", "0123456789abcdef0", "subject.shape: 17 bytes of text, more than 16"},
        {"\"model\":\t\"fem\"", "\"model\": \"\"", "points[0].model: is empty"},
        {"\"model\":\t\"tet_springs\"", "\"model\": 4", "points[1].model: is not a text"},
        {"\"size\":\t1", "\"size\": -2", "points[1].size: -2 is outside"},
        {"\"step_s\":\t0,", "\"step_s\": 1,", "points[0].step_s: 1 is outside 0 .. 0.1"},
        {"\"step_s\":\t0,", "\"step_s\": null,", "points[0].step_s: is not a number"},
        {"\"ms\":\tnull", "\"ms\": -2", "points[0].ms: -2 is outside"},
        {"\"ms\":\tnull", "\"ms\": 1e999", "points[0].ms: inf is outside"},
        {"\"front\":\tfalse", "\"front\": true", "points[0].front: is true of a configuration that was not measured"},
        {"\"err\":\t\"BUDGET\"", "\"err\": \"FINE\"", "points[0].err: \"FINE\" is no error code"},
        {"\"nodes\":\t100,", "", "points[1].nodes: is not there"},
        {"\"reason\":\t\"\",", "\"reason\": \"\", \"x\": 1,", "points[1].x: unknown key"},
        {"\"points\":\t[", "\"points\": [4, ", "points[0]: is not an object"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        pal_diagnostic diag = {""};
        pal_study_file *out = NULL;
        char *text = with(bad[k].old, bad[k].new);
        REQUIRE(text);
        CHECK_INT(pal_study_file_parse("s.json", text, strlen(text), &out, &diag), PAL_ERR_REFUSED);
        if (!strstr(diag.text, bad[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, bad[k].sentence);
        CHECK(out == NULL);
        free(text);
    }
    /* cut anywhere it is no study */
    char *text = with("liver", "liver");
    REQUIRE(text);
    size_t n = strlen(text);
    for (size_t k = 0; k + 1 < n; k += 97) {
        pal_study_file *out = NULL;
        CHECK(pal_study_file_parse("s.json", text, k, &out, NULL) == PAL_ERR_REFUSED);
    }
    free(text);
}

static void points_are_listed_by_what_they_cost(void)
{
    pal_study_file *f = random_file(100);
    static pal_measured_configuration list[PAL_STUDY_POINTS];
    int order[PAL_STUDY_POINTS], seen[100] = {0}, measured = 0;
    pal_diagnostic diag = {""};
    REQUIRE(f);
    pal_study_order(&f->study, order);
    for (int k = 0; k < 100; k++) seen[order[k]]++;
    for (int k = 0; k < 100; k++) CHECK_INT(seen[k], 1);
    for (int k = 0; k < 100; k++) measured += !f->study.point[k].err;
    for (int k = 0; k < 100; k++) CHECK_INT(isnan(f->study.point[order[k]].measured.ms), k >= measured);
    CHECK_INT(pal_study_configurations(&f->study, list), measured);
    for (int k = 0; k < measured; k++) {
        CHECK(k == 0 || list[k].ms >= list[k - 1].ms);
        CHECK(list[k].configuration.step_s > 0);
        CHECK_NEAR(list[k].error_m, f->study.point[order[k]].measured.error_m, 0);
    }
    /* the table has a row each, in that order */
    CHECK_INT(pal_study_file_csv(f, path, &diag), 0);
    size_t n;
    char *text = slurp(&n), *save = NULL;
    REQUIRE(text);
    int row = -1;
    for (char *line = strtok_r(text, "\n", &save); line; line = strtok_r(NULL, "\n", &save), row++) {
        if (row < 0) CHECK(!strncmp(line, "model,element,law,solver,reason,err,size,nodes,substeps,front,step_s,", 69));
        if (row < 0) continue;
        char want[80];
        const pal_study_point *p = &f->study.point[order[row]];
        snprintf(want, sizeof want, ",%s,%d,%d,%d,%d,", pal_err_name(p->err), p->measured.configuration.size, p->n_node,
                 p->n_substep, p->measured.front);
        CHECK(strstr(line, want) != NULL);
    }
    CHECK_INT(row, 100);
    free(text);
    free(f);
}

static void a_study_is_of_a_body_whatever_its_configuration(void)
{
    double x[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    int32_t tri[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    pal_prepared mesh = {.surface = {.n_vertex = 4, .n_tri = 4, .x = x, .tri = tri}};
    static pal_body_def body;
    char first[PAL_STUDY_SHAPE], other[PAL_STUDY_SHAPE];
    pal_body_default(&body, "it", &mesh);
    CHECK_INT(strlen(pal_study_shape(&body, first)), 16);
    pal_entry_init(&body.model, "model", "fem");
    pal_entry_init(&body.solver, "solver", "sdirk2");
    mesh.tets.n_tet = 7;
    CHECK_TEXT(pal_study_shape(&body, other), first);
    body.material.poisson = nextafter(body.material.poisson, 1);
    CHECK(strcmp(pal_study_shape(&body, other), first) != 0);
    body.material.poisson = nextafter(body.material.poisson, 0);
    CHECK_TEXT(pal_study_shape(&body, other), first);
    body.support[0].fraction = 0.06;
    CHECK(strcmp(pal_study_shape(&body, other), first) != 0);
    body.support[0].fraction = 0.05;
    x[10] = 1e-9;
    CHECK(strcmp(pal_study_shape(&body, other), first) != 0);
    x[10] = 0;
    body.n_region = 1;
    body.region[0] = (pal_region){.kind = PAL_REGION_BOX, .young_Pa = 4, .poisson = NAN, .density_kg_m3 = NAN};
    pal_study_shape(&body, other);
    body.region[0].high_m[1] = 1;
    char third[PAL_STUDY_SHAPE];
    CHECK(strcmp(pal_study_shape(&body, third), other) != 0 && strcmp(other, first) != 0);
}

static void files_have_their_place_beside_the_scene(void)
{
    static const struct {
        const char *word, *folder, *stem;
    } good[] = {
        {"/nowhere/scene.json", NULL, "/nowhere/study"},
        {"scene.json", NULL, "study"},
        {"a.b/liver.json", NULL, "a.b/liver_study"},
        {"liver.nii.gz", NULL, "liver_study"},
        {"/tmp", NULL, "/tmp/study"},
        {"x/liver.json", "out", "out/study"},
        {".hidden", NULL, ".hidden_study"},
    };
    char stem[PAL_STUDY_PATH], far[PAL_STUDY_PATH + 10];
    pal_diagnostic diag = {""};
    for (size_t k = 0; k < sizeof good / sizeof *good; k++) {
        CHECK_INT(pal_study_stem(good[k].word, good[k].folder, stem, &diag), 0);
        CHECK_TEXT(stem, good[k].stem);
    }
    memset(far, 'a', sizeof far - 1);
    far[sizeof far - 1] = 0;
    CHECK_INT(pal_study_stem(far, NULL, stem, &diag), PAL_ERR_REFUSED);
    CHECK(pal_study_method_in("", "fem") && pal_study_method_in("tet_springs,fem", "fem"));
    CHECK(!pal_study_method_in("tet_springs,femur", "fem") && pal_study_method_in("fem", "fem"));
    CHECK(!pal_study_method_in("tet_springs", "tet"));
}

/* the head of the page has room for 127 bytes: whole parts of a description, never half a word */
static void a_written_scene_says_how_far_off_it_is_in_whole_words(void)
{
    static pal_study study = {.max_m = 0.0078};
    char text[128];
    snprintf(study.reference, sizeof study.reference,
             "fem hex8_bbar corotational, 40 voxels, static_newton, tolerance 1e-06, 15111 nodes, 2 tries");
    pal_study_accuracy_text(&study, 0.00038, text, sizeof text);
    CHECK_TEXT(text, "within 0.38 mm, 4.9 % of the largest displacement, of fem hex8_bbar corotational, 40 voxels, "
                     "static_newton, tolerance 1e-06");
    pal_study_accuracy_text(&study, 0.00038, text, 90);
    CHECK_TEXT(text, "within 0.38 mm, 4.9 % of the largest displacement, of fem hex8_bbar corotational");
    pal_study_accuracy_text(&study, 0.00038, text, 70);
    CHECK_TEXT(text, "within 0.38 mm, 4.9 % of the largest displacement");
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    snprintf(path, sizeof path, "%s/study.json", folder);
    RUN(every_number_comes_back_with_its_bits);
    RUN(what_is_no_study_is_refused_by_its_place);
    RUN(points_are_listed_by_what_they_cost);
    RUN(a_study_is_of_a_body_whatever_its_configuration);
    RUN(files_have_their_place_beside_the_scene);
    RUN(a_written_scene_says_how_far_off_it_is_in_whole_words);
    unlink(path);
    rmdir(folder);
    return check_report();
}
