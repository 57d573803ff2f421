/* What estimates say, on the thread that asks: the parts of the error, neighbours on the knobs, what is not known. The
 * thread that makes them beside a session: test_estimate. */
#include "server/base/vec3.h"
#include "server/estimate/estimate_hierarchy.h"
#include "server/estimate/estimate_predict.h"
#include "server/estimate/estimation.h"
#include "server/session/configuration_switch.h"
#include "server/sim/springs/spring_law.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/count_threads.h"
#include "tests/fixtures/estimate_scene.h"
#include "tests/session/sculpt_body.h"

/* pushed from the side by all nodes of its upper half for a while, then as it is after some free steps */
static pal_world *swinging(const pal_scene *at, int n_free)
{
    pal_world *w = NULL;
    if (pal_world_create(at, NULL, &w)) abort();
    const pal_body *body = pal_world_view_body(w, 0);
    for (int push = 1; push >= 0; push--) {
        for (int i = 0; i < body->n_node; i++)
            if (body->node_rest[3 * i + 2] > 0) CHECK(!pal_world_load(w, 0, i, (double[3]){push * 1e-4, 0, 0}));
        for (int k = 0; k < (push ? 10 : n_free); k++) CHECK(!pal_world_step(w, at->step_s));
    }
    return w;
}

static bool estimate_of(const pal_scene *at, const pal_world *w, pal_estimate *out)
{
    pal_estimation *work = NULL;
    pal_diagnostic diag = {""};
    bool good = !pal_estimation_open(at, 0, NULL, &diag, &work);
    if (!good) printf("  %s\n", diag.text);
    if (good) {
        pal_estimate_state *state = pal_estimation_state(work);
        /* a quarter stays; a step was interrupted while a frame was made */
        for (int i = 1; i <= 5; i++)
            state->cost[state->n_cost++] = (pal_estimate_cost){.ms = (float)i, .once = i < 5 ? 0.25F : 0.99F};
        good = pal_estimate_copy(state, w, 0) && pal_estimation_run(work, out);
    }
    pal_estimation_close(work);
    return good;
}

/* a world six of the scene's steps on from where w is, by n_part steps each; tolerance 0: the scene's */
static pal_world *six_steps(const pal_scene *at, const pal_world *w, int n_part, double tolerance)
{
    pal_scene *to = malloc(sizeof *to);
    pal_world *on = NULL;
    const pal_body *from = pal_world_view_body(w, 0);
    if (!to) abort();
    *to = *at;
    if (tolerance > 0) {
        pal_entry_put_number(&to->body[0].solver, "tolerance", tolerance, NULL);
        pal_entry_put_number(&to->body[0].solver, "iterations", 400, NULL);
    }
    if (pal_world_create(to, NULL, &on)) abort();
    pal_body *body = pal_world_body(on, 0);
    memcpy(body->x, from->x, 24 * (size_t)body->n_dof);
    memcpy(body->v, from->v, 24 * (size_t)body->n_dof);
    pal_world_invalidate_limits(on, 0);
    for (int i = 0; i < 6 * n_part; i++) CHECK(!pal_world_step(on, at->step_s / n_part));
    free(to);
    return on;
}

/* largest distance of two worlds' points, m; destroys them */
static double apart(pal_world *a, pal_world *b)
{
    const pal_body *from = pal_world_view_body(a, 0);
    const double max = pal_max_dist3(from->x, pal_world_view_body(b, 0)->x, from->n_dof);
    pal_world_destroy(a), pal_world_destroy(b);
    return max;
}

/* six steps from where w is, and the same by steps of a 16th with next to nothing left by the solver */
static double true_time_error(const pal_scene *at, const pal_world *w)
{
    return apart(six_steps(at, w, 1, 1e-10), six_steps(at, w, 16, 1e-10));
}

