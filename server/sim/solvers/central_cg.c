/* Solver central_cg: central differences on the control points of a subdivision solid, with the mass matrix solved
 * by conjugate gradients (paper A section 3.3, eq. 16-20; explicit in the stiffness, erratum A10). Eq. 20 in
 * increments of body->v, the velocity between the points of time:
 *
 *     (M~ + theta k D~) (v+ - v) = k (f~ - D~ v),    p+ = p + dt v+,    theta = 1/2, k = dt, v = (p - p-) / dt
 *
 * In this form zero stays zero to the bit, and precision does not depend on the body's position. When the sub-step
 * changes, k is (dt + dt-) / 2 and theta dt- / (dt + dt-): D~ acts on the velocity at p, by interpolation. At the
 * start and after the body was placed elsewhere, v is the velocity at p and dt- = 0, which is the start p- = p - dt
 * v + dt^2 a / 2.
 *
 * D~ is the components' drag (hook `drag`) times M~, plus the samples' damping matrix where their gamma/mu varies.
 * Departure: theta is at least 1 - 1/(k gamma/mu), so that drag that would reverse the motion within a sub-step gives
 * creep instead. Conjugate gradients start with v+ = v, that is p+ = p + (p - p-), and end when |r| <= tolerance |k
 * (f~ - D~ v)| (key, 1e-4). This takes one iteration with the default preconditioner, a Cholesky factor of M~
 * (num/envelope.h), and 40 to 100 with key preconditioner "diagonal", the paper's. The paper's 2 to 4 iterations
 * leave 1e-4 of the whole right side of eq. 20.
 *
 * The sub-step is `safety` (key, 0.9) of 2 / omega_max of (M~, K~), by Lanczos iteration with K~ from differences of
 * forces at the present state (num/lanczos.h). It is computed at load, after edits, and again from the last Ritz
 * vector when points have moved a fifth of a control cell relative to one another, but at most once in 12 sub-steps,
 * and once in up to 96 while it changes by less than 2 %. Stiffness and damping that CONTACT components report at
 * nodes add their largest eigenvalues at the beginning of every step. Rows of fixed points are omitted; prescribed
 * points keep their velocity and act on their neighbours by its change. step_guard.h limits displacements; where it
 * does so, the stiffness is not the one the limit was computed for, so sub-steps are halved up to three times and
 * then return over PAL_BLEND_S. While elements are inverted sub-steps are half as long (the
 * displaced corner is the fastest mode, and near its limit shows up to twice its energy), unless the body is at rest.
 * Where the world cannot afford the sub-steps (step->adds_mass), all masses are scaled so that the limit is met. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/conjugate_gradient.h"
#include "server/num/envelope.h"
#include "server/num/lanczos.h"
#include "server/sim/core/blend.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/solvers/tuning.h"
#include "server/sim/subdivision/subdivision_mass.h"

#include <string.h>

typedef struct central {
    const pal_interpolation *A;
    const pal_mass_operator *mass;
    double safety, tolerance;
    double dt_s; /* previous sub-step; 0: none, v is that at p */
    pal_conjugate_gradient cg;
    double a, b;           /* its matrix is a M~ + b D~ on the free points, D~ that of the samples where it varies */
    pal_envelope envelope; /* n 0: too large or not requested */
    bool factored;
    uint8_t *fixed;   /* supports when the preconditioner was made [n_dof] */
    double *inverse;  /* 1 / diagonal of M~, 0 for fixed points                    [n_dof]    */
    double *change;   /* v+ - v                                                    [n_dof][3] */
    double *was;      /* v of the previous sub-step [n_dof][3] */
    uint64_t sampled; /* dofs.material_revision when the preconditioner was made; 0: never    */
    pal_solve_report report;

    /* ---- the limit ---- */
    pal_lanczos lanczos;
    double limit_s, omega2;       /* upper bound of omega^2 of the FORCE components, 1/s^2 */
    double cell_m;                /* approximate edge of a control cell */
    double moved_m;               /* upper bound of relative motion since the bound was computed */
    bool has_inversion;           /* inverted elements use their fallback */
    int n_unchecked;              /* sub-steps since the last check for inversion */
    int n_since, pause;           /* sub-steps since the last bound; min interval */
    bool known;                   /* omega2 is valid except for motion */
    double backoff;               /* divides the limit: 1, more after points were clamped */
    double contact2, contact_1_s; /* largest eigenvalues of contact's stiffness and of explicit damping over mass */
    pal_step *step;               /* that requests the limit */
    const double *x;              /* the body's own                                                       */
    double *at, *zero, *g, *g0;   /* saved x, v, g of the body during the iteration; g at the state itself [n_dof][3] */
    double *d, *dv, *f;           /* saved d, dv, f [n_node][3] */
    double *bound;                /* of CONTACT components                                           [n_node]    */
} central;

