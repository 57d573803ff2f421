#include "clients/relay/relay_viewers.h"

#include "clients/relay/tuning.h"
#include "server/base/log.h"
#include "server/net/transport/credit.h"
#include "server/net/transport/host_name.h"
#include "server/net/transport/relay_list.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { ANSWERS = 8, OTHER_SOCKETS = 128 };

/* one connection; in a free entry, peer is NULL */
typedef struct viewer {
    pal_relay_viewers *of;
    pal_peer *peer;
    bool joined;
    uint32_t run;                 /* of what it knows */
    uint64_t opened_ns, waits_ns; /* waits_ns: since when something waits to be taken; 0: nothing */
    pal_grant grant;
    pal_bucket acks, orders;
    pal_credit credit;
    pal_packet *answer[ANSWERS]; /* to what it said, oldest first */
    int n_answer;
    uint64_t text[PAL_RELAY_KINDS], frame[PAL_WIRE_PART_MAX], tools; /* numbers of what was sent last */
    uint64_t n_order;                                                /* sent of the orders */
    pal_packet *out[2 * PAL_WIRE_PART_MAX + 1]; /* cycle in transmission: changes of triangles and frames, then tools */
    int n_out, out_begin;
    uint32_t cycle; /* of it, and of the last one */
    bool topology_deltas;
    uint32_t change[PAL_WIRE_PART_MAX], change_epoch[PAL_WIRE_PART_MAX]; /* of the triangles that it has */
    bool looks;                                                          /* at values of any part */
    pal_relay_view view[PAL_WIRE_PART_MAX];
    uint64_t values[PAL_WIRE_PART_MAX]; /* number of those that were sent last */
    uint64_t pose_error_ns;
} viewer;

struct pal_relay_viewers {
    pal_loop *loop;
    pal_relay_kept *kept;
    pal_relay_options options;
    pal_admission *admission; /* NULL: tickets are not looked at */
    int max_viewers, n_place, n_here;
    viewer *place; /* [n_place] */
    bool ending;
    pal_relay_counts count;
};

static void answer(viewer *v, const pal_control *message)
{
    static char text[PAL_CONTROL_OUT_MAX + 1]; /* [net] only */
    size_t n = 0;
    if (v->peer->drop_code) return;
    if (v->n_answer == ANSWERS) {
        pal_peer_drop(v->peer, PAL_WIRE_CLOSE_POLICY, "too many answers wait to be read");
        return;
    }
    pal_packet *packet = pal_control_put(text, sizeof text, message, &n) ? NULL : pal_packet_create(text, n, true);
    if (!packet) return;
    v->answer[v->n_answer++] = packet;
    v->peer->ops->ready(v->peer);
}

static void refuse(viewer *v, const char *code, const char *sentence)
{
    static pal_control message; /* [net] only */
    message = (pal_control){.type = PAL_CONTROL_ERROR};
    snprintf(message.error.code, sizeof message.error.code, "%s", code);
    snprintf(message.error.text, sizeof message.error.text, "%s", sentence);
    answer(v, &message);
}

/* ---- coming and going ---- */

/* what it wants to see of a part; the lock is held */
static void set_view(viewer *v, uint32_t part, pal_relay_view now)
{
    pal_relay_values_change(&v->of->kept->values[part], &v->view[part], &now);
    v->view[part] = now;
    v->values[part] = 0;
    v->looks = false;
    for (int p = 0; p < PAL_WIRE_PART_MAX; p++) v->looks |= v->view[p].fields != 0;
}

