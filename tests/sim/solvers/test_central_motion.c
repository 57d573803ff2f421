/* Solver central_cg over many steps: what is conserved, rest, supports, drag, emergencies. */
#include "tests/check.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/subdivision_bodies.h"

/* n x n x n cells of 0.1 m in all after n_level levels, springs between corners */
static bool open_block(solid_world *w, int n, int n_level, bool linear)
{
    solid_block(&w->t, n, 0.1, 0.1);
    return solid_world_open(w, n_level, linear, 100);
}

static void add_drag(solid_world *w, double rate_1_s)
{
    pal_config_entry item;
    pal_build build = {.scene = &w->t.scene, .def = &w->t.def, .body = &w->t.body, .arena = w->t.arena};
    pal_entry_init(&item, "drag", "viscous");
    w->t.def.material.damping_1_s = rate_1_s;
    pal_component *row = &w->force[w->n_force++];
    row->effect = &pal_effect_viscous;
    if (row->effect->make(&item, &build, &row->self)) abort();
}

/* ---- conserved ---- */

/* v' M~ v / 2 between n and n + 1 plus u_n' K u_n+1 / 2 is what central differences keep of a linear body; the energy
 * itself goes to and fro about it by (omega dt)^2 of a mode */
static double kept_energy(solid_world *w, double dt)
{
    pal_body *b = &w->t.body;
    double sum = 0;
    solid_forces(w);
    solid_run(w, 1, dt);
    for (int i = 0; i < 3 * b->n_dof; i++) sum -= 0.5 * b->g[i] * (b->x[i] - b->x_rest[i]);
    return sum + pal_body_kinetic_J(b);
}

static void undamped_energy_stays_over_many_steps(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 1, 0, true));
    w.t.body.support[0] = w.t.body.support[1] = PAL_FIXED;
    const double dt = 0.5 * solid_limit(&w) / 0.9;
    solid_shake(&w, 0.1);
    const double before = kept_energy(&w, dt);
    double min = before, max = before;
    CHECK(before > 0);
    for (int i = 0; i < 100; i++) {
        solid_run(&w, CHECK_REPEATS(999, 99), dt);
        const double now = kept_energy(&w, dt);
        min = fmin(min, now), max = fmax(max, now);
    }
    CHECK_LE(max, before * (1 + 1e-9));
    CHECK_LE(before * (1 - 1e-9), min);
    solid_world_close(&w);
}

/* a slow mode's own energy, kinetic by the mean of the velocities round the point of time */
static double energy_now(solid_world *w, double dt)
{
    pal_body *b = &w->t.body;
    const int n = 3 * b->n_dof;
    double sum = 0, *v = malloc(sizeof *v * (size_t)n), *out = malloc(sizeof *out * (size_t)n);
    memcpy(v, b->v, sizeof *v * (size_t)n);
    solid_forces(w);
    for (int i = 0; i < n; i++) sum -= 0.5 * b->g[i] * (b->x[i] - b->x_rest[i]);
    solid_run(w, 1, dt);
    for (int i = 0; i < n; i++) v[i] = 0.5 * (v[i] + b->v[i]);
    pal_mass_operator_multiply(&w->t.mass, 1, 0, NULL, v, out);
    for (int i = 0; i < n; i++) sum += 0.5 * v[i] * out[i];
    free(v), free(out);
    return sum;
}

static void energy_of_a_bending_body_stays_within_a_percent(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 0, true));
    for (int i = 0; i < w.t.body.n_dof; i++) {
        w.t.body.support[i] = w.t.body.x_rest[3 * i + 2] < -0.03;
        w.t.body.x[3 * i] += w.t.body.support[i] ? 0 : 0.1 * (w.t.body.x_rest[3 * i + 2] + 0.05);
    }
    const double dt = 0.5 * solid_limit(&w) / 0.9;
    solid_run(&w, 1, dt);
    const double before = energy_now(&w, dt);
    for (int i = 0; i < 50; i++) {
        solid_run(&w, CHECK_REPEATS(400, 40), dt);
        CHECK_NEAR(energy_now(&w, dt) / before, 1, 0.01);
    }
    solid_world_close(&w);
}

