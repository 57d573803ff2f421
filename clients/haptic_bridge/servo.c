#include "clients/haptic_bridge/servo.h"
#include "clients/haptic_bridge/local_contact.h"
#include "server/base/command_queue.h"
#include "server/base/triple_buffer.h"
#include "server/base/vec3.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define VELOCITY_CUT_HZ    80.0
#define USER_CAP_N         3.0
#define STALE_MIN_S        0.1
#define STALE_MAX_S        0.5
#define FADE_OUT_S         0.5
#define FADE_IN_S          0.25
#define FADE_START_S       1.0
#define CLUTCH_FADE_S      0.05
#define ARM_REST_S         0.5
#define ARM_SPEED_M_S      0.05
#define RISE_TIME_S        0.01
#define STALE_DAMPING_NS_M 3.0
#define FREE_DAMPING_NS_M  0.5
#define WALL_STIFFNESS_N_M 200.0
#define WALL_FRACTION      0.95
#define DRIVEN_SPEED_M_S   0.5
#define SPEED_MAX_M_S      2.0
#define DEGRADED_K_N_M     300.0
#define BAD_READS_MAX      2

enum { SERVO_GAPS = 64, SERVO_EVENTS = 64 };

typedef struct servo_model {
    uint32_t generation;
    bool empty; /* only a change of generation */
    uint64_t arrival_ns;
    pal_wire_haptic haptic;
} servo_model;

struct pal_servo {
    pal_servo_options o;
    double cap_N;
    pal_triple_buffer models, views, origins;
    servo_model model_slot[3];
    pal_servo_view view_slot[3];
    double origin_slot[3][3]; /* m */
    pal_command_queue *events;
    atomic_bool estop, rearm, stalled;
    _Atomic uint64_t ticks;
    /* the rest belongs to [servo] */
    servo_model model; /* in use; empty: none */
    uint64_t last_ns, rest_ns;
    double gap_s[SERVO_GAPS];
    int n_gap;
    bool first, has_position, estop_latched, lost, stale, was_stale, clutched, at_wall;
    int degraded, bad_reads, read_error;
    double x[3], v[3], centre[3], frozen_x[3]; /* world pose, clutch centre in the device's frame */
    double fade, fade_rate, clutch_fade, scale_down, mean_square;
    double force_prev[3], patch_prev[3];
    bool model_changed;
    pal_dev_state device;
    pal_local_contact_state memory;
    pal_servo_view view;
};

const char *pal_servo_state_name(pal_servo_state state)
{
    static const char *const name[] = {"off", "arming", "free", "contact", "stale", "fault", "estop"};
    return name[state];
}

pal_err pal_servo_create(const pal_servo_options *options, pal_servo **out)
{
    pal_servo *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    s->o = *options;
    s->o.scale = options->scale > 0 ? options->scale : 1;
    s->o.force_scale = options->force_scale > 0 ? options->force_scale : 1;
    s->cap_N = fmin(options->force_cap_N > 0 ? options->force_cap_N : USER_CAP_N, options->info.peak_N);
    s->events = pal_command_queue_create(SERVO_EVENTS, sizeof(pal_servo_event));
    if (!s->events) {
        free(s);
        return PAL_ERR_MEMORY;
    }
    pal_triple_buffer_init(&s->models, &s->model_slot[0], &s->model_slot[1], &s->model_slot[2]);
    pal_triple_buffer_init(&s->views, &s->view_slot[0], &s->view_slot[1], &s->view_slot[2]);
    pal_triple_buffer_init(&s->origins, s->origin_slot[0], s->origin_slot[1], s->origin_slot[2]);
    s->model.empty = true;
    s->first = true;
    s->clutch_fade = s->scale_down = 1;
    s->view.state = options->pose_only ? PAL_SERVO_FREE : PAL_SERVO_ARMING;
    *out = s;
    return PAL_ERR_OK;
}

