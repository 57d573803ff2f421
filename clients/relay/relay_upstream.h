/* The way up: one link as a viewer, whose messages and assets are given to what the relay keeps. Thread: [up], the one
 * inside pal_link_run. */
#ifndef PAL_RELAY_UPSTREAM_H
#define PAL_RELAY_UPSTREAM_H
#include "clients/link/link.h"
#include "clients/relay/relay_kept.h"

typedef struct pal_relay_upstream pal_relay_upstream;

/* borrows loop and kept. REFUSED: the URL. [load] */
pal_err pal_relay_upstream_open(pal_link_loop *loop, const char *url, pal_relay_kept *kept, pal_diagnostic *diag,
                                pal_relay_upstream **out);
/* code and reason with which upstream has refused for good, which has stopped the loop; 0: it has not */
int pal_relay_upstream_ended(const pal_relay_upstream *upstream, const char **reason);
void pal_relay_upstream_close(pal_relay_upstream *upstream); /* after the loop is destroyed; NULL is fine. [load] */
#endif