static void leave(viewer *v)
{
    pthread_mutex_lock(&v->of->kept->lock);
    for (uint32_t p = 0; p < PAL_WIRE_PART_MAX; p++) set_view(v, p, (pal_relay_view){.fields = 0});
    pthread_mutex_unlock(&v->of->kept->lock);
    for (; v->n_answer > 0; v->n_answer--) pal_packet_drop(v->answer[v->n_answer - 1]);
    for (; v->out_begin < v->n_out; v->out_begin++) pal_packet_drop(v->out[v->out_begin]);
    if (v->joined) v->of->count.n_viewer--;
    if (v->joined && v->of->admission) pal_admission_leave(v->of->admission, &v->grant, pal_loop_now_ns(v->of->loop));
    v->of->n_here--;
    v->peer->client = NULL;
    *v = (viewer){.peer = NULL};
}

/* a place for one that has not joined: of too many such, the oldest loses its own, of the same address first */
static viewer *take_place(pal_relay_viewers *all, const char *address)
{
    viewer *place = NULL, *oldest = NULL, *oldest_here = NULL;
    int n = 0, n_here = 0;
    for (viewer *v = all->place; v < all->place + all->n_place; v++) {
        if (!v->peer && !place) place = v;
        if (!v->peer || v->joined) continue;
        const bool here = !strcmp(v->peer->address, address);
        n++, n_here += here;
        if (!oldest || v->opened_ns < oldest->opened_ns) oldest = v;
        if (here && (!oldest_here || v->opened_ns < oldest_here->opened_ns)) oldest_here = v;
    }
    if (n_here < PAL_RELAY_UNJOINED_OF_ADDRESS) oldest_here = NULL;
    viewer *evicted = oldest_here ? oldest_here : n < PAL_RELAY_UNJOINED ? NULL : oldest;
    if (!evicted) return place;
    all->count.n_refused++;
    pal_peer_drop(evicted->peer, PAL_WIRE_CLOSE_FULL, "too many connections that do not join");
    leave(evicted);
    return evicted;
}

static void opened(void *user, pal_peer *peer, const char *session, const char *ticket)
{
    pal_relay_viewers *all = user;
    pal_relay_kept *k = all->kept;
    const uint64_t now = pal_loop_now_ns(all->loop);
    viewer fresh = {.of = all, .peer = peer, .opened_ns = now};
    char name[PAL_WIRE_NAME_BYTES];
    pthread_mutex_lock(&k->lock);
    const bool shows = k->text[PAL_RELAY_HELLO].packet != NULL;
    memcpy(name, k->session, sizeof name);
    fresh.run = k->run, fresh.n_order = k->n_order;
    pal_credit_begin(&fresh.credit, k->frame_rate_hz);
    pthread_mutex_unlock(&k->lock);
    const char *why = NULL;
    if (all->ending)
        pal_peer_drop(peer, PAL_WIRE_CLOSE_GOING_AWAY, "the relay ends");
    else if (!shows)
        pal_peer_drop(peer, PAL_WIRE_CLOSE_GOING_AWAY, "the relay has no session yet");
    else if (session[0] && strcmp(session, name))
        pal_peer_drop(peer, PAL_WIRE_CLOSE_NO_SESSION, "there is no session of that name");
    else if (all->admission && (why = pal_admission_check(all->admission, ticket, name, peer->address,
                                                          (uint64_t)time(NULL), now, &fresh.grant)))
        pal_peer_drop(peer, PAL_WIRE_CLOSE_POLICY, "%s", why);
    viewer *v = peer->drop_code ? NULL : take_place(all, peer->address);
    if (!v) {
        all->count.n_refused++;
        return;
    }
    pal_bucket_begin(&fresh.acks, PAL_RELAY_ACKS_1_S, PAL_RELAY_ACKS_1_S / 2, now);
    pal_bucket_begin(&fresh.orders, PAL_RELAY_CONTROL_1_S, PAL_RELAY_CONTROL_AT_ONCE, now);
    *v = fresh;
    peer->client = v;
    all->n_here++;
}

static void closed(void *user, pal_peer *peer)
{
    (void)user;
    if (peer->client) leave(peer->client);
}

