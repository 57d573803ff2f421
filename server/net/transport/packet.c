/* Packets are one heap block each: head, room for a transport's header, bytes. */
#include "server/net/transport/packet.h"

#include <stdlib.h>
#include <string.h>

static _Atomic size_t total; /* of all servers of the process */

pal_packet *pal_packet_create(const void *bytes, size_t n_byte, bool text)
{
    if (n_byte > SIZE_MAX - sizeof(pal_packet) - PAL_PACKET_HEADROOM) return NULL;
    pal_packet *p = malloc(sizeof *p + PAL_PACKET_HEADROOM + n_byte);
    if (!p) return NULL;
    p->n_byte = n_byte;
    atomic_init(&p->n_user, 1);
    p->text = text;
    p->bytes = (uint8_t *)(p + 1) + PAL_PACKET_HEADROOM;
    if (bytes)
        memcpy(p->bytes, bytes, n_byte);
    else
        memset(p->bytes, 0, n_byte);
    total += n_byte;
    return p;
}

pal_packet *pal_packet_hold(pal_packet *packet)
{
    if (packet) packet->n_user++;
    return packet;
}

void pal_packet_drop(pal_packet *packet)
{
    if (!packet || --packet->n_user > 0) return;
    total -= packet->n_byte;
    free(packet);
}

void pal_packet_replace(pal_packet **owner, pal_packet *taken)
{
    pal_packet_drop(*owner);
    *owner = taken;
}

size_t pal_packet_total(void)
{
    return total;
}
