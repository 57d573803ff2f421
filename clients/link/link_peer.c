#include "clients/link/link_core.h"
#include "server/base/clock.h"
#include "server/base/signal_edges.h"

#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

enum {
    LINK_QUEUE = 16,
    LINK_MESSAGE_MAX = 96 << 20, /* a frame of the largest part, or a delta of all triangles */
    LINK_SMALL_SOCKET = 16384,   /* receive buffer of a client that reads slowly on purpose */
    LINK_PAUSE_FIRST_MS = 250,
    LINK_UNSENT = 2048, /* bytes that may wait in the socket: a dozen poses */
    LINK_PAUSE_MAX_MS = 5000
};
/* ns after a `move` for which a server without the session is asked again: it may be loading the scene */
#define LINK_MOVE_NS 60000000000u

struct pal_link {
    pal_link *next;
    pal_link_loop *loop;
    struct lws *wsi;
    link_address address;
    char name[PAL_WIRE_MEMBER_NAME];
    char protocols[128]; /* that it offers */
    pal_link_options o;  /* without url and name, which are copied */
    bool closing, up, fixed, pause_reading;
    uint64_t moved_ns; /* when a `move` has come; 0: none since the last hello */
    double read_budget;
    uint64_t read_ns;
    pal_link_state state;
    int close_code;
    char close_why[128];
    uint32_t pause_ms;
    lws_sorted_usec_list_t retry, resume;
    link_bytes in; /* message being put together */
    bool in_drop;
    bool has_ack, away, grasps; /* of the last pose */
    pal_signal_edges poses;     /* that wait */
    uint64_t sent_pose;         /* number of the last one that does not */
    uint8_t pose[PAL_EDGE_SLOTS][PAL_WIRE_POSE_BYTES], ack[PAL_WIRE_ACK_BYTES];
    int n_queued, queue_first;
    size_t queued_bytes[LINK_QUEUE];
    char queued[LINK_QUEUE][PAL_CONTROL_IN_MAX + 1];
    uint16_t id; /* of the member; 0: before the first hello */
    int held;    /* tool */
    pal_control control;
    pal_link_counts count;
};

static void link_connect(pal_link *link);

static void link_report(pal_link *link, pal_link_state state, const char *reason)
{
    link->state = state;
    if (!link->closing && link->o.events->state)
        link->o.events->state(link->o.user, state, link->close_code, reason ? reason : "");
}

static void link_want_write(pal_link *link)
{
    if (link->wsi && link->up) lws_callback_on_writable(link->wsi);
}

static void link_retry_fired(lws_sorted_usec_list_t *sul)
{
    link_connect(lws_container_of(sul, pal_link, retry));
}

static void link_resume_fired(lws_sorted_usec_list_t *sul)
{
    pal_link *link = lws_container_of(sul, pal_link, resume);
    link->pause_reading = false;
    if (link->wsi && link->up && !link->fixed) lws_rx_flow_control(link->wsi, 1);
}

static void link_free(pal_link *link)
{
    pal_link **place = &link->loop->links;
    while (*place && *place != link) place = &(*place)->next;
    if (*place) *place = link->next;
    free(link->in.at);
    free(link);
}

/* closures after which a client reconnects; after the others it ends (protocol/README.md, "Closing") */
static bool link_may_return(int code)
{
    return code == 0 || code == PAL_WIRE_CLOSE_NORMAL || code == PAL_WIRE_CLOSE_GOING_AWAY || code == 1005 ||
           code == 1006 || code == PAL_WIRE_CLOSE_INTERNAL || code == PAL_WIRE_CLOSE_STALLED ||
           code == PAL_WIRE_CLOSE_FULL || code == PAL_WIRE_CLOSE_ELSEWHERE;
}

/* the connection is gone: try again later, or end */
static void link_lost(pal_link *link, const char *reason)
{
    link->wsi = NULL;
    link->up = link->has_ack = link->away = link->grasps = false;
    link->sent_pose = link->poses.n_value;
    link->n_queued = 0;
    link->in.n = 0;
    link->in_drop = false;
    link->held = PAL_WIRE_TOOL_NONE;
    lws_sul_schedule(link->loop->context, 0, &link->resume, link_resume_fired, LWS_SET_TIMER_USEC_CANCEL);
    if (link->closing) {
        link_free(link);
        return;
    }
    const bool moving = link->moved_ns && pal_clock_ns() - link->moved_ns < LINK_MOVE_NS;
    if (!link_may_return(link->close_code) && !(moving && link->close_code == PAL_WIRE_CLOSE_NO_SESSION)) {
        link_report(link, PAL_LINK_ENDED, reason);
        return;
    }
    lws_sul_schedule(link->loop->context, 0, &link->retry, link_retry_fired, (lws_usec_t)link->pause_ms * 1000);
    link->pause_ms = link->pause_ms * 2 < LINK_PAUSE_MAX_MS ? link->pause_ms * 2 : LINK_PAUSE_MAX_MS;
    link_report(link, PAL_LINK_LOST, reason);
}

