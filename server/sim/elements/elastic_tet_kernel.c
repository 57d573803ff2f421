/* Elastic tetrahedra: forces, rotations and tangents, 8 elements at a time.
 *
 * With h = sum of x_a (dN_a/dl)' the gradient in local coordinates and D = dl/dX the inverse at rest, F = h D. The
 * tangent of the corotational law needs neither the rotation nor D alone: in current axes K has the gradients of the
 * shape functions turned by R, that is D R', 9 numbers per element. For the neo-Hookean law the same trick leaves D v
 * and u of F = u diag(s) v'. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/shape_functions.h"
#include "server/sim/elements/elastic_tet_block.h"

#include <string.h>

enum { SLOW_TURNS = 100 };

/* sigma = mu (a + a') + lambda tr a I */
PAL_INLINE void stress(pal_wide mu, pal_wide lambda, const pal_wide a[9], pal_wide s[9])
{
    pal_wide pressure = lambda * (a[0] + a[4] + a[8]), two = mu + mu;
    s[0] = two * a[0] + pressure, s[4] = two * a[4] + pressure, s[8] = two * a[8] + pressure;
    s[1] = s[3] = mu * (a[1] + a[3]);
    s[2] = s[6] = mu * (a[2] + a[6]);
    s[5] = s[7] = mu * (a[5] + a[7]);
}

/* lanes that need pal_polar_rotation */
static __attribute__((noinline)) void settle_slowly(const pal_wide f[9], unsigned left, double *q)
{
    for (int l = 0; l < PAL_WIDE; l++) {
        if (!(left >> l & 1)) continue;
        double g[9], p[4];
        for (int i = 0; i < 9; i++) g[i] = f[i][l];
        for (int i = 0; i < 4; i++) p[i] = q[i * PAL_LANES + l];
        pal_polar_rotation(g, p, SLOW_TURNS);
        for (int i = 0; i < 4; i++) q[i * PAL_LANES + l] = p[i];
    }
}

/* rotations of F at the centres of half a block: r, m = r'F */
PAL_INLINE int take_turn(double *turn, pal_wide_mask live, const pal_wide f[9], pal_wide r[9], pal_wide m[9])
{
    pal_wide q[4];
    pal_tet_load9(turn, 4, q);
    unsigned left = pal_wide_polar(f, live, PAL_TET_ROTATION_STEPS, q, r, m);
    for (int i = 0; i < 4; i++) pal_wide_store(turn + (size_t)i * PAL_LANES, q[i]);
    if (!left) return 0;
    settle_slowly(f, left, turn);
    pal_tet_load9(turn, 4, q);
    pal_wide_rotation(q, r);
    pal_wide_tmul(m, r, f);
    return __builtin_popcount(left);
}

/* F at the centre, and for ten nodes at the Gauss points; the elements that are inverted at any of them */
PAL_INLINE pal_wide_mask take_gradient(const pal_elastic_tets *t, int n_corner, const pal_tet_block *at, int lane,
                                       const pal_wide inverse[9], pal_wide f[9], pal_wide inner[4][9])
{
    pal_wide h[9];
    pal_tet_local_gradient(t, n_corner, PAL_TET_CENTRE, at, lane, h);
    pal_wide_mul(f, h, inverse);
    pal_wide_mask inverted = pal_wide_det(f) <= 0;
    for (int g = 0; g < 4 && n_corner > 4; g++) {
        pal_tet_local_gradient(t, n_corner, g, at, lane, h);
        pal_wide_mul(inner[g], h, inverse);
        inverted |= pal_wide_det(inner[g]) <= 0;
    }
    return inverted;
}

/* records inverted elements; those with an averaged rotation receive no force yet: their lanes leave `live` */
PAL_INLINE pal_wide_mask note_inverted(pal_elastic_tets *t, int first_lane, pal_wide_mask inverted, pal_wide_mask live)
{
    inverted &= live;
    if (pal_wide_all(~inverted)) return live;
    for (int l = 0; l < PAL_WIDE; l++)
        if (inverted[l]) t->inverted[t->n_inverted++] = t->owner[first_lane + l];
    return t->options.recover && t->options.law == PAL_LAW_COROTATIONAL ? live & ~inverted : live;
}

