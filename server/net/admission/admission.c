#include "server/net/admission/admission.h"

#include "server/base/log.h"
#include "server/net/admission/ticket_keys.h"
#include "server/net/admission/tuning.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { USED_MAX = 4096, BANNED_MAX = 256, ADDRESS = 46 };

/* a ticket that has admitted somebody */
typedef struct used_ticket {
    uint64_t nonce;
    uint32_t expires_s;
    int n_admitted, n_here; /* members in all, and of them now */
    uint64_t left_ns;       /* when the last one left */
    bool banned;
} used_ticket;

struct pal_admission {
    bool open;
    pal_ticket_key start;
    uint64_t start_nonce, unix_s; /* unix_s: of the last check */
    char *key_file;
    struct timespec key_time; /* when the file was written that was read */
    pal_ticket_keys keys;
    int n_used, n_banned;
    used_ticket used[USED_MAX];
    char banned[BANNED_MAX][ADDRESS]; /* ring buffer of addresses */
};

static pal_err read_keys(pal_admission *a, pal_diagnostic *diag)
{
    struct stat info;
    if (stat(a->key_file, &info) == 0) a->key_time = info.st_mtim;
    return pal_ticket_keys_read(a->key_file, &a->keys, diag);
}

/* a key file that cannot be read any more leaves the keys as they were */
static void follow_key_file(pal_admission *a)
{
    struct stat info;
    pal_diagnostic diag = {""};
    if (!a->key_file || stat(a->key_file, &info) || !memcmp(&info.st_mtim, &a->key_time, sizeof info.st_mtim)) return;
    if (read_keys(a, &diag))
        pal_log(PAL_LOG_ERROR, "ticket", "%s", diag.text);
    else
        pal_log(PAL_LOG_INFO, "ticket", "%s was read again: %d keys", a->key_file, a->keys.n);
}

pal_err pal_admission_create(const char *key_file, bool open, pal_diagnostic *diag, pal_admission **out)
{
    pal_admission *a = calloc(1, sizeof *a);
    pal_err err = PAL_ERR_OK;
    if (!a) return PAL_ERR_MEMORY;
    a->open = open;
    if (key_file && key_file[0]) {
        a->key_file = strdup(key_file);
        err = a->key_file ? read_keys(a, diag) : PAL_ERR_MEMORY;
    }
    if (!err) err = pal_random_bytes(a->start.bytes, sizeof a->start.bytes);
    if (!err) err = pal_random_bytes(&a->start_nonce, sizeof a->start_nonce);
    if (err) return pal_admission_destroy(a), err;
    *out = a;
    return PAL_ERR_OK;
}

void pal_admission_destroy(pal_admission *a)
{
    if (!a) return;
    free(a->key_file);
    free(a);
}

void pal_admission_start_ticket(const pal_admission *a, pal_wire_role role, char text[PAL_TICKET_TEXT])
{
    const pal_ticket ticket = {.role = role, .tool = PAL_WIRE_TOOL_ANY, .nonce = a->start_nonce};
    const pal_ticket_key *key = a->keys.n ? &a->keys.key[a->keys.n - 1] : &a->start;
    if (!pal_ticket_put(&ticket, key, text)) text[0] = 0;
}

/* does it matter who has used it? */
static bool is_counted(const pal_ticket *t)
{
    return t->key_id != 0 && (t->uses > 0 || t->expires_s > 0 || t->user > 0);
}

static used_ticket *find_used(pal_admission *a, const pal_ticket *t)
{
    for (int k = 0; is_counted(t) && k < a->n_used; k++)
        if (a->used[k].nonce == t->nonce) return &a->used[k];
    return NULL;
}

/* somebody who was in with it is missing and may return */
static bool may_return(const used_ticket *used, uint64_t now_ns)
{
    return used && used->n_here < used->n_admitted && now_ns - used->left_ns < PAL_RETURN_NS;
}

static bool is_banned(const pal_admission *a, const char *address)
{
    for (int k = 0; address[0] && k < BANNED_MAX; k++)
        if (!strcmp(a->banned[k], address)) return true;
    return false;
}

