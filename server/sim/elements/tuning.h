/* Constants of elastic elements: unit, reason, test that bounds each. */
#ifndef PAL_SIM_ELEMENTS_TUNING_H
#define PAL_SIM_ELEMENTS_TUNING_H
#include "server/sim/core/tuning.h"
#include "server/sim/recovery/tuning.h"

/* volume over h^3 of a tetrahedron that is a sliver (tests/stability/test_fem_numbers.c) */
#define PAL_TET_SLIVER (1e-3 / 6)
#endif