/* sub-steps, which are a fixed part of the period of the fastest mode: between bounds, at least and at most, and
 * between checks for inversion */
enum { PAUSE = 12, MAX_PAUSE = 96, UNCHECKED = 16 };
/* max iterations per sub-step; first and later ones of Lanczos; max entries of a factor */
enum { MAX_CG = 300, FIRST = 24, AGAIN = 6, MAX_ENTRY = 1 << 22 };

/* ---- the left side ---- */

static void multiply(void *user, const double *p, double *out)
{
    const central *solver = user;
    pal_mass_operator_multiply(solver->mass, solver->a, solver->b, solver->fixed, p, out);
}

static void precondition(void *user, const double *r, double *out)
{
    central *solver = user;
    if (solver->factored) {
        pal_envelope_solve(&solver->envelope, r, out);
        return;
    }
    for (int i = 0; i < solver->mass->n_point; i++)
        pal_scale3(out + 3 * (size_t)i, solver->inverse[i], r + 3 * (size_t)i);
}

/* rebuilds the preconditioner when masses or supports have changed; true: rebuilt */
static bool update_preconditioner(central *solver, const pal_body *body)
{
    const pal_mass_operator *m = solver->mass;
    if (solver->sampled == pal_dofs_material_revision(&body->dofs) &&
        !memcmp(solver->fixed, body->support, (size_t)body->n_dof))
        return false;
    solver->sampled = pal_dofs_material_revision(&body->dofs);
    memcpy(solver->fixed, body->support, (size_t)body->n_dof);
    for (int i = 0; i < m->n_point; i++) {
        int32_t k = m->start[i];
        while (m->point[k] != i) k++;
        solver->inverse[i] = solver->fixed[i] || !(m->mass_kg[k] > 0) ? 0 : 1 / m->mass_kg[k];
    }
    solver->factored = solver->envelope.n > 0 &&
                       !pal_envelope_factor(&solver->envelope, m->start, m->point, m->mass_kg, solver->fixed);
    return true;
}

static void clear_fixed(central *solver)
{
    for (int i = 0; i < solver->mass->n_point; i++)
        if (solver->fixed[i]) pal_set3(solver->cg.r + 3 * (size_t)i, 0, 0, 0);
}

/* x += A^-1 r with r in cg.r, until |r| <= target; rows of fixed points are omitted */
static void solve(central *solver, double *x, double target)
{
    clear_fixed(solver);
    solver->report.n_cg += pal_conjugate_gradient_run(&solver->cg, x, target, 0, MAX_CG);
}

/* ---- the limit ---- */

static bool solve_mass(void *user, const double *b, double *out)
{
    central *solver = user;
    const size_t n_byte = sizeof(double) * (size_t)solver->cg.n;
    memcpy(solver->cg.r, b, n_byte);
    memset(out, 0, n_byte);
    solver->a = 1, solver->b = 0;
    solve(solver, out, PAL_SOLVER_TOLERANCE * PAL_SOLVER_TOLERANCE * sqrt(pal_dot_product(solver->cg.n, b, b)));
    return true;
}

static bool assemble_forces(central *solver)
{
    pal_step *step = solver->step;
    const size_t used = step->scratch ? pal_arena_used(step->scratch) : 0;
    const bool good = !pal_assemble_forces(step);
    if (step->scratch) pal_arena_rewind(step->scratch, used);
    return good;
}

