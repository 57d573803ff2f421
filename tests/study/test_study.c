/* Studies: the front and what it answers, what is foreseen, a beam swept in few configurations, what is taken over from
 * a study before, presses on a scene's bodies, refusals. */
#include "server/study/study.h"

#include "server/base/vec3.h"
#include "server/sim/world/world.h"
#include "server/solve/solve.h"
#include "tests/check.h"
#include "tests/fixtures/beam_problem.h"
#include "tests/fixtures/random.h"

static pal_study *new_study(void)
{
    pal_study *s = calloc(1, sizeof *s);
    if (!s) abort();
    return s;
}

/* numbers without a pattern */
static pal_study_point *put(pal_study *s, const char *element, int size, double ms, double error_m)
{
    pal_study_point *p = &s->point[s->n_point++];
    p->measured =
        (pal_measured_configuration){.configuration = {.size = size, .step_s = 1.0 / 60}, .ms = ms, .error_m = error_m};
    snprintf(p->measured.configuration.model, PAL_NAME, "fem");
    snprintf(p->measured.configuration.element, PAL_NAME, "%s", element);
    return p;
}

static void the_front_is_what_nothing_beats(void)
{
    pal_study *s = new_study();
    uint64_t state = 7;
    for (int i = 0; i < 120; i++) {
        pal_study_point *p =
            put(s, "hex8_bbar", i + 2, exp(4 * random_unit(&state)), 1e-3 * exp(-4 * random_unit(&state)));
        if (i % 10 == 3) p->err = PAL_ERR_FROZEN;
        if (i % 10 == 7) p->measured.error_m = NAN;
    }
    pal_study_mark_front(s);
    int n_front = 0;
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *p = &s->point[i];
        bool usable = !p->err && !isnan(p->measured.error_m), beaten = false;
        for (int k = 0; k < s->n_point; k++) {
            const pal_study_point *q = &s->point[k];
            beaten |= !q->err && q->measured.ms < p->measured.ms && q->measured.error_m < p->measured.error_m;
        }
        CHECK(p->measured.front == (usable && !beaten));
        n_front += p->measured.front;
    }
    CHECK(n_front > 2 && n_front < 40);
    free(s);
}

static int brute(const pal_study *s, double within, double budget)
{
    int best = -1;
    for (int i = 0; i < s->n_point; i++) {
        const pal_measured_configuration *p = &s->point[i].measured, *b = best < 0 ? NULL : &s->point[best].measured;
        if (s->point[i].err || isnan(p->error_m)) continue;
        if (!isnan(within) && p->error_m + s->reference_m > within) continue;
        if (!isnan(budget) && p->ms > budget) continue;
        /* below the reference's own error all are the same, and the cheapest is taken */
        double far = fmax(p->error_m, s->reference_m), min = b ? fmax(b->error_m, s->reference_m) : INFINITY;
        bool nearer = far < min || (b && far == min && p->ms < b->ms);
        if (!b || (isnan(within) ? nearer : p->ms < b->ms)) best = i;
    }
    return best;
}

static void a_pick_is_the_best_of_all(void)
{
    pal_study *s = new_study();
    uint64_t state = 11;
    s->reference_m = 6e-5;
    for (int i = 0; i < 60; i++)
        put(s, "tet4", i + 2, exp(4 * random_unit(&state)), 1e-3 * exp(-4 * random_unit(&state)));
    s->point[5].err = PAL_ERR_BUDGET, s->point[5].measured.ms = 1e-6;
    for (int i = 0; i < 40; i++) {
        double within = 1e-3 * exp(-5 * random_unit(&state)), budget = exp(5 * random_unit(&state) - 0.5);
        CHECK_INT(pal_study_pick(s, "", within, NAN), brute(s, within, NAN));
        CHECK_INT(pal_study_pick(s, "", NAN, budget), brute(s, NAN, budget));
        CHECK_INT(pal_study_pick(s, "", within, budget), brute(s, within, budget));
    }
    CHECK_INT(pal_study_pick(s, "", 1e-5, NAN), -1);
    CHECK_INT(pal_study_pick(s, "", NAN, 0.5), -1);
    free(s);
}