static void the_part_of_time_is_what_shorter_steps_change(void)
{
    static const char *const solvers[] = {"implicit_euler", "sdirk2"};
    for (int k = 0; k < 2; k++) {
        pal_scene *fem = fem_scene();
        pal_entry_init(&fem->body[0].solver, "solver", solvers[k]);
        pal_world *w = swinging(fem, 2);
        pal_estimate e;
        REQUIRE(estimate_of(fem, w, &e));
        double true_m = true_time_error(fem, w);
        printf("  %s: true %.3g mm, estimate %.3g mm: %.2f\n", solvers[k], 1e3 * true_m, 1e3 * e.time_m,
               e.time_m / true_m);
        CHECK(e.time_m >= 0.5 * true_m && e.time_m <= 2 * true_m);
        CHECK(e.algebraic_m > 0 && e.algebraic_m < 0.1 * e.max_m);
        pal_world_destroy(w);
        free(fem);
    }
}

/* springs as they push off, swing and come to rest, by sub-steps of half of their limit and of nine tenths */
static void the_part_of_time_of_springs_is_what_much_shorter_steps_change(void)
{
    for (int k = 0; k < 6; k++) {
        pal_scene *springs = malloc(sizeof *springs);
        REQUIRE(springs);
        *springs = scene;
        springs->step_s = 1.0 / 60;
        pal_entry_init(&springs->body[0].solver, "solver", "verlet");
        pal_entry_put_number(&springs->body[0].solver, "safety", k % 2 ? 0.9 : 0.5, NULL);
        pal_world *w = swinging(springs, 1 + 4 * (k / 2));
        pal_estimate e;
        REQUIRE(estimate_of(springs, w, &e));
        const double true_m = apart(six_steps(springs, w, 1, 0), six_steps(springs, w, 16 * pal_world_substeps(w), 0));
        printf("  %d sub-steps: true %.3g mm, estimate %.3g mm: %.2f\n", pal_world_substeps(w), 1e3 * true_m,
               1e3 * e.time_m, e.time_m / true_m);
        CHECK(e.time_m >= 0.5 * true_m && e.time_m <= 2 * true_m);
        CHECK(e.algebraic_m == 0);
        pal_world_destroy(w);
        free(springs);
    }
}

/* the session's threads need the cores */
static void estimates_of_a_session_with_threads_start_none(void)
{
    pal_estimation *work = NULL;
    pal_scene *two = malloc(sizeof *two);
    REQUIRE(two);
    *two = scene;
    two->threads = 2;
    pal_world *w = swinging(two, 2);
    const int n_with = count_threads();
    REQUIRE(!pal_estimation_open(two, 0, NULL, NULL, &work));
    CHECK_LE(count_threads(), n_with); /* a thread that has been joined may be listed for a moment */
    pal_estimation_close(work);
    pal_world_destroy(w);
    free(two);
}

/* steps without an algebraic error are solved to a share of the live tolerance: what that is off by */
static void steps_without_an_algebraic_error_are_exact_enough(void)
{
    static const char *const solvers[] = {"implicit_euler", "sdirk2"}, *const kinds[] = {"factor", "jacobi"};
    for (int k = 0; k < 4; k++) {
        pal_scene *fem = fem_scene();
        pal_entry_init(&fem->body[0].solver, "solver", solvers[k % 2]);
        pal_entry_put_text(&fem->body[0].solver, "preconditioner", kinds[k / 2], NULL);
        pal_world *w = swinging(fem, 2);
        pal_estimate e;
        REQUIRE(estimate_of(fem, w, &e));
        const double algebraic_m = apart(six_steps(fem, w, 1, 0), six_steps(fem, w, 1, 1e-10)),
                     time_m = apart(six_steps(fem, w, 1, 1e-10), six_steps(fem, w, 2, 1e-10)) / (k % 2 ? 0.75 : 0.5);
        printf("  %s, %s: algebraic part %.4g mm, exactly %.4g; of time %.4g, %.4g\n", solvers[k % 2], kinds[k / 2],
               1e3 * e.algebraic_m, 1e3 * algebraic_m, 1e3 * e.time_m, 1e3 * time_m);
        CHECK_NEAR(e.algebraic_m, algebraic_m, 0.1 * algebraic_m);
        CHECK_NEAR(e.time_m, time_m, 0.1 * algebraic_m + 0.01 * time_m);
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
        pal_entry_put_number(&fem->body[0].solver, "tolerance", k ? 1e-5 : 0.1, NULL);
        pal_world *w = swinging(fem, 2);
        REQUIRE(estimate_of(fem, w, &e));
        left[k] = e.algebraic_m;
        pal_world_destroy(w);
        free(fem);
    }
    printf("  left %.3g %.3g mm\n", 1e3 * left[0], 1e3 * left[1]);
    CHECK(left[1] > 0 && left[1] < 0.1 * left[0]);
}