void pal_servo_destroy(pal_servo *servo)
{
    if (!servo) return;
    pal_command_queue_destroy(servo->events);
    free(servo);
}

void pal_servo_put_model(pal_servo *servo, const pal_wire_haptic *model, uint32_t generation, uint64_t arrival_ns)
{
    servo_model *slot = pal_triple_buffer_slot(&servo->models);
    slot->generation = generation;
    slot->empty = false;
    slot->arrival_ns = arrival_ns;
    slot->haptic = *model;
    pal_triple_buffer_publish(&servo->models);
}

void pal_servo_put_generation(pal_servo *servo, uint32_t generation)
{
    servo_model *slot = pal_triple_buffer_slot(&servo->models);
    slot->generation = generation;
    slot->empty = true;
    pal_triple_buffer_publish(&servo->models);
}

void pal_servo_put_origin(pal_servo *servo, const double origin_m[3])
{
    pal_copy3(pal_triple_buffer_slot(&servo->origins), origin_m);
    pal_triple_buffer_publish(&servo->origins);
}

void pal_servo_estop(pal_servo *servo)
{
    atomic_store(&servo->estop, true);
}
void pal_servo_rearm(pal_servo *servo)
{
    atomic_store(&servo->rearm, true);
}
void pal_servo_stalled(pal_servo *servo)
{
    atomic_store(&servo->stalled, true);
}
uint64_t pal_servo_ticks(const pal_servo *servo)
{
    return atomic_load(&servo->ticks);
}
const pal_servo_view *pal_servo_take_view(pal_servo *servo)
{
    return pal_triple_buffer_take(&servo->views);
}
bool pal_servo_take_event(pal_servo *servo, pal_servo_event *out)
{
    return pal_command_queue_get(servo->events, out);
}

static void servo_event(pal_servo *s, pal_servo_event_kind kind, int code, double value, const char *text)
{
    const pal_servo_event event = {(int16_t)kind, (int16_t)code, (float)value, text};
    (void)pal_command_queue_put(s->events, &event);
}

void pal_servo_set_degraded(pal_servo *servo, int level)
{
    if (level == servo->degraded) return;
    servo->degraded = level;
    servo_event(servo, PAL_EVENT_RT_DEGRADED, level, 0,
                level == 0 ? "real time is good again"
                           : (level == 1 ? "servo loop is late: stiffness limited to 300 N/m"
                                         : "servo loop is late: forces off"));
}

static void servo_to_arming(pal_servo *s)
{
    s->view.state = PAL_SERVO_ARMING;
    s->rest_ns = 0;
    s->fade = 0;
}

static void servo_fault(pal_servo *s, pal_servo_event_kind kind, double value, const char *text)
{
    s->view.n_fault++;
    servo_event(s, kind, 0, value, text);
    servo_to_arming(s);
}

/* device pose to world; velocity by a one-pole filter on its difference. false: the device gave nothing usable */
static bool servo_read(pal_servo *s, double dt)
{
    const double *r = s->o.rotation;
    pal_dev_state state;
    s->read_error = s->o.backend->read(s->o.device, &state);
    if (s->read_error < 0 || !pal_finite3(state.position_m)) return false;
    if (!s->clutched) pal_copy3(s->frozen_x, s->x);
    const bool clutch = (state.buttons & PAL_DEVICE_BUTTON_CLUTCH) != 0;
    double away[3], x[3], step[3];
    if (clutch && !s->clutched && pal_norm3(s->force_prev) < 0.3) {
        s->clutched = true;
        servo_event(s, PAL_EVENT_CLUTCH, 1, 0, "clutch held");
    }
    pal_sub3(away, state.position_m, s->centre);
    pal_mul33(x, r, away);
    for (int k = 0; k < 3; k++) x[k] = s->o.origin_m[k] + s->o.scale * x[k];
    if (s->clutched) {
        /* the world pose is constant: the centre follows the handle */
        double back[3];
        pal_sub3(back, s->frozen_x, s->o.origin_m);
        pal_tmul33(back, r, back);
        for (int k = 0; k < 3; k++) s->centre[k] = state.position_m[k] - back[k] / s->o.scale;
        pal_copy3(x, s->frozen_x);
        if (!clutch) {
            s->clutched = false;
            servo_event(s, PAL_EVENT_CLUTCH, 0, 0, "clutch released");
        }
    }
    if (!s->has_position) pal_copy3(s->x, x);
    s->has_position = true;
    pal_sub3(step, x, s->x);
    const double share = 1 - exp(-2 * 3.14159265358979 * VELOCITY_CUT_HZ * dt);
    for (int k = 0; k < 3; k++) s->v[k] += share * (step[k] / dt - s->v[k]);
    pal_copy3(s->x, x);
    s->device = state;
    return true;
}

