/* Solver central_cg: against the textbook's scheme, order, limit, what it conserves, and what goes wrong. */
#include "tests/check.h"
#include "tests/fixtures/subdivision_bodies.h"

#include "server/num/envelope.h"

enum { PLAIN, SUBDIVIDED, COARSE };
/* 27 points with elements of two kinds and pyramids left out, 8 nodes of one cube, a block of 8 cubes */
static bool open_kind(solid_world *w, int kind, bool linear)
{
    solid_block(&w->t, (const int[]){1, 2, 2}[kind], 0.1, 0.1);
    return solid_world_open(w, (const int[]){0, 2, 0}[kind], linear, 100);
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

/* ---- eq. 20 as it is printed, one element, numbers in full ---- */

typedef struct textbook {
    double m[8][8], d[8][8], p[24], before[24], dt;
} textbook;

/* a x = b for 8 points and three directions, in place */
static void eliminate(double a[8][8], double *b)
{
    for (int k = 0; k < 8; k++)
        for (int i = k + 1; i < 8; i++) {
            const double l = a[i][k] / a[k][k];
            for (int j = k; j < 8; j++) a[i][j] -= l * a[k][j];
            for (int c = 0; c < 3; c++) b[3 * i + c] -= l * b[3 * k + c];
        }
    for (int i = 8; i-- > 0;)
        for (int c = 0; c < 3; c++) {
            for (int j = i + 1; j < 8; j++) b[3 * i + c] -= a[i][j] * b[3 * j + c];
            b[3 * i + c] /= a[i][i];
        }
}

static void textbook_forces(solid_world *w, const double *p, double *f)
{
    double kept[24];
    memcpy(kept, w->t.body.x, sizeof kept);
    memcpy(w->t.body.x, p, sizeof kept);
    solid_forces(w);
    memcpy(f, w->t.body.g, sizeof kept);
    memcpy(w->t.body.x, kept, sizeof kept);
}

/* p- = p - dt v + dt^2 a / 2, M a = f - D v */
static void textbook_begin(textbook *b, solid_world *w, double rate, double dt)
{
    const pal_mass_operator *m = &w->t.mass;
    memset(b, 0, sizeof *b);
    b->dt = dt;
    for (int i = 0; i < 8; i++)
        for (int k = m->start[i]; k < m->start[i + 1]; k++) {
            b->m[i][m->point[k]] = m->mass_kg[k];
            b->d[i][m->point[k]] = rate * m->mass_kg[k] + (m->damping_kg_s ? m->damping_kg_s[k] : 0);
        }
    double a[24], lhs[8][8];
    textbook_forces(w, w->t.body.x, a);
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++)
            for (int c = 0; c < 3; c++) a[3 * i + c] -= b->d[i][j] * w->t.body.v[3 * j + c];
    memcpy(lhs, b->m, sizeof lhs);
    eliminate(lhs, a);
    for (int i = 0; i < 24; i++) {
        b->p[i] = w->t.body.x[i];
        b->before[i] = b->p[i] - dt * w->t.body.v[i] + dt * dt * a[i] / 2;
    }
}

/* (2M + dt D) p+ = 2 dt^2 f + 4 M p - (2M - dt D) p- */
static void textbook_step(textbook *b, solid_world *w)
{
    double f[24], lhs[8][8];
    textbook_forces(w, b->p, f);
    for (int i = 0; i < 24; i++) f[i] *= 2 * b->dt * b->dt;
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++) {
            lhs[i][j] = 2 * b->m[i][j] + b->dt * b->d[i][j];
            for (int c = 0; c < 3; c++)
                f[3 * i + c] +=
                    4 * b->m[i][j] * b->p[3 * j + c] - (2 * b->m[i][j] - b->dt * b->d[i][j]) * b->before[3 * j + c];
        }
    eliminate(lhs, f);
    memcpy(b->before, b->p, sizeof f);
    memcpy(b->p, f, sizeof f);
}

