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
 * Where the world cannot afford the sub-steps (step->heavy), nodes that break the limit get the mass that meets it.
 * Components check for inverted elements whenever the bounds are computed, and in every step while there are any. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/surface/active_nodes.h"

#include <string.h>

/* Data of a node between the stages, as position and velocity: the start of its next stage, and the sum of rates. In
 * Lanczos iteration: position and q, forces at the state itself and the previous q */
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
    uint8_t *led;
    bool pulls;           /* all FORCE components support active_nodes */
    double safety, reach; /* of the stability limit; safety times the radius 2.7 */
    double limit_s;
    double way_m; /* upper bound of motion since the bounds were computed */
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
    double over;   /* max overestimate of omega by row sums */
    double *at, *still,
        *force; /* saved x, v and f of the body during the iteration [n_dof][3]; NULL: no adaptive surface */
} rk4;

static const double radius = 2.7;
/* row sums are rarely more than `max_over` times too high, or `more` times more so than last time */
static const double max_over = 1.6, more = 1.05;
/* sub-steps between Lanczos bounds, and iterations for one, each an evaluation of forces */
enum { PAUSE = 12, LANCZOS = 10 };

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double safety = 0.9;
    PAL_TRY(pal_entry_read_number(item, "safety", 0.01, 0.96, &safety, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    if (build->body->interpolation)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED,
                                  "%s: \"rk4\" moves nodes, those of this body are carried by control points; take "
                                  "\"central_cg\" or \"implicit_euler\"",
                                  item->path);
    const pal_body *body = build->body;
    rk4 *row = PAL_NEW(build->arena, rk4, 1);
    if (!row) return PAL_ERR_MEMORY;
    row->stiff = PAL_NEW(build->arena, double, body->n_dof);
    row->damp = PAL_NEW(build->arena, double, body->n_dof);
    row->memory = PAL_NEW(build->arena, memory, body->n_dof);
    row->load = PAL_NEW(build->arena, pal_quad, body->n_dof);
    row->inverse_kg = PAL_NEW(build->arena, double, body->n_dof);
    row->led = PAL_NEW(build->arena, uint8_t, body->n_dof);
    if (!row->stiff || !row->damp || !row->memory || !row->load || !row->inverse_kg || !row->led) return PAL_ERR_MEMORY;
    PAL_TRY(pal_active_nodes_make(build->body, build->body_arena ? build->body_arena : build->arena));
    if (body->active) {
        row->at = PAL_NEW(build->arena, double, 3 * (size_t)body->n_dof);
        row->still = PAL_NEW(build->arena, double, 3 * (size_t)body->n_dof);
        row->force = PAL_NEW(build->arena, double, 3 * (size_t)body->n_dof);
        if (!row->at || !row->still || !row->force) return PAL_ERR_MEMORY;
    }
    row->n_since = PAUSE;
    row->over = max_over;
    row->safety = safety;
    row->reach = safety * radius;
    *self = row;
    return PAL_ERR_OK;
}

/* ---- forces ---- */

/* the body's state and its loads */
static void take_body(rk4 *row, const pal_step *step)
{
    const pal_body *body = step->body;
    pal_active_nodes_load(body);
    row->pulls = pal_active_nodes_complete(step);
    for (int k = 0; k < body->n_active && row->pulls; k++)
        row->load[k] = pal_quad_load(body->load + 3 * (size_t)pal_body_point(body, k));
}

/* copies positions and velocities of active_nodes to the body */
static void give_motion(const pal_body *body)
{
    for (int k = 0; k < body->n_active; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_quad_store(body->x + i, pal_v8_low(body->active_nodes->xv[k]));
        pal_quad_store(body->v + i, pal_v8_high(body->active_nodes->xv[k]));
    }
}

/* forces at the positions and velocities of active_nodes, into active_nodes */
static pal_err find_forces(const rk4 *row, pal_step *step)
{
    pal_body *body = step->body;
    if (row->pulls) {
        memcpy(body->active_nodes->f, row->load, sizeof *row->load * (size_t)body->n_active);
        return pal_active_nodes_assemble(step);
    }
    give_motion(body);
    PAL_TRY(pal_assemble_forces(step));
    for (int k = 0; k < body->n_active; k++)
        body->active_nodes->f[k] = pal_quad_load(body->g + 3 * (size_t)pal_body_point(body, k));
    return PAL_ERR_OK;
}