enum { FORCE = 1, ENERGY = 2 };

/* s = R [y] D', y = A^-1 t, A = tr(m) I - m for symmetric m = R'F at the centre: what the change of the rotation adds
 * to the force when a turn w of R changes the energy by t.w */
PAL_INLINE void turn_stress(const pal_wide r[9], const pal_wide m[9], const pal_wide t[3], const pal_wide inverse[9],
                            pal_wide s[9])
{
    const pal_wide zero = {0};
    pal_wide axx = m[4] + m[8], ayy = m[0] + m[8], azz = m[0] + m[4];
    pal_wide axy = -0.5 * (m[1] + m[3]), axz = -0.5 * (m[2] + m[6]), ayz = -0.5 * (m[5] + m[7]);
    pal_wide cxx = ayy * azz - ayz * ayz, cxy = axz * ayz - axy * azz, cxz = axy * ayz - axz * ayy;
    pal_wide cyy = axx * azz - axz * axz, cyz = axy * axz - axx * ayz, czz = axx * ayy - axy * axy;
    pal_wide det = axx * cxx + axy * cxy + axz * cxz, sum = axx + ayy + azz;
    /* omitted where the rotation is nearly undefined */
    pal_wide_mask good = (axx > 0) & (czz > 0) & (det > 1e-3 * sum * sum * sum);
    pal_wide one = pal_wide_select(good, 1 + zero, zero) / pal_wide_select(good, det, 1 + zero);
    pal_wide x = one * (cxx * t[0] + cxy * t[1] + cxz * t[2]), y = one * (cxy * t[0] + cyy * t[1] + cyz * t[2]),
             z = one * (cxz * t[0] + cyz * t[1] + czz * t[2]);
    pal_wide p[9];
    for (int i = 0; i < 3; i++) {
        p[3 * i] = r[3 * i + 1] * z - r[3 * i + 2] * y;
        p[3 * i + 1] = r[3 * i + 2] * x - r[3 * i] * z;
        p[3 * i + 2] = r[3 * i] * y - r[3 * i + 1] * x;
    }
    pal_wide_mult(s, p, inverse);
}

/* stress at every Gauss point with the rotation r of the centre, m = r'F there on entry */
PAL_INLINE pal_wide rotated_stress(const pal_elastic_tets *t, int n_corner, bool linear, int what, int lane,
                                   const pal_wide inverse[9], pal_wide mu, pal_wide lambda, const pal_wide r[9],
                                   const pal_wide centre[9], pal_wide inner[4][9], pal_tet_block *at)
{
    const pal_wide zero = {0};
    pal_wide f[9], m[9], s[9], sum = zero, turn[3] = {zero, zero, zero};
    int n_point = n_corner == 4 ? 1 : 4;
    for (int g = 0; g < n_point; g++) {
        memcpy(m, centre, sizeof m);
        if (n_point > 1 && linear)
            memcpy(m, inner[g], sizeof m);
        else if (n_point > 1)
            pal_wide_tmul(m, r, inner[g]);
        m[0] -= 1, m[4] -= 1, m[8] -= 1;
        stress(mu, lambda, m, s);
        if (what & ENERGY)
            for (int i = 0; i < 9; i++) sum += s[i] * m[i];
        if (!(what & FORCE)) continue;
        if (n_point > 1 && !linear) {
            pal_wide_mul(f, m, s);
            turn[0] += f[7] - f[5], turn[1] += f[2] - f[6], turn[2] += f[3] - f[1];
        }
        if (linear)
            memcpy(f, s, sizeof f);
        else
            pal_wide_mul(f, r, s);
        pal_wide_mult(s, f, inverse);
        pal_tet_add_force(t, n_corner, g, at, lane, s);
    }
    if (n_point > 1 && !linear && (what & FORCE)) {
        turn_stress(r, centre, turn, inverse, s);
        pal_tet_add_force(t, n_corner, PAL_TET_CENTRE, at, lane, s);
    }
    return 0.5 * sum;
}

