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

/* sigma = mu (a + a') + lambda tr a I */
PAL_INLINE void stress(pal_wide mu, pal_wide lambda, const pal_wide a[9], pal_wide s[9])
{
    pal_wide pressure = lambda * (a[0] + a[4] + a[8]), two = mu + mu;
    s[0] = two * a[0] + pressure, s[4] = two * a[4] + pressure, s[8] = two * a[8] + pressure;
    s[1] = s[3] = mu * (a[1] + a[3]);
    s[2] = s[6] = mu * (a[2] + a[6]);
    s[5] = s[7] = mu * (a[5] + a[7]);
}

PAL_INLINE pal_wide_mask is_bad(pal_wide ratio)
{
    return (ratio < PAL_INVERTED_LOW) | (ratio > PAL_INVERTED_HIGH);
}

/* F at the centre, and for ten nodes at the Gauss points; the elements with a bad ratio of volume at any of them */
PAL_INLINE pal_wide_mask take_gradient(const pal_elastic_tets *t, int n_corner, const pal_block_view *at, int lane,
                                       const pal_wide inverse[9], pal_wide f[9], pal_wide inner[4][9])
{
    pal_wide h[9];
    pal_tet_local_gradient(t, n_corner, PAL_TET_CENTRE, at, lane, h);
    pal_wide_mul(f, h, inverse);
    pal_wide_mask inverted = is_bad(pal_wide_det(f));
    for (int g = 0; g < 4 && n_corner > 4; g++) {
        pal_tet_local_gradient(t, n_corner, g, at, lane, h);
        pal_wide_mul(inner[g], h, inverse);
        inverted |= is_bad(pal_wide_det(inner[g]));
    }
    return inverted;
}

static void note_inverted(pal_elastic_tets *t, pal_wide_mask inverted)
{
    if (pal_wide_all(~inverted)) return;
    for (int l = 0; l < PAL_WIDE; l++) t->n_inverted += inverted[l] != 0;
}

/* s = R [y] D', y = A^-1 t, A = tr(m) I - m for symmetric m = R'F at the centre: what the change of the rotation adds
 * to the force when a rotation w of R changes the energy by t.w */
PAL_INLINE void rotation_stress(const pal_wide r[9], const pal_wide m[9], const pal_wide t[3],
                                const pal_wide inverse[9], pal_wide s[9])
{
    const pal_wide zero = {0};
    pal_wide c[6], sum, y[3], det = pal_wide_spin_cofactors(m, c, &sum);
    /* omitted where the rotation is nearly undefined */
    pal_wide_mask good = (m[4] + m[8] > 0) & (c[5] > 0) & (det > 1e-9 * sum * sum * sum);
    pal_wide_spin_solve(c, pal_wide_select(good, 1 + zero, zero) / pal_wide_select(good, det, 1 + zero), t, y);
    pal_wide_spin_stress(r, y, inverse, s);
}

/* stress at every Gauss point with the rotation r of the centre, m = r'F there on entry */
PAL_INLINE pal_wide rotated_stress(const pal_elastic_tets *t, int n_corner, bool linear, pal_element_run what, int lane,
                                   const pal_wide inverse[9], pal_wide mu, pal_wide lambda, const pal_wide r[9],
                                   const pal_wide centre[9], pal_wide inner[4][9], pal_block_view *at)
{
    const pal_wide zero = {0};
    pal_wide f[9], m[9], s[9], sum = zero, rotation[3] = {zero, zero, zero};
    int n_point = n_corner == 4 ? 1 : 4;
    for (int g = 0; g < n_point; g++) {
        memcpy(m, centre, sizeof m);
        if (n_point > 1 && linear)
            memcpy(m, inner[g], sizeof m);
        else if (n_point > 1)
            pal_wide_tmul(m, r, inner[g]);
        m[0] -= 1, m[4] -= 1, m[8] -= 1;
        stress(mu, lambda, m, s);
        if (what & PAL_RUN_ENERGY)
            for (int i = 0; i < 9; i++) sum += s[i] * m[i];
        if (!(what & PAL_RUN_FORCE)) continue;
        if (n_point > 1 && !linear) {
            pal_wide_mul(f, m, s);
            rotation[0] += f[7] - f[5], rotation[1] += f[2] - f[6], rotation[2] += f[3] - f[1];
        }
        if (linear)
            memcpy(f, s, sizeof f);
        else
            pal_wide_mul(f, r, s);
        pal_wide_mult(s, f, inverse);
        pal_tet_add_force(t, n_corner, g, at, lane, s);
    }
    if (n_point > 1 && !linear && (what & PAL_RUN_FORCE)) {
        rotation_stress(r, centre, rotation, inverse, s);
        pal_tet_add_force(t, n_corner, PAL_TET_CENTRE, at, lane, s);
    }
    return 0.5 * sum;
}

