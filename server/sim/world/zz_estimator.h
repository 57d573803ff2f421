/* The error of a discretisation in energy, by recovered stress (Zienkiewicz and Zhu 1987): nodes take the mean,
 * weighted by volume, of the stress of the elements around them, each of its mean over the element; s* is that nodal
 * field through the elements' own shape functions, and eta^2 = sum over elements of integral (s* - s_h) : C^-1 : (s* -
 * s_h),  |u_h|^2 = integral s_h : C^-1 : s_h, C being the element's Hooke tensor. Means are taken within one material
 * only (mu and lambda that differ by less than a quarter; more than 16 of them count as the nearest of 16), as stress
 * jumps between materials rightly. Stress is Kirchhoff's in current axes: exact for the linear law and for small
 * strains in any rotation, else the measure that rows themselves have.
 *
 * Zero for a field of constant stress; eta^2 goes with h^2 for a smooth one on linear elements. Volumetric locking is
 * not seen: at nu 0.499 linear tetrahedra have 0.4 to 0.6 of the true error. Tetrahedra of ten nodes: about twice too
 * large, as their stress varies within an element, of which the mean alone is recovered from. Rows without a stress
 * hook (springs, cell_elastic) have no such estimate. Heap memory while it runs, nothing else: a world that is never
 * asked has no trace of it. Thread: that of the world, between steps. */
#ifndef PAL_SIM_WORLD_ZZ_ESTIMATOR_ESTIMATOR_H
#define PAL_SIM_WORLD_ZZ_ESTIMATOR_ESTIMATOR_H
#include "server/sim/world/world.h"

typedef struct pal_zz_estimator_error {
    double error, solution; /* eta and |u_h|, J^1/2: half their squares are energies */
    double percent;         /* 100 eta / sqrt(eta^2 + |u_h|^2); 0 where both are 0   */
    int n_material;
} pal_zz_estimator_error;

/* share: eta^2 of each element [the row's elements], J, may be NULL. REFUSED: no row of the body gives stress; MEMORY
 */
pal_err pal_zz_estimator_estimate(const pal_world *world, int body, double *share_J, pal_zz_estimator_error *out,
                                  pal_diagnostic *diag);
#endif
