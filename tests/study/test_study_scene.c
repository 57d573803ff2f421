/* Studies of scenes, which have no load cases: presses and a pull on a full organ, a hollow one and control cells;
 * samples that are given; refusals. */
#include "server/study/study.h"

#include "server/base/vec3.h"
#include "server/mesh/geometry/procedural.h"
#include "server/robustness/robustness.h"
#include "server/study/study_job.h"
#include "tests/check.h"
#include "tests/fixtures/subdivision_scene.h"

/* an ellipsoid of 20 x 14 x 9 cm, full, held below; or its surface alone */
typedef struct organ {
    pal_surface surface;
    pal_prepared mesh;
    pal_scene *scene;
    pal_study *study;
    pal_diagnostic diag;
} organ;

static void organ_make(organ *o, bool full)
{
    const double length_scale_m[3] = {0.2, 0.14, 0.09};
    double low[3], high[3];
    memset(o, 0, sizeof *o);
    o->scene = calloc(1, sizeof *o->scene);
    o->study = calloc(1, sizeof *o->study);
    if (!o->scene || !o->study || pal_sphere_make(0.1, &o->surface)) abort();
    pal_surface_box(&o->surface, low, high);
    for (int i = 0; i < 3 * o->surface.n_vertex; i++)
        o->surface.x[i] = (o->surface.x[i] - low[i % 3]) / (high[i % 3] - low[i % 3]) * length_scale_m[i % 3];
    pal_voxel_options voxel = {.resolution = 10, .border = true, .min_fill = 0.25, .fill = true};
    pal_err err = full ? pal_prepared_make(&o->surface, &voxel, &o->mesh, NULL, &o->diag)
                       : pal_prepared_surface(&o->surface, &o->mesh);
    if (err) printf("  %s\n", o->diag.text), abort();
    pal_scene_default(o->scene);
    o->scene->n_body = 1;
    pal_body_def *def = &o->scene->body[0];
    pal_body_default(def, "organ", &o->mesh);
    def->n_effect = 0;
    def->support[0].fraction = 0.4;
    if (!full) pal_entry_init(&def->model, "model", "adaptive_springs");
}

static void organ_free(organ *o)
{
    pal_prepared_free(&o->mesh);
    pal_surface_free(&o->surface);
    free(o->scene);
    free(o->study);
}

static void show(const pal_study *s)
{
    char name[PAL_CONFIGURATION_TEXT];
    printf("  %s: most %.3g mm, own error %.3g mm\n", s->reference, 1e3 * s->max_m, 1e3 * s->reference_m);
    for (int i = 0; i < s->n_point; i++)
        printf("  %c %s: %d nodes, %.3f ms, rest %.3g mm, way %.3g mm %s\n", s->point[i].measured.front ? '*' : ' ',
               pal_configuration_text(&s->point[i].measured.configuration, name), s->point[i].n_node,
               s->point[i].measured.ms, 1e3 * s->point[i].static_max_m, 1e3 * s->point[i].trajectory_max_m,
               s->point[i].reason);
}

/* what is named has to come back from being mistreated: fitted springs keep some of their volume stiffness, as without
 * it being laid flat leaves them elsewhere for good */
static void check_survives(const organ *o, const pal_configuration *configuration)
{
    static const char *const name[] = {"flat"};
    pal_configured_scene *set = NULL;
    pal_diagnostic diag = {{0}};
    pal_robustness_report *r = calloc(1, sizeof *r);
    REQUIRE(r && !pal_configuration_make(o->scene, 0, configuration, &diag, &set));
    for (int k = 0; k < 1; k++) {
        pal_robustness_options options;
        pal_robustness_default(&options);
        options.only = name[k], options.max_cpu_s = 2;
        CHECK(!pal_robustness_run(&set->scene, &options, r, &diag));
        CHECK_INT(r->count[PAL_VERDICT_FAILED], 0);
        if (r->count[PAL_VERDICT_FAILED]) printf("  %s: %s\n", name[k], r->result[0].diag);
    }
    pal_configured_scene_free(set);
    free(r);
}

