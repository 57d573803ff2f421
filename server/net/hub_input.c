/* Input of the hub. Every message is counted, decoded (untrusted), checked for permission, and passed to the session.
 * A malformed message closes the connection with the text of the refusal. A well-formed request that cannot be granted
 * is answered with `error`. Poses of a tool that the sender does not hold are ignored. */
#include "server/net/hub_input.h"

#include "server/base/vec3.h"
#include "server/net/hub_fields.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/hub_verb.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"

#include <string.h>

static void leave(pal_client *c);

/* takes a tool without notifying anyone */
static pal_err take_tool(pal_client *c, int wanted)
{
    pal_hub_room *room = c->room;
    int before = pal_members_find(&room->members, c->id)->tool, taken = -1;
    PAL_TRY(pal_members_take_tool(&room->members, c->id, wanted == PAL_WIRE_TOOL_ANY ? -1 : wanted, &taken));
    if (before == taken) return PAL_ERR_OK;
    if (before >= 0) pal_hub_release_tool(room, before);
    room->tool[taken] = (pal_stream_tool){c->id, pal_hub_colour(c->id), pal_loop_now_ns(c->hub->loop)};
    room->moved_ns[taken] = room->tool[taken].taken_ns;
    c->waits_ns = 0;
    return PAL_ERR_OK;
}

/* the tool that has not been moved for the longest time, and for PAL_IDLE_NS; -1: none */
static int find_idle_tool(const pal_hub_room *room, uint64_t now_ns)
{
    int found = -1;
    for (int t = 0; t < room->members.n_tool; t++)
        if (room->members.holder[t] && now_ns - room->moved_ns[t] > PAL_IDLE_NS &&
            (found < 0 || room->moved_ns[t] < room->moved_ns[found]))
            found = t;
    return found;
}

void pal_hub_hand_over_idle_tools(pal_hub *hub)
{
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_room *room = &hub->room[r];
        const int tool = find_idle_tool(room, pal_loop_now_ns(hub->loop));
        pal_client *next = NULL, *holder = NULL;
        for (int i = 0; i < hub->max_clients; i++) {
            pal_client *c = &hub->client[i];
            if (!c->peer || !c->id || c->room != room) continue;
            if (c->waits_ns && (!next || c->waits_ns < next->waits_ns)) next = c;
            if (tool >= 0 && c->id == room->members.holder[tool]) holder = c;
        }
        if (tool < 0 || !next || !holder) continue;
        leave(holder);
        if (take_tool(next, tool)) continue;
        pal_hub_refuse(holder, "tool_idle", "tool %d was not moved for %d s and is held by %s now", tool,
                       (int)(PAL_IDLE_NS / 1000000000u), pal_members_find(&room->members, next->id)->name);
        pal_hub_members_changed(room);
    }
}

static void explain_take(pal_client *c, int wanted, pal_err err)
{
    if (err == PAL_ERR_STATE && wanted == PAL_WIRE_TOOL_ANY && !c->waits_ns)
        c->waits_ns = pal_loop_now_ns(c->hub->loop);
    pal_member_list *members = &c->room->members;
    int holder = wanted >= 0 && wanted < members->n_tool ? members->holder[wanted] : 0;
    if (err == PAL_ERR_STATE && holder)
        pal_hub_refuse(c, "tool_taken", "tool %d is held by %s", wanted, pal_members_find(members, holder)->name);
    else if (err == PAL_ERR_STATE)
        pal_hub_refuse(c, "tool_taken", "no tool is free");
    else if (pal_members_find(members, c->id)->role == PAL_MEMBER_VIEWER)
        pal_hub_refuse(c, "role", "a viewer holds no tool");
    else
        pal_hub_refuse(c, "tool", "there is no tool %d", wanted);
}