/* a ball pressed by a tool from above, held for 1 s, on so many voxels; the force on the tool */
static pal_world *pressed(const pal_scene *at, double *force_N)
{
    pal_world *w = NULL;
    if (pal_world_create(at, NULL, &w)) abort();
    for (int k = 1; k <= 120; k++) {
        const pal_pose pose = {.position_m = {0.004, 0, 0.072 - 0.012 * fmin(k / 60.0, 1)}, .quat = {1, 0, 0, 0}};
        CHECK(!pal_world_pose(w, 0, &pose) && !pal_world_step(w, at->step_s));
    }
    const double *f = pal_world_tools(w)->tool[0].force_N;
    *force_N = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    return w;
}

/* The force at the same depth on this mesh against that on a finer one; bounds as those of displacements */
static void the_error_of_force_is_what_finer_meshes_change(void)
{
    pal_scene *fem = fem_scene();
    memcpy(fem->body[0].effect, scene.body[0].effect, sizeof scene.body[0].effect);
    fem->body[0].n_effect = scene.body[0].n_effect;
    fem->body[0].material.damping_1_s = 8;
    fem->tool[0].radius_m = 0.02;
    static const int size[] = {12, 20};
    double force_N[2], percent = NAN;
    for (int k = 0; k < 2; k++) {
        const pal_configuration to = {.model = "fem", .element = "hex8_bbar", .law = "corotational", .size = size[k]};
        pal_configured_scene *set = NULL;
        pal_estimate e;
        REQUIRE(!pal_configuration_make(fem, 0, &to, NULL, &set));
        pal_world *w = pressed(&set->scene, &force_N[k]);
        if (k == 0) {
            REQUIRE(estimate_of(&set->scene, w, &e));
            percent = e.force_percent;
        }
        pal_world_destroy(w);
        pal_configured_scene_free(set);
    }
    const double off = 100 * fabs(force_N[0] / force_N[1] - 1);
    printf("  %d voxels: %.4f N, %.3g %% off, estimated %.3g %%\n", size[0], force_N[0], off, percent);
    CHECK(percent > 0.6 * off && percent < 1.7 * off);
    /* nothing presses */
    pal_world *w = swinging(fem, 2);
    pal_estimate e;
    REQUIRE(estimate_of(fem, w, &e));
    CHECK(isnan(e.force_percent) && isfinite(e.discretisation_m));
    pal_world_destroy(w);
    free(fem);
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
               at->body[0].model.name, 1e3 * e.max_m, 1e3 * e.discretisation_m, 1e3 * e.algebraic_m, 1e3 * e.time_m,
               1e3 * e.model_m, e.energy_error_percent, e.diag);
        CHECK_NEAR(e.error_m, e.discretisation_m + e.algebraic_m + e.time_m + e.model_m, 1e-15);
        if (k > 0) CHECK(e.model_m < 0.5 * e.max_m + 2 * e.discretisation_m);
        CHECK(e.discretisation_m > 0 && e.model_m > 0 && e.energy_error_percent > 0 && e.energy_error_percent < 100);
        CHECK(k ? e.algebraic_m == 0 : e.algebraic_m > 0);
        CHECK(!e.locking);
        CHECK_NEAR(e.ms, 3, 0);
        /* eight voxels across, four, two: there is no order in what these change */
        CHECK_TEXT(e.diag, "discretisation: still grows from mesh to mesh, so more may be left");
        CHECK_INT(e.n_neighbour, k ? 2 : 6);
        CHECK_INT(e.neighbour[0].configuration.size, 4);
        CHECK_INT(e.neighbour[1].configuration.size, 16);
        CHECK(e.neighbour[0].ms < e.ms && e.neighbour[0].ms > 0.25 * e.ms);
        CHECK_LE((0.25 + 0.75 * 4) * e.ms, e.neighbour[1].ms);
        CHECK(e.neighbour[0].error_m > e.error_m && e.neighbour[1].error_m < e.error_m);
        pal_world_destroy(w);
        free(at);
    }
}

