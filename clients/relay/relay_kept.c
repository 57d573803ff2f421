#include "clients/relay/relay_kept.h"

#include "clients/relay/tuning.h"
#include "protocol/asset.h"
#include "protocol/frame_codec.h"
#include "protocol/interior_codec.h"
#include "server/base/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void pal_relay_kept_init(pal_relay_kept *k, void (*changed)(void *user), void *user)
{
    memset(k, 0, sizeof *k);
    pthread_mutex_init(&k->lock, NULL);
    k->changed = changed, k->changed_user = user;
}

void pal_relay_kept_fetch_by(pal_relay_kept *k, void (*want)(void *user, const char *path), void *user)
{
    k->want = want, k->want_user = user;
}

/* ---- messages ---- */

/* takes the reference */
static void keep(pal_relay_kept *k, pal_relay_message *place, pal_packet *packet)
{
    pal_packet_replace(&place->packet, packet);
    place->number = packet ? ++k->number : 0;
}

static void drop_orders(pal_relay_kept *k)
{
    for (int i = 0; i < PAL_RELAY_ORDERS; i++) pal_packet_replace(&k->order[i], NULL);
    k->n_order = 0;
}

/* what viewers know holds no more */
static void begin_run(pal_relay_kept *k)
{
    for (int i = 0; i < PAL_RELAY_KINDS; i++) keep(k, &k->text[i], NULL);
    for (int i = 0; i < PAL_RELAY_MEMBERS; i++) pal_packet_replace(&k->announced[i], NULL);
    for (int p = 0; p < PAL_WIRE_PART_MAX; p++) {
        keep(k, &k->frame[p], NULL);
        pal_packet_replace(&k->coming[p], NULL);
        pal_relay_triangles_free(&k->triangles[p]);
        pal_relay_values_ask(&k->values[p], (pal_relay_view){.fields = 0});
        k->epoch[p] = k->shown_seq[p] = 0;
    }
    keep(k, &k->tools, NULL);
    drop_orders(k);
    k->names[PAL_RELAY_TOPOLOGY].n_path = k->before.n_path = 0;
    k->run++;
}

/* the FRAMEs of a closed cycle, of what is shown */
static void show_frames(pal_relay_kept *k)
{
    for (int p = 0; p < PAL_WIRE_PART_MAX; p++) {
        if (!k->coming[p] || k->coming_epoch[p] != k->epoch[p]) continue;
        keep(k, &k->frame[p], k->coming[p]);
        k->coming[p] = NULL;
        k->shown_seq[p] = k->coming_seq[p];
        pal_relay_triangles_show(&k->triangles[p], k->epoch[p]);
    }
}

/* ---- assets ---- */

static pal_relay_asset *find(const pal_relay_kept *k, const char *path)
{
    pal_relay_asset *a = k->asset;
    while (a && strcmp(a->path, path)) a = a->next;
    return a;
}

static bool names(const pal_relay_names *n, const char *path)
{
    for (int i = 0; i < n->n_path; i++)
        if (!strcmp(n->path[i], path)) return true;
    return false;
}

static bool is_named(const pal_relay_kept *k, const char *path)
{
    return names(&k->names[PAL_RELAY_HELLO], path) || names(&k->names[PAL_RELAY_TOPOLOGY], path) ||
           names(&k->before, path);
}

static void forget_assets(pal_relay_kept *k)
{
    for (pal_relay_asset **at = &k->asset, *a; (a = *at);) {
        if (is_named(k, a->path)) {
            at = &a->next;
            continue;
        }
        *at = a->next;
        k->asset_bytes -= a->bytes->n_byte;
        pal_packet_drop(a->bytes);
        free(a);
    }
}

/* upstream names nothing but assets: what has another path is neither fetched nor shown */
static bool is_asset_path(const char *path)
{
    static const char folder[] = "/asset/";
    const char *hash = path + sizeof folder - 1;
    return !strncmp(path, folder, sizeof folder - 1) && strspn(hash, "0123456789abcdef") == PAL_ASSET_HASH_CHARS - 1 &&
           strlen(hash) == PAL_ASSET_HASH_CHARS - 1;
}

