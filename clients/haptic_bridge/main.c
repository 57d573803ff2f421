/* palpate-bridge: a haptic device, real or virtual, in a session: servo thread (servo_thread.h), network thread (this
 * one), triple buffer between them. Ends with zero force. SIGUSR1 is the emergency stop, SIGUSR2 re-arms. */
#include "clients/haptic_bridge/bridge_net.h"
#include "clients/haptic_bridge/device_virtual.h"
#include "clients/haptic_bridge/doctor.h"
#include "clients/link/end_condition.h"
#include "server/base/flags.h"
#include "server/base/json_members.h"
#include "server/base/log.h"
#include "server/base/vec3.h"

#include <math.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct bridge {
    const char *device, *tool, *hand, *script, *options, *brush;
    double seconds, leak_mW;
    bool list, doctor, stdin_stop;
    pal_flag_common common;
    pal_bridge_net_options net_options; /* the servo's among them */
    pal_servo *servo;
    pal_servo_thread *thread;
    pal_link_loop *loop;
    pal_bridge_net *net;
    char rt_refused[160];
    const char *until_text;
    pal_end_condition until;
    int n_held; /* samples of the script grasp while it holds, and sums of what device and tissue gave */
    double rendered_N, reference_N;
    const char *second_device; /* NULL: one device */
    struct bridge *second;     /* the same for it, on the same loop; NULL: none */
} bridge;

/* what --until may wait for, in the order of main_watch */
static const char *const until_name[] = {"models", "poses", "force_N", "stale", "free", "orders"};

/* a handler runs on any thread: lock-free atomics are safe there, and between threads as well */
static pal_servo *_Atomic main_servo[2]; /* for the emergency stop */

static void main_on_signal(int number)
{
    for (int i = 0; i < 2; i++) {
        pal_servo *servo = main_servo[i];
        if (number == SIGUSR1 && servo) pal_servo_estop(servo);
        if (number == SIGUSR2 && servo) pal_servo_rearm(servo);
    }
}

/* the script grasp: what is rendered and what the tissue gives while the hand holds; ends the program when it is done
 */
static void main_watch_grasp(bridge *b, const pal_servo_view *v)
{
    const pal_servo_options *o = &b->net_options.servo;
    if (o->backend != pal_device_virtual()) return;
    const pal_virtual_phase phase = pal_virtual_script_phase(o->device);
    if (phase == PAL_VIRTUAL_DONE) pal_link_stop(b->loop);
    if (phase != PAL_VIRTUAL_HOLD) return;
    b->n_held++;
    b->rendered_N += pal_norm3(v->force_N) / o->force_scale;
    b->reference_N += pal_norm3(v->reference_N);
}

static void main_watch(void *user)
{
    bridge *b = user;
    const pal_servo_view *v = pal_bridge_net_view(b->net);
    main_watch_grasp(b, v);
    const double seen[] = {
        (double)v->n_model,         (double)pal_bridge_net_count(b->net).n_pose, v->force_max_N, (double)v->n_stale,
        v->state == PAL_SERVO_FREE, (double)pal_bridge_net_count(b->net).n_order};
    if (pal_end_condition_met(&b->until, seen)) pal_link_stop(b->loop);
}

/* closed standard input is an emergency stop: whoever held it open is gone */
static void main_stdin(void *user)
{
    char byte[64];
    bridge *b = user;
    if (read(STDIN_FILENO, byte, sizeof byte) != 0) return;
    pal_servo_estop(b->servo);
    if (b->second && b->second->servo) pal_servo_estop(b->second->servo);
}

