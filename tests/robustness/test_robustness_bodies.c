/* Several bodies in one world under disturbances: one is stopped alone, the others run on bit by bit as in a world in
 * which nothing happened. All bodies share the world's sub-steps: where the one that is stopped was the one that asked
 * for more, the others go on in longer ones, near what they were. Bodies do not touch. */
#include "server/robustness/robustness.h"
#include "tests/fixtures/adaptive_worlds.h"
#include "tests/fixtures/fem_beam.h"

enum { STEPS = 12, AT = 4 };

static pal_diagnostic diag;

/* two beams of fem and one of springs, or three of springs, at one place: bodies do not meet each other */
static void three_make(fem_beam *b, bool springs)
{
    beam_make(b, 5, 2, 2, 0.01, true);
    b->scene->n_body = 3;
    b->def->material.damping_1_s = 20;
    pal_entry_init(&b->def->effect[b->def->n_effect++], "effects[0]", "finite_guard");
    if (springs) {
        pal_entry_init(&b->def->model, "model", "tet_springs");
        pal_entry_init(&b->def->solver, "solver", "verlet");
    }
    for (int k = 1; k < 3; k++) b->scene->body[k] = b->scene->body[0];
    strcpy(b->scene->body[1].name, "second");
    strcpy(b->scene->body[2].name, "springs");
    pal_entry_init(&b->scene->body[2].model, "model", "tet_springs");
    pal_entry_init(&b->scene->body[2].solver, "solver", "verlet");
    REQUIRE(!beam_open(b, &diag));
    for (int k = 0; k < 3; k++) {
        pal_body *body = pal_world_body(b->world, k);
        for (int i = 0; i < body->n_dof; i++)
            if (!body->support[i]) body->v[3 * i + 2] = 0.2 * body->x[3 * i] / b->length_m;
    }
}

/* what is done to the body `which` before step AT */
typedef void disturbance(pal_world *world, int which);

static void poison(pal_world *world, int which)
{
    pal_world_body(world, which)->v[0] = NAN;
}
/* farther than finite_guard allows */
static void throw_away(pal_world *world, int which)
{
    pal_body *body = pal_world_body(world, which);
    for (int i = 0; i < body->n_dof; i++)
        if (!body->support[i]) body->x[3 * i] += 100 * body->length_scale_m;
    pal_world_invalidate_limits(world, which);
}

static bool same_bits(const pal_body *a, const pal_body *b)
{
    size_t n_byte = 3 * sizeof(double) * (size_t)a->n_dof;
    return !memcmp(a->x, b->x, n_byte) && !memcmp(a->v, b->v, n_byte);
}

/* RMS over S */
static double apart(const pal_body *a, const pal_body *b)
{
    double sum = 0;
    for (int i = 0; i < 3 * a->n_dof; i++) sum += (a->x[i] - b->x[i]) * (a->x[i] - b->x[i]);
    return sqrt(sum / a->n_dof) / a->length_scale_m;
}

/* the others of a step: how many are what they are without the disturbance, and how far off the worst one is */
static int others(const fem_beam *hurt, const fem_beam *reference, int which, double *max_S)
{
    int n = 0;
    for (int k = 0; k < 3; k++) {
        const pal_body *a = pal_world_body(hurt->world, k), *b = pal_world_body(reference->world, k);
        if (k == which) continue;
        n += same_bits(a, b);
        *max_S = fmax(*max_S, apart(a, b));
    }
    return n;
}

/* the body is stopped and says why, the others run on, and it alone is reset */
static void stop_one(disturbance *what, int which, bool springs, bool shared)
{
    fem_beam hurt, reference;
    int n_same = 0, n_step = STEPS + 3;
    double max_S = 0;
    three_make(&hurt, springs);
    three_make(&reference, springs);
    const pal_body *stopped = pal_world_body(hurt.world, which);
    for (int i = 0; i < n_step; i++) {
        if (i == AT) what(hurt.world, which);
        (void)pal_world_step(hurt.world, hurt.scene->step_s);
        CHECK(!pal_world_step(reference.world, reference.scene->step_s));
        n_same += others(&hurt, &reference, which, &max_S);
        if (i != STEPS) continue;
        CHECK(stopped->frozen && stopped->reason[0] && stopped->safeguards.n_stopped == 1 && pal_body_finite(stopped));
        for (int k = 0; k < 3; k++) CHECK(pal_world_body(hurt.world, k)->frozen == (k == which));
        printf("  %s: %s\n", stopped->name, stopped->reason);
        CHECK(!pal_world_reset_body(hurt.world, which) && !stopped->frozen);
    }
    printf("  %d of %d states of the others the same, %g S apart at most\n", n_same, 2 * n_step, max_S);
    CHECK(!stopped->frozen && (shared ? max_S < 0.02 : n_same == 2 * n_step));
    for (int k = 0; k < 3; k++) CHECK(pal_body_finite(pal_world_body(hurt.world, k)));
    beam_free(&hurt);
    beam_free(&reference);
}

/* only the springs limit the sub-step of the three */
static void stop_each(disturbance *what)
{
    for (int which = 0; which < 3; which++) stop_one(what, which, false, which == 2);
}

static void a_poisoned_body_stops_alone(void)
{
    stop_each(poison);
    for (int which = 0; which < 3; which++) stop_one(poison, which, true, false);
}

static void a_body_out_of_bounds_stops_alone(void)
{
    stop_each(throw_away);
}

static void disturbed_together_each_is_judged(void)
{
    static const char *const case_name[] = {"poisoned", "meganewton"};
    fem_beam b;
    three_make(&b, false);
    b.scene->n_body = 2;
    for (size_t k = 0; k < sizeof case_name / sizeof case_name[0]; k++) {
        pal_robustness_options options;
        static pal_robustness_report report;
        pal_robustness_default(&options);
        options.only = case_name[k];
        REQUIRE(!pal_robustness_run(b.scene, &options, &report, &diag));
        printf("  %s: %s, %s\n", case_name[k], pal_verdict_name(report.result[0].verdict), report.result[0].diag);
        CHECK(report.n == 1 && report.count[PAL_VERDICT_PASSED] == 1);
    }
    beam_free(&b);
}

/* under its capped load an adaptive ball comes to rest and falls asleep: let go, it has to be awake to come back */
static void what_sleeps_under_a_meganewton_is_let_go(void)
{
    shell_scene s;
    pal_surface ball;
    pal_robustness_options options;
    static pal_robustness_report report;
    REQUIRE(!pal_sphere_make(0.05, &ball));
    shell_scene_take(&s, &ball);
    shell_scene_hold(&s, (const double[3]){-1, -1, -1}, (const double[3]){1, 1, -0.04});
    s.scene->body[0].material.damping_1_s = 20;
    pal_entry_put_number(shell_scene_effect(&s, "sleep"), "rest_time_s", 0.1, NULL);
    pal_robustness_default(&options);
    options.only = "meganewton";
    REQUIRE(!pal_robustness_run(s.scene, &options, &report, &diag));
    const pal_robustness_result *r = &report.result[0];
    printf("  %s, %s\n", pal_verdict_name(r->verdict), r->diag);
    CHECK_INT(report.count[PAL_VERDICT_PASSED], 1);
    CHECK_LE(r->deviation_S, 1e-3);
    CHECK(strstr(r->diag, "S away in RMS"));
    shell_scene_close(&s);
}

int main(void)
{
    RUN_LONG(a_poisoned_body_stops_alone);
    RUN(a_body_out_of_bounds_stops_alone);
    RUN(disturbed_together_each_is_judged);
    RUN(what_sleeps_under_a_meganewton_is_let_go);
    return check_report();
}
