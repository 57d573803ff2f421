/* Tangent stiffness by least squares (stiffness_fit.h). */
#include "server/sim/contact/stiffness_fit.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

void pal_stiffness_fit_start(pal_stiffness_fit *fit, double k_start_N_m)
{
    *fit = (pal_stiffness_fit){.last_m = {INFINITY}, .k_N_m = k_start_N_m, .k_start_N_m = k_start_N_m};
}

void pal_stiffness_fit_add(pal_stiffness_fit *fit, const double x_m[3], const double f_N[3], double prior_m)
{
    if (pal_dist3(x_m, fit->last_m) < MIN_MOVE_M) return;
    pal_copy3(fit->last_m, x_m);
    fit->n = FIT_FORGET * fit->n + 1;
    for (int c = 0; c < 3; c++) {
        fit->x[c] = FIT_FORGET * fit->x[c] + x_m[c];
        fit->f[c] = FIT_FORGET * fit->f[c] + f_N[c];
    }
    fit->xx = FIT_FORGET * fit->xx + pal_dot3(x_m, x_m);
    fit->xf = FIT_FORGET * fit->xf + pal_dot3(x_m, f_N);
    double variance = fit->xx - pal_dot3(fit->x, fit->x) / fit->n, with = fit->xf - pal_dot3(fit->x, fit->f) / fit->n;
    fit->k_N_m = (with + fit->k_start_N_m * prior_m * prior_m) / (variance + prior_m * prior_m);
}
