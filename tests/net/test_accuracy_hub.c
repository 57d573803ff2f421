/* What accuracy costs, as clients see it: the study and the estimates come to those who ask, and are there only for
 * them. */
#include "server/estimate/estimator.h"
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

static small_scene organ;
enum { POINTS = 5 };
static pal_measured_configuration configuration[POINTS];

/* as a study keeps them, by ascending ms; point 2 is what the scene has, point 3 was not measured */
static void make_points(void)
{
    static const double ms[POINTS] = {0.1, 0.2, 0.4, 0.8, 3}, error_m[POINTS] = {4e-3, 5e-3, 2e-3, NAN, 1e-4};
    memset(configuration, 0, sizeof configuration);
    for (int i = 0; i < POINTS; i++) {
        configuration[i].ms = ms[i], configuration[i].error_m = error_m[i];
        configuration[i].front = i != 1 && i != 3;
        pal_configuration_of(&organ.scene, 0, &configuration[i].configuration);
        configuration[i].configuration.size = 7 + 2 * i;
    }
    pal_configuration_of(&organ.scene, 0, &configuration[2].configuration);
    snprintf(configuration[4].configuration.model, sizeof configuration[4].configuration.model, "fem");
    snprintf(configuration[4].configuration.element, sizeof configuration[4].configuration.element, "hex8_bbar");
}

static void begin(bool with_study)
{
    static const pal_session_study study = {.configuration = configuration, .n = POINTS, .reference_m = 3e-4};
    pal_server_options net = {.study = with_study ? &study : NULL};
    served_begin(&organ.scene, (pal_session_options){0}, net);
}

/* half a second, so that every turn is a tick of the hub */
static void turn(mem_client *a, mem_client *b)
{
    served_turn(500000000ull, a, b);
}

#define ESTIMATE(on) "{\"type\":\"command\",\"verb\":\"estimate\",\"target\":\"organ\",\"args\":{\"enabled\":" #on "}}"

static void nothing_is_estimated_without_subscribers(void)
{
    mem_client ada;
    uint64_t made = pal_estimator_count();
    begin(true);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    UNTIL(ada.n_text[PAL_CONTROL_STATUS] > 3, &ada, NULL);
    CHECK(ada.last[PAL_CONTROL_HELLO].hello.estimates);
    CHECK_INT(ada.n_text[PAL_CONTROL_STUDY] + ada.n_text[PAL_CONTROL_ESTIMATE], 0);
    CHECK_INT(pal_estimator_threads(), 0);
    CHECK(pal_estimator_count() == made);
    mem_end(&ada);
    end();
}

