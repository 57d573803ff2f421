/* mem://: peers inside the process, for tests. Nothing moves by itself: the test sends, pulls and turns the loop, so a
 * run is the same every time. A peer that is not pulled is a stalled client. Thread: [net], the test's. */
#ifndef PAL_NET_TRANSPORT_MEM_TRANSPORT_H
#define PAL_NET_TRANSPORT_MEM_TRANSPORT_H
#include "server/net/transport/transport.h"

typedef struct pal_mem_peer pal_mem_peer;

/* opened is called within; session "": the first. NULL: out of memory. Freed by pal_mem_leave or with the road. */
pal_mem_peer *pal_mem_connect(pal_transport *transport, const char *session);
void pal_mem_leave(pal_mem_peer *peer);
/* one message to the hub; longer ones than 4096 bytes drop the peer as ws does. A dropped peer says nothing. */
void pal_mem_send(pal_mem_peer *peer, const void *bytes, size_t n_byte, bool text);
/* next message of the hub or NULL; valid until the next call for this peer */
const pal_packet *pal_mem_receive(pal_mem_peer *peer);
/* what GET would give (assets); the caller drops the body */
void pal_mem_get(pal_transport *transport, const char *path, pal_reply *reply);
bool pal_mem_is_ready(const pal_mem_peer *peer); /* has the hub said since the last receive that something waits? */
int pal_mem_code(const pal_mem_peer *peer);      /* close code, 0: open */
const char *pal_mem_reason(const pal_mem_peer *peer);
#endif
