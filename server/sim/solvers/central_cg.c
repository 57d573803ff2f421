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
 * D~ is the components' drag (hook `drag`) and the body's stiffening damper (stiffening_damper.h) times M~, plus the
 * samples' damping matrix where their gamma/mu varies. Departure: theta is at least 1 - 1/(k gamma/mu), so that drag
 * that would reverse the motion within a sub-step gives creep instead. Conjugate gradients start with v+ = v, that
 * is p+ = p + (p - p-), and end when |r| <= tolerance |k (f~ - D~ v)| (key, 1e-4). This takes one iteration with the
 * default preconditioner, a Cholesky factor of M~ (num/envelope.h), and 40 to 100 with key preconditioner
 * "diagonal", the paper's. The paper's 2 to 4 iterations leave 1e-4 of the whole right side of eq. 20.
 *
 * The sub-step is `safety` (key, 0.9) of 2 / omega_max of (M~, K~), by Lanczos iteration with K~ from differences of
 * forces at the present state (num/lanczos.h). It is computed at load, after edits, and again from the last Ritz
 * vector when points have moved a fifth of a control cell relative to one another, but at most once in 12 sub-steps,
 * and once in up to 96 while it changes by less than 2 %. Stiffness and damping that CONTACT components report at
 * nodes add their largest eigenvalues at the beginning of every step. Rows of fixed points are omitted; prescribed
 * points keep their velocity and act on their neighbours by its change. step_guard.h limits displacements; where it
 * does so, the stiffness is not the one the limit was computed for, so sub-steps are halved up to three times and
 * then grow by 2 % of the reduction per sub-step. While elements are inverted sub-steps are 0.6 times as long,
 * unless the body is at rest. Where the world cannot afford the sub-steps (step->heavy), all masses are scaled so
 * that the limit is met. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/conjugate_gradient.h"
#include "server/num/envelope.h"
#include "server/num/lanczos.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/subdivision/subdivision_mass.h"

#include <string.h>

typedef struct central {
    const pal_interpolation *rows;
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
    double limit_s, rows2;        /* upper bound of omega^2 of the FORCE components, 1/s^2 */
    double cell_m;                /* approximate edge of a control cell */
    double way_m;                 /* upper bound of relative motion since the bound was computed */
    bool has_inversion;           /* inverted elements use their fallback */
    int n_unseen;                 /* sub-steps since the last check for inversion */
    int n_since, pause;           /* sub-steps since the last bound; min interval */
    bool known;                   /* rows2 is valid except for motion */
    double backoff;               /* divides the limit: 1, more after points were clamped */
    double contact2, contact_1_s; /* largest eigenvalues of contact's stiffness and of explicit damping over mass */
    pal_step *step;               /* that requests the limit */
    const double *x;              /* the body's own                                                       */
    double *at, *still, *g, *g0;  /* saved x, v, g of the body during the iteration; g at the state itself [n_dof][3] */
    double *d, *dv, *f;           /* saved d, dv, f [n_node][3] */
    double *bound;                /* of CONTACT components                                           [n_node]    */
} central;

/* back-off of the sub-step after a clamped displacement, and its decay per sub-step without one */
static const double max_backoff = 8, backoff_decay = 0.98;
/* of omega^2 while elements are inverted: the displaced corner is the fastest mode, which near its limit shows up to
 * twice its energy, as velocities are those of half a sub-step before */
static const double inverted2 = 3;
/* of a move in elements, as forces may be of single precision; of omega^2 and of its solves */
static const double small_h = 1e-4, near = 0.02, exact = 1e-6;
enum { PAUSE = 12, MAX_PAUSE = 96 };
/* approximate sub-steps between checks for inversion */
enum { UNSEEN = 16 };
/* max iterations per sub-step; first and later ones of Lanczos; max entries of a factor */
enum { MAX_CG = 300, FIRST = 24, AGAIN = 6, MAX_ENTRY = 1 << 22 };

/* ---- load ---- */

