/* Locally optimal conjugate gradients for an eigenvalue. */
#include "server/num/lowest_mode.h"

#include "server/num/conjugate_gradient.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

enum { WINDOW = 8 }; /* iterations over which the decrease is watched */

/* a direction with its products */
typedef struct triple {
    double *v, *k, *m;
} triple;

static void scale(int n, double s, const triple *a)
{
    for (int i = 0; i < n; i++) a->v[i] *= s, a->k[i] *= s, a->m[i] *= s;
}

static void add(int n, double s, const triple *from, const triple *to)
{
    for (int i = 0; i < n; i++) {
        to->v[i] += s * from->v[i];
        to->k[i] += s * from->k[i];
        to->m[i] += s * from->m[i];
    }
}

/* makes `a` orthonormal to the n_to others in the inner product of M; false: nothing is left of it */
static bool orthonormalise(int n, const triple *a, const triple *to, int n_to)
{
    const double before = pal_dot_product(n, a->v, a->m);
    for (int turn = 0; turn < 2; turn++)
        for (int k = 0; k < n_to; k++) add(n, -pal_dot_product(n, a->v, to[k].m), &to[k], a);
    const double left = pal_dot_product(n, a->v, a->m);
    if (!(left > 1e-20 * before)) return false;
    scale(n, 1 / sqrt(left), a);
    return true;
}

/* lowest eigenvalue of the symmetric matrix a [3][3], of which n rows count, and its vector, by Jacobi rotations */
static double find_lowest(double a[3][3], int n, double vector[3])
{
    double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                if (fabs(a[p][q]) <= 1e-300) continue;
                const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
                const double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < n; k++) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y, a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < n; k++) {
                    const double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
                }
                for (int k = 0; k < n; k++) {
                    const double x = v[k][p], y = v[k][q];
                    v[k][p] = c * x - s * y, v[k][q] = s * x + c * y;
                }
            }
    int low = 0;
    for (int k = 1; k < n; k++) low = a[k][k] < a[low][low] ? k : low;
    for (int k = 0; k < 3; k++) vector[k] = k < n ? v[k][low] : 0;
    return a[low][low];
}

/* x and p of the lowest Ritz vector in the span of s [n_s] = x, w, p */
static void take_ritz(int n, const triple s[3], int n_s)
{
    double a[3][3] = {{0}}, c[3];
    for (int i = 0; i < n_s; i++)
        for (int k = 0; k < n_s; k++) a[i][k] = pal_dot_product(n, s[i].v, s[k].k);
    for (int i = 0; i < n_s; i++)
        for (int k = 0; k < i; k++) a[i][k] = a[k][i] = 0.5 * (a[i][k] + a[k][i]);
    (void)find_lowest(a, n_s, c);
    scale(n, c[2], &s[2]);
    add(n, c[1], &s[1], &s[2]);
    scale(n, c[0], &s[0]);
    add(n, 1, &s[2], &s[0]);
}

void pal_lowest_mode_run(pal_lowest_mode *m, double tolerance, int max)
{
    const int n = m->n;
    double *const work = m->work, *r = work + 8 * (size_t)n, before[WINDOW];
    const triple s[3] = {{m->x, work, work + n},
                         {work + 2 * (size_t)n, work + 3 * (size_t)n, work + 4 * (size_t)n},
                         {work + 5 * (size_t)n, work + 6 * (size_t)n, work + 7 * (size_t)n}};
    m->done = 0, m->lambda = NAN, m->error = INFINITY;
    memset(s[2].v, 0, 3 * sizeof(double) * (size_t)n);
    for (int k = 0; k < WINDOW; k++) before[k] = INFINITY;
    m->stiffness(m->user, s[0].v, s[0].k), m->mass(m->user, s[0].v, s[0].m);
    if (!orthonormalise(n, &s[0], NULL, 0)) return;
    for (;; m->done++) {
        /* products of a sum gather rounding */
        if (m->done % 32 == 31) m->stiffness(m->user, s[0].v, s[0].k), m->mass(m->user, s[0].v, s[0].m);
        m->lambda = pal_dot_product(n, s[0].v, s[0].k) / pal_dot_product(n, s[0].v, s[0].m);
        if (!isfinite(m->lambda)) return;
        for (int i = 0; i < n; i++) r[i] = s[0].k[i] - m->lambda * s[0].m[i];
        m->precondition(m->user, r, s[1].v);
        const double fell = before[m->done % WINDOW] - m->lambda;
        before[m->done % WINDOW] = m->lambda;
        m->error =
            m->lambda > 0 ? fmax(pal_dot_product(n, r, s[1].v), m->done > 2 ? fmin(fell, 1e300) : 0) / m->lambda : 0;
        if (m->done >= max || (m->done >= 3 && m->error <= tolerance)) return;
        m->stiffness(m->user, s[1].v, s[1].k), m->mass(m->user, s[1].v, s[1].m);
        if (!orthonormalise(n, &s[1], s, 1)) return;
        take_ritz(n, s, m->done > 0 && orthonormalise(n, &s[2], s, 2) ? 3 : 2);
    }
}