/* newest model of the newest generation, seq growing; older ones are dropped */
static void servo_take_model(pal_servo *s)
{
    const servo_model *fresh = pal_triple_buffer_take(&s->models);
    s->model_changed = false;
    if (!fresh) return;
    const bool other = fresh->generation != s->model.generation;
    /* another session: force fades in from zero */
    if (other) s->fade = 0;
    if (fresh->empty) {
        s->model.generation = fresh->generation;
        s->model.empty = true;
        s->model_changed = true;
        return;
    }
    if (!other && !s->model.empty && (int32_t)(fresh->haptic.seq - s->model.haptic.seq) <= 0) {
        s->view.n_model_old++;
        return;
    }
    if (!other && !s->model.empty && fresh->arrival_ns > s->model.arrival_ns)
        s->gap_s[s->n_gap++ % SERVO_GAPS] = (double)(fresh->arrival_ns - s->model.arrival_ns) * 1e-9;
    s->model = *fresh;
    s->model_changed = true;
    s->view.n_model++;
    if (fresh->haptic.flags & PAL_WIRE_HAPTIC_FORCE_OFF) atomic_store(&s->estop, true);
}

/* age beyond which a model is stale: the second longest of the last gaps is taken for the usual longest */
static double servo_stale_after(const pal_servo *s)
{
    double longest = 0, second = 0;
    const int n = s->n_gap < SERVO_GAPS ? s->n_gap : SERVO_GAPS;
    for (int i = 0; i < n; i++) {
        if (s->gap_s[i] > longest)
            second = longest, longest = s->gap_s[i];
        else if (s->gap_s[i] > second)
            second = s->gap_s[i];
    }
    const double after = fmax(4e-6 * s->model.haptic.frame_us, 2 * second);
    return fmin(fmax(after, STALE_MIN_S), STALE_MAX_S);
}

/* time since the arrival of the model in use; one that came while the tick was under way is new */
static double servo_model_age_s(const pal_servo *s, uint64_t now)
{
    return s->model.empty || now < s->model.arrival_ns ? 0 : (double)(now - s->model.arrival_ns) * 1e-9;
}

static void servo_toward(double *value, double wanted, double step)
{
    *value = wanted > *value ? fmin(wanted, *value + step) : fmax(wanted, *value - step);
}

