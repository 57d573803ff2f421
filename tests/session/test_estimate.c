/* Estimates of a running session: nothing of them exists while nobody looks, they change nothing, they go from one
 * session to the next that follows it. */
#include "server/base/clock.h"
#include "server/session/estimate_foresee.h"
#include "server/session/estimate_work.h"
#include "server/session/session.h"
#include "tests/check.h"
#include "tests/session/clay.h"
#include "tests/session/small_scene.h"

#include <dirent.h>

static pal_scene scene;
static pal_prepared mesh;
static const uint64_t patience_ns = 120000000000u; /* sanitizers on a busy machine */

static int threads(void)
{
    int n = 0;
    DIR *folder = opendir("/proc/self/task");
    while (folder && readdir(folder)) n++;
    if (folder) closedir(folder);
    return n;
}

static void sleep_ms(unsigned ms)
{
    pal_clock_sleep_until_ns(pal_clock_ns() + (uint64_t)ms * 1000000);
}

static void ask(pal_session *s, bool wanted)
{
    CHECK(!pal_session_command(s, &(pal_command){.kind = PAL_COMMAND_ESTIMATE, .body = 0, .wanted = wanted}));
}

/* the first estimate, or one of a later tick; gives up after two minutes */
static bool wait_estimate(pal_session *s, uint64_t after, pal_estimate *out)
{
    uint64_t until = pal_clock_ns() + patience_ns;
    while (!(pal_session_estimate(s, 0, out) && out->tick >= after)) {
        if (pal_clock_ns() > until) return false;
        sleep_ms(5);
    }
    return true;
}

static bool wait_threads(int n)
{
    uint64_t until = pal_clock_ns() + patience_ns;
    while (pal_estimator_threads() != n) {
        if (pal_clock_ns() > until) return false;
        sleep_ms(2);
    }
    return true;
}

static void nothing_exists_while_nobody_looks(void)
{
    pal_session *s = NULL;
    pal_note note = {""};
    pal_estimate estimate;
    REQUIRE(!pal_session_open(&scene, NULL, &note, &s));
    int before = threads();
    uint64_t made = pal_estimator_made();
    sleep_ms(60);
    CHECK_INT(pal_estimator_threads(), 0);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT((long long)(pal_estimator_made() - made), 0);
    /* two look: one estimator; one looks away: still there; both: gone */
    ask(s, true);
    ask(s, true);
    CHECK(wait_estimate(s, 1, &estimate));
    CHECK_INT(pal_estimator_threads(), 1);
    CHECK(estimate.ms > 0 && estimate.own_ms > 0 && estimate.time_s > 0);
    ask(s, false);
    sleep_ms(30);
    CHECK_INT(pal_estimator_threads(), 1);
    ask(s, false);
    CHECK(wait_threads(0));
    sleep_ms(30);
    CHECK(!pal_session_estimate(s, 0, &estimate));
    CHECK_INT(threads(), before);
    made = pal_estimator_made();
    sleep_ms(300);
    CHECK_INT((long long)(pal_estimator_made() - made), 0);
    pal_session_close(s);
}

static void what_is_not_there_is_refused(void)
{
    pal_session *s = NULL;
    pal_estimate estimate;
    REQUIRE(!pal_session_open(&scene, NULL, NULL, &s));
    for (int body = -1; body < 9; body++) {
        pal_command command = {.kind = PAL_COMMAND_ESTIMATE, .body = body, .wanted = false};
        CHECK_INT(pal_session_command(s, &command), body == 0 ? PAL_ERR_OK : PAL_ERR_REFUSED);
        CHECK(!pal_session_estimate(s, body, &estimate));
    }
    sleep_ms(20);
    CHECK_INT(pal_estimator_threads(), 0);
    /* closing does not wait for somebody to look away, nor for worlds to be made */
    ask(s, true);
    sleep_ms(6);
    pal_session_close(s);
    CHECK_INT(pal_estimator_threads(), 0);
}