PAL_INLINE pal_wide corotational_half(pal_elastic_tets *t, int n_corner, bool linear, int what, int b, int lane,
                                      pal_tet_block *at)
{
    const pal_wide zero = {0};
    pal_wide f[9], inner[4][9], r[9], m[9], inverse[9];
    pal_tet_load9(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
    pal_wide mu = pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + lane),
             lambda = pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + PAL_LANES + lane);
    pal_wide_mask live = mu > 0;
    pal_wide_mask inverted = take_gradient(t, n_corner, at, lane, inverse, f, inner);
    pal_wide_mask asked = note_inverted(t, PAL_LANES * b + lane, inverted, live);
    if (linear)
        memcpy(m, f, sizeof m);
    else
        t->n_slow += take_turn(t->turn + (size_t)b * 4 * PAL_LANES + lane, live, f, r, m);
    double share = n_corner == 4 ? 1 : 0.25;
    mu = share * pal_wide_select(asked, mu, zero), lambda = share * pal_wide_select(asked, lambda, zero);
    return rotated_stress(t, n_corner, linear, what, lane, inverse, mu, lambda, r, m, inner, at);
}

PAL_INLINE pal_wide neo_half(pal_elastic_tets *t, int n_corner, int what, int b, int lane, pal_tet_block *at)
{
    const pal_wide zero = {0};
    pal_wide h[9], f[9], c[9], inverse[9], sum = zero;
    pal_tet_load9(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
    pal_wide mu = pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + lane),
             k1 = mu + pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + PAL_LANES + lane);
    pal_wide_mask live = mu > 0, inverted = ~live & live;
    int n_point = n_corner == 4 ? 1 : 4;
    if (n_point > 1) mu *= 0.25, k1 *= 0.25;
    for (int g = 0; g < n_point; g++) {
        pal_tet_local_gradient(t, n_corner, g, at, lane, h);
        pal_wide_mul(f, h, inverse);
        inverted |= pal_wide_det(f) <= 0;
        /* in a = F - I, so that small strains do not drown in J - 1 (elastic_law.c) */
        f[0] -= 1, f[4] -= 1, f[8] -= 1;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
                c[3 * i + j] = f[3 * i1 + j1] * f[3 * i2 + j2] - f[3 * i1 + j2] * f[3 * i2 + j1];
            }
        pal_wide trace = f[0] + f[4] + f[8], second = c[0] + c[4] + c[8],
                 third = f[0] * c[0] + f[1] * c[1] + f[2] * c[2], j = trace + second + third;
        if (what & ENERGY) {
            pal_wide squares = zero;
            for (int i = 0; i < 9; i++) squares += f[i] * f[i];
            sum += 0.5 * mu * squares - mu * (second + third) + 0.5 * k1 * j * j;
        }
        if (!(what & FORCE)) continue;
        /* cof F = I + tr a I - a' + cof a; P = mu (F - cof F) + k1 (J - 1) cof F */
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) h[3 * i + k] = c[3 * i + k] - f[3 * k + i];
        for (int i = 0; i < 9; i += 4) h[i] += trace;
        for (int i = 0; i < 9; i++) c[i] = mu * (f[i] - h[i]) + k1 * j * (h[i] + (i % 4 == 0 ? 1.0 : 0.0));
        pal_wide_mult(f, c, inverse);
        pal_tet_add_force(t, n_corner, g, at, lane, f);
    }
    note_inverted(t, PAL_LANES * b + lane, inverted, live);
    return sum;
}