static void add_name(pal_relay_names *n, const char *path)
{
    if (!is_asset_path(path) || names(n, path)) return;
    snprintf(n->path[n->n_path++], sizeof *n->path, "%s", path);
}

static void read_names(pal_relay_names *n, const pal_wire_part_info *part, uint32_t n_part)
{
    n->n_part = n_part, n->n_path = 0;
    for (uint32_t p = 0; p < n_part; p++) {
        n->epoch[p] = part[p].epoch, n->fields[p] = 0;
        for (uint32_t i = 0; i < part[p].n_field; i++) n->fields[p] |= 1u << pal_wire_field_find(part[p].field[i]);
        add_name(n, part[p].asset);
        add_name(n, part[p].interior);
        add_name(n, part[p].control_cells);
        for (uint32_t i = 0; i < part[p].n_image; i++) add_name(n, part[p].image[i]);
    }
}

/* ---- hello and topology ---- */

/* a frame of an older epoch is no key frame any more */
static void show_epochs(pal_relay_kept *k, const pal_relay_names *n)
{
    k->n_part = n->n_part;
    memcpy(k->fields, n->fields, sizeof k->fields);
    for (uint32_t p = 0; p < n->n_part; p++) {
        pal_relay_values_show_epoch(&k->values[p], n->epoch[p], &k->number);
        if (n->epoch[p] != k->epoch[p]) keep(k, &k->frame[p], NULL), k->shown_seq[p] = 0;
        k->epoch[p] = n->epoch[p];
        pal_relay_triangles_show_epoch(&k->triangles[p], n->epoch[p]);
    }
}

/* shows what is announced and complete: hello before topology */
static void show(pal_relay_kept *k)
{
    for (int i = 0; i < PAL_RELAY_MEMBERS && (i == PAL_RELAY_HELLO || k->text[PAL_RELAY_HELLO].packet); i++) {
        const pal_relay_names *n = &k->names[i];
        bool complete = k->announced[i] != NULL;
        for (int a = 0; complete && a < n->n_path; a++) complete = find(k, n->path[a]) != NULL;
        if (!complete) continue;
        keep(k, &k->text[i], k->announced[i]);
        k->announced[i] = NULL;
        show_epochs(k, n);
        show_frames(k);
        /* a session that is paused may send no cycle soon */
        if (k->tools.packet) k->tools.number = ++k->number;
        forget_assets(k);
    }
}

/* is this the run that viewers know, with the parts that they know? */
static bool is_same_run(const pal_relay_kept *k, const pal_wire_hello *h)
{
    bool same = k->text[PAL_RELAY_HELLO].packet && h->started == k->started && !strcmp(h->session, k->session) &&
                h->n_part == k->names[PAL_RELAY_HELLO].n_part && !k->announced[PAL_RELAY_TOPOLOGY];
    for (uint32_t p = 0; same && p < h->n_part; p++)
        same = h->part[p].epoch == k->epoch[p] && find(k, h->part[p].asset);
    return same;
}

static void take_hello(pal_relay_kept *k, const pal_wire_hello *h, pal_packet *packet)
{
    k->started = h->started;
    k->frame_rate_hz = h->frame_rate_hz;
    snprintf(k->session, sizeof k->session, "%s", h->session);
    snprintf(k->title, sizeof k->title, "%s", h->title);
    k->up = true;
    pal_packet_replace(&k->announced[PAL_RELAY_HELLO], packet);
    read_names(&k->names[PAL_RELAY_HELLO], h->part, h->n_part);
    forget_assets(k);
}

