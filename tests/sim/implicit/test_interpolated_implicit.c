/* Implicit solvers on bodies whose nodes are carried by control points (body.h, embed): a step against dense algebra,
 * what is conserved, what may only fall, long steps, rest, supports, statics, and edits of the material. */
#include "tests/fixtures/interpolated_body.h"
#include "tests/heap_calls.h"

/* ---- dense algebra ---- */

typedef struct dense {
    int n;
    double *a, *b;
} dense;

/* a = mass M + stiff K of points, K from the springs one by one; rows and columns of held points 1 */
static void make_dense(dense *m, const thing *t, double mass, double stiff)
{
    const pal_body *body = &t->body;
    int n = m->n = 3 * body->n_dof;
    m->a = calloc((size_t)n * (size_t)n, sizeof(double));
    m->b = calloc((size_t)n, sizeof(double));
    double *unit = calloc((size_t)n, sizeof(double)), *column = calloc((size_t)n, sizeof(double));
    for (int j = 0; j < n; j++) {
        memset(unit, 0, sizeof(double) * (size_t)n);
        unit[j] = 1;
        multiply_mass(t, unit, column);
        for (int i = 0; i < n; i++) m->a[i * n + j] = mass * column[i];
    }
    for (int s = 0; s < t->springs->n; s++) {
        memset(unit, 0, sizeof(double) * (size_t)n);
        for (int side = 0; side < 2; side++) {
            int32_t node = t->springs->pair[s][side];
            for (int32_t k = body->interpolation->start[node]; k < body->interpolation->start[node + 1]; k++)
                pal_axpy3(unit + 3 * body->interpolation->point[k], (side ? 1 : -1) * body->interpolation->weight[k],
                          t->springs->line[s]);
        }
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n && unit[i] != 0; j++)
                m->a[i * n + j] += stiff * t->springs->k_N_m * unit[i] * unit[j];
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            if (body->support[i / 3] || body->support[j / 3]) m->a[i * n + j] = i == j;
    free(unit), free(column);
}

/* b = a^-1 b by Gauss; a is lost */
static void solve_dense(dense *m)
{
    int n = m->n;
    for (int k = 0; k < n; k++)
        for (int i = k + 1; i < n; i++) {
            double factor = m->a[i * n + k] / m->a[k * n + k];
            if (factor == 0) continue;
            for (int j = k; j < n; j++) m->a[i * n + j] -= factor * m->a[k * n + j];
            m->b[i] -= factor * m->b[k];
        }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) m->b[i] -= m->a[i * n + j] * m->b[j];
        m->b[i] /= m->a[i * n + i];
    }
}

static void free_dense(dense *m)
{
    free(m->a), free(m->b);
}

/* forces on points at the present places, N [n_dof][3] */
static void find_forces(thing *t, double *out)
{
    pal_body *body = &t->body;
    pal_step step = {.body = body};
    pal_body_update_nodes(body);
    memcpy(body->f, body->load, 3 * sizeof(double) * (size_t)body->n_node);
    springs_run(t->springs, &step);
    memset(out, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    pal_interpolation_apply_transpose(body->interpolation, body->f, out);
    for (int i = 0; i < 3 * body->n_dof; i++)
        if (body->support[i / 3]) out[i] = 0;
}

static double max_difference(const double *a, const double *b, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, fabs(a[i] - b[i]));
    return max;
}

/* velocities by dense algebra: of the stage (M (V - vs) = tau (f(xs + tau V) - c M V)), the body being at xs */
static void solve_stage(thing *t, double tau, double rate, const double *vs, double *out)
{
    dense m;
    make_dense(&m, t, 1 + tau * rate, tau * tau);
    double *f = malloc(sizeof(double) * (size_t)m.n), *q = malloc(sizeof(double) * (size_t)m.n);
    find_forces(t, f);
    multiply_mass(t, vs, q);
    for (int i = 0; i < m.n; i++) m.b[i] = t->body.support[i / 3] ? 0 : q[i] + tau * f[i];
    solve_dense(&m);
    memcpy(out, m.b, sizeof(double) * (size_t)m.n);
    free(f), free(q);
    free_dense(&m);
}

