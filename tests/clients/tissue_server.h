/* A simulated server and network for tests of the bridge: tissue below a plane, models at 60 Hz, delay lines both ways
 * with jitter, loss and outages; virtual time, deterministic by seed. The tissue is quasi-static: contact   surface at
 * z = height (t), N = k1 d + k2 d^2 along z; friction mu N with stiffness kt, solved at the poses that arrive, 60 times
 * a second grasp     from the pose at which the button came: f = -k r (1 + |r| / length) with r = x - x_grasp A model
 * is what clients/haptic_bridge/README.md says a server sends: the plane of zero force p = x + (F / k) n and the
 * tangent k there; f_ref is the tissue's own force. */
#ifndef TESTS_CLIENTS_TISSUE_SERVER_H
#define TESTS_CLIENTS_TISSUE_SERVER_H
#include "clients/haptic_bridge/device_virtual.h"
#include "clients/haptic_bridge/servo.h"
#include "server/base/vec3.h"
#include "tests/fixtures/random.h"

#include <stdio.h>

enum { TISSUE_QUEUE = 512, TISSUE_TICK_NS = 1000000, TISSUE_FRAME_NS = 16666667, TISSUE_POSE_TICKS = 4 };

typedef struct tissue_pose {
    uint64_t arrives_ns;
    uint32_t seq;
    double x[3];
    bool button;
} tissue_pose;
typedef struct tissue_message {
    uint64_t arrives_ns;
    pal_wire_haptic model;
} tissue_message;

typedef struct tissue_options {
    double k1, k2;                        /* N/m, N/m^2 */
    double mu, kt;                        /* friction */
    double grasp_k, length_m;             /* length 0: linear */
    double height_m, breath_m, breath_hz; /* of the surface */
    double k_jitter, plane_jitter_m;      /* of each model: share, and metres */
    double rtt_s, loss;                   /* round trip, jitter a quarter of it; loss of poses and models */
    bool raw;                             /* the baseline: the tissue's force is sent and held */
} tissue_options;

/* device, servo, network and tissue */
typedef struct tissue_rig {
    tissue_options o;
    void *device;
    pal_dev_info info;
    pal_servo *servo;
    uint64_t now_ns, next_frame_ns, seed;
    uint32_t seq, generation, n_pose;
    bool silent; /* nothing passes, either way */
    tissue_pose up[TISSUE_QUEUE];
    tissue_message down[TISSUE_QUEUE];
    int n_up, n_down;
    tissue_pose seen; /* newest at the server */
    double anchor[3], x_grasp[3];
    bool has_anchor, grasps;
    double raw_N[3];
    uint32_t raw_seq;
    pal_servo_view view;
    double given_J, given_max_J; /* energy that the motors have given to handle and hand so far, and its maximum */
    double command_J; /* the same with the force commanded in place of the motor's, a tick and a lag before it */
} tissue_rig;

static inline double tissue_height(const tissue_rig *r, uint64_t now_ns)
{
    return r->o.height_m + r->o.breath_m * sin(2 * 3.14159265358979 * r->o.breath_hz * (double)now_ns * 1e-9);
}

/* force of the tissue on a tool at x; friction by the anchor given */
static inline void tissue_normal(const tissue_rig *r, const double x[3], uint64_t now_ns, double *depth, double *N)
{
    *depth = tissue_height(r, now_ns) - x[2];
    *N = *depth > 0 ? r->o.k1 * *depth + r->o.k2 * *depth * *depth : 0;
}

static inline void tissue_grasp(const tissue_rig *r, const double x[3], double f[3], double K[6])
{
    double away[3];
    pal_sub3(away, x, r->x_grasp);
    const double size = pal_norm3(away), more = r->o.length_m > 0 ? 1 / r->o.length_m : 0;
    pal_scale3(f, -r->o.grasp_k * (1 + size * more), away);
    for (int i = 0, at = 0; i < 3; i++)
        for (int j = i; j < 3; j++)
            K[at++] = r->o.grasp_k * ((i == j) * (1 + size * more) + (size > 0 ? more * away[i] * away[j] / size : 0));
}

