#include "server/num/conjugate_gradient.h"

#include <math.h>
#include <string.h>

double pal_dot_product(int n, const double *a, const double *b)
{
    double lane[8] = {0}, sum = 0;
    int i = 0;
    for (; i + 8 <= n; i += 8)
        for (int l = 0; l < 8; l++) lane[l] += a[i + l] * b[i + l];
    for (; i < n; i++) sum += a[i] * b[i];
    return sum + ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

/* x += alpha p, r -= alpha q; returns r'r */
static double go(int n, double alpha, const double *p, const double *q, double *x, double *r)
{
    for (int i = 0; i < n; i++) {
        x[i] += alpha * p[i];
        r[i] -= alpha * q[i];
    }
    return pal_dot_product(n, r, r);
}

int pal_conjugate_gradient_run(pal_conjugate_gradient *cg, double *x, double target, int min, int max)
{
    const int n = cg->n;
    double rr = pal_dot_product(n, cg->r, cg->r), rz_old = 0, alpha = 0;
    int done = 0;
    while (done < max && rr > 0 && (done < min || rr > target * target)) {
        cg->precondition(cg->user, cg->r, cg->z);
        double rz = pal_dot_product(n, cg->r, cg->z);
        if (!(rz > 0) || !isfinite(rz)) break;
        /* z'(r - r of before) / (z'r of before), and r of before is r + alpha q */
        double beta = done > 0 ? -alpha * pal_dot_product(n, cg->z, cg->q) / rz_old : 0;
        if (done == 0)
            memcpy(cg->p, cg->z, sizeof(double) * (size_t)n);
        else
            for (int i = 0; i < n; i++) cg->p[i] = cg->z[i] + beta * cg->p[i];
        cg->multiply(cg->user, cg->p, cg->q);
        double pq = pal_dot_product(n, cg->p, cg->q);
        if (!(pq > 0) || !isfinite(pq)) break;
        alpha = rz / pq;
        rz_old = rz;
        rr = go(n, alpha, cg->p, cg->q, x, cg->r);
        done++;
    }
    cg->residual = sqrt(rr);
    return done;
}