static void a_step_is_that_of_dense_algebra(void)
{
    for (int form = 0; form < 8; form++) {
        thing t;
        bool between = form & 1, fixed = form & 2, drags = form & 4;
        REQUIRE(make_thing(&t, 2, 2, 2, true, between));
        if (fixed) CHECK_INT(hold_floor(&t), 9);
        if (drags) REQUIRE(add_drag(&t, 30));
        if (form == 3) t.row[0].effect = &silent_springs;
        load_top(&t, 2);
        shake(&t, 2e-3, 0.2);
        int n = 3 * t.body.n_dof;
        double *v = malloc(sizeof(double) * (size_t)n), *x = malloc(sizeof(double) * (size_t)n);
        solve_stage(&t, t.dt_s, drags ? 30 : 0, t.body.v, v);
        for (int i = 0; i < n; i++) x[i] = t.body.x[i] + t.dt_s * v[i];
        pal_entry_put_number(&t.item, "tolerance", 1e-13, NULL);
        REQUIRE(add_solver(&t, &pal_effect_implicit_euler, "iterations", 1000));
        REQUIRE(go(&t));
        CHECK_LE(max_difference(t.body.v, v, n), 1e-8 * 0.2);
        CHECK_LE(max_difference(t.body.x, x, n), 1e-8 * 2e-3);
        CHECK(report_of(&t).converged);
        /* the factor is of this very matrix: as exact as single precision */
        CHECK_LE(report_of(&t).n_cg, 4);
        free(v), free(x);
        free_thing(&t);
    }
}

static void a_step_of_two_stages_is_that_of_dense_algebra(void)
{
    const double g = 1 - sqrt(0.5);
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 2, true, true));
    hold_floor(&t);
    load_top(&t, 2);
    shake(&t, 2e-3, 0.2);
    size_t n = 3 * (size_t)t.body.n_dof;
    double *keep = malloc(5 * n * sizeof(double)), *x0 = keep, *v0 = x0 + n, *v1 = v0 + n, *vs = v1 + n, *v2 = vs + n;
    memcpy(x0, t.body.x, n * sizeof(double)), memcpy(v0, t.body.v, n * sizeof(double));
    solve_stage(&t, g * t.dt_s, 0, v0, v1);
    for (size_t i = 0; i < n; i++) {
        vs[i] = v0[i] + (1 - g) / g * (v1[i] - v0[i]);
        t.body.x[i] = x0[i] + (1 - g) * t.dt_s * v1[i];
    }
    solve_stage(&t, g * t.dt_s, 0, vs, v2);
    memcpy(t.body.x, x0, n * sizeof(double)), memcpy(t.body.v, v0, n * sizeof(double));
    pal_entry_put_number(&t.item, "tolerance", 1e-13, NULL);
    REQUIRE(add_solver(&t, &pal_effect_sdirk2, "iterations", 1000));
    REQUIRE(go(&t));
    CHECK_LE(max_difference(t.body.v, v2, (int)n), 1e-8 * 0.2);
    free(keep);
    free_thing(&t);
}

static void rest_stays_rest_to_the_bit(void)
{
    for (int between = 0; between < 2; between++) {
        thing t;
        REQUIRE(make_thing(&t, 2, 2, 2, false, between));
        REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
        bool still = true;
        for (int i = 0; i < 20 && still; i++) {
            REQUIRE(go(&t));
            for (int k = 0; k < 3 * t.body.n_dof; k++) still &= t.body.v[k] == 0 && t.body.x[k] == t.body.x_rest[k];
        }
        CHECK(still);
        free_thing(&t);
    }
}

static void momentum_of(const thing *t, double out[3])
{
    double *q = malloc(3 * sizeof(double) * (size_t)t->body.n_dof);
    multiply_mass(t, t->body.v, q);
    pal_set3(out, 0, 0, 0);
    for (int i = 0; i < t->body.n_dof; i++) pal_add3(out, out, q + 3 * i);
    free(q);
}