/* latches and states; true: forces may be rendered this tick */
static bool servo_states(pal_servo *s, uint64_t now, double dt)
{
    if (atomic_exchange(&s->estop, false) && !s->estop_latched) {
        s->estop_latched = true;
        s->view.state = PAL_SERVO_ESTOP;
        servo_event(s, PAL_EVENT_ESTOP, 0, 0, "emergency stop");
    }
    if (atomic_exchange(&s->rearm, false) && s->estop_latched) {
        s->estop_latched = false;
        servo_event(s, PAL_EVENT_ESTOP_CLEAR, 0, 0, "emergency stop cleared");
        servo_to_arming(s);
    }
    if (atomic_exchange(&s->stalled, false) && !s->estop_latched) {
        s->o.backend->force_enable(s->o.device, 1);
        servo_fault(s, PAL_EVENT_FAULT, 0, "servo loop stalled: device was stopped");
    }
    if (s->estop_latched || s->lost || s->o.pose_only) return false;
    if (s->view.state == PAL_SERVO_ARMING) {
        const bool ready = (s->device.buttons & PAL_DEVICE_BUTTON_DEADMAN) && pal_norm3(s->v) < ARM_SPEED_M_S;
        if (!ready || s->rest_ns == 0) s->rest_ns = now;
        if ((double)(now - s->rest_ns) * 1e-9 < ARM_REST_S) return false;
        s->view.state = PAL_SERVO_FREE;
        s->fade_rate = 1 / FADE_START_S;
        servo_event(s, PAL_EVENT_DEVICE_READY, 0, 0, "armed");
    }
    const double age = s->model.empty ? INFINITY : servo_model_age_s(s, now);
    s->stale = age > servo_stale_after(s) || (s->model.haptic.flags & PAL_WIRE_HAPTIC_FREEZE);
    if (s->stale && !s->was_stale && s->view.n_model > 0) {
        s->view.n_stale++;
        servo_event(s, PAL_EVENT_STALE, 0, age, "no fresh model");
    }
    if (!s->stale && s->was_stale && s->view.n_model > 1) servo_event(s, PAL_EVENT_RECOVERED, 0, 0, "models again");
    if (s->stale && !s->was_stale) s->fade_rate = 1 / FADE_IN_S;
    s->was_stale = s->stale;
    servo_toward(&s->fade, s->stale || s->degraded == 2 ? 0 : 1,
                 s->stale || s->degraded == 2 ? dt / FADE_OUT_S : dt * s->fade_rate);
    if (s->fade >= 1) s->fade_rate = 1 / FADE_IN_S;
    servo_toward(&s->clutch_fade, s->clutched ? 0 : 1, s->clutched ? dt / CLUTCH_FADE_S : dt / FADE_IN_S);
    return true;
}

/* patches of the model, or nothing; world frame */
static void servo_patches(pal_servo *s, uint64_t now, double force[3], pal_local_contact_result *result)
{
    double k_max = s->o.info.stiffness_max_N_m / (s->o.scale * s->o.force_scale);
    if (s->degraded >= 1) k_max = fmin(k_max, DEGRADED_K_N_M);
    const pal_local_contact_limits limits = {k_max, s->o.info.damping_max_Ns_m, s->o.hand_off ? 5e-3 : 2.5e-3};
    *result = (pal_local_contact_result){.finite = true};
    pal_set3(force, 0, 0, 0);
    if (s->model.empty || s->fade <= 0) return;
    pal_local_contact_force(&s->model.haptic, servo_model_age_s(s, now), s->x, s->v, &limits, &s->memory, result);
    pal_scale3(force, s->fade * s->clutch_fade, result->force_N);
    if (s->model_changed) {
        const double jump = pal_dist3(force, s->patch_prev);
        if (s->view.n_model > 1 && jump > s->view.jump_max_N) s->view.jump_max_N = jump;
    }
}

/* soft walls at 95 % of the workspace, device frame */
static void servo_walls(pal_servo *s, double force_d[3])
{
    bool at_wall = false;
    for (int k = 0; k < 3; k++) {
        const double middle = (s->o.info.low_m[k] + s->o.info.high_m[k]) / 2;
        const double half = WALL_FRACTION * (s->o.info.high_m[k] - s->o.info.low_m[k]) / 2;
        const double off = s->device.position_m[k] - middle;
        if (fabs(off) <= half) continue;
        force_d[k] -= WALL_STIFFNESS_N_M * (off - copysign(half, off));
        at_wall = true;
    }
    if (at_wall && !s->at_wall) servo_event(s, PAL_EVENT_WORKSPACE_EDGE, 0, 0, "edge of the workspace");
    s->at_wall = at_wall;
}