/* what lies below the reference's own error is no nearer for it, and a reference that is far off names nothing */
static void the_reference_bounds_what_is_named(void)
{
    pal_study *s = new_study();
    const double ms[] = {1, 2, 4, 8}, error_m[] = {5e-4, 1.5e-4, 1e-4, 2e-5};
    for (int i = 0; i < 4; i++) put(s, "hex8_bbar", i + 6, ms[i], error_m[i]);
    s->max_m = 1e-2, s->reference_m = 2e-4;
    pal_study_mark_front(s);
    CHECK(s->point[0].measured.front && s->point[1].measured.front);
    CHECK(!s->point[2].measured.front && !s->point[3].measured.front);
    CHECK_INT(pal_study_pick(s, "", NAN, 10), 1);
    CHECK_INT(pal_study_pick(s, "", 3.2e-4, NAN), 2);
    s->reference_m = 2.9e-3;
    CHECK(pal_study_trusted(s) && pal_study_pick(s, "", NAN, 10) == 0);
    s->reference_m = 3.1e-3;
    pal_study_mark_front(s);
    CHECK(!pal_study_trusted(s) && !s->point[0].measured.front);
    CHECK_INT(pal_study_pick(s, "", NAN, 10), -1);
    CHECK_INT(pal_study_pick(s, "", 1, NAN), -1);
    free(s);
}

static void power_laws_are_predicted_exactly(void)
{
    pal_study *s = new_study();
    const int size[] = {8, 11, 16, 22, 30, 40};
    for (int i = 0; i < 6; i++) {
        put(s, "hex8_bbar", size[i], 2e-4 * pow(size[i], 2.7), 0.3 * pow(size[i], -1.8));
        put(s, "tet4", size[i], 9, 9); /* another element is another law */
    }
    double error_m;
    for (int n = 6; n <= 48; n += 7) {
        pal_configuration at = s->point[0].measured.configuration;
        at.size = n;
        CHECK(pal_study_predict_error(s, &at, -1, &error_m));
        CHECK_NEAR(error_m / (0.3 * pow(n, -1.8)), 1, 1e-6);
    }
    /* a point that is left out is not looked at */
    s->point[4].measured.error_m *= 3;
    CHECK(pal_study_predict_error(s, &s->point[4].measured.configuration, 4, &error_m));
    CHECK_NEAR(error_m / (0.3 * pow(16, -1.8)), 1, 1e-6);
    pal_configuration other = s->point[0].measured.configuration;
    snprintf(other.model, PAL_NAME, "tet_springs");
    CHECK(!pal_study_predict_error(s, &other, -1, &error_m));
    other = s->point[0].measured.configuration;
    snprintf(other.element, PAL_NAME, "tet10");
    CHECK(!pal_study_predict_error(s, &other, -1, &error_m));
    free(s);
}

/* what a step takes beside its nodes, what a node takes in a sub-step and what an element or a solver adds come out
 * whatever the nodes and sub-steps are; nothing is taken of the point that is left out */
