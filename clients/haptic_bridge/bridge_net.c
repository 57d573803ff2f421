#include "clients/haptic_bridge/bridge_net.h"
#include "clients/haptic_bridge/tuning.h"
#include "clients/link/asset_store.h"
#include "clients/link/lcm_convert.h"
#include "clients/link/lcm_link.h"
#include "palpate_haptic_config_t.h"
#include "palpate_haptic_event_t.h"
#include "palpate_haptic_status_t.h"
#include "palpate_session_status_t.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/base/vec3.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RESTARTED_NS 1000000000u /* after this pause a server on LCM may count from the start again */

#define TOUCH_FORCE_N 0.05 /* a force that a hand notices */

enum { POSE_PERIOD_US = 4000, EVENT_PERIOD_US = 20000, STATUS_PERIOD_US = 100000, EVENT_KEEP = 16, EVENT_REPEATS = 3 };

struct pal_bridge_net {
    pal_link_loop *loop;
    pal_servo *servo;
    pal_servo_thread *thread;
    pal_bridge_net_options o;
    pal_link *link;    /* websocket, or NULL */
    pal_lcm_link *lcm; /* LCM, or NULL       */
    pal_asset_store *store;
    const pal_stored_asset *asset;
    double radius_m;
    uint32_t generation, pose_seq, echo_seq, model_newest, event_seq, status_seq;
    uint64_t joined_ns, model_ns, n_status;
    bool placed;           /* the place of the workspace is known */
    bool counts_from_here; /* the next model is the first of its session */
    bool has_up;
    double up[3]; /* of the device, in the world */
    pal_workspace_frame frame;
    bool touched; /* the device has rendered a force; it is reported once */
    pal_servo_view view;
    pal_servo_timing timing;
    pal_hand_brush brush;
    struct {
        palpate_haptic_event_t event;
        int left;
    } pending[EVENT_KEEP];
    int next_pending;
    pal_bridge_net_counts count;
};

static void net_model(pal_bridge_net *n, const pal_wire_haptic *model)
{
    n->count.n_model++;
    n->model_ns = pal_clock_ns();
    const int32_t ahead = (int32_t)(model->seq - n->model_newest);
    if (n->counts_from_here || ahead > 0) n->model_newest = model->seq;
    if (!n->counts_from_here && ahead > 1) n->count.n_model_lost += (uint64_t)ahead - 1;
    n->counts_from_here = false;
    const uint64_t now_us = n->model_ns / 1000, back_us = model->echo_stamp_us + model->hold_us;
    if (model->echo_seq != 0 && model->echo_seq != n->echo_seq && back_us <= now_us) {
        n->echo_seq = model->echo_seq;
        pal_jitter_add(&n->count.rtt, (now_us - back_us) * 1000);
    }
    pal_servo_put_model(n->servo, model, n->generation, pal_clock_now_ns(n->o.servo.clock));
}

/* Places the workspace: its up is the scene's, and its centre, unless given, where the tool's centre touches the organ
 * at rest from above. No pose is sent before, because it could lie within the organ */
static void net_place(pal_bridge_net *n)
{
    n->frame.scale = n->o.servo.scale;
    pal_copy3(n->frame.origin_m, n->o.servo.origin_m);
    pal_workspace_rotation(n->up, n->frame.rotation);
    if (!n->o.has_origin && n->asset) {
        if (!n->asset->ready && !n->asset->failed) return;
        double point[3];
        if (n->asset->ready && pal_asset_extreme_vertex(n->asset->asset, n->up, point)) {
            pal_axpy3(point, n->radius_m, n->up);
            pal_copy3(n->frame.origin_m, point);
        }
    }
    n->placed = true;
    pal_servo_put_frame(n->servo, &n->frame);
}

static void net_asset(void *user, const pal_stored_asset *asset)
{
    pal_bridge_net *n = user;
    if (asset->failed) pal_log(PAL_LOG_WARN, "asset", "%s: %s", asset->path, asset->reason);
    if (asset == n->asset) net_place(n);
}

static void net_joined(pal_bridge_net *n)
{
    n->generation++;
    n->echo_seq = 0;
    n->counts_from_here = true;
    n->count.n_reconnect += n->count.joined;
    n->count.joined = true;
    if (!n->joined_ns) n->joined_ns = pal_clock_ns();
    pal_servo_put_generation(n->servo, n->generation);
}

