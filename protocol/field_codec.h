/* FIELD: one number per shown vertex of one part, for colouring: displacement, stress ... (protocol/README.md,
 * "FIELD").
 *
 * Values are quantised to one byte between the least and the largest of them and packed in one LZ4 block. A message
 * stands alone and is sent only to clients that asked with `subscribe_field`. Error of a decoded value: half of (high -
 * low) / 255 and float rounding. */
#ifndef PAL_PROTOCOL_FIELD_CODEC_H
#define PAL_PROTOCOL_FIELD_CODEC_H
#include "protocol/control.h"
#include "protocol/wire.h"

#include <stddef.h>
#include <stdint.h>

#define PAL_FIELD_HEAD_BYTES 40

/* what is shown; numbers on the wire */
typedef enum pal_wire_field {
    PAL_WIRE_FIELD_NONE, /* never in a message */
    PAL_WIRE_FIELD_DISPLACEMENT_M,
    PAL_WIRE_FIELD_VON_MISES_PA,
    PAL_WIRE_FIELD_ENERGY_J_M3,
    PAL_WIRE_FIELD_STIFFNESS_J,
    PAL_WIRE_FIELD_STRAIN,
    PAL_WIRE_FIELD_DISTORTION,
    PAL_WIRE_FIELD_YOUNG_PA,
    PAL_WIRE_FIELD_DENSITY_KG_M3,
    PAL_WIRE_FIELD_DAMPING_1_S,
    PAL_WIRE_FIELD_COUNT
} pal_wire_field;
/* field of a name, as in `subscribe_field` and in parts: "none", "displacement", "von_mises", "energy", "stiffness",
 * "strain", "distortion", "young", "density", "damping"; COUNT: unknown */
pal_wire_field pal_wire_field_find(const char *name);
/* the fields that `subscribe_field` names, with one space between two of them, as bits 1 << field; "none" is 0. false:
 * a name is unknown */
bool pal_wire_field_get_set(const char *names, uint32_t *set);
void pal_wire_field_put_set(uint32_t set, char names[PAL_WIRE_FIELDS_BYTES]); /* the inverse */

typedef struct pal_field_head {
    uint16_t part;
    pal_wire_field field;
    uint32_t epoch; /* topology generation, as in FRAME   */
    uint64_t sim_time_us;
    float low, high; /* values of the bytes 0 and 255, SI */
    uint32_t n_vertex;
    uint32_t n_lz4; /* bytes of the block, the rest of the message */
} pal_field_head;

size_t pal_field_bound(uint32_t n_vertex); /* bytes that any message of n_vertex vertices fits in */

/* [any] one whole message into dst. head gives part, field, epoch, sim_time_us, n_vertex; low, high and n_lz4 are
 * written into it. value [n_vertex] in the asset's vertex order, borrowed; work [n_vertex]: scratch. NAN: a value is
 * not finite; SPACE: cap is less than pal_field_bound(n_vertex); COUNT, RANGE: no vertex or too many, no such field or
 * part */
int pal_field_put(const float *value, pal_field_head *head, uint8_t *work, uint8_t *dst, size_t cap, size_t *n_byte);
/* [any] head of an untrusted message, lengths checked against n_byte */
int pal_field_get_head(const uint8_t *bytes, size_t n_byte, pal_field_head *out);
/* [any] decodes an untrusted message into level [n_vertex] (0: low, 255: high); n_vertex is what the caller has room
 * for, COUNT when the message has another number. On failure level may be partly written, *head is not. */
int pal_field_get(const uint8_t *bytes, size_t n_byte, uint32_t n_vertex, pal_field_head *head, uint8_t *level);
static inline double pal_field_value(const pal_field_head *head, uint8_t level)
{
    return (double)head->low + ((double)head->high - (double)head->low) * level / 255;
}
#endif
