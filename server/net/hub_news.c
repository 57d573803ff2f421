#include "server/net/hub_news.h"

#include "server/base/log.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_rights.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void pal_hub_note_order(pal_client *c, const pal_wire_command *command)
{
    pal_hub_room *room = c->room;
    const pal_member_entry *m = c->member;
    pal_hub_order *order = &room->order[room->n_order++ % PAL_WIRE_ORDER_MAX];
    char text[256] = "";
    size_t n = 0;
    *order = (pal_hub_order){.order = {.id = (uint16_t)c->id}, .at_ns = pal_loop_now_ns(c->hub->loop)};
    for (uint32_t i = 0; i < command->n_arg && n < sizeof text - 1; i++)
        n += (size_t)snprintf(text + n, sizeof text - n, "%s%s %.6g", i ? " " : "", command->arg[i].key,
                              command->arg[i].value);
    pal_plain_text(order->order.name, sizeof order->order.name, m->name);
    pal_plain_text(order->order.verb, sizeof order->order.verb, command->verb);
    pal_plain_text(order->order.target, sizeof order->order.target, command->target);
    pal_plain_text(order->order.text, sizeof order->order.text, text);
    pal_log(PAL_LOG_INFO, "order", "%s (member %d of %s): %s%s%s%s%s", m->name, c->id,
            pal_session_scene(room->session)->name, command->verb, command->target[0] ? " " : "", command->target,
            text[0] ? " " : "", text);
    pal_loop_wake(c->hub->loop);
}

static void list_member(pal_wire_members *w, const pal_member_entry *from)
{
    pal_wire_member *to = &w->member[w->n_member++];
    to->id = (uint16_t)from->id;
    to->role = (pal_wire_role)from->role;
    to->tool = from->tool >= 0 ? from->tool : PAL_WIRE_TOOL_NONE;
    to->colour = pal_hub_colour(from->id);
    to->muted = from->muted;
    if (from->role == PAL_MEMBER_TRAINEE) pal_rights_text(from->rights, to->rights, sizeof to->rights);
    pal_plain_text(to->name, sizeof to->name, from->name);
}

/* members, then viewers as far as there is room */
static pal_packet *encode_members(pal_hub_room *room)
{
    pal_wire_members *w = &pal_hub_message(room->hub, PAL_CONTROL_MEMBERS)->members;
    for (int i = 0; i < PAL_MEMBER_LIST_MAX; i++)
        if (room->members.member[i].id) list_member(w, &room->members.member[i]);
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));) {
        c->listed = pal_hub_only_watches(c) && w->n_member < PAL_WIRE_MEMBER_MAX;
        if (c->listed) list_member(w, c->member);
    }
    for (int t = 0; t < room->members.n_tool; t++)
        if (room->members.tool_locked[t]) w->locked_tool[w->n_locked++] = t;
    w->locked = room->members.locked;
    return pal_hub_encode(room->hub);
}

uint64_t pal_hub_report_news(pal_hub_room *room, uint64_t now_ns)
{
    const bool orders = room->reported_order != room->n_order;
    if (!room->members_changed && !orders) return 0;
    if (room->news_ns && now_ns < room->news_ns + PAL_MEMBERS_NS) return room->news_ns + PAL_MEMBERS_NS;
    room->news_ns = now_ns;
    if (room->members_changed) pal_packet_replace(&room->members_message, encode_members(room));
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));) {
        c->members_due |= room->members_changed;
        c->peer->ops->ready(c->peer);
    }
    room->members_changed = false;
    room->reported_order = room->n_order;
    return 0;
}

pal_packet *pal_hub_next_orders(pal_client *c)
{
    const pal_hub_room *room = c->room;
    if (c->reported_order >= room->reported_order) return NULL;
    pal_wire_orders *w = &pal_hub_message(c->hub, PAL_CONTROL_ORDERS)->orders;
    const uint64_t now = pal_loop_now_ns(c->hub->loop),
                   oldest = room->reported_order - c->reported_order > PAL_WIRE_ORDER_MAX
                                ? room->reported_order - PAL_WIRE_ORDER_MAX
                                : c->reported_order;
    for (uint64_t k = oldest; k < room->reported_order; k++) {
        const pal_hub_order *order = &room->order[k % PAL_WIRE_ORDER_MAX];
        w->order[w->n_order] = order->order;
        w->order[w->n_order++].age_s = 1e-9 * (double)(now - order->at_ns);
    }
    c->reported_order = room->reported_order;
    return pal_hub_encode(c->hub);
}

/* ---- what the server does by itself ---- */

pal_hub_undo *pal_hub_undo_begin(pal_client *c, const char *verb)
{
    pal_hub_room *room = c->room;
    if (room->n_undo == PAL_UNDO_ORDERS)
        memmove(room->undo, room->undo + 1, sizeof *room->undo * (size_t)--room->n_undo);
    pal_hub_undo *undo = &room->undo[room->n_undo++];
    *undo = (pal_hub_undo){.member = c->id, .at_ns = pal_loop_now_ns(c->hub->loop)};
    snprintf(undo->verb, sizeof undo->verb, "%s", verb);
    snprintf(undo->name, sizeof undo->name, "%s", c->member->name);
    return undo;
}

void pal_hub_undo_by_command(pal_client *c, const char *verb, const pal_command *command)
{
    const uint64_t now = pal_loop_now_ns(c->hub->loop);
    pal_hub_undo *last = c->room->n_undo > 0 ? &c->room->undo[c->room->n_undo - 1] : NULL;
    if (last && last->kind == PAL_UNDO_COMMAND && last->member == c->id && now < last->at_ns + PAL_SLOW_NS &&
        last->command.kind == command->kind && last->command.body == command->body &&
        !strcmp(last->command.component, command->component)) {
        last->at_ns = now;
        return;
    }
    pal_hub_undo *undo = pal_hub_undo_begin(c, verb);
    undo->kind = PAL_UNDO_COMMAND;
    undo->command = *command;
}

void pal_hub_notice(pal_hub_room *room, const char *code, const char *format, ...)
{
    char text[400];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    pal_log(PAL_LOG_WARN, code, "%s: %s", pal_session_scene(room->session)->name, text);
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));) pal_hub_refuse(c, code, "%s", text);
}
