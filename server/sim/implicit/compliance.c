/* Static compliance. */
#include "server/sim/implicit/compliance.h"

#include <math.h>
#include <string.h>

/* residual over the force at which the answer is good enough, and the most iterations for it in one call */
static const double enough = 1e-2;
enum { MAX_ITERATIONS = 3 };
/* an earlier answer serves as first guess when its force points the same way */
static const double alike = 0.5;

static size_t bytes3(const pal_body *body)
{
    return 3 * sizeof(double) * (size_t)body->n_dof;
}

static void multiply(void *user, const double *p, double *out)
{
    pal_compliance_solver *answer = user;
    pal_system_true_stiffness(answer->system, answer->x, answer->low, p, out);
}

static void precondition(void *user, const double *r, double *z)
{
    pal_warp_solve(&((pal_compliance_solver *)user)->warp, r, z);
}

/* the earlier answer to the force most like r; the one unused for longest when none is; *share: how much of it fits */
static pal_compliance_entry *find_known(pal_compliance_solver *answer, double size2, double *share)
{
    pal_compliance_entry *best = NULL, *oldest = &answer->known[0];
    double nearest = alike * alike;
    for (int k = 0; k < PAL_COMPLIANCE_CACHE; k++) {
        pal_compliance_entry *known = &answer->known[k];
        if (known->used < oldest->used) oldest = known;
        if (known->size2 == 0) continue;
        double dot = pal_dot_product(answer->cg.n, known->force, answer->cg.r);
        double cosine2 = dot > 0 ? dot / known->size2 * (dot / size2) : 0;
        if (!(cosine2 > nearest)) continue;
        nearest = cosine2;
        best = known;
        *share = dot / known->size2;
    }
    if (!best) *share = 0;
    return best ? best : oldest;
}

/* force and move are of points; body->f and g are overwritten */
static bool solve_points(pal_compliance_solver *answer, const pal_body *body, double *move_m)
{
    int n = answer->cg.n;
    double *r = answer->cg.r, share;
    for (int i = 0; i < n; i++)
        if (body->support[i / 3]) r[i] = 0;
    memset(move_m, 0, bytes3(body));
    double size2 = pal_dot_product(n, r, r);
    if (!(size2 > 0)) return size2 == 0;
    memcpy(answer->x, body->x, bytes3(body));
    pal_compliance_entry *known = find_known(answer, size2, &share);
    memcpy(known->force, r, bytes3(body));
    known->size2 = size2;
    known->used = ++answer->n_call;
    if (share != 0) {
        for (int i = 0; i < n; i++) move_m[i] = share * known->move[i];
        multiply(answer, move_m, answer->cg.q);
        for (int i = 0; i < n; i++) r[i] = body->support[i / 3] ? 0 : r[i] - answer->cg.q[i];
    }
    (void)pal_conjugate_gradient_run(&answer->cg, move_m, enough * sqrt(size2), share == 0, MAX_ITERATIONS);
    memcpy(known->move, move_m, bytes3(body));
    if (!isfinite(answer->cg.residual)) known->size2 = 0;
    return isfinite(answer->cg.residual);
}

static bool solve(void *self, const pal_body *body, const double *force_N, double *move_m)
{
    pal_compliance_solver *answer = self;
    pal_body *own = answer->system->body;
    size_t node_bytes = 3 * sizeof(double) * (size_t)body->n_node;
    memcpy(answer->f, own->f, node_bytes);
    if (body->interpolation) {
        memset(answer->cg.r, 0, bytes3(body));
        pal_interpolation_apply_transpose(body->interpolation, force_N, answer->cg.r);
    } else {
        memcpy(answer->cg.r, force_N, node_bytes);
    }
    bool done = solve_points(answer, body, body->interpolation ? answer->move : move_m);
    if (body->interpolation) pal_interpolation_apply(body->interpolation, answer->move, move_m);
    memcpy(own->f, answer->f, node_bytes);
    return done;
}

void pal_compliance_solver_reset(pal_compliance_solver *answer)
{
    for (int k = 0; k < PAL_COMPLIANCE_CACHE; k++) answer->known[k].size2 = 0;
}

static pal_err make_arrays(pal_compliance_solver *answer, pal_arena *arena)
{
    const pal_body *body = answer->system->body;
    size_t n3 = 3 * (size_t)body->n_dof;
    double **const array[] = {&answer->x,    &answer->move, &answer->low, &answer->cg.r,
                              &answer->cg.z, &answer->cg.p, &answer->cg.q};
    for (size_t i = 0; i < sizeof array / sizeof array[0]; i++) {
        *array[i] = PAL_NEW(arena, double, n3);
        if (!*array[i]) return PAL_ERR_MEMORY;
    }
    if (!(answer->f = PAL_NEW(arena, double, 3 * (size_t)body->n_node))) return PAL_ERR_MEMORY;
    for (int k = 0; k < PAL_COMPLIANCE_CACHE; k++) {
        answer->known[k].force = PAL_NEW(arena, double, n3);
        answer->known[k].move = PAL_NEW(arena, double, n3);
        if (!answer->known[k].force || !answer->known[k].move) return PAL_ERR_MEMORY;
    }
    answer->cg.n = (int)n3;
    answer->cg.multiply = multiply;
    answer->cg.precondition = precondition;
    answer->cg.user = answer;
    return PAL_ERR_OK;
}

pal_err pal_compliance_solver_factor(pal_compliance_solver *answer, pal_system *system, pal_block_matrix *blocks)
{
    double mass = system->mass, stiff = system->stiff, damp = system->damp;
    pal_compliance_solver_reset(answer);
    system->mass = 0, system->stiff = 1, system->damp = 0;
    pal_system_assemble(system, blocks);
    system->mass = mass, system->stiff = stiff, system->damp = damp;
    return pal_warp_factor(&answer->warp, blocks);
}

pal_err pal_compliance_solver_make(pal_system *system, const pal_node_rotations *turns, pal_block_matrix *blocks,
                                   pal_arena *arena, pal_compliance_solver *out)
{
    pal_body *body = system->body;
    pal_support_report supports;
    memset(out, 0, sizeof *out);
    if (!body->wants_compliance || system->n_free == 0) return PAL_ERR_OK;
    PAL_TRY(pal_system_find_supports(system, &supports));
    if (supports.n_unsupported > 0) return PAL_ERR_OK;
    out->system = system;
    PAL_TRY(make_arrays(out, arena));
    PAL_TRY(pal_warp_make(blocks, body, turns, true, arena, &out->warp));
    pal_err err = pal_compliance_solver_factor(out, system, blocks);
    if (err == PAL_ERR_MEMORY) return err;
    /* not positive definite: there is no answer to give */
    if (err) return PAL_ERR_OK;
    out->door = (pal_compliance){.self = out, .solve = solve};
    body->compliance = &out->door;
    return PAL_ERR_OK;
}

void pal_compliance_solver_destroy(pal_compliance_solver *answer)
{
    pal_warp_destroy(&answer->warp);
}