PAL_INLINE double all_blocks(pal_elastic_tets *t, int n_corner, pal_elastic_law law, int what, const double *x,
                             double *force)
{
    double sum = 0;
    pal_tet_block at;
    for (int b = 0; b < t->n_block; b++) {
        if (n_corner == 4)
            pal_tet_load_block(t, b, &at);
        else
            pal_tet10_load_block(t, b, x, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            pal_wide part = law == PAL_LAW_NEO_HOOKEAN
                                ? neo_half(t, n_corner, what, b, lane, &at)
                                : corotational_half(t, n_corner, law == PAL_LAW_LINEAR, what, b, lane, &at);
            for (int l = 0; l < PAL_WIDE && (what & ENERGY); l++) sum += part[l];
        }
        if (!(what & FORCE)) continue;
        if (n_corner == 4)
            pal_tet_store_block(t, b, &at);
        else
            pal_tet10_store_block(t, b, &at, force);
    }
    return sum;
}

/* the kernels; rotations and the list of inverted elements are taken on the way */
static double run_blocks(pal_elastic_tets *t, int what, const double *x, double *force)
{
    t->n_inverted = t->n_slow = 0;
#define CASE(n, l, w)                                                                                                  \
    if (t->options.n_corner == n && t->options.law == l && what == (w)) return all_blocks(t, n, l, w, x, force)
    CASE(4, PAL_LAW_COROTATIONAL, FORCE);
    CASE(4, PAL_LAW_LINEAR, FORCE);
    CASE(4, PAL_LAW_NEO_HOOKEAN, FORCE);
    CASE(10, PAL_LAW_COROTATIONAL, FORCE);
    CASE(10, PAL_LAW_LINEAR, FORCE);
    CASE(10, PAL_LAW_NEO_HOOKEAN, FORCE);
    CASE(4, PAL_LAW_COROTATIONAL, ENERGY);
    CASE(4, PAL_LAW_LINEAR, ENERGY);
    CASE(4, PAL_LAW_NEO_HOOKEAN, ENERGY);
    CASE(10, PAL_LAW_COROTATIONAL, ENERGY);
    CASE(10, PAL_LAW_LINEAR, ENERGY);
    CASE(10, PAL_LAW_NEO_HOOKEAN, ENERGY);
    CASE(4, PAL_LAW_COROTATIONAL, FORCE | ENERGY);
    CASE(4, PAL_LAW_LINEAR, FORCE | ENERGY);
    CASE(4, PAL_LAW_NEO_HOOKEAN, FORCE | ENERGY);
    CASE(10, PAL_LAW_COROTATIONAL, FORCE | ENERGY);
    CASE(10, PAL_LAW_LINEAR, FORCE | ENERGY);
    CASE(10, PAL_LAW_NEO_HOOKEAN, FORCE | ENERGY);
#undef CASE
    return 0;
}

/* rotations alone */
static void turn_blocks(pal_elastic_tets *t, const double *x)
{
    pal_tet_block at;
    t->n_inverted = t->n_slow = 0;
    for (int b = 0; b < t->n_block; b++) {
        int n_corner = t->options.n_corner;
        if (n_corner == 4)
            pal_tet_load_block(t, b, &at);
        else
            pal_tet10_load_block(t, b, x, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            pal_wide f[9], inner[4][9], r[9], m[9], inverse[9];
            pal_wide_mask live = pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + lane) > 0;
            pal_tet_load9(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
            note_inverted(t, PAL_LANES * b + lane, take_gradient(t, n_corner, &at, lane, inverse, f, inner), live);
            if (t->options.law != PAL_LAW_LINEAR)
                t->n_slow += take_turn(t->turn + (size_t)b * 4 * PAL_LANES + lane, live, f, r, m);
        }
    }
}

/* one element on its own */
void pal_elastic_tets_rotation(const pal_elastic_tets *t, int e, double r[9])
{
    double q[4];
    for (int i = 0; i < 4; i++) q[i] = pal_lane_get(t->turn, 4, t->place[e], i);
    pal_quat_matrix(q, r);
}

