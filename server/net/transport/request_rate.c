/* A bucket is the time at which its next token is due: before now by at most the time of PAL_REQUESTS_AT_ONCE tokens.
 */
#include "server/net/transport/request_rate.h"

#include "server/net/transport/tuning.h"

#include <string.h>

uint64_t pal_request_rate_take(pal_request_rate *rate, const char *address, uint64_t now_ns)
{
    const uint64_t token_ns = 1000000000u / PAL_REQUESTS_1_S, depth_ns = PAL_REQUESTS_AT_ONCE * token_ns;
    int k = 0, oldest = 0;
    for (; k < PAL_REQUEST_ADDRESSES && strcmp(rate->of[k].address, address); k++)
        if (rate->of[k].free_ns < rate->of[oldest].free_ns) oldest = k;
    if (k == PAL_REQUEST_ADDRESSES) {
        k = oldest;
        strncpy(rate->of[k].address, address, sizeof rate->of[k].address - 1);
        rate->of[k].free_ns = 0;
    }
    uint64_t *free_ns = &rate->of[k].free_ns;
    if (*free_ns + depth_ns < now_ns) *free_ns = now_ns > depth_ns ? now_ns - depth_ns : 0;
    const uint64_t wait_ns = *free_ns > now_ns ? *free_ns - now_ns : 0;
    if (wait_ns > PAL_REQUEST_WAIT_NS) return UINT64_MAX;
    *free_ns += token_ns;
    return wait_ns;
}
