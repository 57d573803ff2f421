/* Inline 3-vectors, 3x3 matrices (row-major double[9]) and quaternions (w x y z) on plain arrays. Outputs come first
 * and may alias inputs unless said otherwise. Thread: any. */
#ifndef PAL_BASE_VEC3_H
#define PAL_BASE_VEC3_H
#include <math.h>
#include <stdbool.h>

static inline void pal_set3(double r[3], double x, double y, double z)
{
    r[0] = x, r[1] = y, r[2] = z;
}
static inline void pal_copy3(double r[3], const double a[3])
{
    r[0] = a[0], r[1] = a[1], r[2] = a[2];
}
static inline void pal_add3(double r[3], const double a[3], const double b[3])
{
    r[0] = a[0] + b[0], r[1] = a[1] + b[1], r[2] = a[2] + b[2];
}
static inline void pal_sub3(double r[3], const double a[3], const double b[3])
{
    r[0] = a[0] - b[0], r[1] = a[1] - b[1], r[2] = a[2] - b[2];
}
static inline void pal_scale3(double r[3], double s, const double a[3])
{
    r[0] = s * a[0], r[1] = s * a[1], r[2] = s * a[2];
}
static inline void pal_axpy3(double r[3], double s, const double a[3]) /* r += s a */
{
    r[0] += s * a[0], r[1] += s * a[1], r[2] += s * a[2];
}
static inline double pal_dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline void pal_cross3(double r[3], const double a[3], const double b[3])
{
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    r[0] = x, r[1] = y, r[2] = z;
}
static inline double pal_norm3(const double a[3])
{
    return sqrt(pal_dot3(a, a));
}
static inline double pal_dist3(const double a[3], const double b[3])
{
    double d[3];
    pal_sub3(d, a, b);
    return pal_norm3(d);
}
/* the largest length of vectors a [n][3], and the largest distance of points a and b [n][3]; 0 of none */
static inline double pal_max_norm3(const double *a, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, pal_norm3(a + 3 * (long)i));
    return max;
}
static inline double pal_max_dist3(const double *a, const double *b, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, pal_dist3(a + 3 * (long)i, b + 3 * (long)i));
    return max;
}
/* r = (b - a) x (c - a), twice the vector area of the triangle a b c */
static inline void pal_normal3(double r[3], const double a[3], const double b[3], const double c[3])
{
    double u[3], v[3];
    pal_sub3(u, b, a);
    pal_sub3(v, c, a);
    pal_cross3(r, u, v);
}
/* the box of no point, and the smallest box around it and x; a NaN changes nothing */
static inline void pal_box3_empty(double low[3], double high[3])
{
    for (int k = 0; k < 3; k++) low[k] = INFINITY, high[k] = -INFINITY;
}
static inline void pal_box3_add(double low[3], double high[3], const double x[3])
{
    for (int k = 0; k < 3; k++) {
        if (x[k] < low[k]) low[k] = x[k];
        if (x[k] > high[k]) high[k] = x[k];
    }
}
/* a / |a|; false and r untouched when |a| <= min or not finite */
static inline bool pal_unit3(double r[3], const double a[3], double min)
{
    double n = pal_norm3(a);
    if (!(n > min) || !isfinite(n)) return false;
    pal_scale3(r, 1 / n, a);
    return true;
}
static inline bool pal_finite3(const double a[3])
{
    return isfinite(a[0]) && isfinite(a[1]) && isfinite(a[2]);
}
static inline void pal_mul33(double r[3], const double m[9], const double a[3]) /* r = m a */
{
    double x = m[0] * a[0] + m[1] * a[1] + m[2] * a[2], y = m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
           z = m[6] * a[0] + m[7] * a[1] + m[8] * a[2];
    r[0] = x, r[1] = y, r[2] = z;
}
static inline void pal_tmul33(double r[3], const double m[9], const double a[3]) /* r = m' a */
{
    double x = m[0] * a[0] + m[3] * a[1] + m[6] * a[2], y = m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
           z = m[2] * a[0] + m[5] * a[1] + m[8] * a[2];
    r[0] = x, r[1] = y, r[2] = z;
}
/* r = m^-1, not in place; returns the determinant. r has numbers that are not finite where m has no inverse */
static inline double pal_inverse33(double r[9], const double m[9])
{
    double column[3][3];
    for (int k = 0; k < 3; k++) pal_cross3(column[k], m + 3 * ((k + 1) % 3), m + 3 * ((k + 2) % 3));
    const double det = pal_dot3(m, column[0]);
    for (int k = 0; k < 9; k++) r[k] = column[k % 3][k / 3] / det;
    return det;
}
static inline void pal_quat_rotate(double r[3], const double q[4], const double a[3]) /* q unit */
{
    double t[3], u[3] = {q[1], q[2], q[3]};
    pal_cross3(t, u, a);
    pal_scale3(t, 2, t);
    double v[3];
    pal_cross3(v, u, t);
    for (int i = 0; i < 3; i++) r[i] = a[i] + q[0] * t[i] + v[i];
}
#endif