/* the model at the newest pose */
static inline void tissue_solve(tissue_rig *r, pal_wire_haptic *m)
{
    const double *x = r->seen.x;
    double depth, N;
    tissue_normal(r, x, r->now_ns, &depth, &N);
    *m = (pal_wire_haptic){
        .seq = ++r->seq, .stamp_us = r->now_ns / 1000, .frame_us = 16667, .echo_seq = r->seen.seq, .n_patch = 1};
    pal_copy3(m->origin_m, x);
    const double tangent = r->o.k1 + (depth > 0 ? 2 * r->o.k2 * depth : 0);
    const double k = fmax(10, tangent * (1 + r->o.k_jitter * random_signed(&r->seed)));
    const double plane = (depth > 0 ? N / k : depth) + r->o.plane_jitter_m * random_signed(&r->seed);
    const double rate = 2 * 3.14159265358979 * r->o.breath_hz;
    m->patch[0] =
        (pal_wire_contact_patch){.id = 1,
                                 .group = 1,
                                 .n = {0, 0, 1},
                                 .p_m = {0, 0, (float)plane},
                                 .v_m_s = {0, 0, (float)(r->o.breath_m * rate * cos(rate * (double)r->now_ns * 1e-9))},
                                 .k1_N_m = (float)k,
                                 .kt_N_m = (float)r->o.kt,
                                 .mu_s = (float)r->o.mu,
                                 .mu_d = (float)r->o.mu};
    m->f_ref_N[2] = (float)N;
    if (N > 0 && r->o.mu > 0) {
        if (!r->has_anchor) pal_copy3(r->anchor, x);
        double e[3] = {x[0] - r->anchor[0], x[1] - r->anchor[1], 0};
        const double pulls = r->o.kt * pal_norm3(e);
        if (pulls > r->o.mu * N) pal_scale3(e, r->o.mu * N / pulls, e);
        pal_sub3(r->anchor, x, e);
        for (int k2 = 0; k2 < 2; k2++) m->f_ref_N[k2] = (float)(-r->o.kt * e[k2]);
    }
    r->has_anchor = N > 0;
    if (r->seen.button && !r->grasps) pal_copy3(r->x_grasp, x);
    r->grasps = r->seen.button && r->o.grasp_k > 0;
    if (r->grasps) {
        double f[3], K[6];
        tissue_grasp(r, x, f, K);
        m->has_grasp = 1;
        for (int c = 0; c < 3; c++) {
            m->grasp_f0_N[c] = (float)f[c];
            m->f_ref_N[c] += (float)f[c];
        }
        for (int c = 0; c < 6; c++) m->grasp_k_N_m[c] = (float)K[c];
    }
}

/* when a message that leaves now arrives; 0: never */
static inline uint64_t tissue_arrival(tissue_rig *r)
{
    const double delay = r->o.rtt_s / 2 * (1 + 0.25 * random_signed(&r->seed));
    const bool lost = random_unit(&r->seed) < r->o.loss;
    return r->silent || lost ? 0 : r->now_ns + (uint64_t)(delay * 1e9);
}

static inline void tissue_network(tissue_rig *r)
{
    for (int i = 0; i < r->n_up;) {
        if (r->up[i].arrives_ns > r->now_ns) {
            i++;
            continue;
        }
        if (r->up[i].seq > r->seen.seq) r->seen = r->up[i];
        r->up[i] = r->up[--r->n_up];
    }
    if (r->now_ns >= r->next_frame_ns) {
        r->next_frame_ns += TISSUE_FRAME_NS;
        tissue_message *m = &r->down[r->n_down];
        if (r->seen.seq > 0) {
            tissue_solve(r, &m->model);
            m->arrives_ns = tissue_arrival(r);
            r->n_down += m->arrives_ns > 0 && r->n_down < TISSUE_QUEUE - 1;
        }
    }
    for (int i = 0; i < r->n_down;) {
        tissue_message *m = &r->down[i];
        if (m->arrives_ns > r->now_ns) {
            i++;
            continue;
        }
        if (!r->o.raw)
            pal_servo_put_model(r->servo, &m->model, r->generation, r->now_ns);
        else if (m->model.seq > r->raw_seq)
            for (int c = 0; c < 3; c++) r->raw_N[c] = (double)m->model.f_ref_N[c];
        if (m->model.seq > r->raw_seq) r->raw_seq = m->model.seq;
        *m = r->down[--r->n_down];
    }
}

