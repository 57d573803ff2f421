/* Constants of elastic elements: unit, reason, test that bounds each. */
#ifndef PAL_SIM_ELEMENTS_TUNING_H
#define PAL_SIM_ELEMENTS_TUNING_H
#include "server/sim/core/tuning.h"
#include "server/sim/recovery/tuning.h"

/* ratios of a volume to that at rest: tet_elastic returns from its split when every piece is above LOW, with
 * neo_hookean also below HIGH (tests/stability/test_fem_shapes.c) */
#define PAL_TET_RECOVERED_LOW  0.5
#define PAL_TET_RECOVERED_HIGH (1 / PAL_TET_RECOVERED_LOW)
/* updates, one a Newton iteration: a body that inverts again within so many has not recovered for good. A return to
 * cubes that failed raises PAL_RECOVERED_LOW for the next by PAL_INVERTED_LOW (tests/sim/elements/test_hex_recovery.c),
 * at most to MAX: a body on a support that moves without end never has all corners above 0.95
 * (tests/house/test_robustness.sh) */
#define PAL_RETRY_UPDATES 600
#define PAL_RETRY_MAX     0.9
#endif
