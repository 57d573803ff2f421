/* Static compliance by a few iterations a step (tissue_compliance.h). Sums are over active dofs only. */
#include "server/sim/implicit/tissue_compliance.h"

#include "server/base/vec3.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/implicit/tuning.h"

#include <string.h>

static double dot(const pal_body *body, const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        sum += pal_dot3(a + i, b + i);
    }
    return sum;
}

/* to += s from */
static void add(const pal_body *body, double s, const double *from, double *to)
{
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_axpy3(to + i, s, from + i);
    }
}

/* forces at x + part p, as g; fixed dofs 0 */
static bool find_forces(pal_tissue_compliance *tissue, double part, const double *p)
{
    pal_step step = tissue->step;
    pal_body *body = step.body;
    step.drag_separate = true;
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        for (size_t c = i; c < i + 3; c++) body->x[c] = tissue->x[c] + part * p[c];
    }
    return pal_assemble_forces(&step) == PAL_ERR_OK;
}

/* product = K p; false: forces failed */
static bool multiply(pal_tissue_compliance *tissue, const double *p)
{
    pal_body *body = tissue->step.body;
    double longest = 0;
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        longest = fmax(longest, pal_norm3(p + i));
    }
    const double part = longest > 0 ? PAL_DIFFERENCE_H * body->edge_m / longest : 0;
    if (part == 0) memset(tissue->product, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    if (part == 0) return true;
    tissue->credit -= 1;
    bool good = find_forces(tissue, -part, p);
    for (int k = 0; k < body->n_active; k++)
        pal_copy3(tissue->low + 3 * (size_t)pal_body_point(body, k), body->g + 3 * (size_t)pal_body_point(body, k));
    good = good && find_forces(tissue, part, p);
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        for (size_t c = 3 * (size_t)i; c < 3 * (size_t)i + 3; c++)
            tissue->product[c] = body->support[i] ? 0 : (tissue->low[c] - body->g[c]) / (2 * part);
    }
    return good;
}

static void forget_answers(pal_tissue_compliance *tissue)
{
    for (int k = 0; k < PAL_TISSUE_ANSWERS; k++) tissue->answer[k].size2 = 0, tissue->answer[k].used = 0;
    tissue->n_call = 0;
}

static void reset(void *self)
{
    pal_tissue_compliance *tissue = self;
    forget_answers(tissue);
    tissue->credit = tissue->time_s = 0;
    tissue->known = false;
}

/* the preconditioner for the present nodes: of the stiffness at rest; of a body that adapts, where it has not all of
 * them, the inverse of the components' row sums; else 1 */
static void find_preconditioner(pal_tissue_compliance *tissue)
{
    const pal_step *step = &tissue->step;
    const pal_body *body = step->body;
    if (tissue->known && (!body->active || tissue->revision == body->display.revision)) return;
    tissue->preconditioned = tissue->made && body->n_active == body->n_dof;
    memset(tissue->bound, 0, sizeof(double) * (size_t)body->n_node);
    if (body->active) pal_guard_add_bounds(step->force, step->n_force, body, tissue->bound, tissue->low);
    for (int i = 0; i < body->n_dof; i++)
        tissue->inverse[i] = body->active && tissue->bound[i] > 0 ? 1 / tissue->bound[i] : 1;
    tissue->known = true;
    tissue->revision = body->display.revision;
    forget_answers(tissue);
}

/* z of the residual */
static void precondition(pal_tissue_compliance *tissue, const double *r)
{
    const pal_body *body = tissue->step.body;
    if (tissue->preconditioned) pal_rest_preconditioner_solve(&tissue->preconditioner, r, tissue->z);
    for (int k = 0; k < body->n_active && !tissue->preconditioned; k++) {
        const int i = pal_body_point(body, k);
        pal_scale3(tissue->z + 3 * (size_t)i, tissue->inverse[i], r + 3 * (size_t)i);
    }
}