static void link_connect(pal_link *link)
{
    link->close_code = 0;
    link->close_why[0] = 0;
    link_report(link, PAL_LINK_CONNECTING, "");
    struct lws_client_connect_info info =
        link_connect_info(link->loop, &link->address, PAL_PROTOCOL_NAME, link, &link->wsi);
    info.path = link->address.path;
    info.protocol = link->protocols;
    info.ietf_version_or_minus_one = -1;
    /* on failure the callback has reported it */
    lws_client_connect_via_info(&info);
}

/* its address has changed */
static void link_offer(pal_link *link)
{
    snprintf(link->protocols, sizeof link->protocols, link->address.ticket[0] ? "%s, %s%s" : "%s", PAL_PROTOCOL_NAME,
             PAL_TICKET_PREFIX, link->address.ticket);
}

pal_err pal_link_open(pal_link_loop *loop, const pal_link_options *options, pal_diagnostic *diag, pal_link **out)
{
    pal_link *link = calloc(1, sizeof *link);
    if (!link) return PAL_ERR_MEMORY;
    pal_err err = link_address_parse(options->url, &link->address, diag);
    if (err) {
        free(link);
        return err;
    }
    link->loop = loop;
    link_offer(link);
    strncpy(link->name, options->name ? options->name : "client", sizeof link->name - 1);
    link->o = *options;
    link->o.url = link->o.name = NULL;
    link->read_budget = options->read_bytes_s / 4;
    link->held = PAL_WIRE_TOOL_NONE;
    link->pause_ms = LINK_PAUSE_FIRST_MS;
    link->next = loop->links;
    loop->links = link;
    *out = link;
    /* by timer, so that no event comes before the caller has its pointer */
    lws_sul_schedule(loop->context, 0, &link->retry, link_retry_fired, 1);
    return PAL_ERR_OK;
}

void pal_link_close(pal_link *link)
{
    if (!link || link->closing) return;
    link->closing = true;
    lws_sul_schedule(link->loop->context, 0, &link->retry, link_retry_fired, LWS_SET_TIMER_USEC_CANCEL);
    lws_sul_schedule(link->loop->context, 0, &link->resume, link_resume_fired, LWS_SET_TIMER_USEC_CANCEL);
    if (link->up) {
        lws_rx_flow_control(link->wsi, 1);
        link_want_write(link);
        return;
    }
    if (link->wsi) {
        lws_set_opaque_user_data(link->wsi, NULL);
        lws_set_timeout(link->wsi, PENDING_TIMEOUT_CLOSE_SEND, LWS_TO_KILL_ASYNC);
    }
    link_free(link);
}

bool link_close_all(pal_link_loop *loop)
{
    bool open = false;
    for (pal_link *link = loop->links, *next; link; link = next) {
        next = link->next;
        open = open || link->up;
        pal_link_close(link);
    }
    return open;
}

void link_free_all(pal_link_loop *loop)
{
    while (loop->links) link_free(loop->links);
}

pal_link_state pal_link_current_state(const pal_link *link)
{
    return link->state;
}
int pal_link_tool(const pal_link *link)
{
    return link->held;
}
pal_link_counts pal_link_count(const pal_link *link)
{
    return link->count;
}

pal_err pal_link_send_pose(pal_link *link, const pal_wire_pose *pose)
{
    pal_wire_pose back;
    if (link->state != PAL_LINK_JOINED) return PAL_ERR_STATE;
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    /* what the server would refuse is not sent */
    if (!pal_wire_put_pose(bytes, sizeof bytes, pose) || pal_wire_get_pose(bytes, sizeof bytes, &back))
        return PAL_ERR_REFUSED;
    const bool away = pose->flags & PAL_WIRE_POSE_AWAY, grasps = !away && (pose->buttons & PAL_WIRE_GRASP);
    const int edge = pal_signal_edges_put(&link->poses, grasps != link->grasps || (away && !link->away));
    link->away = away, link->grasps = grasps;
    memcpy(link->pose[PAL_EDGE_NEWEST], bytes, sizeof bytes);
    if (edge >= 0) memcpy(link->pose[edge], bytes, sizeof bytes);
    link_want_write(link);
    return PAL_ERR_OK;
}

