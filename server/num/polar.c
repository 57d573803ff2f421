/* Rotations of 3x3 matrices: polar rotation, singular values, eigenvalues.
 *
 * pal_polar_rotation follows Mueller et al. 2016 (A robust method to extract the rotational part of deformations):
 * rotate R by R <- R exp(w) so that R : F grows, warm started. Departure: Mueller's w = g / |tr S|, g the axial vector
 * of the skew part of S = R' F, converges linearly at a third per iteration near a rotation. Here w = A^-1 g with A =
 * tr(S) I - sym(S), the Newton step of R : F (as in Kugelstadt et al. 2018), whose error is squared by each step. Where
 * A is not clearly positive definite (more than a quarter rotation off, saddles half a rotation off, det F <= 0 near a
 * flat state) the answer is taken from the singular values: R = U V'; where it is not unique, the rotation that is free
 * is taken nearest to q.
 *
 * pal_svd3 is one-sided Jacobi (Hestenes 1958), which keeps small singular values exact. */
#include "server/num/polar.h"

#include "server/base/vec3.h"

#include <float.h>

double pal_det3(const double f[9])
{
    return f[0] * (f[4] * f[8] - f[5] * f[7]) - f[1] * (f[3] * f[8] - f[5] * f[6]) + f[2] * (f[3] * f[7] - f[4] * f[6]);
}

void pal_quat_matrix(const double q[4], double r[9])
{
    double w = q[0], x = q[1], y = q[2], z = q[3];
    r[0] = 1 - 2 * (y * y + z * z), r[1] = 2 * (x * y - w * z), r[2] = 2 * (x * z + w * y);
    r[3] = 2 * (x * y + w * z), r[4] = 1 - 2 * (x * x + z * z), r[5] = 2 * (y * z - w * x);
    r[6] = 2 * (x * z - w * y), r[7] = 2 * (y * z + w * x), r[8] = 1 - 2 * (x * x + y * y);
}

void pal_matrix_quat(const double r[9], double q[4])
{
    /* the largest component first (Shepperd 1978) */
    double t[4] = {r[0] + r[4] + r[8], r[0] - r[4] - r[8], r[4] - r[0] - r[8], r[8] - r[0] - r[4]};
    int k = 0;
    for (int i = 1; i < 4; i++)
        if (t[i] > t[k]) k = i;
    const double rows[4][4] = {{1 + t[0], r[7] - r[5], r[2] - r[6], r[3] - r[1]},
                               {r[7] - r[5], 1 + t[1], r[1] + r[3], r[2] + r[6]},
                               {r[2] - r[6], r[1] + r[3], 1 + t[2], r[5] + r[7]},
                               {r[3] - r[1], r[2] + r[6], r[5] + r[7], 1 + t[3]}},
                 *d = rows[k];
    double n = 1 / sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]);
    for (int i = 0; i < 4; i++) q[i] = n * d[i];
}

/* Rotates columns i and j (kept as rows) so that they are orthogonal, and those of v with them. True where the angle
 * was so small that its effect elsewhere is below rounding: a sweep of such rotations is the last one */
static inline bool make_orthogonal(double *restrict bi, double *restrict bj, double *restrict vi, double *restrict vj)
{
    double a = pal_dot3(bi, bi), b = pal_dot3(bj, bj), g = pal_dot3(bi, bj);
    double d = b - a, h = 2 * g, ab = a * b;
    if (g * g <= 1e-32 * ab) return true;
    /* (c, s) along (w, h): half the angle of (d, h), the small half */
    double w = fabs(d) + sqrt(d * d + h * h), square = w * w + h * h;
    if (!(square > 1e-290)) return true;
    double n = 1 / sqrt(square), c = w * n, s = d >= 0 ? h * n : -h * n;
    for (int k = 0; k < 3; k++) {
        double p = bi[k], q = bj[k], m = vi[k], o = vj[k];
        bi[k] = c * p - s * q, bj[k] = s * p + c * q;
        vi[k] = c * m - s * o, vj[k] = s * m + c * o;
    }
    return g * g <= 1e-18 * ab && fabs(h) <= 1e-7 * w;
}

/* exchanges rows i and j of both and keeps the orientation of v */
static void exchange(double b[3][3], double v[3][3], int i, int j)
{
    for (int k = 0; k < 3; k++) {
        double t = b[i][k];
        b[i][k] = b[j][k], b[j][k] = -t;
        t = v[i][k];
        v[i][k] = v[j][k], v[j][k] = -t;
    }
}

/* a unit vector at right angles to unit u */
static void any_normal(const double u[3], double r[3])
{
    int k = fabs(u[0]) < fabs(u[1]) ? 0 : 1;
    if (fabs(u[2]) < fabs(u[k])) k = 2;
    double e[3] = {k == 0, k == 1, k == 2};
    pal_cross3(r, u, e);
    pal_scale3(r, 1 / pal_norm3(r), r);
}