/* allocates n arrays of count numbers; false: no memory */
static bool take(pal_arena *arena, size_t count, double **to[], int n)
{
    for (int i = 0; i < n; i++)
        if (!(*to[i] = PAL_NEW(arena, double, count))) return false;
    return true;
}

static void multiply(void *user, const double *p, double *out);
static void precondition(void *user, const double *r, double *out);
static bool multiply_stiffness(void *user, const double *v, double *out);
static bool solve_mass(void *user, const double *b, double *out);

static pal_err allocate(central *row, const pal_body *body, pal_arena *arena)
{
    const size_t n3 = 3 * (size_t)body->n_dof;
    double **of_dof[] = {&row->cg.r,      &row->cg.z,      &row->cg.p,      &row->cg.q,   &row->change,
                         &row->was,       &row->at,        &row->still,     &row->g,      &row->g0,
                         &row->lanczos.z, &row->lanczos.w, &row->lanczos.u, &row->inverse};
    double **of_node[] = {&row->d, &row->dv, &row->f, &row->bound};
    row->fixed = PAL_NEW(arena, uint8_t, body->n_dof);
    row->lanczos.basis = PAL_NEW(arena, double, FIRST *n3);
    if (!row->fixed || !row->lanczos.basis || !take(arena, n3, of_dof, 14) ||
        !take(arena, 3 * (size_t)body->n_node, of_node, 4))
        return PAL_ERR_MEMORY;
    row->cg.n = row->lanczos.n = (int)n3;
    row->cg.multiply = multiply, row->cg.precondition = precondition, row->cg.user = row;
    row->lanczos.multiply = multiply_stiffness, row->lanczos.solve = solve_mass, row->lanczos.user = row;
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double safety = 0.9, tolerance = 1e-4;
    const char *preconditioner = "factor";
    const pal_body *body = build->body;
    PAL_TRY(pal_entry_read_number(item, "safety", 0.01, 0.98, &safety, build->diag));
    PAL_TRY(pal_entry_read_number(item, "tolerance", 1e-14, 0.1, &tolerance, build->diag));
    PAL_TRY(pal_entry_read_text(item, "preconditioner", &preconditioner, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    bool factor = !strcmp(preconditioner, "factor");
    if (!factor && strcmp(preconditioner, "diagonal"))
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s.preconditioner: \"%s\", known are factor, diagonal",
                                  item->path, preconditioner);
    if (!body->interpolation || !body->mass_operator)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: \"%s\" needs a body of model subdivision_fem",
                                  item->path, item->name);
    central *row = PAL_NEW(build->arena, central, 1);
    if (!row) return PAL_ERR_MEMORY;
    row->rows = body->interpolation, row->mass = body->mass_operator;
    row->n_unseen = UNSEEN;
    row->safety = safety, row->tolerance = tolerance, row->backoff = 1;
    row->cell_m = body->dofs.spacing_m;
    PAL_TRY(allocate(row, body, build->arena));
    if (factor) {
        pal_err err = pal_envelope_make(row->mass->n_point, row->mass->start, row->mass->point, MAX_ENTRY, build->arena,
                                        &row->envelope);
        if (err && err != PAL_ERR_BUDGET) return err;
    }
    *self = row;
    return PAL_ERR_OK;
}

/* ---- the left side ---- */

static void multiply(void *user, const double *p, double *out)
{
    const central *row = user;
    const pal_mass_operator *m = row->mass;
    for (int i = 0; i < m->n_point; i++) {
        double x = 0, y = 0, z = 0, *to = out + 3 * (size_t)i;
        for (int32_t k = m->start[i]; k < m->start[i + 1] && !row->fixed[i]; k++) {
            const double *q = p + 3 * (size_t)m->point[k];
            double w = row->a * m->mass_kg[k];
            if (row->b != 0) w += row->b * m->damping_kg_s[k];
            x += w * q[0], y += w * q[1], z += w * q[2];
        }
        to[0] = x, to[1] = y, to[2] = z;
    }
}