/* what is foreseen of a neighbour's counts is what the switch to it makes: the same rows, as many sub-steps, nodes as
 * pal_configuration_estimate_nodes promises them */
static void neighbours_are_what_a_switch_makes(void)
{
    for (int k = CHECK_REPEATS(0, 1); k < 2; k++) {
        pal_scene *from = fem_scene();
        pal_configured_scene *set = NULL;
        pal_configuration own;
        if (k == 1) *from = scene, from->body[0].n_effect = 0;
        /* in voxels as a switch makes them, so that they stay where the size does */
        pal_configuration_of(from, 0, &own);
        own.size = 9;
        REQUIRE(!pal_configuration_make(from, 0, &own, NULL, &set));
        const pal_scene *at = &set->scene;
        pal_world *w = swinging(at, 0);
        pal_estimate e;
        REQUIRE(estimate_of(at, w, &e));
        CHECK_INT(e.n_neighbour, k ? 2 : 6);
        for (int i = 0; i < e.n_neighbour; i++) {
            const pal_configuration *to = &e.neighbour[i].configuration;
            pal_configuration_switch *change = NULL;
            pal_world *next = NULL;
            pal_diagnostic diag = {""};
            pal_err err = pal_configuration_switch_prepare(at, NULL, 0, to, &diag, &change);
            if (!err) err = pal_world_create(&change->set->scene, &diag, &next);
            if (err) CHECK_FAIL("%s", diag.text);
            double nodes = pal_world_view_body(next, 0)->n_node;
            printf("  %s %d voxels, %g ms: nodes %d foreseen, %g made, sub-steps %d, %d\n", to->model, to->size,
                   1e3 * to->step_s, e.neighbour_nodes[i], nodes, e.neighbour_substeps[i], pal_world_substeps(next));
            bool size = to->size != 9;
            /* a quarter off from 8 voxels on; of 4 nearly all are cut (0.27) */
            const double off = size ? (to->size < 8 ? 0.3 : 0.25) * nodes : 0;
            CHECK_NEAR(e.neighbour_nodes[i], nodes, off);
            /* of another size they follow from the voxel's edge alone, and half of the nodes of four voxels are on the
             * surface, which is less stiff */
            CHECK_LE(abs(e.neighbour_substeps[i] - pal_world_substeps(next)), size);
            CHECK_INT(pal_world_component_count(next), pal_world_component_count(w));
            for (int r = 0; r < pal_world_component_count(w) && r < pal_world_component_count(next); r++)
                CHECK(pal_world_component(next, r)->effect == pal_world_component(w, r)->effect);
            pal_world_destroy(next);
            pal_configuration_switch_free(change);
        }
        pal_world_destroy(w);
        pal_configured_scene_free(set);
        free(from);
    }
}

/* constants as the material gives them, in a scene that calls them fitted: one part in place of two */
static void fitted_springs_are_compared_with_converged_elements(void)
{
    pal_scene *own = fem_scene();
    pal_estimate e[2];
    *own = scene, own->body[0].n_effect = 0;
    double k[3], edge_m = mesh.tets.edge_m, young_Pa = own->body[0].material.young_Pa;
    pal_spring_factors(own->body[0].material.poisson, true, k);
    pal_configuration to;
    pal_configured_scene *set = NULL, *plain = NULL;
    pal_diagnostic diag = {""};
    pal_configuration_of(own, 0, &to);
    to.k_distance_J = k[0] * young_Pa * edge_m * edge_m * edge_m;
    to.k_volume_J = k[2] * young_Pa * edge_m * edge_m * edge_m;
    if (pal_configuration_make(own, 0, &to, &diag, &set)) CHECK_FAIL("%s", diag.text);
    REQUIRE(set);
    /* the same voxels without constants */
    to.k_distance_J = to.k_volume_J = 0;
    if (pal_configuration_make(&set->scene, 0, &to, &diag, &plain)) CHECK_FAIL("%s", diag.text);
    REQUIRE(plain);
    for (int i = 0; i < 2; i++) {
        const pal_scene *at = i ? &set->scene : &plain->scene;
        pal_world *w = swinging(at, 0);
        REQUIRE(estimate_of(at, w, &e[i]));
        printf("  discretisation %.3g, model %.3g mm, %s\n", 1e3 * e[i].discretisation_m, 1e3 * e[i].model_m,
               e[i].diag);
        pal_world_destroy(w);
    }
    CHECK(e[1].discretisation_m == 0 && strstr(e[1].diag, "the mesh's part is in the model's"));
    CHECK_NEAR(e[1].error_m, e[1].model_m + e[1].time_m, 1e-15);
    CHECK(e[0].discretisation_m > 0 && !strstr(e[0].diag, "fitted"));
    /* the estimate is good to a factor of 3, as its text says */
    CHECK(e[1].model_m > 0 && e[1].model_m < 3 * (e[0].discretisation_m + e[0].model_m));
    pal_configured_scene_free(plain);
    pal_configured_scene_free(set);
    free(own);
}