void pal_elastic_tets_gradient(const pal_elastic_tets *t, int e, int point, const double *d, double f[9])
{
    const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
    double h[9] = {0};
    for (int a = 0; a < t->options.n_corner; a++)
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) h[3 * r + c] += d[3 * node[a] + r] * t->shape[point][a][c];
    for (int r = 0; r < 3; r++)
        for (int m = 0; m < 3; m++) {
            f[3 * r + m] = 0;
            for (int c = 0; c < 3; c++)
                f[3 * r + m] += h[3 * r + c] * pal_lane_get(t->inverse, 9, t->place[e], 3 * c + m);
        }
}

/* force, its torque about the origin, and energy of a corotational element with its present rotation */
double pal_tet_add_element(const pal_elastic_tets *t, int e, const double *d, double *force, double *torque)
{
    double r[9], f[9], p[9], sum = 0;
    pal_elastic_tets_rotation(t, e, r);
    double share = (t->single_rotation ? t->soft : 1) / t->n_point,
           mu = share * pal_lane_get(t->stiff, 2, t->place[e], 0),
           lambda = share * pal_lane_get(t->stiff, 2, t->place[e], 1);
    const int32_t *node = t->corner + (size_t)t->options.n_corner * (size_t)e;
    for (int g = 0; g < t->n_point; g++) {
        pal_elastic_tets_gradient(t, e, g, d, f);
        sum += pal_corotational_stress(mu, lambda, f, r, p);
        if (!force) continue;
        for (int k = 0; k < 3; k++) { /* of x and f: -F P' */
            int i = (k + 1) % 3, j = (k + 2) % 3;
            torque[k] += pal_dot3(f + 3 * j, p + 3 * i) - pal_dot3(f + 3 * i, p + 3 * j);
        }
        for (int a = 0; a < t->options.n_corner; a++)
            for (int c = 0; c < 3; c++)
                for (int m = 0; m < 3; m++)
                    for (int k = 0; k < 3; k++)
                        force[3 * node[a] + k] -=
                            p[3 * k + m] * pal_lane_get(t->inverse, 9, t->place[e], 3 * c + m) * t->shape[g][a][c];
    }
    return sum;
}

/* f -= forces a x r at the nodes, r from the mean, which have this torque and no resultant: they balance averaged
 * rotations */
void pal_tet_balance_torque(const pal_elastic_tets *t, const double *d, const double torque[3], double *f)
{
    double mean[3] = {0}, s[9] = {0}, r[3], w[3], v[9], a[3] = {0};
    for (int i = 0; i < t->n_node; i++) pal_axpy3(mean, 1.0 / t->n_node, d + 3 * i);
    for (int i = 0; i < t->n_node; i++) {
        pal_sub3(r, d + 3 * i, mean);
        for (int k = 0; k < 9; k++) s[k] += r[k / 3] * r[k % 3];
    }
    double trace = s[0] + s[4] + s[8];
    if (!(trace > 0 && trace < INFINITY)) return;
    for (int k = 0; k < 9; k++) s[k] = (k % 4 == 0 ? trace : 0) - s[k];
    pal_eigen3(s, w, v);
    /* none about the axis of nodes on a line */
    for (int k = 0; k < 3; k++)
        if (w[k] > 1e-9 * trace) pal_axpy3(a, pal_dot3(v + 3 * k, torque) / w[k], v + 3 * k);
    for (int i = 0; i < t->n_node; i++) {
        pal_sub3(r, d + 3 * i, mean);
        pal_cross3(r, a, r);
        pal_axpy3(f + 3 * i, -1, r);
    }
}

