/* Credit: how many cycles a client may have unacknowledged (protocol/README.md, "Cycles and credit"),
 * and the rate limit of what it says. Plain structs without a clock of their own. Thread: [net].
 *
 * A round trip counts for K only when the cycle was sent with none before it in flight: a client slower than the
 * cycles lets them wait, and a K taken from that wait makes it longer still, up to the clamp. So that there is always
 * such a cycle, one is sent alone at intervals. */
#ifndef PAL_NET_TRANSPORT_CREDIT_H
#define PAL_NET_TRANSPORT_CREDIT_H
#include <stdbool.h>
#include <stdint.h>

enum { PAL_CREDIT_MIN = 2, PAL_CREDIT_MAX = 12 };

typedef struct pal_credit {
    double rate_hz; /* of cycles                                          */
    int max;        /* K = 1 + ceil(rate x smallest round trip), clamped  */
    int n_flight;   /* sent and not acknowledged, oldest first            */
    uint32_t cycle[PAL_CREDIT_MAX];
    uint64_t sent_ns[PAL_CREDIT_MAX];
    uint32_t acknowledged; /* newest acknowledged cycle; 0: none                 */
    uint64_t heard_ns;     /* last acknowledgement, or the first cycle sent      */
    double rtt_s;          /* smoothed; 0: none yet                              */
    double min_s[2];       /* smallest round trip of the last and this window    */
    uint64_t window_ns;    /* end of this window; 0: before the first            */
    bool probing;          /* a cycle goes alone: nothing else until it is back  */
    bool first_alone;      /* cycle[0] was sent with none before it in flight    */
} pal_credit;

void pal_credit_begin(pal_credit *credit, double rate_hz);
bool pal_credit_free(const pal_credit *credit); /* may a cycle be sent now? */
void pal_credit_sent(pal_credit *credit, uint32_t cycle, uint64_t now_ns);
/* takes in an acknowledgement of this and all earlier cycles; false: of a cycle that was never sent */
bool pal_credit_acknowledge(pal_credit *credit, uint32_t cycle, uint64_t now_ns);
bool pal_credit_stalled(const pal_credit *credit, uint64_t now_ns, uint64_t limit_ns);

/* token bucket */
typedef struct pal_bucket {
    double level, depth, per_s;
    uint64_t at_ns;
} pal_bucket;
void pal_bucket_begin(pal_bucket *bucket, double per_s, double depth, uint64_t now_ns);
bool pal_bucket_take(pal_bucket *bucket, uint64_t now_ns); /* false: too many */
#endif