/* one iteration; false: it cannot go on */
static bool iterate(pal_tissue_compliance *tissue, pal_tissue_answer *a)
{
    const pal_body *body = tissue->step.body;
    double fall2 = 0, change2 = 0;
    precondition(tissue, a->left);
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        for (size_t c = i; c < i + 3; c++) {
            fall2 += tissue->z[c] * a->left[c];
            change2 += (tissue->z[c] - a->before[c]) * a->left[c];
            a->before[c] = tissue->z[c];
        }
    }
    const double beta = a->fall2 > 0 ? fmax(0, change2 / a->fall2) : 0;
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        for (size_t c = i; c < i + 3; c++) a->direction[c] = a->before[c] + beta * a->direction[c];
    }
    a->fall2 = fall2;
    if (!multiply(tissue, a->direction)) return false;
    const double curvature = dot(body, a->direction, tissue->product), along = dot(body, a->direction, a->left);
    if (!(curvature > 0 && along > 0)) {
        a->fall2 = 0;
        return false;
    }
    add(body, along / curvature, a->direction, a->move);
    add(body, -along / curvature, tissue->product, a->left);
    return true;
}

static void clear(pal_tissue_answer *a, const pal_body *body)
{
    const size_t n = 3 * sizeof(double) * (size_t)body->n_dof;
    memset(a->move, 0, n), memset(a->direction, 0, n), memset(a->before, 0, n);
    a->fall2 = 0;
}

/* the answer to the load most like r, or the one unused for longest, emptied */
static pal_tissue_answer *find_answer(pal_tissue_compliance *tissue, const double *r, double size2)
{
    const pal_body *body = tissue->step.body;
    pal_tissue_answer *best = NULL, *oldest = &tissue->answer[0];
    double nearest = PAL_SAME_COSINE;
    for (int k = 0; k < PAL_TISSUE_ANSWERS; k++) {
        pal_tissue_answer *a = &tissue->answer[k];
        if (a->used < oldest->used) oldest = a;
        const double cosine = a->size2 > 0 ? dot(body, a->force, r) / sqrt(a->size2 * size2) : 0;
        if (cosine > nearest) nearest = cosine, best = a;
    }
    if (!best) clear(oldest, body);
    return best ? best : oldest;
}

/* Is the answer good enough? With the preconditioner M near K the residual r has r' M^-1 r of the energy f' u left to
 * gain, which is the relative error of the compliance; without one the residual itself has to be small */
static bool is_good(pal_tissue_compliance *tissue, const pal_tissue_answer *a)
{
    const pal_body *body = tissue->step.body;
    if (!tissue->preconditioned)
        return dot(body, a->left, a->left) <= PAL_SOLVER_TOLERANCE * PAL_SOLVER_TOLERANCE * a->size2;
    precondition(tissue, a->left);
    const double gain = dot(body, a->left, tissue->z), has = dot(body, a->force, a->move);
    return has > 0 && gain <= PAL_SEARCH_TOLERANCE * has;
}

/* the answer for the load in product, continued; false: not known yet */
static bool continue_answer(pal_tissue_compliance *tissue, pal_tissue_answer **out)
{
    pal_body *body = tissue->step.body;
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) pal_set3(tissue->product + 3 * (size_t)i, 0, 0, 0);
    const double size2 = dot(body, tissue->product, tissue->product);
    if (!(size2 > 0)) return false;
    pal_tissue_answer *a = *out = find_answer(tissue, tissue->product, size2);
    memcpy(a->force, tissue->product, 3 * sizeof(double) * (size_t)body->n_dof);
    a->size2 = size2;
    a->used = ++tissue->n_call;
    bool good = multiply(tissue, a->move);
    for (int i = 0; i < 3 * body->n_dof; i++) a->left[i] = a->force[i] - tissue->product[i];
    /* u K u / 2 - f u, which is 0 of no answer and falls in every iteration */
    if (!(dot(body, a->move, a->force) + dot(body, a->move, a->left) >= 0)) {
        clear(a, body);
        memcpy(a->left, a->force, 3 * sizeof(double) * (size_t)body->n_dof);
    }
    /* half a product is rounding: a step's time is a sum over its sub-steps */
    for (; good && (tissue->credit > 0.5 || !tissue->iterated) && !is_good(tissue, a); tissue->iterated = true)
        good = iterate(tissue, a);
    if (!isfinite(dot(body, a->left, a->left))) a->size2 = 0;
    return a->size2 > 0 && is_good(tissue, a);
}