/* without damping, with drag, with drag and damping that varies */
static void it_is_the_textbooks_central_difference(void)
{
    for (int damping = 0; damping < 3; damping++) {
        solid_world w;
        textbook b;
        REQUIRE(open_kind(&w, PLAIN, false));
        if (damping > 0) add_drag(&w, 5);
        for (int i = 0; i < 64 && damping > 1; i++) w.t.solid->samples[PAL_CELL_HEX].damping_1_s[i] = (float)i;
        pal_subdivision_mass_fill(w.t.solid, &w.t.mass);
        REQUIRE(!solid_solver(&w, 0, 1e-14, NULL));
        solid_shake(&w, 0.1);
        for (int i = 0; i < 24; i++) w.t.body.v[i] = 0.2 * solid_uniform(&w.t);
        const double dt = 0.3 * solid_limit(&w);
        textbook_begin(&b, &w, damping ? 5 : 0, dt);
        double far = 0;
        for (int i = 0; i < 60; i++) {
            solid_run(&w, 1, dt);
            textbook_step(&b, &w);
            for (int k = 0; k < 24; k++) far = fmax(far, fabs(w.t.body.x[k] - b.p[k]));
        }
        CHECK_LE(far, 1e-12 * w.t.body.length_scale_m);
        double moved = 0;
        for (int k = 0; k < 24; k++) moved = fmax(moved, fabs(b.p[k] - w.t.body.x_rest[k]));
        CHECK_LE(1e-3, moved);
        solid_world_close(&w);
    }
}

/* ---- accuracy ---- */

/* where a body is after 0.05 s in n sub-steps; uneven: every other one half as long */
static void swing(int n, double rate, bool uneven, double *x)
{
    solid_world w;
    if (!open_kind(&w, COARSE, false)) abort();
    if (rate > 0) add_drag(&w, rate);
    for (int i = 0; i < w.t.body.n_dof; i++) {
        w.t.body.x[3 * i] += 0.1 * w.t.body.x_rest[3 * i + 1];
        w.t.body.v[3 * i + 2] = 0.3 * w.t.body.x_rest[3 * i];
    }
    const double dt = 0.05 / n;
    for (int i = 0; i < n; i += 2) {
        solid_run(&w, 1, uneven ? dt * 4 / 3 : dt);
        solid_run(&w, 1, uneven ? dt * 2 / 3 : dt);
    }
    memcpy(x, w.t.body.x, 81 * sizeof *x);
    solid_world_close(&w);
}

static double between(const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < 81; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum);
}

static void order_is_two_with_and_without_drag(void)
{
    for (int drag = 0; drag < 2; drag++) {
        double coarse[81], fine[81], exact[81];
        swing(200, 20.0 * drag, false, coarse);
        swing(400, 20.0 * drag, false, fine);
        swing(3200, 20.0 * drag, false, exact);
        CHECK_NEAR(between(coarse, exact) / between(fine, exact), 4, 0.2);
    }
}

/* positions at half of the steps are of another time than velocities, whichever way the steps are cut */
static void order_is_two_with_uneven_steps(void)
{
    double coarse[81], fine[81], exact[81];
    swing(200, 20, true, coarse);
    swing(400, 20, true, fine);
    swing(3200, 20, false, exact);
    CHECK_NEAR(between(coarse, exact) / between(fine, exact), 4, 0.4);
}

/* ---- the limit ---- */

/* omega_max of (M~, K~) on the free points: power iteration on linear forces */
static double fastest(solid_world *w, int n_round)
{
    pal_body *b = &w->t.body;
    const pal_mass_operator *m = &w->t.mass;
    const int n = 3 * b->n_dof;
    pal_envelope e;
    double *x = malloc(sizeof *x * (size_t)n), *v = calloc((size_t)n, sizeof *v), *u = calloc((size_t)n, sizeof *u),
           *g = malloc(sizeof *g * (size_t)n), omega2 = 0;
    if (pal_envelope_make(m->n_point, m->start, m->point, 1 << 20, w->t.arena, &e)) abort();
    if (pal_envelope_factor(&e, m->start, m->point, m->mass_kg, b->support)) abort();
    memcpy(x, b->x, sizeof *x * (size_t)n);
    solid_forces(w);
    memcpy(g, b->g, sizeof *g * (size_t)n);
    for (int i = 0; i < n; i++) v[i] = b->support[i / 3] ? 0 : solid_uniform(&w->t);
    for (int round = 0; round < n_round; round++) {
        double max = 0, along = 0, norm2 = 0;
        for (int i = 0; i < n; i++) max = fmax(max, fabs(v[i]));
        for (int i = 0; i < n; i++) v[i] /= max, b->x[i] = x[i] + b->edge_m * v[i];
        solid_forces(w);
        for (int i = 0; i < n; i++) u[i] = b->support[i / 3] ? 0 : (g[i] - b->g[i]) / b->edge_m;
        for (int i = 0; i < n; i++) along += u[i] * v[i];
        pal_mass_operator_multiply(m, 1, 0, NULL, v, b->g);
        for (int i = 0; i < n; i++) norm2 += v[i] * b->g[i];
        omega2 = along / norm2;
        pal_envelope_solve(&e, u, v);
    }
    memcpy(b->x, x, sizeof *x * (size_t)n);
    free(x), free(v), free(u), free(g);
    return sqrt(omega2);
}