static void precondition(void *user, const double *r, double *out)
{
    central *row = user;
    if (row->factored) {
        pal_envelope_solve(&row->envelope, r, out);
        return;
    }
    for (int i = 0; i < row->mass->n_point; i++) pal_scale3(out + 3 * (size_t)i, row->inverse[i], r + 3 * (size_t)i);
}

/* rebuilds the preconditioner when masses or supports have changed; true: rebuilt */
static bool renew(central *row, const pal_body *body)
{
    const pal_mass_operator *m = row->mass;
    if (row->sampled == pal_dofs_material_revision(&body->dofs) &&
        !memcmp(row->fixed, body->support, (size_t)body->n_dof))
        return false;
    row->sampled = pal_dofs_material_revision(&body->dofs);
    memcpy(row->fixed, body->support, (size_t)body->n_dof);
    for (int i = 0; i < m->n_point; i++) {
        int32_t k = m->start[i];
        while (m->point[k] != i) k++;
        row->inverse[i] = row->fixed[i] || !(m->mass_kg[k] > 0) ? 0 : 1 / m->mass_kg[k];
    }
    row->factored =
        row->envelope.n > 0 && !pal_envelope_factor(&row->envelope, m->start, m->point, m->mass_kg, row->fixed);
    return true;
}

/* x += A^-1 r with r in cg.r, until |r| <= target; rows of fixed points are omitted */
static void solve(central *row, double *x, double target)
{
    for (int i = 0; i < row->mass->n_point; i++)
        if (row->fixed[i]) pal_set3(row->cg.r + 3 * (size_t)i, 0, 0, 0);
    row->report.n_cg += pal_conjugate_gradient_run(&row->cg, x, target, 0, MAX_CG);
}

/* ---- the limit ---- */

static bool solve_mass(void *user, const double *b, double *out)
{
    central *row = user;
    const size_t n_byte = sizeof(double) * (size_t)row->cg.n;
    memcpy(row->cg.r, b, n_byte);
    memset(out, 0, n_byte);
    row->a = 1, row->b = 0;
    solve(row, out, exact * sqrt(pal_dot_product(row->cg.n, b, b)));
    return true;
}

static bool gather(central *row)
{
    pal_step *step = row->step;
    const size_t used = step->scratch ? pal_arena_used(step->scratch) : 0;
    const bool good = !pal_assemble_forces(step);
    if (step->scratch) pal_arena_rewind(step->scratch, used);
    return good;
}

/* out = K~ v of the FORCE components, by the difference of forces over a small displacement along v */
static bool multiply_stiffness(void *user, const double *v, double *out)
{
    central *row = user;
    const int n = row->cg.n;
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, fabs(v[i]));
    const double small = max > 0 ? small_h * row->step->body->edge_m / max : 0, per = max > 0 ? 1 / small : 0;
    for (int i = 0; i < n; i++) row->at[i] = row->x[i] + small * v[i];
    if (!gather(row)) return false;
    for (int i = 0; i < n; i++) out[i] = row->fixed[i / 3] ? 0 : per * (row->g0[i] - row->g[i]);
    return true;
}

/* out = A' bound A v, with one number of bound per node */
static bool multiply_bound(void *user, const double *v, double *out)
{
    central *row = user;
    const pal_interpolation *rows = row->rows;
    pal_interpolation_apply(rows, v, row->f);
    for (int i = 0; i < rows->n_row; i++) pal_scale3(row->f + 3 * (size_t)i, row->bound[i], row->f + 3 * (size_t)i);
    memset(out, 0, sizeof *out * (size_t)row->cg.n);
    pal_interpolation_apply_transpose(rows, row->f, out);
    for (int i = 0; i < row->cg.n; i++) out[i] *= !row->fixed[i / 3];
    return true;
}