static void a_free_body_keeps_its_momentum(void)
{
    static const pal_effect *const solver[] = {&pal_effect_implicit_euler, &pal_effect_sdirk2};
    for (int form = 0; form < 4; form++) {
        thing t;
        double before[3], after[3];
        REQUIRE(make_thing(&t, 3, 2, 2, false, form & 1));
        shake(&t, 5e-3, 0.5);
        for (int i = 0; i < t.body.n_dof; i++) t.body.v[3 * i] += 1;
        REQUIRE(add_solver(&t, solver[form / 2], NULL, 0));
        momentum_of(&t, before);
        for (int i = 0; i < 100; i++) REQUIRE(go(&t));
        momentum_of(&t, after);
        CHECK_LE(pal_dist3(before, after), 1e-10 * pal_norm3(before));
        free_thing(&t);
    }
}

static void steps_a_hundred_times_as_long_are_stable(void)
{
    for (int form = 0; form < 4; form++) {
        thing t;
        REQUIRE(make_thing(&t, 2, 2, 2, false, form & 1));
        if (form & 2) hold_floor(&t);
        shake(&t, 1.5e-2, 1);
        t.dt_s *= 100;
        REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
        double first = energy_J(&t), max = 0;
        for (int i = 0; i < 60; i++) {
            REQUIRE(go(&t));
            max = fmax(max, energy_J(&t));
        }
        CHECK_LE(max, first * (1 + 1e-6));
        /* of a body without supports the rigid motion is left */
        CHECK_LE(springs_energy(t.springs, &t.body), 1e-3 * first);
        free_thing(&t);
    }
}

static void energy_never_rises_under_a_constant_load(void)
{
    for (int form = 0; form < 4; form++) {
        thing t;
        REQUIRE(make_thing(&t, 2, 2, 3, false, form & 1));
        hold_floor(&t);
        if (form & 2) REQUIRE(add_drag(&t, 5));
        load_top(&t, 3);
        shake(&t, 2e-3, 0.3);
        REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
        double before = energy_J(&t) - work_J(&t), rise = 0, scale = energy_J(&t);
        for (int i = 0; i < 150; i++) {
            REQUIRE(go(&t));
            double now = energy_J(&t) - work_J(&t);
            rise = fmax(rise, now - before);
            scale = fmax(scale, fabs(work_J(&t)));
            before = now;
        }
        CHECK_LE(rise, 1e-6 * scale);
        CHECK(work_J(&t) > 0);
        free_thing(&t);
    }
}

static void the_end_is_that_of_dense_statics(void)
{
    static const pal_effect *const solver[] = {&pal_effect_implicit_euler, &pal_effect_sdirk2,
                                               &pal_effect_static_newton};
    for (int s = 0; s < 3; s++) {
        thing t;
        dense m;
        REQUIRE(make_thing(&t, 2, 2, 2, true, true));
        hold_floor(&t);
        load_top(&t, 3);
        make_dense(&m, &t, 0, 1);
        find_forces(&t, m.b);
        solve_dense(&m);
        double max = 0, wrong = 0;
        if (s < 2) t.dt_s = 10;
        REQUIRE(add_solver(&t, solver[s], NULL, 0));
        for (int i = 0; i < (s < 2 ? 40 : 1); i++) REQUIRE(go(&t));
        for (int i = 0; i < m.n; i++) {
            max = fmax(max, fabs(m.b[i]));
            wrong = fmax(wrong, fabs(t.body.x[i] - t.body.x_rest[i] - m.b[i]));
        }
        CHECK(max > 1e-3);
        CHECK_LE(wrong, 1e-6 * max);
        free_dense(&m);
        free_thing(&t);
    }
}

