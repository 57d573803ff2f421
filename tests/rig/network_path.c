#include "tests/rig/network_path.h"

#include "server/num/random.h"
#include "tests/rig/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DRAW_JITTER, DRAW_REORDER, DRAW_LOSS };
_Static_assert(DRAW_LOSS + RIG_RETRIES < RIG_DRAWS, "each transmission has a random number of its own");

/* Of reordering a round trip says nothing: where there is jitter, half as many datagrams as are lost. */
const network_profile network_profiles[] = {
    {.name = "lan", .queue_s = RIG_QUEUE_S},
    {.name = "20", .round_trip_s = 0.02, .queue_s = RIG_QUEUE_S},
    {.name = "50", .round_trip_s = 0.05, .queue_s = RIG_QUEUE_S},
    {.name = "80", .round_trip_s = 0.08, .jitter_s = 0.02, .loss = 0.02, .reorder = 0.01, .queue_s = RIG_QUEUE_S},
    {.name = "150", .round_trip_s = 0.15, .jitter_s = 0.05, .loss = 0.05, .reorder = 0.025, .queue_s = RIG_QUEUE_S},
    {.name = "200", .round_trip_s = 0.2, .loss = 0.2, .queue_s = RIG_QUEUE_S},
    {.name = "outage", .outage_at_s = 5, .outage_s = 2, .outage_every_s = 10, .queue_s = RIG_QUEUE_S},
    {.name = NULL},
};

const network_profile *network_find_profile(const char *name)
{
    for (const network_profile *p = network_profiles; p->name; p++)
        if (!strcmp(p->name, name)) return p;
    return NULL;
}

pal_err network_check_profile(const network_profile *p, pal_diagnostic *diag)
{
    if (p->jitter_s > p->round_trip_s)
        return PAL_REFUSE(diag,
                          "a jitter of %g ms is more than the round trip of %g ms: a packet would arrive before "
                          "it leaves",
                          p->jitter_s * 1e3, p->round_trip_s * 1e3);
    if (p->outage_s > 0 && p->outage_every_s > 0 && p->outage_s >= p->outage_every_s)
        return PAL_REFUSE(diag, "an outage of %g s every %g s leaves no time between them", p->outage_s,
                          p->outage_every_s);
    return PAL_ERR_OK;
}

static uint64_t path_ns(double seconds)
{
    return (uint64_t)llround(seconds * 1e9);
}

network_path network_path_make(const network_profile *profile, uint64_t seed)
{
    return (network_path){.profile = *profile, .seed = seed};
}

network_flow network_flow_make(network_path *path)
{
    return (network_flow){.path = path, .seed = pal_random_bits(path->seed, path->n_flow++)};
}

bool network_in_outage(const network_profile *p, uint64_t at_ns)
{
    const uint64_t from = path_ns(p->outage_at_s), period = path_ns(p->outage_every_s);
    if (p->outage_s <= 0 || at_ns < from) return false;
    const uint64_t since = at_ns - from;
    return (period ? since % period : since) < path_ns(p->outage_s);
}

static double path_draw(const network_flow *flow, unsigned which)
{
    return pal_random_unit(flow->seed, flow->index * RIG_DRAWS + which);
}

/* the end of the transmission of a packet that waits for those before it */
static uint64_t path_transmit(network_path *path, uint64_t now_ns, size_t n_byte)
{
    path->count.packets++;
    path->count.bytes += n_byte;
    if (path->profile.bits_s <= 0) return now_ns;
    const uint64_t from = path->busy_ns > now_ns ? path->busy_ns : now_ns;
    return path->busy_ns = from + path_ns(8 * (double)n_byte / path->profile.bits_s);
}

/* is transmission number `attempt` of this packet, which ends at end_ns, lost? */
static bool path_loses(const network_flow *flow, unsigned attempt, uint64_t end_ns)
{
    network_path *path = flow->path;
    const bool outage = network_in_outage(&path->profile, end_ns);
    const bool lost = !outage && path_draw(flow, DRAW_LOSS + attempt) < path->profile.loss;
    path->count.in_outage += outage;
    path->count.lost += lost;
    return outage || lost;
}