/* a world that is looked at by an estimator has the bits of one that is not */
static uint64_t run(bool looked_at)
{
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    CHECK(!pal_world_create(&scene, NULL, &w));
    if (!w) return 0;
    if (looked_at) CHECK(!pal_estimator_open(&scene, 0, NULL, &e));
    uint64_t made = pal_estimator_made();
    for (int i = 0; i < 100; i++) {
        pal_pose pose = {.position_m = {0, 0, 0.06 - 0.0002 * i}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_world_pose(w, 0, &pose));
        CHECK(!pal_world_step(w, scene.step_s));
        if (e) pal_estimator_look(e, w, 1);
        for (int k = 0; e && i % 20 == 10 && k < 4000 && pal_estimator_made() == made; k++) {
            sleep_ms(5);
            pal_estimator_look(e, w, NAN);
        }
        made = pal_estimator_made();
    }
    if (e) CHECK(pal_estimator_read(e, &estimate) && estimate.tick > 0);
    uint64_t hash = pal_world_hash(w);
    pal_estimator_close(e);
    pal_world_destroy(w);
    return hash;
}

static void looking_changes_nothing(void)
{
    uint64_t without = run(false), with = run(true);
    CHECK(without == with);
}

static void carry(void *user, pal_world *next, const pal_world *before)
{
    (void)user;
    pal_world_follow(next, before, -1, NULL, NULL);
}

static void who_looks_goes_on_looking_at_what_follows(void)
{
    pal_session *before = NULL, *next = NULL;
    pal_scene other = scene;
    pal_estimate estimate;
    REQUIRE(!pal_session_open(&scene, NULL, NULL, &before));
    ask(before, true);
    CHECK(wait_estimate(before, 1, &estimate));
    REQUIRE(!pal_session_open_after(before, &other, NULL, &next));
    CHECK(!pal_session_follow(next, before, carry, NULL, NULL));
    pal_session_close(before);
    CHECK(wait_estimate(next, 1, &estimate));
    CHECK_INT(pal_estimator_threads(), 1);
    ask(next, false);
    CHECK(wait_threads(0));
    pal_session_close(next);
}

/* ---- what it says ---- */

/* the ball as finite elements, 60 steps a second, held at its foot */
static pal_scene *fem_scene(void)
{
    pal_scene *fem = malloc(sizeof *fem);
    if (!fem) abort();
    *fem = scene;
    fem->step_s = 1.0 / 60;
    pal_item_init(&fem->body[0].model, "model", "fem");
    pal_item_init(&fem->body[0].solver, "solver", "implicit_euler");
    fem->body[0].material.damping_1_s = 0;
    fem->body[0].n_effect = 0;
    return fem;
}

/* pushed from the side by all nodes of its upper half for a while, then as it is after some free steps */
static pal_world *swinging(const pal_scene *at, int n_free)
{
    pal_world *w = NULL;
    if (pal_world_create(at, NULL, &w)) abort();
    const pal_body *body = pal_world_look(w, 0);
    for (int push = 1; push >= 0; push--) {
        for (int i = 0; i < body->n_node; i++)
            if (body->node_rest[3 * i + 2] > 0) CHECK(!pal_world_load(w, 0, i, (double[3]){push * 1e-4, 0, 0}));
        for (int k = 0; k < (push ? 10 : n_free); k++) CHECK(!pal_world_step(w, at->step_s));
    }
    return w;
}

static bool estimate_of(const pal_scene *at, const pal_world *w, pal_estimate *out)
{
    pal_estimate_work *work = NULL;
    pal_note note = {""};
    bool good = !pal_estimate_work_open(at, 0, NULL, &note, &work);
    if (!good) printf("  %s\n", note.text);
    if (good) {
        pal_estimate_state *state = pal_estimate_work_state(work);
        for (int i = 0; i < 5; i++) state->ms[state->n_ms++] = (float)(1 + i);
        good = pal_estimate_copy(state, w, 0) && pal_estimate_work_run(work, out);
    }
    pal_estimate_work_close(work);
    return good;
}

