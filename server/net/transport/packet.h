/* Reference-counted bytes of one message, encoded once and shared by every peer that has yet to send it.
 *
 * A packet is constant once it is shared. The headroom before its bytes is writable, for a transport's own header
 * (websocket framing); hence only one network thread sends a packet. Any thread may create, hold and drop packets; the
 * last drop frees. Thread: [any]. */
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
    bool text;      /* control message; else binary */
    uint8_t *bytes; /* [n_byte], after a writable headroom of PAL_PACKET_HEADROOM bytes */
} pal_packet;

/* Copies; the caller owns one reference. bytes NULL: zeroed, to be filled before it is shared. NULL: out of memory. */
pal_packet *pal_packet_create(const void *bytes, size_t n_byte, bool text);
pal_packet *pal_packet_hold(pal_packet *packet); /* adds a reference; NULL is fine */
void pal_packet_drop(pal_packet *packet);        /* removes a reference, the last one frees; NULL is fine */
/* drops *owner and moves `taken` there, which may be NULL */
void pal_packet_replace(pal_packet **owner, pal_packet *taken);
size_t pal_packet_total(void); /* bytes in all live packets, for metrics and tests */
#endif