/* presses move the body by what they say, about; finer elements are nearer */
static void a_full_organ_is_pressed(void)
{
    static const char *const method[] = {"fem", "tet_springs"};
    organ o;
    organ_make(&o, true);
    pal_study_options options = {.quick = 1, .seconds = 0.1, .method = method, .n_method = CHECK_REPEATS(2, 1)};
    pal_err err = pal_study_scene(o.scene, &options, o.study, &o.diag);
    if (err) CHECK_FAIL("%s", o.diag.text);
    const pal_study *s = o.study;
    show(s);
    /* the pull goes about as far as a hand does */
    CHECK(s->max_m > 0.05 * s->length_scale_m && s->max_m < 0.15 * s->length_scale_m);
    CHECK(s->reference_m > 0 && s->reference_m < 0.15 * s->max_m);
    double coarse = NAN, fine = NAN, fitted = NAN, plain = NAN;
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *p = &s->point[i];
        const pal_configuration *q = &p->measured.configuration;
        CHECK(!p->err && p->measured.ms > 0 && p->measured.error_m > 0 && p->measured.error_m < 0.6 * s->max_m);
        if (!strcmp(q->element, "hex8_bbar")) coarse = isnan(coarse) ? p->static_rms_m : coarse, fine = p->static_rms_m;
        if (!strcmp(q->model, "tet_springs") && q->k_distance_J > 0) fitted = p->static_rms_m;
        if (!strcmp(q->model, "tet_springs") && !(q->k_distance_J > 0)) plain = p->static_rms_m;
    }
    CHECK(fine < coarse && (CHECK_REPEATS(false, true) || fitted < plain));
    int n_sprung = 0;
    CHECK(pal_study_pick(s, "", NAN, 1e9) >= 0);
    for (int i = 0; i < s->n_point; i++) {
        const pal_configuration *q = &s->point[i].measured.configuration;
        if (!(q->k_distance_J > 0)) continue;
        n_sprung++;
        CHECK(q->k_volume_J > 0.3 * q->k_distance_J);
        check_survives(&o, q);
    }
    CHECK_INT(n_sprung, CHECK_REPEATS(1, 0));
    organ_free(&o);
}

/* rests of the reference itself, the one with most nodes, in the order in which they were found */
enum { MAX_RESTS = 16, MAX_VALUES = 3000 };
typedef struct rests {
    int n, n_node, n_value;
    double u[MAX_RESTS][MAX_VALUES];
} rests;

static void take_rest(uint64_t key, const pal_study_answer *answer, const double *value, int n, void *user)
{
    rests *r = user;
    (void)key;
    if (answer->err || answer->n_node < r->n_node || n > MAX_VALUES) return;
    if (answer->n_node > r->n_node) r->n = 0;
    if (r->n == MAX_RESTS) return;
    r->n_node = answer->n_node, r->n_value = n;
    memcpy(r->u[r->n++], value, sizeof *value * (size_t)n);
}

static int max_moved(const double *u, int n_value)
{
    int max = 0;
    for (int i = 0; i < n_value / 3; i++)
        if (pal_norm3(u + 3 * i) > pal_norm3(u + 3 * max)) max = i;
    return max;
}

/* three times in by about 2 % of its diagonal, then out by no more than 7.5 %, at the place of the first press */
static void check_loads(const rests *r, double length_scale_m)
{
    CHECK(r->n >= 4);
    if (r->n < 4) return;
    const double *first = r->u[0], *pull = r->u[r->n - 1];
    for (int k = 0; k < r->n; k++) {
        double moved = pal_norm3(r->u[k] + 3 * max_moved(r->u[k], r->n_value));
        printf("  load %d moves it by %.2f %% of its diagonal\n", k, 100 * moved / length_scale_m);
        if (k == r->n - 1) CHECK(moved > 0.03 * length_scale_m && moved < 0.075 * length_scale_m);
    }
    const int at = 3 * max_moved(pull, r->n_value);
    CHECK(pal_dot3(pull + at, first + at) < 0);
}

static void a_hollow_organ_is_pressed_and_pulled(void)
{
    organ o;
    organ_make(&o, false);
    rests *found = calloc(1, sizeof *found);
    REQUIRE(found);
    pal_study_options options = {.quick = 1, .seconds = 0.1, .remember = take_rest, .user = found};
    pal_err err = pal_study_scene(o.scene, &options, o.study, &o.diag);
    if (err) CHECK_FAIL("%s", o.diag.text);
    show(o.study);
    CHECK_INT(o.study->n_point, 3);
    for (int i = 0; i < o.study->n_point; i++) {
        const pal_study_point *p = &o.study->point[i];
        CHECK(!p->err && !strcmp(p->measured.configuration.model, "adaptive_springs") && p->measured.ms > 0);
    }
    /* the finest that is swept, wholly refined, is nearer than the coarse surface */
    CHECK(o.study->point[2].static_max_m < o.study->point[0].static_max_m);
    check_loads(found, o.study->length_scale_m);
    free(found);
    organ_free(&o);
}

