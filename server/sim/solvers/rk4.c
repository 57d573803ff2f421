/* Solver rk4: the classical fourth-order Runge-Kutta method over the body's active nodes (paper C, equations of
 * motion). Loads of CONTACT components are constant within a sub-step.
 *
 * The sub-step is `safety` (key, 0.9) of 2.7 / max(omega, c) over the free nodes. c = C/m, where C are the
 * Gershgorin row sums of explicit damping; omega^2 bounds stiffness over mass. The method is stable where |lambda
 * dt| <= 2.61 in the left half plane, and no eigenvalue exceeds max(omega, c). Row sums K/m overestimate omega by up
 * to 1.4 times on a surface; there Lanczos iteration gives a sharper bound, on M^-1 K through differences of forces,
 * K of all FORCE components at the present state: the largest Ritz value plus its residual (Zhou and Li, Bounding
 * the spectrum of large Hermitian matrices, 2011). It was measured at most 2 % below the true value and never
 * exceeds the row sums; the row sums of CONTACT components are added. With the membrane law the sub-step halves with
 * every level, as eq. 9 requires. The bounds are recomputed when a node may have moved a fifth of an element or when
 * the active part has changed, the Lanczos bound at most once in 12 sub-steps and only where it saves one; between,
 * row sums alone are used. Changes of common factors scale the bound.
 *
 * Departures. Drag of the components (hook `drag`, rate r, v' = -r v) is integrated exactly by the exponential
 * Runge-Kutta method of Cox and Matthews (2002, eq. 26-29). It equals the classical method for r = 0, has order 4
 * for every r, is stable for all r where the classical one is stable without drag, and creeps as v = f/(m r) for
 * very large r. Fixed nodes do not move; prescribed ones keep their velocity. step_guard.h limits displacements.
 * Where the world cannot afford the sub-steps (step->adds_mass), nodes that break the limit get the mass that meets it.
 * Components check for inverted elements whenever the bounds are computed, and in every step while there are any.
 *
 * Threads share the stages of a body with packed dofs in parts of its nodes (active_nodes.h). */
#include "server/base/clock.h"
#include "server/base/team.h"
#include "server/base/vec3.h"
#include "server/num/lanczos.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/surface/active_nodes.h"

#include <string.h>

/* Data of a node between the stages, as position and velocity: the start of its next stage, and the sum of rates. In
 * Lanczos iteration: position and forces at the state itself */
typedef struct memory {
    pal_v8 from, sum;
} memory;

/* Coefficients of a sub-step dt with drag r, z = r dt, for position and velocity: decay of the start after half a
 * sub-step and a whole one (exp(-z/2), exp(-z)), of free and of prescribed nodes; weights of rates at half (dt/2,
 * dt/2 phi1(z/2)), in the fourth stage, and in the sum in stages 1, 2 and 3, 4 */
typedef struct rates {
    double dt;
    pal_v8 half[2], whole[2], grow, last, weight[3];
} rates;

typedef struct rk4 {
    double *stiff, *damp; /* Gershgorin row sums, N/m and Ns/m [n_dof] */
    /* by index among the active nodes [n_dof] */
    memory *memory;
    pal_quad *load;
    double *inverse_kg;
    uint8_t *prescribed;
    bool packed;          /* all FORCE components support active_nodes */
    double safety, reach; /* of the stability limit; safety times the radius 2.7 */
    double limit_s;
    double moved_m; /* upper bound of motion since the bounds were computed */
    /* of the body when they were computed */
    uint64_t revision;
    double ramp[2];
    bool known;         /* limit_s holds */
    bool has_inversion; /* bounds must be computed again in the coming step */

    /* Lanczos' bound on omega^2 of the FORCE components, 1/s^2, at which common factors it was taken, and sub-steps
     * since */
    double sharp2, sharp_ramp[2];
    int n_since;
    bool sharp_known;
    double step_s; /* the last whole step; 0: none yet */
    double over;   /* overestimate of omega by row sums as last measured; infinite: not yet */
    pal_lanczos lanczos;
    pal_step *step; /* that requests the bound */
    double *at, *zero,
        *force; /* saved x, v and f of the body during the iteration [n_dof][3]; NULL: no adaptive surface */
} rk4;