/* averaged rotations: around nodes from the elements that are not inverted, then of the others */
static void recover(pal_elastic_tets *t)
{
    memset(t->around, 0, 9 * sizeof(double) * (size_t)t->n_node);
    for (int i = 0; i < t->n_inverted; i++) t->flag[t->inverted[i]] = 1;
    for (int e = 0; e < t->options.n_tet; e++) {
        double r[9], volume = pal_lane_get(t->volume_m3, 1, t->place[e], 0);
        if (t->flag[e] || volume <= 0) continue;
        pal_elastic_tets_rotation(t, e, r);
        for (int c = 0; c < 4; c++)
            for (int i = 0; i < 9; i++) t->around[9 * t->corner[t->options.n_corner * e + c] + i] += volume * r[i];
    }
    for (int k = 0; k < t->n_inverted; k++) {
        int e = t->inverted[k];
        double sum[9] = {0}, q[4], max = 0;
        t->flag[e] = 0;
        for (int c = 0; c < 4; c++) {
            /* a node is weighted by its rotation, not by the volume around it */
            const double *a = t->around + 9 * t->corner[t->options.n_corner * e + c];
            double length = 0;
            for (int i = 0; i < 9; i++) length += a[i] * a[i];
            for (int i = 0; i < 9 && length > 0; i++) sum[i] += a[i] / sqrt(length);
        }
        for (int i = 0; i < 9; i++) max = fmax(max, fabs(sum[i]));
        if (!(max > 1e-9)) continue;
        for (int i = 0; i < 4; i++) q[i] = pal_lane_get(t->turn, 4, t->place[e], i);
        pal_polar_rotation(sum, q, SLOW_TURNS);
        for (int i = 0; i < 4; i++) pal_lane_set(t->turn, 4, t->place[e], i, q[i]);
    }
}

static bool has_inversion(const pal_elastic_tets *t)
{
    return t->n_inverted > 0 && t->options.recover && t->options.law == PAL_LAW_COROTATIONAL;
}

static double take(pal_elastic_tets *t, int what, const double *d, double *f)
{
    bool node_order = t->options.n_corner == 4;
    if (t->single_rotation) return pal_tet_single_rotation_force(t, d, f);
    if (node_order) pal_node_order_load(t->node_order, d);
    double sum = run_blocks(t, what, d, f), torque[3] = {0};
    if (node_order && f) pal_node_order_add(t->node_order, f);
    if (!has_inversion(t)) return sum;
    recover(t);
    for (int i = 0; i < t->n_inverted; i++) sum += pal_tet_add_element(t, t->inverted[i], d, f, torque);
    if (f) pal_tet_balance_torque(t, d, torque, f);
    return sum;
}

void pal_elastic_tets_force(pal_elastic_tets *t, const double *d, double *f)
{
    take(t, FORCE, d, f);
}

double pal_elastic_tets_energy(pal_elastic_tets *t, const double *d, double *f)
{
    return take(t, f ? FORCE | ENERGY : ENERGY, d, f);
}

/* D R' of every element */
static void take_gradients(pal_elastic_tets *t)
{
    for (int b = 0; b < t->n_block; b++)
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            pal_wide q[4], r[9], inverse[9], g[9];
            pal_tet_load9(t->turn + (size_t)b * 4 * PAL_LANES + lane, 4, q);
            pal_tet_load9(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
            pal_wide_rotation(q, r);
            pal_wide_mult(g, inverse, r);
            for (int i = 0; i < 9; i++)
                pal_wide_store(t->tangent + ((size_t)b * 9 + (size_t)i) * PAL_LANES + lane, g[i]);
        }
}

void pal_elastic_tets_linearise(pal_elastic_tets *t, const double *d)
{
    if (t->options.n_corner == 4) pal_node_order_load(t->node_order, d);
    if (t->single_rotation)
        pal_tet_fit_single_rotation(t, d);
    else
        turn_blocks(t, d);
    if (has_inversion(t) && !t->single_rotation) recover(t);
    if (t->options.law == PAL_LAW_NEO_HOOKEAN)
        pal_elastic_tets_modes(t, d);
    else
        take_gradients(t);
}