/* ---- the limit ---- */

/* true: the last bound is still valid */
static bool still_known(const rk4 *row, const pal_step *step)
{
    const pal_body *body = step->body;
    /* a non-finite bound is unknown */
    if (!row->known || row->revision != body->revision || !(row->way_m <= PAL_GUARD_RECHECK * body->edge_m))
        return false;
    if (body->active && (row->ramp[0] != *body->dofs.ramp[0] || row->ramp[1] != *body->dofs.ramp[1])) return false;
    if (body->active && !row->sharp_known && row->n_since >= PAUSE) return false;
    return step->sub != 0 || !pal_guard_has_bounds(step->contact, step->n_contact);
}

/* max over free nodes of row sums of stiffness over mass */
static double max_stiff(const rk4 *row, const pal_body *body)
{
    double max = 0;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double omega2 = row->stiff[i] / body->mass_kg[i];
        if (!body->support[i] && omega2 > max) max = omega2;
    }
    return max;
}

/* 1 for a state and row sums that are finite, else NaN */
static double one_if_finite(const rk4 *row, const pal_body *body)
{
    double sum = 0;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        const double *x = body->x + 3 * (size_t)i, *v = body->v + 3 * (size_t)i;
        sum += 0 * row->stiff[i] + 0 * row->damp[i];
        for (int q = 0; q < 3; q++) sum += 0 * x[q] + 0 * v[q];
    }
    return 1 + sum;
}

/* ---- Lanczos' iteration; vectors are sqrt(m) times displacements, A q replaces the forces ---- */

/* the first vector: arbitrary signs, weighted by row sums over mass, because fast modes are where nodes are stiffest */
static void begin_lanczos(rk4 *row, const pal_body *body)
{
    double norm2 = 0;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double weight = row->stiff[i] / body->mass_kg[i];
        uint64_t bits = ((uint64_t)(uint32_t)i + 1) * 0x9e3779b97f4a7c15u;
        pal_quad q = {0};
        row->inverse_kg[k] = body->support[i] ? 0 : 1 / sqrt(body->mass_kg[i]);
        for (int c = 0; c < 3 && !body->support[i]; c++) {
            bits ^= bits >> 29, bits *= 0xbf58476d1ce4e5b9u;
            q[c] = weight * ((double)(bits >> 11) * 0x1p-52 - 1);
        }
        norm2 += pal_quad_dot(q, q);
        row->memory[k].from = pal_v8_join(pal_v8_low(body->active_nodes->xv[k]), q);
        row->memory[k].sum = pal_v8_join(body->active_nodes->f[k], (pal_quad){0});
    }
    const pal_quad one = {1, 1, 1, 1};
    const pal_v8 scale = pal_v8_join(one, norm2 > 0 ? one / sqrt(norm2) : 0 * one);
    for (int k = 0; k < body->n_active; k++) row->memory[k].from *= scale;
}

/* A q by the difference of forces over a displacement of 1e-6 of an element; returns q A q */
static pal_err apply_stiffness(rk4 *row, pal_step *step, double *along)
{
    pal_body *body = step->body;
    pal_active_nodes *pack = body->active_nodes;
    double max2 = 0;
    for (int k = 0; k < body->n_active; k++) {
        pal_quad q = row->inverse_kg[k] * pal_v8_high(row->memory[k].from);
        double q2 = pal_quad_dot(q, q);
        max2 = q2 > max2 ? q2 : max2;
    }
    double small = max2 > 0 ? 1e-6 * body->edge_m / sqrt(max2) : 0, per = max2 > 0 ? 1 / small : 0;
    for (int k = 0; k < body->n_active; k++) {
        pal_quad move = small * row->inverse_kg[k] * pal_v8_high(row->memory[k].from);
        pack->xv[k] = pal_v8_join(pal_v8_low(row->memory[k].from) + move, (pal_quad){0});
    }
    PAL_TRY(find_forces(row, step));
    *along = 0;
    for (int k = 0; k < body->n_active; k++) {
        pack->f[k] = per * row->inverse_kg[k] * (pal_v8_low(row->memory[k].sum) - pack->f[k]);
        *along += pal_quad_dot(pack->f[k], pal_v8_high(row->memory[k].from));
    }
    return PAL_ERR_OK;
}