/* sub-steps between Lanczos bounds, and iterations for one, each an evaluation of forces */
enum { PAUSE = 12, LANCZOS = 10 };

/* ---- forces ---- */

/* what a part of the nodes has come to in a sub-step */
typedef struct part_result {
    double max2;            /* square of the largest displacement, m^2; NaN where one is not finite         */
    uint64_t n_clamped, ns; /* nodes whose move was shortened, and the time that took */
} part_result;

/* what threads do with the nodes, part by part */
typedef struct pass {
    rk4 *solver;
    pal_body *body;
    void (*run)(struct pass *pass, int first, int end, part_result *out);
    int n_part;
    const rates *rates;
    double max_m; /* largest displacement of a node in a sub-step */
    bool adds_mass, stores_forces;
    const double *from; /* vectors of Lanczos' iteration [n_active][3] */
    double *to, small, per;
    part_result result[PAL_TEAM_MAX];
} pass;

static void run_part(void *user, int worker, int part)
{
    pass *p = user;
    (void)worker;
    p->run(p, pal_active_first(p->body, p->n_part, part), pal_active_first(p->body, p->n_part, part + 1),
           &p->result[part]);
}

static void share(pass *p, void (*run)(pass *p, int first, int end, part_result *out))
{
    p->run = run;
    pal_team_run(p->body->team, p->n_part, run_part, p);
}

static void begin_pass(pass *p, rk4 *solver, pal_body *body)
{
    p->solver = solver, p->body = body, p->n_part = pal_active_parts(body);
}

/* the body's state and its loads, as which packed forces begin */
static void load_part(pass *p, int first, int end, part_result *out)
{
    const pal_body *body = p->body;
    (void)out;
    for (int k = first; k < end; k++) {
        pal_active_node_load(body, k);
        body->active_nodes->f[k] = p->solver->load[k] = pal_quad_load(body->load + 3 * (size_t)pal_body_point(body, k));
    }
}

/* copies positions and velocities of active_nodes to the body */
static void store_part(pass *p, int first, int end, part_result *out)
{
    const pal_body *body = p->body;
    const pal_active_nodes *nodes = body->active_nodes;
    (void)out;
    for (int k = first; k < end; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_quad_store(body->x + i, pal_v8_low(nodes->xv[k]));
        pal_quad_store(body->v + i, pal_v8_high(nodes->xv[k]));
        if (p->stores_forces) pal_quad_store(body->f + i, nodes->f[k]);
    }
}

/* forces at the positions and velocities of active_nodes, into active_nodes, where packed ones begin as the loads */
static pal_err find_forces(pass *p, pal_step *step)
{
    pal_body *body = p->body;
    if (p->solver->packed) return pal_run_forces(step, PAL_FORCES_PACKED);
    share(p, store_part);
    PAL_TRY(pal_assemble_forces(step));
    for (int k = 0; k < body->n_active; k++)
        body->active_nodes->f[k] = pal_quad_load(body->g + 3 * (size_t)pal_body_point(body, k));
    return PAL_ERR_OK;
}

/* ---- the limit ---- */

/* true: the last bound is still valid */
static bool is_known(const rk4 *solver, const pal_step *step)
{
    const pal_body *body = step->body;
    /* a non-finite bound is unknown */
    if (!solver->known || solver->revision != body->display.revision ||
        !(solver->moved_m <= PAL_GUARD_MOVE * body->edge_m))
        return false;
    if (body->active && (solver->ramp[0] != *body->dofs.ramp[0] || solver->ramp[1] != *body->dofs.ramp[1]))
        return false;
    if (body->active && !solver->sharp_known && solver->n_since >= PAUSE) return false;
    return step->sub != 0 || !pal_guard_has_bounds(step->contact, step->n_contact);
}