static void take_topology(pal_relay_kept *k, const pal_wire_topology *t, pal_packet *packet)
{
    if (!k->announced[PAL_RELAY_TOPOLOGY]) k->before = k->names[PAL_RELAY_TOPOLOGY];
    pal_packet_replace(&k->announced[PAL_RELAY_TOPOLOGY], packet);
    read_names(&k->names[PAL_RELAY_TOPOLOGY], t->part, t->n_part);
    forget_assets(k); /* of one that was never complete */
}

/* ---- triangles of parts that adapt: decoded before the lock is taken ---- */

static void set_triangles(pal_relay_kept *k)
{
    for (int p = 0; p < PAL_WIRE_PART_MAX; p++) {
        pal_relay_triangles *t = &k->triangles[p];
        const pal_relay_asset *a = pal_relay_triangles_lack_asset(t) ? find(k, t->asset) : NULL;
        if (a && pal_relay_triangles_set_asset(t, p, a->bytes->bytes, a->bytes->n_byte))
            pal_log(PAL_LOG_WARN, "triangles", "part %d keeps those of its start: %s is not its asset", p, t->asset);
    }
}

static void announce_triangles(pal_relay_kept *k, const pal_wire_part_info *part, uint32_t n_part, bool connection)
{
    for (uint32_t p = 0; p < n_part; p++)
        if (pal_relay_triangles_announce(&k->triangles[p], &part[p], connection))
            pal_log(PAL_LOG_WARN, "triangles", "part %u keeps those of its start: there are too many", p);
    set_triangles(k);
}

/* ---- from upstream ---- */

/* hello as viewers get it: a relay takes no commands, so it offers none. NULL: it does not fit, or out of memory */
static pal_packet *offer(const pal_control *hello)
{
    static pal_control offered; /* [up] only; too large for the stack, as is text */
    static char text[PAL_CONTROL_OUT_MAX + 1];
    size_t n = 0;
    offered = *hello;
    offered.hello.relay = true;
    offered.hello.estimates = false;
    pal_packet *packet = pal_control_put(text, sizeof text, &offered, &n) ? NULL : pal_packet_create(text, n, true);
    if (!packet)
        pal_log(PAL_LOG_WARN, "hello", "of %s is too long, or there is no memory: it is not shown",
                hello->hello.session);
    return packet;
}

/* of any part, since epochs of a server only grow: viewers would take an older one for what they have */
static bool is_older(const pal_relay_kept *k, const pal_wire_topology *t)
{
    for (uint32_t p = 0; p < t->n_part; p++)
        if ((int32_t)(t->part[p].epoch - k->triangles[p].epoch) < 0) return true;
    return false;
}

void pal_relay_take_text(pal_relay_kept *k, const pal_control *c, const char *text, size_t n_byte)
{
    if (c->type == PAL_CONTROL_TOPOLOGY && is_older(k, &c->topology)) {
        pal_log(PAL_LOG_WARN, "topology", "of an older epoch is ignored");
        return;
    }
    const bool passed = c->type == PAL_CONTROL_HELLO || c->type == PAL_CONTROL_TOPOLOGY ||
                        c->type == PAL_CONTROL_MEMBERS || c->type == PAL_CONTROL_STATUS ||
                        c->type == PAL_CONTROL_ORDERS;
    pal_packet *packet = c->type == PAL_CONTROL_HELLO ? offer(c)
                         : passed                     ? pal_packet_create(text, n_byte, true)
                                                      : NULL;
    if (!packet) return;
    if (c->type == PAL_CONTROL_HELLO && !is_same_run(k, &c->hello)) {
        pthread_mutex_lock(&k->lock);
        begin_run(k);
        pthread_mutex_unlock(&k->lock);
    }
    if (c->type == PAL_CONTROL_HELLO) announce_triangles(k, c->hello.part, c->hello.n_part, true);
    if (c->type == PAL_CONTROL_TOPOLOGY) announce_triangles(k, c->topology.part, c->topology.n_part, false);
    pthread_mutex_lock(&k->lock);
    if (c->type == PAL_CONTROL_HELLO)
        take_hello(k, &c->hello, packet);
    else if (c->type == PAL_CONTROL_TOPOLOGY)
        take_topology(k, &c->topology, packet);
    else if (c->type == PAL_CONTROL_ORDERS)
        pal_packet_replace(&k->order[k->n_order++ % PAL_RELAY_ORDERS], packet);
    else
        keep(k, &k->text[c->type == PAL_CONTROL_MEMBERS ? PAL_RELAY_MEMBERS : PAL_RELAY_STATUS], packet);
    show(k);
    pthread_mutex_unlock(&k->lock);
    if (c->type == PAL_CONTROL_HELLO || c->type == PAL_CONTROL_TOPOLOGY) pal_relay_want_missing(k);
    k->changed(k->changed_user);
}

