/* Values of one part, on its skin (FIELD) and inside it (INTERIOR): what viewers want of them, what upstream is asked
 * for, which is the union of that, and the newest of each. Each function is called under the caller's lock. */
#ifndef PAL_RELAY_VALUES_H
#define PAL_RELAY_VALUES_H
#include "protocol/field_codec.h"
#include "server/net/transport/packet.h"

/* what somebody wants of a part */
typedef struct pal_relay_view {
    uint32_t fields;       /* bits 1 << pal_wire_field */
    bool interior, energy; /* interior: of these fields; energy: in the status */
} pal_relay_view;

typedef struct pal_relay_value {
    pal_packet *packet; /* NULL: none */
    uint64_t number;    /* when it came, or its epoch was shown: grows over all messages */
    uint32_t epoch;
} pal_relay_value;

typedef struct pal_relay_values {
    int n_field[PAL_WIRE_FIELD_COUNT], n_interior, n_energy; /* viewers who want it */
    pal_relay_view asked;                                    /* of upstream */
    pal_relay_value field[PAL_WIRE_FIELD_COUNT], interior[PAL_WIRE_FIELD_COUNT];
} pal_relay_values;

/* a viewer wants something else */
void pal_relay_values_change(pal_relay_values *of, const pal_relay_view *before, const pal_relay_view *now);
pal_relay_view pal_relay_values_wanted(const pal_relay_values *of); /* by any viewer */
/* upstream is asked for this: what it does not contain is dropped */
void pal_relay_values_ask(pal_relay_values *of, pal_relay_view asked);
/* takes the packet; values that upstream is no longer asked for are dropped */
void pal_relay_values_take(pal_relay_values *of, bool interior, pal_wire_field field, pal_relay_value value);
/* values that came before their epoch was shown become new now: *number is that of the last message */
void pal_relay_values_show_epoch(pal_relay_values *of, uint32_t epoch, uint64_t *number);
/* the oldest of this epoch that a viewer lacks, who has all before and including the number sent; NULL: none */
const pal_relay_value *pal_relay_values_lacking(const pal_relay_values *of, const pal_relay_view *view, uint32_t epoch,
                                                uint64_t sent);
#endif