/* the next vector from A q - alpha q - beta q'; returns its norm before normalisation */
static double next_lanczos(rk4 *row, const pal_body *body, double alpha, double beta)
{
    double norm2 = 0;
    for (int k = 0; k < body->n_active; k++) {
        memory *m = &row->memory[k];
        pal_quad q = pal_v8_high(m->from), next = body->active_nodes->f[k] - (alpha * q + beta * pal_v8_high(m->sum));
        norm2 += pal_quad_dot(next, next);
        m->sum = pal_v8_join(pal_v8_low(m->sum), q);
        m->from = pal_v8_join(pal_v8_low(m->from), next);
    }
    const pal_quad one = {1, 1, 1, 1};
    const double norm = sqrt(norm2);
    const pal_v8 scale = pal_v8_join(one, norm > 0 ? one / norm : 0 * one);
    for (int k = 0; k < body->n_active; k++) row->memory[k].from *= scale;
    return norm;
}

/* largest eigenvalue of the tridiagonal matrix with diagonal a and off-diagonal b, plus the residual from b[n - 1].
 * Bisection below `max`, an upper bound, by the signs of leading minors */
static double largest_of(const double *a, const double *b, int n, double max)
{
    double low = a[0], high = max;
    for (int turn = 0; turn < 30 && low < high; turn++) {
        double middle = 0.5 * (low + high), d = middle - a[0];
        bool above = d > 0;
        for (int i = 1; i < n && above; i++) {
            d = middle - a[i] - b[i - 1] * b[i - 1] / d;
            above = d > 0;
        }
        *(above ? &high : &low) = middle;
    }
    /* its eigenvector, from the first entry on */
    double last = 0, s = 1, sum = 1;
    for (int i = 0; i + 1 < n; i++) {
        double next = ((high - a[i]) * s - (i > 0 ? b[i - 1] * last : 0)) / b[i];
        last = s, s = next, sum += s * s;
    }
    return high + fabs(b[n - 1] * s) / sqrt(sum);
}

/* Lanczos bound on omega^2 of the FORCE components; above `max`: no better bound */
static pal_err run_lanczos(rk4 *row, pal_step *step, double max, double *out)
{
    double a[LANCZOS], b[LANCZOS];
    int n = 0;
    take_body(row, step);
    PAL_TRY(find_forces(row, step));
    begin_lanczos(row, step->body);
    while (n < LANCZOS) {
        PAL_TRY(apply_stiffness(row, step, &a[n]));
        b[n] = next_lanczos(row, step->body, a[n], n > 0 ? b[n - 1] : 0);
        if (!(b[n++] > 1e-6 * max)) break;
    }
    *out = largest_of(a, b, n, 1.01 * max);
    return PAL_ERR_OK;
}

/* the same at zero velocity; restores all arrays of the body */
static void find_sharp(rk4 *row, pal_step *step, double max)
{
    pal_body *body = step->body;
    const pal_body kept = *body;
    const bool apart = step->drag_separate;
    for (int k = 0; k < body->n_active; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_copy3(row->at + i, body->x + i);
    }
    body->x = body->d = row->at;
    body->v = body->dv = row->still;
    body->f = body->g = row->force;
    step->drag_separate = true;
    double sharp2 = NAN;
    row->sharp_known = !run_lanczos(row, step, max, &sharp2) && sharp2 == sharp2;
    row->sharp2 = sharp2;
    row->over = more * fmax(1, sqrt(max / row->sharp2));
    step->drag_separate = apart;
    body->x = kept.x, body->d = kept.d, body->v = kept.v, body->dv = kept.dv, body->f = kept.f, body->g = kept.g;
    row->sharp_ramp[0] = *body->dofs.ramp[0], row->sharp_ramp[1] = *body->dofs.ramp[1];
    row->n_since = 0;
}

/* true: a longer limit would save a sub-step */
static bool would_help(const rk4 *row, double max)
{
    double n = row->step_s * sqrt(max) / row->reach;
    return !(row->step_s > 0) || ceil(n / row->over) < ceil(n);
}

/* omega^2 of the FORCE components: at most the largest row sum `max`. If the common factors have grown for only part of
 * the stiffness, scaling all of it gives an upper bound */
