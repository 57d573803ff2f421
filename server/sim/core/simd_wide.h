/* Vectors for the kernels of elastic elements: as many doubles as the processor has side by side (8 or 4), so that a
 * block of PAL_LANES elements takes one or two of them; and the rotations of that many elements at once. Every
 * operation is lane by lane, so the width does not change a bit of the result. As simd.h: only for files compiled with
 * the room's options. Thread: [sim]. */
#ifndef PAL_SIM_CORE_SIMD_WIDE_H
#define PAL_SIM_CORE_SIMD_WIDE_H
#include "server/sim/core/simd.h"

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

/* rotation of a quaternion that is nearly of length one */
PAL_INLINE void pal_wide_rotation(const pal_wide q[4], pal_wide r[9])
{
    pal_wide s = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    pal_wide x = s * q[1], y = s * q[2], z = s * q[3];
    pal_wide wx = q[0] * x, wy = q[0] * y, wz = q[0] * z, xx = q[1] * x, xy = q[1] * y, xz = q[1] * z;
    pal_wide yy = q[2] * y, yz = q[2] * z, zz_estimator = q[3] * z;
    r[0] = 1 - (yy + zz_estimator), r[1] = xy - wz, r[2] = xz + wy;
    r[3] = xy + wz, r[4] = 1 - (xx + zz_estimator), r[5] = yz - wx;
    r[6] = xz - wy, r[7] = yz + wx, r[8] = 1 - (xx + yy);
}

/* One Newton turn of R : F (num/polar.c): q <- q exp(w), w = A^-1 g, g the axial vector of m = R'F, A = tr(m) I -
 * sym(m). settled: the turn was below 1e-5 rad, so that what is left is below 1e-10 times the strain. stuck: A is not
 * clearly positive definite and q stays */
PAL_INLINE void pal_wide_rotation_step(const pal_wide m[9], pal_wide q[4], pal_wide_mask *settled, pal_wide_mask *stuck)
{
    const pal_wide zero = {0};
    pal_wide gx = m[7] - m[5], gy = m[2] - m[6], gz = m[3] - m[1];
    pal_wide axx = m[4] + m[8], ayy = m[0] + m[8], azz = m[0] + m[4];
    pal_wide axy = -0.5 * (m[1] + m[3]), axz = -0.5 * (m[2] + m[6]), ayz = -0.5 * (m[5] + m[7]);
    pal_wide cxx = ayy * azz - ayz * ayz, cxy = axz * ayz - axy * azz, cxz = axy * ayz - axz * ayy;
    pal_wide cyy = axx * azz - axz * axz, cyz = axy * axz - axx * ayz, czz = axx * ayy - axy * axy;
    pal_wide det = axx * cxx + axy * cxy + axz * cxz, sum = axx + ayy + azz;
    pal_wide_mask good = (axx > 0) & (czz > 0) & (sum > 0) & (det > 1e-4 * sum * sum * sum);
    pal_wide half = 0.5 / pal_wide_select(good, det, 1 + zero);
    pal_wide x = half * (cxx * gx + cxy * gy + cxz * gz), y = half * (cxy * gx + cyy * gy + cyz * gz),
             z = half * (cxz * gx + cyz * gy + czz * gz);
    pal_wide w2 = x * x + y * y + z * z;
    good = good & (w2 < 1);
    x = pal_wide_select(good, x, zero), y = pal_wide_select(good, y, zero), z = pal_wide_select(good, z, zero);
    pal_wide a = q[0] - (q[1] * x + q[2] * y + q[3] * z), b = q[1] + q[0] * x + (q[2] * z - q[3] * y),
             c = q[2] + q[0] * y + (q[3] * x - q[1] * z), d = q[3] + q[0] * z + (q[1] * y - q[2] * x);
    pal_wide keep = 1.5 - 0.5 * (a * a + b * b + c * c + d * d); /* towards length one */
    q[0] = keep * a, q[1] = keep * b, q[2] = keep * c, q[3] = keep * d;
    *settled = good & (w2 < 2.5e-11);
    *stuck = ~good;
}

/* Rotations of as many elements as are live (mask), from q (in and out): r, and m = r'f. Returns the lanes, as bits,
 * that pal_polar_rotation has to settle (then r and m are to be taken again); `most` turns at most */
PAL_INLINE unsigned pal_wide_polar(const pal_wide f[9], pal_wide_mask live, int max, pal_wide q[4], pal_wide r[9],
                                   pal_wide m[9])
{
    pal_wide_mask settled = ~live, stuck = ~live;
    bool done = false;
    for (int k = 0;; k++) {
        pal_wide_rotation(q, r);
        pal_wide_tmul(m, r, f);
        if (done || k == max) break;
        pal_wide_rotation_step(m, q, &settled, &stuck);
        settled = settled | ~live;
        done = pal_wide_all(settled | stuck);
    }
    unsigned left = 0;
    for (int l = 0; l < PAL_WIDE; l++) left |= settled[l] ? 0u : 1u << l;
    return left;
}
#endif