static void costs_proportional_to_the_count_are_predicted_exactly(void)
{
    const double own_s[] = {1.0 / 60, 1.0 / 240}, overhead = 0.1, node = 60e-6;
    pal_study *s = new_study();
    s->step_s = 1.0 / 120;
    uint64_t state = 5;
    for (int i = 0; i < 40; i++) {
        pal_study_point *p = put(s, "", 8 + i % 9, 0, 1e-3);
        snprintf(p->measured.configuration.model, PAL_NAME, "tet_springs");
        p->measured.configuration.step_s = own_s[i % 2];
        p->n_node = 100 + (int)(3000 * random_unit(&state)), p->n_substep = 1 + (int)(60 * random_unit(&state));
        p->measured.ms = (overhead + node * p->n_node * p->n_substep) * s->step_s / own_s[i % 2];
    }
    double ms;
    s->point[7].measured.ms *= 5;
    for (int k = 0; k < 20; k++) {
        int nodes = 50 + 400 * k, substeps = 1 + 7 * k;
        pal_configuration at = s->point[k % 2].measured.configuration;
        s->point[8].err = PAL_ERR_FROZEN;
        CHECK(pal_study_predict_cost(s, &at, nodes, 0, substeps, 0, 7, &ms));
        CHECK_NEAR(ms / ((overhead + node * nodes * substeps) * s->step_s / at.step_s), 1, 1e-4);
    }
    pal_configuration at = s->point[0].measured.configuration;
    CHECK(!pal_study_predict_cost(s, &at, 0, 0, 3, 0, -1, &ms) &&
          !pal_study_predict_cost(s, &at, 300, 0, 0, 0, -1, &ms));
    snprintf(at.element, PAL_NAME, "tet10");
    CHECK(!pal_study_predict_cost(s, &at, 300, 0, 3, 0, -1, &ms));
    snprintf(at.model, PAL_NAME, "fem");
    CHECK(!pal_study_predict_cost(s, &at, 300, 0, 3, 0, -1, &ms));
    free(s);
}

/* a slender body has half as many elements to a node as a stout one, and exact tangents go with the elements alone */
static void steps_go_with_elements_where_they_are_counted(void)
{
    const double element = 300e-6, tangent = 1200e-6, to_a_node[] = {0.4, 0.55, 0.6, 0.7, 0.78};
    pal_study *s = new_study();
    s->step_s = 1.0 / 60;
    for (int i = 0; i < 20; i++) {
        int k = i / 2 % 5;
        bool neo = i % 2;
        pal_study_point *p = put(s, "hex8_bbar", 16 + i / 10 + 8 * k, 0, 1e-3);
        snprintf(p->measured.configuration.law, PAL_NAME, neo ? "neo_hookean" : "corotational");
        p->n_node = 150 << k, p->n_substep = 1, p->n_element = to_a_node[k] * p->n_node;
        p->measured.ms = (element + (neo ? tangent : 0)) * p->n_element;
    }
    for (int left_out = 0; left_out < 20; left_out++) {
        const pal_study_point *p = &s->point[left_out];
        double ms, twice;
        CHECK(pal_study_predict_cost(s, &p->measured.configuration, p->n_node, p->n_element, 1, 0, left_out, &ms));
        CHECK_NEAR(ms / p->measured.ms, 1, 0.02);
        CHECK(
            pal_study_predict_cost(s, &p->measured.configuration, p->n_node, 2 * p->n_element, 1, 0, left_out, &twice));
        CHECK_NEAR(twice / ms, 2, 0.1);
    }
    free(s);
}

/* of a surface that adapts the nodes of the other levels say how much is refined, its own are not looked at */
static void how_much_is_refined_is_seen_of_other_levels(void)
{
    pal_study *s = new_study();
    s->step_s = 1.0 / 60;
    /* 190 nodes, 766, 3070 refined; a tenth of what there is to refine is */
    const int size[] = {1, 2, 2, 3, 3}, nodes[] = {190, 248, 766, 478, 3070};
    for (int i = 0; i < 5; i++) {
        pal_study_point *p = put(s, i == 2 || i == 4 ? "refined" : "", size[i], 1e-4 * nodes[i] * (6 << size[i]), 1e-3);
        snprintf(p->measured.configuration.model, PAL_NAME, "adaptive_springs");
        p->n_node = nodes[i], p->n_substep = 6 << size[i];
    }
    double ms;
    for (int i = 0; i < 5; i++)
        for (int reported = 100; reported < 5000; reported += 2000) {
            bool is_adaptive = i == 1 || i == 3;
            const pal_study_point *p = &s->point[i];
            CHECK(pal_study_predict_cost(s, &p->measured.configuration, is_adaptive ? reported : p->n_node, 0,
                                         is_adaptive ? reported / 100 : p->n_substep, 0, i, &ms));
            CHECK_NEAR(ms / p->measured.ms, 1, 0.01);
        }
    s->point[3].err = PAL_ERR_FROZEN;
    CHECK(!pal_study_predict_cost(s, &s->point[1].measured.configuration, 248, 0, 24, 0, 1, &ms));
    free(s);
}