static void ws_control(void *user, const pal_control *c)
{
    pal_bridge_net *n = user;
    if (c->type == PAL_CONTROL_MOVE) pal_asset_store_move(n->store, c->move.address, c->move.session);
    if (c->type == PAL_CONTROL_HELLO || c->type == PAL_CONTROL_MEMBERS) n->count.tool = pal_link_tool(n->link);
    if (c->type == PAL_CONTROL_HELLO) {
        const pal_wire_hello *hello = &c->hello;
        n->radius_m = hello->you_tool >= 0 && (uint32_t)hello->you_tool < hello->n_tool
                          ? hello->tool[hello->you_tool].radius_m
                          : 0.01;
        net_joined(n);
        if (!n->has_up) pal_unit3(n->up, hello->up, 0.5);
        n->asset = hello->n_part > 0 ? pal_asset_store_request(n->store, hello->part[0].asset) : NULL;
        net_place(n);
        pal_log(PAL_LOG_INFO, "joined", "%s with tool %d", hello->session, hello->you_tool);
    }
    if (c->type == PAL_CONTROL_ERROR) pal_log(PAL_LOG_WARN, "server", "%s", c->error.text);
    n->count.n_order_refused += c->type == PAL_CONTROL_ERROR && n->brush.under_way;
    if (c->type == PAL_CONTROL_ERROR || c->type == PAL_CONTROL_ANSWER) pal_hand_brush_answered(&n->brush);
}

static void ws_message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    pal_bridge_net *n = user;
    if (head->kind == PAL_WIRE_TOOLS) {
        pal_link_acknowledge(n->link, bytes, n_byte);
    } else if (head->kind == PAL_WIRE_HAPTIC) {
        pal_wire_haptic haptic;
        if (pal_wire_get_haptic(bytes, n_byte, &haptic))
            n->count.n_refused++;
        else if (haptic.tool == n->count.tool)
            net_model(n, &haptic);
    }
}

static void ws_state(void *user, pal_link_state state, int code, const char *reason)
{
    pal_bridge_net *n = user;
    if (state != PAL_LINK_LOST && state != PAL_LINK_ENDED) return;
    pal_hand_brush_reset(&n->brush);
    snprintf(n->count.reason, sizeof n->count.reason, "%d %.100s", code, reason);
    pal_log(PAL_LOG_WARN, "server", "connection lost: %d %s", code, reason);
}

/* which session is there, for who waits for another: "PREFIX/SESSION/STATUS" */
static void note_session(pal_bridge_net *n, const char *channel)
{
    const size_t n_prefix = strlen(pal_lcm_link_prefix(n->lcm)) + 1, n_all = strlen(channel), n_end = strlen("/STATUS");
    if (n->count.joined || n_all <= n_prefix + n_end || strcmp(channel + n_all - n_end, "/STATUS")) return;
    const char *session = channel + n_prefix;
    const int n_session = (int)(n_all - n_prefix - n_end);
    if (strlen(n->o.session) != (size_t)n_session || strncmp(n->o.session, session, (size_t)n_session))
        snprintf(n->count.reason, sizeof n->count.reason, "not session %.24s, but %.*s is there (--session)",
                 n->o.session, n_session < 24 ? n_session : 24, session);
}

/* the session's name is a regular expression in the subscription */
static bool lcm_wants(void *user, const char *channel)
{
    pal_bridge_net *n = user;
    note_session(n, channel);
    return pal_lcm_channel_index(channel, pal_lcm_link_prefix(n->lcm), n->o.session, "HMODEL") == n->o.tool;
}

/* models on LCM; a server that counts from the start again after a pause is another session */
static void lcm_model(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source)
{
    (void)channel, (void)source;
    pal_bridge_net *n = user;
    pal_wire_haptic haptic;
    if (pal_lcm_to_haptic(bytes, n_byte, &haptic) || haptic.tool != n->o.tool) {
        n->count.n_refused++;
        return;
    }
    const bool back = (int32_t)(haptic.seq - n->model_newest) <= 0;
    if (!n->count.joined || (back && pal_clock_ns() - n->model_ns > RESTARTED_NS)) net_joined(n);
    net_model(n, &haptic);
}

