/* Low-rank correction for springs of contact. */
#include "server/sim/implicit/woodbury.h"

#include "server/base/vec3.h"
#include "server/sim/implicit/tuning.h"

#include <string.h>

pal_err pal_woodbury_make(const pal_system *system, const pal_component *component, int n_component, pal_arena *arena,
                          pal_woodbury *out)
{
    bool any = false;
    *out = (pal_woodbury){.system = system};
    for (int i = 0; i < n_component; i++)
        any = any || (component[i].effect->tangent && component[i].effect->tangent->mean_springs);
    if (!any || system->body->interpolation) return PAL_ERR_OK;
    for (int k = 0; k < PAL_WOODBURY_SPRINGS; k++) {
        out->spring[k].u = PAL_NEW(arena, float, 9 * (size_t)system->body->n_dof);
        if (!out->spring[k].u) return PAL_ERR_MEMORY;
    }
    out->n = PAL_WOODBURY_SPRINGS;
    return PAL_ERR_OK;
}

void pal_woodbury_reset(pal_woodbury *woodbury)
{
    for (int k = 0; k < woodbury->n; k++) woodbury->spring[k].spring.revision = 0, woodbury->spring[k].acts = false;
    woodbury->left_s = 0, woodbury->column = 0;
}

/* a column of U, from M */
static void renew(const pal_woodbury *woodbury, pal_woodbury_spring *s, int axis, pal_preconditioner *m, double *work)
{
    const pal_body *body = woodbury->system->body;
    memset(work, 0, pal_body_bytes3(body));
    for (int i = 0; i < s->spring.n_node; i++) work[3 * s->spring.node[i] + axis] = s->spring.weight[i];
    pal_system_clear_supported(body, work);
    pal_preconditioner_solve(m, PAL_CYCLE_V, work, work);
    for (int i = 0; i < 3 * body->n_dof; i++) s->u[3 * i + axis] = (float)work[i];
}

/* B^-1 and G^-1; false: B is not positive definite */
static bool invert(const pal_woodbury *woodbury, pal_woodbury_spring *s)
{
    const double c = woodbury->system->stiff * s->spring.k_N_m;
    double sum[9] = {0}, b[9], g[9];
    for (int i = 0; i < s->spring.n_node; i++)
        for (int k = 0; k < 9; k++)
            sum[k] += s->spring.weight[i] * (double)s->u[9 * (size_t)s->spring.node[i] + (size_t)k];
    for (int k = 0; k < 9; k++) b[k] = 0.5 * (sum[k] + sum[k % 3 * 3 + k / 3]);
    for (int k = 0; k < 3; k++) pal_mul33(g + 3 * k, b, b + 3 * k);
    for (int k = 0; k < 9; k++) g[k] = b[k] + c * g[k];
    return b[0] > 0 && b[0] * b[4] > b[1] * b[1] && pal_inverse33(s->b_inverse, b) > 0 &&
           pal_inverse33(s->g_inverse, g) > 0;
}

/* the springs of all components that act now; returns their number */
static int collect(const pal_woodbury *woodbury, pal_mean_spring *out)
{
    int n = 0;
    for (int i = 0; i < woodbury->system->n_contact; i++) {
        const pal_component *component = &woodbury->system->contact[i];
        if (component->effect->tangent && component->effect->tangent->mean_springs)
            n += component->effect->tangent->mean_springs(component->self, out + n, woodbury->n - n);
    }
    return n;
}

/* where the U of a spring is, else one whose spring acts no more */
static pal_woodbury_spring *find(pal_woodbury *woodbury, const pal_mean_spring *spring)
{
    pal_woodbury_spring *free = NULL;
    for (int k = 0; k < woodbury->n; k++) {
        pal_woodbury_spring *s = &woodbury->spring[k];
        if (s->spring.revision == spring->revision) return s;
        if (!s->acts) free = s;
    }
    return free;
}