/* adds arbitrary signs at the free points, of length `share` of the vector's norm, or 1 if it is zero */
static void add_any(const central *row, double share, double *z)
{
    const double norm = sqrt(pal_dot_product(row->cg.n, z, z)), each = share * norm / sqrt(row->cg.n);
    for (int i = 0; i < row->cg.n; i++) {
        uint64_t bits = ((uint64_t)(uint32_t)i + 1) * 0x9e3779b97f4a7c15u;
        bits ^= bits >> 29, bits *= 0xbf58476d1ce4e5b9u, bits ^= bits >> 32;
        if (!row->fixed[i / 3]) z[i] += (norm > 0 ? each : 1) * ((double)(bits >> 11) * 0x1p-52 - 1);
    }
}

/* omega^2 of the FORCE components at the present position with zero velocity; restores all arrays of the body */
static double find_rows2(central *row, pal_step *step)
{
    pal_body *body = step->body;
    const pal_body kept = *body;
    const bool apart = step->drag_separate;
    const int n_cg = row->report.n_cg;
    double max = NAN;
    row->step = step, row->x = body->x;
    memcpy(row->at, body->x, sizeof(double) * (size_t)row->cg.n);
    body->x = row->at, body->v = row->still, body->g = row->g;
    body->d = row->d, body->dv = row->dv, body->f = row->f;
    step->drag_separate = true;
    if (gather(row)) {
        memcpy(row->g0, row->g, sizeof(double) * (size_t)row->cg.n);
        if (!row->known) memset(row->lanczos.z, 0, sizeof(double) * (size_t)row->cg.n);
        add_any(row, 0.1, row->lanczos.z);
        row->lanczos.multiply = multiply_stiffness;
        max = pal_lanczos_run(&row->lanczos, near, row->known ? 3 : 8, row->known ? AGAIN : FIRST);
    }
    step->drag_separate = apart;
    body->x = kept.x, body->v = kept.v, body->g = kept.g;
    body->d = kept.d, body->dv = kept.dv, body->f = kept.f;
    row->report.n_cg = n_cg;
    return max > 0 || isnan(max) ? max : 0;
}

/* the largest eigenvalue of row->bound over mass */
static double find_bound(central *row)
{
    /* keep the Ritz vector of the FORCE components */
    double *z = row->lanczos.z, sum = 0;
    const int n_cg = row->report.n_cg;
    for (int i = 0; i < row->rows->n_row; i++) sum += row->bound[i];
    if (sum == 0) return 0;
    row->lanczos.z = row->at;
    memset(row->at, 0, sizeof(double) * (size_t)row->cg.n);
    add_any(row, 0, row->at);
    multiply_bound(row, row->at, row->g);
    memcpy(row->at, row->g, sizeof(double) * (size_t)row->cg.n);
    row->lanczos.multiply = multiply_bound;
    const double max = pal_lanczos_run(&row->lanczos, near, 2, AGAIN);
    row->lanczos.z = z;
    row->report.n_cg = n_cg;
    return max;
}

static void clear_bound(central *row)
{
    memset(row->bound, 0, sizeof(double) * (size_t)row->rows->n_row);
}

/* contact changes between steps without motion of any point */
static void find_contact(central *row, const pal_step *step)
{
    clear_bound(row);
    for (int i = 0; i < step->n_contact; i++) {
        const pal_effect *effect = step->contact[i].effect;
        if (effect->stiffness) effect->stiffness(step->contact[i].self, step->body, row->bound);
        if (effect->wanted) effect->wanted(step->contact[i].self, step->body, row->bound);
        if (effect->wanted) effect->wanted(step->contact[i].self, step->body, row->bound);
    }
    row->contact2 = find_bound(row);
    clear_bound(row);
    for (int i = 0; i < step->n_contact + step->n_force; i++) {
        const pal_component *of = i < step->n_contact ? &step->contact[i] : &step->force[i - step->n_contact];
        if (of->effect->damping && !of->effect->drag) of->effect->damping(of->self, step->body, row->bound);
    }
    row->contact_1_s = find_bound(row);
}

