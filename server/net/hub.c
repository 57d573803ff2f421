/* Peers of the hub: connection, disconnection, and the choice of the next message
 * (protocol/README.md, "Cycles and credit"). */
#include "server/net/hub.h"

#include "server/base/log.h"
#include "server/net/http_pages.h"
#include "server/net/hub_accuracy.h"
#include "server/net/hub_fields.h"
#include "server/net/hub_input.h"
#include "server/net/hub_jobs.h"
#include "server/net/hub_members.h"
#include "server/net/hub_news.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/hub_sessions.h"
#include "server/net/hub_status.h"
#include "server/net/hub_steering.h"
#include "server/net/hub_verb.h"
#include "server/net/hub_watch.h"
#include "server/net/transport/plain_text.h"
#include "server/net/transport/relay_list.h"
#include "server/net/tuning.h"
#include "server/session/resume.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* ---- sending ---- */

static bool wants_cycle(const pal_client *c)
{
    return c->id && c->room->stream->tools && c->room->stream->cycle != c->sent_cycle && pal_credit_free(&c->credit);
}

static bool client_waiting(void *user, const pal_peer *peer)
{
    const pal_client *c = peer->client;
    (void)user;
    if (!c || peer->drop_code) return false;
    return c->n_queue || c->members_due || c->reported_order < c->room->reported_order || c->status_due || c->haptic ||
           c->out_begin < c->n_out || pal_hub_wants_estimate(c) || pal_hub_wants_field(c) || wants_cycle(c);
}

/* queues the TOPOLOGY_DELTA for the newest frame of a part; false: not available now, so the frame waits too */
static bool add_topology_delta(pal_client *c, int p)
{
    const pal_stream_part *part = &c->room->stream->part[p];
    if (!c->topology_deltas || !part->slots || c->sent_change[p] == part->slots->change) return true;
    pal_packet *packet = part->frame_change[c->tier] == part->slots->change
                             ? pal_triangle_slots_delta(part->slots, c->sent_change[p])
                             : NULL;
    if (!packet) return false;
    c->out[c->n_out++] = packet;
    c->sent_change[p] = part->slots->change;
    c->hub->count.n_delta++;
    return true;
}

/* queues the newest messages that this client lacks, as one cycle */
static void begin_cycle(pal_client *c)
{
    const pal_stream *s = c->room->stream;
    c->out_begin = c->n_out = 0;
    for (int p = 0; p < s->n_part; p++) {
        const pal_stream_part *part = &s->part[p];
        if (!part->frame[c->tier] || (int32_t)(part->frame_seq[c->tier] - c->sent_frame[p]) <= 0) continue;
        if (!add_topology_delta(c, p)) continue;
        c->out[c->n_out++] = pal_packet_hold(part->frame[c->tier]);
        c->sent_frame[p] = part->frame_seq[c->tier];
        c->hub->count.n_frame++;
    }
    c->out[c->n_out++] = pal_packet_hold(s->tools);
    if (c->n_cycle && s->cycle > c->sent_cycle + 1) {
        c->n_skipped += s->cycle - c->sent_cycle - 1;
        c->hub->count.n_skipped += s->cycle - c->sent_cycle - 1;
    }
    c->n_cycle++;
    c->out_cycle = c->sent_cycle = s->cycle;
}

static pal_packet *take_next(pal_client *c)
{
    pal_packet *p = NULL;
    if (c->n_queue) {
        p = c->queue[0];
        memmove(c->queue, c->queue + 1, sizeof *c->queue * (size_t)--c->n_queue);
        return p;
    }
    if (c->members_due) {
        c->members_due = false;
        if (c->room->members_message) return pal_packet_hold(c->room->members_message);
    }
    if ((p = pal_hub_next_orders(c))) return p;
    if (c->status_due) {
        c->status_due = false;
        if ((p = pal_hub_next_status(c))) return p;
    }
    if ((p = pal_hub_next_estimate(c))) return p;
    if (c->haptic) {
        p = c->haptic;
        c->haptic = NULL;
        return p;
    }
    if ((p = pal_hub_next_field(c))) return p;
    if (c->out_begin == c->n_out && wants_cycle(c)) begin_cycle(c);
    if (c->out_begin == c->n_out) return NULL;
    p = c->out[c->out_begin++];
    if (c->out_begin == c->n_out) pal_credit_sent(&c->credit, c->out_cycle, pal_loop_now_ns(c->hub->loop));
    return p;
}

