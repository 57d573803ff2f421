#include "clients/lcm_bridge/lcm_bridge.h"
#include "clients/lcm_bridge/lcm_orders.h"
#include "clients/lcm_bridge/tuning.h"
#include "clients/link/asset_store.h"
#include "clients/link/lcm_convert.h"
#include "clients/link/lcm_seal.h"
#include "clients/link/triangle_table.h"
#include "palpate_body_frame_t.h"
#include "palpate_order_t.h"
#include "palpate_session_status_t.h"
#include "palpate_triangles_t.h"
#include "protocol/frame_codec.h"
#include "server/base/clock.h"
#include "server/base/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STATUS_VERSION 2 /* of messages that have changed */
#define BODY_VERSION   2
#define POSE_RATE_HZ   245.0 /* the server allows 250 */
#define POSE_BURST     10.0
#define POSE_EDGES     4.0 /* of these for states at which the grasp changes */
#define SILENCE_NS     5000000000u
#define REPEAT_NS      1000000000u
#define RESTARTED_NS   1000000000u  /* after this pause a sender without seal may count from the start again */
#define OTHER_NS       60000000000u /* between two warnings of another bridge */

typedef struct bridge_tool {
    pal_lcm_bridge *bridge;
    pal_link *link; /* NULL: no member */
    int index;
    double tokens;
    bool grasps; /* in the last pose */
    uint32_t seq;
    uint64_t last_ns, source; /* of the last state */
} bridge_tool;

typedef struct bridge_part {
    uint8_t *bytes; /* newest frame [n_byte] */
    size_t n_byte, cap;
    pal_frame_head head;
    uint64_t sent_ns;
    bool waits; /* the frame for its triangles */
    /* of a part that adapts */
    pal_triangle_table table; /* n_slot 0: it does not */
    const pal_stored_asset *asset;
    uint64_t change, table_sent;           /* with which the frame is shown; that was sent, UINT64_MAX: none */
    uint64_t table_due_ns, table_again_ns; /* when another change, and the same one, may be sent */
} bridge_part;

struct pal_lcm_bridge {
    pal_link_loop *loop;
    pal_lcm_link *lcm;
    pal_link *watcher;
    char server[PAL_WIRE_TEXT_BYTES + PAL_WIRE_NAME_BYTES + 16], session[PAL_WIRE_NAME_BYTES],
        organ[PAL_WIRE_TEXT_BYTES];
    bool named;
    pal_wire_role role; /* of the watcher */
    pal_wire_topology topology;
    pal_wire_status status; /* the last one */
    pal_asset_store *store;
    pal_lcm_orders orders;
    bridge_part part[PAL_WIRE_PART_MAX];
    bridge_tool tool[PAL_WIRE_TOOL_MAX];
    uint32_t status_seq, n_tool;
    uint64_t status_ns, logged_ns, other_ns; /* when a refusal, and another bridge, were last logged */
    pal_lcm_bridge_counts count;
};

static void bridge_body(pal_lcm_bridge *b, uint32_t index)
{
    bridge_part *part = &b->part[index];
    part->sent_ns = pal_clock_ns();
    part->waits = false;
    const palpate_body_frame_t frame = {.utime = (int64_t)part->head.sim_time_us,
                                        .epoch = (int32_t)part->head.epoch,
                                        .seq = (int32_t)part->head.seq,
                                        .version = BODY_VERSION,
                                        .part = (int16_t)index,
                                        .cycle = (int32_t)part->head.cycle,
                                        .change = (int64_t)part->change,
                                        .size = (int32_t)part->n_byte,
                                        .payload = part->bytes};
    if (pal_lcm_link_publish(b->lcm, b->session, "BODY", (int)index, palpate_body_frame_t_get_type_info(), &frame))
        b->count.n_frame_dropped++;
    else
        b->count.n_frame++;
}