static void lcm_refused(void *user, const char *channel, const char *reason)
{
    (void)channel, (void)reason;
    ((pal_bridge_net *)user)->count.n_refused++;
}

static pal_err net_publish(pal_bridge_net *n, const char *what, const lcm_type_info_t *type, const void *message)
{
    return pal_lcm_link_publish(n->lcm, n->o.session, what, n->o.tool, type, message);
}

/* commands of the brush, from where the tool is rendered; without one the button grasps */
static void net_sculpt(pal_bridge_net *n, const pal_servo_view *v)
{
    pal_control c = {.type = PAL_CONTROL_COMMAND};
    pal_hand_brush_move(&n->brush, v->buttons & PAL_WIRE_GRASP, v->position_m, v->n_proxy > 0 ? v->force_N : NULL);
    if (!pal_hand_brush_take(&n->brush, &c.command)) return;
    if (pal_link_send_control(n->link, &c))
        pal_hand_brush_answered(&n->brush);
    else
        n->count.n_order++;
}

/* 250 Hz: newest pose and force to the server */
static void net_send_pose(void *user)
{
    pal_bridge_net *n = user;
    const pal_servo_view *fresh = pal_servo_take_view(n->servo);
    if (!fresh) return;
    n->view = *fresh;
    const pal_servo_view *v = &n->view;
    if (v->force_max_N > TOUCH_FORCE_N && !n->touched) pal_log(PAL_LOG_INFO, "touch", "%.2f N", v->force_max_N);
    n->touched = v->force_max_N > TOUCH_FORCE_N;
    const int tool = n->lcm ? n->o.tool : n->count.tool;
    if (tool < 0 || !n->placed) return;
    pal_wire_pose pose = {.tool = (uint16_t)tool,
                          .seq = n->pose_seq + 1,
                          .flags = v->flags,
                          .stamp_us = pal_clock_ns() / 1000,
                          .grip = (float)v->grip,
                          .buttons = v->buttons,
                          .model_seq = v->model_seq,
                          .model_age_us = v->model_age_us,
                          .model_stamp_us = v->model_stamp_us};
    if (n->o.inside && !v->buttons) pose.flags |= PAL_WIRE_POSE_AWAY;
    if (n->brush.kind) pose.buttons = 0, net_sculpt(n, v);
    pal_copy3(pose.position_m, v->position_m);
    memcpy(pose.quaternion, v->quat, sizeof pose.quaternion);
    for (int k = 0; k < 3; k++) {
        pose.velocity_m_s[k] = (float)v->velocity_m_s[k];
        pose.omega_rad_s[k] = (float)v->omega_rad_s[k];
        pose.force_N[k] = (float)v->force_N[k];
        pose.torque_N_m[k] = (float)v->torque_N_m[k];
    }
    pal_err err;
    if (n->lcm) {
        palpate_tool_state_t state;
        pal_lcm_from_pose(&pose, &state);
        err = net_publish(n, "TOOL", palpate_tool_state_t_get_type_info(), &state);
    } else {
        err = pal_link_send_pose(n->link, &pose);
    }
    if (err) return;
    n->pose_seq++;
    n->count.n_pose++;
}

/* 50 Hz: events to the log and, three times each, to the bus */
static void net_send_events(void *user)
{
    pal_bridge_net *n = user;
    pal_servo_event event;
    while (pal_servo_take_event(n->servo, &event)) {
        pal_log(event.kind == PAL_EVENT_DEVICE_READY || event.kind == PAL_EVENT_RECOVERED ? PAL_LOG_INFO : PAL_LOG_WARN,
                "device", "%s (%g)", event.text, (double)event.value);
        const int slot = n->next_pending++ % EVENT_KEEP;
        n->pending[slot].left = EVENT_REPEATS;
        n->pending[slot].event = (palpate_haptic_event_t){.utime = (int64_t)(pal_clock_ns() / 1000),
                                                          .seq = (int32_t)++n->event_seq,
                                                          .version = PAL_LCM_VERSION,
                                                          .tool = (int16_t)n->o.tool,
                                                          .kind = event.kind,
                                                          .code = event.code,
                                                          .value = event.value,
                                                          .text = (char *)(uintptr_t)event.text};
    }
    if (!n->lcm) return;
    for (int i = 0; i < EVENT_KEEP; i++)
        if (n->pending[i].left > 0 && n->pending[i].left--)
            net_publish(n, "HEVENT", palpate_haptic_event_t_get_type_info(), &n->pending[i].event);
}

