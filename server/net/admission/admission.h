/* Who may come in, and as what: tickets, what is used up of them, and bans (protocol/README.md, "Tickets").
 *
 * A ticket admits as many members as it says. A member whose connection ends may return with it for PAL_RETURN_NS,
 * also when it has expired meanwhile, and counts once. A server signs tickets of its own at its start: with the last
 * key of its key file, so that they hold after a restart too, or with a key that nobody else has. The key file is read
 * again when it has changed. Without a ticket a client is a viewer, or what it asks to be when the server is open.
 * Thread: [net]. */
#ifndef PAL_NET_ADMISSION_H
#define PAL_NET_ADMISSION_H
#include "protocol/ticket.h"
#include "server/base/err.h"

typedef struct pal_admission pal_admission;

/* what a connection may become */
typedef struct pal_grant {
    pal_wire_role role; /* the highest */
    int tool;           /* the only one; PAL_WIRE_TOOL_ANY: any, PAL_WIRE_TOOL_NONE: none */
    bool has_ticket;
    pal_ticket ticket;
    char address[46]; /* of the peer; "": unknown */
} pal_grant;

/* key_file: NULL: none. REFUSED names file and reason. [load] */
pal_err pal_admission_create(const char *key_file, bool open, pal_diagnostic *diag, pal_admission **out);
void pal_admission_destroy(pal_admission *admission);
/* a ticket of this server for any session and tool, as long as it runs. [load] */
void pal_admission_start_ticket(const pal_admission *admission, pal_wire_role role, char text[PAL_TICKET_TEXT]);

/* what the bearer of a ticket ("": none) may be in a session; unix_s: now. NULL: *grant is filled; else why not */
const char *pal_admission_check(pal_admission *admission, const char *text, const char *session, const char *address,
                                uint64_t unix_s, uint64_t now_ns, pal_grant *grant);
/* a member joins with its grant, and leaves. FULL: the ticket's members are all here, or have been; now_ns: of the loop
 */
pal_err pal_admission_enter(pal_admission *admission, const pal_grant *grant, uint64_t now_ns);
void pal_admission_leave(pal_admission *admission, const pal_grant *grant, uint64_t now_ns);
/* A ticket with the same rights as that of a member whom this server sends elsewhere: it admits for PAL_RETURN_NS more,
 * as if the member had lost its connection here. "": none is needed, as without an expiry, or none can be signed */
void pal_admission_renew(const pal_admission *admission, const pal_grant *grant, uint64_t unix_s,
                         char text[PAL_TICKET_TEXT]);
/* bans the ticket if it was made for certain members, else the address from which the member came */
void pal_admission_ban(pal_admission *admission, const pal_grant *grant);
#endif