/* out = K~ v of the FORCE components, by the difference of forces over a small displacement along v */
static bool multiply_stiffness(void *user, const double *v, double *out)
{
    central *solver = user;
    const int n = solver->cg.n;
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, fabs(v[i]));
    const double small = max > 0 ? PAL_DIFFERENCE_H * solver->step->body->edge_m / max : 0,
                 per = max > 0 ? 1 / small : 0;
    for (int i = 0; i < n; i++) solver->at[i] = solver->x[i] + small * v[i];
    if (!assemble_forces(solver)) return false;
    for (int i = 0; i < n; i++) out[i] = solver->fixed[i / 3] ? 0 : per * (solver->g0[i] - solver->g[i]);
    return true;
}

/* out = A' bound A v, with one number of bound per node */
static bool multiply_bound(void *user, const double *v, double *out)
{
    central *solver = user;
    pal_interpolation_apply(solver->A, v, solver->f);
    for (int i = 0; i < solver->A->n_row; i++)
        pal_scale3(solver->f + 3 * (size_t)i, solver->bound[i], solver->f + 3 * (size_t)i);
    memset(out, 0, sizeof *out * (size_t)solver->cg.n);
    pal_interpolation_apply_transpose(solver->A, solver->f, out);
    for (int i = 0; i < solver->cg.n; i++) out[i] *= !solver->fixed[i / 3];
    return true;
}

/* adds arbitrary signs at the free points, of length `share` of the vector's norm, or 1 if it is zero */
static void add_any(const central *solver, double share, double *z)
{
    const double norm = sqrt(pal_dot_product(solver->cg.n, z, z)), each = share * norm / sqrt(solver->cg.n);
    for (int i = 0; i < solver->cg.n; i++) {
        uint64_t bits = ((uint64_t)(uint32_t)i + 1) * 0x9e3779b97f4a7c15u;
        bits ^= bits >> 29, bits *= 0xbf58476d1ce4e5b9u, bits ^= bits >> 32;
        if (!solver->fixed[i / 3]) z[i] += (norm > 0 ? each : 1) * ((double)(bits >> 11) * 0x1p-52 - 1);
    }
}

/* omega^2 of the FORCE components at the present position with zero velocity; restores all arrays of the body */
static double find_rows2(central *solver, pal_step *step)
{
    pal_body *body = step->body;
    const pal_body saved = *body;
    const bool drag_separate = step->drag_separate;
    const int n_cg = solver->report.n_cg;
    double max = NAN;
    solver->step = step, solver->x = body->x;
    memcpy(solver->at, body->x, sizeof(double) * (size_t)solver->cg.n);
    body->x = solver->at, body->v = solver->zero, body->g = solver->g;
    body->d = solver->d, body->dv = solver->dv, body->f = solver->f;
    step->drag_separate = true;
    if (assemble_forces(solver)) {
        memcpy(solver->g0, solver->g, sizeof(double) * (size_t)solver->cg.n);
        if (!solver->known) memset(solver->lanczos.z, 0, sizeof(double) * (size_t)solver->cg.n);
        add_any(solver, 0.1, solver->lanczos.z);
        solver->lanczos.multiply = multiply_stiffness;
        max = pal_lanczos_run(&solver->lanczos, PAL_SOLVER_TOLERANCE, solver->known ? 3 : 8,
                              solver->known ? AGAIN : FIRST);
    }
    step->drag_separate = drag_separate;
    body->x = saved.x, body->v = saved.v, body->g = saved.g;
    body->d = saved.d, body->dv = saved.dv, body->f = saved.f;
    solver->report.n_cg = n_cg;
    return max > 0 || isnan(max) ? max : 0;
}

/* the largest eigenvalue of solver->bound over mass */
static double find_bound(central *solver)
{
    /* keep the Ritz vector of the FORCE components */
    double *z = solver->lanczos.z, sum = 0;
    const int n_cg = solver->report.n_cg;
    for (int i = 0; i < solver->A->n_row; i++) sum += solver->bound[i];
    if (sum == 0) return 0;
    solver->lanczos.z = solver->at;
    memset(solver->at, 0, sizeof(double) * (size_t)solver->cg.n);
    add_any(solver, 0, solver->at);
    multiply_bound(solver, solver->at, solver->g);
    memcpy(solver->at, solver->g, sizeof(double) * (size_t)solver->cg.n);
    solver->lanczos.multiply = multiply_bound;
    const double max = pal_lanczos_run(&solver->lanczos, PAL_SOLVER_TOLERANCE, 2, AGAIN);
    solver->lanczos.z = z;
    solver->report.n_cg = n_cg;
    return max;
}

