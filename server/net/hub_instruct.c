/* Verbs of instructors: rights of trainees, tools, and who stays. */
#include "server/net/hub_members.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_verb.h"

/* client of the argument `member`; NULL: an error was sent */
static pal_client *find_member(pal_client *c, const pal_wire_command *command)
{
    const double id = pal_hub_arg(command, "member", 0);
    for (pal_client *m = NULL; (m = pal_hub_next_member(c->room, m));)
        if (m->id == id) return m;
    pal_hub_refuse(c, "member", "there is no member %g", id);
    return NULL;
}

/* index of the argument `tool`; -1: an error was sent */
static int find_tool(pal_client *c, const pal_wire_command *command)
{
    const double tool = pal_hub_arg(command, "tool", -1);
    if (tool >= 0 && tool < c->room->members.n_tool && tool == (int)tool) return (int)tool;
    pal_hub_refuse(c, "tool", "there is no tool %g", tool);
    return -1;
}

/* the client that holds a tool; NULL: nobody */
static pal_client *holder_of(pal_client *c, int tool)
{
    for (pal_client *m = NULL; (m = pal_hub_next_member(c->room, m));)
        if (m->id == c->room->members.holder[tool]) return m;
    return NULL;
}

static void set_rights(pal_member_entry *member, uint32_t rights, bool enabled)
{
    member->rights = enabled ? member->rights | rights : member->rights & ~rights;
}

bool pal_hub_run_allow(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    const uint32_t rights = pal_rights_named(command->target);
    const bool enabled = pal_hub_arg(command, "enabled", 1) != 0;
    const bool all = pal_hub_arg(command, "member", 0) == 0;
    pal_member_list *members = &c->room->members;
    if (!rights) return pal_hub_refuse(c, "target", "%s: there is no right %s", verb->name, command->target);
    if (all) {
        members->rights = enabled ? members->rights | rights : members->rights & ~rights;
        for (int k = 0; k < PAL_MEMBER_LIST_MAX; k++) set_rights(&members->member[k], rights, enabled);
    } else {
        pal_client *m = find_member(c, command);
        if (!m) return false;
        set_rights(m->member, rights, enabled);
    }
    pal_hub_members_changed(c->room);
    return true;
}

bool pal_hub_run_hand_over(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    (void)verb;
    const int tool = find_tool(c, command);
    const bool to_nobody = pal_hub_arg(command, "member", 0) == 0;
    if (tool < 0) return false;
    pal_client *to = to_nobody ? NULL : find_member(c, command), *from = holder_of(c, tool);
    if (!to && !to_nobody) return false;
    if (to && to->member->role == PAL_MEMBER_VIEWER)
        return pal_hub_refuse(c, "role", "%s is a viewer, who holds no tool", to->member->name);
    if (to && to->member->muted) return pal_hub_refuse(c, "muted", "%s is muted", to->member->name);
    if (from == to) return true;
    if (from) {
        pal_hub_give_tool_back(from);
        pal_hub_refuse(from, "tool_handed_over", "%s has given tool %d to %s", c->member->name, tool,
                       to ? to->member->name : "nobody");
    }
    if (!to) return true;
    /* an instructor may give what is locked */
    const bool locked = c->room->members.tool_locked[tool];
    c->room->members.tool_locked[tool] = false;
    const bool taken = pal_hub_take_tool(to, tool);
    c->room->members.tool_locked[tool] = locked;
    return taken || pal_hub_refuse(c, "tool", "%s may not hold tool %d", to->member->name, tool);
}

bool pal_hub_run_lock(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    const bool enabled = pal_hub_arg(command, "enabled", 1) != 0;
    if (verb->detail == PAL_LOCK_SESSION) {
        c->room->members.locked = enabled;
    } else {
        const int tool = find_tool(c, command);
        if (tool < 0) return false;
        pal_client *holder = holder_of(c, tool);
        c->room->members.tool_locked[tool] = enabled;
        if (enabled && holder && holder->member->role != PAL_MEMBER_INSTRUCTOR) {
            pal_hub_give_tool_back(holder);
            pal_hub_refuse(holder, "tool_locked", "%s has locked tool %d", c->member->name, tool);
        }
    }
    pal_hub_members_changed(c->room);
    return true;
}

bool pal_hub_run_mute(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    (void)verb;
    pal_client *m = find_member(c, command);
    if (!m) return false;
    if (m->member->role == PAL_MEMBER_INSTRUCTOR)
        return pal_hub_refuse(c, "role", "%s is an instructor", m->member->name);
    m->member->muted = pal_hub_arg(command, "enabled", 1) != 0;
    if (m->member->muted) {
        pal_hub_give_tool_back(m);
        pal_hub_refuse(m, "muted", "%s lets you watch only", c->member->name);
    }
    pal_hub_members_changed(c->room);
    return true;
}

bool pal_hub_run_remove(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    pal_client *m = find_member(c, command);
    const bool ban = verb->detail == PAL_REMOVE_AND_BAN;
    if (!m) return false;
    if (m == c) return pal_hub_refuse(c, "member", "that is you");
    if (ban) pal_admission_ban(c->hub->admission, &m->grant);
    pal_hub_drop(m, PAL_WIRE_CLOSE_REMOVED, "%s has %s you", c->member->name, ban ? "banned" : "removed");
    return true;
}
