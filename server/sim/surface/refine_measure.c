/* Criteria of refinement at the nodes of an adaptive surface, and sums on both sides of a change of level. */
#include "server/sim/surface/refine_measure.h"

#include "server/base/vec3.h"

#include <string.h>

pal_err pal_refine_measure_make(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, pal_arena *arena)
{
    size_t n = (size_t)adaptive->levels.n_vertex[adaptive->levels.n_level - 1];
    *measure = (pal_refine_measure){.frame.quat = {1, 0, 0, 0}};
    measure->sum = PAL_NEW(arena, double, 8 * n);
    measure->rest_curvature = PAL_NEW(arena, double, n);
    measure->mark = PAL_NEW(arena, uint8_t, n);
    return measure->sum && measure->rest_curvature && measure->mark ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* ---- curvature ---- */

static void add_normals(double *sum, const pal_adaptive_surface *adaptive, const double *x)
{
    for (int t = 0; t < adaptive->n_tri; t++) {
        const int32_t *c = adaptive->tri + 3 * (size_t)t;
        double n[3];
        pal_normal3(n, x + 3 * (size_t)c[0], x + 3 * (size_t)c[1], x + 3 * (size_t)c[2]);
        for (int k = 0; k < 3; k++) {
            double *to = sum + 8 * (size_t)c[k];
            pal_add3(to, to, n);
        }
    }
}

static void add_springs(double *sum, const pal_adaptive_surface *adaptive, const double *x)
{
    for (int s = 0; s < adaptive->n_spring; s++) {
        const int32_t *end = adaptive->levels.edge[adaptive->spring[s]].vertex;
        double *a = sum + 8 * (size_t)end[0], *b = sum + 8 * (size_t)end[1], d[3], d2;
        pal_sub3(d, x + 3 * (size_t)end[1], x + 3 * (size_t)end[0]);
        d2 = pal_dot3(d, d);
        a[6] += 1, b[6] += 1;
        /* a spring without length has no direction to bend in */
        if (!(d2 > 0)) continue;
        pal_axpy3(a + 3, 1 / d2, d);
        pal_axpy3(b + 3, -1 / d2, d);
    }
}

static void take_sums(double *sum, const pal_adaptive_surface *adaptive, const double *x)
{
    for (int k = 0; k < adaptive->n_node; k++) memset(sum + 8 * (size_t)adaptive->node[k], 0, 8 * sizeof *sum);
    add_normals(sum, adaptive, x);
    add_springs(sum, adaptive, x);
}

static inline double curvature(const double *sum)
{
    return 2 * pal_dot3(sum, sum + 3) / (pal_norm3(sum) * sum[6]);
}

void pal_refine_curvature(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, const double *x,
                          double *out)
{
    take_sums(measure->sum, adaptive, x);
    for (int k = 0; k < adaptive->n_node; k++)
        out[adaptive->node[k]] = curvature(measure->sum + 8 * (size_t)adaptive->node[k]);
}

/* ---- marks ---- */

/* value and thresholds as squares */
static inline int judge(double value2, double limit2, double quiet2)
{
    return value2 > limit2 ? PAL_REFINE_REQUESTED : value2 < quiet2 ? PAL_REFINE_QUIET : PAL_REFINE_BETWEEN;
}

static inline int larger(int a, int b)
{
    return a > b ? a : b;
}

static double speed2(const pal_rigid_fit *frame, const double *x, const double *v)
{
    double arm[3], rigid[3], rest[3];
    pal_sub3(arm, x, frame->centre_m);
    pal_cross3(rigid, frame->Omega_1_s, arm);
    for (int c = 0; c < 3; c++) rest[c] = v[c] - frame->V_m_s[c] - rigid[c];
    return pal_dot3(rest, rest);
}

/* sums of curvature now, after that at rest where the nodes have changed */
static void take_curvature(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, const pal_body *body)
{
    if (!measure->known || measure->revision != adaptive->revision) {
        pal_refine_curvature(measure, adaptive, body->x_rest, measure->rest_curvature);
        measure->known = true;
        measure->revision = adaptive->revision;
    }
    take_sums(measure->sum, adaptive, body->x);
}

void pal_refine_mark_nodes(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, const pal_body *body,
                           const pal_refine_limits *limits)
{
    const bool force = limits->force_N > 0, speed = limits->speed_m_s > 0, bend = limits->curvature_1_m > 0;
    const double m_0 = adaptive->level_mass_kg[0], speed_2 = limits->speed_m_s * limits->speed_m_s,
                 force_2 = limits->force_N * limits->force_N, bend_2 = limits->curvature_1_m * limits->curvature_1_m;
    if (speed) pal_adaptive_fit_rigid(adaptive, body, &measure->frame);
    if (bend) take_curvature(measure, adaptive, body);
    for (int k = 0; k < adaptive->n_node; k++) {
        const size_t i = (size_t)adaptive->node[k];
        const double share = body->mass_kg[i] / m_0;
        int mark = PAL_REFINE_QUIET;
        if (force) {
            double at = force_2 * share * share;
            mark = judge(pal_dot3(body->load + 3 * i, body->load + 3 * i), at, 0.25 * at);
        }
        if (speed) {
            double v2 = speed2(&measure->frame, body->x + 3 * i, body->v + 3 * i);
            mark = larger(mark, judge(v2, speed_2, 0.25 * speed_2));
        }
        if (bend) {
            double change = curvature(measure->sum + 8 * i) - measure->rest_curvature[i];
            mark = larger(mark, judge(change * change, bend_2 / share, 0.0625 * bend_2 / share));
        }
        measure->mark[i] = (uint8_t)mark;
    }
}

/* ---- both sides of a switch ---- */

void pal_refine_balance_compute(pal_refine_balance *side, const pal_step *step)
{
    const pal_body *body = step->body;
    *side = (pal_refine_balance){0};
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        const double m = body->mass_kg[i], *v = body->v + 3 * (size_t)i;
        side->mass_kg += m;
        side->kinetic_J += 0.5 * m * pal_dot3(v, v);
        if (body->support[i]) continue;
        double angular[3];
        pal_cross3(angular, body->x + 3 * (size_t)i, v);
        pal_axpy3(side->momentum_kg_m_s, m, v);
        pal_axpy3(side->angular_momentum_kg_m2_s, m, angular);
    }
    for (int i = 0; i < step->n_force; i++) {
        const pal_effect *effect = step->force[i].effect;
        if (!effect->energy) continue;
        double energy = effect->energy(step->force[i].self, body);
        if (!strcmp(effect->name, "edge_spring"))
            side->spring_J += energy;
        else if (!strcmp(effect->name, "shape_spring"))
            side->shape_J += energy;
        else
            side->other_J += energy;
    }
}