/* the largest |entry|; *sum is 0, or no number where an entry is not finite */
static double largest(const double f[9], double *sum)
{
    double max = 0;
    *sum = 0;
    for (int i = 0; i < 9; i++) max = fmax(max, fabs(f[i])), *sum += 0 * f[i];
    return max;
}

void pal_svd3(const double f[9], double u[9], double s[3], double v[9])
{
    double b[3][3], w[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, r[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double sum, max = largest(f, &sum);
    if (!(max > 0) || sum != 0) { /* zero or not finite */
        for (int i = 0; i < 9; i++) u[i] = v[i] = i % 4 == 0;
        for (int i = 0; i < 3; i++) s[i] = sum;
        return;
    }
    /* scaled only where squares would leave the range, in two halves (1e308 fits in neither) and exactly */
    int e = 0;
    double up = 1, up2 = 1;
    if (!(max > 1e-70 && max < 1e70)) {
        (void)frexp(max, &e);
        up = ldexp(1, -e / 2), up2 = ldexp(1, -e - -e / 2);
    }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) b[i][k] = f[3 * k + i] * up * up2;
    for (int sweep = 0; sweep < 12; sweep++) {
        bool small = make_orthogonal(b[0], b[1], w[0], w[1]);
        small &= make_orthogonal(b[0], b[2], w[0], w[2]);
        small &= make_orthogonal(b[1], b[2], w[1], w[2]);
        if (small) break;
    }
    double n[3] = {pal_dot3(b[0], b[0]), pal_dot3(b[1], b[1]), pal_dot3(b[2], b[2])}, t;
    if (n[0] < n[1]) exchange(b, w, 0, 1), t = n[0], n[0] = n[1], n[1] = t;
    if (n[0] < n[2]) exchange(b, w, 0, 2), t = n[0], n[0] = n[2], n[2] = t;
    if (n[1] < n[2]) exchange(b, w, 1, 2), t = n[1], n[1] = n[2], n[2] = t;
    s[0] = sqrt(n[0]);
    pal_scale3(r[0], 1 / s[0], b[0]);
    s[1] = sqrt(n[1]);
    pal_axpy3(b[1], -pal_dot3(r[0], b[1]), r[0]);
    double left = pal_norm3(b[1]);
    if (left > 1e-150)
        pal_scale3(r[1], 1 / left, b[1]);
    else
        any_normal(r[0], r[1]);
    pal_cross3(r[2], r[0], r[1]);
    s[2] = pal_dot3(r[2], b[2]);
    if (fabs(s[2]) > s[1]) s[2] = copysign(s[1], s[2]); /* by rounding */
    if (e != 0) {
        up = ldexp(1, e / 2), up2 = ldexp(1, e - e / 2);
        for (int i = 0; i < 3; i++) s[i] = s[i] * up * up2;
    }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) u[3 * k + i] = r[i][k], v[3 * k + i] = w[i][k];
}

/* One Jacobi rotation of the symmetric a, entries about 1, in the plane p, q; rows p, q of v follow. True as above */
static inline bool jacobi_rotation(double a[3][3], double v[3][3], int p, int q)
{
    double g = a[p][q], d = a[q][q] - a[p][p], h = 2 * g;
    if (!(fabs(g) > 1e-17)) return true;
    double w = fabs(d) + sqrt(d * d + h * h), n = 1 / sqrt(w * w + h * h);
    double c = w * n, s = d >= 0 ? h * n : -h * n, up = d >= 0 ? g * h / w : -g * h / w;
    int r = 3 - p - q;
    double x = a[p][r], y = a[q][r];
    a[p][p] -= up, a[q][q] += up;
    a[p][q] = a[q][p] = 0;
    a[p][r] = a[r][p] = c * x - s * y;
    a[q][r] = a[r][q] = s * x + c * y;
    for (int k = 0; k < 3; k++) {
        double m = v[p][k], o = v[q][k];
        v[p][k] = c * m - s * o, v[q][k] = s * m + c * o;
    }
    return fabs(g) <= 1e-9 && fabs(h) <= 1e-7 * w;
}

void pal_eigen3(const double f[9], double w[3], double v[9])
{
    double a[3][3], b[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double sum, max = largest(f, &sum);
    if (!(max > 0) || sum != 0) {
        for (int i = 0; i < 9; i++) v[i] = i % 4 == 0;
        for (int i = 0; i < 3; i++) w[i] = sum;
        return;
    }
    double up = max > 1e-300 ? 1 / max : 1e300;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) a[i][j] = up * 0.5 * (f[3 * i + j] + f[3 * j + i]);
    for (int sweep = 0; sweep < 12; sweep++) {
        bool small = jacobi_rotation(a, b, 0, 1);
        small &= jacobi_rotation(a, b, 0, 2);
        small &= jacobi_rotation(a, b, 1, 2);
        if (small) break;
    }
    int at[3] = {0, 1, 2};
    bool odd = false;
    for (int i = 0; i < 2; i++)
        for (int j = i + 1; j < 3; j++)
            if (a[at[i]][at[i]] > a[at[j]][at[j]]) {
                int t = at[i];
                at[i] = at[j], at[j] = t;
                odd = !odd;
            }
    for (int i = 0; i < 3; i++) {
        w[i] = a[at[i]][at[i]] / up;
        double sign = i == 2 && odd ? -1 : 1;
        for (int k = 0; k < 3; k++) v[3 * i + k] = sign * b[at[i]][k];
    }
}