/* "BACKEND:ID", to which the flags of the virtual hand are added when it is virtual, become back end and id */
static pal_err main_find_device(bridge *b, char *id, size_t n_id, pal_diagnostic *diag)
{
    const size_t n_name = strcspn(b->device, ":");
    const char *which = b->device[n_name] ? b->device + n_name + 1 : "";
    pal_servo_options *o = &b->net_options.servo;
    o->backend = pal_device_find(b->device, n_name);
    if (!o->backend) return PAL_REFUSE(diag, "no back end \"%.*s\" (--list-devices)", (int)n_name, b->device);
    const int n = o->backend != pal_device_virtual()
                      ? snprintf(id, n_id, "%s", which)
                      : snprintf(id, n_id, "%s,hand=%s,script=%s%s%s", which[0] ? which : "touch", b->hand, b->script,
                                 b->options ? "," : "", b->options ? b->options : "");
    return n < (int)n_id ? PAL_ERR_OK : PAL_REFUSE(diag, "device description is too long");
}

static pal_err main_open_device(bridge *b, pal_diagnostic *diag)
{
    char id[256];
    pal_servo_options *o = &b->net_options.servo;
    PAL_TRY(main_find_device(b, id, sizeof id, diag));
    const int error = o->backend->open(&o->device, id, &o->info);
    return error < 0 ? PAL_REFUSE(diag, "--device %s: %s", b->device, o->backend->strerror(o->device, error))
                     : PAL_ERR_OK;
}

/* place and axes of the workspace, as far as they are known before hello */
static pal_err main_workspace(bridge *b, pal_diagnostic *diag)
{
    pal_bridge_net_options *net = &b->net_options;
    const double up[3] = {0, 0, 1};
    const bool has_up = !isnan(net->up[0]);
    if (!has_up) pal_set3(net->up, 0, 0, 0);
    if (has_up && !pal_unit3(net->up, net->up, 1e-9)) return PAL_REFUSE(diag, "--up is no direction");
    pal_workspace_rotation(has_up ? net->up : up, net->servo.rotation);
    net->has_origin = !isnan(net->servo.origin_m[0]);
    if (!net->has_origin) pal_set3(net->servo.origin_m, 0, 0, 0);
    return PAL_ERR_OK;
}

static cJSON *times_json(const pal_jitter *j)
{
    return PAL_JSON({"n", JSON_NUMBER(j->n)}, {"p50", JSON_NUMBER(pal_jitter_at_us(j, 0.5))},
                    {"p99", JSON_NUMBER(pal_jitter_at_us(j, 0.99))}, {"p99_9", JSON_NUMBER(pal_jitter_at_us(j, 0.999))},
                    {"max", JSON_NUMBER((double)j->max_ns * 1e-3)});
}

/* means while the script grasp holds; NULL: it did not get so far */
static cJSON *grasp_json(const bridge *b)
{
    if (b->n_held == 0) return NULL;
    return PAL_JSON({"felt_N", JSON_NUMBER(b->rendered_N / b->n_held)},
                    {"server_N", JSON_NUMBER(b->reference_N / b->n_held)});
}

