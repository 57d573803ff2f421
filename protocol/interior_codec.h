/* INTERIOR: displacement and value of a field at the nodes inside one part, for slices and volumes
 * (protocol/README.md, "INTERIOR").
 *
 * Displacements are whole steps of q, values one byte between the least and the largest; both packed in one LZ4 block.
 * A message stands alone and is sent only to clients that asked with `"interior": true` in `subscribe_field`. Error of
 * a decoded displacement: q/2 per axis; of a value: half of (high - low) / 255; and float rounding. */
#ifndef PAL_PROTOCOL_INTERIOR_CODEC_H
#define PAL_PROTOCOL_INTERIOR_CODEC_H
#include "protocol/field_codec.h"

#define PAL_INTERIOR_HEAD_BYTES   44
#define PAL_INTERIOR_NODE_BYTES   7      /* of a node in the block */
#define PAL_INTERIOR_DISPLACEMENT 0x7FFF /* largest displacement in steps of q */

typedef struct pal_interior_head {
    uint16_t part;
    pal_wire_field field;
    uint32_t epoch; /* topology generation, as in FRAME */
    uint64_t sim_time_us;
    float low, high; /* values of the bytes 0 and 255, SI */
    float q_m;       /* step of displacements, above 0    */
    uint32_t n_node;
    uint32_t n_lz4; /* bytes of the block, the rest of the message */
} pal_interior_head;

size_t pal_interior_bound(uint32_t n_node); /* bytes that any message of n_node nodes fits in */

/* [any] one whole message into dst. head gives part, field, epoch, sim_time_us, n_node and the wanted q_m, which is
 * raised to what the largest displacement needs; low, high, q_m and n_lz4 are written into it. node [n_node][4]: x y z
 * of the displacement, m, and the value, in the order of the interior's asset, borrowed; work [7 n_node]: scratch. NAN:
 * a number is not finite; SPACE: cap is less than pal_interior_bound(n_node); COUNT, RANGE: no node or too many, no
 * such field, part or step */
int pal_interior_put(const float *node, pal_interior_head *head, uint8_t *work, uint8_t *dst, size_t cap,
                     size_t *n_byte);
/* [any] head of an untrusted message, lengths checked against n_byte */
int pal_interior_get_head(const uint8_t *bytes, size_t n_byte, pal_interior_head *out);
/* [any] decodes an untrusted message: move_m [n_node][3] m, level [n_node] (0: low, 255: high); n_node is what the
 * caller has room for, COUNT when the message has another number; work [7 n_node]: scratch. On failure the arrays may
 * be partly written, *head is not. */
int pal_interior_get(const uint8_t *bytes, size_t n_byte, uint32_t n_node, uint8_t *work, pal_interior_head *head,
                     float *move_m, uint8_t *level);
#endif
