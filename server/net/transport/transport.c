/* What every road shares: how a peer is marked for closing. */
#include "server/net/transport/transport.h"

#include <stdarg.h>
#include <stdio.h>

void pal_peer_drop(pal_peer *peer, int code, const char *format, ...)
{
    if (peer->drop_code) return;
    va_list args;
    va_start(args, format);
    vsnprintf(peer->drop_reason, sizeof peer->drop_reason, format, args);
    va_end(args);
    peer->drop_code = code;
    peer->ops->drop(peer);
}
