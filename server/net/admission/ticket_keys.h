/* Key file of tickets: one key a line, "ID HEX", with ID from 1 to 255 and 64 hexadecimal digits; "#" begins a comment.
 * Nobody but its owner may read or write it. Tickets are signed with the last key; those signed with any key that is in
 * the file are accepted. To replace a key, add one, and remove the old one when its tickets have expired. */
#ifndef PAL_NET_TICKET_KEYS_H
#define PAL_NET_TICKET_KEYS_H
#include "protocol/ticket.h"
#include "server/base/err.h"

enum { PAL_TICKET_KEYS_MAX = 16 };

typedef struct pal_ticket_keys {
    int n;
    pal_ticket_key key[PAL_TICKET_KEYS_MAX];
} pal_ticket_keys;

/* REFUSED names file, line and reason; also a file that others may read. Thread: any */
pal_err pal_ticket_keys_read(const char *path, pal_ticket_keys *keys, pal_diagnostic *diag);
/* appends a random key to the file, which is made when it is not there; *id: its id. REFUSED, IO. Thread: any */
pal_err pal_ticket_keys_add(const char *path, int *id, pal_diagnostic *diag);
/* fills bytes from the system's random generator; IO. Thread: any */
pal_err pal_random_bytes(void *bytes, size_t n_byte);
#endif