/* cap, continuous rating, rise limit; device frame; true: something was cut */
static bool servo_limit(pal_servo *s, double force_d[3], double dt)
{
    bool cut = false;
    /* a device that spares its motors heats by what it gives */
    const double *given = s->device.has_force ? s->device.force_N : s->force_prev;
    s->mean_square += (1 - exp(-dt)) * (pal_dot3(given, given) - s->mean_square);
    const bool hot = s->mean_square > s->o.info.continuous_N * s->o.info.continuous_N;
    servo_toward(&s->scale_down, hot ? 0 : 1, hot ? dt / 2 : dt / 5);
    pal_scale3(force_d, s->scale_down, force_d);
    const double before = pal_norm3(s->force_prev), size = pal_norm3(force_d);
    double max = s->cap_N;
    if (size > max) cut = true;
    max = fmin(max, before + s->cap_N / RISE_TIME_S * dt);
    /* slightly less, so that no rounding passes the cap */
    if (size > max) pal_scale3(force_d, max / size * (1 - 1e-12), force_d);
    return cut;
}

/* everything that gives force; result in the device's frame */
static void servo_render(pal_servo *s, uint64_t now, double dt, double force_d[3])
{
    pal_local_contact_result patch;
    double force[3];
    servo_patches(s, now, force, &patch);
    pal_copy3(s->patch_prev, force);
    if (!patch.finite) {
        s->view.n_not_finite++;
        servo_fault(s, PAL_EVENT_FAULT, 0, "force was not finite");
        pal_set3(force_d, 0, 0, 0);
        return;
    }
    const double speed = pal_norm3(s->v);
    if ((pal_dot3(force, s->v) > 0 && pal_norm3(force) > 0.05 && speed > DRIVEN_SPEED_M_S) || speed > SPEED_MAX_M_S) {
        servo_fault(s, PAL_EVENT_LIMIT, speed, "too fast: force off");
        pal_set3(force_d, 0, 0, 0);
        return;
    }
    if (s->stale) pal_axpy3(force, -(s->fade > 0 ? STALE_DAMPING_NS_M : FREE_DAMPING_NS_M), s->v);
    pal_tmul33(force_d, s->o.rotation, force);
    pal_scale3(force_d, s->o.force_scale, force_d);
    servo_walls(s, force_d);
    if (servo_limit(s, force_d, dt)) s->view.n_saturated++, s->view.flags |= PAL_WIRE_POSE_SATURATED;
    s->view.n_clamped += patch.clamped;
    if (patch.clamped) s->view.flags |= PAL_WIRE_POSE_STIFF_CLAMPED;
    if (patch.n_contact > 0) s->view.flags |= PAL_WIRE_POSE_CONTACT;
    s->view.depth_m = patch.depth_m;
    s->view.rendered_stiffness_N_m = patch.depth_m > 0 ? pal_norm3(force) / patch.depth_m : 0;
    s->view.state = s->stale && s->fade > 0 && s->view.n_model > 0
                        ? PAL_SERVO_STALE
                        : (patch.n_contact > 0 && s->fade > 0 ? PAL_SERVO_CONTACT : PAL_SERVO_FREE);
}

