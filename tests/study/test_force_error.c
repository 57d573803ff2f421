/* The error of the force felt: what a study reports of a renderer that gives nothing is the reference's whole force, of
 * the bridge's own it falls with resolution and grows with the round trip; it is stored, printed and drawn. */
#include "server/study/study_page.h"
#include "server/study/study_store.h"

#include "server/base/vec3.h"
#include "server/commands/rendered_force.h"
#include "server/mesh/geometry/procedural.h"
#include "server/study/study_job.h"
#include "tests/check.h"

static pal_diagnostic diag;

/* an ellipsoid of 20 x 14 x 9 cm, held below */
typedef struct organ {
    pal_surface surface;
    pal_prepared mesh;
    pal_scene *scene;
    pal_study *study;
} organ;

static bool organ_make(organ *o)
{
    static const double side_m[3] = {0.2, 0.14, 0.09};
    double low[3], high[3];
    *o = (organ){.scene = calloc(1, sizeof *o->scene), .study = calloc(1, sizeof *o->study)};
    if (!o->scene || !o->study || pal_sphere_make(0.1, &o->surface)) return false;
    pal_surface_box(&o->surface, low, high);
    for (int i = 0; i < 3 * o->surface.n_vertex; i++)
        o->surface.x[i] = (o->surface.x[i] - low[i % 3]) / (high[i % 3] - low[i % 3]) * side_m[i % 3];
    pal_voxel_options voxel = {.resolution = 10, .border = true, .min_fill = 0.25, .fill = true};
    if (pal_prepared_make(&o->surface, &voxel, &o->mesh, NULL, &diag)) return false;
    pal_scene_default(o->scene);
    o->scene->n_body = 1;
    pal_tools_default(o->scene, 1);
    pal_body_def *def = &o->scene->body[0];
    pal_body_default(def, "organ", &o->mesh);
    for (int i = 1; i < def->n_effect; i++) def->effect[i - 1] = def->effect[i]; /* no weight */
    def->n_effect--;
    def->support[0].fraction = 0.4;
    return true;
}

static void organ_free(organ *o)
{
    pal_prepared_free(&o->mesh);
    pal_surface_free(&o->surface);
    free(o->scene);
    free(o->study);
}

static void nothing_arrives(void *state, const pal_tool *model, double period_s)
{
    (void)state, (void)model, (void)period_s;
}

static void nothing_is_rendered(void *state, double dt_s, const double x_m[3], const double v_m_s[3], double force_N[3])
{
    (void)state, (void)dt_s, (void)x_m, (void)v_m_s;
    pal_set3(force_N, 0, 0, 0);
}

static bool run(organ *o, const pal_study_renderer *renderer)
{
    static const char *const method[] = {"fem"};
    const pal_study_options options = {
        .quick = 1, .seconds = 0.1, .method = method, .n_method = 1, .renderer = renderer};
    if (!organ_make(o)) return false;
    pal_err err = pal_study_scene(o->scene, &options, o->study, &diag);
    if (err) printf("  %s\n", diag.text);
    return !err;
}

static void who_renders_nothing_is_off_by_all_of_the_force(void)
{
    static const pal_study_renderer nothing = {1, nothing_arrives, nothing_is_rendered};
    organ o;
    int n = 0;
    REQUIRE(run(&o, &nothing));
    CHECK(o.study->max_force_N > 0.05);
    for (int i = 0; i < o.study->n_point; i++) {
        const pal_study_point *p = &o.study->point[i];
        if (!pal_study_measured(p)) continue;
        n++;
        for (int k = 0; k < PAL_STUDY_FORCES; k++) {
            CHECK_NEAR(p->force_max_N[k], o.study->max_force_N, 1e-12);
            /* held for a quarter of the time, in contact for most of it */
            CHECK(p->force_rms_N[k] > 0.5 * o.study->max_force_N && p->force_rms_N[k] < 0.9 * o.study->max_force_N);
        }
    }
    CHECK(n > 3);
    organ_free(&o);
}

static void the_bridge_is_nearer_on_finer_meshes_and_shorter_ways(void)
{
    organ o;
    char name[PAL_CONFIGURATION_TEXT];
    const pal_study_point *coarse = NULL, *fine = NULL;
    REQUIRE(run(&o, &pal_rendered_force));
    const pal_study *s = o.study;
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *p = &s->point[i];
        const pal_configuration *c = &p->measured.configuration;
        printf("  %s: force %.2f %.2f %.2f %.2f %% rms, %.1f %.1f %.1f %.1f %% at most\n",
               pal_configuration_text(c, name), 100 * p->force_rms_N[0] / s->max_force_N,
               100 * p->force_rms_N[1] / s->max_force_N, 100 * p->force_rms_N[2] / s->max_force_N,
               100 * p->force_rms_N[3] / s->max_force_N, 100 * p->force_max_N[0] / s->max_force_N,
               100 * p->force_max_N[1] / s->max_force_N, 100 * p->force_max_N[2] / s->max_force_N,
               100 * p->force_max_N[3] / s->max_force_N);
        if (strcmp(c->element, "hex8_bbar") != 0 || strcmp(c->solver, "implicit_euler") != 0) continue;
        if (!coarse || c->size < coarse->measured.configuration.size) coarse = p;
        if (!fine || c->size > fine->measured.configuration.size) fine = p;
    }
    REQUIRE(coarse && fine && coarse != fine);
    printf("  largest force %.3f N, %s; %.2g %% from a coarser mesh\n", s->max_force_N, s->reference,
           100 * s->reference_force_N / s->max_force_N);
    CHECK_LE(fine->force_rms_N[0], 0.5 * coarse->force_rms_N[0]);
    CHECK_LE(fine->force_rms_N[0], fine->force_rms_N[2]);
    CHECK_LE(fine->force_rms_N[1], 0.1 * s->max_force_N);
    organ_free(&o);
}