static pal_packet *client_next(void *user, pal_peer *peer)
{
    pal_client *c = peer->client;
    (void)user;
    if (!c || peer->drop_code) return NULL;
    pal_packet *p = take_next(c);
    if (!p) return NULL;
    c->n_byte += p->n_byte;
    c->hub->count.n_byte += p->n_byte;
    return p;
}

/* ---- connection and disconnection ---- */

static pal_hub_room *find_room(pal_hub *hub, const char *session)
{
    if (!*session) return hub->n_room ? hub->room[0] : NULL;
    for (int i = 0; i < hub->n_room; i++)
        if (!strcmp(pal_session_scene(hub->room[i]->session)->name, session)) return hub->room[i];
    return NULL;
}

/* the client has no place any more; its peer closes by itself */
static void let_go(pal_client *c)
{
    pal_hub_leave_room(c);
    c->peer->client = NULL;
    c->peer = NULL;
    c->hub->n_client--;
}

/* a place for a peer that has not joined. Beyond a number of them, the oldest one loses its place, of the same address
 * first, so that who opens connections and says nothing keeps nobody out */
static pal_client *take_place(pal_hub *hub, const char *address)
{
    pal_client *place = NULL, *oldest = NULL, *oldest_here = NULL;
    int n = 0, n_here = 0;
    for (pal_client *c = hub->client; c < hub->client + hub->max_clients; c++) {
        if (!c->peer) place = place ? place : c;
        if (!c->peer || c->id) continue;
        const bool here = !strcmp(c->peer->address, address);
        n++, n_here += here;
        if (!oldest || c->opened_ns < oldest->opened_ns) oldest = c;
        if (here && (!oldest_here || c->opened_ns < oldest_here->opened_ns)) oldest_here = c;
    }
    if (n_here < PAL_UNJOINED_OF_ADDRESS) oldest_here = NULL;
    pal_client *evicted = oldest_here ? oldest_here : n < PAL_UNJOINED_PLACES ? NULL : oldest;
    if (!evicted) return place;
    hub->count.n_refused_join++;
    pal_hub_drop(evicted, PAL_WIRE_CLOSE_FULL, "too many connections that do not join");
    let_go(evicted);
    return evicted;
}

static void client_opened(void *user, pal_peer *peer, const char *session, const char *ticket)
{
    pal_hub *hub = user;
    pal_hub_room *room = find_room(hub, session);
    const uint64_t now = pal_loop_now_ns(hub->loop);
    pal_grant grant;
    const char *why = NULL;
    if (hub->leaving)
        pal_peer_drop(peer, PAL_WIRE_CLOSE_GOING_AWAY, "the server ends");
    else if (!room)
        pal_peer_drop(peer, PAL_WIRE_CLOSE_NO_SESSION, "there is no session of that name");
    else if ((why = pal_admission_check(hub->admission, ticket, pal_session_scene(room->session)->name, peer->address,
                                        (uint64_t)time(NULL), now, &grant)))
        pal_peer_drop(peer, PAL_WIRE_CLOSE_POLICY, "%s", why);
    pal_client *c = peer->drop_code ? NULL : take_place(hub, peer->address);
    if (!c && !peer->drop_code) pal_peer_drop(peer, PAL_WIRE_CLOSE_FULL, "the server has no free place");
    if (peer->drop_code) {
        hub->count.n_refused_join++;
        pal_log(PAL_LOG_INFO, "refused", "a client from %s: %s", peer->address[0] ? peer->address : "this process",
                peer->drop_reason);
        return;
    }
    *c = (pal_client){.hub = hub, .peer = peer, .room = room, .opened_ns = now, .grant = grant};
    pal_bucket_begin(&c->poses, PAL_MESSAGES_1_S, PAL_MESSAGES_1_S / 2, now);
    pal_bucket_begin(&c->orders, PAL_CONTROL_1_S, PAL_CONTROL_AT_ONCE, now);
    pal_credit_begin(&c->credit, pal_stream_rate_hz(room->stream));
    peer->client = c;
    hub->n_client++;
}

