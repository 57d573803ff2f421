/* Neighbours on the knobs (estimate_predict.h): their cost and error by the models, and that what is offered is what a
 * switch takes, the same check on both sides. */
#include "server/estimate/estimate_predict.h"
#include "server/session/configuration_switch.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"

#include <string.h>

static pal_scene scene;
static pal_prepared mesh;

static pal_prediction prediction(int size, bool implicit)
{
    pal_prediction f = {.scene = &scene,
                        .nodes = {0.125, 8},
                        .substeps = {1, 1},
                        .work = {0.08, 12},
                        .order = 1.5,
                        .implicit = implicit,
                        .solver_order = 1,
                        .tolerance = 1e-2,
                        .decade = 1.3};
    f.configuration = (pal_configuration){.model = "fem", .element = "hex8_bbar", .size = size, .step_s = scene.step_s};
    if (!implicit) f.configuration = (pal_configuration){.model = "tet_springs", .size = size, .step_s = scene.step_s};
    return f;
}

static void predict(const pal_prediction *f, pal_estimate *out)
{
    *out = (pal_estimate){.ms = 1, .error_m = 4e-3, .discretisation_m = 1e-3, .time_m = 1e-3, .algebraic_m = 1e-3};
    pal_estimate_predict(f, out);
}

static bool offers(const pal_estimate *e, int size)
{
    for (int i = 0; i < e->n_neighbour; i++)
        if (e->neighbour[i].configuration.size == size) return true;
    return false;
}

/* at every size: what is offered passes the check, what is not offered though it is in range is refused by a switch
 * with a sentence, before anything is made */
static void what_is_offered_is_taken_and_the_other_way_round(void)
{
    int n_offered = 0, n_refused = 0;
    for (int size = 8; size <= 200; size += 4) {
        pal_prediction f = prediction(size, true);
        pal_estimate e;
        pal_diagnostic diag = {""};
        pal_configuration_switch *change = NULL;
        predict(&f, &e);
        for (int i = 0; i < e.n_neighbour; i++, n_offered++)
            CHECK_INT(pal_configuration_check_live(&scene, 0, &e.neighbour[i].configuration, &diag), PAL_ERR_OK);
        if (offers(&e, 2 * size)) continue;
        f.configuration.size = 2 * size;
        CHECK_INT(pal_configuration_switch_prepare(&scene, NULL, 0, &f.configuration, &diag, &change), PAL_ERR_REFUSED);
        CHECK(!change && strstr(diag.text, "a live switch takes 100000 at most") != NULL);
        n_refused++;
    }
    CHECK(n_offered > 60 && n_refused > 20);
}

/* small ones wholly: the switch is prepared */
static void what_is_offered_can_be_made(void)
{
    pal_prediction f = prediction(8, true);
    pal_estimate e;
    predict(&f, &e);
    CHECK_INT(e.n_neighbour, 6);
    for (int i = 0; i < e.n_neighbour; i++) {
        pal_diagnostic diag = {""};
        pal_configuration_switch *change = NULL;
        if (pal_configuration_switch_prepare(&scene, NULL, 0, &e.neighbour[i].configuration, &diag, &change))
            CHECK_FAIL("%s", diag.text);
        pal_configuration_switch_free(change);
    }
}

/* a scene of 30 sub-steps at most, of which 16 are taken: springs half as large, or a step twice as long, would not do
 */
static void sub_steps_that_are_not_allowed_are_not_offered(void)
{
    pal_estimate e;
    pal_prediction springs = prediction(8, false), fem = prediction(8, true);
    scene.max_substep = 30;
    springs.n_substep = fem.n_substep = 16;
    predict(&springs, &e);
    CHECK(offers(&e, 4) && !offers(&e, 16));
    predict(&fem, &e);
    CHECK(offers(&e, 4) && offers(&e, 16));
    for (int i = 0; i < e.n_neighbour; i++) CHECK_LE(e.neighbour[i].configuration.step_s, scene.step_s);
    scene.max_substep = 32;
    predict(&springs, &e);
    CHECK(offers(&e, 16));
}