static bool has_place(const viewer *v)
{
    const pal_relay_viewers *all = v->of;
    const pal_ticket *ticket = &v->grant.ticket;
    int n = 0, max_here = all->max_viewers / PAL_RELAY_ADDRESSES;
    if (all->count.n_viewer >= all->max_viewers) return false;
    if (pal_address_is_loopback(v->peer->address) || ticket->uses || ticket->user) return true;
    for (const viewer *other = all->place; other < all->place + all->n_place; other++)
        n += other->peer && other->joined && !strcmp(other->peer->address, v->peer->address);
    if (max_here < PAL_RELAY_ADDRESS_PLACES) max_here = PAL_RELAY_ADDRESS_PLACES;
    return n < max_here;
}

static void join(viewer *v, const pal_wire_join *wanted)
{
    pal_relay_viewers *all = v->of;
    if (v->joined) {
        refuse(v, "joined", "you have joined already");
        return;
    }
    const bool full = !has_place(v);
    if (full || (all->admission && pal_admission_enter(all->admission, &v->grant, pal_loop_now_ns(all->loop)))) {
        all->count.n_refused++;
        pal_peer_drop(v->peer, full && all->options.relays ? PAL_WIRE_CLOSE_ELSEWHERE : PAL_WIRE_CLOSE_FULL, "%s",
                      full ? "the relay has no free place" : "as many as this ticket admits are here, or have been");
        return;
    }
    v->joined = true;
    v->topology_deltas = wanted->topology_deltas;
    all->count.n_viewer++, all->count.n_joined++;
    v->peer->ops->ready(v->peer);
    if (wanted->role != PAL_WIRE_ROLE_VIEWER) refuse(v, "role", "this is a relay: here you may only watch");
}

/* ---- what viewers say ---- */

/* upstream is asked for it, if not for somebody else, by relay_upstream.c */
static void subscribe(viewer *v, const pal_wire_field_subscription *wanted)
{
    pal_relay_kept *k = v->of->kept;
    uint32_t fields = 0;
    const bool known = pal_wire_field_get_set(wanted->field, &fields);
    pthread_mutex_lock(&k->lock);
    const bool no_part = wanted->part >= k->n_part;
    const bool offered = !no_part && known && !(fields & ~k->fields[wanted->part]);
    if (offered)
        set_view(v, wanted->part,
                 (pal_relay_view){.fields = fields, .interior = wanted->interior && fields, .energy = wanted->energy});
    pthread_mutex_unlock(&k->lock);
    if (offered)
        v->peer->ops->ready(v->peer);
    else
        refuse(v, no_part ? "part" : "field", no_part ? "there is no such part" : "the part has no such field");
}

/* the result is why a message is malformed; 0: it is not */
static int control(viewer *v, const uint8_t *bytes, size_t n_byte)
{
    static pal_control in, pong; /* [net] only */
    const int refusal = pal_control_get((const char *)bytes, n_byte, false, &in);
    if (refusal) return refusal;
    if (!v->joined && in.type != PAL_CONTROL_JOIN && in.type != PAL_CONTROL_PING) {
        pal_peer_drop(v->peer, PAL_WIRE_CLOSE_POLICY, "join comes first");
        return 0;
    }
    switch (in.type) {
    case PAL_CONTROL_JOIN:
        join(v, &in.join);
        break;
    case PAL_CONTROL_PING:
        pong = (pal_control){.type = PAL_CONTROL_PONG, .stamp_ms = in.stamp_ms};
        answer(v, &pong);
        break;
    case PAL_CONTROL_SUBSCRIBE_FIELD:
        subscribe(v, &in.field_subscription);
        break;
    case PAL_CONTROL_RELEASE_TOOL:
        break;
    case PAL_CONTROL_TAKE_TOOL:
    case PAL_CONTROL_COMMAND:
        refuse(v, "role", "this is a relay: here you may only watch");
        break;
    default:
        return PAL_REFUSAL_KIND;
    }
    return 0;
}