/* of control cells time and algebraic part alone are known: their sum is not the error */
static void small_parts_alone_are_no_error(void)
{
    clay_scene clay;
    pal_estimate e;
    clay_make(&clay, 2, 0.1);
    pal_entry_init(&clay.scene.body[0].solver, "solver", "implicit_euler");
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
        pal_entry_put_text(&fem->body[0].model, "element", element[k], NULL);
        fem->body[0].material.poisson = 0.499;
        pal_world *w = swinging(fem, 0);
        REQUIRE(estimate_of(fem, w, &e));
        CHECK(e.locking == (k < 2));
        pal_world_destroy(w);
        free(fem);
    }
}

static double own(const pal_estimate_cost *c)
{
    return 1 - (double)c->once - (double)c->beside;
}

/* what is shown and guarded is done once; another body in each sub-step, but does not go with this one's mesh */
static void a_steps_time_is_told_apart(void)
{
    pal_scene *two = fem_scene();
    pal_world *w = NULL;
    pal_estimate_cost cost[2];
    two->body[1] = two->body[0], two->n_body = 2;
    snprintf(two->body[1].name, sizeof two->body[1].name, "other");
    REQUIRE(!pal_world_create(two, NULL, &w));
    cost[0] = pal_estimate_cost_of(w, 0, 2);
    CHECK(cost[0].ms == 2 && cost[0].once == 0 && cost[0].beside == 0);
    for (int i = 0; i < 3; i++) CHECK(!pal_world_step(w, two->step_s));
    for (int b = 0; b < 2; b++) {
        cost[b] = pal_estimate_cost_of(w, b, 2);
        CHECK(cost[b].once > 0 && cost[b].beside > 0 && own(&cost[b]) > 0);
    }
    /* the same step: what is one body's own is beside the other's */
    CHECK_NEAR(cost[0].once, cost[1].once, 1e-6);
    CHECK_NEAR(own(&cost[0]) + own(&cost[1]) + cost[0].once, 1, 1e-6);
    /* a body that sleeps has nothing of its own */
    pal_world_body(w, 0)->asleep = true;
    CHECK(!pal_world_step(w, two->step_s));
    cost[0] = pal_estimate_cost_of(w, 0, 2), cost[1] = pal_estimate_cost_of(w, 1, 2);
    CHECK_NEAR(own(&cost[0]), 0, 1e-6);
    CHECK_NEAR(own(&cost[1]), cost[0].beside, 1e-6);
    pal_world_destroy(w);
    free(two);
}

static bool estimate_again(pal_estimation *work, const pal_world *w, pal_estimate *out)
{
    return pal_estimate_copy(pal_estimation_state(work), w, 0) && pal_estimation_run(work, out);
}

/* puts the body at rest, or where gravity has it after some steps */
static void fall(pal_world *w, const pal_scene *at, int n_step)
{
    pal_body *body = pal_world_body(w, 0);
    memcpy(body->x, body->x_rest, 24 * (size_t)body->n_dof);
    memset(body->v, 0, 24 * (size_t)body->n_dof);
    pal_world_invalidate_limits(w, 0);
    for (int i = 0; i < n_step; i++) CHECK(!pal_world_step(w, at->step_s));
}

