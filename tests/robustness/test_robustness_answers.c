/* The three answers of the cases: over all models, no tool presses with more than its cap; generated organs are safe
 * and come back, in the same time at every run. */
#include "server/robustness/robustness.h"
#include "tests/fixtures/generated_organ.h"
#include "tests/fixtures/model_scenes.h"

static pal_robustness_report report;

static const pal_robustness_result *run(const pal_scene *scene, const char *only)
{
    pal_robustness_options options;
    pal_diagnostic diag = {""};
    pal_robustness_default(&options);
    options.only = only;
    if (pal_robustness_run(scene, &options, &report, &diag)) CHECK_FAIL("%s: %s", only, diag.text);
    return &report.result[0];
}

/* a cap that binds: the tool in the middle would press with more */
static void no_model_is_pressed_with_more_than_the_cap(void)
{
    static const char *const only[] = {"teleport", "inside", "pressed"};
    for (model_kind kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double max_N = 0;
        model_scene_make(&m, kind);
        model_scene_effect(&m, "tool_push");
        model_scene_effect(&m, "finite_guard");
        for (int t = 0; t < 2; t++) m.scene->tool[t].force_cap_N = 0.05;
        for (int k = 0; k < 3; k++) {
            const pal_robustness_result *r = run(m.scene, only[k]);
            CHECK_LE(r->peak_contact_N, 0.05 * (1 + 1e-9));
            CHECK(r->contact_cap_N == 0.05 && r->safe == PAL_YES && r->recovered == PAL_YES);
            if (r->verdict == PAL_VERDICT_FAILED) printf("  %s, %s: %s\n", model_kind_name[kind], only[k], r->diag);
            max_N = fmax(max_N, r->peak_contact_N);
        }
        printf("  %s: up to %.4g N of 0.05 N\n", model_kind_name[kind], max_N);
        CHECK(max_N > 0.5 * 0.05);
        model_scene_close(&m);
    }
}

static void generated_organs_are_safe_and_recover_alike_each_time(void)
{
    static const struct {
        const char *name, *only, *model;
    } row[] = {{"slender:5", "mirrored", "fem"}, {"slender:2", "meganewton", "springs"},
               {"branched:4", "flat", "fem"},    {"thin-walled:10", "point", "fem"},
               {"lobed:2", "stretched", "fem"},  {"lobed:4", "inside", "adaptive"}};
    for (size_t k = 0; k < sizeof row / sizeof row[0]; k++) {
        pal_loaded_scene *loaded = generated_organ(row[k].name, row[k].model);
        REQUIRE(loaded);
        const pal_robustness_result *r = run(&loaded->scene, row[k].only);
        const double return_s = r->return_s, left_S = r->deviation_S;
        printf("  %s, %s: %s, %s\n", row[k].name, row[k].only, pal_verdict_name(r->verdict), r->diag);
        CHECK(report.rests && r->safe == PAL_YES && r->recovered == PAL_YES && r->cause == PAL_CAUSE_NONE);
        CHECK(isfinite(return_s));
        if (k < 2) {
            r = run(&loaded->scene, row[k].only);
            CHECK(r->return_s == return_s && r->deviation_S == left_S);
        }
        pal_scene_free(loaded);
    }
}

/* a guard that is too strict stops the body: not safe, and the cause is named */
static void a_stopped_body_is_not_safe(void)
{
    model_scene m;
    model_scene_make(&m, FEM);
    pal_entry_put_number(model_scene_effect(&m, "finite_guard"), "reach", 0.1, NULL);
    const pal_robustness_result *r = run(m.scene, "stretched");
    CHECK(r->safe == PAL_NO && r->cause == PAL_CAUSE_STOPPED && r->verdict == PAL_VERDICT_FAILED);
    model_scene_close(&m);
}

/* too soft for its weight: no shape is judged against one that is crushed */
static void what_its_weight_crushes_is_not_judged(void)
{
    pal_loaded_scene *loaded = generated_organ("thin-walled:7", "fem");
    REQUIRE(loaded);
    loaded->scene.body[0].material.young_Pa *= 0.01;
    const pal_robustness_result *r = run(&loaded->scene, "flat");
    printf("  %d elements inverted at rest: %s\n", report.rest_inverted, r->diag);
    CHECK(!report.rests && report.rest_inverted > 0);
    CHECK(r->verdict == PAL_VERDICT_UNDECIDED && r->safe == PAL_UNKNOWN && r->cause == PAL_CAUSE_NO_REST);
    pal_scene_free(loaded);
}

int main(void)
{
    RUN(no_model_is_pressed_with_more_than_the_cap);
    RUN(generated_organs_are_safe_and_recover_alike_each_time);
    RUN(what_its_weight_crushes_is_not_judged);
    RUN(a_stopped_body_is_not_safe);
    return check_report();
}