/* contact changes between steps without motion of any point */
static void find_contact(central *solver, const pal_step *step)
{
    const size_t n_byte = sizeof(double) * (size_t)solver->A->n_row;
    memset(solver->bound, 0, n_byte);
    for (int i = 0; i < step->n_contact; i++) {
        const pal_effect *effect = step->contact[i].effect;
        if (effect->bounds.stiffness) effect->bounds.stiffness(step->contact[i].self, step->body, solver->bound);
        if (effect->bounds.wanted) effect->bounds.wanted(step->contact[i].self, step->body, solver->bound);
    }
    solver->contact2 = find_bound(solver);
    memset(solver->bound, 0, n_byte);
    for (int i = 0; i < step->n_contact + step->n_force; i++) {
        const pal_component *of = i < step->n_contact ? &step->contact[i] : &step->force[i - step->n_contact];
        if (of->effect->bounds.damping && !of->effect->drag)
            of->effect->bounds.damping(of->self, step->body, solver->bound);
    }
    solver->contact_1_s = find_bound(solver);
}

static void update_omega2(central *solver, pal_step *step)
{
    const double before = solver->known ? solver->omega2 : 0;
    solver->omega2 = find_rows2(solver, step);
    bool same = fabs(solver->omega2 - before) <= PAL_SOLVER_TOLERANCE * before;
    solver->pause = !same ? PAUSE : solver->pause < MAX_PAUSE ? 2 * solver->pause : MAX_PAUSE;
    solver->known = true;
    solver->moved_m = 0;
    solver->n_since = 0;
}

/* true: elements were found inverted and use their fallback from now on */
static bool recover(central *solver, pal_step *step)
{
    pal_body *body = step->body;
    double *d = body->d;
    if (solver->n_unchecked < (step->sub == 0 ? UNCHECKED / 2 : UNCHECKED)) return false;
    solver->n_unchecked = 0;
    pal_interpolation_apply(body->interpolation, body->x, solver->d);
    body->d = solver->d;
    const unsigned seen = pal_guard_recover(step);
    body->d = d;
    /* half a sub-step of the previous length with the forces of another law would be an impulse */
    if (seen & PAL_INVERSION_CHANGED) solver->dt_s = 0;
    solver->has_inversion = (seen & PAL_INVERTED) && !(seen & PAL_INVERSION_AT_REST);
    return seen & PAL_INVERSION_CHANGED;
}

/* with lambda the largest omega^2 and c that of damping, symplectic steps are stable for dt^2 lambda + 2 dt c < 4 */
static double limit(void *self, pal_step *step)
{
    central *solver = self;
    const pal_body *body = step->body;
    if (!pal_body_finite(body)) return NAN;
    if (update_preconditioner(solver, body) || recover(solver, step)) solver->known = false;
    if (!solver->known || (solver->n_since >= solver->pause && !(solver->moved_m <= PAL_GUARD_MOVE * solver->cell_m)))
        update_omega2(solver, step);
    if (step->sub == 0) find_contact(solver, step);
    const double omega2 = solver->has_inversion ? 4 * solver->omega2 : solver->omega2,
                 lambda = omega2 + solver->contact2, c = solver->contact_1_s;
    solver->limit_s = solver->safety * 4 / (c + sqrt(c * c + 4 * lambda)) / solver->backoff;
    return solver->limit_s;
}

/* ---- a sub-step ---- */

/* applies the known change of velocity of fixed points; `was` is v before the change. True: it is not 0 */
static bool begin_change(central *solver, const pal_body *body)
{
    bool any = false;
    memset(solver->change, 0, sizeof(double) * (size_t)solver->cg.n);
    for (int i = 0; i < body->n_dof; i++) {
        double *was = solver->was + 3 * (size_t)i, *change = solver->change + 3 * (size_t)i;
        const double *v = body->v + 3 * (size_t)i;
        if (body->support[i] == PAL_PRESCRIBED && solver->dt_s > 0)
            pal_sub3(change, v, was);
        else
            pal_copy3(was, v);
        if (body->support[i] == PAL_FIXED) pal_scale3(change, -1, v);
        any |= change[0] != 0 || change[1] != 0 || change[2] != 0;
    }
    return any;
}

