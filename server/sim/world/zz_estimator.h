/* Estimate of the discretisation error in energy by stress recovery (Zienkiewicz and Zhu 1987). The recovered stress
 * at a node is the volume-weighted mean of the element mean stresses around it; s* interpolates it by the elements'
 * shape functions. Then eta^2 = sum over elements of integral (s* - s_h) : C^-1 : (s* - s_h) and |u_h|^2 = integral
 * s_h : C^-1 : s_h, where C is the element's Hooke tensor. Means are taken within one material only, because stress
 * jumps between materials are physical; mu and lambda that differ by less than a quarter count as one material, and
 * beyond 16 materials the nearest of 16 is taken. Stress is Kirchhoff stress in current axes: exact for the linear
 * law and for small strains under any rotation, otherwise the measure that the components use.
 *
 * The estimate is zero for constant stress; eta^2 is O(h^2) for a smooth field on linear elements. It does not
 * detect volumetric locking: at nu 0.499 linear tetrahedra give 0.4 to 0.6 of the true error. For ten-node
 * tetrahedra it is about twice too large, because stress varies within an element and only its mean is used.
 * Components without a stress hook (springs, cell_elastic) have no estimate. Uses heap memory only while it runs.
 * Thread: that of the world, between steps. */
#ifndef PAL_SIM_WORLD_ZZ_ESTIMATOR_ESTIMATOR_H
#define PAL_SIM_WORLD_ZZ_ESTIMATOR_ESTIMATOR_H
#include "server/sim/world/world.h"

typedef struct pal_zz_estimator_error {
    double error, solution; /* eta and |u_h|, J^1/2: half their squares are energies */
    double percent;         /* 100 eta / sqrt(eta^2 + |u_h|^2); 0 where both are 0   */
    int n_material;
} pal_zz_estimator_error;

/* share_J: eta^2 of each of the component's elements, J, may be NULL. REFUSED: no component of the body gives
 * stress; MEMORY */
pal_err pal_zz_estimator_estimate(const pal_world *world, int body, double *share_J, pal_zz_estimator_error *out,
                                  pal_diagnostic *diag);
#endif
