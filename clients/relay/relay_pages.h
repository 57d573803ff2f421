/* Pages of a relay: assets, health, readiness, its session, metrics, and the files of the page. Thread: [net]. */
#ifndef PAL_RELAY_PAGES_H
#define PAL_RELAY_PAGES_H
#include "clients/relay/relay_kept.h"
#include "server/net/transport/site.h"
#include "server/net/transport/transport.h"

typedef struct pal_relay_options {
    int max_viewers;     /* 0: PAL_RELAY_VIEWERS */
    const char *keys;    /* file of the keys of tickets, which are then checked; NULL: tickets are not looked at */
    const char *relays;  /* to which who finds no place here is sent (relay_list.h); NULL: none */
    pal_site *site;      /* files of the page, borrowed; NULL: none */
    bool health_on_main; /* health and metrics stand beside the page */
} pal_relay_options;

/* counts, for /metrics */
typedef struct pal_relay_counts {
    int n_viewer;
    uint64_t n_joined, n_refused, n_frame, n_skipped, n_byte;
} pal_relay_counts;

void pal_relay_get(pal_relay_kept *kept, const pal_relay_options *options, const pal_relay_counts *count,
                   const pal_request *request, pal_reply *reply);
#endif
