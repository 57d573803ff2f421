#include "clients/haptic_bridge/servo.h"
#include "clients/haptic_bridge/tuning.h"
#include "server/base/command_queue.h"
#include "server/base/triple_buffer.h"
#include "server/base/vec3.h"
#include "server/rendering/energy_gate.h"
#include "server/rendering/local_contact.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { SERVO_GAPS = 64, SERVO_EVENTS = 64 };

typedef struct servo_model {
    uint32_t generation;
    bool empty; /* only a change of generation */
    uint64_t arrival_ns;
    double late_s; /* its delay above the usual least one */
    pal_wire_haptic haptic;
} servo_model;

/* what of model and walls is rendered: everything whose change the energy gate pays for */
typedef struct servo_use {
    double lambda, age_s;     /* share of the newest model, extrapolation of its surfaces */
    double gain, wall_gain;   /* of model and walls, 0 to 1 */
    double stiffness_max_N_m; /* world */
} servo_use;

struct pal_servo {
    pal_servo_options o;
    double cap_N;
    pal_triple_buffer models, views, frames;
    servo_model model_slot[3];
    pal_servo_view view_slot[3];
    pal_workspace_frame frame_slot[3];
    pal_command_queue *events;
    atomic_bool estop, rearm, stalled;
    _Atomic uint64_t ticks;
    /* of [net]: least usual delay of the models of a session, with the unknown offset of the two clocks */
    double min_delay_s;
    uint64_t last_arrival_ns;
    uint32_t delay_generation;
    /* the rest belongs to [servo] */
    servo_model model;                  /* the newest; empty: none */
    uint64_t last_ns, rest_ns, both_ns; /* both: since when both buttons are held, 0: they are not */
    double gap_s[SERVO_GAPS];
    int n_gap;
    bool first, estop_latched, lost, stale, was_stale, at_wall;
    const pal_workspace_frame *next_frame; /* waits until it may be applied */
    int degraded, bad_reads, read_error;
    pal_workspace place;
    double blend_s; /* of the newest model */
    double fade, fade_rate, clutch_fade, scale_down, mean_square;
    double force_prev[3], torque_prev[3]; /* commanded in the last tick, device axes */
    /* force and torque that the motors are driven to and that they are taken to give, device axes */
    double motor_to[2][3], motor[2][3];
    pal_dev_state device;
    pal_local_blend blend;
    pal_local_contact_state memory;
    servo_use use;
    pal_energy_gate gate;
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
    pal_triple_buffer_init(&s->frames, &s->frame_slot[0], &s->frame_slot[1], &s->frame_slot[2]);
    s->place.frame.scale = s->o.scale;
    pal_copy3(s->place.frame.origin_m, s->o.origin_m);
    memcpy(s->place.frame.rotation, s->o.rotation, sizeof s->o.rotation);
    pal_workspace_restart(&s->place);
    s->gate = (pal_energy_gate){.max_J = TANK_MAX_J, .leak_W = options->leak_W, .tank_J = TANK_START_J};
    s->min_delay_s = INFINITY;
    s->model.empty = true;
    s->first = true;
    s->clutch_fade = s->scale_down = 1;
    s->blend_s = BLEND_MIN_S;
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

/* delay of a model above the least one of its session, which is forgotten slowly: s */
static double servo_late(pal_servo *s, const pal_wire_haptic *model, uint32_t generation, uint64_t arrival_ns)
{
    const double delay = 1e-9 * (double)(int64_t)(arrival_ns - 1000 * model->stamp_us);
    const double since = 1e-9 * (double)(int64_t)(arrival_ns - s->last_arrival_ns);
    const bool other = generation != s->delay_generation;
    s->min_delay_s = other ? delay : fmin(delay, s->min_delay_s + DELAY_FORGOTTEN * fmax(since, 0));
    s->last_arrival_ns = arrival_ns;
    s->delay_generation = generation;
    return delay - s->min_delay_s;
}

void pal_servo_put_model(pal_servo *servo, const pal_wire_haptic *model, uint32_t generation, uint64_t arrival_ns)
{
    servo_model *slot = pal_triple_buffer_slot(&servo->models);
    slot->generation = generation;
    slot->empty = false;
    slot->arrival_ns = arrival_ns;
    slot->late_s = servo_late(servo, model, generation, arrival_ns);
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

void pal_servo_put_frame(pal_servo *servo, const pal_workspace_frame *frame)
{
    *(pal_workspace_frame *)pal_triple_buffer_slot(&servo->frames) = *frame;
    pal_triple_buffer_publish(&servo->frames);
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

/* device joules for each world joule */
static double servo_energy_scale(const pal_servo *s)
{
    return s->o.force_scale / s->place.frame.scale;
}

static pal_local_limits servo_limits(const pal_servo *s, double stiffness_max_N_m)
{
    return (pal_local_limits){.stiffness_max_N_m = stiffness_max_N_m,
                              .damping_max_Ns_m =
                                  s->o.info.damping_max_Ns_m / (s->place.frame.scale * s->o.force_scale),
                              .damping_floor_s = s->o.hand_off ? DAMPING_FLOOR_HAND_OFF_S : DAMPING_FLOOR_S,
                              .force_max_N = s->cap_N / s->o.force_scale};
}

/* energy at the device's pose if `use` were rendered, J at the device */
static double servo_stored(const pal_servo *s, const servo_use *use)
{
    double energy = 0, wall_N[3], wall_J;
    if (use->gain > 0) {
        const pal_local_limits limits = servo_limits(s, use->stiffness_max_N_m);
        pal_local_model mix;
        pal_local_blend_mix(&s->blend, use->lambda, use->age_s, &mix);
        energy = use->gain * servo_energy_scale(s) * pal_local_contact_energy(&mix, s->place.x_w, &limits, &s->memory);
    }
    if (pal_workspace_walls(&s->place, &s->o.info, 0, wall_N, &wall_J)) energy += use->wall_gain * wall_J;
    return energy;
}

/* nothing is rendered any more; what was stored is lost */
static void servo_release(pal_servo *s)
{
    s->use.gain = s->use.wall_gain = 0;
    s->memory.n_group = 0;
    pal_energy_gate_drop(&s->gate, 0);
}

static void servo_forget_model(pal_servo *s)
{
    s->model.empty = true;
    s->blend.from = s->blend.to = (pal_local_model){0};
    servo_release(s);
}

static void servo_to_arming(pal_servo *s)
{
    s->view.state = PAL_SERVO_ARMING;
    s->rest_ns = 0;
    s->fade = 0;
    servo_release(s);
}

static void servo_fault(pal_servo *s, pal_servo_event_kind kind, double value, const char *text)
{
    s->view.n_fault++;
    servo_event(s, kind, 0, value, text);
    servo_to_arming(s);
}

/* another place of the workspace, once it is allowed */
static void servo_move_frame(pal_servo *s)
{
    const pal_workspace_frame *fresh = pal_triple_buffer_take(&s->frames);
    if (fresh) s->next_frame = fresh;
    if (!s->next_frame || pal_norm3(s->force_prev) > NO_FORCE_N) return;
    if (fabs(s->next_frame->scale - s->place.frame.scale) > 0 && !s->place.clutched &&
        s->view.state != PAL_SERVO_ARMING)
        return;
    s->place.frame = *s->next_frame;
    s->next_frame = NULL;
    servo_release(s);
    pal_workspace_restart(&s->place);
}

/* Work of the hand on the device since the last pose. The motors follow a command one tick and MOTOR_TIME_S late: a
 * spring gives energy by that, which the damping floor takes and the tank must not count as income */
static double servo_work(pal_servo *s, double dt)
{
    const double left = exp(-dt / MOTOR_TIME_S), mean = (1 - left) * MOTOR_TIME_S / dt;
    const double *moved[2] = {s->place.step_d, s->place.turn_d}, *next[2] = {s->force_prev, s->torque_prev};
    double work = 0;
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            const double to = s->motor_to[i][k], off = s->motor[i][k] - to;
            work -= (to + mean * off) * moved[i][k];
            s->motor[i][k] = to + left * off;
            s->motor_to[i][k] = next[i][k];
        }
    return work;
}

/* pose of the device and the hand's work since the last one; false: the device gave nothing usable */
static bool servo_read(pal_servo *s, double dt)
{
    pal_dev_state state;
    s->read_error = s->o.backend->read(s->o.device, &state);
    if (s->read_error < 0 || !pal_finite3(state.position_m)) return false;
    servo_move_frame(s);
    const bool button = (state.buttons & PAL_DEVICE_BUTTON_CLUTCH) != 0, was = s->place.clutched;
    const bool hold = button && (was || pal_norm3(s->force_prev) < CLUTCH_FORCE_N);
    pal_workspace_move(&s->place, &state, hold, dt);
    if (hold != was) servo_event(s, PAL_EVENT_CLUTCH, hold, 0, hold ? "clutch held" : "clutch released");
    s->device = state;
    const double work = servo_work(s, dt);
    if (s->o.info.dof_out > 3 && !hold) {
        double turn[3];
        pal_workspace_to_world(&s->place, s->place.turn_d, turn);
        pal_local_contact_turn(&s->memory, turn);
    }
    pal_energy_gate_work(&s->gate, work, servo_stored(s, &s->use));
    return true;
}

/* the newest model of the newest generation, seq growing; older ones are dropped */
static void servo_take_model(pal_servo *s)
{
    const servo_model *fresh = pal_triple_buffer_take(&s->models);
    if (!fresh) return;
    const bool other = fresh->generation != s->model.generation;
    if (other) {
        /* another session owes nothing to this one: force fades in from zero, with an empty tank */
        if (s->model.generation != 0) s->gate.tank_J = fmin(s->gate.tank_J, 0);
        s->fade = 0;
        servo_forget_model(s);
        s->model.generation = fresh->generation;
    }
    if (fresh->empty) return;
    if (!s->model.empty && (int32_t)(fresh->haptic.seq - s->model.haptic.seq) <= 0) {
        s->view.n_model_old++;
        return;
    }
    double gap = 0;
    if (!s->model.empty && fresh->arrival_ns > s->model.arrival_ns) {
        gap = (double)(fresh->arrival_ns - s->model.arrival_ns) * 1e-9;
        s->gap_s[s->n_gap++ % SERVO_GAPS] = gap;
    }
    /* a slow server changes its mind by more at once */
    s->blend_s = fmin(fmax(BLEND_MIN_S, fmax(gap, 1e-6 * fresh->haptic.frame_us)), BLEND_MAX_S);
    const pal_local_limits limits = servo_limits(s, s->use.stiffness_max_N_m);
    if (!pal_local_blend_start(&s->blend, s->use.lambda, s->use.age_s, &fresh->haptic, &limits)) {
        s->view.n_not_finite++;
        servo_forget_model(s);
        servo_fault(s, PAL_EVENT_FAULT, 0, "a number of the model was not finite");
        return;
    }
    s->use.lambda = s->use.age_s = 0;
    s->model = *fresh;
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
static double servo_since_arrival_s(const pal_servo *s, uint64_t now)
{
    return s->model.empty || now < s->model.arrival_ns ? 0 : (double)(now - s->model.arrival_ns) * 1e-9;
}

/* time since the model in use was made, as far as its delay tells */
static double servo_model_age_s(const pal_servo *s, uint64_t now)
{
    return s->model.empty ? 0 : servo_since_arrival_s(s, now) + s->model.late_s;
}

static void servo_toward(double *value, double wanted, double step)
{
    *value = wanted > *value ? fmin(wanted, *value + step) : fmax(wanted, *value - step);
}

/* both buttons together are what a frightened hand does, and no way of working */
static void servo_watch_buttons(pal_servo *s, uint64_t now)
{
    const uint32_t both = PAL_DEVICE_BUTTON_GRASP | PAL_DEVICE_BUTTON_CLUTCH;
    if ((s->device.buttons & both) != both)
        s->both_ns = 0;
    else if (s->both_ns == 0)
        s->both_ns = now;
    else if ((double)(now - s->both_ns) * 1e-9 >= ESTOP_HOLD_S)
        atomic_store(&s->estop, true);
}

/* latches and states; true: forces may be rendered this tick */
static bool servo_states(pal_servo *s, uint64_t now, double dt)
{
    servo_watch_buttons(s, now);
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
        const bool ready = (s->device.buttons & PAL_DEVICE_BUTTON_DEADMAN) && pal_norm3(s->place.v_d) < ARM_SPEED_M_S;
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
    const bool held = s->place.clutched;
    servo_toward(&s->clutch_fade, held ? 0 : 1, held ? dt / CLUTCH_FADE_S : dt / FADE_IN_S);
    return true;
}

/* what should be rendered now, changed by no more than a tick's step */
static servo_use servo_wanted(const pal_servo *s, uint64_t now, double dt)
{
    const double gain = s->fade * s->clutch_fade * s->scale_down;
    double k_max = s->o.info.stiffness_max_N_m;
    if (s->degraded >= 1) k_max = fmin(k_max, DEGRADED_K_N_M);
    const double lambda = fmin(1, s->use.lambda + dt / s->blend_s);
    /* the model before has been moved on to the arrival, so that only the newest one has to catch up */
    const double late_s = s->model.empty ? 0 : lambda * s->model.late_s;
    return (servo_use){.lambda = lambda,
                       .age_s = fmin(servo_since_arrival_s(s, now) + late_s, EXTRAPOLATE_MAX_S),
                       .gain = fmin(gain, s->use.gain + dt * s->fade_rate),
                       .wall_gain = s->degraded == 2 ? 0 : fmin(s->scale_down, s->use.wall_gain + dt / FADE_START_S),
                       .stiffness_max_N_m = k_max / (s->place.frame.scale * s->o.force_scale)};
}

typedef struct servo_change {
    const pal_servo *servo;
    servo_use from, to;
} servo_change;

static servo_use servo_use_between(const servo_change *c, double share)
{
    const servo_use *a = &c->from, *b = &c->to;
    return (servo_use){a->lambda + share * (b->lambda - a->lambda), a->age_s + share * (b->age_s - a->age_s),
                       a->gain + share * (b->gain - a->gain), a->wall_gain + share * (b->wall_gain - a->wall_gain),
                       a->stiffness_max_N_m + share * (b->stiffness_max_N_m - a->stiffness_max_N_m)};
}

static double servo_change_stored(const void *user, double share)
{
    const servo_change *c = user;
    const servo_use use = servo_use_between(c, share);
    return servo_stored(c->servo, &use);
}

/* force and torque of a use, world; memory moves on */
static void servo_force(const pal_servo *s, const servo_use *use, double dt, pal_local_contact_state *memory,
                        pal_local_contact_result *out)
{
    const pal_local_limits limits = servo_limits(s, use->stiffness_max_N_m);
    pal_local_model mix;
    pal_local_blend_mix(&s->blend, use->lambda, use->age_s, &mix);
    pal_local_contact_force(&mix, s->place.x_w, s->place.v_w, dt, &limits, memory, out);
    pal_scale3(out->force_N, use->gain, out->force_N);
    pal_scale3(out->torque_N_m, use->gain, out->torque_N_m);
}

/* what the model gives: falls of gain and limits at once, everything else as the energy gate allows */
static void servo_contact(pal_servo *s, uint64_t now, double dt, pal_local_contact_result *out)
{
    servo_change change = {.servo = s, .from = s->use, .to = servo_wanted(s, now, dt)};
    servo_use *use = &change.from;
    use->gain = fmin(use->gain, change.to.gain);
    use->wall_gain = fmin(use->wall_gain, change.to.wall_gain);
    use->stiffness_max_N_m = fmin(use->stiffness_max_N_m, change.to.stiffness_max_N_m);
    pal_energy_gate_drop(&s->gate, servo_stored(s, use));
    pal_local_contact_state memory = s->memory;
    pal_local_contact_result before;
    servo_force(s, use, dt, &memory, &before);
    s->use = servo_use_between(&change, pal_energy_gate_pay(&s->gate, dt, servo_change_stored, &change));
    servo_force(s, &s->use, dt, &s->memory, out);
    pal_energy_gate_settle(&s->gate, servo_stored(s, &s->use));
    const double jump = s->o.force_scale * pal_dist3(before.force_N, out->force_N);
    if (jump > s->view.jump_max_N) s->view.jump_max_N = jump;
}

/* a long mean force above the continuous rating scales force down */
static void servo_rate(pal_servo *s, double dt)
{
    const double rating = s->o.info.continuous_N;
    /* a device that spares its motors heats by what it gives */
    const double *given = s->device.has_force ? s->device.force_N : s->force_prev;
    s->mean_square += (1 - exp(-dt / RATING_TIME_S)) * (pal_dot3(given, given) - s->mean_square);
    const bool hot = s->mean_square > rating * rating;
    servo_toward(&s->scale_down, hot ? 0 : 1, hot ? dt / SCALE_DOWN_S : dt / SCALE_UP_S);
}

/* cap and rise limit; device axes; true: something was cut */
static bool servo_cut(const pal_servo *s, double force_d[3], double torque_d[3], double dt)
{
    const double size = pal_norm3(force_d);
    const double max = fmin(s->cap_N, pal_norm3(s->force_prev) + s->cap_N / RISE_TIME_S * dt);
    if (size > max) {
        /* slightly less, so that no rounding passes the cap */
        pal_scale3(torque_d, max / size, torque_d);
        pal_scale3(force_d, max / size * (1 - 1e-12), force_d);
    }
    return size > s->cap_N;
}

/* Damping and walls, device axes */
static void servo_own_forces(pal_servo *s, double dt, double force_d[3])
{
    double wall[3], wall_J, stale = 0;
    if (s->degraded == 2) return; /* a late loop gives no force at all */
    if (s->stale) stale = s->fade > 0 ? STALE_DAMPING_NS_M : FREE_DAMPING_NS_M;
    const double gate = pal_energy_gate_damping(&s->gate, pal_norm3(s->place.v_d), dt);
    if (gate > 0 && s->gate.tank_J < 0) s->view.n_passivity++;
    pal_axpy3(force_d, -fmin(s->o.info.damping_max_Ns_m, fmax(stale, gate)), s->place.v_d);
    const bool at_wall = pal_workspace_walls(&s->place, &s->o.info, DAMPING_FLOOR_S, wall, &wall_J);
    if (at_wall) pal_axpy3(force_d, s->use.wall_gain, wall);
    if (at_wall && !s->at_wall) servo_event(s, PAL_EVENT_WORKSPACE_EDGE, 0, 0, "edge of the workspace");
    s->at_wall = at_wall;
}

/* everything that gives force; results in device axes, zero after a fault */
static void servo_render(pal_servo *s, uint64_t now, double dt, double force_d[3], double torque_d[3])
{
    pal_local_contact_result contact;
    servo_rate(s, dt);
    servo_contact(s, now, dt, &contact);
    if (!pal_finite3(contact.force_N) || !pal_finite3(contact.torque_N_m)) {
        s->view.n_not_finite++;
        servo_forget_model(s);
        servo_fault(s, PAL_EVENT_FAULT, 0, "force was not finite");
        return;
    }
    double force[3], torque[3];
    pal_workspace_to_device(&s->place, contact.force_N, force);
    pal_scale3(force, s->o.force_scale, force);
    const double speed = pal_norm3(s->place.v_d);
    const bool driven = pal_dot3(force, s->place.v_d) > 0 && pal_norm3(force) > DRIVEN_FORCE_N;
    if ((driven && speed > DRIVEN_SPEED_M_S) || speed > SPEED_MAX_M_S) {
        servo_fault(s, PAL_EVENT_LIMIT, speed, "too fast: force off");
        return;
    }
    pal_workspace_to_device(&s->place, contact.torque_N_m, torque);
    pal_scale3(torque, s->o.info.dof_out > 3 ? servo_energy_scale(s) : 0, torque);
    pal_copy3(force_d, force);
    pal_copy3(torque_d, torque);
    servo_own_forces(s, dt, force_d);
    pal_servo_view *v = &s->view;
    if (servo_cut(s, force_d, torque_d, dt) || (contact.saturated && s->use.gain > 0))
        v->n_saturated++, v->flags |= PAL_WIRE_POSE_SATURATED;
    v->n_clamped += contact.clamped;
    if (contact.clamped) v->flags |= PAL_WIRE_POSE_STIFF_CLAMPED;
    if (contact.n_contact > 0) v->flags |= PAL_WIRE_POSE_CONTACT;
    v->depth_m = contact.depth_m;
    v->n_proxy = contact.n_contact;
    memcpy(v->proxy_m, contact.proxy_m, sizeof v->proxy_m);
    v->rendered_stiffness_N_m = contact.depth_m > 0 ? pal_norm3(contact.force_N) / contact.depth_m : 0;
    const bool acts = s->use.gain > 0 && (contact.n_contact > 0 || s->model.haptic.has_grasp);
    v->state =
        s->stale && s->fade > 0 && v->n_model > 0 ? PAL_SERVO_STALE : (acts ? PAL_SERVO_CONTACT : PAL_SERVO_FREE);
}

static void servo_publish(pal_servo *s, uint64_t now)
{
    pal_servo_view *v = &s->view;
    v->n_tick++;
    pal_copy3(v->position_m, s->place.x_w);
    pal_copy3(v->velocity_m_s, s->place.v_w);
    pal_copy3(v->omega_rad_s, s->place.omega_w);
    memcpy(v->quat, s->place.quat_w, sizeof v->quat);
    pal_workspace_to_world(&s->place, s->force_prev, v->force_N);
    pal_workspace_to_world(&s->place, s->torque_prev, v->torque_N_m);
    v->fade = s->use.gain;
    v->grip = s->device.grip;
    v->buttons = s->device.buttons & PAL_DEVICE_BUTTON_GRASP ? PAL_WIRE_GRASP : 0;
    v->motor_temperature = s->device.motor_temperature;
    v->tank_mJ = 1e3 * s->gate.tank_J;
    v->generated_mJ = 1e3 * s->gate.given_max_J;
    v->force_rms_N = sqrt(s->mean_square);
    v->force_max_N = fmax(v->force_max_N, pal_norm3(s->force_prev));
    if (s->place.clutched) v->flags |= PAL_WIRE_POSE_CLUTCHED;
    if (s->stale) v->flags |= PAL_WIRE_POSE_STALE;
    if (s->estop_latched) v->flags |= PAL_WIRE_POSE_ESTOP;
    if (s->o.pose_only) v->flags |= PAL_WIRE_POSE_POSE_ONLY;
    if (s->fade > 0 && v->state != PAL_SERVO_ESTOP) v->flags |= PAL_WIRE_POSE_FORCES_ON;
    const bool model = !s->model.empty;
    const double age_us = 1e6 * servo_model_age_s(s, now);
    v->model_seq = model ? s->model.haptic.seq : 0;
    v->model_stamp_us = model ? s->model.haptic.stamp_us : 0;
    v->model_age_us = age_us < 4e9 ? (uint32_t)age_us : UINT32_MAX;
    for (int k = 0; k < 3; k++) v->reference_N[k] = model ? (double)s->model.haptic.f_ref_N[k] : 0;
    pal_servo_view *slot = pal_triple_buffer_slot(&s->views);
    *slot = *v;
    pal_triple_buffer_publish(&s->views);
    atomic_fetch_add(&s->ticks, 1);
}

/* one bad read keeps the force; after more of them the device is lost until it answers again */
static void servo_unread(pal_servo *s, double force_d[3], double torque_d[3])
{
    if (s->lost) return;
    if (++s->bad_reads < BAD_READS_MAX) {
        pal_copy3(force_d, s->force_prev);
        pal_copy3(torque_d, s->torque_prev);
        return;
    }
    s->lost = true;
    s->fade = 0;
    servo_release(s);
    pal_workspace_restart(&s->place);
    s->view.state = PAL_SERVO_FAULT;
    s->view.n_fault++;
    servo_event(s, PAL_EVENT_DEVICE_LOST, s->read_error, 0,
                s->read_error < 0 ? s->o.backend->strerror(s->o.device, s->read_error)
                                  : "position of the device is not a number");
}

void pal_servo_tick(pal_servo *s, uint64_t now_ns)
{
    const double nominal = 1 / s->o.rate_hz;
    double dt = s->first ? nominal : (double)(now_ns - s->last_ns) * 1e-9;
    dt = fmin(fmax(dt, 0.1 * nominal), 0.1);
    s->first = false;
    s->last_ns = now_ns;
    double force_d[3] = {0, 0, 0}, torque_d[3] = {0, 0, 0};
    s->view.flags = 0;
    s->view.n_proxy = 0;
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
    if (!good) {
        servo_unread(s, force_d, torque_d);
    } else {
        s->bad_reads = 0;
        if (servo_states(s, now_ns, dt))
            servo_render(s, now_ns, dt, force_d, torque_d);
        else
            servo_release(s);
    }
    /* an e-stop that came during the tick counts for this tick */
    if (atomic_load(&s->estop) || s->estop_latched || !pal_finite3(force_d)) {
        pal_set3(force_d, 0, 0, 0);
        pal_set3(torque_d, 0, 0, 0);
        servo_release(s);
    }
    if (s->estop_latched) s->fade = 0;
    s->o.backend->write(s->o.device, force_d, torque_d, 0);
    pal_copy3(s->force_prev, force_d);
    pal_copy3(s->torque_prev, torque_d);
    servo_publish(s, now_ns);
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