const char *pal_admission_check(pal_admission *a, const char *text, const char *session, const char *address,
                                uint64_t unix_s, uint64_t now_ns, pal_grant *grant)
{
    *grant = (pal_grant){.role = a->open ? PAL_WIRE_ROLE_INSTRUCTOR : PAL_WIRE_ROLE_VIEWER,
                         .tool = a->open ? PAL_WIRE_TOOL_ANY : PAL_WIRE_TOOL_NONE};
    a->unix_s = unix_s;
    strncpy(grant->address, address, sizeof grant->address - 1);
    if (text[0]) {
        pal_ticket *t = &grant->ticket;
        follow_key_file(a);
        if (!pal_ticket_get(text, &a->start, 1, t) && !pal_ticket_get(text, a->keys.key, a->keys.n, t))
            return "this ticket is not one of this server";
        const used_ticket *used = find_used(a, t);
        if (used && used->banned) return "this ticket was banned";
        if (t->session && t->session != pal_ticket_session(session)) return "this ticket is for another session";
        if (t->expires_s && unix_s > t->expires_s && !may_return(used, now_ns)) return "this ticket has expired";
        grant->has_ticket = true;
        grant->role = t->role;
        grant->tool = t->tool;
    }
    if (is_banned(a, grant->address) && (!grant->has_ticket || !is_counted(&grant->ticket)) &&
        (a->open || grant->role != PAL_WIRE_ROLE_INSTRUCTOR))
        return "this address was banned";
    return NULL;
}

/* a free entry: a new one, or that of a ticket that has expired and with which nobody can return; NULL: none */
static used_ticket *take_entry(pal_admission *a, uint64_t now_ns)
{
    if (a->n_used < USED_MAX) return &a->used[a->n_used++];
    for (int k = 0; k < USED_MAX; k++)
        if (a->used[k].expires_s && a->used[k].expires_s < a->unix_s && !a->used[k].n_here &&
            !may_return(&a->used[k], now_ns))
            return &a->used[k];
    return NULL;
}

pal_err pal_admission_enter(pal_admission *a, const pal_grant *grant, uint64_t now_ns)
{
    const pal_ticket *t = &grant->ticket;
    if (!grant->has_ticket || !is_counted(t)) return PAL_ERR_OK;
    used_ticket *used = find_used(a, t);
    if (!used) {
        used = take_entry(a, now_ns);
        if (!used) return PAL_ERR_FULL;
        *used = (used_ticket){.nonce = t->nonce, .expires_s = t->expires_s};
    }
    if (!may_return(used, now_ns)) {
        if (t->uses && used->n_admitted >= t->uses) return PAL_ERR_FULL;
        used->n_admitted++;
    }
    used->n_here++;
    return PAL_ERR_OK;
}

void pal_admission_leave(pal_admission *a, const pal_grant *grant, uint64_t now_ns)
{
    used_ticket *used = grant->has_ticket ? find_used(a, &grant->ticket) : NULL;
    if (!used) return;
    used->n_here--;
    used->left_ns = now_ns;
}

void pal_admission_renew(const pal_admission *a, const pal_grant *grant, uint64_t unix_s, char text[PAL_TICKET_TEXT])
{
    const uint64_t until_s = unix_s + PAL_RETURN_NS / 1000000000u;
    pal_ticket ticket = grant->ticket;
    text[0] = 0;
    if (!grant->has_ticket || !ticket.expires_s || !a->keys.n || ticket.expires_s >= until_s) return;
    ticket.expires_s = until_s < UINT32_MAX ? (uint32_t)until_s : UINT32_MAX;
    if (!pal_ticket_put(&ticket, &a->keys.key[a->keys.n - 1], text)) text[0] = 0;
}

void pal_admission_ban(pal_admission *a, const pal_grant *grant)
{
    used_ticket *used = grant->has_ticket ? find_used(a, &grant->ticket) : NULL;
    if (used)
        used->banned = true;
    else if (grant->address[0] && !is_banned(a, grant->address))
        memcpy(a->banned[a->n_banned++ % BANNED_MAX], grant->address, ADDRESS);
}