/* r -= (a M~ + b D~)(s was + t change); z and q are free */
static void subtract_product(central *solver, double a, double b, double s, double t)
{
    for (int i = 0; i < solver->cg.n; i++) solver->cg.z[i] = s * solver->was[i] + t * solver->change[i];
    solver->a = a, solver->b = b;
    multiply(solver, solver->cg.z, solver->cg.q);
    for (int i = 0; i < solver->cg.n; i++) solver->cg.r[i] -= solver->cg.q[i];
}

static void find_change(central *solver, const pal_step *step)
{
    const pal_body *body = step->body;
    const double dt = step->dt_s, k = 0.5 * (dt + solver->dt_s), rate = pal_guard_drag_1_s(step->force, step->n_force),
                 over = solver->limit_s > 0 ? dt / solver->limit_s : 0;
    const double scale = step->adds_mass && over > 1 ? over * over : 1;
    const bool varies = solver->mass->damping_kg_s != NULL, moves = begin_change(solver, body);
    const double max = k * (rate + (varies ? solver->mass->damping_max_1_s : 0));
    double theta = solver->dt_s / (dt + solver->dt_s);
    if (max > 0) theta = fmax(theta, 1 - 1 / max);
    const double a = scale + theta * k * rate, b = varies ? theta * k : 0;
    for (int i = 0; i < solver->cg.n; i++) solver->cg.r[i] = k * body->g[i];
    if (rate > 0 || moves) subtract_product(solver, 1, 0, k * rate, a);
    if (varies) subtract_product(solver, 0, 1, k, b);
    solver->a = a, solver->b = b;
    clear_fixed(solver);
    const double norm = sqrt(pal_dot_product(solver->cg.n, solver->cg.r, solver->cg.r));
    if (step->sub == 0) solver->report.n_cg = 0;
    const double before = pal_clock_s();
    solve(solver, solver->change, solver->tolerance * norm);
    solver->report.solve_s += pal_clock_s() - before;
    /* non-finite forces give non-finite velocities */
    for (int i = 0; i < solver->cg.n && !isfinite(norm); i++) solver->change[i] = NAN;
    solver->report.residual = norm > 0 ? solver->cg.residual / norm : 0;
    solver->report.converged = solver->cg.residual <= solver->tolerance * norm;
}

/* computes v+ and p+; returns the largest relative displacement of a point, not finite when a velocity is not */
static double move(central *solver, pal_body *body, double dt)
{
    const double max_m = pal_guard_max_move_m(body);
    const uint64_t n_clamped = body->safeguards.n_clamped;
    double mean[3] = {0, 0, 0}, max2 = 0, non_finite = 0;
    for (int i = 0; i < body->n_dof; i++) {
        double *v = body->v + 3 * (size_t)i;
        /* prescribed points already have theirs */
        if (body->support[i] == PAL_FIXED) pal_set3(v, 0, 0, 0);
        if (!body->support[i]) pal_add3(v, v, solver->change + 3 * (size_t)i);
        const double move_m = pal_norm3(v) * dt;
        non_finite += 0 * move_m;
        if (move_m > max_m) {
            uint64_t before = pal_clock_ns();
            pal_scale3(v, pal_guard_shorten(move_m, max_m, &body->safeguards.n_clamped), v);
            body->safeguards.ns += pal_clock_ns() - before;
        }
        pal_axpy3(body->x + 3 * (size_t)i, dt, v);
        pal_copy3(solver->was + 3 * (size_t)i, v);
        pal_axpy3(mean, 1.0 / body->n_dof, v);
    }
    for (int i = 0; i < body->n_dof; i++) {
        double from[3];
        pal_sub3(from, body->v + 3 * (size_t)i, mean);
        max2 = fmax(max2, pal_dot3(from, from));
    }
    solver->backoff = body->safeguards.n_clamped > n_clamped
                          ? fmin(2 * solver->backoff, PAL_BACKOFF_MAX)
                          : pal_blend_toward(solver->backoff, 1, (PAL_BACKOFF_MAX - 1) * dt, PAL_BLEND_S);
    return dt * sqrt(max2) + non_finite;
}