/* max over free nodes of row sums [n_dof] over mass */
static double max_over_mass(const double *sum, const pal_body *body)
{
    double max = 0;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double ratio = sum[i] / body->mass_kg[i];
        if (!body->support[i] && ratio > max) max = ratio;
    }
    return max;
}

/* 1 for a state and row sums that are finite, else NaN */
static double one_if_finite(const rk4 *solver, const pal_body *body)
{
    double one = pal_body_finite(body) ? 1 : NAN;
    for (int k = 0; k < body->n_active; k++)
        one += 0 * solver->stiff[pal_body_point(body, k)] + 0 * solver->damp[pal_body_point(body, k)];
    return one;
}

/* ---- the Lanczos bound; vectors are displacements of active nodes [n_active][3] ---- */

/* positions displaced by small v, at rest */
static void displace_part(pass *p, int first, int end, part_result *out)
{
    const rk4 *solver = p->solver;
    pal_active_nodes *nodes = p->body->active_nodes;
    (void)out;
    for (int k = first; k < end; k++) {
        pal_quad move = p->small * pal_quad_load(p->from + 3 * (size_t)k);
        nodes->xv[k] = pal_v8_join(pal_v8_low(solver->memory[k].from) + move, (pal_quad){0});
        nodes->f[k] = solver->load[k];
    }
}

/* out = K v by the difference of forces over a small displacement */
static void subtract_part(pass *p, int first, int end, part_result *out)
{
    const pal_body *body = p->body;
    (void)out;
    for (int k = first; k < end; k++) {
        double free = body->support[pal_body_point(body, k)] ? 0 : p->per;
        pal_quad_store(p->to + 3 * (size_t)k, free * (pal_v8_low(p->solver->memory[k].sum) - body->active_nodes->f[k]));
    }
}

static bool multiply_stiffness(void *user, const double *v, double *out)
{
    rk4 *solver = user;
    pal_body *body = solver->step->body;
    pass p = {.from = v, .to = out};
    double max2 = 0;
    begin_pass(&p, solver, body);
    for (int k = 0; k < body->n_active; k++) max2 = fmax(max2, pal_dot3(v + 3 * (size_t)k, v + 3 * (size_t)k));
    p.small = max2 > 0 ? PAL_DIFFERENCE_H * body->edge_m / sqrt(max2) : 0, p.per = max2 > 0 ? 1 / p.small : 0;
    share(&p, displace_part);
    if (find_forces(&p, solver->step)) return false;
    share(&p, subtract_part);
    return true;
}

static bool solve_mass(void *user, const double *b, double *out)
{
    const rk4 *solver = user;
    const pal_body *body = solver->step->body;
    for (int k = 0; k < body->n_active; k++)
        pal_scale3(out + 3 * (size_t)k, 1 / body->mass_kg[pal_body_point(body, k)], b + 3 * (size_t)k);
    return true;
}

/* Lanczos bound on omega^2 of the FORCE components. The first vector has arbitrary signs, weighted by row sums over
 * mass, because fast modes are where nodes are stiffest */
static double run_lanczos(rk4 *solver, pal_step *step)
{
    const pal_body *body = step->body;
    pass p = {.n_part = 0};
    solver->step = step;
    solver->packed = pal_active_nodes_complete(step);
    begin_pass(&p, solver, step->body);
    share(&p, load_part);
    if (find_forces(&p, step)) return NAN;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double *z = solver->lanczos.z + 3 * (size_t)k, weight = solver->stiff[i] / sqrt(body->mass_kg[i]);
        uint64_t bits = ((uint64_t)(uint32_t)i + 1) * 0x9e3779b97f4a7c15u;
        for (int c = 0; c < 3; c++) {
            bits ^= bits >> 29, bits *= 0xbf58476d1ce4e5b9u;
            z[c] = body->support[i] ? 0 : weight * ((double)(bits >> 11) * 0x1p-52 - 1);
        }
        solver->memory[k] = (memory){.from = body->active_nodes->xv[k]};
        solver->memory[k].sum = pal_v8_join(body->active_nodes->f[k], (pal_quad){0});
    }
    solver->lanczos.n = 3 * body->n_active;
    return pal_lanczos_run(&solver->lanczos, PAL_SOLVER_TOLERANCE, LANCZOS, LANCZOS);
}