static char *slurp(const char *stem, const char *ending)
{
    char path[PAL_STUDY_PATH + 16];
    snprintf(path, sizeof path, "%s%s", stem, ending);
    FILE *file = fopen(path, "rb");
    char *text = calloc(1, 1 << 20);
    if (file && text && fread(text, 1, (1 << 20) - 1, file) == 0) text[0] = 0;
    if (file) fclose(file);
    remove(path);
    return text;
}

/* numbers without a pattern, two configurations, of which the second was not pressed */
static void forces_are_stored_printed_and_drawn(void)
{
    char folder[] = "/tmp/palpate_force_XXXXXX", stem[64];
    pal_study_file *file = calloc(1, sizeof *file), *back = NULL;
    REQUIRE(file && mkdtemp(folder));
    snprintf(stem, sizeof stem, "%s/study", folder);
    pal_study *s = &file->study;
    s->max_force_N = 2.5, s->reference_force_N = 0.125, s->max_m = 0.02, s->length_scale_m = 0.3, s->step_s = 1.0 / 60;
    s->reference_m = 1e-4;
    snprintf(file->shape, sizeof file->shape, "0123456789abcdef");
    for (int i = 0; i < 2; i++) {
        pal_study_point *p = &s->point[s->n_point++];
        p->measured = (pal_measured_configuration){
            .configuration = {.model = "fem", .size = 8 + i, .step_s = 1.0 / 60}, .ms = 1.5 + i, .error_m = 1e-3};
        for (int k = 0; k < PAL_STUDY_FORCES; k++)
            p->force_rms_N[k] = 0.1 + 0.05 * k, p->force_max_N[k] = 0.4 + 0.05 * k;
        if (i == 1) pal_study_forget_forces(p);
    }
    pal_study_mark_front(s);
    CHECK_INT(pal_study_publish(file, stem, &diag), 0);
    char *csv = slurp(stem, ".csv"), *svg = slurp(stem, "_force.svg"), *html = slurp(stem, ".html");
    free(slurp(stem, ".svg"));
    CHECK(strstr(csv, "force_rms_200_N") != NULL);
    CHECK(strstr(svg, "<svg") != NULL && strstr(svg, "force 4, 6, 8 % at 0, 50, 200 ms") != NULL);
    CHECK(strstr(svg, "1.4 times coarser") != NULL);
    CHECK(strstr(html, "<th>force 200 ms RMS %</th>") != NULL && strstr(html, "changes by 5 %") != NULL);
    cJSON *tree = pal_study_file_tree(file);
    char *json = cJSON_Print(tree);
    REQUIRE(json && !pal_study_file_parse("study", json, strlen(json), &back, &diag));
    CHECK_NEAR(back->study.max_force_N, 2.5, 0);
    CHECK_NEAR(back->study.reference_force_N, 0.125, 0);
    CHECK_NEAR(back->study.point[0].force_rms_N[3], s->point[0].force_rms_N[3], 0);
    CHECK(isnan(back->study.point[1].force_max_N[2]));
    /* a study stored before has no force, which is no force of 0 */
    cJSON_DeleteItemFromObject(tree, "max_force_N");
    cJSON_DeleteItemFromObject(cJSON_GetArrayItem(cJSON_GetObjectItem(tree, "points"), 0), "force_rms_0_N");
    free(back);
    cJSON_free(json);
    json = cJSON_Print(tree);
    REQUIRE(json && !pal_study_file_parse("study", json, strlen(json), &back, &diag));
    CHECK(isnan(back->study.max_force_N) && isnan(back->study.point[0].force_rms_N[0]));
    cJSON_free(json);
    cJSON_Delete(tree);
    rmdir(folder);
    free(back), free(file), free(csv), free(svg), free(html);
}

int main(void)
{
    RUN(who_renders_nothing_is_off_by_all_of_the_force);
    RUN(the_bridge_is_nearer_on_finer_meshes_and_shorter_ways);
    RUN(forces_are_stored_printed_and_drawn);
    return check_report();
}