static void limit_is_the_true_one_within_two_percent(void)
{
    for (int kind = 0; kind < 3; kind++)
        for (int fixed = 0; fixed < 2; fixed++) {
            solid_world w;
            REQUIRE(open_kind(&w, kind, true));
            for (int i = 0; i < 3 * fixed; i++) w.t.body.support[i] = PAL_FIXED;
            double want = 0.9 * 2 / fastest(&w, 500), limit = solid_limit(&w);
            CHECK_LE(limit, want * 1.002);
            CHECK_LE(0.97 * want, limit);
            solid_world_close(&w);
        }
}

static double farthest(const solid_world *w)
{
    double max = 0;
    for (int i = 0; i < 3 * w->t.body.n_dof; i++)
        max = fmax(max, fabs(w->t.body.x[i] - w->t.body.x_rest[i]) / w->t.body.edge_m);
    return max;
}

static void just_below_the_true_limit_is_stable_and_just_above_is_not(void)
{
    for (int kind = 0; kind < 2; kind++)
        for (int above = 0; above < 2; above++) {
            solid_world w;
            REQUIRE(open_kind(&w, kind, true));
            w.t.body.support[0] = w.t.body.support[1] = w.t.body.support[2] = PAL_FIXED;
            double dt = (above ? 1.05 : 0.99) * 2 / fastest(&w, 500);
            solid_shake(&w, 1e-6);
            solid_run(&w, above ? 200 : CHECK_REPEATS(10000, 1000), dt);
            if (above)
                CHECK_LE(1e-2, farthest(&w));
            else
                CHECK_LE(farthest(&w), 3e-4);
            solid_world_close(&w);
        }
}

/* steps of the limit through a large deformation, the limit asked before each as the world does */
static void limit_holds_in_flight(void)
{
    solid_world w;
    REQUIRE(open_kind(&w, SUBDIVIDED, false));
    add_drag(&w, 3);
    double at_rest = solid_limit(&w), min = INFINITY, max = 0;
    for (int i = 0; i < w.t.body.n_dof; i++) w.t.body.v[3 * i] = 40 * w.t.body.x_rest[3 * i + 1];
    w.solve.effect->reset(w.solve.self, &w.t.body);
    for (int i = 0; i < CHECK_REPEATS(1000, 300); i++) {
        double limit = solid_limit(&w);
        min = fmin(min, limit), max = fmax(max, limit);
        solid_run(&w, 1, limit);
    }
    CHECK(pal_body_finite(&w.t.body));
    CHECK_INT(w.t.body.safeguards.n_clamped, 0);
    CHECK_LE(farthest(&w), 40);
    CHECK_LE(0.5 * at_rest, min);
    CHECK_LE(max, 2 * at_rest);
    solid_world_close(&w);
}

static void a_look_at_the_limit_leaves_the_body(void)
{
    solid_world w;
    REQUIRE(open_kind(&w, SUBDIVIDED, false));
    solid_shake(&w, 0.3);
    solid_run(&w, 3, 1e-4);
    const pal_body before = w.t.body;
    const size_t n = 3 * sizeof(double) * (size_t)before.n_node, n_dof = 3 * sizeof(double) * (size_t)before.n_dof;
    void *kept[5] = {malloc(n), malloc(n), malloc(n), malloc(n), malloc(n)};
    const double *of[5] = {before.d, before.dv, before.f, before.x, before.v};
    for (int i = 0; i < 5; i++) memcpy(kept[i], of[i], i < 3 ? n : n_dof);
    w.solve.effect->reset(w.solve.self, &w.t.body);
    CHECK(solid_limit(&w) > 0);
    CHECK(!memcmp(&before, &w.t.body, sizeof before));
    for (int i = 0; i < 5; i++) CHECK(!memcmp(kept[i], of[i], i < 3 ? n : n_dof));
    for (int i = 0; i < 5; i++) free(kept[i]);
    solid_world_close(&w);
}