static void take_frame(pal_relay_kept *k, const uint8_t *bytes, size_t n_byte)
{
    pal_frame_head head;
    if (pal_frame_get_head(bytes, n_byte, &head) || head.part >= PAL_WIRE_PART_MAX) return;
    if ((int32_t)(head.epoch - k->epoch[head.part]) < 0) return;
    /* a new connection begins with the newest, which viewers may have */
    const uint32_t shown = k->shown_seq[head.part];
    if (head.epoch == k->epoch[head.part] && shown && (int32_t)(head.seq - shown) <= 0) return;
    pal_packet_replace(&k->coming[head.part], pal_packet_create(bytes, n_byte, false));
    k->coming_epoch[head.part] = head.epoch, k->coming_seq[head.part] = head.seq;
}

static void take_triangles(pal_relay_kept *k, uint16_t part, const uint8_t *bytes, size_t n_byte)
{
    const int refusal = part < PAL_WIRE_PART_MAX ? pal_relay_triangles_take(&k->triangles[part], bytes, n_byte) : 0;
    if (refusal)
        pal_log(PAL_LOG_WARN, "triangles", "part %u: a change is refused: %s", part, pal_refusal_text(refusal));
    /* a FRAME from before this change, which waits for its asset, is not shown with it: the next one follows at once */
    if (part < PAL_WIRE_PART_MAX) pal_packet_replace(&k->coming[part], NULL);
}

static void take_values(pal_relay_kept *k, bool interior, const uint8_t *bytes, size_t n_byte)
{
    pal_field_head field = {.part = 0};
    pal_interior_head inside = {.part = 0};
    if (interior ? pal_interior_get_head(bytes, n_byte, &inside) : pal_field_get_head(bytes, n_byte, &field)) return;
    const uint16_t part = interior ? inside.part : field.part;
    pal_relay_value value = {.epoch = interior ? inside.epoch : field.epoch};
    if (part >= PAL_WIRE_PART_MAX || !(value.packet = pal_packet_create(bytes, n_byte, false))) return;
    pthread_mutex_lock(&k->lock);
    value.number = ++k->number;
    pal_relay_values_take(&k->values[part], interior, interior ? inside.field : field.field, value);
    pthread_mutex_unlock(&k->lock);
    k->changed(k->changed_user);
}

static void take_tools(pal_relay_kept *k, const uint8_t *bytes, size_t n_byte)
{
    pal_wire_tools tools;
    pal_packet *packet = pal_wire_get_tools(bytes, n_byte, &tools) ? NULL : pal_packet_create(bytes, n_byte, false);
    if (!packet) return;
    pthread_mutex_lock(&k->lock);
    show_frames(k);
    keep(k, &k->tools, packet);
    k->cycle = tools.cycle;
    pthread_mutex_unlock(&k->lock);
    k->changed(k->changed_user);
}

void pal_relay_take_message(pal_relay_kept *k, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    if (head->kind == PAL_WIRE_FRAME) take_frame(k, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOPOLOGY_DELTA) take_triangles(k, head->index, bytes, n_byte);
    if (head->kind == PAL_WIRE_FIELD || head->kind == PAL_WIRE_INTERIOR)
        take_values(k, head->kind == PAL_WIRE_INTERIOR, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOOLS) take_tools(k, bytes, n_byte);
}