/* stays at rest while gravity is off, falls when it is on */
static void rows_switched_off_are_off_for_the_estimate(void)
{
    pal_scene *fem = fem_scene();
    pal_estimation *work = NULL;
    pal_world *w = NULL;
    pal_estimate e, fresh;
    pal_entry_init(&fem->body[0].effect[0], "effect", "gravity");
    pal_entry_put_number(&fem->body[0].effect[0], "acceleration_m_s2", 0.2, NULL);
    fem->body[0].n_effect = 1;
    fem->body[0].material.damping_1_s = 4;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    REQUIRE(!pal_estimation_open(fem, 0, NULL, NULL, &work));
    for (int round = 0; round < CHECK_REPEATS(2, 1); round++) {
        /* two rows, so that every switch moves the solver's place in the plan and makes it again */
        CHECK(!pal_world_switch_component(w, fem, 0, "gravity", false, NULL));
        CHECK(!pal_world_switch_component(w, fem, 0, "viscous", false, NULL));
        fall(w, fem, 0);
        REQUIRE(estimate_again(work, w, &e));
        REQUIRE(estimate_of(fem, w, &fresh));
        CHECK_LE(fresh.error_m, 1e-12);
        CHECK_LE(e.error_m, round ? 1e-9 : 1e-12);
        CHECK(!pal_world_switch_component(w, fem, 0, "viscous", true, NULL));
        CHECK(!pal_world_switch_component(w, fem, 0, "gravity", true, NULL));
        fall(w, fem, 10);
        REQUIRE(estimate_again(work, w, &e));
        REQUIRE(estimate_of(fem, w, &fresh));
        printf("  on: %.6g, made for it %.6g mm; algebraic %.3g, %.3g mm\n", 1e3 * e.discretisation_m,
               1e3 * fresh.discretisation_m, 1e3 * e.algebraic_m, 1e3 * fresh.algebraic_m);
        CHECK(fresh.discretisation_m > 1e-7);
        CHECK_NEAR(e.discretisation_m, fresh.discretisation_m, 1e-3 * fresh.discretisation_m);
        CHECK_NEAR(e.algebraic_m, fresh.algebraic_m, 1e-3 * fresh.algebraic_m + 1e-12);
        CHECK_NEAR(e.time_m, fresh.time_m, 1e-3 * fresh.time_m);
    }
    pal_estimation_close(work);
    pal_world_destroy(w);
    free(fem);
}

/* held by loads and then let go: inertia bears what the loads bore, and the error is the same in that moment */
static void a_body_let_go_errs_as_it_did_under_load(void)
{
    for (int k = 0; k < CHECK_REPEATS(2, 1); k++) {
        pal_scene *at = fem_scene();
        if (k) *at = scene, at->body[0].n_effect = 0;
        at->body[0].material.damping_1_s = 40;
        pal_world *w = NULL;
        pal_estimate fixed, gone;
        REQUIRE(!pal_world_create(at, NULL, &w));
        pal_body *body = pal_world_body(w, 0);
        for (int i = 0; i < body->n_node; i++)
            if (body->node_rest[3 * i + 2] > 0) CHECK(!pal_world_load(w, 0, i, (double[3]){1e-4, 0, 0}));
        for (int i = 0; i < 12; i++) CHECK(!pal_world_step(w, at->step_s));
        REQUIRE(estimate_of(at, w, &fixed));
        memset(body->load, 0, 24 * (size_t)body->n_node);
        REQUIRE(estimate_of(at, w, &gone));
        printf("  %s: held %.6g, let go %.6g mm of %.4g mm; model %.6g, %.6g mm; zz %.4g, %.4g %%\n",
               at->body[0].model.name, 1e3 * fixed.discretisation_m, 1e3 * gone.discretisation_m, 1e3 * fixed.max_m,
               1e3 * fixed.model_m, 1e3 * gone.model_m, fixed.energy_error_percent, gone.energy_error_percent);
        CHECK(fixed.discretisation_m > 0.01 * fixed.max_m && fixed.model_m > 0);
        CHECK_NEAR(gone.discretisation_m, fixed.discretisation_m, 1e-6 * fixed.discretisation_m);
        CHECK_NEAR(gone.model_m, fixed.model_m, 1e-3 * fixed.model_m + 1e-9);
        CHECK_NEAR(gone.energy_error_percent, fixed.energy_error_percent, 1e-3);
        CHECK(gone.n_neighbour >= 2 && gone.neighbour[1].error_m < gone.error_m);
        pal_world_destroy(w);
        free(at);
    }
}