static bool solve(void *self, const pal_body *body, const double *force_N, double *move_m)
{
    pal_tissue_compliance *tissue = self;
    pal_body *own = tissue->step.body;
    pal_tissue_answer *a = NULL;
    if (tissue->pauses) return false;
    find_preconditioner(tissue);
    memcpy(tissue->x, own->x, 3 * sizeof(double) * (size_t)own->n_dof);
    memset(tissue->product, 0, 3 * sizeof(double) * (size_t)own->n_dof);
    if (body->interpolation)
        pal_interpolation_apply_transpose(body->interpolation, force_N, tissue->product);
    else
        memcpy(tissue->product, force_N, 3 * sizeof(double) * (size_t)own->n_dof);
    bool known = continue_answer(tissue, &a);
    memcpy(own->x, tissue->x, 3 * sizeof(double) * (size_t)own->n_dof);
    pal_body_update_nodes(own);
    if (!known) return false;
    if (body->interpolation)
        pal_interpolation_apply(body->interpolation, a->move, move_m);
    else
        memcpy(move_m, a->move, 3 * sizeof(double) * (size_t)own->n_dof);
    return true;
}

static void begin(void *self, pal_step *step)
{
    pal_tissue_compliance *tissue = self;
    const double since_s = step->time_s > tissue->time_s ? step->time_s - tissue->time_s : 0;
    tissue->step = *step;
    tissue->time_s = step->time_s;
    if (!(since_s > 0)) return;
    /* what was not used in a step is not saved up */
    tissue->credit = fmin(tissue->credit, 0) + PAL_PROBES_1_S * step->dt_s * step->n_sub;
    tissue->pauses = tissue->credit <= 1e-6; /* 0 but for rounding */
    tissue->iterated = false;
}

static void destroy(void *self)
{
    pal_rest_preconditioner_destroy(&((pal_tissue_compliance *)self)->preconditioner);
}

/* for a body whose dofs are all nodes now. The factor goes on with the pattern; the values stay in rest->work */
static pal_err make_preconditioner(pal_tissue_compliance *tissue, const pal_system *system, pal_arena *arena,
                                   pal_rest_values *rest)
{
    rest->work = pal_arena_create(1 << 20, true);
    if (!rest->work) return PAL_ERR_MEMORY;
    pal_block_matrix *blocks = &tissue->rest; /* borrowed by the preconditioner */
    PAL_TRY(pal_rest_stiffness_find(system, rest->work, blocks));
    const size_t n_start = (size_t)blocks->n + 1, n_row = (size_t)blocks->start[blocks->n];
    int32_t *start = PAL_NEW(arena, int32_t, n_start), *row = PAL_NEW(arena, int32_t, n_row);
    if (!start || !row) return PAL_ERR_MEMORY;
    memcpy(start, blocks->start, n_start * sizeof *start);
    memcpy(row, blocks->row, n_row * sizeof *row);
    blocks->start = start, blocks->row = row;
    const uint8_t *support = system->body->support;
    pal_err err = pal_rest_preconditioner_make(system->body, blocks, support, arena, &tissue->preconditioner);
    if (!err) rest->blocks = *blocks, rest->preconditioner = &tissue->preconditioner;
    blocks->value = NULL;
    return err;
}

pal_err pal_tissue_compliance_make(const pal_build *build, pal_rest_values *rest)
{
    pal_body *body = build->body;
    pal_arena *arena = build->body_arena ? build->body_arena : build->arena;
    const size_t n = (size_t)body->n_dof;
    pal_tissue_compliance *tissue = PAL_NEW(arena, pal_tissue_compliance, 1);
    pal_system system;
    if (!tissue) return PAL_ERR_MEMORY;
    bool made = PAL_NEW_DOUBLES(arena, 3 * n, &tissue->x, &tissue->low, &tissue->product, &tissue->z) &&
                PAL_NEW_DOUBLES(arena, n, &tissue->inverse) &&
                PAL_NEW_DOUBLES(arena, (size_t)body->n_node, &tissue->bound);
    for (int k = 0; k < PAL_TISSUE_ANSWERS && made; k++) {
        pal_tissue_answer *a = &tissue->answer[k];
        made = PAL_NEW_DOUBLES(arena, 3 * n, &a->force, &a->move, &a->left, &a->direction, &a->before);
    }
    if (!made) return PAL_ERR_MEMORY;
    if (!body->interpolation && body->n_active == body->n_dof) {
        PAL_TRY(pal_system_make(build, &system));
        pal_err err = make_preconditioner(tissue, &system, arena, rest);
        if (err == PAL_ERR_MEMORY) pal_rest_preconditioner_destroy(&tissue->preconditioner);
        if (err == PAL_ERR_MEMORY) return err;
        tissue->made = err == PAL_ERR_OK;
    }
    tissue->hook = (pal_compliance){.self = tissue, .solve = solve, .begin = begin, .reset = reset, .destroy = destroy};
    body->compliance = &tissue->hook;
    return PAL_ERR_OK;
}