static pal_err run(void *self, pal_step *step)
{
    central *solver = self;
    step->drag_separate = true;
    PAL_TRY(pal_assemble_forces(step));
    update_preconditioner(solver, step->body);
    find_change(solver, step);
    solver->moved_m += move(solver, step->body, step->dt_s);
    solver->dt_s = step->dt_s;
    solver->n_since += solver->n_since < MAX_PAUSE;
    solver->n_unchecked++;
    return PAL_ERR_OK;
}

/* ---- hooks ---- */

static pal_err allocate(central *solver, const pal_body *body, pal_arena *arena)
{
    const size_t n3 = 3 * (size_t)body->n_dof;
    pal_conjugate_gradient *cg = &solver->cg;
    pal_lanczos *lanczos = &solver->lanczos;
    solver->fixed = PAL_NEW(arena, uint8_t, body->n_dof);
    const bool made =
        solver->fixed && PAL_NEW_DOUBLES(arena, FIRST * n3, &lanczos->basis) &&
        PAL_NEW_DOUBLES(arena, n3, &cg->r, &cg->z, &cg->p, &cg->q, &solver->change, &solver->was, &solver->at,
                        &solver->zero, &solver->g, &solver->g0, &lanczos->z, &lanczos->w, &lanczos->u,
                        &solver->inverse) &&
        PAL_NEW_DOUBLES(arena, 3 * (size_t)body->n_node, &solver->d, &solver->dv, &solver->f, &solver->bound);
    cg->n = lanczos->n = (int)n3;
    lanczos->n_basis = FIRST;
    cg->multiply = multiply, cg->precondition = precondition, cg->user = solver;
    lanczos->multiply = multiply_stiffness, lanczos->solve = solve_mass, lanczos->user = solver;
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double safety = 0.9, tolerance = 1e-4;
    static const char *const preconditioner[] = {"factor", "diagonal"};
    int kind = 0;
    const pal_body *body = build->body;
    PAL_TRY(pal_entry_read_number(item, "safety", 0.01, 0.98, &safety, build->diag));
    PAL_TRY(pal_entry_read_number(item, "tolerance", 1e-14, 0.1, &tolerance, build->diag));
    PAL_TRY(pal_entry_read_choice(item, "preconditioner", preconditioner, 2, &kind, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    if (!body->interpolation || !body->mass_operator)
        return PAL_REFUSE(build->diag, "%s: \"%s\" needs a body of model subdivision_fem", item->path, item->name);
    central *solver = PAL_NEW(build->arena, central, 1);
    if (!solver) return PAL_ERR_MEMORY;
    solver->A = body->interpolation, solver->mass = body->mass_operator;
    solver->n_unchecked = UNCHECKED;
    solver->safety = safety, solver->tolerance = tolerance, solver->backoff = 1;
    solver->cell_m = body->dofs.spacing_m;
    PAL_TRY(allocate(solver, body, build->arena));
    if (kind == 0) {
        pal_err err = pal_envelope_make(solver->mass->n_point, solver->mass->start, solver->mass->point, MAX_ENTRY,
                                        build->arena, &solver->envelope);
        if (err && err != PAL_ERR_BUDGET) return err;
    }
    *self = solver;
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    central *solver = self;
    (void)body;
    solver->dt_s = 0;
    solver->backoff = 1;
    solver->has_inversion = false;
    solver->known = false;
    solver->n_unchecked = UNCHECKED;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    (void)body, (void)to, (void)diag;
    ((central *)self)->known = false;
    return PAL_ERR_OK;
}

static void report(const void *self, pal_solve_report *out)
{
    const central *solver = self;
    *out = solver->report;
    out->factor_nonzeros = solver->factored ? solver->envelope.start[solver->envelope.n] : 0;
}

static void accuracy(void *self, pal_solve_accuracy *to)
{
    central *solver = self;
    const double before = solver->tolerance;
    solver->tolerance = to->tolerance;
    to->tolerance = before;
}

const pal_effect pal_effect_central_cg = {PAL_EFFECT("central_cg", SOLVE), .bounds.limit = limit, .material = material,
                                          .reset = reset, .inspect = {.report = report, .accuracy = accuracy}};
