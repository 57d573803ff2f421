#include "clients/link/tool_client.h"
#include "server/base/clock.h"

#include <string.h>

/* between two sends of a pose: a few of them fit into the time that one lasts */
enum { REPEAT_US = 50000 };

static void end(pal_tool_client *c, pal_err err)
{
    c->err = err;
    pal_link_stop(c->loop);
}

/* both must have come, in either order */
static void begin_when_ready(pal_tool_client *c)
{
    if (!c->rest || !c->rest->ready || pal_link_current_state(c->link) != PAL_LINK_JOINED) return;
    if (pal_asset_extreme_vertex(c->rest->asset, c->up, c->top_m))
        c->ready(c);
    else
        end(c, PAL_REFUSE(c->diag, "the first part of the session has no vertex"));
}

static void on_asset(void *user, const pal_stored_asset *stored)
{
    pal_tool_client *c = user;
    if (stored->failed)
        end(c, PAL_REFUSE(c->diag, "%s: %s", stored->path, stored->reason));
    else
        begin_when_ready(c);
}

static void on_control(void *user, const pal_control *message)
{
    pal_tool_client *c = user;
    const pal_wire_move *to = &message->move;
    if (message->type == PAL_CONTROL_MOVE) pal_asset_store_move(c->store, to->address, to->session);
    if (message->type != PAL_CONTROL_HELLO) return;
    const int tool = message->hello.you_tool;
    if (tool < 0) {
        end(c, PAL_REFUSE(c->diag, "no tool is free"));
        return;
    }
    memcpy(c->up, message->hello.up, sizeof c->up);
    c->radius_m = message->hello.tool[tool].radius_m;
    c->rest = pal_asset_store_request(c->store, message->hello.part[0].asset);
    if (!c->rest)
        end(c, pal_diagnostic_set(c->diag, PAL_ERR_MEMORY, "out of memory"));
    else if (c->rest->failed)
        on_asset(c, c->rest);
}

static void on_state(void *user, pal_link_state state, int code, const char *reason)
{
    pal_tool_client *c = user;
    if (state == PAL_LINK_JOINED) begin_when_ready(c);
    if (state == PAL_LINK_ENDED) end(c, PAL_REFUSE(c->diag, "the server refuses: %d %s", code, reason));
}

static void on_message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    pal_tool_client *c = user;
    const int tool = pal_link_tool(c->link);
    pal_wire_tools tools;
    if (head->kind != PAL_WIRE_TOOLS || pal_wire_get_tools(bytes, n_byte, &tools)) return;
    pal_link_acknowledge(c->link, bytes, n_byte);
    if (tool < 0 || (uint32_t)tool >= tools.n_tool || tools.tool[tool].echo_seq != c->pose.seq ||
        c->n_moved == c->pose.seq)
        return;
    c->n_moved = c->pose.seq;
    c->moved(c, &tools.tool[tool]);
}

static pal_err send_pose(pal_tool_client *c)
{
    const int tool = pal_link_tool(c->link);
    if (tool < 0) return PAL_ERR_STATE;
    c->pose.tool = (uint16_t)tool;
    return pal_link_send_pose(c->link, &c->pose);
}

pal_err pal_tool_client_move(pal_tool_client *c, const double position_m[3], bool grasps)
{
    if (pal_link_tool(c->link) < 0) return PAL_ERR_STATE;
    c->pose = (pal_wire_pose){.flags = PAL_WIRE_POSE_POSE_ONLY,
                              .seq = c->pose.seq + 1,
                              .stamp_us = pal_clock_ns() / 1000,
                              .quaternion = {1},
                              .buttons = grasps ? PAL_WIRE_GRASP : 0};
    memcpy(c->pose.position_m, position_m, sizeof c->pose.position_m);
    return send_pose(c);
}

/* a step that comes late has dropped the pose: it would never be answered */
static void repeat(void *user)
{
    pal_tool_client *c = user;
    if (c->pose.seq > 0 && c->n_moved != c->pose.seq) (void)send_pose(c);
}

void pal_tool_client_stop(pal_tool_client *c)
{
    end(c, PAL_ERR_OK);
}

pal_err pal_tool_client_run(pal_tool_client *c, const char *url, double seconds, pal_diagnostic *diag)
{
    static const pal_link_events events = {on_state, .control = on_control, .message = on_message};
    const pal_link_options options = {
        .url = url, .role = PAL_WIRE_ROLE_TRAINEE, .tool = PAL_WIRE_TOOL_ANY, .events = &events, .user = c};
    c->diag = diag;
    c->err = pal_diagnostic_set(diag, PAL_ERR_MEMORY, "out of memory");
    if (pal_link_loop_create(&c->loop)) return c->err;
    c->store = pal_asset_store_create(c->loop, url, on_asset, c);
    if (c->store && pal_link_add_timer(c->loop, REPEAT_US, repeat, c))
        c->err = pal_link_open(c->loop, &options, diag, &c->link);
    if (!c->err) {
        c->err = pal_diagnostic_set(diag, PAL_ERR_STATE, "the time is over");
        pal_link_run_for(c->loop, seconds);
    }
    /* destroying the loop fails what is under way, which calls back */
    const pal_diagnostic message = *diag;
    const pal_err err = c->err;
    pal_link_loop_destroy(c->loop);
    pal_asset_store_destroy(c->store);
    c->rest = NULL;
    *diag = message;
    return err;
}
