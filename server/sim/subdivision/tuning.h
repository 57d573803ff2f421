/* Constants of subdivision solids: unit, reason, test that bounds each. */
#ifndef PAL_SIM_SUBDIVISION_TUNING_H
#define PAL_SIM_SUBDIVISION_TUNING_H
#include "server/sim/recovery/tuning.h"

/* factor on the s of a region under a lasting load, and its period in s: tissue that hangs by a soft region is drawn
 * out by 1 / s (tests/sim/subdivision/test_cell_recovery.c) */
#define PAL_CELL_STIFFEN_FACTOR 1.25
#define PAL_CELL_STIFFEN_S      (PAL_REGION_GROW_S / 8)
#endif