/* six steps from where w is, and the same by steps of a 16th with next to nothing left by the solver */
static double true_time_error(const pal_scene *at, const pal_world *w)
{
    pal_scene *exact = malloc(sizeof *exact);
    pal_world *a[2] = {NULL, NULL};
    const pal_body *from = pal_world_look(w, 0);
    double most = 0;
    if (!exact) abort();
    *exact = *at;
    pal_item_put_number(&exact->body[0].solver, "tolerance", 1e-10, NULL);
    pal_item_put_number(&exact->body[0].solver, "iterations", 300, NULL);
    for (int k = 0; k < 2; k++) {
        CHECK(!pal_world_create(exact, NULL, &a[k]));
        pal_body *body = pal_world_body(a[k], 0);
        memcpy(body->x, from->x, 24 * (size_t)body->n_dof);
        memcpy(body->v, from->v, 24 * (size_t)body->n_dof);
        pal_world_moved(a[k], 0);
        for (int i = 0; i < (k ? 6 * 16 : 6); i++) CHECK(!pal_world_step(a[k], at->step_s / (k ? 16 : 1)));
    }
    const double *x = pal_world_look(a[0], 0)->x, *y = pal_world_look(a[1], 0)->x;
    for (int i = 0; i < from->n_dof; i++)
        most = fmax(most, sqrt(pow(x[3 * i] - y[3 * i], 2) + pow(x[3 * i + 1] - y[3 * i + 1], 2) +
                               pow(x[3 * i + 2] - y[3 * i + 2], 2)));
    for (int k = 0; k < 2; k++) pal_world_destroy(a[k]);
    free(exact);
    return most;
}

static void the_part_of_time_is_what_shorter_steps_change(void)
{
    static const char *const solvers[] = {"implicit_euler", "sdirk2"};
    for (int k = 0; k < 2; k++) {
        pal_scene *fem = fem_scene();
        pal_item_init(&fem->body[0].solver, "solver", solvers[k]);
        pal_world *w = swinging(fem, 2);
        pal_estimate e;
        REQUIRE(estimate_of(fem, w, &e));
        double true_m = true_time_error(fem, w);
        printf("  %s: true %.3g mm, estimate %.3g mm: %.2f\n", solvers[k], 1e3 * true_m, 1e3 * e.time_m,
               e.time_m / true_m);
        CHECK(e.time_m >= 0.5 * true_m && e.time_m <= 2 * true_m);
        CHECK(e.algebraic_m > 0 && e.algebraic_m < 0.1 * e.most_m);
        pal_world_destroy(w);
        free(fem);
    }
}

static void a_looser_solver_leaves_more(void)
{
    double left[2];
    for (int k = 0; k < 2; k++) {
        pal_scene *fem = fem_scene();
        pal_estimate e;
        pal_item_put_number(&fem->body[0].solver, "tolerance", k ? 1e-5 : 0.1, NULL);
        pal_world *w = swinging(fem, 2);
        REQUIRE(estimate_of(fem, w, &e));
        left[k] = e.algebraic_m;
        pal_world_destroy(w);
        free(fem);
    }
    printf("  left %.3g %.3g mm\n", 1e3 * left[0], 1e3 * left[1]);
    CHECK(left[1] > 0 && left[1] < 0.1 * left[0]);
}

static void every_part_is_known_of_finite_elements_and_of_springs(void)
{
    /* springs have 1.5 s of processor time to come to rest in, which is too little under sanitizers */
    for (int k = 0; k < CHECK_REPEATS(2, 1); k++) {
        pal_scene *at = fem_scene();
        if (k) *at = scene, at->body[0].n_effect = 0;
        pal_world *w = swinging(at, 0);
        pal_estimate e;
        REQUIRE(estimate_of(at, w, &e));
        printf("  %s: largest way %.3g mm; discretisation %.3g, algebraic %.3g, time %.3g, model %.3g mm, zz %.3g %%, "
               "%s\n",
               at->body[0].model.name, 1e3 * e.most_m, 1e3 * e.discretisation_m, 1e3 * e.algebraic_m, 1e3 * e.time_m,
               1e3 * e.model_m, e.zz_percent, e.note);
        CHECK_NEAR(e.error_m, e.discretisation_m + e.algebraic_m + e.time_m + e.model_m, 1e-15);
        CHECK(k == 0 || e.model_m < 0.5 * e.most_m + 2 * e.discretisation_m);
        CHECK(e.discretisation_m > 0 && e.model_m > 0 && e.zz_percent > 0 && e.zz_percent < 100);
        CHECK(k ? e.algebraic_m == 0 : e.algebraic_m > 0);
        CHECK(!e.locking);
        CHECK_NEAR(e.ms, 3, 0);
        CHECK_TEXT(e.note, "");
        CHECK_INT(e.n_neighbour, k ? 2 : 6);
        CHECK_INT(e.neighbour[0].setting.size, 4);
        CHECK_INT(e.neighbour[1].setting.size, 16);
        CHECK(e.neighbour[0].ms < e.ms && e.neighbour[1].ms > e.ms);
        CHECK(e.neighbour[0].error_m > e.error_m && e.neighbour[1].error_m < e.error_m);
        pal_world_destroy(w);
        free(at);
    }
}

