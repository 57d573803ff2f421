/* Forces of springs in single precision, for the sub-steps of an explicit solver: half the memory and twice the numbers
 * in a register of spring_set.h, and roots and divisions at a fifth of the cost. Positions are by slot, relative to a
 * node of the body, in units of the edge of its voxels (pal_node_order): on a lattice at rest their differences are
 * whole numbers, and forces are zero. A position is rounded by 2^-24 of the number of voxels between it and that
 * node at most, 1e-6 of an edge for 16: noise in the strains of that size, and stiffness by differences of such
 * forces would be wrong, so that everything else takes doubles. Thread: [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_SINGLE_H
#define PAL_SIM_SPRINGS_SPRING_SINGLE_H
#include "server/sim/springs/spring_set.h"

/* An edge below this part of its length at rest has no direction: some roundings of positions, of bodies of up to a
 * hundred voxels (tests/sim/springs/test_spring_single.c) */
#define PAL_SPRING_SINGLE_SHORT 1e-5

/* order->single_f += the forces of all springs of a set, strips first, or of n blocks in ascending order (block NULL:
 * all). Returns the smallest square of an edge's length over that at rest, at most 1; of other kinds 1 */
double pal_spring_single_run(const pal_spring_set *set, const pal_node_order *order, const int32_t *block, int n);
#endif