/* ---- a beam ---- */

/* The processor's clock of a thread counts work: a step takes 20 us, and 60 ns for each point in each sub-step. So
 * costs are those of a study on a machine that does nothing else */
static _Thread_local uint64_t work_ns;
uint64_t __wrap_pal_clock_thread_ns(void);
uint64_t __wrap_pal_clock_thread_ns(void)
{
    return work_ns;
}

pal_err __real_pal_world_step(pal_world *world, double dt_s);
pal_err __wrap_pal_world_step(pal_world *world, double dt_s);
pal_err __wrap_pal_world_step(pal_world *world, double dt_s)
{
    const pal_err err = __real_pal_world_step(world, dt_s);
    work_ns += 20000 + 60 * (uint64_t)(pal_world_body(world, 0)->n_active * pal_world_substeps(world));
    return err;
}

typedef struct calls {
    int n_done, n_reference, max;
} calls;

static bool count_done(const pal_study *study, int n_total, void *user)
{
    calls *c = user;
    c->n_done++;
    CHECK(study->n_point <= n_total);
    return c->max == 0 || study->n_point < c->max;
}

static bool count_progress(const char *what, double fraction, void *user)
{
    calls *c = user;
    CHECK(fraction >= 0 && fraction <= 1);
    c->n_reference += !strncmp(what, "reference", 9);
    return true;
}

/* largest distance between two solves at the beam's corners, which are all the vertices that a study picks */
static double between(const pal_problem *p, const pal_surface *beam, int size, int other)
{
    pal_solution *s[2] = {NULL, NULL};
    pal_diagnostic diag = {{0}};
    double max = 0;
    for (int k = 0; k < 2; k++) {
        pal_solve_result r;
        pal_solve_options o = {.element = "hex8_bbar",
                               .law = "corotational",
                               .voxel.resolution = k ? other : size,
                               .voxel.fill = true,
                               .voxel.align = true,
                               .twist = 1, /* as a live body */
                               .young_Pa = NAN,
                               .poisson = NAN};
        if (pal_solve(p, &p->load_case[0], beam, &o, &s[k], &r, &diag)) CHECK_FAIL("%s", diag.text);
    }
    for (int i = 0; i < beam->n_vertex && s[0] && s[1]; i++) {
        double x[3], u[2][3];
        pal_add3(x, beam->x + 3 * i, beam->origin_m);
        for (int k = 0; k < 2; k++) pal_solution_at(s[k], x, u[k]);
        max = fmax(max, pal_dist3(u[0], u[1]));
    }
    pal_solution_free(s[0]);
    pal_solution_free(s[1]);
    return max;
}

static void check_errors(const pal_study *s, const pal_problem *p, const pal_surface *beam)
{
    int reference = 0, n_found = 0;
    const char *at = strstr(s->reference, ", ");
    if (at) reference = (int)strtol(at + 2, NULL, 10);
    CHECK_INT(reference, 40);
    for (int i = 0; i < s->n_point; i++) {
        const pal_configuration *q = &s->point[i].measured.configuration;
        bool base = !strcmp(q->element, "hex8_bbar") && !strcmp(q->solver, "implicit_euler") && q->step_s > 0.016;
        if (!base) continue;
        double solved = between(p, beam, q->size, reference);
        CHECK_NEAR(s->point[i].static_max_m, solved, 0.01 * solved);
        n_found++;
    }
    CHECK_INT(n_found, 2);
}