static void look(central *row, pal_step *step)
{
    const double before = row->known ? row->rows2 : 0;
    row->rows2 = find_rows2(row, step);
    bool same = fabs(row->rows2 - before) <= near * before;
    row->pause = !same ? PAUSE : row->pause < MAX_PAUSE ? 2 * row->pause : MAX_PAUSE;
    row->known = true;
    row->way_m = 0;
    row->n_since = 0;
}

/* true: elements were found inverted and use their fallback from now on */
static bool recover(central *row, pal_step *step)
{
    pal_body *body = step->body;
    double *d = body->d;
    if (row->n_unseen < (step->sub == 0 ? UNSEEN / 2 : UNSEEN)) return false;
    row->n_unseen = 0;
    pal_interpolation_apply(body->interpolation, body->x, row->d);
    body->d = row->d;
    const unsigned seen = pal_guard_recover(step);
    body->d = d;
    /* half a sub-step of the previous length with the forces of another law would be an impulse */
    if (seen & PAL_INVERSION_CHANGED) row->dt_s = 0;
    row->has_inversion = (seen & PAL_INVERTED) && !(seen & PAL_INVERSION_AT_REST);
    return seen & PAL_INVERSION_CHANGED;
}

/* with lambda the largest omega^2 and c that of damping, symplectic steps are stable for dt^2 lambda + 2 dt c < 4 */
static double limit(void *self, pal_step *step)
{
    central *row = self;
    const pal_body *body = step->body;
    if (!pal_body_finite(body)) return NAN;
    if (renew(row, body) || recover(row, step)) row->known = false;
    if (!row->known || (row->n_since >= row->pause && !(row->way_m <= PAL_GUARD_RECHECK * row->cell_m)))
        look(row, step);
    if (step->sub == 0) find_contact(row, step);
    const double rows2 = row->has_inversion ? inverted2 * row->rows2 : row->rows2, lambda = rows2 + row->contact2,
                 c = row->contact_1_s;
    row->limit_s = row->safety * 4 / (c + sqrt(c * c + 4 * lambda)) / row->backoff;
    return row->limit_s;
}

/* ---- a sub-step ---- */

/* applies the known change of velocity of fixed points; `was` is v before the change. True: it is not 0 */
static bool begin_change(central *row, const pal_body *body)
{
    bool any = false;
    memset(row->change, 0, sizeof(double) * (size_t)row->cg.n);
    for (int i = 0; i < body->n_dof; i++) {
        double *was = row->was + 3 * (size_t)i, *change = row->change + 3 * (size_t)i;
        const double *v = body->v + 3 * (size_t)i;
        if (body->support[i] == PAL_PRESCRIBED && row->dt_s > 0)
            pal_sub3(change, v, was);
        else
            pal_copy3(was, v);
        if (body->support[i] == PAL_FIXED) pal_scale3(change, -1, v);
        any |= change[0] != 0 || change[1] != 0 || change[2] != 0;
    }
    return any;
}

/* r -= (a M~ + b D~)(s was + t change); z and q are free */
static void take_away(central *row, double a, double b, double s, double t)
{
    for (int i = 0; i < row->cg.n; i++) row->cg.z[i] = s * row->was[i] + t * row->change[i];
    row->a = a, row->b = b;
    multiply(row, row->cg.z, row->cg.q);
    for (int i = 0; i < row->cg.n; i++) row->cg.r[i] -= row->cg.q[i];
}

