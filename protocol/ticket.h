/* Tickets: what a client may be, signed by who admits it (protocol/README.md, "Tickets").
 *
 * A ticket is 30 bytes and an HMAC-SHA256 over them, as base64url text of 83 characters. A client offers it as the
 * subprotocol "ticket.TEXT" behind the name of the protocol, so that it stands in no address that somebody logs. Who
 * issues and who verifies share a key of 32 bytes; key ids let keys be replaced one by one. Thread: any. */
#ifndef PAL_PROTOCOL_TICKET_H
#define PAL_PROTOCOL_TICKET_H
#include "protocol/control.h"

#define PAL_TICKET_PREFIX "ticket."
enum {
    PAL_TICKET_BYTES = 30,
    PAL_TICKET_KEY_BYTES = 32,
    PAL_TICKET_TEXT = PAL_WIRE_TICKET_BYTES, /* characters of a ticket, and the zero */
};

typedef struct pal_ticket {
    uint8_t key_id;
    pal_wire_role role; /* the highest that the bearer may have */
    int tool;           /* the only tool that it may hold; PAL_WIRE_TOOL_ANY: any, PAL_WIRE_TOOL_NONE: none */
    uint16_t uses;      /* how many members it admits; 0: any number */
    uint64_t session;   /* pal_ticket_session of the only session; 0: any */
    uint32_t user;      /* of the issuer's own numbering; 0: nobody in particular */
    uint32_t expires_s; /* Unix time after which it admits nobody; 0: never */
    uint64_t nonce;     /* tells tickets apart */
} pal_ticket;

typedef struct pal_ticket_key {
    uint8_t id;
    uint8_t bytes[PAL_TICKET_KEY_BYTES];
} pal_ticket_key;

/* first 8 bytes of the SHA-256 of a session's name, never 0; 0: the name is empty */
uint64_t pal_ticket_session(const char *name);
/* signs a ticket; its key_id becomes the key's. false: a field is out of range */
bool pal_ticket_put(const pal_ticket *ticket, const pal_ticket_key *key, char text[PAL_TICKET_TEXT]);
/* reads untrusted text. true: signed by the one of n keys that it names, and every field is in range. The comparison
 * takes the same time for every wrong signature */
bool pal_ticket_get(const char *text, const pal_ticket_key *key, int n_key, pal_ticket *ticket);
#endif