/* the same at zero velocity; restores all arrays of the body */
static void find_sharp(rk4 *solver, pal_step *step, double max)
{
    pal_body *body = step->body;
    const pal_body saved = *body;
    const bool drag_separate = step->drag_separate;
    for (int k = 0; k < body->n_active; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_copy3(solver->at + i, body->x + i);
    }
    body->x = body->d = solver->at;
    body->v = body->dv = solver->zero;
    body->f = body->g = solver->force;
    step->drag_separate = true;
    solver->sharp2 = run_lanczos(solver, step);
    solver->sharp_known = solver->sharp2 == solver->sharp2;
    solver->over = fmax(1, sqrt(max / solver->sharp2));
    step->drag_separate = drag_separate;
    body->x = saved.x, body->d = saved.d, body->v = saved.v, body->dv = saved.dv, body->f = saved.f, body->g = saved.g;
    solver->sharp_ramp[0] = *body->dofs.ramp[0], solver->sharp_ramp[1] = *body->dofs.ramp[1];
    solver->n_since = 0;
}

/* omega^2 of the FORCE components: at most the largest row sum `max`. If the common factors have grown for only part of
 * the stiffness, scaling all of it gives an upper bound */
static double bound_force(rk4 *solver, pal_step *step, double max)
{
    const pal_body *body = step->body;
    /* called from outside without motion: the world asks at rest, with positions that are not the body's */
    if (!body->active || body->x == body->x_rest) return max;
    bool moved = solver->revision != body->display.revision || !(solver->moved_m <= PAL_GUARD_MOVE * body->edge_m);
    solver->sharp_known &= !moved;
    if (!solver->sharp_known && solver->n_since >= PAUSE) {
        /* only where a longer limit saves a sub-step */
        double n = solver->step_s * sqrt(max) / solver->reach;
        if (!(solver->step_s > 0) || fmax(1, ceil(n / solver->over)) < ceil(n))
            find_sharp(solver, step, max);
        else
            solver->n_since = 0;
    }
    if (!solver->sharp_known) return max;
    double grown =
        fmax(1, fmax(*body->dofs.ramp[0] / solver->sharp_ramp[0], *body->dofs.ramp[1] / solver->sharp_ramp[1]));
    return fmin(max, grown * solver->sharp2);
}

static double limit(void *self, pal_step *step)
{
    rk4 *solver = self;
    const pal_body *body = step->body;
    if (!(step->sub == 0 && solver->has_inversion) && is_known(solver, step)) return solver->limit_s;
    solver->has_inversion = pal_guard_recover(step) & PAL_INVERTED;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        solver->stiff[i] = solver->damp[i] = 0;
    }
    pal_guard_add_bounds(step->contact, step->n_contact, body, solver->stiff, solver->damp);
    double contact2 = max_over_mass(solver->stiff, body);
    pal_guard_add_bounds(step->force, step->n_force, body, solver->stiff, solver->damp);
    double max2 = max_over_mass(solver->stiff, body);
    solver->limit_s = one_if_finite(solver, body);
    if (solver->limit_s == 1) max2 = fmin(max2, bound_force(solver, step, max2) + contact2);
    /* the larger of omega and c */
    const double max = fmax(sqrt(max2), max_over_mass(solver->damp, body));
    solver->limit_s *= max > 0 ? solver->reach / max : INFINITY;
    if (!solver->sharp_known || solver->n_since == 0) solver->moved_m = 0;
    solver->revision = body->display.revision;
    for (int k = 0; k < 2 && body->active; k++) solver->ramp[k] = *body->dofs.ramp[k];
    solver->known = true;
    return solver->limit_s;
}

