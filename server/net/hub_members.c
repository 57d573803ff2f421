#include "server/net/hub_members.h"

#include "server/base/log.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/hub_steering.h"
#include "server/net/transport/host_name.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"

#include <string.h>

/* ---- tools ---- */

/* takes a tool without notifying anyone */
static pal_err take_tool(pal_client *c, int wanted)
{
    pal_hub_room *room = c->room;
    int before = c->member->tool, taken = -1;
    if (wanted == PAL_WIRE_TOOL_ANY) wanted = c->grant.tool;
    if (c->grant.tool != PAL_WIRE_TOOL_ANY && wanted != c->grant.tool) return PAL_ERR_REFUSED;
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
        pal_hub_room *room = hub->room[r];
        const int tool = find_idle_tool(room, pal_loop_now_ns(hub->loop));
        pal_client *next = NULL, *holder = NULL;
        for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));) {
            if (c->waits_ns && (!next || c->waits_ns < next->waits_ns)) next = c;
            if (tool >= 0 && c->id == room->members.holder[tool]) holder = c;
        }
        if (tool < 0 || !next || !holder) continue;
        pal_hub_give_tool_back(holder);
        if (take_tool(next, tool)) continue;
        pal_hub_refuse(holder, "tool_idle", "tool %d was not moved for %d s and is held by %s now", tool,
                       (int)(PAL_IDLE_NS / 1000000000u), next->member->name);
        pal_hub_members_changed(room);
    }
}

static bool explain_take(pal_client *c, int wanted, pal_err err)
{
    pal_member_list *members = &c->room->members;
    const pal_member_entry *me = c->member;
    const bool known = wanted >= 0 && wanted < members->n_tool;
    const int holder = known ? members->holder[wanted] : 0;
    if (err == PAL_ERR_STATE && wanted == PAL_WIRE_TOOL_ANY && !c->waits_ns)
        c->waits_ns = pal_loop_now_ns(c->hub->loop);
    if (err == PAL_ERR_STATE && holder)
        return pal_hub_refuse(c, "tool_taken", "tool %d is held by %s", wanted,
                              pal_members_find(members, holder)->name);
    if (err == PAL_ERR_STATE && known)
        return pal_hub_refuse(c, "tool_locked", "an instructor has locked tool %d", wanted);
    if (err == PAL_ERR_STATE) return pal_hub_refuse(c, "tool_taken", "no tool is free");
    if (me->role == PAL_MEMBER_VIEWER) return pal_hub_refuse(c, "role", "a viewer holds no tool");
    if (me->muted) return pal_hub_refuse(c, "muted", "an instructor lets you watch only");
    if (known && c->grant.tool == PAL_WIRE_TOOL_NONE) return pal_hub_refuse(c, "ticket", "your ticket is for no tool");
    if (known) return pal_hub_refuse(c, "ticket", "your ticket is for tool %d", c->grant.tool);
    return pal_hub_refuse(c, "tool", "there is no tool %d", wanted);
}

bool pal_hub_take_tool(pal_client *c, int tool)
{
    pal_err err = take_tool(c, tool);
    if (err) return explain_take(c, tool, err);
    pal_hub_members_changed(c->room);
    return true;
}

void pal_hub_give_tool_back(pal_client *c)
{
    const int tool = c->member->tool;
    c->waits_ns = 0;
    if (tool < 0) return;
    pal_members_release_tool(&c->room->members, c->id);
    pal_hub_release_tool(c->room, tool);
    pal_packet_replace(&c->haptic, NULL);
    pal_hub_members_changed(c->room);
}

/* ---- joining ---- */

static void send_hello(pal_client *c)
{
    const pal_member_entry *m = c->member;
    pal_wire_hello *hello = &pal_hub_message(c->hub, PAL_CONTROL_HELLO)->hello;
    pal_stream_hello(c->room->stream, hello);
    pal_hub_put_plan(c->room, &hello->plan);
    hello->estimates = true;
    hello->started = c->hub->started_s;
    pal_hub_playback_marks(c->room, hello);
    hello->credit = (uint32_t)c->credit.max;
    hello->you_id = (uint16_t)m->id;
    hello->you_role = (pal_wire_role)m->role;
    hello->you_tool = m->tool >= 0 ? m->tool : PAL_WIRE_TOOL_NONE;
    pal_plain_text(hello->you_name, sizeof hello->you_name, m->name);
    pal_hub_send(c);
}

/* is there a place in the whole server for this member or viewer? Neither takes a place of the other */
static bool has_place(const pal_client *c, pal_wire_role role)
{
    const pal_hub *hub = c->hub;
    const bool watches = role == PAL_WIRE_ROLE_VIEWER;
    int n = 0, n_address = 0, kept = hub->max_members / 4, of_address = PAL_ADDRESS_PLACES;
    if (kept > PAL_INSTRUCTOR_PLACES) kept = PAL_INSTRUCTOR_PLACES;
    for (int i = 0; i < hub->max_clients; i++) {
        const pal_client *other = &hub->client[i];
        if (!other->peer || !other->id || pal_hub_only_watches(other) != watches) continue;
        n++;
        n_address += !strcmp(other->grant.address, c->grant.address);
    }
    if (role == PAL_WIRE_ROLE_INSTRUCTOR) return n < hub->max_members;
    /* from this machine comes a proxy for everybody, and whoever is here can do worse than fill places */
    const bool made_for = c->grant.ticket.uses || c->grant.ticket.user;
    const bool counted = !pal_address_is_loopback(c->grant.address) && !made_for;
    const int viewers = hub->max_viewers + (made_for ? PAL_VIEWING_TICKETS : 0);
    if (watches && of_address < hub->max_viewers / PAL_VIEWING_ADDRESSES)
        of_address = hub->max_viewers / PAL_VIEWING_ADDRESSES;
    return n < (watches ? viewers : hub->max_members - kept) && (!counted || n_address < of_address);
}