static void check_points(const pal_study *s)
{
    double best[2] = {INFINITY, INFINITY};
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *p = &s->point[i];
        CHECK(!p->err && p->measured.ms > 0 && p->ms_p95 >= p->measured.ms && p->n_node > 0 && p->prepare_s > 0);
        CHECK(p->measured.error_m == fmax(p->static_max_m, p->trajectory_max_m) && p->static_rms_m <= p->static_max_m);
        bool fitted = p->measured.configuration.k_distance_J > 0;
        if (!strcmp(p->measured.configuration.model, "tet_springs")) best[fitted] = fmin(best[fitted], p->static_max_m);
    }
    /* calibration is what springs are worth something by: at rest from 18 % to a per mille of the tip's way */
    CHECK(best[0] > 0.1 * s->max_m && best[1] < 0.005 * s->max_m);
    CHECK(s->reference_m > 0 && s->reference_m < 0.02 * s->max_m);
    CHECK(s->max_m > 0.009 && s->max_m < 0.012 && s->step_s > 0 && s->machine[0]);
}

/* each point by the others: costs are 0.66 to 0.93 of the work that is counted, of so few points */
static void check_predicted(const pal_study *s)
{
    int n = 0, n_cost = 0;
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *p = &s->point[i];
        n_cost += isfinite(p->predicted_ms);
        CHECK(isnan(p->predicted_ms) || fabs(p->predicted_ms / p->measured.ms - 1) < 0.5);
        /* a step that none other is near: what it costs is told by what is counted, what it leaves is not known */
        if (!isfinite(p->predicted_m)) continue;
        CHECK(p->predicted_m < 5 * p->measured.error_m && p->predicted_m > p->measured.error_m / 5);
        n++;
    }
    CHECK(n >= 2 && n_cost > n);
    /* between the two sizes that were measured: errors between theirs, within a third */
    pal_configuration between = s->point[0].measured.configuration, last = between;
    double error_m, low = s->point[0].measured.error_m, high = low;
    for (int i = 0; i < s->n_point; i++) {
        last.size = s->point[i].measured.configuration.size;
        if (!pal_configuration_equal(&last, &s->point[i].measured.configuration)) continue;
        low = fmin(low, s->point[i].measured.error_m), high = fmax(high, s->point[i].measured.error_m);
    }
    between.size = 20;
    CHECK(pal_study_predict_error(s, &between, -1, &error_m));
    CHECK(error_m > low / 1.33 && error_m < high * 1.33);
}

/* what is known is taken over; what is not comes out the same but for its time */
static void check_resumed(const pal_study *s, const pal_problem *p, const pal_surface *beam)
{
    pal_study *again = new_study(), *part = new_study();
    pal_diagnostic diag = {{0}};
    calls c = {0};
    pal_study_options o = {
        .quick = 1, .seconds = 0.1, .before = s, .done = count_done, .progress = count_progress, .user = &c};
    CHECK(!pal_study_problem(p, &p->load_case[0], beam, &o, again, &diag));
    CHECK_INT(c.n_reference, 0);
    CHECK_INT(c.n_done, s->n_point);
    CHECK(!memcmp(again->point, s->point, sizeof s->point) && again->reference_m == s->reference_m);
    c = (calls){.max = 2};
    o.before = NULL;
    CHECK(pal_study_problem(p, &p->load_case[0], beam, &o, part, &diag) == PAL_ERR_STATE);
    CHECK_INT(part->n_point, 2);
    CHECK_INT(c.n_done, 2);
    for (int i = 0; i < 2; i++) {
        CHECK_NEAR(part->point[i].measured.error_m, s->point[i].measured.error_m, 1e-12);
        CHECK_INT(part->point[i].n_substep, s->point[i].n_substep);
    }
    free(again);
    free(part);
}