static double bound_force(rk4 *row, pal_step *step, double max)
{
    const pal_body *body = step->body;
    /* called from outside without motion: the world asks at rest, with positions that are not the body's */
    if (!body->active || body->x == body->x_rest) return max;
    bool moved = row->revision != body->revision || !(row->way_m <= PAL_GUARD_RECHECK * body->edge_m);
    row->sharp_known &= !moved;
    if (!row->sharp_known && row->n_since >= PAUSE) {
        if (would_help(row, max))
            find_sharp(row, step, max);
        else
            row->n_since = 0;
    }
    if (!row->sharp_known) return max;
    double grown = fmax(1, fmax(*body->dofs.ramp[0] / row->sharp_ramp[0], *body->dofs.ramp[1] / row->sharp_ramp[1]));
    return fmin(max, grown * row->sharp2);
}

static double limit(void *self, pal_step *step)
{
    rk4 *row = self;
    const pal_body *body = step->body;
    if (!(step->sub == 0 && row->has_inversion) && still_known(row, step)) return row->limit_s;
    row->has_inversion = pal_guard_recover(step) & PAL_INVERTED;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        row->stiff[i] = row->damp[i] = 0;
    }
    pal_guard_add_bounds(step->contact, step->n_contact, body, row->stiff, row->damp);
    double contact2 = max_stiff(row, body);
    pal_guard_add_bounds(step->force, step->n_force, body, row->stiff, row->damp);
    /* the largest of omega^2 and c */
    double max2 = max_stiff(row, body), max = 0;
    row->limit_s = one_if_finite(row, body);
    if (row->limit_s == 1) max2 = fmin(max2, bound_force(row, step, max2) + contact2);
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double c = row->damp[i] / body->mass_kg[i];
        if (!body->support[i] && c > max) max = c;
    }
    max = fmax(sqrt(max2), max);
    row->limit_s *= max > 0 ? row->reach / max : INFINITY;
    if (!row->sharp_known || row->n_since == 0) row->way_m = 0;
    row->revision = body->revision;
    for (int k = 0; k < 2 && body->active; k++) row->ramp[k] = *body->dofs.ramp[k];
    row->known = true;
    return row->limit_s;
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

static pal_v8 both(double place, double velocity)
{
    const pal_quad one = {1, 1, 1, 1};
    return pal_v8_join(place * one, velocity * one);
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

/* inverse masses: fixed nodes have no acceleration, and those that do not move no velocity */
static void take_masses(rk4 *row, const pal_body *body, const rates *r, bool heavy)
{
    double t = r->dt / row->reach;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        double mass = body->mass_kg[i];
        if (heavy) mass = fmax(mass, fmax(t * t * row->stiff[i], t * row->damp[i]));
        row->inverse_kg[k] = body->support[i] ? 0 : 1 / mass;
        row->led[k] = body->support[i] == PAL_PRESCRIBED;
        if (body->support[i] == PAL_FIXED)
            body->active_nodes->xv[k] = pal_v8_join(pal_v8_low(body->active_nodes->xv[k]), (pal_quad){0});
    }
}

/* velocity and acceleration of an active node */
PAL_INLINE pal_v8 rate_of(const rk4 *row, const pal_active_nodes *pack, int k)
{
    return pal_v8_join(pal_v8_high(pack->xv[k]), row->inverse_kg[k] * pack->f[k]);
}

/* the state at the start, and the second stage's */
static void stage_first(rk4 *row, const pal_body *body, const rates *r)
{
    pal_active_nodes *pack = body->active_nodes;
    for (int k = 0; k < body->n_active; k++) {
        memory *m = &row->memory[k];
        const pal_v8 y = pack->xv[k], rate = rate_of(row, pack, k);
        m->from = y;
        m->sum = r->whole[row->led[k]] * y + r->weight[0] * rate;
        pack->xv[k] = r->half[row->led[k]] * y + r->grow * rate;
    }
}

/* the third stage's state from the second stage's forces. The fourth stage's velocity continues from the second's
 * after drag, less the contribution of the first acceleration */
static void stage_second(rk4 *row, const pal_body *body, const rates *r)
{
    pal_active_nodes *pack = body->active_nodes;
    for (int k = 0; k < body->n_active; k++) {
        memory *m = &row->memory[k];
        const pal_v8 y = pack->xv[k], rate = rate_of(row, pack, k), half = r->half[row->led[k]];
        const pal_v8 kept = half * m->from, next = half * y - (y - kept);
        m->sum += r->weight[1] * rate;
        m->from = pal_v8_join(pal_v8_low(m->from), pal_v8_high(next));
        pack->xv[k] = kept + r->grow * rate;
    }
}