/* moved by rounding alone it has no error, whatever the loads that balance rounding do elsewhere */
static void what_rounding_moved_has_no_error(void)
{
    for (int k = 0; k < 2; k++) {
        pal_scene *at = fem_scene();
        if (k) *at = scene, at->body[0].n_effect = 0;
        pal_world *w = NULL;
        pal_estimate e;
        REQUIRE(!pal_world_create(at, NULL, &w));
        pal_body *body = pal_world_body(w, 0);
        for (int i = 0; i < 3 * body->n_dof; i++) body->x[i] += i % 7 * 1e-17;
        REQUIRE(estimate_of(at, w, &e));
        CHECK(e.max_m > 0 && e.error_m == 0 && e.discretisation_m == 0 && e.model_m == 0 && e.time_m == 0);
        CHECK(e.energy_error_percent == 0);
        CHECK_TEXT(e.diag, "");
        pal_world_destroy(w);
        free(at);
    }
}

/* what a step costs asleep is not what its configuration costs */
static void a_sleeping_body_has_its_cost_awake(void)
{
    pal_scene *fem = fem_scene();
    pal_estimation *work = NULL;
    pal_world *w = NULL;
    pal_estimate e;
    REQUIRE(!pal_world_create(fem, NULL, &w));
    pal_world_body(w, 0)->asleep = true;
    REQUIRE(!pal_estimation_open(fem, 0, NULL, NULL, &work));
    REQUIRE(estimate_again(work, w, &e));
    CHECK(e.ms > 0 && e.ms < 1e4 && strstr(e.diag, "asleep"));
    pal_estimation_state(work)->n_cost = 1;
    pal_estimation_state(work)->cost[0].ms = 7;
    REQUIRE(estimate_again(work, w, &e));
    CHECK_NEAR(e.ms, 7, 0);
    pal_estimation_close(work);
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
           e.time_m, e.algebraic_m, e.model_m, e.diag);
    CHECK_LE(e.error_m, 1e-12);
    CHECK_LE(e.max_m, 0);
    pal_world_destroy(w);
    free(fem);
}

/* meshes of other sizes are made once for a load and Poisson's ratio: E and what is borne cancel, the ratio does not.
 * Five at most are solved: the finest, this one, merged voxels, half and twice */
static void other_sizes_are_measured_anew_where_the_answer_is_another(void)
{
    pal_scene *fem = fem_scene();
    fem->body[0].output.name[0] = 0;
    pal_world *w = swinging(fem, 0);
    const pal_body *body = pal_world_view_body(w, 0);
    pal_estimation *work = NULL;
    pal_estimate_hierarchy f = {.known = false};
    pal_configuration configuration;
    pal_configuration_of(fem, 0, &configuration);
    REQUIRE(!pal_estimation_open(fem, 0, NULL, NULL, &work));
    pal_estimate_state *s = pal_estimation_state(work);
    REQUIRE(pal_estimate_copy(s, w, 0));
    for (int i = 0; i < 3 * s->n_node; i++) s->borne[i] = i % 3 == 0 ? 1e-5 * body->node_mass_kg[i / 3] : 0;
    const pal_material is = s->material;
    static const struct {
        double young, poisson, load; /* times what it is */
        int n;                       /* measured until then */
    } edits[] = {{1, 1, 1, 1}, {1, 1, 3, 1}, {10, 1, 1, 1}, {1, 0.8, 1, 2}, {1, 0.8, 1, 2}, {1, 1, 1, 3}};
    double times[3] = {0};
    for (size_t k = 0; k < sizeof edits / sizeof *edits; k++) {
        s->material = is, f.next_s = 0;
        s->material.young_Pa *= edits[k].young, s->material.poisson *= edits[k].poisson;
        for (int i = 0; i < 3 * s->n_node; i++) s->borne[i] *= edits[k].load;
        CHECK(pal_estimate_hierarchy_refresh(fem, body, &configuration, s, false, false, NULL, &f));
        CHECK_INT(f.n_measured, edits[k].n);
        times[f.n_measured - 1] = f.times;
    }
    printf("  %d voxels against %d: error %.3g, then %.3g of the change; %d meshes in %d times, good to %.2g\n",
           configuration.size, f.finest, times[0], times[1], f.n_mesh, f.n_measured, f.uncertainty_factor);
    CHECK_LE(f.n_mesh, 5 * f.n_measured);
    CHECK(times[1] != times[0]);
    CHECK_NEAR(times[2] / times[0], 1, 1e-4);
    /* before it may be measured again, what is there is of something else, and said to be worse */
    char text[2][80];
    s->material.poisson *= 0.9, f.next_s = INFINITY;
    CHECK(!pal_estimate_hierarchy_refresh(fem, body, &configuration, s, false, false, NULL, &f));
    CHECK_INT(f.n_measured, 3);
    f.uncertainty_factor = 2.4;
    pal_estimate_hierarchy_describe(&f, true, text[0], sizeof text[0]),
        pal_estimate_hierarchy_describe(&f, false, text[1], sizeof text[1]);
    CHECK(strstr(text[0], "a factor of 2.4") && strstr(text[1], "a factor of 3"));
    pal_estimate_hierarchy_free(&f);
    pal_estimation_close(work);
    pal_world_destroy(w);
    free(fem);
}