/* an id that no other viewer of the room has */
static int viewer_id(pal_hub_room *room)
{
    const pal_client *other = NULL;
    int id;
    do {
        id = PAL_MEMBER_ID_MAX + 1 + (int)(room->hub->n_viewed++ % (uint32_t)(UINT16_MAX - PAL_MEMBER_ID_MAX));
        for (other = NULL; (other = pal_hub_next_member(room, (pal_client *)other)) && other->id != id;) {
        }
    } while (other);
    return id;
}

/* FULL, STATE: as pal_members_join */
static pal_err enter_room(pal_client *c, pal_wire_role role, const char *name)
{
    static const pal_member_role roles[PAL_WIRE_ROLE_COUNT] = {PAL_MEMBER_VIEWER, PAL_MEMBER_TRAINEE,
                                                               PAL_MEMBER_INSTRUCTOR};
    pal_hub_room *room = c->room;
    if (role != PAL_WIRE_ROLE_VIEWER) {
        PAL_TRY(pal_members_join(&room->members, roles[role], name, &c->id));
        c->member = pal_members_find(&room->members, c->id);
        return PAL_ERR_OK;
    }
    if (room->members.locked) return PAL_ERR_STATE;
    c->viewer = (pal_member_entry){.id = viewer_id(room), .role = PAL_MEMBER_VIEWER, .tool = -1};
    pal_members_name(&room->members, name, c->viewer.name);
    c->id = c->viewer.id, c->member = &c->viewer;
    room->n_viewer++;
    return PAL_ERR_OK;
}

/* a member as it joins; sends nothing. false: the client is closed with the reason */
static bool enter(pal_client *c, pal_wire_role role, const char *name)
{
    const uint64_t now = pal_loop_now_ns(c->hub->loop);
    const char *full = "the server has no free place";
    pal_err err = PAL_ERR_FULL;
    int code = PAL_WIRE_CLOSE_FULL;
    if (!has_place(c, role)) {
        if (role == PAL_WIRE_ROLE_VIEWER && c->hub->relays) code = PAL_WIRE_CLOSE_ELSEWHERE;
    } else {
        full = "as many as this ticket admits are here, or have been";
        err = pal_admission_enter(c->hub->admission, &c->grant, now);
        if (!err) {
            full = "the session has no free place";
            err = enter_room(c, role, name);
            if (err) pal_admission_leave(c->hub->admission, &c->grant, now);
        }
    }
    if (!err) return true;
    c->id = 0;
    c->hub->count.n_refused_join++;
    pal_hub_drop(c, code, "%s", err == PAL_ERR_STATE ? "an instructor has locked the session" : full);
    return false;
}

void pal_hub_join(pal_client *c, const pal_wire_join *wanted)
{
    pal_hub_room *room = c->room;
    const pal_wire_role role = wanted->role < c->grant.role ? wanted->role : c->grant.role;
    if (c->id) {
        pal_hub_refuse(c, "joined", "you have joined already");
        return;
    }
    if (!enter(c, role, wanted->name)) return;
    c->hub->count.n_joined++;
    c->topology_deltas = wanted->topology_deltas;
    c->moves = wanted->moves;
    c->reported_order = room->n_order > PAL_WIRE_ORDER_MAX ? room->n_order - PAL_WIRE_ORDER_MAX : 0;
    /* nobody has looked: what the stream holds is the shape of then, and the next cycle has that of now */
    if (pal_session_observe(room->session, true)) c->sent_cycle = room->stream->cycle;
    if (room->tier_users[c->tier]++ == 0) pal_stream_begin_tier(room->stream, c->tier);
    /* hello names role and tool; refusals follow it */
    pal_err err = PAL_ERR_OK;
    if (wanted->tool != PAL_WIRE_TOOL_NONE && role != PAL_WIRE_ROLE_VIEWER) err = take_tool(c, wanted->tool);
    pal_log(PAL_LOG_INFO, "join", "%s joins %s as member %d, %s, from %s%s", c->member->name,
            pal_session_scene(room->session)->name, c->id, pal_wire_role_name(role),
            c->grant.address[0] ? c->grant.address : "this process", c->grant.has_ticket ? ", with a ticket" : "");
    send_hello(c);
    if (role < wanted->role && c->id && c->grant.has_ticket)
        pal_hub_refuse(c, "role", "your ticket is for a %s", pal_wire_role_name(role));
    else if (role < wanted->role && c->id)
        pal_hub_refuse(c, "role", "without a ticket you may only watch: use an address that the server has printed");
    if (err && c->id) explain_take(c, wanted->tool, err);
    /* a viewer beyond the list is no news to the others */
    if (pal_hub_only_watches(c) && room->members.n_member + room->n_viewer > PAL_WIRE_MEMBER_MAX)
        c->members_due = true;
    else
        pal_hub_members_changed(room);
}
