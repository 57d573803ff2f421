/* Input of the hub. Every message is counted, decoded (untrusted), checked for permission, and passed to the session.
 * A malformed message closes the connection with the text of the refusal. A well-formed request that cannot be granted
 * is answered with `error`. Poses of a tool that the sender does not hold are ignored. */
#include "server/net/hub_input.h"

#include "server/base/vec3.h"
#include "server/net/hub_fields.h"
#include "server/net/hub_members.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_verb.h"
#include "server/net/tuning.h"

#include <string.h>

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
        pal_hub_join(c, &in.join);
        break;
    case PAL_CONTROL_TAKE_TOOL:
        pal_hub_take_tool(c, in.tool);
        break;
    case PAL_CONTROL_RELEASE_TOOL:
        pal_hub_give_tool_back(c);
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
    const pal_member_entry *m = c->member;
    if (m->tool < 0 || m->tool != w.tool) {
        c->hub->count.n_pose_ignored++;
        if (m->role == PAL_MEMBER_VIEWER && (c->pose_error_ns == 0 || now - c->pose_error_ns > PAL_POSE_ERROR_NS)) {
            c->pose_error_ns = now;
            pal_hub_refuse(c, "role", "a viewer moves no tool");
        }
        return 0;
    }
    pal_pose p = {.buttons =
                      (w.buttons & PAL_WIRE_GRASP ? PAL_POSE_GRASP : 0) | (w.model_seq ? 0 : PAL_POSE_NO_HAPTICS),
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
    if (!c || peer->drop_code || c->hub->leaving) return;
    if (!pal_bucket_take(text ? &c->orders : &c->poses, pal_loop_now_ns(c->hub->loop))) {
        c->hub->count.n_flood++;
        pal_hub_drop(c, PAL_WIRE_CLOSE_RATE, "more than %d %s a second", text ? PAL_CONTROL_1_S : PAL_MESSAGES_1_S,
                     text ? "control messages" : "poses and acknowledgements");
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