PAL_INLINE pal_wide corotational_half(pal_elastic_tets *t, int n_corner, bool linear, pal_element_run what, int b,
                                      int lane, pal_block_view *at)
{
    pal_wide f[9], inner[4][9], r[9], m[9], inverse[9], stiff[2];
    pal_tet_constants(t, b, lane, 1, inverse, stiff);
    pal_wide_mask live = stiff[0] > 0;
    pal_wide_mask inverted = take_gradient(t, n_corner, at, lane, inverse, f, inner);
    note_inverted(t, inverted & live);
    if (linear)
        memcpy(m, f, sizeof m);
    else
        pal_wide_take_rotation(t->rotation + (size_t)b * 4 * PAL_LANES + lane, live, f, r, m);
    double share = n_corner == 4 ? 1 : 0.25;
    stiff[0] *= share, stiff[1] *= share;
    return rotated_stress(t, n_corner, linear, what, lane, inverse, stiff[0], stiff[1], r, m, inner, at);
}

PAL_INLINE pal_wide neo_half(pal_elastic_tets *t, int n_corner, pal_element_run what, int b, int lane,
                             pal_block_view *at)
{
    const pal_wide zero = {0};
    pal_wide h[9], f[9], c[9], inverse[9], stiff[2], sum = zero;
    int n_point = n_corner == 4 ? 1 : 4;
    pal_tet_constants(t, b, lane, 1.0 / n_point, inverse, stiff);
    const pal_wide mu = stiff[0], k1 = mu + stiff[1];
    pal_wide_mask live = mu > 0, inverted = ~live & live;
    for (int g = 0; g < n_point; g++) {
        pal_tet_local_gradient(t, n_corner, g, at, lane, h);
        pal_wide_mul(f, h, inverse);
        inverted |= is_bad(pal_wide_det(f));
        /* in a = F - I, so that small strains do not drown in J - 1 (elastic_law.c) */
        f[0] -= 1, f[4] -= 1, f[8] -= 1;
        pal_wide third = pal_wide_cofactors(f, c), trace = f[0] + f[4] + f[8], second = c[0] + c[4] + c[8],
                 j = trace + second + third;
        if (what & PAL_RUN_ENERGY) {
            pal_wide squares = zero;
            for (int i = 0; i < 9; i++) squares += f[i] * f[i];
            sum += 0.5 * mu * squares - mu * (second + third) + 0.5 * k1 * j * j;
        }
        if (!(what & PAL_RUN_FORCE)) continue;
        /* cof F = I + tr a I - a' + cof a; P = mu (F - cof F) + k1 (J - 1) cof F */
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) h[3 * i + k] = c[3 * i + k] - f[3 * k + i];
        for (int i = 0; i < 9; i += 4) h[i] += trace;
        for (int i = 0; i < 9; i++) c[i] = mu * (f[i] - h[i]) + k1 * j * (h[i] + (i % 4 == 0 ? 1.0 : 0.0));
        pal_wide_mult(f, c, inverse);
        pal_tet_add_force(t, n_corner, g, at, lane, f);
    }
    note_inverted(t, inverted & live);
    return sum;
}