static void net_send_config(pal_bridge_net *n)
{
    const pal_servo_options *s = &n->o.servo;
    char name[64];
    memcpy(name, s->info.name, sizeof name);
    palpate_haptic_config_t config = {.utime = (int64_t)(pal_clock_ns() / 1000),
                                      .seq = (int32_t)n->status_seq,
                                      .version = PAL_LCM_VERSION,
                                      .tool = (int16_t)n->o.tool,
                                      .dof = (int16_t)(s->info.dof_in * 16 + s->info.dof_out),
                                      .flags = (s->pose_only ? 1 : 0) | (s->leak_W > 0 ? 0 : 4),
                                      .device = name,
                                      .f_peak = (float)s->info.peak_N,
                                      .f_cont = (float)s->info.continuous_N,
                                      .f_user = (float)s->force_cap_N,
                                      .k_max = (float)s->info.stiffness_max_N_m,
                                      .b_max = (float)s->info.damping_max_Ns_m,
                                      .scale = (float)s->scale,
                                      .fscale = (float)s->force_scale,
                                      .tank_mJ = (float)(1e3 * TANK_MAX_J),
                                      .leak_mW = (float)(1e3 * s->leak_W)};
    for (int k = 0; k < 3; k++) {
        config.ws_min[k] = (float)s->info.low_m[k];
        config.ws_max[k] = (float)s->info.high_m[k];
        config.origin[k] = n->frame.origin_m[k];
    }
    pal_workspace_quat(n->frame.rotation, config.quat);
    net_publish(n, "HCONFIG", palpate_haptic_config_t_get_type_info(), &config);
}

/* part of the models that did not come in order */
static float net_lost(const pal_bridge_net_counts *c)
{
    const uint64_t n = c->n_model + c->n_model_lost;
    return n ? (float)((double)c->n_model_lost / (double)n) : 0;
}

/* 10 Hz: health; 1 Hz: limits */
static void net_send_status(void *user)
{
    pal_bridge_net *n = user;
    const pal_servo_timing *timing = n->thread ? pal_servo_thread_timing(n->thread) : NULL;
    if (timing) n->timing = *timing;
    if (!n->lcm) return;
    const pal_servo_view *v = &n->view;
    const pal_jitter *p = &n->timing.period;
    const double ticks = v->n_tick ? (double)v->n_tick : 1;
    char name[64];
    memcpy(name, n->o.servo.info.name, sizeof name);
    const double seconds = n->joined_ns ? (double)(pal_clock_ns() - n->joined_ns) * 1e-9 : 0;
    const palpate_haptic_status_t status = {
        .utime = (int64_t)(pal_clock_ns() / 1000),
        .seq = (int32_t)++n->status_seq,
        .version = PAL_LCM_VERSION,
        .tool = (int16_t)n->o.tool,
        .state = (int16_t)v->state,
        .rt_flags = (int16_t)n->timing.rt_flags,
        .rate_hz = (float)n->o.servo.rate_hz,
        .period_us = {(float)pal_jitter_at_us(p, 0.5), (float)pal_jitter_at_us(p, 0.99),
                      (float)pal_jitter_at_us(p, 0.999), (float)((double)p->max_ns * 1e-3)},
        .late_ticks = (int32_t)n->timing.n_missed,
        .ticks = (int32_t)v->n_tick,
        .rtt_ms = {(float)pal_jitter_at_us(&n->count.rtt, 0.5) / 1e3f,
                   (float)pal_jitter_at_us(&n->count.rtt, 0.99) / 1e3f, (float)((double)n->count.rtt.max_ns * 1e-6)},
        .model_hz = seconds > 0 ? (float)((double)n->count.n_model / seconds) : 0,
        .model_lost = net_lost(&n->count),
        .model_age_ms = (float)v->model_age_us * 1e-3f,
        .jump_max_N = (float)v->jump_max_N,
        .force_rms_N = (float)v->force_rms_N,
        .force_max_N = (float)v->force_max_N,
        .sat_frac = (float)((double)v->n_saturated / ticks),
        .pc_frac = (float)((double)v->n_passivity / ticks),
        .tank_mJ = (float)v->tank_mJ,
        .injected_mJ = (float)v->generated_mJ,
        .stiff_clamped = (float)((double)v->n_clamped / ticks),
        .motor_temp = (float)v->motor_temperature,
        .device = name};
    net_publish(n, "HSTATUS", palpate_haptic_status_t_get_type_info(), &status);
    if (n->n_status++ % 10 == 0) net_send_config(n);
}