static void send_hello(pal_client *c)
{
    const pal_member_entry *m = pal_members_find(&c->room->members, c->id);
    pal_wire_hello *hello = &pal_hub_message(c->hub, PAL_CONTROL_HELLO)->hello;
    pal_stream_hello(c->room->stream, hello);
    pal_hub_put_plan(c->room, &hello->plan);
    hello->estimates = true;
    hello->credit = (uint32_t)c->credit.max;
    hello->you_id = (uint16_t)m->id;
    hello->you_role = (pal_wire_role)m->role;
    hello->you_tool = m->tool >= 0 ? m->tool : PAL_WIRE_TOOL_NONE;
    pal_plain_text(hello->you_name, sizeof hello->you_name, m->name);
    pal_hub_send(c);
}

static void join(pal_client *c, const pal_wire_join *wanted)
{
    static const pal_member_role roles[PAL_WIRE_ROLE_COUNT] = {PAL_MEMBER_VIEWER, PAL_MEMBER_TRAINEE,
                                                               PAL_MEMBER_INSTRUCTOR};
    pal_hub_room *room = c->room;
    if (c->id) {
        pal_hub_refuse(c, "joined", "you have joined already");
        return;
    }
    if (pal_members_join(&room->members, roles[wanted->role], wanted->name, &c->id)) {
        c->id = 0;
        c->hub->count.n_refused_join++;
        pal_hub_drop(c, PAL_WIRE_CLOSE_FULL, "the session has its %d members", PAL_MEMBER_LIST_MAX);
        return;
    }
    c->hub->count.n_joined++;
    c->topology_deltas = wanted->topology_deltas;
    pal_session_observe(room->session, true);
    if (room->tier_users[c->tier]++ == 0) pal_stream_begin_tier(room->stream, c->tier);
    /* hello names the granted tool; a refusal follows it */
    pal_err err = PAL_ERR_OK;
    if (wanted->tool != PAL_WIRE_TOOL_NONE && wanted->role != PAL_WIRE_ROLE_VIEWER) err = take_tool(c, wanted->tool);
    send_hello(c);
    if (err && c->id) explain_take(c, wanted->tool, err);
    pal_hub_members_changed(room);
}

static void take(pal_client *c, int tool)
{
    pal_err err = take_tool(c, tool);
    if (err)
        explain_take(c, tool, err);
    else
        pal_hub_members_changed(c->room);
}

static void leave(pal_client *c)
{
    pal_member_entry *m = pal_members_find(&c->room->members, c->id);
    int tool = m->tool;
    c->waits_ns = 0;
    if (tool < 0) return;
    pal_members_release_tool(&c->room->members, c->id);
    pal_hub_release_tool(c->room, tool);
    pal_packet_replace(&c->haptic, NULL);
    pal_hub_members_changed(c->room);
}

/* control, pose and acknowledge return why a message is malformed; 0: it is not */
static int control(pal_client *c, const uint8_t *bytes, size_t n_byte)
{
    /* decoded into a separate struct, because answers use hub->control */
    static pal_control in; /* about 30 KiB; [net] only */
    int refusal = pal_control_get((const char *)bytes, n_byte, false, &in);
    c->hub->count.n_control++;
    if (refusal) return refusal;
    if (!c->id && in.type != PAL_CONTROL_JOIN && in.type != PAL_CONTROL_PING) {
        pal_hub_drop(c, PAL_WIRE_CLOSE_POLICY, "join comes first");
        return 0;
    }
    switch (in.type) {
    case PAL_CONTROL_JOIN:
        join(c, &in.join);
        break;
    case PAL_CONTROL_TAKE_TOOL:
        take(c, in.tool);
        break;
    case PAL_CONTROL_RELEASE_TOOL:
        leave(c);
        break;
    case PAL_CONTROL_COMMAND:
        pal_hub_execute(c, &in.command);
        break;
    case PAL_CONTROL_SUBSCRIBE_FIELD:
        pal_hub_subscribe_field(c, &in.field_subscription);
        break;
    case PAL_CONTROL_PING:
        pal_hub_message(c->hub, PAL_CONTROL_PONG)->stamp_ms = in.stamp_ms;
        pal_hub_send(c);
        break;
    default:
        return PAL_REFUSAL_KIND;
    }
    return 0;
}