PAL_INLINE double all_blocks(pal_elastic_tets *t, int n_corner, pal_elastic_law law, pal_element_run what,
                             const double *x, double *force)
{
    double sum = 0;
    pal_block_view at;
    for (int b = 0; b < t->n_block; b++) {
        pal_tet_open(t, n_corner, b, x, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            pal_wide part = law == PAL_LAW_NEO_HOOKEAN
                                ? neo_half(t, n_corner, what, b, lane, &at)
                                : corotational_half(t, n_corner, law == PAL_LAW_LINEAR, what, b, lane, &at);
            for (int l = 0; l < PAL_WIDE && (what & PAL_RUN_ENERGY); l++) sum += part[l];
        }
        if (what & PAL_RUN_FORCE) pal_tet_close(t, n_corner, b, &at, force);
    }
    return sum;
}

/* the kernels; rotations and the number of inverted elements are taken on the way */
static double run_blocks(pal_elastic_tets *t, pal_element_run what, const double *x, double *force)
{
    t->n_inverted = 0;
#define CASE(n, l)                                                                                                     \
    if (t->options.n_corner == n && t->options.law == l)                                                               \
    return what == PAL_RUN_FORCE    ? all_blocks(t, n, l, PAL_RUN_FORCE, x, force)                                     \
           : what == PAL_RUN_ENERGY ? all_blocks(t, n, l, PAL_RUN_ENERGY, x, force)                                    \
                                    : all_blocks(t, n, l, PAL_RUN_BOTH, x, force)
    CASE(4, PAL_LAW_COROTATIONAL);
    CASE(4, PAL_LAW_LINEAR);
    CASE(4, PAL_LAW_NEO_HOOKEAN);
    CASE(10, PAL_LAW_COROTATIONAL);
    CASE(10, PAL_LAW_LINEAR);
    CASE(10, PAL_LAW_NEO_HOOKEAN);
#undef CASE
    return 0;
}

/* rotations alone */
static void rotate_blocks(pal_elastic_tets *t, const double *x)
{
    pal_block_view at;
    t->n_inverted = 0;
    for (int b = 0; b < t->n_block; b++) {
        int n_corner = t->options.n_corner;
        pal_tet_open(t, n_corner, b, x, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            pal_wide f[9], inner[4][9], r[9], m[9], inverse[9], stiff[2];
            pal_tet_constants(t, b, lane, 1, inverse, stiff);
            pal_wide_mask live = stiff[0] > 0;
            note_inverted(t, take_gradient(t, n_corner, &at, lane, inverse, f, inner) & live);
            if (t->options.law != PAL_LAW_LINEAR)
                pal_wide_take_rotation(t->rotation + (size_t)b * 4 * PAL_LANES + lane, live, f, r, m);
        }
    }
}

/* one element on its own */
void pal_elastic_tets_rotation(const pal_elastic_tets *t, int e, double r[9])
{
    double q[4];
    for (int i = 0; i < 4; i++) q[i] = *pal_lane(t->rotation, 4, t->place[e], i);
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
            for (int c = 0; c < 3; c++) f[3 * r + m] += h[3 * r + c] * *pal_lane(t->inverse, 9, t->place[e], 3 * c + m);
        }
}

static double take(pal_elastic_tets *t, pal_element_run what, const double *d, double *f)
{
    const bool node_order = t->options.n_corner == 4;
    if (node_order) pal_node_order_load(t->node_order, d);
    double sum = run_blocks(t, what, d, f);
    if (node_order && f) pal_node_order_add(t->node_order, f);
    return sum;
}

void pal_elastic_tets_force(pal_elastic_tets *t, const double *d, double *f)
{
    take(t, PAL_RUN_FORCE, d, f);
}

double pal_elastic_tets_energy(pal_elastic_tets *t, const double *d, double *f)
{
    return take(t, f ? PAL_RUN_BOTH : PAL_RUN_ENERGY, d, f);
}