/* of the control points with M~ between them, about the origin: sum of x_i x (M~ v)_i */
static void find_momenta(const solid_world *w, double linear[3], double angular[3])
{
    const pal_body *b = &w->t.body;
    double *p = malloc(3 * sizeof *p * (size_t)b->n_dof);
    pal_mass_operator_multiply(&w->t.mass, 1, 0, NULL, b->v, p);
    memset(linear, 0, 3 * sizeof *linear), memset(angular, 0, 3 * sizeof *angular);
    for (int i = 0; i < b->n_dof; i++) {
        const double *x = b->x + 3 * i, *q = p + 3 * i;
        for (int c = 0; c < 3; c++) {
            const int d = (c + 1) % 3, e = (c + 2) % 3;
            linear[c] += q[c];
            angular[c] += x[d] * q[e] - x[e] * q[d];
        }
    }
    free(p);
}

static void a_free_body_keeps_its_momentum_and_angular_momentum(void)
{
    for (int uneven = 0; uneven < 2; uneven++) {
        solid_world w;
        REQUIRE(open_block(&w, 2, 1, false));
        pal_body *b = &w.t.body;
        for (int i = 0; i < 3 * b->n_dof; i++) b->v[i] = 0.1 * (1 + (i % 3 == 1 ? 5 * b->x[i - 1] : 0));
        solid_shake(&w, 0.1);
        double p[2][3], l[2][3], summary[3];
        const double dt = 0.5 * solid_limit(&w);
        find_momenta(&w, p[0], l[0]);
        for (int i = 0; i < CHECK_REPEATS(500, 50); i++) {
            solid_run(&w, 1, dt);
            solid_run(&w, 1, uneven ? 0.6 * dt : dt);
        }
        find_momenta(&w, p[1], l[1]);
        body_momentum(b, summary);
        double swing = 0.1 * 0.01 * solid_mass_kg(w.t.solid);
        for (int c = 0; c < 3; c++) {
            CHECK_NEAR(p[1][c] / p[0][0], p[0][c] / p[0][0], 1e-10);
            CHECK_NEAR(summary[c] / p[0][0], p[1][c] / p[0][0], 1e-10);
            CHECK_NEAR(l[1][c] / swing, l[0][c] / swing, 1e-10);
        }
        solid_world_close(&w);
    }
}

static void rest_stays_rest_to_the_bit(void)
{
    for (int drag = 0; drag < 2; drag++) {
        solid_world w;
        REQUIRE(open_block(&w, 2, 2, false));
        if (drag) add_drag(&w, 4);
        w.t.body.support[3] = drag ? PAL_FIXED : PAL_FREE;
        double dt = solid_limit(&w);
        for (int i = 0; i < 50; i++) solid_run(&w, 1, dt * (1 + 0.5 * (i % 2)));
        CHECK(!memcmp(w.t.body.x, w.t.body.x_rest, 3 * sizeof(double) * (size_t)w.t.body.n_dof));
        for (int i = 0; i < 3 * w.t.body.n_dof; i++) CHECK(w.t.body.v[i] == 0);
        solid_world_close(&w);
    }
}

/* the same free fall of all points, whatever M~ couples */
static void constant_acceleration_is_exact(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, false));
    pal_body *b = &w.t.body;
    for (int i = 0; i < b->n_node; i++) b->load[3 * i + 2] = -9.81 * b->node_mass_kg[i];
    const double dt = 0.8 * solid_limit(&w);
    solid_run(&w, 100, dt);
    for (int i = 0; i < b->n_dof; i++) {
        CHECK_NEAR((b->x[3 * i + 2] - b->x_rest[3 * i + 2]) / (-0.5 * 9.81 * 1e4 * dt * dt), 1, 1e-9);
        CHECK_NEAR(b->x[3 * i], b->x_rest[3 * i], 1e-12);
    }
    solid_world_close(&w);
}

