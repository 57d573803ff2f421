/* The keys of a file (server/base/key_file.h) as they sign tickets. */
#ifndef PAL_NET_TICKET_KEYS_H
#define PAL_NET_TICKET_KEYS_H
#include "protocol/ticket.h"
#include "server/base/key_file.h"

typedef struct pal_ticket_keys {
    int n;
    pal_ticket_key key[PAL_KEYS_MAX];
} pal_ticket_keys;

/* errors of pal_key_file_read. Thread: any */
pal_err pal_ticket_keys_read(const char *path, pal_ticket_keys *keys, pal_diagnostic *diag);
#endif