/* ---- a sub-step ---- */

/* phi_1, phi_2, phi_3 of -z, z >= 0: phi_k = sum over n of (-z)^n / (n + k)!. Series and doubling instead of exp, for
 * the same bits with every library */
static void find_phi(double z, double phi[4])
{
    int n_double = 0;
    while (z > 0.5 && n_double < 60) z *= 0.5, n_double++;
    for (int k = 0; k < 4; k++) {
        double term = 1, sum = 0;
        for (int n = 1; n <= k; n++) term /= n;
        for (int n = 1; n < 16; n++) sum += term, term *= -z / (n + k);
        phi[k] = sum;
    }
    for (int d = 0; d < n_double; d++) {
        phi[0] *= phi[0];
        z *= 2;
        phi[1] = (1 - phi[0]) / z;
        phi[2] = (1 - phi[1]) / z;
        phi[3] = (0.5 - phi[2]) / z;
    }
}

static pal_v8 both(double position, double velocity)
{
    const pal_quad one = {1, 1, 1, 1};
    return pal_v8_join(position * one, velocity * one);
}

static rates find_rates(double dt_s, double rate)
{
    double half = 1, whole = 1, grow = 0.5 * dt_s, weight[3] = {dt_s / 6, dt_s / 3, dt_s / 6}, phi[4];
    if (rate * dt_s > 0) {
        find_phi(rate * dt_s / 2, phi);
        half = phi[0];
        grow = 0.5 * dt_s * phi[1];
        find_phi(rate * dt_s, phi);
        whole = phi[0];
        weight[0] = dt_s * (phi[1] - 3 * phi[2] + 4 * phi[3]);
        weight[1] = dt_s * (2 * phi[2] - 4 * phi[3]);
        weight[2] = dt_s * (4 * phi[3] - phi[2]);
    }
    return (rates){.dt = dt_s,
                   .half = {both(1, half), both(1, 1)},
                   .whole = {both(0, whole), both(0, 1)},
                   .grow = both(0.5 * dt_s, grow),
                   .last = both(dt_s, 2 * grow),
                   .weight = {both(dt_s / 6, weight[0]), both(dt_s / 3, weight[1]), both(dt_s / 6, weight[2])}};
}

/* the body's state, and inverse masses: fixed nodes have no acceleration, and those that do not move no velocity */
static void begin_part(pass *p, int first, int end, part_result *out)
{
    rk4 *solver = p->solver;
    const pal_body *body = p->body;
    const double t = p->rates->dt / solver->reach;
    load_part(p, first, end, out);
    for (int k = first; k < end; k++) {
        int i = pal_body_point(body, k);
        double mass = body->mass_kg[i];
        if (p->adds_mass) mass = fmax(mass, fmax(t * t * solver->stiff[i], t * solver->damp[i]));
        solver->inverse_kg[k] = body->support[i] ? 0 : 1 / mass;
        solver->prescribed[k] = body->support[i] == PAL_PRESCRIBED;
        if (body->support[i] == PAL_FIXED)
            body->active_nodes->xv[k] = pal_v8_join(pal_v8_low(body->active_nodes->xv[k]), (pal_quad){0});
    }
}

/* velocity and acceleration of an active node */
PAL_INLINE pal_v8 rate_of(const rk4 *solver, const pal_active_nodes *nodes, int k)
{
    return pal_v8_join(pal_v8_high(nodes->xv[k]), solver->inverse_kg[k] * nodes->f[k]);
}