/* the present triangles of a part that adapts, whose asset is there */
static void bridge_triangles(pal_lcm_bridge *b, uint32_t index)
{
    bridge_part *part = &b->part[index];
    const pal_triangle_table *table = &part->table;
    const uint32_t n = pal_triangle_table_count(table);
    int32_t *corner = malloc(sizeof *corner * 3 * (n + 1));
    if (!corner) return;
    palpate_triangles_t t = {.utime = (int64_t)(pal_clock_ns() / 1000),
                             .change = (int64_t)table->revision,
                             .epoch = (int32_t)b->topology.part[index].epoch,
                             .version = PAL_LCM_VERSION,
                             .part = (int16_t)index,
                             .corner = corner};
    for (uint32_t i = 0; i < table->n_slot; i++) {
        const uint32_t *tri = table->tri + 3 * (size_t)i;
        if (tri[0] == tri[1]) continue; /* an empty slot */
        for (int k = 0; k < 3; k++) corner[t.n_corner++] = (int32_t)tri[k];
    }
    const uint64_t now = pal_clock_ns(), took = (uint64_t)(4e9 * t.n_corner / PAL_TRIANGLES_BYTES_S);
    part->table_sent = table->revision;
    part->table_due_ns = now + took;
    part->table_again_ns = now + (took * PAL_TRIANGLES_REPEAT > REPEAT_NS ? took * PAL_TRIANGLES_REPEAT : REPEAT_NS);
    if (!pal_lcm_link_publish(b->lcm, b->session, "TRIANGLES", (int)index, palpate_triangles_t_get_type_info(), &t))
        b->count.n_triangles++;
    free(corner);
}

/* the newest frame, behind the triangles that it is shown with; it waits for the asset, or while these have no turn */
static void bridge_show(pal_lcm_bridge *b, uint32_t index)
{
    bridge_part *part = &b->part[index];
    if (part->n_byte == 0) return;
    part->waits = true;
    if (part->table.n_slot) {
        /* a change stands right before its own frame: the last one is for other triangles */
        if (!part->table.based || part->change != part->table.revision) return;
        if (part->table_sent != part->change) {
            if (pal_clock_ns() < part->table_due_ns) return;
            bridge_triangles(b, index);
        }
    }
    bridge_body(b, index);
}

/* the tables begin with the triangles of the assets, which are fetched */
static void begin_triangles(pal_lcm_bridge *b)
{
    for (uint32_t i = 0; i < b->topology.n_part; i++) {
        const pal_wire_part_info *info = &b->topology.part[i];
        bridge_part *part = &b->part[i];
        pal_triangle_table_free(&part->table);
        part->asset = NULL, part->waits = false;
        part->change = part->table_due_ns = 0, part->table_sent = UINT64_MAX;
        if (!info->is_adaptive || pal_triangle_table_init(&part->table, info->n_triangle, info->n_vertex)) continue;
        part->asset = pal_asset_store_request(b->store, info->asset);
        if (part->asset && part->asset->ready) (void)pal_triangle_table_set_base(&part->table, part->asset->asset);
    }
}

static void asset_changed(void *user, const pal_stored_asset *asset)
{
    pal_lcm_bridge *b = user;
    if (asset->failed) pal_log(PAL_LOG_WARN, "asset", "%s: %s", asset->path, asset->reason);
    for (uint32_t i = 0; i < b->topology.n_part; i++) {
        bridge_part *part = &b->part[i];
        if (part->asset != asset) continue;
        /* without its asset a part is shown without triangles */
        if (!asset->ready || pal_triangle_table_set_base(&part->table, asset->asset))
            pal_triangle_table_free(&part->table), part->change = 0;
        if (part->waits) bridge_show(b, i);
    }
}

static void take_triangles(pal_lcm_bridge *b, const uint8_t *bytes, size_t n_byte)
{
    pal_topology_delta_head head;
    if (pal_topology_delta_get_head(bytes, n_byte, &head) || head.part >= b->topology.n_part) return;
    bridge_part *part = &b->part[head.part];
    if (part->table.n_slot) (void)pal_triangle_table_apply(&part->table, bytes, n_byte, &head);
}