static cJSON *main_json(const bridge *b, const pal_servo_timing *t, const pal_servo_view *v,
                        const pal_bridge_net_counts *c, const char *reason)
{
    const char *forces = t->rt_flags & PAL_RT_OFF       ? "off: servo loop is late"
                         : t->rt_flags & PAL_RT_LIMITED ? "limited: servo loop is late"
                                                        : "full";
    return PAL_JSON(
        {"ok", JSON_BOOL(reason == NULL)}, {"reason", reason ? JSON_TEXT(reason) : NULL},
        {"device", JSON_TEXT(b->net_options.servo.info.name)}, {"rate_hz", JSON_NUMBER(b->net_options.servo.rate_hz)},
        {"fifo", JSON_BOOL(t->rt_flags & PAL_RT_FIFO)}, {"memory_locked", JSON_BOOL(t->rt_flags & PAL_RT_LOCKED)},
        {"real_time_refused", JSON_TEXT(b->rt_refused)}, {"forces", JSON_TEXT(forces)},
        {"ticks", JSON_NUMBER(t->n_tick)}, {"missed", JSON_NUMBER(t->n_missed)},
        {"watchdog_stops", JSON_NUMBER(t->n_watchdog)}, {"period_us", times_json(&t->period)},
        {"lateness_us", times_json(&t->lateness)}, {"rtt_us", times_json(&c->rtt)},
        {"state", JSON_TEXT(pal_servo_state_name(v->state))}, {"force_max_N", JSON_NUMBER(v->force_max_N)},
        {"force_rms_N", JSON_NUMBER(v->force_rms_N)}, {"jump_max_N", JSON_NUMBER(v->jump_max_N)},
        {"max_step_N", JSON_NUMBER(v->jump_max_N)}, {"generated_mJ", JSON_NUMBER(v->generated_mJ)},
        {"tank_mJ", JSON_NUMBER(v->tank_mJ)}, {"grasp", grasp_json(b)},
        {"felt_N_m", JSON_NUMBER(v->rendered_stiffness_N_m)}, {"models", JSON_NUMBER(v->n_model)},
        {"models_old", JSON_NUMBER(v->n_model_old)}, {"models_lost", JSON_NUMBER(c->n_model_lost)},
        {"stale", JSON_NUMBER(v->n_stale)}, {"faults", JSON_NUMBER(v->n_fault)},
        {"not_finite", JSON_NUMBER(v->n_not_finite)}, {"poses", JSON_NUMBER(c->n_pose)}, {"tool", JSON_NUMBER(c->tool)},
        {"joined", JSON_BOOL(c->joined)}, {"reconnects", JSON_NUMBER(c->n_reconnect)},
        {"orders", JSON_NUMBER(c->n_order)}, {"orders_refused", JSON_NUMBER(c->n_order_refused)},
        {"position_m", cJSON_CreateDoubleArray(v->position_m, 3)});
}

static void main_table(const bridge *b, const pal_servo_timing *t, const pal_servo_view *v,
                       const pal_bridge_net_counts *c)
{
    printf("%s at %g Hz: %llu ticks, %llu missed, watchdog %llu; %s%s\n", b->net_options.servo.info.name,
           b->net_options.servo.rate_hz, (unsigned long long)t->n_tick, (unsigned long long)t->n_missed,
           (unsigned long long)t->n_watchdog,
           t->rt_flags & PAL_RT_FIFO ? "SCHED_FIFO" : "no real time: ", t->rt_flags & PAL_RT_FIFO ? "" : b->rt_refused);
    const pal_jitter *row[] = {&t->period, &t->lateness, &c->rtt};
    const char *name[] = {"period", "lateness", "round trip"};
    for (int i = 0; i < 3; i++)
        printf("%-10s us: p50 %.0f  p99 %.0f  p99.9 %.0f  max %.0f\n", name[i], pal_jitter_at_us(row[i], 0.5),
               pal_jitter_at_us(row[i], 0.99), pal_jitter_at_us(row[i], 0.999), (double)row[i]->max_ns * 1e-3);
    printf("generated %.3f mJ, tank %.3f mJ\n", v->generated_mJ, v->tank_mJ);
    if (b->n_held > 0)
        printf("grasp held: felt %.3f N, tissue %.3f N\n", b->rendered_N / b->n_held, b->reference_N / b->n_held);
    printf(
        "state %s; force N: max %.2f  rms %.2f  largest step at an update %.3f; felt %.0f N/m; %llu models, %llu times "
        "stale\n",
        pal_servo_state_name(v->state), v->force_max_N, v->force_rms_N, v->jump_max_N, v->rendered_stiffness_N_m,
        (unsigned long long)v->n_model, (unsigned long long)v->n_stale);
}