static inline bool tissue_open(tissue_rig *r, const char *id, const tissue_options *o, const pal_servo_options *servo)
{
    *r = (tissue_rig){.o = *o, .now_ns = 1000000000, .generation = 1, .seed = 42};
    r->next_frame_ns = r->now_ns;
    pal_servo_options s = *servo;
    s.backend = pal_device_virtual();
    if (s.rate_hz <= 0) s.rate_hz = 1000;
    if (s.rotation[0] == 0 && s.rotation[1] == 0 && s.rotation[2] == 0)
        s.rotation[0] = s.rotation[4] = s.rotation[8] = 1;
    if (pal_device_virtual()->open(&r->device, id, &s.info)) return false;
    r->info = s.info;
    s.device = r->device;
    pal_device_virtual()->force_enable(r->device, 1);
    return pal_servo_create(&s, &r->servo) == PAL_ERR_OK;
}

static inline void tissue_close(tissue_rig *r)
{
    pal_servo_destroy(r->servo);
    pal_device_virtual()->close(r->device);
}

static inline void tissue_tick(tissue_rig *r)
{
    tissue_network(r);
    const double none[3] = {0, 0, 0};
    double x[3];
    if (r->o.raw) {
        pal_dev_state state;
        pal_device_virtual()->read(r->device, &state);
        pal_copy3(x, state.position_m);
        pal_device_virtual()->write(r->device, r->raw_N, none, 0);
        pal_copy3(r->view.position_m, x);
        pal_copy3(r->view.force_N, r->raw_N);
        r->view.buttons = state.buttons & PAL_DEVICE_BUTTON_GRASP;
    } else {
        pal_servo_tick(r->servo, r->now_ns);
        const pal_servo_view *view = pal_servo_take_view(r->servo);
        if (view) r->view = *view;
        pal_copy3(x, r->view.position_m);
    }
    if ((r->now_ns / TISSUE_TICK_NS) % TISSUE_POSE_TICKS == 0) {
        tissue_pose p = {.seq = ++r->n_pose, .button = r->view.buttons != 0};
        pal_copy3(p.x, x);
        p.arrives_ns = tissue_arrival(r);
        if (p.arrives_ns > 0 && r->n_up < TISSUE_QUEUE) r->up[r->n_up++] = p;
    }
    double command[3];
    pal_copy3(command, r->view.force_N);
    double from[3], to[3], f0[3], f1[3], step[3], mean[3];
    pal_virtual_truth(r->device, from, NULL, f0);
    pal_virtual_advance(r->device, 1e-3);
    pal_virtual_truth(r->device, to, NULL, f1);
    pal_sub3(step, to, from);
    pal_add3(mean, f0, f1);
    r->command_J += pal_dot3(command, step);
    r->given_J += pal_dot3(mean, step) / 2;
    r->given_max_J = fmax(r->given_max_J, r->given_J);
    r->now_ns += TISSUE_TICK_NS;
}

static inline void tissue_run(tissue_rig *r, double seconds)
{
    for (int i = 0; i < (int)(seconds * 1000 + 0.5); i++) tissue_tick(r);
}

static inline double tissue_force(const tissue_rig *r)
{
    return pal_norm3(r->view.force_N);
}

static inline bool tissue_event(tissue_rig *r, int kind)
{
    pal_servo_event event;
    bool found = false;
    while (pal_servo_take_event(r->servo, &event)) found = found || event.kind == kind;
    return found;
}
#endif
