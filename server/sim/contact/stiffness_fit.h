/* Tangent stiffness that a tool feels, from how its force changes as it moves, where no solver knows the compliance:
 * least squares with forgetting and a start value,
 *     k = (sum w (x - mean x).(f - mean f) + k_start prior^2) / (sum w |x - mean x|^2 + prior^2),
 * w falling by the factor `keep` from sample to sample. Samples are taken when x has moved by PAL_FIT_MOVE_M, so that
 * a tool at rest does not divide noise by noise. Used by contact patches (x: depth along the normal) and by grasps (x:
 * the tool). Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_STIFFNESS_FIT_H
#define PAL_SIM_CONTACT_STIFFNESS_FIT_H

/* m. A sample is taken when x has moved so far: a tenth of what a hand can hold still */
#define PAL_FIT_MOVE_M 0.05e-3

typedef struct pal_stiffness_fit {
    double n, x[3], f[3], xx, xf; /* weighted number, sums */
    double last_m[3];             /* of the newest sample  */
    double k_N_m;                 /* the current estimate  */
} pal_stiffness_fit;

void pal_stiffness_fit_start(pal_stiffness_fit *fit, double k_N_m);
/* a new sample of place and force, which grows along x; prior_m is the spread of x at which data weigh as much as the
 * start value. A number c beside a direction is the vector (c, 0, 0) */
void pal_stiffness_fit_add(pal_stiffness_fit *fit, const double x_m[3], const double f_N[3], double keep,
                           double prior_m, double k_start_N_m);
#endif