static pal_err main_start(bridge *b, pal_diagnostic *diag)
{
    pal_servo_options *o = &b->net_options.servo;
    if (b->brush) PAL_TRY(pal_hand_brush_parse(b->brush, &b->net_options.brush, diag));
    if ((b->brush || b->net_options.inside) && strncmp(b->net_options.server, "ws://", 5))
        return PAL_REFUSE(diag, "%s needs a server by websocket", b->brush ? "--brush" : "--inside");
    b->net_options.tool = strcmp(b->tool, "any") ? atoi(b->tool) : PAL_WIRE_TOOL_ANY;
    PAL_TRY(main_workspace(b, diag));
    PAL_TRY(main_open_device(b, diag));
    o->force_cap_N = fmin(o->force_cap_N, o->info.peak_N);
    o->pose_only = o->pose_only || o->info.pose_only;
    o->leak_W = 1e-3 * b->leak_mW;
    o->hand_off = !strcmp(b->hand, "off");
    o->clock = o->backend == pal_device_virtual() ? pal_virtual_clock(o->device) : NULL;
    o->no_watchdog = o->clock != NULL;
    PAL_TRY(pal_servo_create(o, &b->servo));
    main_servo[main_servo[0] != NULL] = b->servo;
    pal_diagnostic refused = {""};
    PAL_TRY(pal_servo_thread_start(b->servo, o, &refused, &b->thread));
    snprintf(b->rt_refused, sizeof b->rt_refused, "%s", refused.text);
    if (refused.text[0])
        pal_log(PAL_LOG_WARN, "real_time", "%s: forces are limited when the loop is late", refused.text);
    PAL_TRY(pal_bridge_net_open(b->loop, b->servo, b->thread, &b->net_options, diag, &b->net));
    return PAL_ERR_OK;
}