static void client_closed(void *user, pal_peer *peer)
{
    pal_client *c = peer->client;
    (void)user;
    if (c) let_go(c);
}

/* ---- frames and housekeeping ---- */

static void offer_cycle(pal_hub_room *room)
{
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));) {
        const int tool = c->member->tool;
        if (tool >= 0 && room->stream->haptic[tool])
            pal_packet_replace(&c->haptic, pal_packet_hold(room->stream->haptic[tool]));
        if (client_waiting(NULL, c->peer)) c->peer->ops->ready(c->peer);
    }
}

static void hub_wake(void *user)
{
    pal_hub *hub = user;
    uint64_t now = pal_loop_now_ns(hub->loop), apart = (uint64_t)(0.9e9 / PAL_STREAM_RATE_HZ), due = 0;
    if (hub->leaving) return;
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_room *room = hub->room[r];
        bool used[PAL_STREAM_TIER_COUNT];
        uint64_t next = room->stream->cycle ? room->stream->cycle_ns + apart : now;
        if (now < next) {
            if (!due || next < due) due = next;
        } else {
            for (int t = 0; t < PAL_STREAM_TIER_COUNT; t++) used[t] = room->tier_users[t] > 0;
            if (pal_stream_update(room->stream, now, used, room->tool)) offer_cycle(room);
        }
        next = pal_hub_make_fields(room, now);
        if (next && (!due || next < due)) due = next;
        next = pal_hub_report_news(room, now);
        if (next && (!due || next < due)) due = next;
    }
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_play_on(hub->room[r]);
        pal_hub_jobs_update(hub->room[r]);
    }
    pal_hub_sessions_update(hub->sessions);
    if (due) pal_loop_set_due(hub->loop, due);
}

static void set_tier(pal_client *client, int tier)
{
    pal_hub_room *room = client->room;
    if (tier == client->tier) return;
    room->tier_users[client->tier]--;
    client->tier = tier;
    room->tier_users[tier]++;
    pal_stream_begin_tier(room->stream, tier);
    if (client->sent_cycle == room->stream->cycle) client->sent_cycle--;
}

/* more than a quarter of the cycles skipped for 2 s: coarser frames; 10 s without a skip: finer ones */
static void judge_tier(pal_client *c, uint64_t now)
{
    if (now - c->tier_ns < PAL_TIER_WINDOW_NS) return;
    uint64_t sent = c->n_cycle - c->tier_cycle, skipped = c->n_skipped - c->tier_skipped;
    bool first = c->tier_ns == 0;
    c->tier_ns = now;
    c->tier_cycle = c->n_cycle;
    c->tier_skipped = c->n_skipped;
    if (first || skipped > 0) c->clean_ns = now;
    if (first) return;
    if (4 * skipped > sent + skipped && c->tier + 1 < PAL_STREAM_TIER_COUNT)
        set_tier(c, c->tier + 1);
    else if (c->tier > 0 && now - c->clean_ns >= PAL_TIER_CLEAN_NS) {
        set_tier(c, c->tier - 1);
        c->clean_ns = now;
    }
}

static void beat(pal_hub *hub)
{
    int n_client = 0;
    for (const pal_client *c = hub->client; c < hub->client + hub->max_clients; c++) n_client += c->peer && c->id;
    atomic_store(&hub->pulse.n_session, hub->n_room);
    atomic_store(&hub->pulse.n_client, n_client);
    if (pal_hub_is_alive(hub)) atomic_store(&hub->pulse.alive_ns, pal_clock_ns());
}