/* edits are found by what they change: samples painted, points held or let go */
static void limit_follows_mass_and_supports(void)
{
    solid_world w;
    REQUIRE(open_kind(&w, SUBDIVIDED, true));
    const double before = solid_limit(&w);
    const pal_stroke stroke = {{0, 0, 0}, 1, 0, 1, 4};
    w.t.def.stroke = &stroke, w.t.def.n_stroke = 1;
    pal_subdivision_solid_sample(w.t.solid, &w.t.def);
    pal_subdivision_mass_fill(w.t.solid, &w.t.mass);
    CHECK_NEAR(solid_limit(&w) / before, 2, 1e-6);
    w.springs.k_N_m *= 4;
    CHECK_NEAR(solid_limit(&w) / before, 2, 1e-6);
    w.solve.effect->material(w.solve.self, &w.t.body, &w.t.def.material, NULL);
    CHECK_NEAR(solid_limit(&w) / before, 1, 1e-3);
    memset(w.t.body.support, 1, (size_t)w.t.body.n_dof);
    CHECK(isinf(solid_limit(&w)));
    w.t.body.support[4] = PAL_FREE;
    CHECK_LE(before, solid_limit(&w));
    solid_world_close(&w);
}

/* ---- contact ---- */

/* a tool's spring on every node of one face: a CONTACT row gives loads and says its stiffness */
typedef struct pusher {
    double k_N_m, c_Ns_m;
} pusher;

static bool pushed(const pal_body *body, int node)
{
    return body->node_rest[3 * node + 2] > 0.04;
}

static pal_err push(void *self, pal_step *step)
{
    const pusher *p = self;
    pal_body *b = step->body;
    for (int i = 0; i < b->n_node; i++) {
        double load = -p->k_N_m * (b->d[3 * i + 2] - b->node_rest[3 * i + 2]) - p->c_Ns_m * b->dv[3 * i + 2];
        b->load[3 * i + 2] = pushed(b, i) ? load : 0;
    }
    return PAL_ERR_OK;
}

static void push_stiffness(void *self, const pal_body *body, double *bound)
{
    for (int i = 0; i < body->n_node; i++) bound[i] += pushed(body, i) ? ((const pusher *)self)->k_N_m : 0;
}

static void push_damping(void *self, const pal_body *body, double *bound)
{
    for (int i = 0; i < body->n_node; i++) bound[i] += pushed(body, i) ? ((const pusher *)self)->c_Ns_m : 0;
}

/* by each of the three ways in which a row may say it */
static const pal_effect pusher_effect[3] = {
    {.name = "pusher", .stage = PAL_STAGE_CONTACT, .run = push, .bounds.stiffness = push_stiffness},
    {.name = "wisher", .stage = PAL_STAGE_CONTACT, .run = push, .bounds.wanted = push_stiffness},
    {.name = "brake", .stage = PAL_STAGE_CONTACT, .run = push, .bounds.damping = push_damping},
};

static void limit_counts_what_contact_says(void)
{
    for (int way = 0; way < 3; way++) {
        solid_world w;
        pusher p = {way < 2 ? 6000 : 0, way < 2 ? 0 : 8};
        REQUIRE(open_kind(&w, SUBDIVIDED, true));
        const double alone = solid_limit(&w);
        w.contact[w.n_contact++] = (pal_component){.effect = &pusher_effect[way], .self = &p};
        const double limit = solid_limit(&w);
        CHECK_LE(limit, 0.6 * alone);
        solid_shake(&w, 1e-3);
        double before = farthest(&w);
        for (int i = 0; i < CHECK_REPEATS(1000, 300); i++) {
            pal_step step = solid_step(&w, limit);
            pal_body_update_nodes(&w.t.body);
            push(&p, &step);
            solid_run(&w, 1, limit);
        }
        CHECK_LE(farthest(&w), 300 * before);
        CHECK(pal_body_finite(&w.t.body));
        solid_world_close(&w);
    }
}

int main(void)
{
    RUN(it_is_the_textbooks_central_difference);
    RUN(order_is_two_with_and_without_drag);
    RUN(order_is_two_with_uneven_steps);
    RUN(limit_is_the_true_one_within_two_percent);
    RUN_LONG(just_below_the_true_limit_is_stable_and_just_above_is_not);
    RUN(limit_holds_in_flight);
    RUN(a_look_at_the_limit_leaves_the_body);
    RUN(limit_follows_mass_and_supports);
    RUN(limit_counts_what_contact_says);
    return check_report();
}