static void find_change(central *row, const pal_step *step)
{
    const pal_body *body = step->body;
    const double dt = step->dt_s, k = 0.5 * (dt + row->dt_s),
                 rate = body->stiffening_damping_1_s + pal_guard_drag_1_s(step->force, step->n_force),
                 over = row->limit_s > 0 ? dt / row->limit_s : 0;
    const double scale = step->heavy && over > 1 ? over * over : 1;
    const bool varies = row->mass->damping_kg_s != NULL, moves = begin_change(row, body);
    const double max = k * (rate + (varies ? row->mass->damping_max_1_s : 0));
    double theta = row->dt_s / (dt + row->dt_s);
    if (max > 0) theta = fmax(theta, 1 - 1 / max);
    const double a = scale + theta * k * rate, b = varies ? theta * k : 0;
    for (int i = 0; i < row->cg.n; i++) row->cg.r[i] = k * body->g[i];
    if (rate > 0 || moves) take_away(row, 1, 0, k * rate, a);
    if (varies) take_away(row, 0, 1, k, b);
    row->a = a, row->b = b;
    for (int i = 0; i < row->cg.n; i++)
        if (row->fixed[i / 3]) row->cg.r[i] = 0;
    const double norm = sqrt(pal_dot_product(row->cg.n, row->cg.r, row->cg.r));
    if (step->sub == 0) row->report.n_cg = 0;
    solve(row, row->change, row->tolerance * norm);
    /* non-finite forces give non-finite velocities */
    for (int i = 0; i < row->cg.n && !isfinite(norm); i++) row->change[i] = NAN;
    row->report.residual = norm > 0 ? row->cg.residual / norm : 0;
    row->report.converged = row->cg.residual <= row->tolerance * norm;
}

/* computes v+ and p+; returns the largest relative displacement of a point, not finite when a velocity is not */
static double move(central *row, pal_body *body, double dt)
{
    const double max_m = pal_guard_max_move_m(body);
    const uint64_t n_clamped = body->safeguards.n_clamped;
    double mean[3] = {0, 0, 0}, max2 = 0, poison = 0;
    for (int i = 0; i < body->n_dof; i++) {
        double *v = body->v + 3 * (size_t)i;
        /* prescribed points already have theirs */
        if (body->support[i] == PAL_FIXED) pal_set3(v, 0, 0, 0);
        if (!body->support[i]) pal_add3(v, v, row->change + 3 * (size_t)i);
        const double way = pal_norm3(v) * dt;
        poison += 0 * way;
        if (way > max_m) {
            uint64_t before = pal_clock_ns();
            pal_scale3(v, pal_guard_shorten(body, way, max_m), v);
            body->safeguards.ns += pal_clock_ns() - before;
        }
        pal_axpy3(body->x + 3 * (size_t)i, dt, v);
        pal_copy3(row->was + 3 * (size_t)i, v);
        pal_axpy3(mean, 1.0 / body->n_dof, v);
    }
    for (int i = 0; i < body->n_dof; i++) {
        double from[3];
        pal_sub3(from, body->v + 3 * (size_t)i, mean);
        max2 = fmax(max2, pal_dot3(from, from));
    }
    row->backoff = body->safeguards.n_clamped > n_clamped ? fmin(2 * row->backoff, max_backoff)
                                                          : 1 + backoff_decay * (row->backoff - 1);
    return dt * sqrt(max2) + poison;
}

static pal_err run(void *self, pal_step *step)
{
    central *row = self;
    step->drag_separate = true;
    PAL_TRY(pal_assemble_forces(step));
    renew(row, step->body);
    find_change(row, step);
    row->way_m += move(row, step->body, step->dt_s);
    row->dt_s = step->dt_s;
    row->n_since += row->n_since < MAX_PAUSE;
    row->n_unseen++;
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    central *row = self;
    (void)body;
    row->dt_s = 0;
    row->backoff = 1;
    row->has_inversion = false;
    row->known = false;
    row->n_unseen = UNSEEN;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    (void)body, (void)to, (void)diag;
    ((central *)self)->known = false;
    return PAL_ERR_OK;
}

static void report(const void *self, pal_solve_report *out)
{
    const central *row = self;
    *out = row->report;
    out->factor_nonzeros = row->factored ? row->envelope.start[row->envelope.n] : 0;
}

const pal_effect pal_effect_central_cg = {.name = "central_cg",
                                          .stage = PAL_STAGE_SOLVE,
                                          .make = make,
                                          .run = run,
                                          .limit = limit,
                                          .material = material,
                                          .reset = reset,
                                          .report = report};