static void who_asks_sees_study_and_estimate_until_the_last_has_gone(void)
{
    mem_client ada, bo;
    begin(true);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    mem_join(&bo, transport, "Bo", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    turn(&ada, &bo);
    mem_text(&ada, ESTIMATE(1));
    mem_text(&ada, ESTIMATE(1)); /* twice is once */
    UNTIL(ada.n_text[PAL_CONTROL_ESTIMATE] > 2, &ada, &bo);
    CHECK_INT(bo.n_text[PAL_CONTROL_STUDY] + bo.n_text[PAL_CONTROL_ESTIMATE], 0);
    CHECK_INT(ada.n_text[PAL_CONTROL_STUDY], 1);
    const pal_wire_study *study = &ada.last[PAL_CONTROL_STUDY].study;
    CHECK_TEXT(study->body, "organ");
    CHECK_INT(study->n_point, POINTS - 1);
    CHECK_NEAR(study->step_ms, 1e3 * organ.scene.step_s, 1e-9);
    CHECK(study->reference_m == 3e-4);
    CHECK_INT(study->point[3].index, 4);
    CHECK_TEXT(study->point[3].method, "fem hex8_bbar");
    CHECK(study->point[0].pareto_optimal && !study->point[1].pareto_optimal && study->point[3].error_m == 1e-4);
    const pal_wire_estimate *e = &ada.last[PAL_CONTROL_ESTIMATE].estimate;
    CHECK_TEXT(e->body, "organ");
    CHECK_INT(e->study_point, 2);
    CHECK(strstr(e->configuration, "tet_springs"));
    WAIT_UNTIL(e->cost_ms > 0, &ada, &bo);
    CHECK_INT(pal_estimator_threads(), 1);

    /* a viewer may subscribe as well; one estimator serves both */
    mem_text(&bo, ESTIMATE(1));
    UNTIL(bo.n_text[PAL_CONTROL_ESTIMATE] > 0 && bo.n_text[PAL_CONTROL_STUDY] == 1, &ada, &bo);
    CHECK_INT(pal_estimator_threads(), 1);
    mem_text(&ada, ESTIMATE(0));
    for (int i = 0; i < 3; i++) turn(&ada, &bo);
    int n_ada = ada.n_text[PAL_CONTROL_ESTIMATE], n_bo = bo.n_text[PAL_CONTROL_ESTIMATE];
    UNTIL(bo.n_text[PAL_CONTROL_ESTIMATE] > n_bo + 2, &ada, &bo);
    CHECK_INT(ada.n_text[PAL_CONTROL_ESTIMATE], n_ada);
    CHECK_INT(pal_estimator_threads(), 1);
    mem_end(&bo); /* gone without a word */
    WAIT_UNTIL(pal_estimator_threads() == 0, &ada, NULL);
    CHECK_INT(ada.n_bad, 0);
    mem_end(&ada);
    end();
}

static void without_a_study_there_is_the_estimate_alone(void)
{
    mem_client ada;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    mem_text(&ada, ESTIMATE(1));
    UNTIL(ada.n_text[PAL_CONTROL_ESTIMATE] > 0, &ada, NULL);
    CHECK_INT(ada.n_text[PAL_CONTROL_STUDY], 1);
    CHECK_INT(ada.last[PAL_CONTROL_STUDY].study.n_point, 0);
    CHECK(isnan(ada.last[PAL_CONTROL_ESTIMATE].estimate.study_point));
    mem_end(&ada);
    end();
}

/* what a choice is foreseen to cost is for the same time of the body as what it costs now */
static void neighbours_are_measured_once(void)
{
    pal_body_def *def = &organ.scene.body[0], *was = malloc(sizeof *was);
    pal_configuration now;
    mem_client ada;
    int n_step = 0, n_size = 0;
    REQUIRE(was);
    *was = *def;
    def->n_effect = 0;
    pal_entry_init(&def->model, "model", "fem");
    pal_entry_init(&def->solver, "solver", "implicit_euler");
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    mem_text(&ada, ESTIMATE(1));
    const pal_wire_estimate *e = &ada.last[PAL_CONTROL_ESTIMATE].estimate;
    WAIT_UNTIL(e->n_neighbour >= 2 && e->cost_ms > 0, &ada, NULL);
    double step_ms = 1e3 * organ.scene.step_s;
    pal_configuration_of(&organ.scene, 0, &now);
    for (uint32_t i = 0; i < e->n_neighbour; i++) {
        const pal_wire_neighbour *near = &e->neighbour[i];
        bool step = !strcmp(near->parameter, "step"), size = !strcmp(near->parameter, "resolution");
        n_step += step, n_size += size;
        if (step) CHECK_NEAR(near->cost_ms * near->step_ms, e->cost_ms * step_ms, 1e-9 * step_ms);
        if (size) CHECK((near->cost_ms > e->cost_ms) == ((int)near->size > now.size));
    }
    CHECK_INT(n_step, 2);
    printf("  %u neighbours, %d in size\n", e->n_neighbour, n_size);
    mem_end(&ada);
    end();
    *def = *was;
    free(was);
}

/* their constants hold for the size that they were found for */
static void calibrated_springs_keep_their_size(void)
{
    pal_config_entry *model = &organ.scene.body[0].model, was = *model;
    pal_configuration now;
    mem_client ada;
    char text[160], summary[64];
    CHECK(!pal_entry_put_number(model, "k_distance_J", 1e-3, NULL));
    CHECK(!pal_entry_put_text(model, "weights", "volume", NULL));
    pal_configuration_of(&organ.scene, 0, &now);
    CHECK(now.k_distance_J > 0 && now.size > 0);
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    turn(&ada, NULL);
    for (int k = 0; k < 2; k++) {
        snprintf(text, sizeof text,
                 "{\"type\":\"command\",\"verb\":\"configure\",\"args\":{\"size\":%d,\"step_ms\":%.9g}}",
                 now.size + (k == 0), 1e3 * now.step_s);
        mem_text(&ada, text);
        WAIT_UNTIL(ada.n_text[PAL_CONTROL_ERROR] + ada.n_text[PAL_CONTROL_ANSWER] == k + 1, &ada, NULL);
    }
    snprintf(summary, sizeof summary, "calibrated for %d voxels", now.size);
    CHECK(strstr(ada.last[PAL_CONTROL_ERROR].error.text, summary) != NULL);
    CHECK_INT(ada.n_text[PAL_CONTROL_ERROR], 1);
    CHECK_INT(ada.n_text[PAL_CONTROL_ANSWER], 1);
    mem_end(&ada);
    end();
    *model = was;
}

static void bad_orders_are_refused_with_a_sentence(void)
{
    static const char *const bad[] = {
        "{\"type\":\"command\",\"verb\":\"estimate\",\"target\":\"liver\",\"args\":{\"enabled\":1}}",
        "{\"type\":\"command\",\"verb\":\"estimate\"}",
        "{\"type\":\"command\",\"verb\":\"estimate\",\"args\":{\"disabled\":1}}"};
    static const char *const summary[] = {"there is no body liver", "estimate: enabled is missing",
                                          "estimate: enabled is missing"};
    mem_client ada;
    begin(true);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    turn(&ada, NULL);
    for (int i = 0; i < 3; i++) {
        mem_text(&ada, bad[i]);
        UNTIL(ada.n_text[PAL_CONTROL_ERROR] == i + 1, &ada, NULL);
        CHECK_TEXT(ada.last[PAL_CONTROL_ERROR].error.text, summary[i]);
    }
    CHECK_INT(ada.n_text[PAL_CONTROL_STUDY] + ada.n_text[PAL_CONTROL_ESTIMATE], 0);
    CHECK_INT(pal_estimator_threads(), 0);
    mem_end(&ada);
    end();
}

int main(void)
{
    if (!small_scene_make(&organ, "small")) return 1;
    make_points();
    RUN(nothing_is_estimated_without_subscribers);
    RUN(who_asks_sees_study_and_estimate_until_the_last_has_gone);
    RUN(without_a_study_there_is_the_estimate_alone);
    RUN(neighbours_are_measured_once);
    RUN(calibrated_springs_keep_their_size);
    RUN(bad_orders_are_refused_with_a_sentence);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
