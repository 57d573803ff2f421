/* Static compliance. */
#include "server/sim/implicit/compliance.h"

#include "server/sim/implicit/tuning.h"

#include <math.h>
#include <string.h>

/* of one call; the next ones continue from its result */
enum { MAX_ITERATIONS = 3 };

static void multiply(void *user, const double *p, double *out)
{
    pal_compliance_solver *solver = user;
    pal_system_true_stiffness(solver->system, solver->x, solver->low, p, out);
}

static void precondition(void *user, const double *r, double *z)
{
    pal_compliance_solver *solver = user;
    const pal_cycle cycle = pal_preconditioner_cycle(solver->system, &solver->cg);
    pal_preconditioner_solve(&solver->preconditioner, cycle, r, z);
}

/* a'b, in eight sums side by side */
static double dot(int n, const float *a, const double *b)
{
    double lane[8] = {0};
    int i = 0;
    for (; i + 8 <= n; i += 8)
        for (int l = 0; l < 8; l++) lane[l] += (double)a[i + l] * b[i + l];
    for (; i < n; i++) lane[0] += (double)a[i] * b[i];
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

static void keep(int n, const double *from, float *to)
{
    for (int i = 0; i < n; i++) to[i] = (float)from[i];
}

/* the earlier answer to the force most like r; the one unused for longest when none is; *share: how much of it fits */
static pal_compliance_entry *find_known(pal_compliance_solver *solver, double size2, double *share)
{
    pal_compliance_entry *best = NULL, *oldest = &solver->known[0];
    double nearest = PAL_SAME_COSINE * PAL_SAME_COSINE;
    for (int k = 0; k < PAL_COMPLIANCE_CACHE; k++) {
        pal_compliance_entry *known = &solver->known[k];
        if (known->used < oldest->used) oldest = known;
        if (known->size2 == 0) continue;
        const double along = dot(solver->cg.n, known->force, solver->cg.r);
        double cosine2 = along > 0 ? along / known->size2 * (along / size2) : 0;
        if (!(cosine2 > nearest)) continue;
        nearest = cosine2;
        best = known;
        *share = along / known->size2;
    }
    if (!best) *share = 0;
    return best ? best : oldest;
}

/* force and move are of points; body->f and g are overwritten */
static bool solve_points(pal_compliance_solver *solver, const pal_body *body, double *move_m)
{
    int n = solver->cg.n;
    solver->cg.team = body->team;
    double *r = solver->cg.r, share;
    pal_system_clear_supported(body, r);
    memset(move_m, 0, pal_body_bytes3(body));
    double size2 = pal_dot_product(n, r, r);
    if (!(size2 > 0)) return size2 == 0;
    memcpy(solver->x, body->x, pal_body_bytes3(body));
    pal_compliance_entry *known = find_known(solver, size2, &share);
    keep(n, r, known->force);
    known->size2 = size2;
    known->used = ++solver->n_call;
    solver->cg.energy = 0;
    pal_preconditioner_rotate(&solver->preconditioner);
    if (share != 0) {
        for (int i = 0; i < n; i++) move_m[i] = share * (double)known->move[i];
        multiply(solver, move_m, solver->cg.q);
        for (int i = 0; i < n; i++) r[i] = body->support[i / 3] ? 0 : r[i] - solver->cg.q[i];
        solver->cg.energy = dot(n, known->force, move_m);
    }
    (void)pal_conjugate_gradient_run(&solver->cg, move_m, PAL_SOLVER_TOLERANCE * sqrt(size2), share == 0,
                                     MAX_ITERATIONS);
    keep(n, move_m, known->move);
    if (!isfinite(solver->cg.residual)) known->size2 = 0;
    return isfinite(solver->cg.residual);
}

static bool solve(void *self, const pal_body *body, const double *force_N, double *move_m)
{
    pal_compliance_solver *solver = self;
    pal_body *own = solver->system->body;
    size_t node_bytes = 3 * sizeof(double) * (size_t)body->n_node;
    memcpy(solver->f, own->f, node_bytes);
    pal_system_restrict(body, force_N, solver->cg.r);
    bool done = solve_points(solver, body, body->interpolation ? solver->move : move_m);
    if (body->interpolation) pal_interpolation_apply(body->interpolation, solver->move, move_m);
    memcpy(own->f, solver->f, node_bytes);
    return done;
}

void pal_compliance_solver_reset(pal_compliance_solver *solver)
{
    for (int k = 0; k < PAL_COMPLIANCE_CACHE; k++) solver->known[k].size2 = 0;
}

static pal_err make_arrays(pal_compliance_solver *solver, const pal_conjugate_gradient *of, double *work,
                           pal_arena *arena)
{
    const pal_body *body = solver->system->body;
    pal_conjugate_gradient *cg = &solver->cg;
    size_t n3 = 3 * (size_t)body->n_dof;
    bool made = PAL_NEW_DOUBLES(arena, n3, &solver->x) && (work || PAL_NEW_DOUBLES(arena, n3, &solver->low)) &&
                PAL_NEW_DOUBLES(arena, 3 * (size_t)body->n_node, &solver->f) &&
                (!body->interpolation || PAL_NEW_DOUBLES(arena, n3, &solver->move));
    if (work) solver->low = work;
    cg->r = of->r, cg->z = of->z, cg->p = of->p, cg->q = of->q;
    for (int k = 0; k < PAL_COMPLIANCE_CACHE && made; k++) {
        solver->known[k].force = PAL_NEW(arena, float, n3), solver->known[k].move = PAL_NEW(arena, float, n3);
        made = solver->known[k].force && solver->known[k].move;
    }
    cg->n = (int)n3;
    cg->gain = PAL_COMPLIANCE_GAIN;
    cg->multiply = multiply, cg->precondition = precondition, cg->user = solver;
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_compliance_solver_update(pal_compliance_solver *solver, bool later)
{
    pal_system *system = solver->system;
    const double mass = system->mass, stiff = system->stiff, viscous = system->viscous, damp = system->damp;
    pal_err err = PAL_ERR_OK;
    pal_compliance_solver_reset(solver);
    system->mass = 0, system->stiff = 1, system->viscous = system->damp = 0;
    if (later)
        (void)pal_preconditioner_refresh(&solver->preconditioner, true);
    else
        err = pal_preconditioner_update(&solver->preconditioner);
    system->mass = mass, system->stiff = stiff, system->viscous = viscous, system->damp = damp;
    return err;
}

pal_err pal_compliance_solver_make(const pal_preconditioner *like, const pal_conjugate_gradient *cg, double *work,
                                   pal_arena *arena, pal_compliance_solver *out)
{
    pal_system *system = like->system;
    pal_body *body = system->body;
    pal_support_report supports;
    memset(out, 0, sizeof *out);
    if (!body->wants_compliance || system->n_free == 0) return PAL_ERR_OK;
    PAL_TRY(pal_system_find_supports(system, &supports));
    if (supports.n_unsupported > 0) return PAL_ERR_OK;
    out->system = system;
    PAL_TRY(make_arrays(out, cg, work, arena));
    const pal_preconditioner_options options = {.single = true, .like = like};
    PAL_TRY(pal_preconditioner_make(&options, system, like->rotations, arena, NULL, &out->preconditioner));
    pal_err err = pal_compliance_solver_update(out, false);
    if (err == PAL_ERR_MEMORY) return err;
    /* not positive definite: there is no answer to give */
    if (err) return PAL_ERR_OK;
    out->hook = (pal_compliance){.self = out, .solve = solve};
    body->compliance = &out->hook;
    return PAL_ERR_OK;
}

void pal_compliance_solver_report(const pal_compliance_solver *solver, const pal_preconditioner *preconditioner,
                                  pal_solve_report *out)
{
    if (!preconditioner->system) return;
    pal_preconditioner_report(preconditioner, out);
    out->analyse_s += solver->preconditioner.analyse_s;
    out->factor_s += solver->preconditioner.update_s;
}

void pal_compliance_solver_destroy(pal_compliance_solver *solver)
{
    pal_preconditioner_destroy(&solver->preconditioner);
}
