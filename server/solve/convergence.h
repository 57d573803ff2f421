/* Convergence under refinement: solves one load case at several resolutions and reports errors and observed orders.
 * The error is that of sample_points.h against a reference. It is also estimated, with or without a reference, from
 * the change between resolutions (Richardson 1911; Roache 1994). [load] */
#ifndef PAL_SOLVE_CONVERGENCE_H
#define PAL_SOLVE_CONVERGENCE_H
#include "server/solve/solve.h"

enum { PAL_CONVERGENCE_MAX = 16 };

/* one resolution; unknown numbers are NaN */
typedef struct pal_convergence_point {
    int resolution;
    double rms_percent, max_percent; /* against the samples; NaN without */
    double order;                    /* of rms_percent, from the previous point: log ratio of errors over that of h */
    /* RMS change of displacement from the previous point, over the largest displacement */
    double change_percent;
    double change_order;     /* p of change ~ h^p - h'^p, from this point and the two before */
    double estimate_percent; /* error of this point by that order (by order 1 at the second point) */
    pal_solve_result result;
} pal_convergence_point;

/* Resolutions must ascend strictly (REFUSED names the number), at most PAL_CONVERGENCE_MAX; options->resolution is
 * not read. samples NULL: changes are taken at 4096 evenly picked vertices of the surface. *n_done (may be NULL):
 * number of complete points, also after an error. Errors as pal_solve, and MEMORY. */
pal_err pal_convergence(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                        const pal_solve_options *options, const pal_samples *samples, const int *resolution, int n,
                        pal_convergence_point *out, int *n_done, pal_diagnostic *diag);

/* Computes the four derived numbers of points whose h, rms_percent and change_percent are set. */
void pal_convergence_orders(pal_convergence_point *point, int n);
/* log(coarse / fine) / log(h_coarse / h_fine); NaN unless all are positive and the two h differ. */
double pal_observed_order(double h_coarse, double coarse, double h_fine, double fine);
/* p of u_h = u + C h^p from the changes between three meshes: h[0] > h[1] > h[2]; first: 0 to 1, second: 1 to 2.
 * NaN if no p in 0.05 to 8 explains how the changes shrink. */
double pal_richardson_order(const double h[3], double first, double second);
#endif