static int binary(viewer *v, const uint8_t *bytes, size_t n_byte)
{
    const uint64_t now = pal_loop_now_ns(v->of->loop);
    pal_wire_head head;
    pal_wire_ack ack;
    pal_wire_pose pose;
    int refusal = pal_wire_get_head(bytes, n_byte, &head);
    if (refusal) return refusal;
    if (head.kind != PAL_WIRE_ACK && head.kind != PAL_WIRE_POSE) return PAL_REFUSAL_KIND;
    if (!v->joined) {
        pal_peer_drop(v->peer, PAL_WIRE_CLOSE_POLICY, "join comes first");
        return 0;
    }
    if (head.kind == PAL_WIRE_POSE) {
        refusal = pal_wire_get_pose(bytes, n_byte, &pose);
        if (!refusal && (!v->pose_error_ns || now - v->pose_error_ns > 1000000000u)) {
            v->pose_error_ns = now;
            refuse(v, "role", "a viewer moves no tool");
        }
        return refusal;
    }
    refusal = pal_wire_get_ack(bytes, n_byte, &ack);
    if (refusal) return refusal;
    if (!pal_credit_acknowledge(&v->credit, ack.cycle, now)) return PAL_REFUSAL_RANGE;
    v->peer->ops->ready(v->peer);
    return 0;
}

static void received(void *user, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text)
{
    viewer *v = peer->client;
    (void)user;
    if (!v || peer->drop_code) return;
    if (!pal_bucket_take(text ? &v->orders : &v->acks, pal_loop_now_ns(v->of->loop))) {
        pal_peer_drop(peer, PAL_WIRE_CLOSE_RATE, "more than %d %s a second",
                      text ? PAL_RELAY_CONTROL_1_S : PAL_RELAY_ACKS_1_S,
                      text ? "control messages" : "poses and acknowledgements");
        return;
    }
    const int refusal = text ? control(v, bytes, n_byte) : binary(v, bytes, n_byte);
    if (refusal) pal_peer_drop(peer, PAL_WIRE_CLOSE_PROTOCOL, "%s", pal_refusal_text(refusal));
}

/* ---- what viewers are sent; the lock is held ---- */

/* the newest text message that it lacks; PAL_RELAY_KINDS: none. hello comes once */
static int next_text(const viewer *v)
{
    int i = 0;
    const pal_relay_message *m = v->of->kept->text;
    while (i < PAL_RELAY_KINDS && (m[i].number <= v->text[i] || (i == PAL_RELAY_HELLO && v->text[i]))) i++;
    return i;
}

static bool wants_cycle(const viewer *v)
{
    return v->of->kept->tools.number > v->tools && pal_credit_free(&v->credit);
}

/* what has changed of the triangles of a part since the last FRAME that it got; false: out of memory, so FRAME waits */
static bool add_triangles(viewer *v, int p)
{
    pal_triangle_slots *slots = v->of->kept->triangles[p].slots;
    if (!v->topology_deltas || !slots) return true;
    if (v->change_epoch[p] != slots->epoch) v->change[p] = 0;
    v->change_epoch[p] = slots->epoch;
    if (v->change[p] == slots->change) return true;
    pal_packet *delta = pal_triangle_slots_delta(slots, v->change[p]);
    if (!delta) return false;
    v->out[v->n_out++] = delta;
    v->change[p] = slots->change;
    return true;
}

static void begin_cycle(viewer *v)
{
    const pal_relay_kept *k = v->of->kept;
    v->out_begin = v->n_out = 0;
    for (int p = 0; p < PAL_WIRE_PART_MAX; p++) {
        if (k->frame[p].number <= v->frame[p] || !add_triangles(v, p)) continue;
        v->out[v->n_out++] = pal_packet_hold(k->frame[p].packet);
        v->frame[p] = k->frame[p].number;
        v->of->count.n_frame++;
    }
    v->out[v->n_out++] = pal_packet_hold(k->tools.packet);
    if (v->tools && k->cycle > v->cycle + 1) v->of->count.n_skipped += k->cycle - v->cycle - 1;
    v->tools = k->tools.number, v->cycle = k->cycle;
}

