/* While hold_estimates is true, estimators take no new state, so that estimates age. For tests linked with
 * --wrap=pal_estimate_copy. */
#ifndef TESTS_ESTIMATE_HOLD_ESTIMATES_H
#define TESTS_ESTIMATE_HOLD_ESTIMATES_H
#include "server/estimate/estimate.h"

#include <stdatomic.h>

static _Atomic bool hold_estimates;

bool __real_pal_estimate_copy(pal_estimate_state *to, const pal_world *world, int body);
bool __wrap_pal_estimate_copy(pal_estimate_state *to, const pal_world *world, int body);

bool __wrap_pal_estimate_copy(pal_estimate_state *to, const pal_world *world, int body)
{
    return !hold_estimates && __real_pal_estimate_copy(to, world, body);
}
#endif