/* the fourth stage's state from the third stage's forces */
static void stage_third(rk4 *row, const pal_body *body, const rates *r)
{
    pal_active_nodes *pack = body->active_nodes;
    for (int k = 0; k < body->n_active; k++) {
        memory *m = &row->memory[k];
        const pal_v8 rate = rate_of(row, pack, k);
        m->sum += r->weight[1] * rate;
        pack->xv[k] = m->from + r->last * rate;
    }
}

/* the final state from the fourth stage's forces; returns the square of the largest displacement, NaN if one is NaN */
static double stage_last(rk4 *row, const pal_body *body, const rates *r)
{
    pal_active_nodes *pack = body->active_nodes;
    const double dt2 = r->dt * r->dt;
    double max2 = 0, poison = 0;
    for (int k = 0; k < body->n_active; k++) {
        const memory *m = &row->memory[k];
        const pal_v8 sum = m->sum + r->weight[2] * rate_of(row, pack, k), square = sum * sum;
        double way2 = square[0] + square[1] + square[2], v2 = dt2 * (square[4] + square[5] + square[6]);
        pack->xv[k] = pal_v8_join(pal_v8_low(m->from) + pal_v8_low(sum), pal_v8_high(sum));
        poison += 0 * way2 + 0 * v2;
        way2 = v2 > way2 ? v2 : way2;
        max2 = way2 > max2 ? way2 : max2;
    }
    return max2 + poison;
}

/* limits displacements to max_m, and velocities that would cause longer ones */
static void clamp_moves(const rk4 *row, pal_body *body, double dt_s, double max_m)
{
    for (int k = 0; k < body->n_active; k++) {
        pal_v8 *to = &body->active_nodes->xv[k];
        pal_quad from = pal_v8_low(row->memory[k].from), move = pal_v8_low(*to) - from, v = pal_v8_high(*to);
        double way = sqrt(pal_quad_dot(move, move)), speed = sqrt(pal_quad_dot(v, v)) * dt_s;
        if (way > max_m) move *= max_m / way;
        if (speed > max_m) v *= max_m / speed;
        if (way > max_m || speed > max_m) *to = pal_v8_join(from + move, v);
        body->safeguards.n_clamped += way > max_m || speed > max_m;
    }
}

/* forces of the fourth stage, for support reactions */
static void give_forces(const rk4 *row, const pal_body *body)
{
    for (int k = 0; k < body->n_active && row->pulls; k++)
        pal_quad_store(body->f + 3 * (size_t)pal_body_point(body, k), body->active_nodes->f[k]);
}

static pal_err run(void *self, pal_step *step)
{
    rk4 *row = self;
    pal_body *body = step->body;
    const rates r = find_rates(step->dt_s, pal_guard_drag_1_s(step->force, step->n_force));
    step->drag_separate = true;
    take_body(row, step);
    take_masses(row, body, &r, step->heavy);
    PAL_TRY(find_forces(row, step));
    stage_first(row, body, &r);
    PAL_TRY(find_forces(row, step));
    stage_second(row, body, &r);
    PAL_TRY(find_forces(row, step));
    stage_third(row, body, &r);
    PAL_TRY(find_forces(row, step));
    double way = sqrt(stage_last(row, body, &r)), max = pal_guard_max_move_m(body);
    if (way > max) {
        uint64_t before = pal_clock_ns();
        clamp_moves(row, body, step->dt_s, max);
        body->safeguards.ns += pal_clock_ns() - before;
    }
    give_motion(body);
    give_forces(row, body);
    row->way_m += way > max ? max : way;
    row->n_since += row->n_since < PAUSE;
    if (step->sub == 0) row->step_s = step->dt_s * step->n_sub;
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    rk4 *row = self;
    (void)body;
    row->known = row->sharp_known = false;
    row->n_since = PAUSE;
    row->step_s = 0;
    row->over = max_over;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    (void)to, (void)diag;
    reset(self, body);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_rk4 = {.name = "rk4",
                                   .stage = PAL_STAGE_SOLVE,
                                   .make = make,
                                   .run = run,
                                   .limit = limit,
                                   .material = material,
                                   .reset = reset};
