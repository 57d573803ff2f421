/* mem://: peers inside the process, for tests. The test sends, receives and advances the loop itself, so every run is
 * identical. A peer that does not receive is a stalled client. Thread: [net], the test's. */
#ifndef PAL_NET_TRANSPORT_MEM_TRANSPORT_H
#define PAL_NET_TRANSPORT_MEM_TRANSPORT_H
#include "server/net/transport/transport.h"

typedef struct pal_mem_peer pal_mem_peer;

/* calls opened before it returns; session "": the first. NULL: out of memory. pal_mem_leave or closing the transport
 * frees the peer. */
pal_mem_peer *pal_mem_connect(pal_transport *transport, const char *session);
void pal_mem_leave(pal_mem_peer *peer);
/* sends one message to the hub; more than 4096 bytes drop the peer, as in ws. A dropped peer sends nothing. */
void pal_mem_send(pal_mem_peer *peer, const void *bytes, size_t n_byte, bool text);
/* next message from the hub or NULL; valid until the next call for this peer */
const pal_packet *pal_mem_receive(pal_mem_peer *peer);
/* response to GET (assets); the caller drops the body */
void pal_mem_get(pal_transport *transport, const char *path, pal_reply *reply);
bool pal_mem_is_ready(const pal_mem_peer *peer); /* has the hub signalled a waiting message since the last receive? */
int pal_mem_code(const pal_mem_peer *peer);      /* websocket close code; 0: open */
const char *pal_mem_reason(const pal_mem_peer *peer);
#endif