pal_hub_pulse pal_hub_read_pulse(const pal_hub *hub)
{
    return (pal_hub_pulse){.alive = pal_clock_ns() - atomic_load(&hub->pulse.alive_ns) < PAL_PULSE_NS,
                           .n_session = atomic_load(&hub->pulse.n_session),
                           .n_client = atomic_load(&hub->pulse.n_client)};
}

static void hub_tick(void *user)
{
    pal_hub *hub = user;
    uint64_t now = pal_loop_now_ns(hub->loop);
    if (hub->leaving) return;
    beat(hub);
    hub_wake(hub);
    pal_hub_hand_over_idle_tools(hub);
    for (int r = 0; r < hub->n_room; r++) {
        pal_stream_measure(hub->room[r]->stream, now);
        pal_packet_replace(&hub->room[r]->status, NULL);
        pal_hub_update_subscriptions(hub->room[r]);
        pal_hub_count_unobserved(hub->room[r]);
        pal_hub_watch_pace(hub->room[r]);
    }
    for (int i = 0; i < hub->max_clients; i++) {
        pal_client *c = &hub->client[i];
        if (!c->peer || c->peer->drop_code) continue;
        if (!c->id) {
            if (now - c->opened_ns > PAL_ANSWER_NS) pal_hub_drop(c, PAL_WIRE_CLOSE_POLICY, "no join within 5 s");
            continue;
        }
        if (pal_credit_stalled(&c->credit, now, PAL_STALL_NS)) {
            hub->count.n_stalled++;
            pal_hub_drop(c, PAL_WIRE_CLOSE_STALLED, "no acknowledgement for 10 s");
            continue;
        }
        judge_tier(c, now);
        pal_hub_world_answer(c);
        c->status_due = true;
        pal_hub_estimates_due(c);
        c->peer->ops->ready(c->peer);
    }
}

pal_err pal_hub_create(pal_loop *loop, const pal_server_options *options, pal_site *site, pal_session **session,
                       int n_session, pal_diagnostic *diag, pal_hub **out)
{
    pal_hub *hub = calloc(1, sizeof *hub);
    pal_err err = PAL_ERR_OK;
    if (!hub) return PAL_ERR_MEMORY;
    hub->loop = loop;
    hub->site = site;
    hub->source = options->source;
    hub->open = options->open;
    hub->error_m = options->error_m;
    hub->drain_to = options->drain_to ? options->drain_to : "";
    hub->verb = options->verb ? options->verb : pal_verb_table;
    hub->n_verb = options->verb ? options->n_verb : pal_verb_count;
    hub->started_s = (uint32_t)time(NULL);
    hub->health_on_main = !options->allow_remote && !(options->health && options->health[0]);
    hub->max_members = options->max_clients > 0 ? options->max_clients : PAL_HUB_CLIENTS;
    hub->relays = options->relays && options->relays[0] ? options->relays : NULL;
    hub->max_viewers = options->max_viewers > 0 ? options->max_viewers : PAL_HUB_VIEWERS;
    hub->max_clients = hub->max_members + hub->max_viewers + PAL_VIEWING_TICKETS + PAL_UNJOINED_PLACES;
    hub->client = calloc((size_t)hub->max_clients, sizeof *hub->client);
    hub->control = malloc(sizeof *hub->control);
    hub->text = malloc(PAL_CONTROL_OUT_MAX + 1);
    if (!hub->client || !hub->control || !hub->text) err = PAL_ERR_MEMORY;
    if (!err) err = pal_relay_list_check(options->relays, "--relays", diag);
    if (!err) err = pal_admission_create(options->key_file, options->open, diag, &hub->admission);
    if (!err && n_session > PAL_SESSIONS_MAX)
        err = PAL_REFUSE(diag, "%d sessions, at most %d", n_session, PAL_SESSIONS_MAX);
    for (int i = 0; !err && i < n_session; i++) {
        const pal_opened_session opened = {.session = session[i],
                                           .study = options->study ? options->study[i] : (pal_session_study){.n = 0},
                                           .recording = options->recording ? options->recording[i]
                                                                           : (pal_session_recording){.recording = NULL},
                                           .resume = options->resume ? options->resume[i] : NULL};
        pal_hub_room *room;
        err = pal_hub_room_open(hub, &opened, diag, &room);
        if (err) break;
        room->given = &session[i];
        /* what it borrows is the hub's now */
        if (opened.resume) room->own = true, session[i] = NULL, room->given = NULL;
        room->number = hub->n_numbered++;
        hub->room[hub->n_room++] = room;
    }
    if (!err && (hub->source || options->n_failed)) err = pal_hub_sessions_create(hub, &hub->sessions);
    for (int k = 0; !err && k < options->n_failed; k++) pal_hub_sessions_fail(hub->sessions, &options->failed[k]);
    if (err) return pal_hub_destroy(hub), err;
    pal_loop_listen(loop, &(pal_loop_events){hub_wake, hub_tick, hub});
    *out = hub;
    return PAL_ERR_OK;
}

