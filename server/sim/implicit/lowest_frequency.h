/* The lowest angular frequency w1 of a body at rest: K v = w1^2 M v, K the stiffness of its FORCE components at rest
 * and M its masses. K comes from the components' tangents, or, where an elastic component has none (springs), from
 * differences of forces: points without a common neighbour move together. The preconditioner is
 * multigrid where the body has levels (hex_multigrid.h), else an incomplete factor of K (num/incomplete_cholesky.h)
 * with the rigid motions of clusters of points (num/rigid_clusters.h), so that 10 to 70 iterations do for every size
 * and shape (num/lowest_mode.h). Thread: [load], or [sim] between steps: it takes heap memory. */
#ifndef PAL_SIM_IMPLICIT_LOWEST_FREQUENCY_H
#define PAL_SIM_IMPLICIT_LOWEST_FREQUENCY_H
#include "server/sim/implicit/rest_stiffness.h"

/* Fills lowest_1_s and lowest_error of the body that build->made [n_made] belong to; both 0: not known, because part of
 * the body moves as a rigid one, or the work would be too much. The body is at rest. mode: its mode, of mass 1 kg m^2
 * [n_dof][3]; NULL: not asked for. rest: the stiffness where it has been found already; NULL: it has not. MEMORY */
pal_err pal_lowest_frequency_find(const pal_build *build, const pal_rest_values *rest, double *mode);
#endif
