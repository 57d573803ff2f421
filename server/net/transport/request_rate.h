/* How many HTTP requests an address may make: a token bucket for each of the addresses that were seen last. A request
 * beyond the rate waits, so that a class that loads the page at once gets it, and one that would wait for too long is
 * refused. Thread: [net]. */
#ifndef PAL_NET_TRANSPORT_REQUEST_RATE_H
#define PAL_NET_TRANSPORT_REQUEST_RATE_H
#include <stdbool.h>
#include <stdint.h>

enum { PAL_REQUEST_ADDRESSES = 256 };

typedef struct pal_request_rate {
    struct {
        char address[46];
        uint64_t free_ns; /* when the bucket has a token again that no request waits for */
    } of[PAL_REQUEST_ADDRESSES];
} pal_request_rate;

/* takes a token; the result is how long the request has to wait, ns; UINT64_MAX: refuse it */
uint64_t pal_request_rate_take(pal_request_rate *rate, const char *address, uint64_t now_ns);
#endif