/* of many nodes there is no factor, which would take a hundred megabytes and more */
static void meshes_of_many_nodes_have_no_factor(void)
{
    pal_scene *fem = fem_scene();
    pal_world *w = swinging(fem, 0);
    pal_configuration configuration;
    pal_configuration_of(fem, 0, &configuration);
    static const int size[] = {8, 20};
    for (int k = 0; k < 2; k++) {
        pal_rest_solution rest;
        pal_solve_report report;
        REQUIRE(!pal_rest_solution_sized(fem, pal_world_view_body(w, 0), &configuration, size[k], "linear", &rest));
        pal_world_solve_report(rest.world, 0, &report);
        const int n_node = pal_world_view_body(rest.world, 0)->n_node;
        printf("  %d nodes: %lld numbers in a factor, %.1f MB\n", n_node, (long long)report.factor_nonzeros,
               1e-6 * (double)pal_world_bytes(rest.world));
        CHECK(k ? n_node > 4000 : n_node < 4000);
        CHECK(k ? report.factor_nonzeros == 0 : report.factor_nonzeros > 0);
        /* 14 blocks of 3x3 a node in double and in single precision are 1.5 KB */
        CHECK_LE((double)pal_world_bytes(rest.world), 4e3 * n_node + 2e6);
        pal_rest_solution_free(&rest);
    }
    pal_world_destroy(w);
    free(fem);
}

int main(void)
{
    if (!estimate_scene(8)) return 1;
    RUN_LONG(the_part_of_time_is_what_shorter_steps_change);
    RUN(estimates_of_a_session_with_threads_start_none);
    RUN_LONG(the_part_of_time_of_springs_is_what_much_shorter_steps_change);
    RUN_LONG(steps_without_an_algebraic_error_are_exact_enough);
    RUN_LONG(a_looser_solver_leaves_more);
    RUN(the_error_of_force_is_what_finer_meshes_change);
    RUN(every_part_is_known_of_finite_elements_and_of_springs);
    RUN(a_steps_time_is_told_apart);
    RUN(neighbours_are_what_a_switch_makes);
    RUN(fitted_springs_are_compared_with_converged_elements);
    RUN(small_parts_alone_are_no_error);
    RUN_LONG(elements_that_lock_say_so);
    RUN_LONG(rows_switched_off_are_off_for_the_estimate);
    RUN(a_body_at_rest_has_no_error);
    RUN_LONG(a_body_let_go_errs_as_it_did_under_load);
    RUN_LONG(what_rounding_moved_has_no_error);
    RUN_LONG(a_sleeping_body_has_its_cost_awake);
    pal_prepared_free(&mesh);
    if (!estimate_scene(4)) return 1;
    RUN(meshes_of_many_nodes_have_no_factor);
    RUN(other_sizes_are_measured_anew_where_the_answer_is_another);
    pal_prepared_free(&mesh);
    return check_report();
}