static void neighbours_follow_the_models_of_cost_and_error(void)
{
    pal_prediction from = {.configuration = {.model = "fem", .size = 20, .step_s = 0.01},
                           .n_node = 1000,
                           .rest_substeps = 3,
                           .once = 0.25,
                           .beside = 0.15,
                           .nodes = {0.2, 6},
                           .substeps = {2.0 / 3, 2},
                           .work = {0.1, 9},
                           .order = 2,
                           .implicit = true,
                           .solver_order = 1,
                           .tolerance = 0.01,
                           .decade = 1.25};
    pal_estimate e = {
        .ms = 2, .discretisation_m = 0.8, .time_m = 0.4, .algebraic_m = 0.1, .model_m = NAN, .error_m = 1.3};
    const double ms[6] = {2 * (0.25 + 0.15 * 2 / 3 + 0.6 * 0.2 / 3), 2 * (0.25 + 0.15 * 2 + 0.6 * 18), 1, 4, 1.6, 2.5},
                 error[6] = {1.3 + 2.4, 1.3 - 0.6, 1.7, 1.1, 2.2, 1.21};
    pal_estimate_predict(&from, &e);
    CHECK_INT(e.n_neighbour, 6);
    for (int i = 0; i < 6; i++) {
        CHECK_NEAR(e.neighbour[i].ms, ms[i], 1e-12);
        CHECK_NEAR(e.neighbour[i].error_m, error[i], 1e-12);
    }
    const int nodes[6] = {200, 6000, 1000, 1000, 1000, 1000}, substeps[6] = {2, 6, 3, 3, 3, 3};
    for (int i = 0; i < 6; i++) {
        CHECK_INT(e.neighbour_nodes[i], nodes[i]);
        CHECK_INT(e.neighbour_substeps[i], substeps[i]);
    }
    CHECK_INT(e.neighbour[0].configuration.size, 10);
    CHECK_NEAR(e.neighbour[3].configuration.step_s, 0.005, 1e-15);
    CHECK_NEAR(e.neighbour[4].configuration.tolerance, 0.1, 1e-15);
    /* another body needs four sub-steps anyway, so that they are four, four and six */
    from.other_substeps = 4;
    pal_estimate_predict(&from, &e);
    CHECK_NEAR(e.neighbour[0].ms, 2 * (0.25 + 0.15 + 0.6 * 0.1), 1e-12);
    CHECK_NEAR(e.neighbour[1].ms, 2 * (0.25 + 1.5 * (0.15 + 0.6 * 9)), 1e-12);
    /* what is not known is not foreseen */
    e.discretisation_m = NAN, from.work[0] = from.work[1] = NAN, from.decade = NAN;
    pal_estimate_predict(&from, &e);
    CHECK_INT(e.n_neighbour, 2);
    CHECK_INT(e.neighbour[0].configuration.size, 20);
    /* what a choice costs is known without the error that it changes */
    e.error_m = NAN;
    pal_estimate_predict(&from, &e);
    CHECK_INT(e.n_neighbour, 2);
    CHECK_NEAR(e.neighbour[1].ms, 4, 1e-12);
    CHECK(isnan(e.neighbour[0].error_m) && isnan(e.neighbour[1].error_m));
}

/* constants of springs go with the cube of their edge */
static void calibrated_springs_have_no_neighbour_in_size(void)
{
    pal_prediction from = {.configuration = {.model = "tet_springs", .size = 20, .step_s = 0.01},
                           .nodes = {0.2, 6},
                           .substeps = {1, 1},
                           .work = {0.2, 7},
                           .order = 1.5};
    pal_estimate e = {.ms = 2, .discretisation_m = 0.8, .model_m = 0.1, .error_m = 0.9};
    pal_estimate_predict(&from, &e);
    CHECK_INT(e.n_neighbour, 2);
    from.configuration.k_distance_J = 1e-3;
    pal_estimate_predict(&from, &e);
    CHECK_INT(e.n_neighbour, 0);
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 8)) return 1;
    RUN(what_is_offered_is_taken_and_the_other_way_round);
    RUN(what_is_offered_can_be_made);
    RUN(sub_steps_that_are_not_allowed_are_not_offered);
    RUN(neighbours_follow_the_models_of_cost_and_error);
    RUN(calibrated_springs_have_no_neighbour_in_size);
    pal_prepared_free(&mesh);
    return check_report();
}
