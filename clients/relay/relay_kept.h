/* What a relay keeps of its session: the newest message of each kind, as it came, and the assets that it names.
 *
 * Messages come from upstream and are borrowed for the call. A newer one replaces an older one, so nothing grows. Two
 * threads meet here: [up] takes messages in, [net] reads; a lock is between them, held for copies of pointers, and for
 * the changes of triangles that a cycle brings.
 * A number that grows with every change tells a reader what is new to it. */
#ifndef PAL_RELAY_KEPT_H
#define PAL_RELAY_KEPT_H
#include "clients/relay/relay_triangles.h"
#include "clients/relay/relay_values.h"
#include "protocol/control.h"
#include "protocol/wire.h"
#include "server/base/err.h"
#include "server/net/transport/packet.h"

#include <pthread.h>

enum { PAL_RELAY_ORDERS = 16, PAL_RELAY_PATHS = PAL_WIRE_PART_MAX * (3 + PAL_WIRE_IMAGE_MAX) };

/* kinds of text messages that are kept, in the order in which a newcomer gets them */
typedef enum pal_relay_kind {
    PAL_RELAY_HELLO,
    PAL_RELAY_TOPOLOGY,
    PAL_RELAY_MEMBERS,
    PAL_RELAY_STATUS,
    PAL_RELAY_KINDS
} pal_relay_kind;

typedef struct pal_relay_message {
    pal_packet *packet; /* NULL: none */
    uint64_t number;    /* when it came: grows over all messages; 0: none */
} pal_relay_message;

/* the epochs and assets of hello or topology */
typedef struct pal_relay_names {
    uint32_t n_part, epoch[PAL_WIRE_PART_MAX];
    uint32_t fields[PAL_WIRE_PART_MAX]; /* of each part, bits 1 << pal_wire_field */
    int n_path;
    char path[PAL_RELAY_PATHS][PAL_WIRE_NAME_BYTES];
} pal_relay_names;

typedef struct pal_relay_asset {
    char path[PAL_WIRE_NAME_BYTES];
    pal_packet *bytes;
    struct pal_relay_asset *next;
} pal_relay_asset;

typedef struct pal_relay_kept {
    pthread_mutex_t lock; /* of all that follows, but what is marked [up] */
    bool up;              /* upstream answers */
    uint32_t run;         /* grows when viewers have to begin anew */
    uint64_t number;      /* of the last change */
    double frame_rate_hz;
    char session[PAL_WIRE_NAME_BYTES], title[PAL_WIRE_TEXT_BYTES];
    pal_relay_message text[PAL_RELAY_KINDS];
    pal_relay_message frame[PAL_WIRE_PART_MAX]; /* newest of closed cycles */
    uint32_t n_part, fields[PAL_WIRE_PART_MAX]; /* parts as shown, and the fields of each */
    uint32_t epoch[PAL_WIRE_PART_MAX];          /* of what is shown */
    pal_relay_values values[PAL_WIRE_PART_MAX];
    pal_relay_message tools;
    pal_relay_triangles triangles[PAL_WIRE_PART_MAX]; /* of these frames; it says what is [up] */
    uint32_t cycle;                                   /* of tools */
    pal_packet *order[PAL_RELAY_ORDERS];              /* ring buffer */
    uint64_t n_order;
    pal_relay_asset *asset; /* list */
    size_t asset_bytes;     /* of them all */
    /* [up] */
    uint32_t started;                      /* of the run */
    pal_packet *coming[PAL_WIRE_PART_MAX]; /* newest FRAME of a cycle that is open, or of an epoch to come */
    uint32_t coming_epoch[PAL_WIRE_PART_MAX], coming_seq[PAL_WIRE_PART_MAX]; /* of these */
    uint32_t shown_seq[PAL_WIRE_PART_MAX];                                   /* of frame; 0: none */
    pal_packet *announced[PAL_RELAY_MEMBERS];   /* hello and topology until their assets are here; NULL: shown */
    pal_relay_names names[PAL_RELAY_MEMBERS];   /* of the newest of both */
    pal_relay_names before;                     /* of the topology before */
    void (*want)(void *user, const char *path); /* fetches an asset */
    void *want_user;
    void (*changed)(void *user); /* wakes [net] */
    void *changed_user;
} pal_relay_kept;

/* changed: there is news, called [up]. [load] */
void pal_relay_kept_init(pal_relay_kept *kept, void (*changed)(void *user), void *user);
/* want: an asset is to be fetched and given to pal_relay_take_asset, called [up]. Before the first message. [load] */
void pal_relay_kept_fetch_by(pal_relay_kept *kept, void (*want)(void *user, const char *path), void *user);
void pal_relay_kept_free(pal_relay_kept *kept); /* [load] */

/* a text message of upstream, decoded and as it came; what viewers do not get is ignored. [up] */
void pal_relay_take_text(pal_relay_kept *kept, const pal_control *decoded, const char *text, size_t n_byte);
/* a binary message of upstream with a valid head; what viewers get of it is kept. [up] */
void pal_relay_take_message(pal_relay_kept *kept, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte);
/* REFUSED: its hash is not the name in its path, or nothing names it now; FULL: too much is kept; MEMORY. [up] */
pal_err pal_relay_take_asset(pal_relay_kept *kept, const char *path, const uint8_t *bytes, size_t n_byte);
void pal_relay_want_missing(pal_relay_kept *kept); /* asks once more for every asset that is missing. [up] */
void pal_relay_lost(pal_relay_kept *kept);         /* upstream does not answer. [up] */

/* part of which viewers want something else than upstream was asked for, from part `first` on in a circle, and what
 * they want; from then on it counts as asked for. PAL_WIRE_PART_MAX: none. [up] */
uint32_t pal_relay_next_request(pal_relay_kept *kept, uint32_t first, pal_relay_view *wanted);
void pal_relay_forget_requests(pal_relay_kept *kept); /* upstream has been asked for nothing: a new connection. [up] */

/* the caller's reference to an asset; NULL: unknown. [any] */
pal_packet *pal_relay_find_asset(pal_relay_kept *kept, const char *path);
#endif
