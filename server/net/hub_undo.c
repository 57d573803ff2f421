#include "server/net/hub_undo.h"

#include "server/base/log.h"
#include "server/net/hub_peers.h"
#include "server/net/tuning.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

pal_hub_undo *pal_hub_undo_begin(pal_client *c, const char *verb)
{
    pal_hub_room *room = c->room;
    if (room->n_undo == PAL_UNDO_ORDERS)
        memmove(room->undo, room->undo + 1, sizeof *room->undo * (size_t)--room->n_undo);
    pal_hub_undo *undo = &room->undo[room->n_undo++];
    *undo = (pal_hub_undo){.member = c->id, .at_ns = pal_loop_now_ns(c->hub->loop)};
    snprintf(undo->verb, sizeof undo->verb, "%s", verb);
    snprintf(undo->name, sizeof undo->name, "%s", pal_members_find(&room->members, c->id)->name);
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