/* the state at the start, and the second stage's. As after the other stages, forces begin as the loads again */
static void stage_first(pass *p, int first, int end, part_result *out)
{
    rk4 *solver = p->solver;
    const rates *r = p->rates;
    pal_active_nodes *nodes = p->body->active_nodes;
    (void)out;
    for (int k = first; k < end; k++) {
        memory *m = &solver->memory[k];
        const pal_v8 y = nodes->xv[k], rate = rate_of(solver, nodes, k);
        m->from = y;
        m->sum = r->whole[solver->prescribed[k]] * y + r->weight[0] * rate;
        nodes->xv[k] = r->half[solver->prescribed[k]] * y + r->grow * rate;
        nodes->f[k] = solver->load[k];
    }
}

/* the third stage's state from the second stage's forces. The fourth stage's velocity continues from the second's
 * after drag, less the contribution of the first acceleration */
static void stage_second(pass *p, int first, int end, part_result *out)
{
    rk4 *solver = p->solver;
    const rates *r = p->rates;
    pal_active_nodes *nodes = p->body->active_nodes;
    (void)out;
    for (int k = first; k < end; k++) {
        memory *m = &solver->memory[k];
        const pal_v8 y = nodes->xv[k], rate = rate_of(solver, nodes, k), half = r->half[solver->prescribed[k]];
        const pal_v8 saved = half * m->from, next = half * y - (y - saved);
        m->sum += r->weight[1] * rate;
        m->from = pal_v8_join(pal_v8_low(m->from), pal_v8_high(next));
        nodes->xv[k] = saved + r->grow * rate;
        nodes->f[k] = solver->load[k];
    }
}

/* the fourth stage's state from the third stage's forces */
static void stage_third(pass *p, int first, int end, part_result *out)
{
    rk4 *solver = p->solver;
    const rates *r = p->rates;
    pal_active_nodes *nodes = p->body->active_nodes;
    (void)out;
    for (int k = first; k < end; k++) {
        memory *m = &solver->memory[k];
        const pal_v8 rate = rate_of(solver, nodes, k);
        m->sum += r->weight[1] * rate;
        nodes->xv[k] = m->from + r->last * rate;
        nodes->f[k] = solver->load[k];
    }
}

/* the final state from the fourth stage's forces; and the square of the largest displacement */
static void stage_last(pass *p, int first, int end, part_result *out)
{
    rk4 *solver = p->solver;
    const rates *r = p->rates;
    pal_active_nodes *nodes = p->body->active_nodes;
    const double dt2 = r->dt * r->dt;
    double max2 = 0, non_finite = 0;
    for (int k = first; k < end; k++) {
        const memory *m = &solver->memory[k];
        const pal_v8 sum = m->sum + r->weight[2] * rate_of(solver, nodes, k), square = sum * sum;
        double move2 = square[0] + square[1] + square[2], v2 = dt2 * (square[4] + square[5] + square[6]);
        nodes->xv[k] = pal_v8_join(pal_v8_low(m->from) + pal_v8_low(sum), pal_v8_high(sum));
        non_finite += 0 * move2 + 0 * v2;
        move2 = v2 > move2 ? v2 : move2;
        max2 = move2 > max2 ? move2 : max2;
    }
    out->max2 = max2 + non_finite;
}

/* limits displacements to max_m, and velocities that would cause longer ones */
static void clamp_moves(const pass *p, int first, int end, part_result *out)
{
    const uint64_t before = pal_clock_ns();
    const double max_m = p->max_m;
    for (int k = first; k < end; k++) {
        pal_v8 *to = &p->body->active_nodes->xv[k];
        pal_quad from = pal_v8_low(p->solver->memory[k].from), move = pal_v8_low(*to) - from, v = pal_v8_high(*to);
        double move_m = sqrt(pal_quad_dot(move, move)), speed = sqrt(pal_quad_dot(v, v)) * p->rates->dt;
        if (move_m > max_m) move *= max_m / move_m;
        if (speed > max_m) v *= max_m / speed;
        if (move_m > max_m || speed > max_m) *to = pal_v8_join(from + move, v);
        out->n_clamped += move_m > max_m || speed > max_m;
    }
    out->ns = pal_clock_ns() - before;
}

