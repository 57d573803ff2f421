#include "server/net/hub_undo.h"

#include "server/base/log.h"
#include "server/net/hub_peers.h"

#include <stdarg.h>
#include <stdio.h>

pal_hub_undo *pal_hub_undo_begin(pal_client *c, const char *verb)
{
    pal_hub_undo *undo = &c->room->undo;
    *undo = (pal_hub_undo){.member = c->id, .at_ns = pal_loop_now_ns(c->hub->loop)};
    snprintf(undo->verb, sizeof undo->verb, "%s", verb);
    snprintf(undo->name, sizeof undo->name, "%s", pal_members_find(&c->room->members, c->id)->name);
    return undo;
}

void pal_hub_undo_by_command(pal_client *c, const char *verb, const pal_command *command)
{
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