static void statics_of_springs_that_turn_leave_no_force(void)
{
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 4, false, true));
    hold_floor(&t);
    load_top(&t, 12);
    REQUIRE(add_solver(&t, &pal_effect_static_newton, "tolerance", 1e-9));
    REQUIRE(go(&t));
    int n = 3 * t.body.n_dof;
    double *f = malloc(sizeof(double) * (size_t)n), far = 0, left = 0;
    find_forces(&t, f);
    for (int i = 0; i < n; i++) left = fmax(left, fabs(f[i]));
    for (int i = 0; i < n; i++) far = fmax(far, fabs(t.body.x[i] - t.body.x_rest[i]));
    CHECK(report_of(&t).converged);
    CHECK(far > 0.02);
    CHECK_LE(left, 1e-6 * 12);
    /* nodes are where points carry them */
    double *d = malloc(3 * sizeof(double) * (size_t)t.body.n_node);
    pal_interpolation_apply(t.body.interpolation, t.body.x, d);
    CHECK_LE(max_difference(d, t.body.d, 3 * t.body.n_node), 0);
    free(f), free(d);
    free_thing(&t);
}

static void held_points_stay_and_led_ones_go_their_way(void)
{
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 2, false, true));
    int n = hold_floor(&t), n_right = 0, n_led = 0;
    for (int i = 0; i < t.body.n_dof; i++)
        if (t.body.x_rest[3 * i + 2] > 0.049) t.body.support[i] = PAL_PRESCRIBED, n_led++;
    load_top(&t, 3);
    REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
    for (int k = 0; k < 30; k++) {
        for (int i = 0; i < t.body.n_dof; i++)
            if (t.body.support[i] == PAL_PRESCRIBED) pal_set3(t.body.v + 3 * i, 0.01, 0, 0.02);
        REQUIRE(go(&t));
    }
    for (int i = 0; i < t.body.n_dof; i++) {
        double way[3], wanted[3] = {0.01 * 30 * t.dt_s, 0, 0.02 * 30 * t.dt_s};
        pal_sub3(way, t.body.x + 3 * i, t.body.x_rest + 3 * i);
        if (t.body.support[i] == PAL_FIXED) n_right += way[0] == 0 && way[1] == 0 && way[2] == 0;
        if (t.body.support[i] == PAL_PRESCRIBED) n_right += pal_dist3(way, wanted) < 1e-12;
    }
    CHECK_INT(n_right, n + n_led);
    CHECK_INT(n_led, 9);
    free_thing(&t);
}

static void a_step_calls_no_heap(void)
{
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 2, false, true));
    hold_floor(&t);
    load_top(&t, 3);
    pal_entry_put_number(&t.item, "newton", 3, NULL);
    REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
    n_heap_call = 0;
    for (int i = 0; i < 20; i++) {
        /* columns are found anew on the way, the last ones are not: then a spare thread factors */
        if (i == 5) t.body.model.solid->sampled++;
        counting = i < 12;
        bool went = go(&t);
        counting = false;
        REQUIRE(went);
    }
    CHECK_INT(n_heap_call, 0);
    free_thing(&t);
}

static void other_samples_bring_another_factor(void)
{
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 2, true, true));
    hold_floor(&t);
    load_top(&t, 3);
    t.row[0].effect = &silent_springs;
    REQUIRE(add_solver(&t, &pal_effect_implicit_euler, "tolerance", 1e-10));
    t.dt_s = t.scene->step_s;
    int at[4] = {0};
    for (int i = 0; i < 80; i++) {
        if (i == 10) t.springs->k_N_m *= 1000, t.body.model.solid->sampled++;
        REQUIRE(go(&t));
        if (i == 9) at[0] = report_of(&t).n_cg;
        if (i == 11) at[1] = report_of(&t).n_cg;
    }
    at[2] = report_of(&t).n_cg;
    printf("  iterations before, after an edit, with its factor: %d %d %d\n", at[0], at[1], at[2]);
    CHECK_INT(report_of(&t).n_factor, 2);
    CHECK_LE(at[0], 4);
    CHECK(at[1] > 10);
    CHECK_LE(at[2], 8);
    /* a reset brings the factor of load back at once */
    t.springs->k_N_m /= 1000, t.body.model.solid->sampled++;
    t.solve.effect->reset(t.solve.self, &t.body);
    CHECK_INT(report_of(&t).n_factor, 3);
    free_thing(&t);
}