void pal_hub_destroy(pal_hub *hub)
{
    if (!hub) return;
    pal_hub_sessions_destroy(hub->sessions);
    for (int i = 0; i < hub->n_room; i++) pal_hub_room_close(hub->room[i]);
    pal_admission_destroy(hub->admission);
    free(hub->client);
    free(hub->control);
    free(hub->text);
    free(hub);
}

void pal_hub_events(pal_hub *hub, pal_peer_events *out)
{
    *out = (pal_peer_events){.opened = client_opened,
                             .received = pal_hub_received,
                             .waiting = client_waiting,
                             .next = client_next,
                             .closed = client_closed,
                             .get = pal_hub_get,
                             .user = hub};
}

/* ---- end ---- */

static void send_move(pal_client *c)
{
    pal_wire_move *move = &pal_hub_message(c->hub, PAL_CONTROL_MOVE)->move;
    snprintf(move->address, sizeof move->address, "%s", c->hub->drain_to);
    snprintf(move->session, sizeof move->session, "%s", pal_session_scene(c->room->session)->name);
    pal_admission_renew(c->hub->admission, &c->grant, (uint64_t)time(NULL), move->ticket);
    pal_hub_send(c);
}

void pal_hub_drain(pal_hub *hub)
{
    int n_sent = 0;
    if (hub->leaving) return;
    hub->leaving = true;
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_jobs_complete(hub->room[r]);
        pal_session_finish(hub->room[r]->session);
    }
    for (int r = 0; hub->drain_to[0] && r < hub->n_room; r++)
        for (pal_client *c = NULL; (c = pal_hub_next_member(hub->room[r], c));)
            if (c->moves) send_move(c), n_sent++;
    if (hub->drain_to[0])
        pal_log(PAL_LOG_INFO, "drain", "%d sessions end, %d clients are sent to %s", hub->n_room, n_sent,
                hub->drain_to);
}

bool pal_hub_moves_sent(const pal_hub *hub)
{
    if (!hub->drain_to[0]) return true;
    for (const pal_client *c = hub->client; c < hub->client + hub->max_clients; c++)
        if (c->peer && c->n_queue > 0) return false;
    return true;
}

void pal_hub_goodbye(pal_hub *hub)
{
    for (int i = 0; i < hub->max_clients; i++)
        if (hub->client[i].peer) pal_hub_drop(&hub->client[i], PAL_WIRE_CLOSE_GOING_AWAY, "the server ends");
}

void pal_hub_start_ticket(const pal_hub *hub, pal_wire_role role, char text[PAL_TICKET_TEXT])
{
    pal_admission_start_ticket(hub->admission, role, text);
}

bool pal_hub_has_ended(const pal_hub *hub, int i)
{
    return hub->ended >> i & 1;
}

int pal_hub_record_error(const pal_hub *hub)
{
    int error = 0;
    for (int r = 0; r < hub->n_room && !error; r++) error = pal_session_record_error(hub->room[r]->session);
    return error;
}

int pal_hub_clients(const pal_hub *hub)
{
    return hub->n_client;
}
