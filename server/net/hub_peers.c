/* Messages that the hub sends at once, counts of subscribers, and how a client leaves its room. */
#include "server/net/hub_peers.h"

#include "server/base/log.h"
#include "server/net/transport/plain_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void pal_hub_release_tool(pal_hub_room *room, int tool)
{
    room->tool[tool] = (pal_stream_tool){0};
    (void)pal_session_request_pose(room->session, tool, NULL);
}

uint32_t pal_hub_colour(int id)
{
    static const uint32_t colours[] = {0xFF8C42, 0x3FA7D6, 0x59CD90, 0xEE6352, 0xB388EB, 0xFAC05E,
                                       0x2EC4B6, 0xF15BB5, 0x9BC53D, 0x5C7AEA, 0xD4A373, 0x8D99AE};
    return colours[(unsigned)(id - 1) % (sizeof colours / sizeof *colours)];
}

static void request(pal_session *session, bool wanted, bool *requested, pal_command command)
{
    if (wanted == *requested) return;
    command.wanted = wanted;
    if (pal_session_command(session, &command) == PAL_ERR_OK) *requested = wanted;
}

void pal_hub_update_subscriptions(pal_hub_room *room)
{
    for (int b = 0; b < room->stream->n_part; b++) {
        request(room->session, room->n_estimate[b] > 0, &room->estimate_requested[b],
                (pal_command){.kind = PAL_COMMAND_ESTIMATE, .body = b});
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++)
            request(room->session,
                    room->subscribers.n_field[b][k] > 0 ||
                        (k == PAL_FIELD_ENERGY_J_M3 && room->subscribers.n_energy[b] > 0),
                    &room->reported[b][k], (pal_command){.kind = PAL_COMMAND_FIELD, .body = b, .field = (pal_field)k});
    }
}

void pal_hub_set_fields(pal_client *c, int part, uint32_t fields, bool interior)
{
    const uint32_t before = c->view[part];
    pal_stream_subscribers *of = &c->room->subscribers;
    for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++) {
        const bool was = before >> k & 1, is = fields >> k & 1;
        of->n_field[part][k] += is - was;
        of->n_interior[part][k] += (is && interior) - (was && c->interior[part]);
    }
    if (fields != before || interior != c->interior[part]) c->sent_values[part] = 0;
    c->view[part] = fields;
    c->interior[part] = interior;
}

void pal_hub_set_energy(pal_client *c, int part, bool wanted)
{
    c->room->subscribers.n_energy[part] += wanted - c->energy[part];
    c->energy[part] = wanted;
}

void pal_hub_set_estimate(pal_client *c, int body, bool wanted)
{
    if (c->estimate[body] == wanted) return;
    c->room->n_estimate[body] += wanted ? 1 : -1;
    c->estimate[body] = wanted;
    if (!wanted) c->estimate_due[body] = false;
}

static void unsubscribe_all(pal_client *c)
{
    for (int b = 0; b < c->room->stream->n_part; b++) {
        pal_hub_set_fields(c, b, 0, false);
        pal_hub_set_energy(c, b, false);
        pal_hub_set_estimate(c, b, false);
    }
    pal_hub_update_subscriptions(c->room);
}

/* a dropped member leaves at once, before its socket closes */
void pal_hub_leave_room(pal_client *c)
{
    pal_hub_room *room = c->room;
    while (c->n_queue > 0) pal_packet_drop(c->queue[--c->n_queue]);
    for (; c->out_begin < c->n_out; c->out_begin++) pal_packet_drop(c->out[c->out_begin]);
    c->out_begin = c->n_out = 0;
    pal_packet_replace(&c->haptic, NULL);
    c->members_due = c->status_due = false;
    c->waits_ns = 0;
    if (!c->id) return;
    unsubscribe_all(c);
    const int tool = c->member->tool;
    pal_log(PAL_LOG_INFO, "leave", "%s (member %d) leaves %s", c->member->name, c->id,
            pal_session_scene(room->session)->name);
    const bool was_seen = !pal_hub_only_watches(c) || c->listed;
    if (pal_hub_only_watches(c))
        room->n_viewer--;
    else
        pal_members_leave(&room->members, c->id);
    if (tool >= 0) pal_hub_release_tool(room, tool);
    room->tier_users[c->tier]--;
    (void)pal_session_observe(room->session, false);
    pal_admission_leave(c->hub->admission, &c->grant, pal_loop_now_ns(c->hub->loop));
    c->id = 0, c->member = NULL;
    if (was_seen) pal_hub_members_changed(room);
}

void pal_hub_drop(pal_client *client, int code, const char *format, ...)
{
    char reason[PAL_PEER_REASON];
    va_list args;
    if (client->peer->drop_code) return;
    va_start(args, format);
    vsnprintf(reason, sizeof reason, format, args);
    va_end(args);
    pal_log(PAL_LOG_INFO, "drop", "%s from %s is closed with %d: %s", client->id ? "a member" : "a client",
            client->peer->address[0] ? client->peer->address : "this process", code, reason);
    pal_peer_drop(client->peer, code, "%s", reason);
    pal_hub_leave_room(client);
}

static void queue(pal_client *c, pal_packet *packet)
{
    if (c->n_queue == PAL_HUB_QUEUE || !packet) {
        pal_packet_drop(packet);
        c->hub->count.n_overflow++;
        pal_hub_drop(c, PAL_WIRE_CLOSE_POLICY, "too many answers wait to be read");
        return;
    }
    c->queue[c->n_queue++] = packet;
    c->peer->ops->ready(c->peer);
}

pal_control *pal_hub_message(pal_hub *hub, pal_control_type type)
{
    memset(hub->control, 0, sizeof *hub->control);
    hub->control->type = type;
    return hub->control;
}

pal_packet *pal_hub_encode(pal_hub *hub)
{
    size_t n = 0;
    int refusal = pal_control_put(hub->text, PAL_CONTROL_OUT_MAX + 1, hub->control, &n);
    if (refusal) {
        pal_log(PAL_LOG_ERROR, "control", "%s is not sent: %s", pal_control_name(hub->control->type),
                pal_refusal_text(refusal));
        return NULL;
    }
    return pal_packet_create(hub->text, n, true);
}

void pal_hub_send(pal_client *client)
{
    if (!client->peer->drop_code) queue(client, pal_hub_encode(client->hub));
}

bool pal_hub_refuse(pal_client *client, const char *code, const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    pal_wire_error *error = &pal_hub_message(client->hub, PAL_CONTROL_ERROR)->error;
    pal_plain_text(error->code, sizeof error->code, code);
    pal_plain_text(error->text, sizeof error->text, text);
    pal_hub_send(client);
    return false;
}

pal_client *pal_hub_next_member(const pal_hub_room *room, pal_client *after)
{
    pal_client *end = room->hub->client + room->hub->max_clients;
    for (pal_client *c = after ? after + 1 : room->hub->client; c < end; c++)
        if (c->peer && c->room == room && c->id && !c->peer->drop_code) return c;
    return NULL;
}

bool pal_hub_only_watches(const pal_client *c)
{
    return c->id > PAL_MEMBER_ID_MAX;
}

void pal_hub_members_changed(pal_hub_room *room)
{
    room->members_changed = true;
    pal_loop_wake(room->hub->loop);
}