/* both devices on one loop; the end condition looks at the first */
static pal_err main_start_all(bridge *b, pal_diagnostic *diag)
{
    PAL_TRY(pal_link_loop_create(&b->loop));
    PAL_TRY(pal_link_stop_on_signals(b->loop));
    if (b->second) b->second->loop = b->loop;
    PAL_TRY(main_start(b, diag));
    if (b->second) PAL_TRY(main_start(b->second, diag));
    if (b->stdin_stop) PAL_TRY(pal_link_poll_fd(b->loop, STDIN_FILENO, main_stdin, b));
    return pal_link_add_timer(b->loop, 50000, main_watch, b) ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* what is reported of a device at the end */
typedef struct bridge_end {
    pal_servo_timing timing;
    pal_servo_view view;
    pal_bridge_net_counts counts;
    char reason[sizeof((pal_diagnostic *)0)->text]; /* "": it ended well */
} bridge_end;

static void main_stop(bridge *b, pal_err err, const char *text, bridge_end *end)
{
    *end = (bridge_end){0};
    pal_servo_thread_stop(b->thread, &end->timing);
    if (b->net) {
        end->view = *pal_bridge_net_view(b->net);
        end->counts = pal_bridge_net_count(b->net);
    }
    if (err)
        snprintf(end->reason, sizeof end->reason, "%s", text[0] ? text : pal_err_text(err));
    else if (!end->counts.joined)
        snprintf(end->reason, sizeof end->reason, "no server at %.100s: %.100s", b->net_options.server,
                 end->counts.reason[0] ? end->counts.reason : "no answer");
}

static void main_close(bridge *b)
{
    const pal_servo_options *o = &b->net_options.servo;
    pal_bridge_net_close(b->net);
    pal_servo_destroy(b->servo);
    if (o->device) o->backend->close(o->device);
}

static int main_run(bridge *b)
{
    pal_diagnostic diag = {""};
    static bridge second;
    static char second_tool[16];
    if (b->second_device) {
        second = *b;
        second.device = b->second_device;
        /* LCM gives no tools away, and who names one names the next as well */
        if (strcmp(b->tool, "any") || !strncmp(b->net_options.server, "lcm", 3)) {
            snprintf(second_tool, sizeof second_tool, "%d", atoi(b->tool) + 1);
            second.tool = second_tool;
        }
        b->second = &second;
    }
    const pal_err err = main_start_all(b, &diag);
    if (!err) pal_link_run_for(b->loop, b->seconds);
    bridge *device[] = {b, b->second};
    static bridge_end end[2];
    for (int i = 0; i < 2 && device[i]; i++) main_stop(device[i], err, diag.text, &end[i]);
    main_servo[0] = main_servo[1] = NULL;
    pal_link_loop_destroy(b->loop);
    for (int i = 0; i < 2 && device[i]; i++) main_close(device[i]);
    const char *reason = end[0].reason[0] ? end[0].reason : end[1].reason[0] ? end[1].reason : NULL;
    cJSON *report = NULL;
    for (int i = 0; i < 2 && device[i]; i++) {
        if (!b->common.json && !b->common.quiet && !err)
            main_table(device[i], &end[i].timing, &end[i].view, &end[i].counts);
        if (!b->common.json) continue;
        cJSON *one = main_json(device[i], &end[i].timing, &end[i].view, &end[i].counts, reason);
        if (i == 0)
            report = one;
        else
            cJSON_AddItemToObject(report, "second", one);
    }
    if (report) (void)pal_json_write(stdout, report);
    if (reason) fprintf(stderr, "palpate-bridge: %s\n", reason);
    return reason ? 1 : 0;
}

/* 1: something is not ok */
static int main_doctor(bridge *b)
{
    char id[256];
    pal_diagnostic diag = {""};
    if (!main_find_device(b, id, sizeof id, &diag)) return pal_doctor(id, &b->net_options.servo, 1) > 0;
    fprintf(stderr, "palpate-bridge: %s\n", diag.text);
    return 1;
}

int main(int argc, char **argv)
{
    bridge b = {
        .device = "virtual:touch",
        .tool = "any",
        .hand = "average",
        .script = "press-hold",
        .net_options = {.server = "ws://127.0.0.1:8090/ws",
                        .session = "main",
                        .name = "haptic bridge",
                        .up = {NAN},
                        .servo = {.rate_hz = 1000, .force_cap_N = 3, .scale = 1, .force_scale = 1, .origin_m = {NAN}}}};
    pal_bridge_net_options *net = &b.net_options;
    pal_servo_options *servo = &net->servo;
    const pal_flag flag[] = {
        {"--device", "BACKEND:ID", PAL_FLAG_TEXT, &b.device, 0, 0,
         "virtual:touch | premium | omega3 | inverse3 | falcon (virtual:touch)\n"
         "hdapi:[NAME]  dhd:[NUMBER]  haply:[DEVICE][@HOST:PORT]  input:[FILE|spnav]  plugin:FILE[,ID]"},
        {"--second-device", "BACKEND:ID", PAL_FLAG_TEXT, &b.second_device, 0, 0,
         "for the other hand, with the next tool"},
        {"--server", "URL", PAL_FLAG_TEXT, &net->server, 0, 0, "ws://host:port/ws or lcm://group:port?ttl=0"},
        {"--session", "NAME", PAL_FLAG_TEXT, &net->session, 0, 0, "LCM: name in the channels (main)"},
        {"--channel", "PREFIX", PAL_FLAG_TEXT, &net->channel, 0, 0, "LCM: of the channels; one a rig (PALPATE1)"},
        {"--lcm-key", "FILE", PAL_FLAG_TEXT, &net->lcm_key, 0, 0,
         "LCM: key file, to sign poses and to take signed models alone (PALPATE_LCM_KEY, or none)"},
        {"--name", "NAME", PAL_FLAG_TEXT, &net->name, 0, 0, "name among the members"},
        {"--tool", "N", PAL_FLAG_TEXT, &b.tool, 0, 0, "tool to take: index or any; LCM: index (any, 0)"},
        {"--hand", "NAME", PAL_FLAG_TEXT, &b.hand, 0, 0, "virtual: average | light | firm | off"},
        {"--script", "NAME", PAL_FLAG_TEXT, &b.script, 0, 0,
         "virtual: still | press-hold | cycle | ramp | stroke | tap | grasp | sculpt (both end by themselves)"},
        {"--options", "K=V,...", PAL_FLAG_TEXT, &b.options, 0, 0,
         "virtual: depth, height, descent mm, wait s, lag ms, clock"},
        {"--brush", "KIND,...", PAL_FLAG_TEXT, &b.brush, 0, 0,
         "the grasp button sculpts: inflate | curve | paint | extrude, radius=MM (20), strength=Pa, N/m or factor "
         "(2000, 200, 2)"},
        {"--inside", NULL, PAL_FLAG_SWITCH, &net->inside, 0, 0,
         "the tool passes through the surface, and grasps within the volume"},
        {"--rate", "HZ", PAL_FLAG_NUMBER, &servo->rate_hz, 500, 4000, "servo rate (1000)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &b.seconds, 0.1, 86400, "end after this time (never)"},
        {"--until", "NAME=N,...", PAL_FLAG_TEXT, &b.until_text, 0, 0,
         "end before that once all is reached: models, poses, force_N, stale, free=1, orders"},
        {"--force-cap", "N", PAL_FLAG_NUMBER, &servo->force_cap_N, 0, 20, "largest force (3, and the device's peak)"},
        {"--origin", "X,Y,Z", PAL_FLAG_VECTOR, servo->origin_m, 0, 0, "world place of the workspace's centre, m"},
        {"--up", "X,Y,Z", PAL_FLAG_VECTOR, net->up, 0, 0,
         "world direction of the device's up; its x, to the user, and y, right, are level (up of the scene; LCM: "
         "0,0,1)"},
        {"--scale", "S", PAL_FLAG_NUMBER, &servo->scale, 0.01, 100, "world metres per device metre (1)"},
        {"--force-scale", "S", PAL_FLAG_NUMBER, &servo->force_scale, 0.01, 100, "device newtons per world newton (1)"},
        {"--leak-mW", "MW", PAL_FLAG_NUMBER, &b.leak_mW, 0, 10,
         "energy that changes of the model may add beyond the tank (0, strict)"},
        {"--pose-only", NULL, PAL_FLAG_SWITCH, &servo->pose_only, 0, 0, "no force"},
        {"--stdin-stop", NULL, PAL_FLAG_SWITCH, &b.stdin_stop, 0, 0, "closed standard input is an emergency stop"},
        {"--list-devices", NULL, PAL_FLAG_SWITCH, &b.list, 0, 0, "which back ends there are, or why not"},
        {"--doctor", NULL, PAL_FLAG_SWITCH, &b.doctor, 0, 0,
         "measure limits, device and one second of servo; each line is ok or says what to do"},
    };
    const pal_flag_table table = {.program = "palpate-bridge",
                                  .usage = "[flags]",
                                  .about = "Renders a session's contact models on a haptic device at 1 kHz. SIGUSR1 "
                                           "is the emergency stop, SIGUSR2 re-arms.\n",
                                  PAL_FLAGS(flag)};
    const int code = pal_flags_parse(&table, argc, argv, &b.common, NULL, NULL);
    if (code >= 0) return code;
    if (b.list) {
        pal_doctor_list();
        return 0;
    }
    pal_diagnostic diag = {""};
    if (b.until_text &&
        pal_end_condition_parse(&b.until, until_name, sizeof until_name / sizeof *until_name, b.until_text, &diag))
        return pal_flags_wrong(&b.common, "%s", diag.text);
    pal_log_set_level(b.common.quiet || b.common.json ? PAL_LOG_ERROR : PAL_LOG_INFO);
    if (b.doctor) return main_doctor(&b);
    signal(SIGUSR1, main_on_signal);
    signal(SIGUSR2, main_on_signal);
    return main_run(&b);
}