/* ---- supports ---- */

static void held_points_stand_and_led_ones_keep_their_velocity(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, false));
    pal_body *b = &w.t.body;
    b->support[5] = PAL_FIXED, b->support[9] = PAL_PRESCRIBED;
    for (int c = 0; c < 3; c++) b->v[15 + c] = 1, b->v[27 + c] = 0.01 * (c - 1);
    const double dt = 0.5 * solid_limit(&w);
    solid_run(&w, 50, dt);
    for (int c = 0; c < 3; c++) {
        CHECK(b->x[15 + c] == b->x_rest[15 + c] && b->v[15 + c] == 0);
        CHECK(b->v[27 + c] == 0.01 * (c - 1));
        CHECK_NEAR(b->x[27 + c] - b->x_rest[27 + c], 50 * dt * 0.01 * (c - 1), 1e-15);
    }
    CHECK(fabs(b->v[0]) > 0);
    solid_world_close(&w);
}

/* a body without stiffness whose face is shaken: M_ff a_f = -M_fl a_l, solved here by Gauss and Seidel */
static void led_points_pull_their_neighbours_by_the_mass_between_them(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 1, 0, true));
    w.springs.k_N_m = 0;
    pal_body *b = &w.t.body;
    const pal_mass_operator *m = &w.t.mass;
    double want[8] = {0};
    for (int i = 0; i < 4; i++) b->support[i] = PAL_PRESCRIBED, want[i] = 0.3;
    solid_run(&w, 2, 1e-3);
    for (int i = 0; i < 4; i++) b->v[3 * i] = 0.3;
    solid_run(&w, 1, 1e-3);
    for (int round = 0; round < 200; round++)
        for (int i = 4; i < 8; i++) {
            double sum = 0, own = 0;
            for (int k = m->start[i]; k < m->start[i + 1]; k++)
                *(m->point[k] == i ? &own : &sum) += m->mass_kg[k] * (m->point[k] == i ? 1 : want[m->point[k]]);
            want[i] = -sum / own;
        }
    CHECK_LE(want[4], -0.05);
    for (int i = 0; i < 8; i++) CHECK_NEAR(b->v[3 * i], want[i], 1e-12);
    solid_world_close(&w);
}

static void all_points_held_is_fine(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, false));
    memset(w.t.body.support, 1, (size_t)w.t.body.n_dof);
    CHECK(isinf(solid_limit(&w)));
    w.t.body.load[7] = 1e3;
    solid_run(&w, 10, 0.01);
    CHECK(!memcmp(w.t.body.x, w.t.body.x_rest, 3 * sizeof(double) * (size_t)w.t.body.n_dof));
    solid_world_close(&w);
}

/* ---- drag ---- */

/* v = f/(m r) whatever the sub-step, from a thousandth to a million times what the sub-step resolves */
static void huge_drag_creeps_monotonically(void)
{
    for (double rate = 1e2; rate < 1e11; rate *= 1e2) {
        solid_world w;
        REQUIRE(open_block(&w, 2, 1, false));
        add_drag(&w, rate);
        pal_body *b = &w.t.body;
        const double dt = 0.5 * solid_limit(&w);
        for (int i = 0; i < b->n_node; i++) b->load[3 * i + 1] = 2 * b->node_mass_kg[i];
        double last = b->x[1];
        for (int i = 0; i < 40; i++) {
            solid_run(&w, 1, dt);
            CHECK(b->x[1] >= last);
            last = b->x[1];
        }
        if (rate * dt > 2) CHECK_NEAR(b->v[1] / (2 / rate), 1, 1e-6);
        solid_world_close(&w);
    }
}