/* the last stage, of which the body takes state and forces */
static void end_part(pass *p, int first, int end, part_result *out)
{
    *out = (part_result){0};
    stage_last(p, first, end, out);
    if (sqrt(out->max2) > p->max_m) clamp_moves(p, first, end, out);
    store_part(p, first, end, out);
}

static pal_err run(void *self, pal_step *step)
{
    rk4 *solver = self;
    pal_body *body = step->body;
    const rates r = find_rates(step->dt_s, pal_guard_drag_1_s(step->force, step->n_force));
    pass p = {.rates = &r, .max_m = pal_guard_max_move_m(body), .adds_mass = step->adds_mass};
    step->drag_separate = true;
    solver->packed = pal_active_nodes_complete(step);
    begin_pass(&p, solver, body);
    share(&p, begin_part);
    PAL_TRY(find_forces(&p, step));
    share(&p, stage_first);
    PAL_TRY(find_forces(&p, step));
    share(&p, stage_second);
    PAL_TRY(find_forces(&p, step));
    share(&p, stage_third);
    PAL_TRY(find_forces(&p, step));
    /* for support reactions */
    p.stores_forces = solver->packed && step->sub == step->n_sub - 1;
    share(&p, end_part);
    double max2 = 0, non_finite = 0;
    for (int k = 0; k < p.n_part; k++) {
        max2 = p.result[k].max2 > max2 ? p.result[k].max2 : max2;
        non_finite += 0 * p.result[k].max2;
        body->safeguards.n_clamped += p.result[k].n_clamped, body->safeguards.ns += p.result[k].ns;
    }
    const double move_m = sqrt(max2 + non_finite);
    solver->moved_m += move_m > p.max_m ? p.max_m : move_m;
    solver->n_since += solver->n_since < PAUSE;
    if (step->sub == 0) solver->step_s = step->dt_s * step->n_sub;
    return PAL_ERR_OK;
}

/* ---- hooks ---- */

static void reset(void *self, const pal_body *body)
{
    rk4 *solver = self;
    (void)body;
    solver->known = solver->sharp_known = false;
    solver->n_since = PAUSE;
    solver->step_s = 0;
    solver->over = INFINITY;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double safety = 0.9;
    PAL_TRY(pal_entry_read_number(item, "safety", 0.01, 0.96, &safety, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    const pal_body *body = build->body;
    rk4 *solver = PAL_NEW(build->arena, rk4, 1);
    if (!solver) return PAL_ERR_MEMORY;
    solver->memory = PAL_NEW(build->arena, memory, body->n_dof);
    solver->load = PAL_NEW(build->arena, pal_quad, body->n_dof);
    solver->prescribed = PAL_NEW(build->arena, uint8_t, body->n_dof);
    if (!solver->memory || !solver->load || !solver->prescribed ||
        !PAL_NEW_DOUBLES(build->arena, body->n_dof, &solver->stiff, &solver->damp, &solver->inverse_kg))
        return PAL_ERR_MEMORY;
    PAL_TRY(pal_active_nodes_make(build));
    pal_lanczos *lanczos = &solver->lanczos;
    const size_t n3 = 3 * (size_t)body->n_dof;
    lanczos->multiply = multiply_stiffness, lanczos->solve = solve_mass, lanczos->user = solver, lanczos->n_basis = 2;
    if (body->active && (!PAL_NEW_DOUBLES(build->arena, n3, &solver->at, &solver->zero, &solver->force, &lanczos->z,
                                          &lanczos->w, &lanczos->u) ||
                         !PAL_NEW_DOUBLES(build->arena, 2 * n3, &lanczos->basis)))
        return PAL_ERR_MEMORY;
    solver->safety = safety;
    solver->reach = safety * 2.7;
    *self = solver;
    reset(solver, body);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_rk4 = {PAL_EFFECT("rk4", SOLVE), .moves_nodes = true, .bounds.limit = limit,
                                   .reset = reset};