pal_err pal_link_send_ack(pal_link *link, const pal_wire_ack *ack)
{
    if (link->state != PAL_LINK_JOINED) return PAL_ERR_STATE;
    pal_wire_put_ack(link->ack, sizeof link->ack, ack);
    link->has_ack = true;
    link_want_write(link);
    return PAL_ERR_OK;
}

void pal_link_acknowledge(pal_link *link, const uint8_t *bytes, size_t n_byte)
{
    pal_wire_tools tools;
    if (!pal_wire_get_tools(bytes, n_byte, &tools)) pal_link_send_ack(link, &(pal_wire_ack){.cycle = tools.cycle});
}

pal_err pal_link_send_control(pal_link *link, const pal_control *c)
{
    if (!link->up) return PAL_ERR_STATE;
    if (link->n_queued == LINK_QUEUE) return PAL_ERR_FULL;
    const int slot = (link->queue_first + link->n_queued) % LINK_QUEUE;
    if (pal_control_put(link->queued[slot], sizeof link->queued[slot], c, &link->queued_bytes[slot]))
        return PAL_ERR_REFUSED;
    link->n_queued++;
    link_want_write(link);
    return PAL_ERR_OK;
}

void pal_link_pause_reading(pal_link *link, bool hold)
{
    link->fixed = hold;
    if (link->wsi && link->up && !link->pause_reading) lws_rx_flow_control(link->wsi, !hold);
}

/* one message per writable callback: control, pose, acknowledgement */
static int link_write(pal_link *link, struct lws *wsi)
{
    uint8_t buffer[LWS_PRE + PAL_CONTROL_IN_MAX];
    const void *from;
    size_t n;
    int pose = pal_signal_edges_next(&link->poses, link->sent_pose);
    enum lws_write_protocol kind = LWS_WRITE_BINARY;
    if (link->closing) {
        lws_close_reason(wsi, LWS_CLOSE_STATUS_NORMAL, NULL, 0);
        return -1;
    }
    if (link->n_queued > 0) {
        n = link->queued_bytes[link->queue_first];
        from = link->queued[link->queue_first];
        link->queue_first = (link->queue_first + 1) % LINK_QUEUE;
        link->n_queued--;
        kind = LWS_WRITE_TEXT;
    } else if (pose >= 0) {
        n = sizeof link->pose[pose];
        from = link->pose[pose];
        link->sent_pose = link->poses.number[pose];
        pose = pal_signal_edges_next(&link->poses, link->sent_pose);
    } else if (link->has_ack) {
        n = sizeof link->ack;
        from = link->ack;
        link->has_ack = false;
    } else {
        return 0;
    }
    memcpy(buffer + LWS_PRE, from, n);
    if (lws_write(wsi, buffer + LWS_PRE, n, kind) < 0) return -1;
    if (link->n_queued > 0 || pose >= 0 || link->has_ack) lws_callback_on_writable(wsi);
    return 0;
}

static void link_fault(pal_link *link, int refusal)
{
    if (link->o.events->fault) link->o.events->fault(link->o.user, refusal);
}

/* the next connection goes to another server; an address that is none leaves everything as it is */
static void link_move(pal_link *link, const pal_wire_move *move)
{
    char url[sizeof move->address + sizeof move->session + 16];
    link_address to;
    snprintf(url, sizeof url, "%s?session=%s", move->address, move->session);
    if (link_address_parse(url, &to, NULL)) return;
    memcpy(to.ticket, move->ticket[0] ? move->ticket : link->address.ticket, sizeof to.ticket);
    link->address = to;
    link->moved_ns = pal_clock_ns();
    link_offer(link);
}

static void link_text(pal_link *link)
{
    const int refusal = pal_control_get((const char *)link->in.at, link->in.n, true, &link->control);
    if (refusal) {
        link_fault(link, refusal);
        return;
    }
    const bool hello = link->control.type == PAL_CONTROL_HELLO;
    const pal_wire_members *members = &link->control.members;
    for (uint32_t i = 0; link->control.type == PAL_CONTROL_MEMBERS && i < members->n_member; i++)
        if (members->member[i].id == link->id) link->held = members->member[i].tool;
    if (hello) {
        link->id = link->control.hello.you_id;
        link->held = link->control.hello.you_tool;
        link->pause_ms = LINK_PAUSE_FIRST_MS;
        link->moved_ns = 0;
        link->count.joins++;
    }
    if (link->control.type == PAL_CONTROL_MOVE) link_move(link, &link->control.move);
    if (link->o.events->text) link->o.events->text(link->o.user, &link->control, (const char *)link->in.at, link->in.n);
    if (link->o.events->control) link->o.events->control(link->o.user, &link->control);
    if (hello && !link->closing) link_report(link, PAL_LINK_JOINED, "");
}