/* the samples' gamma in one half of the body, far beyond what the sub-step resolves, none in the other */
static void huge_damping_that_varies_is_stable(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, false));
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int i = 0; i < 64 * w.t.solid->elements.n[kind]; i++)
            w.t.solid->samples[kind].damping_1_s[i] = i % 128 < 64 ? 1e7f : 0;
    pal_subdivision_mass_fill(w.t.solid, &w.t.mass);
    REQUIRE(w.t.mass.damping_kg_s != NULL);
    solid_shake(&w, 0.2);
    const double dt = solid_limit(&w);
    double before = INFINITY, first = 0;
    for (int i = 0; i < 40; i++) {
        solid_run(&w, 10, dt);
        const double now = pal_body_kinetic_J(&w.t.body);
        if (i == 0) first = now;
        CHECK_LE(now, fmax(before, first) * 1.5);
        before = now;
    }
    pal_solve_report report;
    w.solve.effect->inspect.report(w.solve.self, &report);
    CHECK(report.converged);
    CHECK_LE(before, first);
    CHECK(pal_body_finite(&w.t.body));
    solid_world_close(&w);
}

/* ---- conjugate gradients ---- */

/* the same path whichever preconditioner; a factor of M~ leaves one iteration */
static void preconditioners_agree(void)
{
    double *path[2] = {NULL, NULL}, far = 0, moved = 0;
    int n = 0;
    for (int way = 0; way < 2; way++) {
        solid_world w;
        REQUIRE(open_block(&w, 2, 2, false));
        REQUIRE(!solid_solver(&w, 0, 1e-10, way ? "diagonal" : "factor"));
        solid_shake(&w, 0.2);
        const double dt = 2e-4;
        CHECK_LE(dt, solid_limit(&w));
        solid_run(&w, 100, dt);
        pal_solve_report report;
        w.solve.effect->inspect.report(w.solve.self, &report);
        CHECK(report.converged && report.residual <= 1e-10);
        if (way == 0) CHECK_INT(report.n_cg, 1);
        if (way == 1) CHECK_LE(report.n_cg, 60);
        CHECK((report.factor_nonzeros > 0) == (way == 0));
        n = 3 * w.t.body.n_dof;
        path[way] = malloc(sizeof(double) * (size_t)n);
        for (int i = 0; i < n; i++) path[way][i] = w.t.body.x[i] - w.t.body.x_rest[i];
        solid_world_close(&w);
    }
    for (int i = 0; i < n; i++) far = fmax(far, fabs(path[0][i] - path[1][i])), moved = fmax(moved, fabs(path[0][i]));
    CHECK_LE(far, 1e-7 * moved);
    free(path[0]), free(path[1]);
}

static void a_reset_body_moves_as_it_did_to_the_bit(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, false));
    pal_body *b = &w.t.body;
    const size_t n_byte = 3 * sizeof(double) * (size_t)b->n_dof;
    double *path = malloc(n_byte);
    for (int turn = 0; turn < 2; turn++) {
        memcpy(b->x, b->x_rest, n_byte);
        memset(b->v, 0, n_byte);
        w.solve.effect->reset(w.solve.self, b);
        b->load[40] = 0.5;
        for (int i = 0; i < 200; i++) solid_run(&w, 1, solid_limit(&w));
        if (turn == 0)
            memcpy(path, b->x, n_byte);
        else
            CHECK(!memcmp(path, b->x, n_byte));
    }
    CHECK(fabs(path[0] - b->x_rest[0]) > 0);
    free(path);
    solid_world_close(&w);
}

/* ---- emergencies ---- */

