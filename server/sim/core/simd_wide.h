/* Vectors for the kernels of elastic elements: as many doubles as the processor has side by side (8 or 4), so that a
 * block of PAL_LANES elements takes one or two of them; and the rotations of that many elements at once. Every
 * operation is lane by lane, so the width does not change a bit of the result. As simd.h: only for files compiled with
 * the room's options. Thread: [sim]. */
#ifndef PAL_SIM_CORE_SIMD_WIDE_H
#define PAL_SIM_CORE_SIMD_WIDE_H
#include "server/num/polar.h"
#include "server/sim/core/simd.h"

#include <math.h>

#ifdef __AVX512F__
enum { PAL_WIDE = 8 };
typedef double pal_wide __attribute__((vector_size(64)));
typedef int64_t pal_wide_mask __attribute__((vector_size(64)));
typedef double pal_wide_memory __attribute__((vector_size(64), aligned(8), may_alias));
#else
enum { PAL_WIDE = 4 };
typedef double pal_wide __attribute__((vector_size(32)));
typedef int64_t pal_wide_mask __attribute__((vector_size(32)));
typedef double pal_wide_memory __attribute__((vector_size(32), aligned(8), may_alias));
#endif

PAL_INLINE pal_wide pal_wide_load(const double *at)
{
    return *(const pal_wide_memory *)at;
}
PAL_INLINE void pal_wide_store(double *at, pal_wide a)
{
    *(pal_wide_memory *)at = a;
}
/* n numbers of the same elements, PAL_LANES apart in memory */
PAL_INLINE void pal_wide_load_n(const double *at, int n, pal_wide *to)
{
    for (int i = 0; i < n; i++) to[i] = pal_wide_load(at + (size_t)i * PAL_LANES);
}
PAL_INLINE void pal_wide_store_n(double *at, int n, const pal_wide *from)
{
    for (int i = 0; i < n; i++) pal_wide_store(at + (size_t)i * PAL_LANES, from[i]);
}
PAL_INLINE void pal_wide_add(double *at, pal_wide a)
{
    *(pal_wide_memory *)at += a;
}
PAL_INLINE pal_wide pal_wide_select(pal_wide_mask mask, pal_wide a, pal_wide b)
{
    return (pal_wide)((mask & (pal_wide_mask)a) | (~mask & (pal_wide_mask)b));
}
PAL_INLINE bool pal_wide_all(pal_wide_mask mask)
{
    int64_t all = mask[0];
    for (int l = 1; l < PAL_WIDE; l++) all &= mask[l];
    return all != 0;
}
PAL_INLINE bool pal_wide_any(pal_wide_mask mask)
{
    return !pal_wide_all(~mask);
}
PAL_INLINE pal_wide pal_wide_of(double a)
{
    return a - (pal_wide){0};
}
PAL_INLINE pal_wide pal_wide_sqrt(pal_wide q)
{
    for (int l = 0; l < PAL_WIDE; l++) q[l] = sqrt(q[l]);
    return q;
}
/* as pal_inverse_sqrt8 */
PAL_INLINE pal_wide pal_wide_inverse_sqrt(pal_wide q)
{
    pal_wide half = 0.5 * q, r = (pal_wide)(0x5fe6eb50c7b537a9 - ((pal_wide_mask)q >> 1));
    for (int k = 0; k < 4; k++) r = r * (1.5 - half * r * r);
    return r;
}
/* lengths of a and of the cross product a x b, to a few units of the last place */
PAL_INLINE pal_wide pal_wide_length(const pal_wide a[3])
{
    const pal_wide floor = pal_wide_of(1e-300), q = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
    return q * pal_wide_inverse_sqrt(pal_wide_select(q < floor, floor, q));
}
PAL_INLINE pal_wide pal_wide_cross_length(const pal_wide a[3], const pal_wide b[3])
{
    const pal_wide n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return pal_wide_length(n);
}
/* r = a b, r = a' b, r = a b'; r apart from a and b */
PAL_INLINE void pal_wide_mul(pal_wide r[9], const pal_wide a[9], const pal_wide b[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) r[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}
PAL_INLINE void pal_wide_tmul(pal_wide r[9], const pal_wide a[9], const pal_wide b[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) r[3 * i + j] = a[i] * b[j] + a[3 + i] * b[3 + j] + a[6 + i] * b[6 + j];
}
PAL_INLINE void pal_wide_mult(pal_wide r[9], const pal_wide a[9], const pal_wide b[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[3 * i + j] = a[3 * i] * b[3 * j] + a[3 * i + 1] * b[3 * j + 1] + a[3 * i + 2] * b[3 * j + 2];
}
PAL_INLINE pal_wide pal_wide_det(const pal_wide f[9])
{
    return f[0] * (f[4] * f[8] - f[5] * f[7]) - f[1] * (f[3] * f[8] - f[5] * f[6]) + f[2] * (f[3] * f[7] - f[4] * f[6]);
}

/* cofactors c = dJ/dF; returns J = det F */
PAL_INLINE pal_wide pal_wide_cofactors(const pal_wide f[9], pal_wide c[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int a = 3 * ((i + 1) % 3), b = 3 * ((i + 2) % 3), p = (j + 1) % 3, q = (j + 2) % 3;
            c[3 * i + j] = f[a + p] * f[b + q] - f[a + q] * f[b + p];
        }
    return f[0] * c[0] + f[1] * c[1] + f[2] * c[2];
}
/* u = r y (transposed: u = r' y) for columns first to n - 1 of y and u [3][stride]; u may be y */
PAL_INLINE void pal_wide_rotate(const pal_wide r[9], bool transposed, int first, int n, int stride, const pal_wide *y,
                                pal_wide *u)
{
    const int row = transposed ? 1 : 3, column = transposed ? 3 : 1;
    for (int m = first; m < n; m++) {
        const pal_wide a = y[m], b = y[stride + m], c = y[2 * stride + m];
        for (int i = 0; i < 3; i++)
            u[i * stride + m] = r[row * i] * a + r[row * i + column] * b + r[row * i + 2 * column] * c;
    }
}

/* rotation of a quaternion that is nearly of length one */
PAL_INLINE void pal_wide_rotation(const pal_wide q[4], pal_wide r[9])
{
    const pal_wide s = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    pal_wide x = s * q[1], y = s * q[2], z = s * q[3];
    pal_wide wx = q[0] * x, wy = q[0] * y, wz = q[0] * z, qxx = q[1] * x, xy = q[1] * y, xz = q[1] * z;
    pal_wide qyy = q[2] * y, yz = q[2] * z, qzz = q[3] * z;
    r[0] = 1 - (qyy + qzz), r[1] = xy - wz, r[2] = xz + wy;
    r[3] = xy + wz, r[4] = 1 - (qxx + qzz), r[5] = yz - wx;
    r[6] = xz - wy, r[7] = yz + wx, r[8] = 1 - (qxx + qyy);
}

/* A = tr(m) I - sym(m), which relates a small rotation to its moment: cofactors c (xx xy xz yy yz zz) and trace;
 * returns det A */
PAL_INLINE pal_wide pal_wide_spin_cofactors(const pal_wide m[9], pal_wide c[6], pal_wide *trace)
{
    pal_wide axx = m[4] + m[8], ayy = m[0] + m[8], azz = m[0] + m[4];
    pal_wide axy = -0.5 * (m[1] + m[3]), axz = -0.5 * (m[2] + m[6]), ayz = -0.5 * (m[5] + m[7]);
    c[0] = ayy * azz - ayz * ayz, c[1] = axz * ayz - axy * azz, c[2] = axy * ayz - axz * ayy;
    c[3] = axx * azz - axz * axz, c[4] = axy * axz - axx * ayz, c[5] = axx * ayy - axy * axy;
    *trace = axx + ayy + azz;
    return axx * c[0] + axy * c[1] + axz * c[2];
}
/* w = s C t with those cofactors; s = 1 / det A gives A^-1 t */
PAL_INLINE void pal_wide_spin_solve(const pal_wide c[6], pal_wide s, const pal_wide t[3], pal_wide w[3])
{
    w[0] = s * (c[0] * t[0] + c[1] * t[1] + c[2] * t[2]);
    w[1] = s * (c[1] * t[0] + c[3] * t[1] + c[4] * t[2]);
    w[2] = s * (c[2] * t[0] + c[4] * t[1] + c[5] * t[2]);
}
/* s = r [w] d': stress of a rotation w of r */
PAL_INLINE void pal_wide_spin_stress(const pal_wide r[9], const pal_wide w[3], const pal_wide d[9], pal_wide s[9])
{
    pal_wide p[9];
    for (int i = 0; i < 9; i++) {
        const int row = i - i % 3, j = (i + 1) % 3, k = (i + 2) % 3;
        p[i] = r[row + j] * w[k] - r[row + k] * w[j];
    }
    pal_wide_mult(s, p, d);
}

/* One Newton step of R : F (num/polar.c): q <- q (1, w), w = A^-1 g / 2, g the axial vector of m = R'F, which converges
 * cubically. settled: |w| was below 3e-5, so that 2e-13 rad are left (measured). stuck: A is not clearly positive
 * definite and q stays */
PAL_INLINE void pal_wide_rotation_step(const pal_wide m[9], pal_wide q[4], pal_wide_mask *settled, pal_wide_mask *stuck)
{
    const pal_wide zero = {0}, g[3] = {m[7] - m[5], m[2] - m[6], m[3] - m[1]};
    pal_wide c[6], sum, w[3], det = pal_wide_spin_cofactors(m, c, &sum);
    pal_wide_mask good = (m[4] + m[8] > 0) & (c[5] > 0) & (sum > 0) & (det > 1e-4 * sum * sum * sum);
    pal_wide_spin_solve(c, 0.5 / pal_wide_select(good, det, 1 + zero), g, w);
    pal_wide w2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
    good = good & (w2 < 1);
    for (int i = 0; i < 3; i++) w[i] = pal_wide_select(good, w[i], zero);
    pal_wide a = q[0] - (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]), b = q[1] + q[0] * w[0] + (q[2] * w[2] - q[3] * w[1]),
             d = q[2] + q[0] * w[1] + (q[3] * w[0] - q[1] * w[2]), e = q[3] + q[0] * w[2] + (q[1] * w[1] - q[2] * w[0]);
    pal_wide keep = 1.5 - 0.5 * (a * a + b * b + d * d + e * e); /* towards length one */
    q[0] = keep * a, q[1] = keep * b, q[2] = keep * d, q[3] = keep * e;
    *settled = good & (w2 < 1e-9);
    *stuck = ~good;
}

/* Newton steps of a rotation before pal_polar_rotation, and steps of that */
enum { PAL_WIDE_TURNS = 8, PAL_POLAR_STEPS_MAX = 200 };

/* pal_polar_rotation of the lanes whose bits are set */
static __attribute__((noinline, unused)) void pal_wide_settle(const pal_wide f[9], unsigned left, pal_wide q[4])
{
    for (int l = 0; l < PAL_WIDE; l++) {
        if (!(left >> l & 1)) continue;
        double g[9], p[4];
        for (int i = 0; i < 9; i++) g[i] = f[i][l];
        for (int i = 0; i < 4; i++) p[i] = q[i][l];
        pal_polar_rotation(g, p, PAL_POLAR_STEPS_MAX);
        for (int i = 0; i < 4; i++) q[i][l] = p[i];
    }
}
/* rotations r of as many elements as are live (mask), from q (in and out), and m = r'f */
PAL_INLINE void pal_wide_polar(const pal_wide f[9], pal_wide_mask live, pal_wide q[4], pal_wide r[9], pal_wide m[9])
{
    pal_wide_mask settled = ~live, stuck = ~live;
    bool done = false;
    for (int k = 0;; k++) {
        pal_wide_rotation(q, r);
        pal_wide_tmul(m, r, f);
        if (done || k == PAL_WIDE_TURNS) break;
        pal_wide_rotation_step(m, q, &settled, &stuck);
        settled = settled | ~live;
        done = pal_wide_all(settled | stuck);
    }
    if (pal_wide_all(settled)) return;
    unsigned left = 0;
    for (int l = 0; l < PAL_WIDE; l++) left |= settled[l] ? 0u : 1u << l;
    pal_wide_settle(f, left, q);
    pal_wide_rotation(q, r);
    pal_wide_tmul(m, r, f);
}
/* the same from the quaternions at `rotation` (in and out, PAL_LANES apart) */
PAL_INLINE void pal_wide_take_rotation(double *rotation, pal_wide_mask live, const pal_wide f[9], pal_wide r[9],
                                       pal_wide m[9])
{
    pal_wide q[4];
    pal_wide_load_n(rotation, 4, q);
    pal_wide_polar(f, live, q, r, m);
    pal_wide_store_n(rotation, 4, q);
}

/* one rotation of Jacobi's method on the symmetric a (xx yy zz yz zx xy) in the plane p, q; columns of v turn along */
PAL_INLINE void pal_wide_jacobi_rotate(pal_wide a[6], pal_wide v[9], int p, int q)
{
    const int o = 3 - p - q;
    pal_wide *app = a + p, *aqq = a + q, *apq = a + 3 + o, *apo = a + 3 + q, *aqo = a + 3 + p;
    pal_wide d = *aqq - *app, twice = 2 * *apq, sum = d * d + twice * twice;
    pal_wide_mask turned = sum > 1e-280, down = d < 0;
    pal_wide root = pal_wide_sqrt(sum) + pal_wide_select(down, -d, d);
    pal_wide t = pal_wide_select(down, -twice, twice) / pal_wide_select(turned, root, pal_wide_of(1));
    pal_wide c = 1 / pal_wide_sqrt(1 + t * t), s = t * c;
    *app -= t * *apq, *aqq += t * *apq, *apq = pal_wide_of(0);
    pal_wide x = *apo, y = *aqo;
    *apo = c * x - s * y, *aqo = s * x + c * y;
    for (int i = 0; i < 3; i++) {
        pal_wide b = v[3 * i + p], e = v[3 * i + q];
        v[3 * i + p] = c * b - s * e, v[3 * i + q] = s * b + c * e;
    }
}
/* eigenvalues a[0..2] and eigenvectors, columns of v, of a symmetric matrix; off-diagonals of a sweep below 1e-12 of
 * the diagonal are left */
PAL_INLINE void pal_wide_jacobi(pal_wide a[6], pal_wide v[9])
{
    for (int i = 0; i < 9; i++) v[i] = pal_wide_of(i % 4 == 0);
    for (int sweep = 0; sweep < 6; sweep++) {
        pal_wide off = a[3] * a[3] + a[4] * a[4] + a[5] * a[5], on = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
        if (!pal_wide_any(off > 1e-24 * on)) break;
        pal_wide_jacobi_rotate(a, v, 0, 1), pal_wide_jacobi_rotate(a, v, 0, 2), pal_wide_jacobi_rotate(a, v, 1, 2);
    }
}
#endif
