/* What is offered as a neighbour on a knob is what a switch takes (estimate_predict.h): the same check on both sides.
 */
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

int main(void)
{
    if (!small_scene(&scene, &mesh, 8)) return 1;
    RUN(what_is_offered_is_taken_and_the_other_way_round);
    RUN(what_is_offered_can_be_made);
    RUN(sub_steps_that_are_not_allowed_are_not_offered);
    pal_prepared_free(&mesh);
    return check_report();
}