void pal_woodbury_update(pal_woodbury *woodbury, pal_preconditioner *m, double *work)
{
    pal_mean_spring now[PAL_WOODBURY_SPRINGS];
    const int n = collect(woodbury, now);
    for (int k = 0; k < woodbury->n; k++) {
        woodbury->spring[k].acts = false;
        for (int i = 0; i < n; i++) woodbury->spring[k].acts |= woodbury->spring[k].spring.revision == now[i].revision;
    }
    for (int i = 0; i < n; i++) {
        pal_woodbury_spring *s = find(woodbury, &now[i]);
        const bool known = s->spring.revision == now[i].revision;
        s->spring = now[i];
        if (!known) woodbury->left_s = PAL_WOODBURY_RENEWAL_S;
        for (int axis = 0; axis < 3 && !known; axis++) renew(woodbury, s, axis, m, work);
        s->acts = true;
    }
    if (n > 0 && !(woodbury->left_s > 0)) {
        do woodbury->column = (woodbury->column + 1) % (3 * woodbury->n);
        while (!woodbury->spring[woodbury->column / 3].acts);
        renew(woodbury, &woodbury->spring[woodbury->column / 3], woodbury->column % 3, m, work);
        woodbury->left_s = PAL_WOODBURY_RENEWAL_S;
    }
    for (int k = 0; k < woodbury->n; k++)
        if (woodbury->spring[k].acts) woodbury->spring[k].acts = invert(woodbury, &woodbury->spring[k]);
}

/* U'r */
static void restrict_to(const pal_woodbury *woodbury, const pal_woodbury_spring *s, const double *r, double t[3])
{
    pal_set3(t, 0, 0, 0);
    for (int i = 0; i < 3 * woodbury->system->body->n_dof; i++)
        for (int axis = 0; axis < 3; axis++) t[axis] += (double)s->u[3 * (size_t)i + (size_t)axis] * r[i];
}

/* p += U y, y = G^-1 t - B^-1 w'p */
static void add(const pal_woodbury *woodbury, const pal_woodbury_spring *s, const double t[3], double *p)
{
    double mean[3] = {0}, y[3];
    for (int i = 0; i < s->spring.n_node; i++) pal_axpy3(mean, s->spring.weight[i], p + 3 * (size_t)s->spring.node[i]);
    pal_mul33(mean, s->b_inverse, mean);
    pal_mul33(y, s->g_inverse, t);
    pal_sub3(y, y, mean);
    for (int i = 0; i < 3 * woodbury->system->body->n_dof; i++) {
        const float *u = s->u + 3 * (size_t)i;
        p[i] += (double)u[0] * y[0] + (double)u[1] * y[1] + (double)u[2] * y[2];
    }
}

void pal_woodbury_guess(const pal_woodbury *woodbury, const double *r, double *p)
{
    for (int k = 0; k < woodbury->n; k++) {
        double t[3];
        if (!woodbury->spring[k].acts) continue;
        restrict_to(woodbury, &woodbury->spring[k], r, t);
        add(woodbury, &woodbury->spring[k], t, p);
    }
}

void pal_woodbury_solve(const pal_woodbury *woodbury, pal_preconditioner *m, pal_cycle cycle, const double *r,
                        double *z)
{
    double t[PAL_WOODBURY_SPRINGS][3], y[3];
    memcpy(z, r, pal_body_bytes3(woodbury->system->body));
    for (int k = 0; k < woodbury->n; k++) {
        const pal_woodbury_spring *s = &woodbury->spring[k];
        if (!s->acts) continue;
        restrict_to(woodbury, s, z, t[k]);
        pal_mul33(y, s->b_inverse, t[k]);
        for (int i = 0; i < s->spring.n_node; i++)
            pal_axpy3(z + 3 * (size_t)s->spring.node[i], -s->spring.weight[i], y);
    }
    pal_system_clear_supported(woodbury->system->body, z);
    pal_preconditioner_solve(m, cycle, z, z);
    for (int k = woodbury->n - 1; k >= 0; k--)
        if (woodbury->spring[k].acts) add(woodbury, &woodbury->spring[k], t[k], z);
}

void pal_woodbury_step(pal_woodbury *woodbury, double dt_s)
{
    woodbury->left_s -= dt_s;
}
