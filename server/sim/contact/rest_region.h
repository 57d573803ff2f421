/* The nodes that a support holds, chosen at rest. Keys low_m and high_m (a box, body frame) or lowest (share of the
 * body's height along `up`, 0.05). Thread: [load]. */
#ifndef PAL_SIM_CONTACT_REST_REGION_H
#define PAL_SIM_CONTACT_REST_REGION_H
#include "server/sim/core/config_entry.h"

typedef struct pal_rest_region {
    bool box;
    double low_m[3], high_m[3]; /* of the box */
    double up[3], top_m;        /* of the lowest part */
} pal_rest_region;

/* reads the keys, for points x [n][3]; REFUSED */
pal_err pal_rest_region_read(pal_config_entry *entry, const double *x, int n, const double up[3], pal_rest_region *out,
                             pal_diagnostic *diag);
bool pal_rest_region_has(const pal_rest_region *region, const double x[3]);
#endif
