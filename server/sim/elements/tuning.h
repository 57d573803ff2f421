/* Constants of elastic elements: unit, reason, test that bounds each. */
#ifndef PAL_SIM_ELEMENTS_TUNING_H
#define PAL_SIM_ELEMENTS_TUNING_H
#include "server/sim/core/tuning.h"
#include "server/sim/recovery/tuning.h"

/* volume over h^3 of a tetrahedron that is a sliver (tests/stability/test_fem_numbers.c) */
#define PAL_TET_SLIVER (1e-3 / 6)
/* stiffness of what lies outside of the surface in a cut voxel, over that inside: no point is without any, and the
 * condition number of the stiffness stays that of whole voxels (tests/sim/elements/test_hex_cut.c) */
#define PAL_VOID_STIFFNESS 1e-3
#endif