void pal_elastic_tets_count(pal_elastic_tets *t, const double *d)
{
    if (t->options.n_corner == 4) pal_node_order_load(t->node_order, d);
    rotate_blocks(t, d);
}

/* D R' of every element */
static void take_gradients(pal_elastic_tets *t)
{
    for (int b = 0; b < t->n_block; b++)
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            pal_wide q[4], r[9], inverse[9], g[9];
            pal_wide_load_n(t->rotation + (size_t)b * 4 * PAL_LANES + lane, 4, q);
            pal_wide_load_n(t->inverse + (size_t)b * 9 * PAL_LANES + lane, 9, inverse);
            pal_wide_rotation(q, r);
            pal_wide_mult(g, inverse, r);
            pal_wide_store_n(t->tangent + (size_t)b * 9 * PAL_LANES + lane, 9, g);
        }
}

void pal_elastic_tets_linearise(pal_elastic_tets *t, const double *d)
{
    pal_elastic_tets_count(t, d);
    if (t->options.law == PAL_LAW_NEO_HOOKEAN)
        pal_elastic_tets_modes(t, d);
    else
        take_gradients(t);
}

PAL_INLINE void multiply_half(const pal_elastic_tets *t, int n_corner, double k, int b, int lane, pal_block_view *at)
{
    int n_point = n_corner == 4 ? 1 : 4;
    pal_wide h[9], g[9], a[9], s[9], stiff[2];
    pal_wide_load_n(t->tangent + (size_t)b * 9 * PAL_LANES + lane, 9, g);
    pal_wide_load_n(t->stiff + (size_t)b * 2 * PAL_LANES + lane, 2, stiff);
    double share = -k / n_point; /* at->f takes -(-K p) */
    for (int point = 0; point < n_point; point++) {
        pal_tet_local_gradient(t, n_corner, point, at, lane, h);
        pal_wide_mul(a, h, g);
        stress(share * stiff[0], share * stiff[1], a, s);
        pal_wide_mult(a, s, g);
        pal_tet_add_force(t, n_corner, point, at, lane, a);
    }
}

PAL_INLINE void multiply_neo_half(const pal_elastic_tets *t, int n_corner, double k, int b, int lane,
                                  pal_block_view *at)
{
    int n_point = n_corner == 4 ? 1 : 4;
    for (int point = 0; point < n_point; point++) {
        pal_wide h[9], modes[PAL_TET_MODES], a[9], q[9];
        const pal_wide *u = modes, *g = modes + 9, *s = modes + 18, *e = modes + 24, *c = modes + 27;
        pal_wide_load_n(t->tangent + ((size_t)b * (size_t)n_point + (size_t)point) * PAL_TET_MODES * PAL_LANES + lane,
                        PAL_TET_MODES, modes);
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
    pal_block_view at;
    for (int b = 0; b < t->n_block; b++) {
        pal_tet_open(t, n_corner, b, p, &at);
        for (int lane = 0; lane < PAL_LANES; lane += PAL_WIDE) {
            if (neo)
                multiply_neo_half(t, n_corner, k, b, lane, &at);
            else
                multiply_half(t, n_corner, k, b, lane, &at);
        }
        pal_tet_close(t, n_corner, b, &at, out);
    }
}

void pal_elastic_tets_multiply(const pal_elastic_tets *t, double k, const double *p, double *out)
{
    const bool neo = t->options.law == PAL_LAW_NEO_HOOKEAN, four = t->options.n_corner == 4;
    if (four) pal_node_order_load(t->node_order, p);
    if (four && neo)
        multiply_blocks(t, 4, true, k, p, out);
    else if (four)
        multiply_blocks(t, 4, false, k, p, out);
    else if (neo)
        multiply_blocks(t, 10, true, k, p, out);
    else
        multiply_blocks(t, 10, false, k, p, out);
    if (four) pal_node_order_add(t->node_order, out);
}