/* server's status, or NULL when there is no server */
static void bridge_status(pal_lcm_bridge *b, const pal_wire_status *s)
{
    static const pal_wire_status none;
    const bool running = s != NULL;
    if (!s) s = &none;
    const uint32_t n_part = b->topology.n_part;
    int32_t epoch[PAL_WIRE_PART_MAX];
    char *asset[PAL_WIRE_PART_MAX];
    for (uint32_t i = 0; i < n_part; i++) {
        epoch[i] = (int32_t)b->topology.part[i].epoch;
        asset[i] = b->topology.part[i].asset;
    }
    char diag[PAL_WIRE_TEXT_BYTES];
    memcpy(diag, s->diag, sizeof diag);
    const palpate_session_status_t status = {.utime = (int64_t)(pal_clock_ns() / 1000),
                                             .seq = (int32_t)++b->status_seq,
                                             .version = STATUS_VERSION,
                                             .state = running ? (s->frozen ? 3 : (s->paused ? 2 : 1)) : 0,
                                             .session = b->session,
                                             .organ = b->organ,
                                             .server = b->server,
                                             .tick = (int64_t)s->tick,
                                             .sim_time_s = s->sim_time_s,
                                             .step_rate_hz = (float)s->step_rate_hz,
                                             .slowdown = (float)s->slowdown,
                                             .step_ms = (float)s->step_ms,
                                             .substeps = (int32_t)s->substeps,
                                             .members = (int32_t)s->n_member,
                                             .late = (int32_t)s->n_late,
                                             .refused = (int32_t)s->n_refused,
                                             .n_frame = (int32_t)b->count.n_frame,
                                             .n_frame_dropped = (int32_t)b->count.n_frame_dropped,
                                             .n_state = (int32_t)b->count.n_state,
                                             .n_state_refused = (int32_t)b->count.n_state_refused,
                                             .n_order = (int32_t)b->orders.n_order,
                                             .n_order_refused = (int32_t)b->orders.n_refused,
                                             .role = running ? (int16_t)b->role : -1,
                                             .n_tool = (int32_t)b->n_tool,
                                             .n_part = (int8_t)n_part,
                                             .epoch = epoch,
                                             .asset = asset,
                                             .diag = diag};
    b->status_ns = pal_clock_ns();
    if (!pal_lcm_link_publish(b->lcm, b->session, "STATUS", -1, palpate_session_status_t_get_type_info(), &status))
        b->count.n_status++;
}

static void bridge_frame(pal_lcm_bridge *b, const uint8_t *bytes, size_t n_byte)
{
    pal_frame_head head;
    if (pal_frame_get_head(bytes, n_byte, &head) || head.part >= b->topology.n_part) return;
    bridge_part *part = &b->part[head.part];
    if (head.epoch != b->topology.part[head.part].epoch) return; /* of the asset before */
    if (n_byte > part->cap) {
        uint8_t *grown = realloc(part->bytes, n_byte);
        if (!grown) return;
        part->bytes = grown;
        part->cap = n_byte;
    }
    memcpy(part->bytes, bytes, n_byte);
    part->n_byte = n_byte;
    part->head = head;
    part->change = part->table.revision;
    bridge_show(b, head.part);
}

static void watcher_message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    pal_lcm_bridge *b = user;
    if (head->kind == PAL_WIRE_FRAME) bridge_frame(b, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOPOLOGY_DELTA) take_triangles(b, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOOLS) pal_link_acknowledge(b->watcher, bytes, n_byte);
}

static void watcher_control(void *user, const pal_control *c)
{
    pal_lcm_bridge *b = user;
    pal_lcm_orders_control(&b->orders, c);
    if (c->type == PAL_CONTROL_MOVE) {
        /* links of tools that are open move by themselves; this is for those opened later */
        snprintf(b->server, sizeof b->server, "%s?session=%s", c->move.address, c->move.session);
        pal_asset_store_move(b->store, c->move.address, c->move.session);
    }
    if (c->type == PAL_CONTROL_HELLO) {
        if (!b->named) memcpy(b->session, c->hello.session, sizeof b->session);
        memcpy(b->organ, c->hello.organ, sizeof b->organ);
        b->n_tool = c->hello.n_tool;
        b->role = c->hello.you_role;
        b->status = (pal_wire_status){.step_rate_hz = c->hello.step_rate_hz, .slowdown = 1};
        b->topology.n_part = c->hello.n_part;
        memcpy(b->topology.part, c->hello.part, sizeof b->topology.part);
        for (int i = 0; i < PAL_WIRE_PART_MAX; i++) b->part[i].n_byte = 0;
        begin_triangles(b);
        pal_log(PAL_LOG_INFO, "lcm_joined", "session %s: %s", b->session, b->organ);
    }
    if (c->type == PAL_CONTROL_STATUS) b->status = c->status;
    if (c->type == PAL_CONTROL_TOPOLOGY) {
        b->topology = c->topology;
        for (int i = 0; i < PAL_WIRE_PART_MAX; i++) b->part[i].n_byte = 0;
        begin_triangles(b);
    }
    /* the others too: listeners learn the assets before the first frame of theirs */
    if (c->type == PAL_CONTROL_STATUS || c->type == PAL_CONTROL_TOPOLOGY || c->type == PAL_CONTROL_HELLO)
        bridge_status(b, &b->status);
}

