/* TOPOLOGY_DELTA: the triangles of a part that adapts, as far as they changed (protocol/README.md, "TOPOLOGY_DELTA").
 *
 * Such a part has a table of slots, one triangle or 0 0 0 (empty) each; the asset holds the table at load. A message
 * names changed slots and what stands in them now. It does not stand alone: the first to a client is relative to the
 * asset, every later one to the one before. It goes only to clients whose `join` said that they take topology deltas.
 * Thread: any; nothing is allocated. */
#ifndef PAL_PROTOCOL_TOPOLOGY_DELTA_CODEC_H
#define PAL_PROTOCOL_TOPOLOGY_DELTA_CODEC_H
#include "protocol/wire.h"

#include <stddef.h>
#include <stdint.h>

#define PAL_TOPOLOGY_DELTA_HEAD_BYTES    32
#define PAL_TRIANGLE_SLOT_MAX            (1u << 22)         /* slots of a part that adapts */
#define PAL_TOPOLOGY_DELTA_WORK_BYTES(n) (16 * (size_t)(n)) /* scratch for n changed slots */

typedef struct pal_topology_delta_head {
    uint16_t part;
    uint32_t epoch;     /* asset whose slots and vertices these are, as in FRAME   */
    uint32_t n_changed; /* slots, >= 1                                              */
    uint64_t revision;  /* of the table that results, below 2^53; grows             */
    uint32_t n_lz4;     /* bytes of the block, the rest of the message              */
} pal_topology_delta_head;

size_t pal_topology_delta_bound(uint32_t n_changed); /* bytes that any message of so many slots fits in */

/* one whole message into dst. slot [n_changed] ascending, table [..][3] the whole table as it is now, both borrowed;
 * head gives part, epoch, n_changed, revision, n_lz4 is written into it; work
 * [PAL_TOPOLOGY_DELTA_WORK_BYTES(n_changed)]: scratch. COUNT: no slot or too many; RANGE: part, revision, slots that do
 * not ascend, a corner no part can have; SPACE: cap is less than pal_topology_delta_bound(n_changed) */
int pal_topology_delta_put(const uint32_t *slot, const uint32_t *table, pal_topology_delta_head *head, uint8_t *work,
                           uint8_t *dst, size_t cap, size_t *n_byte);
/* head of an untrusted message, lengths checked against n_byte */
int pal_topology_delta_get_head(const uint8_t *bytes, size_t n_byte, pal_topology_delta_head *out);
/* takes an untrusted message into table [n_slot][3], corners of n_vertex vertices; work
 * [PAL_TOPOLOGY_DELTA_WORK_BYTES(n_slot)]: scratch. The caller compares part and epoch before. On refusal table and
 * *head are as before. COUNT: more slots than the table has; LZ4; RANGE: slots that do not ascend or are not of the
 * table, a corner that is no vertex */
int pal_topology_delta_get(const uint8_t *bytes, size_t n_byte, uint32_t n_slot, uint32_t n_vertex, uint8_t *work,
                           pal_topology_delta_head *head, uint32_t *table);
#endif
