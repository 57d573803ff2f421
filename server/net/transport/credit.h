/* Credit: the number of cycles that a client may leave unacknowledged (protocol/README.md, "Cycles and credit"), and
 * the rate limit of incoming messages. Plain structs; the caller passes the time. Thread: [net].
 *
 * The smallest round trip is learnt only from cycles sent with none in flight: one that waits in a queue behind others
 * would lengthen the queue that it measures. At intervals one cycle is therefore sent alone.
 *
 * K covers that round trip and PAL_CREDIT_STALL_S, so that the stream goes on while TCP sends a lost segment again.
 * Where the line is slower than the stream, cycles would queue in it: when even the fastest of a window took longer
 * than the smallest round trip by PAL_CREDIT_QUEUE_S, K becomes what the line has delivered in
 * one round trip at best lately, and then grows again until cycles queue: the bandwidth-delay product, found from both
 * sides. At best, because a stream that stood still for a lost segment says nothing about the line. */
#ifndef PAL_NET_TRANSPORT_CREDIT_H
#define PAL_NET_TRANSPORT_CREDIT_H
#include <stdbool.h>
#include <stdint.h>

enum { PAL_CREDIT_MIN = 2, PAL_CREDIT_MAX = 128, PAL_CREDIT_WINDOWS = 8 };

typedef struct pal_credit {
    double rate_hz; /* of cycles                                          */
    int max;        /* K */
    double limit;   /* of K by what the line delivers; grows where nothing queues */
    int n_flight;   /* sent and unacknowledged, oldest first */
    uint32_t cycle[PAL_CREDIT_MAX];
    uint64_t sent_ns[PAL_CREDIT_MAX];
    uint32_t acknowledged;                  /* newest acknowledged cycle; 0: none */
    uint64_t heard_ns;                      /* time of the last acknowledgement, or of the first cycle sent */
    double rtt_s;                           /* smoothed; 0: none yet                              */
    double min_s[2];                        /* smallest round trip of the last and the current window */
    uint64_t window_ns;                     /* end of the current window; 0: before the first */
    double fastest_s;                       /* smallest round trip of a cycle, alone or not, since judged_ns */
    int n_delivered;                        /* cycles acknowledged since then */
    uint64_t judged_ns;                     /* 0: before the first */
    double delivered_s[PAL_CREDIT_WINDOWS]; /* cycles a second in the last windows, a ring buffer */
    int n_window;
    bool probing;     /* a cycle is sent alone: no other until it is acknowledged */
    bool first_alone; /* cycle[0] was sent with none in flight */
} pal_credit;

void pal_credit_begin(pal_credit *credit, double rate_hz);
bool pal_credit_free(const pal_credit *credit); /* may a cycle be sent now? */
void pal_credit_sent(pal_credit *credit, uint32_t cycle, uint64_t now_ns);
/* acknowledges this and all earlier cycles; false: the cycle was never sent */
bool pal_credit_acknowledge(pal_credit *credit, uint32_t cycle, uint64_t now_ns);
bool pal_credit_stalled(const pal_credit *credit, uint64_t now_ns, uint64_t limit_ns);

/* token bucket */
typedef struct pal_bucket {
    double level, depth, per_s;
    uint64_t at_ns;
} pal_bucket;
void pal_bucket_begin(pal_bucket *bucket, double per_s, double depth, uint64_t now_ns);
bool pal_bucket_take(pal_bucket *bucket, uint64_t now_ns); /* false: rate exceeded */
#endif