static void watcher_state(void *user, pal_link_state state, int code, const char *reason)
{
    pal_lcm_bridge *b = user;
    if (state == PAL_LINK_LOST || state == PAL_LINK_ENDED) {
        pal_log(state == PAL_LINK_ENDED ? PAL_LOG_WARN : PAL_LOG_DEBUG, "lcm_server", "%d %s", code, reason);
        for (int i = 0; i < PAL_WIRE_PART_MAX; i++) b->part[i].n_byte = 0;
    }
    if (state != PAL_LINK_ENDED) return;
    b->count.refused = true;
    pal_link_stop(b->loop);
}

/* the member of one tool */
static void tool_message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    bridge_tool *tool = user;
    pal_lcm_bridge *b = tool->bridge;
    pal_wire_haptic haptic;
    if (head->kind == PAL_WIRE_TOOLS) pal_link_acknowledge(tool->link, bytes, n_byte);
    if (head->kind != PAL_WIRE_HAPTIC || pal_wire_get_haptic(bytes, n_byte, &haptic) || haptic.tool != tool->index)
        return;
    palpate_haptic_model_t model;
    palpate_contact_patch_t patch[PAL_WIRE_CONTACT_PATCH_MAX];
    pal_lcm_from_haptic(&haptic, &model, patch);
    if (!pal_lcm_link_publish(b->lcm, b->session, "HMODEL", tool->index, palpate_haptic_model_t_get_type_info(),
                              &model))
        b->count.n_model++;
}

static void tool_control(void *user, const pal_control *c)
{
    bridge_tool *tool = user;
    if (c->type == PAL_CONTROL_ERROR) pal_log(PAL_LOG_WARN, "lcm_tool", "tool %d: %s", tool->index, c->error.text);
}

static void tool_state(void *user, pal_link_state state, int code, const char *reason)
{
    bridge_tool *tool = user;
    if (state == PAL_LINK_ENDED) pal_log(PAL_LOG_WARN, "lcm_tool", "tool %d: %d %s", tool->index, code, reason);
}

static const pal_link_events tool_events = {.state = tool_state, .control = tool_control, .message = tool_message};

static void tool_open(pal_lcm_bridge *b, bridge_tool *tool)
{
    char name[PAL_WIRE_MEMBER_NAME];
    snprintf(name, sizeof name, "lcm tool %d", tool->index);
    const pal_link_options options = {.url = b->server,
                                      .name = name,
                                      .role = PAL_WIRE_ROLE_TRAINEE,
                                      .tool = tool->index,
                                      .events = &tool_events,
                                      .user = tool};
    if (pal_link_open(b->loop, &options, NULL, &tool->link)) tool->link = NULL;
    b->count.n_tool += tool->link != NULL;
}

/* Does a state follow the last one? Its number grows, by no more than so many states as come in the time since. A
 * sender that begins anew is another source, or unsealed and was silent */
static bool follows(const bridge_tool *tool, uint64_t source, uint32_t seq, uint64_t silence_ns)
{
    if (!tool->link || source != tool->source || (!source && silence_ns >= RESTARTED_NS)) return true;
    return pal_seal_follows(seq, tool->seq, silence_ns);
}