pal_err pal_relay_take_asset(pal_relay_kept *k, const char *path, const uint8_t *bytes, size_t n_byte)
{
    char hash[PAL_ASSET_HASH_CHARS];
    const char *slash = strrchr(path, '/');
    pal_asset_hash(bytes, n_byte, hash);
    /* [up] alone changes names and assets */
    if (!slash || strcmp(slash + 1, hash) || !is_named(k, path)) return PAL_ERR_REFUSED;
    if (find(k, path)) return PAL_ERR_OK;
    if (n_byte > PAL_RELAY_ASSETS_BYTES - k->asset_bytes) return PAL_ERR_FULL;
    pal_relay_asset *a = calloc(1, sizeof *a);
    pal_packet *packet = pal_packet_create(bytes, n_byte, false);
    if (!a || !packet) {
        free(a);
        pal_packet_drop(packet);
        return PAL_ERR_MEMORY;
    }
    snprintf(a->path, sizeof a->path, "%s", path);
    a->bytes = packet;
    pthread_mutex_lock(&k->lock);
    a->next = k->asset;
    k->asset = a;
    k->asset_bytes += n_byte;
    pthread_mutex_unlock(&k->lock);
    set_triangles(k);
    pthread_mutex_lock(&k->lock);
    show(k);
    pthread_mutex_unlock(&k->lock);
    k->changed(k->changed_user);
    return PAL_ERR_OK;
}

void pal_relay_want_missing(pal_relay_kept *k)
{
    /* [up] alone adds and drops assets and names */
    for (int i = 0; i < PAL_RELAY_MEMBERS; i++)
        for (int a = 0; k->announced[i] && a < k->names[i].n_path; a++)
            if (!find(k, k->names[i].path[a])) k->want(k->want_user, k->names[i].path[a]);
}

void pal_relay_lost(pal_relay_kept *k)
{
    pthread_mutex_lock(&k->lock);
    k->up = false;
    pthread_mutex_unlock(&k->lock);
}

static bool same_view(const pal_relay_view *a, const pal_relay_view *b)
{
    return a->fields == b->fields && a->interior == b->interior && a->energy == b->energy;
}

uint32_t pal_relay_next_request(pal_relay_kept *k, uint32_t first, pal_relay_view *wanted)
{
    uint32_t found = PAL_WIRE_PART_MAX;
    pthread_mutex_lock(&k->lock);
    for (uint32_t i = 0; i < k->n_part && found == PAL_WIRE_PART_MAX; i++) {
        pal_relay_values *of = &k->values[(first + i) % k->n_part];
        *wanted = pal_relay_values_wanted(of);
        /* a field that a topology has taken away would have the whole request refused */
        wanted->fields &= k->fields[(first + i) % k->n_part];
        if (!wanted->fields) wanted->interior = false;
        if (same_view(wanted, &of->asked)) continue;
        pal_relay_values_ask(of, *wanted);
        found = (first + i) % k->n_part;
    }
    pthread_mutex_unlock(&k->lock);
    return found;
}

void pal_relay_forget_requests(pal_relay_kept *k)
{
    pthread_mutex_lock(&k->lock);
    for (int p = 0; p < PAL_WIRE_PART_MAX; p++) pal_relay_values_ask(&k->values[p], (pal_relay_view){.fields = 0});
    pthread_mutex_unlock(&k->lock);
}

pal_packet *pal_relay_find_asset(pal_relay_kept *k, const char *path)
{
    pthread_mutex_lock(&k->lock);
    const pal_relay_asset *a = find(k, path);
    pal_packet *bytes = a ? pal_packet_hold(a->bytes) : NULL;
    pthread_mutex_unlock(&k->lock);
    return bytes;
}

void pal_relay_kept_free(pal_relay_kept *k)
{
    begin_run(k);
    k->names[PAL_RELAY_HELLO].n_path = 0;
    forget_assets(k);
    pthread_mutex_destroy(&k->lock);
}