/* the values that it lacks next, while it has credit for a cycle, and of which part; NULL: none */
static const pal_relay_value *lacking(const viewer *v, int *part)
{
    const pal_relay_kept *k = v->of->kept;
    const pal_relay_value *found = NULL;
    if (!v->looks || v->out_begin < v->n_out || !pal_credit_free(&v->credit)) return NULL;
    for (*part = 0; *part < PAL_WIRE_PART_MAX; ++*part) {
        found = pal_relay_values_lacking(&k->values[*part], &v->view[*part], k->epoch[*part], v->values[*part]);
        if (found) break;
    }
    return found;
}

static bool has_news(const viewer *v)
{
    int part;
    return v->n_answer || v->out_begin < v->n_out ||
           (v->joined && (next_text(v) < PAL_RELAY_KINDS || v->n_order < v->of->kept->n_order || wants_cycle(v) ||
                          lacking(v, &part)));
}

static pal_packet *take_next(viewer *v)
{
    const pal_relay_kept *k = v->of->kept;
    if (!v->joined || v->text[PAL_RELAY_HELLO]) /* what is refused at joining follows hello */
        if (v->n_answer) {
            pal_packet *packet = v->answer[0];
            memmove(v->answer, v->answer + 1, sizeof *v->answer * (size_t)--v->n_answer);
            return packet;
        }
    if (!v->joined) return NULL;
    const int i = next_text(v);
    if (i < PAL_RELAY_KINDS) {
        v->text[i] = k->text[i].number;
        return pal_packet_hold(k->text[i].packet);
    }
    if (v->n_order < k->n_order) {
        if (k->n_order - v->n_order > PAL_RELAY_ORDERS) v->n_order = k->n_order - PAL_RELAY_ORDERS;
        return pal_packet_hold(k->order[v->n_order++ % PAL_RELAY_ORDERS]);
    }
    int part;
    const pal_relay_value *values = lacking(v, &part);
    if (values) {
        v->values[part] = values->number;
        return pal_packet_hold(values->packet);
    }
    if (v->out_begin == v->n_out && wants_cycle(v)) begin_cycle(v);
    if (v->out_begin == v->n_out) return NULL;
    pal_packet *packet = v->out[v->out_begin++];
    if (v->out_begin == v->n_out) pal_credit_sent(&v->credit, v->cycle, pal_loop_now_ns(v->of->loop));
    return packet;
}

static bool waiting(void *user, const pal_peer *peer)
{
    pal_relay_viewers *all = user;
    const viewer *v = peer->client;
    if (!v || peer->drop_code) return false;
    pthread_mutex_lock(&all->kept->lock);
    const bool news = v->run == all->kept->run && has_news(v);
    pthread_mutex_unlock(&all->kept->lock);
    return news;
}

static pal_packet *next(void *user, pal_peer *peer)
{
    pal_relay_viewers *all = user;
    viewer *v = peer->client;
    if (!v || peer->drop_code) return NULL;
    pthread_mutex_lock(&all->kept->lock);
    pal_packet *packet = v->run == all->kept->run ? take_next(v) : NULL;
    pthread_mutex_unlock(&all->kept->lock);
    v->waits_ns = 0;
    if (packet) all->count.n_byte += packet->n_byte;
    return packet;
}

/* ---- news and housekeeping ---- */

