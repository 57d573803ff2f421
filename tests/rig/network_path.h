/* One direction of a network in virtual time: when does a packet that leaves now arrive, if at all?
 *
 * A path has the properties of a profile: delay, jitter, loss, reordering, bandwidth, outages. Its flows share its
 * bandwidth; each keeps the order of its own packets. What happens to packet number n of a flow is a function of the
 * seeds, n and the time at which it leaves (and of the packets before it, for order and bandwidth); no call reads a
 * clock. Times are nanoseconds from the start of the rig.
 *
 * Two kinds of packet:
 *   - A datagram is lost with probability `loss`, in an outage, and when the queue of the line is full. The share
 *     `reorder` takes a path twice as long, and those sent after it overtake it.
 *   - A segment of a byte stream (TCP) is always delivered, in order. When it is lost it is sent again after the
 *     retransmission timeout max(200 ms, round trip), twice that, four times that; the flow sends nothing in between
 *     (RFC 6298 sections 2.4 and 5.5 with the minimum that Linux uses). After 15 retransmissions the connection is
 * given up (Linux tcp_retries2). Not modelled: slow start and other congestion control, selective acknowledgement,
 * duplicates, damaged bytes. */
#ifndef TESTS_RIG_NETWORK_PATH_H
#define TESTS_RIG_NETWORK_PATH_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define NETWORK_LOST UINT64_MAX /* the arrival of what never arrives */

/* of the round trip: each direction has half of round_trip_s and jitter_s, and all of the rest */
typedef struct network_profile {
    const char *name;
    double round_trip_s;
    double jitter_s; /* +-, uniform in each direction */
    double loss;     /* probability for each transmission in each direction, [0, 1] */
    double reorder;  /* share of the datagrams that others overtake, [0, 1] */
    double bits_s;   /* bandwidth; 0: without limit */
    double queue_s;  /* of data that wait for the line: more datagrams are dropped, streams are not read */
    double outage_at_s, outage_s, outage_every_s; /* the first begins at; lasts; period, 0: once. outage_s 0: none */
} network_profile;

extern const network_profile network_profiles[]; /* ends with one without a name */
/* NULL: there is none of that name */
const network_profile *network_find_profile(const char *name);
/* REFUSED: jitter above the round trip, an outage as long as its period */
pal_err network_check_profile(const network_profile *profile, pal_diagnostic *diag);

typedef struct network_counts {
    uint64_t packets, bytes;  /* that were to be sent */
    uint64_t lost;            /* transmissions lost by chance */
    uint64_t in_outage;       /* transmissions lost in an outage */
    uint64_t queue_dropped;   /* datagrams that found the queue full */
    uint64_t reordered;       /* datagrams that took the longer path */
    uint64_t retransmissions; /* of segments */
    uint64_t given_up;        /* segments, and with each its connection */
} network_counts;

typedef struct network_path {
    network_profile profile; /* copied */
    uint64_t seed;
    uint64_t busy_ns; /* until then the line transmits what was sent before */
    uint64_t n_flow;
    network_counts count;
} network_path;

typedef struct network_flow {
    network_path *path;   /* borrowed */
    uint64_t seed, index; /* number of the next packet */
    uint64_t ready_ns;    /* a segment that was lost leaves again then */
    uint64_t last_ns;     /* the arrival that later packets do not overtake */
} network_flow;

network_path network_path_make(const network_profile *profile, uint64_t seed);
/* flows of a path are numbered in the order of these calls, which is what tells their random sequences apart */
network_flow network_flow_make(network_path *path);

/* the arrival of a datagram that leaves at now_ns, or NETWORK_LOST. now_ns must not decrease */
uint64_t network_send_datagram(network_flow *flow, uint64_t now_ns, size_t n_byte);
/* from when on the flow may send a segment */
uint64_t network_ready_ns(const network_flow *flow);
/* the arrival of a segment that leaves at now_ns >= network_ready_ns, or NETWORK_LOST: the connection is given up at
 * network_ready_ns */
uint64_t network_send_segment(network_flow *flow, uint64_t now_ns, size_t n_byte);
bool network_in_outage(const network_profile *profile, uint64_t at_ns);

/* Packets on their way, by arrival; equal arrivals in the order of their departure. */
typedef struct network_packet {
    struct network_packet *next;
    uint64_t arrival_ns;
    int to;        /* descriptor that sends it on */
    size_t n_byte; /* 0: end of the stream */
    uint8_t bytes[];
} network_packet;

typedef struct network_queue {
    network_packet *first, *last;
    size_t n_byte;
} network_queue;

/* copies the bytes; MEMORY */
pal_err network_queue_add(network_queue *queue, uint64_t arrival_ns, int to, const uint8_t *bytes, size_t n_byte);
/* arrival of the first packet; NETWORK_LOST: none */
uint64_t network_queue_next_ns(const network_queue *queue);
void network_queue_remove_first(network_queue *queue);
void network_queue_clear(network_queue *queue);
#endif