static void link_binary(pal_link *link)
{
    pal_wire_head head;
    int refusal = pal_wire_get_head(link->in.at, link->in.n, &head);
    if (!refusal && head.kind >= PAL_WIRE_POSE) refusal = PAL_REFUSAL_KIND;
    if (refusal)
        link_fault(link, refusal);
    else if (link->o.events->message)
        link->o.events->message(link->o.user, &head, link->in.at, link->in.n);
}

/* token bucket of a slow client: read_bytes_s fills it, messages empty it; reading pauses while it is empty */
static void link_spend(pal_link *link, struct lws *wsi, size_t n_byte)
{
    const uint64_t now = pal_clock_ns();
    link->read_budget += link->o.read_bytes_s * 1e-9 * (double)(now - link->read_ns);
    if (link->read_budget > link->o.read_bytes_s / 4) link->read_budget = link->o.read_bytes_s / 4;
    link->read_ns = now;
    link->read_budget -= (double)n_byte;
    if (link->read_budget >= 0 || link->pause_reading) return;
    link->pause_reading = true;
    lws_rx_flow_control(wsi, 0);
    lws_sul_schedule(link->loop->context, 0, &link->resume, link_resume_fired,
                     (lws_usec_t)(-link->read_budget / link->o.read_bytes_s * 1e6) + 1);
}

static void link_receive(pal_link *link, struct lws *wsi, const uint8_t *bytes, size_t n_byte)
{
    link->count.bytes_in += n_byte;
    if (link->o.read_bytes_s > 0) link_spend(link, wsi, n_byte);
    if (lws_is_first_fragment(wsi)) {
        link->in.n = 0;
        link->in_drop = false;
    }
    link->in_drop = link->in_drop || !link_bytes_append(&link->in, bytes, n_byte, LINK_MESSAGE_MAX);
    if (!lws_is_final_fragment(wsi) || lws_remaining_packet_payload(wsi) > 0) return;
    if (link->in_drop)
        link_fault(link, PAL_REFUSAL_LONG);
    else if (lws_frame_is_binary(wsi))
        link_binary(link);
    else
        link_text(link);
    link->in.n = 0;
}

static void link_established(pal_link *link, struct lws *wsi)
{
    link->up = true;
    link->pause_reading = false;
    link->read_ns = pal_clock_ns();
    /* what is not on the wire yet stays here, where something newer replaces it: after an outage the server gets the
     * newest pose and the last edges of its grasp, not thousands */
    const int unsent = LINK_UNSENT;
    setsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof unsent);
    if (link->o.read_bytes_s > 0) {
        const int small = LINK_SMALL_SOCKET;
        setsockopt(lws_get_socket_fd(wsi), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    }
    pal_control join = {.type = PAL_CONTROL_JOIN};
    memcpy(join.join.name, link->name, sizeof join.join.name);
    join.join.role = link->o.role;
    join.join.tool = link->o.tool;
    join.join.topology_deltas = link->o.topology_deltas;
    join.join.moves = true;
    pal_link_send_control(link, &join);
    link_report(link, PAL_LINK_OPEN, "");
    if (link->fixed) lws_rx_flow_control(wsi, 0);
}

int link_ws_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len)
{
    (void)user;
    pal_link *link = wsi ? lws_get_opaque_user_data(wsi) : NULL;
    if (!link) return 0;
    switch (reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        link_established(link, wsi);
        break;
    case LWS_CALLBACK_CLIENT_RECEIVE:
        if (!link->closing) link_receive(link, wsi, in, len);
        break;
    case LWS_CALLBACK_CLIENT_WRITEABLE:
        return link_write(link, wsi);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
        if (len < 2) break;
        link->close_code = ((const uint8_t *)in)[0] << 8 | ((const uint8_t *)in)[1];
        len = len - 2 < sizeof link->close_why - 1 ? len - 2 : sizeof link->close_why - 1;
        memcpy(link->close_why, (const char *)in + 2, len);
        link->close_why[len] = 0;
        break;
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
        lws_set_opaque_user_data(wsi, NULL);
        link_lost(link, !in ? "no connection"
                        : link->address.tls && strstr((const char *)in, "SSL")
                            ? "the server's certificate is not trusted, or it does not speak TLS"
                            : in);
        break;
    case LWS_CALLBACK_CLOSED_CLIENT_HTTP: /* before the handshake was answered: the library reports one or the other */
    case LWS_CALLBACK_CLIENT_CLOSED:
        lws_set_opaque_user_data(wsi, NULL);
        link_lost(link, link->close_why[0] ? link->close_why : "connection closed");
        break;
    default:
        break;
    }
    return 0;
}