static void moves_are_clamped(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, false));
    pal_body *b = &w.t.body;
    b->load[0] = 1e9;
    b->v[31] = -1e9;
    solid_run(&w, 1, 1e-3);
    CHECK(pal_body_finite(b));
    CHECK_LE(1, (double)b->safeguards.n_clamped);
    for (int i = 0; i < b->n_dof; i++) {
        const double *x = b->x + 3 * i, *r = b->x_rest + 3 * i;
        CHECK_LE(sqrt(pow(x[0] - r[0], 2) + pow(x[1] - r[1], 2) + pow(x[2] - r[2], 2)),
                 0.2 * b->length_scale_m * (1 + 1e-12));
    }
    solid_world_close(&w);
}

/* sub-steps twenty times too long, free and in contact with a spring that asks for more than the body */
static void heavy_steps_stay_bounded(void)
{
    solid_world w;
    REQUIRE(open_block(&w, 2, 1, true));
    const double limit = solid_limit(&w);
    solid_shake(&w, 0.05);
    for (int i = 0; i < 500; i++) {
        pal_step step = solid_step(&w, 20 * limit);
        step.adds_mass = true;
        CHECK_INT(w.solve.effect->run(w.solve.self, &step), 0);
    }
    CHECK_INT(w.t.body.safeguards.n_clamped, 0);
    for (int i = 0; i < 3 * w.t.body.n_dof; i++)
        CHECK_LE(fabs(w.t.body.x[i] - w.t.body.x_rest[i]), 3 * w.t.body.edge_m);
    solid_world_close(&w);
}

static void a_state_that_is_no_number_has_no_limit(void)
{
    for (int kind = 0; kind < 3; kind++) {
        solid_world w;
        REQUIRE(open_block(&w, 2, 1, false));
        CHECK(solid_limit(&w) > 0);
        if (kind == 0) w.t.body.x[8] = NAN;
        if (kind == 1) w.t.body.v[5] = INFINITY;
        if (kind == 2) w.t.body.load[3] = NAN;
        solid_run(&w, 1, 1e-5);
        CHECK(isnan(solid_limit(&w)));
        solid_world_close(&w);
    }
}

static void a_body_without_a_solid_is_refused_in_a_sentence(void)
{
    pal_scene scene;
    pal_body body = {.name = "liver"};
    pal_config_entry item;
    pal_diagnostic diag = {{0}};
    void *self = NULL;
    pal_arena *arena = pal_arena_create(1 << 16, true);
    pal_scene_default(&scene);
    pal_build build = {.scene = &scene, .def = &scene.body[0], .body = &body, .arena = arena, .diag = &diag};
    pal_entry_init(&item, "solver", "central_cg");
    CHECK_INT(pal_effect_central_cg.make(&item, &build, &self), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "solver: \"central_cg\" needs a body of model subdivision_fem");
    (void)pal_entry_put_text(&item, "preconditioner", "magic", NULL);
    CHECK_INT(pal_effect_central_cg.make(&item, &build, &self), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "solver.preconditioner: \"magic\", wanted \"factor\" or \"diagonal\"");
    pal_arena_destroy(arena);
}

int main(void)
{
    RUN(undamped_energy_stays_over_many_steps);
    RUN(energy_of_a_bending_body_stays_within_a_percent);
    RUN(a_free_body_keeps_its_momentum_and_angular_momentum);
    RUN(rest_stays_rest_to_the_bit);
    RUN(constant_acceleration_is_exact);
    RUN(held_points_stand_and_led_ones_keep_their_velocity);
    RUN(led_points_pull_their_neighbours_by_the_mass_between_them);
    RUN(all_points_held_is_fine);
    RUN(huge_drag_creeps_monotonically);
    RUN(huge_damping_that_varies_is_stable);
    RUN(preconditioners_agree);
    RUN(a_reset_body_moves_as_it_did_to_the_bit);
    RUN(moves_are_clamped);
    RUN(heavy_steps_stay_bounded);
    RUN(a_state_that_is_no_number_has_no_limit);
    RUN(a_body_without_a_solid_is_refused_in_a_sentence);
    return check_report();
}
