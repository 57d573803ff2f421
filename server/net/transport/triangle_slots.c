/* Every entry is compared when the revision changes (0.1 ms for 200,000). The uses of each vertex are counted
 * incrementally, so that the flags of hidden vertices need no extra pass. */
#include "server/net/transport/triangle_slots.h"

#include "protocol/topology_delta_codec.h"
#include "server/base/log.h"

#include <stdlib.h>
#include <string.h>

/* an empty entry uses no vertex */
static void use(pal_triangle_slots *s, const uint32_t tri[3], bool begin)
{
    if (!(tri[0] | tri[1] | tri[2])) return;
    for (int c = 0; c < 3; c++) {
        s->n_use[tri[c]] += begin ? 1 : UINT32_MAX;
        s->hidden[tri[c]] = s->n_use[tri[c]] == 0;
    }
}

static void valid(const pal_triangle_slots *s, const int32_t from[3], uint32_t tri[3])
{
    bool good = true;
    for (int c = 0; c < 3; c++) good &= (uint32_t)from[c] < s->n_vertex;
    for (int c = 0; c < 3; c++) tri[c] = good ? (uint32_t)from[c] : 0;
}

pal_err pal_triangle_slots_make(int part, const char *name, uint32_t epoch, const int32_t *tri, uint32_t n_slot,
                                uint32_t n_vertex, pal_diagnostic *diag, pal_triangle_slots **out)
{
    if (n_slot > PAL_TRIANGLE_SLOT_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET,
                                  "part %s: %u triangles on its finest level, %u of a body that adapts can be streamed",
                                  name, n_slot, PAL_TRIANGLE_SLOT_MAX);
    pal_triangle_slots *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    s->part = (uint16_t)part;
    s->epoch = epoch;
    s->n_slot = n_slot;
    s->n_vertex = n_vertex;
    s->revision = UINT64_MAX; /* the simulation may have changed the table since: compare the first frame */
    s->tri = calloc(3 * (size_t)s->n_slot + 1, sizeof *s->tri);
    s->written = calloc((size_t)s->n_slot + 1, sizeof *s->written);
    s->n_use = calloc((size_t)s->n_vertex + 1, sizeof *s->n_use);
    s->hidden = malloc((size_t)s->n_vertex + 1);
    if (!s->tri || !s->written || !s->n_use || !s->hidden) return pal_triangle_slots_free(s), PAL_ERR_MEMORY;
    memset(s->hidden, 1, s->n_vertex);
    for (uint32_t i = 0; i < s->n_slot; i++) {
        valid(s, tri + 3 * (size_t)i, s->tri + 3 * (size_t)i);
        use(s, s->tri + 3 * (size_t)i, true);
    }
    *out = s;
    return PAL_ERR_OK;
}

static void forget(pal_triangle_slots *s)
{
    for (int i = 0; i < PAL_TRIANGLE_DELTAS_KEPT; i++) pal_packet_replace(&s->made[i].packet, NULL);
}

void pal_triangle_slots_free(pal_triangle_slots *slots)
{
    if (!slots) return;
    forget(slots);
    free(slots->tri);
    free(slots->written);
    free(slots->n_use);
    free(slots->hidden);
    free(slots);
}

bool pal_triangle_slots_update(pal_triangle_slots *slots, const int32_t *slot, uint64_t revision)
{
    bool changed = false;
    if (revision == slots->revision) return false;
    slots->revision = revision;
    for (uint32_t i = 0; i < slots->n_slot; i++) {
        uint32_t tri[3], *mine = slots->tri + 3 * (size_t)i;
        valid(slots, slot + 3 * (size_t)i, tri);
        if (!memcmp(tri, mine, sizeof tri)) continue;
        use(slots, mine, false);
        use(slots, tri, true);
        memcpy(mine, tri, sizeof tri);
        slots->written[i] = slots->change + 1;
        changed = true;
    }
    if (!changed) return false;
    slots->change++;
    slots->changed_revision = revision;
    forget(slots);
    return true;
}

/* encodes the n entries that changed after `from`; one allocation for entries, planes and the message */
static pal_packet *encode(pal_triangle_slots *s, uint32_t from, uint32_t n)
{
    size_t n_index = (size_t)n * sizeof(uint32_t), n_work = PAL_TOPOLOGY_DELTA_WORK_BYTES(n),
           cap = pal_topology_delta_bound(n), n_byte;
    uint8_t *room = malloc(n_index + n_work + cap), *work = room + n_index, *dst = work + n_work;
    if (!room) return NULL;
    uint32_t *slot = (uint32_t *)(void *)room, at = 0;
    for (uint32_t i = 0; i < s->n_slot; i++)
        if (s->written[i] > from) slot[at++] = i;
    pal_topology_delta_head head = {.part = s->part,
                                    .epoch = s->epoch,
                                    .n_changed = n,
                                    .revision = s->changed_revision & (((uint64_t)1 << 53) - 1)};
    int refusal = pal_topology_delta_put(slot, s->tri, &head, work, dst, cap, &n_byte);
    if (refusal) pal_log(PAL_LOG_ERROR, "patch", "part %d: %s", s->part, pal_refusal_text(refusal));
    pal_packet *packet = refusal ? NULL : pal_packet_create(dst, n_byte, false);
    free(room);
    return packet;
}

pal_packet *pal_triangle_slots_delta(pal_triangle_slots *slots, uint32_t from)
{
    uint32_t n = 0;
    for (int i = 0; i < PAL_TRIANGLE_DELTAS_KEPT; i++)
        if (slots->made[i].packet && slots->made[i].from == from) return pal_packet_hold(slots->made[i].packet);
    for (uint32_t i = 0; i < slots->n_slot; i++) n += slots->written[i] > from;
    pal_packet *packet = n ? encode(slots, from, n) : NULL;
    if (!packet) return NULL;
    slots->n_delta++;
    slots->n_byte += packet->n_byte;
    slots->made[slots->next].from = from;
    pal_packet_replace(&slots->made[slots->next].packet, packet);
    slots->next = (slots->next + 1) % PAL_TRIANGLE_DELTAS_KEPT;
    return pal_packet_hold(packet);
}