static void what_cannot_be_is_refused_in_a_sentence(void)
{
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 2, true, true));
    CHECK(!add_solver(&t, &pal_effect_static_newton, NULL, 0));
    CHECK(strstr(diag.text, "fewer than three held nodes") != NULL);
    free_thing(&t);
    REQUIRE(make_thing(&t, 2, 2, 2, true, true));
    pal_entry_put_text(&t.item, "free", "inertia_relief", NULL);
    CHECK(!add_solver(&t, &pal_effect_static_newton, NULL, 0));
    CHECK(strstr(diag.text, "control points") != NULL);
    free_thing(&t);
    REQUIRE(make_thing(&t, 2, 2, 2, true, true));
    hold_floor(&t);
    pal_entry_put_text(&t.item, "linear", "direct", NULL);
    CHECK(!add_solver(&t, &pal_effect_static_newton, NULL, 0));
    CHECK(strstr(diag.text, "take \"pcg\"") != NULL);
    free_thing(&t);
}

/* 200 points that are coupled all with all, and 40,000 nodes */
static void a_matrix_of_too_much_work_is_refused(void)
{
    enum { POINTS = 200, NODES = 40000 };
    pal_interpolation rows = {.n_row = NODES, .n_point = POINTS};
    pal_arena *arena = pal_arena_create(1 << 20, true);
    pal_body body = {.name = "body"};
    pal_interpolated_system *e = NULL;
    const pal_component row = {.effect = &silent_springs};
    rows.start = calloc(NODES + 1, sizeof *rows.start);
    rows.point = calloc(NODES, sizeof *rows.point);
    rows.weight = calloc(NODES, sizeof *rows.weight);
    REQUIRE(arena && rows.start && rows.point && rows.weight);
    for (int i = 0; i < NODES; i++) rows.start[i + 1] = i + 1, rows.point[i] = i % POINTS, rows.weight[i] = 1;
    REQUIRE(!pal_body_allocate_interpolated(&body, arena, &rows));
    CHECK_INT(pal_interpolated_system_make(&body, &row, 1, arena, &diag, &e), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "200 control points by 600 or more products on 40000 nodes") != NULL);
    CHECK(e == NULL);
    pal_interpolation_free(&rows);
    pal_arena_destroy(arena);
}

static void a_state_that_is_no_number_freezes_the_body(void)
{
    thing t;
    REQUIRE(make_thing(&t, 2, 2, 2, false, true));
    hold_floor(&t);
    REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
    t.body.v[3 * 26] = NAN;
    CHECK(!go(&t));
    CHECK(t.body.frozen);
    free_thing(&t);
}

static void all_held_is_no_work(void)
{
    thing t;
    REQUIRE(make_thing(&t, 1, 1, 1, false, true));
    for (int i = 0; i < t.body.n_dof; i++) t.body.support[i] = PAL_FIXED;
    REQUIRE(add_solver(&t, &pal_effect_implicit_euler, NULL, 0));
    load_top(&t, 3);
    CHECK(go(&t));
    CHECK_LE(max_difference(t.body.x, t.body.x_rest, 3 * t.body.n_dof), 0);
    free_thing(&t);
}

int main(void)
{
    RUN(a_step_is_that_of_dense_algebra);
    RUN(a_step_of_two_stages_is_that_of_dense_algebra);
    RUN(rest_stays_rest_to_the_bit);
    RUN(a_free_body_keeps_its_momentum);
    RUN(steps_a_hundred_times_as_long_are_stable);
    RUN(energy_never_rises_under_a_constant_load);
    RUN(the_end_is_that_of_dense_statics);
    RUN(statics_of_springs_that_turn_leave_no_force);
    RUN(held_points_stay_and_led_ones_go_their_way);
    RUN(a_step_calls_no_heap);
    RUN(other_samples_bring_another_factor);
    RUN(what_cannot_be_is_refused_in_a_sentence);
    RUN(a_matrix_of_too_much_work_is_refused);
    RUN(a_state_that_is_no_number_freezes_the_body);
    RUN(all_held_is_no_work);
    return check_report();
}