PAL_INLINE void multiply_half(const pal_elastic_tets *t, int n_corner, double k, int b, int lane, pal_tet_block *at)
{
    int n_point = n_corner == 4 ? 1 : 4;
    pal_wide h[9], g[9], a[9], s[9];
    pal_tet_load9(t->tangent + (size_t)b * 9 * PAL_LANES + lane, 9, g);
    double share = -k / n_point; /* at->f takes -(-K p) */
    pal_wide mu = share * pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + lane),
             lambda = share * pal_wide_load(t->stiff + (size_t)b * 2 * PAL_LANES + PAL_LANES + lane);
    for (int point = 0; point < n_point; point++) {
        pal_tet_local_gradient(t, n_corner, point, at, lane, h);
        pal_wide_mul(a, h, g);
        stress(mu, lambda, a, s);
        pal_wide_mult(a, s, g);
        pal_tet_add_force(t, n_corner, point, at, lane, a);
    }
}

PAL_INLINE void multiply_neo_half(const pal_elastic_tets *t, int n_corner, double k, int b, int lane, pal_tet_block *at)
{
    int n_point = n_corner == 4 ? 1 : 4;
    for (int point = 0; point < n_point; point++) {
        pal_wide h[9], u[9], g[9], s[6], e[3], c[3], a[9], q[9];
        const double *from =
            t->tangent + ((size_t)b * (size_t)n_point + (size_t)point) * PAL_TET_MODES * PAL_LANES + lane;
        pal_tet_load9(from, 9, u);
        pal_tet_load9(from + 9 * PAL_LANES, 9, g);
        pal_tet_load9(from + 18 * PAL_LANES, 6, s);
        pal_tet_load9(from + 24 * PAL_LANES, 3, e);
        pal_tet_load9(from + 27 * PAL_LANES, 3, c);
        pal_tet_local_gradient(t, n_corner, point, at, lane, h);
        pal_wide_mul(a, h, g);
        pal_wide_tmul(q, u, a);
        a[0] = s[0] * q[0] + s[5] * q[4] + s[4] * q[8];
        a[4] = s[5] * q[0] + s[1] * q[4] + s[3] * q[8];
        a[8] = s[4] * q[0] + s[3] * q[4] + s[2] * q[8];
        a[5] = e[0] * q[5] + c[0] * q[7], a[7] = e[0] * q[7] + c[0] * q[5];
        a[2] = e[1] * q[2] + c[1] * q[6], a[6] = e[1] * q[6] + c[1] * q[2];
        a[1] = e[2] * q[1] + c[2] * q[3], a[3] = e[2] * q[3] + c[2] * q[1];
        pal_wide_mul(q, u, a);
        pal_wide_mult(a, q, g);
        for (int i = 0; i < 9; i++) a[i] *= -k;
        pal_tet_add_force(t, n_corner, point, at, lane, a);
    }
}

PAL_INLINE void multiply_blocks(const pal_elastic_tets *t, int n_corner, bool neo, double k, const double *p,
                                double *out)
{
    pal_tet_block at;
    for (int b = 0; b < t->n_block; b++) {
        if (n_corner == 4)
            pal_tet_load_block(t, b, &at);
        else
            pal_tet10_load_block(t, b, p, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            if (neo)
                multiply_neo_half(t, n_corner, k, b, lane, &at);
            else
                multiply_half(t, n_corner, k, b, lane, &at);
        }
        if (n_corner == 4)
            pal_tet_store_block(t, b, &at);
        else
            pal_tet10_store_block(t, b, &at, out);
    }
}

void pal_elastic_tets_multiply(const pal_elastic_tets *t, double k, const double *p, double *out)
{
    bool neo = t->options.law == PAL_LAW_NEO_HOOKEAN;
    if (t->single_rotation) k *= t->soft;
    if (t->options.n_corner == 4) {
        pal_node_order_load(t->node_order, p);
        if (neo)
            multiply_blocks(t, 4, true, k, p, out);
        else
            multiply_blocks(t, 4, false, k, p, out);
        pal_node_order_add(t->node_order, out);
    } else if (neo)
        multiply_blocks(t, 10, true, k, p, out);
    else
        multiply_blocks(t, 10, false, k, p, out);
}