static void a_beam_is_swept_and_taken_up_again(void)
{
    pal_surface beam;
    pal_problem *p = malloc(sizeof *p);
    pal_study *s = new_study();
    pal_diagnostic diag = {{0}};
    REQUIRE(p && make_beam(&beam, p));
    pal_study_options o = {.quick = 1, .seconds = 0.1};
    pal_err err = pal_study_problem(p, &p->load_case[0], &beam, &o, s, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    CHECK_INT(s->n_point, 7);
    check_points(s);
    check_errors(s, p, &beam);
    check_predicted(s);
    check_resumed(s, p, &beam);
    pal_surface_free(&beam);
    free(p);
    free(s);
}

/* nu 0.4999 and samples of another solve in place of the reference */
static void nearly_incompressible_and_against_samples(void)
{
    static const char *const method[] = {"fem"};
    pal_surface beam;
    pal_problem *p = malloc(sizeof *p);
    pal_study *s = new_study();
    pal_solution *solution = NULL;
    pal_solve_result r;
    pal_diagnostic diag = {{0}};
    REQUIRE(p && make_beam(&beam, p));
    p->material[0].poisson = 0.4999;
    pal_solve_options solve = {.element = "hex8_bbar",
                               .law = "corotational",
                               .voxel.resolution = 32,
                               .voxel.fill = true,
                               .voxel.align = true,
                               .young_Pa = NAN,
                               .poisson = NAN};
    REQUIRE(!pal_solve(p, &p->load_case[0], &beam, &solve, &solution, &r, &diag));
    double x[2][3] = {{1.32, 0.02, 0.02}, {1.16, 0.02, 0.02}}, u[2][3];
    for (int i = 0; i < 2; i++) pal_solution_at(solution, x[i], u[i]);
    const pal_samples samples = {2, x[0], u[0]};
    pal_study_options o = {.quick = 1, .seconds = 0.1, .method = method, .n_method = 1, .samples = &samples};
    pal_err err = pal_study_problem(p, &p->load_case[0], &beam, &o, s, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    CHECK_NEAR(s->max_m, pal_norm3(u[0]), 1e-9);
    CHECK(s->n_point > 3 && s->reference_m == 0 && strstr(s->reference, "given"));
    for (int i = 0; i < s->n_point; i++) {
        const pal_study_point *q = &s->point[i];
        bool locks = !strcmp(q->measured.configuration.element, "tet4");
        CHECK(!q->err);
        CHECK(locks ? q->static_max_m > 0.2 * s->max_m : q->static_max_m < 0.05 * s->max_m);
    }
    pal_solution_free(solution);
    pal_surface_free(&beam);
    free(p);
    free(s);
}

static void problems_that_no_live_body_can_be_are_refused(void)
{
    pal_surface beam;
    pal_problem *p = malloc(sizeof *p);
    pal_study *s = new_study();
    pal_diagnostic diag = {{0}};
    pal_study_options o = {.quick = 1};
    REQUIRE(p && make_beam(&beam, p));
    p->support[0].moved = true, p->support[0].move_m[0] = 0.01;
    CHECK(pal_study_problem(p, &p->load_case[0], &beam, &o, s, &diag) == PAL_ERR_REFUSED && strstr(diag.text, "moves"));
    p->support[0].moved = false, p->load_case[0].load[0].region.low_m[0] = 1.5;
    CHECK(pal_study_problem(p, &p->load_case[0], &beam, &o, s, &diag) == PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "meets no surface"));
    p->n_support = 0;
    CHECK(pal_study_problem(p, &p->load_case[0], &beam, &o, s, &diag) == PAL_ERR_REFUSED && strstr(diag.text, "held"));
    p->load_case[0].n_load = 0;
    CHECK(pal_study_problem(p, &p->load_case[0], &beam, &o, s, &diag) == PAL_ERR_REFUSED && strstr(diag.text, "load"));
    pal_surface_free(&beam);
    free(p);
    free(s);
}

int main(void)
{
    RUN(the_front_is_what_nothing_beats);
    RUN(a_pick_is_the_best_of_all);
    RUN(the_reference_bounds_what_is_named);
    RUN(power_laws_are_predicted_exactly);
    RUN(costs_proportional_to_the_count_are_predicted_exactly);
    RUN(steps_go_with_elements_where_they_are_counted);
    RUN(how_much_is_refined_is_seen_of_other_levels);
    RUN(a_beam_is_swept_and_taken_up_again);
    RUN_LONG(nearly_incompressible_and_against_samples);
    RUN(problems_that_no_live_body_can_be_are_refused);
    return check_report();
}
