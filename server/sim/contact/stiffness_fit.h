/* Tangent stiffness by least squares, where the solver knows no compliance: the slope of force over displacement,
 *     k = (cov(x, f) + p^2 k_start) / (var(x) + p^2),
 * with older samples forgotten and a start value that weighs as much as data of spread p. A sample counts only when the
 * tool has moved, so a tool at rest keeps its stiffness. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_STIFFNESS_FIT_H
#define PAL_SIM_CONTACT_STIFFNESS_FIT_H

typedef struct pal_stiffness_fit {
    double n, x[3], f[3], xx, xf; /* weighted sums           */
    double last_m[3];             /* of the newest sample    */
    double k_N_m, k_start_N_m;    /* estimate, start value   */
} pal_stiffness_fit;

void pal_stiffness_fit_start(pal_stiffness_fit *fit, double k_start_N_m);
/* a displacement of the tool and the force on tissue there (of one direction: the others 0); prior_m: p */
void pal_stiffness_fit_add(pal_stiffness_fit *fit, const double x_m[3], const double f_N[3], double prior_m);
#endif