static void neighbours_follow_the_models_of_cost_and_error(void)
{
    pal_foresight from = {.setting = {.model = "fem", .size = 20, .step_s = 0.01},
                          .growth = 1.5,
                          .order = 2,
                          .implicit = true,
                          .solver_order = 1,
                          .tolerance = 0.01,
                          .decade = 1.25};
    pal_estimate e = {
        .ms = 2, .discretisation_m = 0.8, .time_m = 0.4, .algebraic_m = 0.1, .model_m = NAN, .error_m = 1.3};
    const double ms[6] = {2 / pow(8, 1.5), 2 * pow(8, 1.5), 1, 4, 1.6, 2.5},
                 error[6] = {1.3 + 2.4, 1.3 - 0.6, 1.7, 1.1, 2.2, 1.21};
    pal_estimate_foresee(&from, &e);
    CHECK_INT(e.n_neighbour, 6);
    for (int i = 0; i < 6; i++) {
        CHECK_NEAR(e.neighbour[i].ms, ms[i], 1e-12);
        CHECK_NEAR(e.neighbour[i].error_m, error[i], 1e-12);
    }
    CHECK_INT(e.neighbour[0].setting.size, 10);
    CHECK_NEAR(e.neighbour[3].setting.step_s, 0.005, 1e-15);
    CHECK_NEAR(e.neighbour[4].setting.tolerance, 0.1, 1e-15);
    /* what is not known is not foreseen */
    e.discretisation_m = NAN, from.growth = NAN, from.decade = NAN;
    pal_estimate_foresee(&from, &e);
    CHECK_INT(e.n_neighbour, 2);
    CHECK_INT(e.neighbour[0].setting.size, 20);
    /* what a choice costs is known without the error that it changes */
    e.error_m = NAN;
    pal_estimate_foresee(&from, &e);
    CHECK_INT(e.n_neighbour, 2);
    CHECK_NEAR(e.neighbour[1].ms, 4, 1e-12);
    CHECK(isnan(e.neighbour[0].error_m) && isnan(e.neighbour[1].error_m));
}

/* constants of springs go with the cube of their edge */
static void calibrated_springs_have_no_neighbour_in_size(void)
{
    pal_foresight from = {.setting = {.model = "tet_springs", .size = 20, .step_s = 0.01}, .growth = 1.5, .order = 1.5};
    pal_estimate e = {.ms = 2, .discretisation_m = 0.8, .model_m = 0.1, .error_m = 0.9};
    pal_estimate_foresee(&from, &e);
    CHECK_INT(e.n_neighbour, 2);
    from.setting.k_distance_J = 1e-3;
    pal_estimate_foresee(&from, &e);
    CHECK_INT(e.n_neighbour, 0);
}

/* of control cells time and algebraic part alone are known: their sum is not the error */
static void small_parts_alone_are_no_error(void)
{
    clay_scene clay;
    pal_estimate e;
    clay_make(&clay, 2, 0.1);
    pal_item_init(&clay.scene.body[0].solver, "solver", "implicit_euler");
    pal_world *w = swinging(&clay.scene, 2);
    REQUIRE(estimate_of(&clay.scene, w, &e));
    CHECK(e.time_m > 0 && e.algebraic_m >= 0 && isnan(e.discretisation_m) && isnan(e.model_m));
    CHECK(isnan(e.error_m));
    CHECK(e.n_neighbour >= 2 && isnan(e.neighbour[0].error_m));
    CHECK_NEAR(e.neighbour[0].ms, e.ms / 2, 1e-12);
    pal_world_destroy(w);
    clay_free(&clay);
}

static void elements_that_lock_say_so(void)
{
    static const char *const element[] = {"tet4", "hex8", "hex8_bbar"};
    for (int k = 0; k < 3; k++) {
        pal_scene *fem = fem_scene();
        pal_estimate e;
        pal_item_put_text(&fem->body[0].model, "element", element[k], NULL);
        fem->body[0].material.poisson = 0.499;
        pal_world *w = swinging(fem, 0);
        REQUIRE(estimate_of(fem, w, &e));
        CHECK(e.locking == (k < 2));
        pal_world_destroy(w);
        free(fem);
    }
}