/* a tool_state_t (lcmtypes/) that passed the walk */
static void bridge_state(pal_lcm_bridge *b, int index, const void *bytes, size_t n_byte, uint64_t source)
{
    bridge_tool *tool = &b->tool[index];
    pal_wire_pose pose;
    const uint64_t now = pal_clock_ns();
    if (pal_lcm_to_pose(bytes, n_byte, &pose) || pose.tool != index) {
        b->count.n_state_refused++;
        return;
    }
    const uint64_t silence = now - tool->last_ns;
    if (!follows(tool, source, pose.seq, silence)) {
        b->count.n_state_refused++;
        return;
    }
    b->count.n_state++;
    tool->last_ns = now;
    tool->seq = pose.seq;
    tool->source = source;
    tool->tokens = tool->tokens + POSE_RATE_HZ * 1e-9 * (double)silence;
    if (tool->tokens > POSE_BURST) tool->tokens = POSE_BURST;
    if (!tool->link) tool_open(b, tool);
    const bool grasps = pose.buttons & PAL_WIRE_GRASP;
    const double needed = grasps == tool->grasps ? 1 + POSE_EDGES : 1;
    if (!tool->link || pal_link_tool(tool->link) != index || tool->tokens < needed) return;
    tool->tokens -= 1;
    tool->grasps = grasps;
    pal_link_send_pose(tool->link, &pose);
}

/* two rigs that call their sessions the same on one bus move each other's tools */
static void hear_other(pal_lcm_bridge *b, uint64_t source)
{
    const uint64_t now = pal_clock_ns();
    if (source == pal_lcm_link_source(b->lcm) || (b->other_ns && now - b->other_ns < OTHER_NS)) return;
    b->other_ns = now;
    b->count.n_other++;
    pal_log(
        PAL_LOG_WARN, "lcm_session",
        "another palpate-lcm takes the session %s to the channels %s of this bus: give each rig its own with --channel",
        b->session, pal_lcm_link_prefix(b->lcm));
}

static bool is_channel(const pal_lcm_bridge *b, const char *channel, const char *what)
{
    char own[PAL_LCM_CHANNEL_MAX + 1];
    pal_lcm_channel(own, pal_lcm_link_prefix(b->lcm), b->session, what, -1);
    return !strcmp(channel, own);
}

/* -1: not of a tool of this session */
static int tool_of(const pal_lcm_bridge *b, const char *channel)
{
    const int index = pal_lcm_channel_index(channel, pal_lcm_link_prefix(b->lcm), b->session, "TOOL");
    return index < PAL_WIRE_TOOL_MAX ? index : -1;
}

/* what other sessions of the bus say is no concern of this one, whoever has signed it */
static bool bridge_lcm_wants(void *user, const char *channel)
{
    const pal_lcm_bridge *b = user;
    return b->session[0] &&
           (tool_of(b, channel) >= 0 || is_channel(b, channel, "ORDER") || is_channel(b, channel, "STATUS"));
}

static void bridge_lcm_message(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source)
{
    pal_lcm_bridge *b = user;
    const int index = tool_of(b, channel);
    if (is_channel(b, channel, "ORDER"))
        pal_lcm_orders_take(&b->orders, bytes, n_byte, source, pal_clock_ns());
    else if (is_channel(b, channel, "STATUS"))
        hear_other(b, source);
    else if ((uint32_t)index < b->n_tool)
        bridge_state(b, index, bytes, n_byte, source);
    else
        b->count.n_state_refused++;
}

static void bridge_lcm_refused(void *user, const char *channel, const char *reason)
{
    pal_lcm_bridge *b = user;
    const uint64_t now = pal_clock_ns();
    b->count.n_state_refused++;
    const bool logged = b->logged_ns && now - b->logged_ns < REPEAT_NS;
    pal_log(logged ? PAL_LOG_DEBUG : PAL_LOG_WARN, "lcm_refused", "%.63s: %s", channel, reason);
    if (!logged) b->logged_ns = now, b->count.n_logged++;
}

/* four times a second: releases tools without states, requests tools that were refused, and repeats parts at rest and
 * the status */