static void wake(void *user)
{
    pal_relay_viewers *all = user;
    pthread_mutex_lock(&all->kept->lock);
    const uint32_t run = all->kept->run;
    pthread_mutex_unlock(&all->kept->lock);
    for (viewer *v = all->place; v < all->place + all->n_place; v++) {
        if (!v->peer || v->peer->drop_code) continue;
        if (v->run != run)
            pal_peer_drop(v->peer, PAL_WIRE_CLOSE_GOING_AWAY, "the session begins anew");
        else if (waiting(all, v->peer)) {
            if (!v->waits_ns) v->waits_ns = pal_loop_now_ns(all->loop);
            v->peer->ops->ready(v->peer);
        }
    }
}

static void tick(void *user)
{
    pal_relay_viewers *all = user;
    wake(all);
    const uint64_t now = pal_loop_now_ns(all->loop); /* not before what wake has noted */
    for (viewer *v = all->place; v < all->place + all->n_place; v++) {
        if (!v->peer || v->peer->drop_code) continue;
        if (!v->joined && now - v->opened_ns > PAL_RELAY_JOIN_NS)
            pal_peer_drop(v->peer, PAL_WIRE_CLOSE_POLICY, "no join within 5 s");
        else if (pal_credit_stalled(&v->credit, now, PAL_RELAY_STALL_NS))
            pal_peer_drop(v->peer, PAL_WIRE_CLOSE_STALLED, "no acknowledgement for 10 s");
        else if (v->waits_ns && now - v->waits_ns > PAL_RELAY_STALL_NS)
            pal_peer_drop(v->peer, PAL_WIRE_CLOSE_STALLED, "nothing is read for 10 s");
    }
}

static void get(void *user, const pal_request *request, pal_reply *reply)
{
    pal_relay_viewers *all = user;
    pal_relay_get(all->kept, &all->options, &all->count, request, reply);
}

/* ---- life ---- */

static int viewers_of(const pal_relay_options *options)
{
    return options->max_viewers > 0 ? options->max_viewers : PAL_RELAY_VIEWERS;
}

int pal_relay_sockets(const pal_relay_options *options)
{
    return viewers_of(options) + PAL_RELAY_UNJOINED + OTHER_SOCKETS;
}

pal_err pal_relay_viewers_create(pal_loop *loop, pal_relay_kept *kept, const pal_relay_options *options,
                                 pal_diagnostic *diag, pal_relay_viewers **out)
{
    pal_relay_viewers *all = calloc(1, sizeof *all);
    pal_err err = PAL_ERR_OK;
    if (!all) return PAL_ERR_MEMORY;
    all->loop = loop, all->kept = kept, all->options = *options;
    all->max_viewers = viewers_of(options);
    all->n_place = all->max_viewers + PAL_RELAY_UNJOINED;
    all->place = calloc((size_t)all->n_place, sizeof *all->place);
    if (!all->place) err = PAL_ERR_MEMORY;
    if (!err) err = pal_relay_list_check(options->relays, "--relays", diag);
    if (!err && options->keys) err = pal_admission_create(options->keys, false, diag, &all->admission);
    if (err) return pal_relay_viewers_destroy(all), err;
    pal_loop_listen(loop, &(pal_loop_events){wake, tick, all});
    *out = all;
    return PAL_ERR_OK;
}

void pal_relay_viewers_destroy(pal_relay_viewers *all)
{
    if (!all) return;
    pal_admission_destroy(all->admission);
    free(all->place);
    free(all);
}

void pal_relay_viewers_events(pal_relay_viewers *all, pal_peer_events *out)
{
    *out = (pal_peer_events){opened, received, waiting, next, closed, get, all};
}

void pal_relay_viewers_end(pal_relay_viewers *all, int code, const char *reason)
{
    all->ending = true;
    for (viewer *v = all->place; v < all->place + all->n_place; v++)
        if (v->peer) pal_peer_drop(v->peer, code, "%s", reason);
}

int pal_relay_viewers_here(const pal_relay_viewers *all)
{
    return all->n_here;
}

const pal_relay_counts *pal_relay_viewers_count(const pal_relay_viewers *all)
{
    return &all->count;
}