static uint64_t path_delay_ns(const network_flow *flow)
{
    const network_profile *p = &flow->path->profile;
    return path_ns(0.5 * (p->round_trip_s + p->jitter_s * (2 * path_draw(flow, DRAW_JITTER) - 1)));
}

/* not before what was sent before it */
static uint64_t path_in_order(network_flow *flow, uint64_t arrival_ns)
{
    if (arrival_ns > flow->last_ns) flow->last_ns = arrival_ns;
    return flow->last_ns;
}

static bool path_queue_full(const network_path *path, uint64_t now_ns)
{
    return path->busy_ns > now_ns + path_ns(path->profile.queue_s);
}

uint64_t network_send_datagram(network_flow *flow, uint64_t now_ns, size_t n_byte)
{
    network_path *path = flow->path;
    uint64_t arrival = NETWORK_LOST;
    if (path_queue_full(path, now_ns)) {
        path->count.packets++, path->count.bytes += n_byte, path->count.queue_dropped++;
    } else {
        const uint64_t end = path_transmit(path, now_ns, n_byte);
        const bool longer = path_draw(flow, DRAW_REORDER) < path->profile.reorder;
        if (!path_loses(flow, 0, end)) {
            arrival = end + path_delay_ns(flow) * (longer ? 2 : 1);
            if (!longer) arrival = path_in_order(flow, arrival);
            path->count.reordered += longer;
        }
    }
    flow->index++;
    return arrival;
}

uint64_t network_ready_ns(const network_flow *flow)
{
    const network_path *path = flow->path;
    const uint64_t queue = path_ns(path->profile.queue_s);
    const uint64_t room = path->busy_ns > queue ? path->busy_ns - queue : 0;
    return flow->ready_ns > room ? flow->ready_ns : room;
}

uint64_t network_send_segment(network_flow *flow, uint64_t now_ns, size_t n_byte)
{
    network_path *path = flow->path;
    uint64_t end = path_transmit(path, now_ns, n_byte), arrival = NETWORK_LOST;
    double timeout_s = fmax(RIG_TIMEOUT_MIN_S, path->profile.round_trip_s);
    flow->ready_ns = now_ns;
    for (unsigned attempt = 0; attempt <= RIG_RETRIES && arrival == NETWORK_LOST; attempt++) {
        path->count.retransmissions += attempt > 0;
        if (!path_loses(flow, attempt, end)) {
            arrival = path_in_order(flow, end + path_delay_ns(flow));
        } else {
            const uint64_t wait = path_ns(timeout_s);
            end += wait, flow->ready_ns += wait;
            timeout_s = fmin(2 * timeout_s, RIG_TIMEOUT_MAX_S);
        }
    }
    path->count.given_up += arrival == NETWORK_LOST;
    flow->index++;
    return arrival;
}

pal_err network_queue_add(network_queue *queue, uint64_t arrival_ns, int to, const uint8_t *bytes, size_t n_byte)
{
    network_packet *packet = malloc(sizeof *packet + n_byte);
    if (!packet) return PAL_ERR_MEMORY;
    *packet = (network_packet){.arrival_ns = arrival_ns, .to = to, .n_byte = n_byte};
    if (n_byte) memcpy(packet->bytes, bytes, n_byte);
    /* nearly all are the last; one that overtakes looks for its place */
    network_packet **at = queue->first && queue->last->arrival_ns <= arrival_ns ? &queue->last->next : &queue->first;
    while (*at && (*at)->arrival_ns <= arrival_ns) at = &(*at)->next;
    packet->next = *at;
    if (!packet->next) queue->last = packet;
    *at = packet;
    queue->n_byte += n_byte;
    return PAL_ERR_OK;
}

uint64_t network_queue_next_ns(const network_queue *queue)
{
    return queue->first ? queue->first->arrival_ns : NETWORK_LOST;
}

void network_queue_remove_first(network_queue *queue)
{
    network_packet *packet = queue->first;
    queue->first = packet->next;
    queue->n_byte -= packet->n_byte;
    free(packet);
}

void network_queue_clear(network_queue *queue)
{
    while (queue->first) network_queue_remove_first(queue);
}