static int pose(pal_client *c, const uint8_t *bytes, size_t n_byte)
{
    pal_wire_pose w;
    uint64_t now = pal_loop_now_ns(c->hub->loop);
    int refusal = pal_wire_get_pose(bytes, n_byte, &w);
    c->hub->count.n_pose++;
    if (refusal) return refusal;
    const pal_member_entry *m = pal_members_find(&c->room->members, c->id);
    if (m->tool < 0 || m->tool != w.tool) {
        c->hub->count.n_pose_ignored++;
        if (m->role == PAL_MEMBER_VIEWER && (c->pose_error_ns == 0 || now - c->pose_error_ns > PAL_POSE_ERROR_NS)) {
            c->pose_error_ns = now;
            pal_hub_refuse(c, "role", "a viewer moves no tool");
        }
        return 0;
    }
    pal_pose p = {.buttons = w.buttons & PAL_WIRE_GRASP,
                  .seq = w.seq,
                  .stamp_us = w.stamp_us,
                  .commands_force = w.flags & PAL_WIRE_POSE_FORCES_ON,
                  .opening = w.grip};
    for (int i = 0; i < 3; i++) {
        p.position_m[i] = w.position_m[i];
        p.velocity_m_s[i] = w.velocity_m_s[i];
        p.force_N[i] = w.force_N[i];
    }
    for (int i = 0; i < 4; i++) p.quat[i] = w.quaternion[i];
    if (pal_dist3(p.position_m, c->room->moved_m[m->tool]) > PAL_STILL_M ||
        p.buttons != c->room->moved_buttons[m->tool]) {
        pal_copy3(c->room->moved_m[m->tool], p.position_m);
        c->room->moved_buttons[m->tool] = p.buttons;
        c->room->moved_ns[m->tool] = now;
    }
    /* a release is never refused */
    if (pal_session_request_pose(c->room->session, m->tool, w.flags & PAL_WIRE_POSE_AWAY ? NULL : &p))
        c->hub->count.n_pose_refused++;
    return 0;
}

static int acknowledge(pal_client *c, const uint8_t *bytes, size_t n_byte)
{
    pal_wire_ack ack;
    int refusal = pal_wire_get_ack(bytes, n_byte, &ack);
    c->hub->count.n_ack++;
    if (refusal) return refusal;
    if (!pal_credit_acknowledge(&c->credit, ack.cycle, pal_loop_now_ns(c->hub->loop))) return PAL_REFUSAL_RANGE;
    c->peer->ops->ready(c->peer);
    return 0;
}

void pal_hub_received(void *user, pal_peer *peer, const uint8_t *bytes, size_t n_byte, bool text)
{
    pal_client *c = peer->client;
    pal_wire_head head;
    (void)user;
    if (!c || peer->drop_code) return;
    if (!pal_bucket_take(&c->bucket, pal_loop_now_ns(c->hub->loop))) {
        c->hub->count.n_flood++;
        pal_hub_drop(c, PAL_WIRE_CLOSE_RATE, "more than 600 messages a second");
        return;
    }
    int refusal = text ? control(c, bytes, n_byte) : pal_wire_get_head(bytes, n_byte, &head);
    if (!text && !refusal) {
        if (head.kind != PAL_WIRE_POSE && head.kind != PAL_WIRE_ACK)
            refusal = PAL_REFUSAL_KIND;
        else if (!c->id)
            pal_hub_drop(c, PAL_WIRE_CLOSE_POLICY, "join comes first");
        else
            refusal = head.kind == PAL_WIRE_POSE ? pose(c, bytes, n_byte) : acknowledge(c, bytes, n_byte);
    }
    if (!refusal) return;
    c->hub->count.n_malformed++;
    pal_hub_drop(c, PAL_WIRE_CLOSE_PROTOCOL, "%s", pal_refusal_text(refusal));
}