static bool estimate_again(pal_estimate_work *work, const pal_world *w, pal_estimate *out)
{
    return pal_estimate_copy(pal_estimate_work_state(work), w, 0) && pal_estimate_work_run(work, out);
}

/* at rest while gravity is off, not so when it is on */
static void rows_switched_off_are_off_for_the_estimate(void)
{
    pal_scene *fem = fem_scene();
    pal_estimate_work *work = NULL;
    pal_world *w = NULL;
    pal_estimate e, fresh;
    pal_item_init(&fem->body[0].effect[0], "effect", "gravity");
    pal_item_put_number(&fem->body[0].effect[0], "acceleration_m_s2", 0.2, NULL);
    fem->body[0].n_effect = 1;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    REQUIRE(!pal_estimate_work_open(fem, 0, NULL, NULL, &work));
    for (int round = 0; round < 2; round++) {
        CHECK(!pal_world_switch_row(w, fem, 0, "gravity", false, NULL));
        REQUIRE(estimate_again(work, w, &e));
        REQUIRE(estimate_of(fem, w, &fresh));
        CHECK_LE(fresh.error_m, 1e-12);
        CHECK_LE(e.error_m, round ? 1e-9 : 1e-12);
        CHECK(!pal_world_switch_row(w, fem, 0, "gravity", true, NULL));
        REQUIRE(estimate_again(work, w, &e));
        REQUIRE(estimate_of(fem, w, &fresh));
        printf("  on: %.6g, made for it %.6g mm; algebraic %.3g, %.3g mm\n", 1e3 * e.discretisation_m,
               1e3 * fresh.discretisation_m, 1e3 * e.algebraic_m, 1e3 * fresh.algebraic_m);
        CHECK(fresh.discretisation_m > 1e-7);
        CHECK_NEAR(e.discretisation_m, fresh.discretisation_m, 1e-3 * fresh.discretisation_m);
        CHECK_NEAR(e.algebraic_m, fresh.algebraic_m, 1e-3 * fresh.algebraic_m + 1e-12);
    }
    pal_estimate_work_close(work);
    pal_world_destroy(w);
    free(fem);
}

/* looks until there are so many estimates, or a while has gone by */
static uint64_t look_for(pal_estimator *e, pal_world *w, uint64_t n, uint64_t while_ns)
{
    uint64_t made = pal_estimator_made(), until = pal_clock_ns() + while_ns;
    while (pal_estimator_made() - made < n && pal_clock_ns() < until) {
        CHECK(!pal_world_step(w, scene.step_s));
        pal_estimator_look(e, w, 1);
        sleep_ms(5);
    }
    return pal_estimator_made() - made;
}

static void a_sleeping_body_is_looked_at_once(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    pal_item_init(&fem->body[0].effect[0], "effect", "sleep");
    fem->body[0].n_effect = 1;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    for (int i = 0; i < 200 && !pal_world_look(w, 0)->asleep; i++) CHECK(!pal_world_step(w, fem->step_s));
    REQUIRE(pal_world_look(w, 0)->asleep);
    REQUIRE(!pal_estimator_open(fem, 0, NULL, &e));
    CHECK_INT((long long)look_for(e, w, 1, patience_ns), 1);
    uint64_t tick = pal_estimator_read(e, &estimate) ? estimate.tick : 0;
    CHECK_INT((long long)look_for(e, w, 1, 600000000), 0);
    CHECK(pal_estimator_read(e, &estimate) && estimate.tick == tick);
    /* a load wakes it */
    CHECK(!pal_world_load(w, 0, 0, (double[3]){1e-3, 0, 0}));
    CHECK_INT((long long)look_for(e, w, 1, patience_ns), 1);
    CHECK(pal_estimator_read(e, &estimate) && estimate.tick > tick && estimate.most_m > 0);
    pal_estimator_close(e);
    pal_world_destroy(w);
    free(fem);
}

