/* Sums over a body's points. */
#include "server/sim/core/sums.h"

#include "server/sim/core/simd.h"

static double sum_lanes(pal_v8 a)
{
    return ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]));
}

double pal_sum_mv2(int n, const double *mass_kg, const double *v)
{
    pal_v8 a = {0}, b = {0}, c = {0};
    double sum = 0;
    int i = 0;
    for (; i + 8 <= n; i += 8) {
        const double *u = v + 3 * (size_t)i;
        const pal_v8 m = pal_load8(mass_kg + i), p = pal_load8(u), q = pal_load8(u + 8), r = pal_load8(u + 16);
        /* each mass beside the three numbers of its point */
        a += __builtin_shufflevector(m, m, 0, 0, 0, 1, 1, 1, 2, 2) * (p * p);
        b += __builtin_shufflevector(m, m, 2, 3, 3, 3, 4, 4, 4, 5) * (q * q);
        c += __builtin_shufflevector(m, m, 5, 5, 6, 6, 6, 7, 7, 7) * (r * r);
    }
    for (; i < n; i++) {
        const double *u = v + 3 * (size_t)i;
        sum += mass_kg[i] * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    }
    return sum + sum_lanes(a + b + c);
}

double pal_sum_work(int n, const double *f, const double *x, const double *x0)
{
    pal_v8 a = {0}, b = {0};
    double sum = 0;
    int i = 0;
    for (; i + 16 <= n; i += 16) {
        a += pal_load8(f + i) * (pal_load8(x + i) - pal_load8(x0 + i));
        b += pal_load8(f + i + 8) * (pal_load8(x + i + 8) - pal_load8(x0 + i + 8));
    }
    for (; i < n; i++) sum += f[i] * (x[i] - x0[i]);
    return sum + sum_lanes(a + b);
}

bool pal_copy_finite(int n, const double *from, double *to)
{
    /* 0 * x is 0 for finite x and NaN otherwise */
    pal_v8 a = {0};
    double sum = 0;
    int i = 0;
    for (; i + 8 <= n; i += 8) {
        const pal_v8 p = pal_load8(from + i);
        if (to) *(pal_v8_unaligned *)(to + i) = p;
        a += 0 * p;
    }
    for (; i < n; i++) {
        if (to) to[i] = from[i];
        sum += 0 * from[i];
    }
    return sum + sum_lanes(a) == 0;
}