static pal_err net_open_ws(pal_bridge_net *n, pal_diagnostic *diag)
{
    static const pal_link_events events = {.state = ws_state, .control = ws_control, .message = ws_message};
    n->store = pal_asset_store_create(n->loop, n->o.server, net_asset, n);
    if (!n->store) return PAL_ERR_MEMORY;
    const pal_link_options link = {.url = n->o.server,
                                   .name = n->o.name,
                                   .role = PAL_WIRE_ROLE_TRAINEE,
                                   .tool = n->o.tool,
                                   .events = &events,
                                   .user = n};
    return pal_link_open(n->loop, &link, diag, &n->link);
}

static pal_err net_open_lcm(pal_bridge_net *n, pal_diagnostic *diag)
{
    static const pal_lcm_events events = {lcm_wants, lcm_model, lcm_refused};
    const pal_lcm_options lcm = {n->o.server, n->o.channel, n->o.lcm_key};
    char channel[PAL_LCM_CHANNEL_MAX + 1];
    PAL_TRY(pal_lcm_link_open(n->loop, &lcm, &events, n, diag, &n->lcm));
    snprintf(channel, sizeof channel, ".*/HMODEL/%d", n->o.tool);
    PAL_TRY(pal_lcm_link_subscribe(n->lcm, channel, palpate_haptic_model_t_get_type_info()));
    return pal_lcm_link_subscribe(n->lcm, ".*/STATUS", palpate_session_status_t_get_type_info());
}

pal_err pal_bridge_net_open(pal_link_loop *loop, pal_servo *servo, pal_servo_thread *thread,
                            const pal_bridge_net_options *options, pal_diagnostic *diag, pal_bridge_net **out)
{
    pal_bridge_net *n = calloc(1, sizeof *n);
    if (!n) return PAL_ERR_MEMORY;
    *n = (pal_bridge_net){.loop = loop, .servo = servo, .thread = thread, .o = *options};
    if (!n->o.servo.clock) n->o.servo.clock = &pal_clock_monotonic;
    n->count.tool = PAL_WIRE_TOOL_NONE;
    const bool bus = !strncmp(options->server, "lcm://", 6) || !strncmp(options->server, "udpm://", 7);
    n->brush = options->brush;
    n->has_up = pal_unit3(n->up, options->up, 1e-9);
    if (!n->has_up) pal_set3(n->up, 0, 0, 1);
    /* the bus has no hello */
    if (bus) net_place(n);
    if (bus && n->o.tool < 0) n->o.tool = 0;
    if (bus) n->count.tool = n->o.tool;
    pal_err err = bus ? net_open_lcm(n, diag) : net_open_ws(n, diag);
    if (!err && (!pal_link_add_timer(loop, POSE_PERIOD_US, net_send_pose, n) ||
                 !pal_link_add_timer(loop, EVENT_PERIOD_US, net_send_events, n) ||
                 !pal_link_add_timer(loop, STATUS_PERIOD_US, net_send_status, n)))
        err = PAL_ERR_MEMORY;
    /* the loop may hold timers and links of a half-open one: it frees them, the rest is freed after it */
    *out = n;
    return err;
}

void pal_bridge_net_close(pal_bridge_net *net)
{
    if (!net) return;
    pal_lcm_link_close(net->lcm);
    pal_asset_store_destroy(net->store);
    free(net);
}

pal_bridge_net_counts pal_bridge_net_count(const pal_bridge_net *net)
{
    return net->count;
}

const pal_servo_view *pal_bridge_net_view(const pal_bridge_net *net)
{
    return &net->view;
}