static void bridge_tidy(void *user)
{
    pal_lcm_bridge *b = user;
    const uint64_t now = pal_clock_ns();
    for (int i = 0; i < PAL_WIRE_TOOL_MAX; i++) {
        bridge_tool *tool = &b->tool[i];
        if (!tool->link) continue;
        if (now - tool->last_ns > SILENCE_NS || pal_link_current_state(tool->link) == PAL_LINK_ENDED) {
            pal_link_close(tool->link);
            tool->link = NULL;
            b->count.n_tool--;
        } else if (pal_link_current_state(tool->link) == PAL_LINK_JOINED && pal_link_tool(tool->link) != i) {
            pal_link_send_control(tool->link, &(pal_control){.type = PAL_CONTROL_TAKE_TOOL, .tool = i});
        }
    }
    for (uint32_t i = 0; i < b->topology.n_part; i++) {
        bridge_part *part = &b->part[i];
        if (part->n_byte == 0) continue;
        if (part->waits)
            bridge_show(b, i);
        else if (part->table.n_slot && part->table_sent == part->table.revision && now > part->table_again_ns)
            bridge_triangles(b, i);
        if (!part->waits && now - part->sent_ns > REPEAT_NS) bridge_body(b, i);
    }
    if (pal_link_current_state(b->watcher) != PAL_LINK_JOINED && now - b->status_ns > REPEAT_NS && b->session[0])
        bridge_status(b, NULL);
}

pal_err pal_lcm_bridge_open(pal_link_loop *loop, const pal_lcm_bridge_options *options, pal_diagnostic *diag,
                            pal_lcm_bridge **out)
{
    static const pal_link_events watcher_events = {
        .state = watcher_state, .control = watcher_control, .message = watcher_message};
    static const pal_lcm_events lcm_events = {bridge_lcm_wants, bridge_lcm_message, bridge_lcm_refused};
    pal_lcm_bridge *b = calloc(1, sizeof *b);
    if (!b) return PAL_ERR_MEMORY;
    b->loop = loop;
    snprintf(b->server, sizeof b->server, "%s", options->server);
    b->named = options->session != NULL;
    if (b->named) snprintf(b->session, sizeof b->session, "%s", options->session);
    for (int i = 0; i < PAL_WIRE_TOOL_MAX; i++) b->tool[i] = (bridge_tool){.bridge = b, .index = i};
    const pal_link_options link = {.url = b->server,
                                   .name = "palpate-lcm",
                                   .role = PAL_WIRE_ROLE_INSTRUCTOR,
                                   .tool = PAL_WIRE_TOOL_NONE,
                                   .topology_deltas = true,
                                   .events = &watcher_events,
                                   .user = b};
    pal_err err = pal_lcm_link_open(loop, &options->lcm, &lcm_events, b, diag, &b->lcm);
    if (!err) err = pal_lcm_link_subscribe(b->lcm, ".*/TOOL/.*", palpate_tool_state_t_get_type_info());
    if (!err) err = pal_lcm_link_subscribe(b->lcm, ".*/ORDER", palpate_order_t_get_type_info());
    if (!err) err = pal_lcm_link_subscribe(b->lcm, ".*/STATUS", palpate_session_status_t_get_type_info());
    if (!err && !(b->store = pal_asset_store_create(loop, b->server, asset_changed, b))) err = PAL_ERR_MEMORY;
    if (!err) err = pal_link_open(loop, &link, diag, &b->watcher);
    b->orders = (pal_lcm_orders){.lcm = b->lcm, .session = b->session, .link = b->watcher, .tokens = PAL_ORDERS_BURST};
    if (!err && !pal_link_add_timer(loop, 250000, bridge_tidy, b)) err = PAL_ERR_MEMORY;
    if (err) {
        pal_link_close(b->watcher);
        pal_lcm_link_close(b->lcm);
        pal_asset_store_destroy(b->store);
        free(b);
        return err;
    }
    *out = b;
    return PAL_ERR_OK;
}

void pal_lcm_bridge_close(pal_lcm_bridge *bridge)
{
    if (!bridge) return;
    pal_lcm_link_close(bridge->lcm);
    for (int i = 0; i < PAL_WIRE_PART_MAX; i++) {
        free(bridge->part[i].bytes);
        pal_triangle_table_free(&bridge->part[i].table);
    }
    pal_asset_store_destroy(bridge->store);
    free(bridge);
}

pal_lcm_bridge_counts pal_lcm_bridge_count(const pal_lcm_bridge *bridge)
{
    pal_lcm_bridge_counts count = bridge->count;
    count.n_order = bridge->orders.n_order, count.n_order_refused = bridge->orders.n_refused;
    return count;
}
