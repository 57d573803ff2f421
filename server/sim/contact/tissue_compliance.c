/* Static compliance by a few iterations a step (tissue_compliance.h). Sums are over active dofs only. */
#include "server/sim/contact/tissue_compliance.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"
#include "server/sim/core/step_guard.h"

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
    pal_step step = *tissue->step;
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
    pal_body *body = tissue->step->body;
    double longest = 0;
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        longest = fmax(longest, pal_norm3(p + i));
    }
    const double part = longest > 0 ? DIFFERENCE_EDGES * body->edge_m / longest : 0;
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

/* the diagonal's inverse, from the components' row sums where dofs are nodes */
static void find_diagonal(pal_tissue_compliance *tissue)
{
    const pal_step *step = tissue->step;
    const pal_body *body = step->body;
    if (tissue->known && tissue->revision == body->display.revision) return;
    memset(tissue->bound, 0, sizeof(double) * (size_t)body->n_node);
    if (!body->interpolation) pal_guard_add_bounds(step->force, step->n_force, body, tissue->bound, tissue->low);
    for (int i = 0; i < body->n_dof; i++)
        tissue->inverse[i] = !body->interpolation && tissue->bound[i] > 0 ? 1 / tissue->bound[i] : 1;
    tissue->known = true;
    tissue->revision = body->display.revision;
    pal_tissue_compliance_reset(tissue);
}

/* one iteration; false: it cannot go on */
static bool iterate(pal_tissue_compliance *tissue, pal_tissue_answer *a)
{
    const pal_body *body = tissue->step->body;
    double fall2 = 0, change2 = 0;
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        for (size_t c = 3 * (size_t)i; c < 3 * (size_t)i + 3; c++) {
            const double z = tissue->inverse[i] * a->left[c];
            fall2 += z * a->left[c];
            change2 += (z - a->before[c]) * a->left[c];
            a->before[c] = z;
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

/* the answer to the load most like r, or the one unused for longest, emptied */
static pal_tissue_answer *find_answer(pal_tissue_compliance *tissue, const double *r, double size2)
{
    const pal_body *body = tissue->step->body;
    pal_tissue_answer *best = NULL, *oldest = &tissue->answer[0];
    double nearest = PAL_SAME_COSINE;
    for (int k = 0; k < PAL_TISSUE_ANSWERS; k++) {
        pal_tissue_answer *a = &tissue->answer[k];
        if (a->used < oldest->used) oldest = a;
        const double cosine = a->size2 > 0 ? dot(body, a->force, r) / sqrt(a->size2 * size2) : 0;
        if (cosine > nearest) nearest = cosine, best = a;
    }
    if (best) return best;
    const size_t n = 3 * sizeof(double) * (size_t)body->n_dof;
    memset(oldest->move, 0, n), memset(oldest->direction, 0, n), memset(oldest->before, 0, n);
    oldest->fall2 = 0;
    return oldest;
}

/* the answer for the load in product, continued; false: not known yet */
static bool continue_answer(pal_tissue_compliance *tissue, pal_tissue_answer **out)
{
    pal_body *body = tissue->step->body;
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
    while (good && tissue->credit >= 1 && dot(body, a->left, a->left) > ANSWER_SHARE * ANSWER_SHARE * size2)
        good = iterate(tissue, a);
    const double left2 = dot(body, a->left, a->left);
    if (!isfinite(left2)) a->size2 = 0;
    return left2 <= ANSWER_SHARE * ANSWER_SHARE * size2;
}

static bool solve(void *self, const pal_body *body, const double *force_N, double *move_m)
{
    pal_tissue_compliance *tissue = self;
    pal_body *own = tissue->step->body;
    pal_tissue_answer *a = NULL;
    find_diagonal(tissue);
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

void pal_tissue_compliance_begin(pal_tissue_compliance *tissue, pal_step *step)
{
    tissue->step = step;
    tissue->credit = fmin(tissue->credit + ITERATIONS_1_S * step->dt_s * step->n_sub, 2 * ITERATIONS_1_S * FRAME_S);
}

void pal_tissue_compliance_reset(pal_tissue_compliance *tissue)
{
    for (int k = 0; k < PAL_TISSUE_ANSWERS; k++) tissue->answer[k].size2 = 0;
}

pal_err pal_tissue_compliance_make(const pal_body *body, pal_arena *arena, pal_tissue_compliance *out)
{
    const size_t n = (size_t)body->n_dof;
    memset(out, 0, sizeof *out);
    bool made = PAL_NEW_DOUBLES(arena, 3 * n, &out->x, &out->low, &out->product) &&
                PAL_NEW_DOUBLES(arena, n, &out->inverse) && PAL_NEW_DOUBLES(arena, (size_t)body->n_node, &out->bound);
    for (int k = 0; k < PAL_TISSUE_ANSWERS && made; k++) {
        pal_tissue_answer *a = &out->answer[k];
        made = PAL_NEW_DOUBLES(arena, 3 * n, &a->force, &a->move, &a->left, &a->direction, &a->before);
    }
    out->hook = (pal_compliance){.self = out, .solve = solve};
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}