static void nothing_is_known_of_a_frozen_body(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = NULL;
    pal_estimator *e = NULL;
    pal_estimate estimate;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    REQUIRE(!pal_estimator_open(fem, 0, NULL, &e));
    CHECK_INT((long long)look_for(e, w, 1, patience_ns), 1);
    CHECK(pal_estimator_read(e, &estimate) && estimate.error_m >= 0);
    pal_world_body(w, 0)->frozen = true;
    pal_estimator_look(e, w, 1);
    REQUIRE(pal_estimator_read(e, &estimate));
    CHECK(isnan(estimate.error_m) && isnan(estimate.most_m) && estimate.tick == pal_world_tick(w));
    CHECK(strstr(estimate.note, "frozen") != NULL);
    /* what was known before is not what is known after */
    CHECK(!pal_world_reset_body(w, 0));
    pal_estimator_look(e, w, NAN);
    CHECK(!pal_estimator_read(e, &estimate));
    CHECK_INT((long long)look_for(e, w, 1, patience_ns), 1);
    for (int k = 0; k < 100 && !pal_estimator_read(e, &estimate); k++) look_for(e, w, 1, patience_ns);
    CHECK(pal_estimator_read(e, &estimate) && estimate.error_m >= 0);
    pal_estimator_close(e);
    pal_world_destroy(w);
    free(fem);
}

static void a_body_at_rest_has_no_error(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = NULL;
    pal_estimate e;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    fem->body[0].n_effect = 0;
    REQUIRE(estimate_of(fem, w, &e));
    printf("  at rest: discretisation %.3g, time %.3g, algebraic %.3g, model %.3g m, %s\n", e.discretisation_m,
           e.time_m, e.algebraic_m, e.model_m, e.note);
    CHECK_LE(e.error_m, 1e-12);
    CHECK_LE(e.most_m, 0);
    pal_world_destroy(w);
    free(fem);
}

/* pressed by a tool: its contact is among the loads */
static void a_pressed_body_is_estimated_while_it_runs(void)
{
    pal_scene *fem = fem_scene();
    pal_session *s = NULL;
    pal_estimate e = {.tick = 0};
    fem->body[0].n_effect = scene.body[0].n_effect;
    REQUIRE(!pal_session_open(fem, NULL, NULL, &s));
    ask(s, true);
    uint64_t until = pal_clock_ns() + patience_ns;
    while (pal_clock_ns() < until && !(e.most_m > 1e-4 && e.discretisation_m > 0)) {
        const pal_pose pose = {.position_m = {0.048, 0, 0.01}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_session_put_pose(s, 0, &pose));
        sleep_ms(10);
        (void)pal_session_estimate(s, 0, &e);
    }
    printf("  pressed by %.3g mm: discretisation %.3g mm, all %.3g mm, zz %.3g %%, own %.3g ms, a step %.3g ms\n",
           1e3 * e.most_m, 1e3 * e.discretisation_m, 1e3 * e.error_m, e.zz_percent, e.own_ms, e.ms);
    CHECK(e.most_m > 1e-4 && e.discretisation_m > 0 && e.zz_percent > 0);
    pal_session_close(s);
    CHECK_INT(pal_estimator_threads(), 0);
    free(fem);
}

/* on a foot as small as a voxel the ball would fall over */
static void without_gravity(pal_body_def *body)
{
    int n = 0;
    for (int i = 0; i < body->n_effect; i++)
        if (strcmp(body->effect[i].name, "gravity")) body->effect[n++] = body->effect[i];
    body->n_effect = n;
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 8)) return 1;
    without_gravity(&scene.body[0]);
    RUN(nothing_exists_while_nobody_looks);
    RUN(what_is_not_there_is_refused);
    RUN(looking_changes_nothing);
    RUN(who_looks_goes_on_looking_at_what_follows);
    RUN(a_pressed_body_is_estimated_while_it_runs);
    RUN(the_part_of_time_is_what_shorter_steps_change);
    RUN(a_looser_solver_leaves_more);
    RUN(every_part_is_known_of_finite_elements_and_of_springs);
    RUN(neighbours_follow_the_models_of_cost_and_error);
    RUN(calibrated_springs_have_no_neighbour_in_size);
    RUN(small_parts_alone_are_no_error);
    RUN(elements_that_lock_say_so);
    RUN(rows_switched_off_are_off_for_the_estimate);
    RUN(a_sleeping_body_is_looked_at_once);
    RUN(nothing_is_known_of_a_frozen_body);
    RUN(a_body_at_rest_has_no_error);
    pal_prepared_free(&mesh);
    return check_report();
}