/* the rotation that maximises R : F, from the singular values; the nearest to q where many do */
static void rotation_by_svd(const double f[9], double q[4])
{
    double u[9], s[3], v[9], old[9], m[9], r[9], t[9];
    pal_svd3(f, u, s, v);
    double c = 1, z = 0;
    if (s[1] + s[2] <= 1e-12 * s[0]) {
        /* any rotation about the first axis is optimal: M = U' R V, nearest to R */
        pal_quat_matrix(q, old);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                t[3 * i + j] = old[3 * i] * v[j] + old[3 * i + 1] * v[3 + j] + old[3 * i + 2] * v[6 + j];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) m[3 * i + j] = u[i] * t[j] + u[3 + i] * t[3 + j] + u[6 + i] * t[6 + j];
        double x = m[4] + m[8], y = m[7] - m[5], n = sqrt(x * x + y * y);
        if (n > 1e-12) c = x / n, z = y / n;
    }
    for (int i = 0; i < 3; i++) { /* t = U rotation, rotation = (1, (c -z), (z c)) */
        t[3 * i] = u[3 * i];
        t[3 * i + 1] = c * u[3 * i + 1] + z * u[3 * i + 2];
        t[3 * i + 2] = c * u[3 * i + 2] - z * u[3 * i + 1];
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) r[3 * i + j] = pal_dot3(t + 3 * i, v + 3 * j);
    double p[4];
    pal_matrix_quat(r, p);
    double sign = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0 ? -1 : 1;
    for (int i = 0; i < 4; i++) q[i] = sign * p[i];
}

/* w = A^-1 g, A = tr(S) I - sym(S); false where A is not clearly positive definite. |F| is about 1 */
static bool newton_step(const double f[9], const double q[4], double w[3])
{
    const double min = 0.02;
    double r[9], s[9];
    pal_quat_matrix(q, r);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) s[3 * i + j] = r[i] * f[j] + r[3 + i] * f[3 + j] + r[6 + i] * f[6 + j];
    double g[3] = {s[7] - s[5], s[2] - s[6], s[3] - s[1]};
    double a00 = s[4] + s[8], a11 = s[0] + s[8], a22 = s[0] + s[4];
    double a10 = -0.5 * (s[1] + s[3]), a20 = -0.5 * (s[2] + s[6]), a21 = -0.5 * (s[5] + s[7]);
    /* cofactors; by the signs of the leading minors (Sylvester) */
    double c00 = a11 * a22 - a21 * a21, c10 = a21 * a20 - a10 * a22, c20 = a10 * a21 - a11 * a20;
    double det = a00 * c00 + a10 * c10 + a20 * c20, minor = a00 * a11 - a10 * a10;
    if (!(a00 > min && minor > min * a00 && det > min * minor)) return false;
    double c11 = a00 * a22 - a20 * a20, c21 = a10 * a20 - a00 * a21, d = 1 / det;
    w[0] = d * (c00 * g[0] + c10 * g[1] + c20 * g[2]);
    w[1] = d * (c10 * g[0] + c11 * g[1] + c21 * g[2]);
    w[2] = d * (c20 * g[0] + c21 * g[1] + minor * g[2]);
    return true;
}

/* q <- q * the rotation by w in the body's own axes (Cayley: 2 atan |w|/2, so never beyond 180 degrees) */
static void rotate(double q[4], const double w[3])
{
    double x = 0.5 * w[0], y = 0.5 * w[1], z = 0.5 * w[2];
    double p[4] = {q[0] - q[1] * x - q[2] * y - q[3] * z, q[1] + q[0] * x + q[2] * z - q[3] * y,
                   q[2] + q[0] * y + q[3] * x - q[1] * z, q[3] + q[0] * z + q[1] * y - q[2] * x};
    double n = 1 / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
    for (int i = 0; i < 4; i++) q[i] = n * p[i];
}

int pal_polar_rotation(const double f[9], double q[4], int max)
{
    enum { MAX_NEWTON = 10 };
    double h[9], w[3], square = 0;
    for (int i = 0; i < 9; i++) square += f[i] * f[i];
    double scale = 1 / sqrt(square);
    if (!(square > 1e-280 && square < 1e280)) {
        double sum, top = largest(f, &sum);
        if (!(top >= DBL_MIN) || sum != 0) return 0;
        scale = 1 / top;
    }
    for (int i = 0; i < 9; i++) h[i] = scale * f[i];
    for (int n = 1; n <= max; n++) {
        if (n > MAX_NEWTON || !newton_step(h, q, w)) {
            rotation_by_svd(h, q);
            return n;
        }
        rotate(q, w);
        /* the next step would be about the square of this one */
        if (pal_dot3(w, w) < 1e-12) return n;
    }
    return max;
}
