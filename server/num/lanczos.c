/* Lanczos' iteration. */
#include "server/num/lanczos.h"

#include "server/num/conjugate_gradient.h"

#include <math.h>
#include <string.h>

/* largest eigenvalue of the tridiagonal matrix with diagonal a and b beside it, by bisection with the signs of leading
 * minors, and its eigenvector s of length 1; b[n - 1] lies outside */
static double find_largest(const double *a, const double *b, int n, double *s)
{
    double low = a[0], high = a[0], sum = 0;
    for (int i = 0; i < n; i++) {
        double reach = a[i] + (i > 0 ? b[i - 1] : 0) + (i + 1 < n ? b[i] : 0);
        low = fmax(low, a[i]), high = fmax(high, reach);
    }
    high += 1e-15 * fabs(high);
    for (int turn = 0; turn < 60 && low < high; turn++) {
        double middle = 0.5 * (low + high), d = middle - a[0];
        bool above = d > 0;
        for (int i = 1; i < n && above; i++) {
            d = middle - a[i] - b[i - 1] * b[i - 1] / d;
            above = d > 0;
        }
        *(above ? &high : &low) = middle;
    }
    /* from the last entry back, the direction in which it grows */
    s[n - 1] = 1;
    for (int i = n - 1; i > 0; i--) {
        s[i - 1] = ((high - a[i]) * s[i] - (i + 1 < n ? b[i] * s[i + 1] : 0)) / b[i - 1];
        /* only ratios count */
        if (fabs(s[i - 1]) > 1e100)
            for (int k = i - 1; k < n; k++) s[k] *= 1e-100;
    }
    for (int i = 0; i < n; i++) sum += s[i] * s[i];
    for (int i = 0; i < n; i++) s[i] /= sqrt(sum);
    return high;
}

/* M times the Ritz vector */
static void combine(pal_lanczos *l, const double *s)
{
    memset(l->z, 0, sizeof(double) * (size_t)l->n);
    for (int j = 0; j < l->done; j++) {
        const double *q = l->basis + (size_t)j * (size_t)l->n;
        for (int i = 0; i < l->n; i++) l->z[i] += s[j] * q[i];
    }
}

double pal_lanczos_run(pal_lanczos *l, double tolerance, int min, int max)
{
    double a[PAL_LANCZOS_MAX], b[PAL_LANCZOS_MAX], s[PAL_LANCZOS_MAX] = {1}, beta = 0;
    const size_t n = (size_t)l->n;
    l->done = 0, l->ritz = l->residual = 0;
    if (!l->solve(l->user, l->z, l->w)) return NAN;
    beta = sqrt(pal_dot_product(l->n, l->w, l->z));
    if (beta == 0) return 0;
    while (l->done < max) {
        double *q = l->basis + (size_t)(l->done % l->n_basis) * n;
        const double *before = l->done > 0 ? l->basis + (size_t)((l->done - 1) % l->n_basis) * n : NULL;
        for (size_t i = 0; i < n; i++) q[i] = l->z[i] / beta, l->w[i] /= beta;
        if (!l->multiply(l->user, l->w, l->u)) return NAN;
        double alpha = pal_dot_product(l->n, l->u, l->w);
        for (size_t i = 0; i < n; i++) l->z[i] = l->u[i] - alpha * q[i] - (before ? beta * before[i] : 0);
        if (!l->solve(l->user, l->z, l->w)) return NAN;
        double next2 = pal_dot_product(l->n, l->w, l->z);
        if (!isfinite(alpha) || !isfinite(next2)) return NAN;
        beta = sqrt(fmax(next2, 0));
        a[l->done] = alpha, b[l->done] = beta;
        l->ritz = find_largest(a, b, ++l->done, s);
        l->residual = beta * fabs(s[l->done - 1]);
        if (!(beta > 1e-12 * fabs(l->ritz))) break;
        if (l->done >= min && l->residual <= tolerance * l->ritz) break;
    }
    if (l->done <= l->n_basis) combine(l, s);
    return l->ritz + l->residual;
}
