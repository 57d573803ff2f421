/* Counted encoded bytes: one message, encoded once, held by everybody who still has to send it.
 *
 * A packet is constant once it has been handed on. Before its bytes lies room that a road may use for its own header
 * (websocket framing), hence only one network thread sends a packet. Any thread may create, hold and drop: the last one
 * frees. Thread: [any]. */
#ifndef PAL_NET_TRANSPORT_PACKET_H
#define PAL_NET_TRANSPORT_PACKET_H
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { PAL_PACKET_HEADROOM = 32 };

typedef struct pal_packet {
    size_t n_byte;
    atomic_int n_user;
    bool text;      /* control message, else binary */
    uint8_t *bytes; /* [n_byte], writable room of PAL_PACKET_HEADROOM bytes before it */
} pal_packet;

/* copies; the caller holds it once. bytes may be NULL: zeroed, to be filled before it is handed on. NULL: out of
 * memory */
pal_packet *pal_packet_create(const void *bytes, size_t n_byte, bool text);
pal_packet *pal_packet_hold(pal_packet *packet); /* one more user; NULL is fine */
void pal_packet_drop(pal_packet *packet);        /* one user less, the last one frees; NULL is fine */
/* *place drops what it held and takes the packet (which may be NULL) */
void pal_packet_replace(pal_packet **place, pal_packet *taken);
size_t pal_packet_total(void); /* bytes in all living packets, for metrics and tests */
#endif
