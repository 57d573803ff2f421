/* The nodes that a support holds, chosen at rest. Keys low_m and high_m (a box, body frame) or lowest (share of the
 * body's height along `up`, 0.05). Thread: [load]. */
#ifndef PAL_SIM_CONTACT_REST_REGION_H
#define PAL_SIM_CONTACT_REST_REGION_H
#include "server/sim/core/effect.h"

/* reads the keys; held [n] = 1 for the points x [n][3] in the region, memory of build->arena; REFUSED, MEMORY */
pal_err pal_rest_region_find(pal_config_entry *entry, const double *x, int n, const pal_build *build, uint8_t **held);
#endif