static void servo_publish(pal_servo *s, uint64_t now, const double force_d[3])
{
    pal_servo_view *v = &s->view;
    v->n_tick++;
    pal_copy3(v->position_m, s->x);
    pal_copy3(v->velocity_m_s, s->v);
    memcpy(v->quat, s->device.quat, sizeof v->quat);
    pal_mul33(v->force_N, s->o.rotation, force_d);
    v->fade = s->fade;
    v->grip = s->device.grip;
    v->buttons = s->device.buttons & PAL_DEVICE_BUTTON_GRASP ? PAL_WIRE_GRASP : 0;
    v->motor_temperature = s->device.motor_temperature;
    const double size = pal_norm3(force_d);
    v->force_rms_N = sqrt(s->mean_square);
    if (size > v->force_max_N) v->force_max_N = size;
    if (s->clutched) v->flags |= PAL_WIRE_POSE_CLUTCHED;
    if (s->stale) v->flags |= PAL_WIRE_POSE_STALE;
    if (s->estop_latched) v->flags |= PAL_WIRE_POSE_ESTOP;
    if (s->o.pose_only) v->flags |= PAL_WIRE_POSE_POSE_ONLY;
    if (s->fade > 0 && v->state != PAL_SERVO_ESTOP) v->flags |= PAL_WIRE_POSE_FORCES_ON;
    const bool model = !s->model.empty;
    const double age_us = 1e6 * servo_model_age_s(s, now);
    v->model_seq = model ? s->model.haptic.seq : 0;
    v->model_stamp_us = model ? s->model.haptic.stamp_us : 0;
    v->model_age_us = age_us < 4e9 ? (uint32_t)age_us : UINT32_MAX;
    pal_servo_view *slot = pal_triple_buffer_slot(&s->views);
    *slot = *v;
    pal_triple_buffer_publish(&s->views);
    atomic_fetch_add(&s->ticks, 1);
}

void pal_servo_tick(pal_servo *s, uint64_t now_ns)
{
    const double nominal = 1 / s->o.rate_hz;
    double dt = s->first ? nominal : (double)(now_ns - s->last_ns) * 1e-9;
    dt = fmin(fmax(dt, 0.1 * nominal), 0.1);
    s->first = false;
    s->last_ns = now_ns;
    double force_d[3] = {0, 0, 0};
    const double none[3] = {0, 0, 0};
    s->view.flags = 0;
    s->view.depth_m = s->view.rendered_stiffness_N_m = 0;
    const bool good = servo_read(s, dt);
    servo_take_model(s);
    if (good && s->lost) {
        s->lost = false;
        servo_to_arming(s);
        if (s->o.pose_only) s->view.state = PAL_SERVO_FREE;
        if (s->estop_latched) s->view.state = PAL_SERVO_ESTOP;
        servo_event(s, PAL_EVENT_RECOVERED, 0, 0, "device answers again");
    }
    if (good) {
        s->bad_reads = 0;
        /* the workspace may move only while no force is rendered */
        const double *origin = pal_norm3(s->force_prev) < 0.01 ? pal_triple_buffer_take(&s->origins) : NULL;
        if (origin) {
            pal_copy3(s->o.origin_m, origin);
            s->has_position = false;
        }
        if (servo_states(s, now_ns, dt)) servo_render(s, now_ns, dt, force_d);
    } else if (!s->lost) {
        /* one bad read keeps the force; after more of them the device is lost until it answers again */
        pal_copy3(force_d, s->force_prev);
        if (++s->bad_reads >= BAD_READS_MAX) {
            s->lost = true;
            s->has_position = false;
            s->fade = 0;
            s->view.state = PAL_SERVO_FAULT;
            s->view.n_fault++;
            servo_event(s, PAL_EVENT_DEVICE_LOST, s->read_error, 0,
                        s->read_error < 0 ? s->o.backend->strerror(s->o.device, s->read_error)
                                          : "position of the device is not a number");
            pal_set3(force_d, 0, 0, 0);
        }
    }
    /* an e-stop that came during the tick counts for this tick */
    if (atomic_load(&s->estop) || s->estop_latched || !pal_finite3(force_d)) pal_set3(force_d, 0, 0, 0);
    if (s->estop_latched) s->fade = 0;
    s->o.backend->write(s->o.device, force_d, none, 0);
    pal_copy3(s->force_prev, force_d);
    servo_publish(s, now_ns, force_d);
}

bool pal_servo_device_lost(const pal_servo *servo)
{
    return servo->lost;
}

void pal_servo_end(pal_servo *servo)
{
    const double none[3] = {0, 0, 0};
    for (int i = 0; i < 10; i++) servo->o.backend->write(servo->o.device, none, none, 0);
    servo->o.backend->stop(servo->o.device);
}