static void cells_are_pressed(void)
{
    static const char *const method[] = {"subdivision_fem"};
    const int32_t n[3] = {3, 2, 2};
    const double length_scale_m[3] = {0.15, 0.1, 0.1};
    solid_scene s;
    pal_study *study = calloc(1, sizeof *study);
    REQUIRE(study);
    solid_scene_take(&s, solid_scene_box(n, length_scale_m, true), 1, "central_cg", "polar");
    solid_scene_hold(&s, 0, 1e-9);
    pal_study_options options = {.quick = 1, .seconds = 0.1, .method = method, .n_method = 1};
    pal_err err = pal_study_scene(s.scene, &options, study, &s.diag);
    if (err) CHECK_FAIL("%s", s.diag.text);
    show(study);
    CHECK_INT(study->n_point, 4);
    for (int i = 0; i < study->n_point; i++)
        CHECK(!study->point[i].err && study->point[i].static_max_m < 0.7 * study->max_m);
    solid_scene_close(&s);
    free(study);
}

/* of every method and size that is swept one configuration has the scene's own step, and all others are named of it */
static void the_step_of_the_scene_is_the_one_that_is_swept(void)
{
    static const double own_s[] = {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 250, 1.0 / 1000};
    pal_study_entry *target = calloc(PAL_STUDY_POINTS, sizeof *target);
    REQUIRE(target);
    for (int full = 0; full < 2; full++) {
        organ o;
        organ_make(&o, full);
        for (int k = 0; k < 10; k++) {
            double own = own_s[k % 5];
            pal_study_options options = {.quick = k < 5};
            pal_study_job job = {.scene = o.scene, .options = &options, .law = "corotational", .adaptive = !full};
            job.reference = full ? 64 : 4, job.slender = 1;
            o.scene->step_s = own;
            int n = pal_study_list(&job, target), n_own = 0, n_other = 0;
            for (int i = 0; i < n; i++) {
                const double times = target[i].configuration.step_s / own;
                bool known = times == 1 || times == 0.25 || times == 0.5 || times == 2;
                n_own += times == 1, n_other += times != 1;
                CHECK(known || target[i].configuration.step_s == 1e-3);
                CHECK(times <= 1 || target[i].configuration.step_s < 1.0001 / 60);
                for (int j = 0; j < i; j++)
                    CHECK(target[i].calibrate != target[j].calibrate ||
                          !pal_configuration_equal(&target[i].configuration, &target[j].configuration));
            }
            CHECK(n_own > 2 && (full ? n_other > 0 : n_other == 0) && n < PAL_STUDY_POINTS);
        }
        organ_free(&o);
    }
    free(target);
}

static void check_refused(organ *o, const pal_study_options *options, const char *word)
{
    o->diag.text[0] = 0;
    CHECK(pal_study_scene(o->scene, options, o->study, &o->diag) == PAL_ERR_REFUSED);
    CHECK(strstr(o->diag.text, word));
    if (!strstr(o->diag.text, word)) printf("  \"%s\" has no \"%s\"\n", o->diag.text, word);
}

static void what_makes_no_sense_is_refused_in_a_sentence(void)
{
    static const char *const wrong[] = {"jelly"}, *const hollow[] = {"adaptive_springs"};
    organ o;
    organ_make(&o, true);
    check_refused(&o, &(pal_study_options){.quick = 1, .body = 1}, "body 1");
    check_refused(&o, &(pal_study_options){.quick = 1, .method = wrong, .n_method = 1}, "jelly");
    check_refused(&o, &(pal_study_options){.quick = 1, .method = hollow, .n_method = 1}, "adaptive_springs");
    check_refused(&o, &(pal_study_options){.quick = 1, .seconds = -1}, "seconds");
    o.scene->body[0].n_support = 0;
    check_refused(&o, &(pal_study_options){.quick = 1}, "hold");
    organ_free(&o);
}

int main(void)
{
    RUN(the_step_of_the_scene_is_the_one_that_is_swept);
    RUN_LONG(a_full_organ_is_pressed);
    RUN(a_hollow_organ_is_pressed_and_pulled);
    RUN_LONG(cells_are_pressed);
    RUN(what_makes_no_sense_is_refused_in_a_sentence);
    return check_report();
}
