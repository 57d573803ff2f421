/* Least squares of force over place. */
#include "server/sim/contact/stiffness_fit.h"

#include "server/base/vec3.h"

void pal_stiffness_fit_start(pal_stiffness_fit *fit, double k_N_m)
{
    *fit = (pal_stiffness_fit){.k_N_m = k_N_m};
}

void pal_stiffness_fit_add(pal_stiffness_fit *fit, const double x[3], const double f[3], double keep, double prior_m,
                           double k_start_N_m)
{
    double *to = fit->last_m;
    if (fit->n > 0 && pal_dist3(x, to) < PAL_FIT_MOVE_M) return;
    pal_copy3(to, x);
    fit->n = keep * fit->n + 1;
    for (int c = 0; c < 3; c++) {
        fit->x[c] = keep * fit->x[c] + x[c];
        fit->f[c] = keep * fit->f[c] + f[c];
    }
    fit->xx = keep * fit->xx + pal_dot3(x, x);
    fit->xf = keep * fit->xf + pal_dot3(x, f);
    double vary = fit->xx - pal_dot3(fit->x, fit->x) / fit->n, with = fit->xf - pal_dot3(fit->x, fit->f) / fit->n;
    fit->k_N_m = (with + k_start_N_m * prior_m * prior_m) / (vary + prior_m * prior_m);
}
