/* Stress, energy, strain and modulus of an adaptive surface, leaf by leaf. */
#include "server/sim/surface/adaptive_measure.h"

#include "server/base/vec3.h"

#include <math.h>

/* sums over the springs of one leaf */
typedef struct leaf_sum {
    double virial_J[9]; /* sum of (f / l) d d' */
    double energy_J, young_N_m, share;
} leaf_sum;

/* part of a leaf's share in a spring on its side: a half of a side that a finer neighbour splits is twice as stiff, as
 * it is half as long (adaptive_surface.h) */
static double share_of(const pal_adaptive_surface *s, int32_t edge, bool half)
{
    if (s->options.law == PAL_ADAPTIVE_MEMBRANE) return half ? 1 : 0.5;
    const int level = s->levels.edge_level[edge];
    const int32_t *beside = s->levels.edge[edge].face;
    const int n_face = (beside[0] >= 0) + (beside[1] >= 0);
    return ldexp(s->level_mass_kg[level] / s->level_mass_kg[0], level) / (n_face > 0 ? n_face : 1);
}

static void add_spring(const pal_adaptive_surface *s, const pal_adaptive_springs *springs, const double *x,
                       int32_t edge, bool half, leaf_sum *to)
{
    const size_t a = 3 * (size_t)s->levels.edge[edge].vertex[0], b = 3 * (size_t)s->levels.edge[edge].vertex[1];
    const double young = springs->edge_young && !isnan(springs->edge_young[edge]) ? (double)springs->edge_young[edge]
                                                                                  : springs->young_Pa,
                 share = share_of(s, edge, half), k = springs->k_N_m * share * (young / springs->young_Pa);
    double d[3], rest[3];
    pal_sub3(d, x + b, x + a);
    pal_sub3(rest, s->levels.x + b, s->levels.x + a);
    const double l = pal_norm3(d), l0 = pal_norm3(rest);
    for (int i = 0; i < 9 && l > PAL_ROUNDING * l0; i++) to->virial_J[i] += k * (1 - l0 / l) * d[i / 3] * d[i % 3];
    to->energy_J += 0.5 * k * (l - l0) * (l - l0);
    to->young_N_m += k, to->share += share;
}

static double von_mises(const double s[9])
{
    const double mean = (s[0] + s[4] + s[8]) / 3;
    double square = 0;
    for (int i = 0; i < 9; i++) square += (s[i] - (i % 4 == 0 ? mean : 0)) * (s[i] - (i % 4 == 0 ? mean : 0));
    return sqrt(1.5 * square);
}

/* two sides of a triangle and its area */
static double sides(const double *x, const int32_t tri[3], double u[3], double v[3])
{
    double normal[3];
    pal_sub3(u, x + 3 * (size_t)tri[1], x + 3 * (size_t)tri[0]);
    pal_sub3(v, x + 3 * (size_t)tri[2], x + 3 * (size_t)tri[0]);
    pal_cross3(normal, u, v);
    return 0.5 * pal_norm3(normal);
}

/* largest principal stretch less 1: of C = G0^-1 G with the inner products G of the sides now, G0 at rest */
static double largest_strain(const double *x, const double *rest, const int32_t tri[3])
{
    double u[3], v[3], p[3], q[3];
    sides(x, tri, u, v);
    const double area = sides(rest, tri, p, q), det = 4 * area * area;
    const double a = pal_dot3(p, p), b = pal_dot3(p, q), c = pal_dot3(q, q);
    const double A = pal_dot3(u, u), B = pal_dot3(u, v), C = pal_dot3(v, v);
    const double half = 0.5 * (c * A - 2 * b * B + a * C) / det, product = (A * C - B * B) / det;
    return sqrt(half + sqrt(fmax(half * half - product, 0))) - 1;
}

static void sum_leaf(const pal_adaptive_surface *s, const pal_adaptive_springs *springs, const double *d, int32_t leaf,
                     leaf_sum *to)
{
    for (int k = 0; k < 3; k++) {
        const int32_t edge = s->levels.face_edge[3 * (size_t)leaf + (size_t)k];
        const bool split = s->edge_split[edge] > 0;
        if (!split) add_spring(s, springs, d, edge, false, to);
        for (int h = 0; h < 2 && split; h++)
            add_spring(s, springs, d, pal_levels_edge_half(&s->levels, edge, h), true, to);
    }
}

void pal_adaptive_measure(const pal_adaptive_surface *s, const pal_adaptive_springs *springs, const double *d,
                          pal_field field, double *sum, double *area_m2)
{
    const double *rest = s->levels.x, t = springs->thickness_m;
    for (int k = 0; k < s->n_leaf; k++) {
        int32_t tri[4][3];
        const int n = pal_adaptive_triangles(s, s->leaf[k], tri);
        double u[3], v[3], area = 0, now = 0, value = 0;
        leaf_sum of = {.share = 0};
        for (int i = 0; i < n; i++) area += sides(rest, tri[i], u, v), now += sides(d, tri[i], u, v);
        if (field != PAL_FIELD_STRAIN) sum_leaf(s, springs, d, s->leaf[k], &of);
        if (field == PAL_FIELD_VON_MISES_PA) value = von_mises(of.virial_J) / (fmax(now, 1e-6 * area) * t);
        if (field == PAL_FIELD_ENERGY_J_M3) value = of.energy_J / (area * t);
        if (field == PAL_FIELD_YOUNG_PA) value = 2 / sqrt(3) * of.young_N_m / (of.share * t);
        for (int i = 0; i < n; i++) {
            const double part = sides(rest, tri[i], u, v) / 3;
            if (field == PAL_FIELD_STRAIN) value = largest_strain(d, rest, tri[i]);
            for (int c = 0; c < 3; c++) sum[tri[i][c]] += part * value, area_m2[tri[i][c]] += part;
        }
    }
}
