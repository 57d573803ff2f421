/* The bridge's servo in virtual time against a simulated server: states, limits, felt stiffness. */
#include "clients/haptic_bridge/device_virtual.h"
#include "clients/haptic_bridge/jitter.h"
#include "clients/haptic_bridge/servo.h"
#include "server/base/vec3.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#define TICK_NS  1000000u
#define FRAME_NS 16666667u

typedef struct trial {
    void *device;
    pal_servo *servo;
    uint64_t now_ns;
    uint32_t seq, generation;
    pal_wire_haptic model;
    bool serving; /* models come at 60 Hz */
    uint64_t next_model_ns;
    pal_servo_view view;
} trial;

/* tissue below z = 0 of the world; device and world have the same axes */
static const pal_servo_options level = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
static bool rig_open_as(trial *r, const char *id, double k1, const pal_servo_options *options)
{
    *r = (trial){.now_ns = 1000000000, .generation = 1, .serving = true};
    pal_servo_options o = *options;
    o.backend = pal_device_virtual();
    o.rate_hz = 1000;
    const int32_t dof_out = o.info.dof_out;
    if (pal_device_virtual()->open(&r->device, id, &o.info)) return false;
    o.device = r->device;
    if (dof_out) o.info.dof_out = dof_out;
    pal_device_virtual()->force_enable(r->device, 1);
    r->model = (pal_wire_haptic){.n_patch = 1, .frame_us = 16667};
    r->model.patch[0] = (pal_wire_contact_patch){.id = 1, .group = 1, .n = {0, 0, 1}, .k1_N_m = (float)k1};
    return pal_servo_create(&o, &r->servo) == PAL_ERR_OK;
}
static bool rig_open(trial *r, const char *id, double k1)
{
    return rig_open_as(r, id, k1, &level);
}
static void rig_close(trial *r)
{
    pal_servo_destroy(r->servo);
    pal_device_virtual()->close(r->device);
}

/* the next model, made at a time, arrives now */
static void rig_model(trial *r, uint64_t made_ns)
{
    r->model.seq = ++r->seq;
    r->model.stamp_us = made_ns / 1000;
    pal_servo_put_model(r->servo, &r->model, r->generation, r->now_ns);
}

static void rig_tick(trial *r)
{
    if (r->serving && r->now_ns >= r->next_model_ns) {
        rig_model(r, r->now_ns);
        r->next_model_ns = r->now_ns + FRAME_NS;
    }
    pal_servo_tick(r->servo, r->now_ns);
    const pal_servo_view *view = pal_servo_take_view(r->servo);
    if (view) r->view = *view;
    pal_virtual_advance(r->device, 1e-3);
    r->now_ns += TICK_NS;
}
static void rig_run(trial *r, double seconds)
{
    for (int i = 0; i < (int)(seconds * 1000); i++) rig_tick(r);
}
static double rig_force(const trial *r)
{
    const double *f = r->view.force_N;
    return sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
}
static bool rig_event(trial *r, int kind)
{
    pal_servo_event event;
    bool found = false;
    while (pal_servo_take_event(r->servo, &event)) found = found || event.kind == kind;
    return found;
}

/* carries the device to a place at 0.4 m/s */
static void rig_carry(trial *r, const double to[3])
{
    double x[3], step[3];
    pal_virtual_truth(r->device, x, NULL, NULL);
    const int n = (int)(pal_dist3(x, to) / 0.4e-3) + 1;
    pal_sub3(step, to, x);
    for (int i = 0; i < n; i++) {
        pal_axpy3(x, 1.0 / n, step);
        pal_virtual_place(r->device, x);
        rig_tick(r);
    }
}
static void rig_buttons(trial *r, uint32_t buttons)
{
    const double upright[4] = {1, 0, 0, 0};
    pal_virtual_set_handle(r->device, PAL_DEVICE_BUTTON_DEADMAN | buttons, upright);
}

/* pressed and held on 300 N/m: comes to rest, and force over depth is the plane's stiffness */
static void press_and_hold_on_a_plane_is_stable_and_feels_its_stiffness(void)
{
    static const char *const devices[] = {"touch", "premium", "omega3", "inverse3", "falcon"};
    static const char *const hands[] = {"average", "light", "firm"};
    for (int d = 0; d < 5; d++) {
        for (int h = 0; h < 3; h++) {
            /* light enough for the continuous rating of every device */
            char id[96];
            snprintf(id, sizeof id, "%s,hand=%s,script=press-hold,depth=%g,clock=virtual", devices[d], hands[h],
                     h == 2 ? 0.5 : 3.0);
            trial r;
            REQUIRE(rig_open(&r, id, 300));
            rig_run(&r, 5);
            double x[3], v[3], fastest = 0, f_sum = 0, d_sum = 0;
            for (int i = 0; i < 500; i++) {
                rig_tick(&r);
                pal_virtual_truth(r.device, x, v, NULL);
                fastest = fmax(fastest, fabs(v[2]));
                f_sum += r.view.force_N[2];
                d_sum += -x[2];
            }
            CHECK_LE(fastest, 2e-3);
            CHECK(f_sum / 500 > 0.1);
            /* the encoder's floor makes the device look deeper by half a step on average */
            CHECK_NEAR(f_sum / d_sum, 300, 0.01 * 300 + 300 * 0.064e-3 * 500 / d_sum);
            CHECK_INT(r.view.state, PAL_SERVO_CONTACT);
            CHECK_NEAR(r.view.rendered_stiffness_N_m, 300, 3);
            rig_close(&r);
        }
    }
}

static void stale_model_fades_out_in_100_and_500_ms_and_comes_back_slowly(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    const double before = rig_force(&r);
    CHECK(before > 0.1);
    r.serving = false;
    const uint64_t last = r.next_model_ns - FRAME_NS;
    double worst_step = 0, at = before;
    while (r.now_ns < last + 99000000) rig_tick(&r);
    CHECK_NEAR(rig_force(&r), before, 0.02);
    CHECK_INT(r.view.flags & PAL_WIRE_POSE_STALE, 0);
    while (r.now_ns < last + 602000000) {
        rig_tick(&r);
        worst_step = fmax(worst_step, fabs(rig_force(&r) - at));
        at = rig_force(&r);
    }
    CHECK_LE(worst_step, 0.1);
    CHECK(r.view.flags & PAL_WIRE_POSE_STALE);
    CHECK_NEAR(r.view.fade, 0, 0);
    CHECK(rig_event(&r, PAL_EVENT_STALE));
    /* what is left is damping of 0.5 N s/m */
    rig_run(&r, 2);
    CHECK_LE(rig_force(&r), 0.005);
    CHECK_INT(r.view.state, PAL_SERVO_FREE);
    r.serving = true;
    at = rig_force(&r);
    worst_step = 0;
    for (int i = 0; i < 1000; i++) {
        rig_tick(&r);
        worst_step = fmax(worst_step, rig_force(&r) - at);
        at = rig_force(&r);
    }
    CHECK_LE(worst_step, 0.05);
    CHECK(at > 0.1);
    CHECK(rig_event(&r, PAL_EVENT_RECOVERED));
    rig_close(&r);
}

/* the network thread is another one: its stamp may lie after the time with which the tick began */
static void model_that_comes_during_the_tick_is_fresh(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    r.model.seq = ++r.seq;
    r.model.stamp_us = r.now_ns / 1000 + 5;
    pal_servo_put_model(r.servo, &r.model, r.generation, r.now_ns + 5000);
    rig_tick(&r);
    CHECK_INT(r.view.model_seq, r.seq);
    CHECK_INT(r.view.model_age_us, 0);
    CHECK_INT(r.view.n_stale, 0);
    CHECK_NEAR(r.view.fade, 1, 0);
    rig_close(&r);
}

/* a stream stands still; then its oldest models arrive, one each tick, of a surface that is now 4 mm higher, now lower
 */
static void models_of_a_stall_that_arrive_in_a_burst_are_stale(void)
{
    for (int t = 0; t < 2; t++) {
        trial r;
        REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
        rig_run(&r, 4);
        CHECK(rig_force(&r) > 0.1);
        const uint64_t began = r.next_model_ns;
        const int n_late = t ? 80 : 9; /* the newest of them 150 ms old or more */
        double fade = 1, step = 0, at[3];
        r.serving = false;
        rig_run(&r, t ? 1.5 : 0.3);
        fade = r.view.fade;
        CHECK_NEAR(fade, t ? 0 : 0.6, 0.05);
        pal_copy3(at, r.view.force_N);
        for (int i = 0; i < n_late; i++) {
            const uint64_t made = began + (uint64_t)i * FRAME_NS;
            r.model.patch[0].p_m[2] = i % 2 ? 0.004f : -0.004f;
            rig_model(&r, made);
            rig_tick(&r);
            CHECK(r.view.flags & PAL_WIRE_POSE_STALE);
            /* a hundredth of the stall is forgotten */
            CHECK_NEAR(r.view.model_age_us, (double)(r.now_ns - TICK_NS - made) * 1e-3, t ? 16e3 : 4e3);
            CHECK_NEAR(r.view.fade, fmax(0, fade - 2e-3 * (i + 1)), 1e-9);
            step = fmax(step, pal_dist3(at, r.view.force_N));
            pal_copy3(at, r.view.force_N);
        }
        CHECK_INT(r.view.n_stale, 1);
        /* models in time again */
        r.model.patch[0].p_m[2] = 0;
        r.next_model_ns = r.now_ns;
        r.serving = true;
        for (int i = 0; i < 2000; i++) {
            rig_tick(&r);
            step = fmax(step, pal_dist3(at, r.view.force_N));
            pal_copy3(at, r.view.force_N);
        }
        printf("  stall of %g s: largest step %.3f N, at the end %.2f N\n", t ? 1.5 : 0.3, step, rig_force(&r));
        CHECK_LE(step, 0.1);
        CHECK_INT(r.view.n_stale, 1);
        CHECK(rig_force(&r) > 0.1);
        rig_close(&r);
    }
}

/* one way of a round trip of 150 ms with jitter of 50 ms, in order; then the way is longer by 200 ms for good */
static void jitter_makes_nothing_stale_and_a_longer_way_becomes_the_usual_one(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=cycle,clock=virtual", 300));
    uint64_t seed = 7, made = r.now_ns, arrives = 0, oldest_us = 0, stale_ticks = 0;
    double peak = 0;
    r.serving = false;
    for (int i = 0; i < 50000; i++) {
        const double way = 0.075 + 0.025 * random_signed(&seed) + (i < 30000 ? 0 : 0.2);
        if (arrives == 0) arrives = made + (uint64_t)(way * 1e9);
        if (arrives <= r.now_ns) {
            rig_model(&r, made);
            made += FRAME_NS;
            arrives = 0;
        }
        rig_tick(&r);
        if (i < 30000) {
            CHECK_INT(r.view.n_stale, 0);
            oldest_us = r.view.model_age_us > oldest_us ? r.view.model_age_us : oldest_us;
        }
        if (i >= 45000) peak = fmax(peak, rig_force(&r));
        if (i >= 31000) stale_ticks += (r.view.flags & PAL_WIRE_POSE_STALE) != 0;
    }
    printf("  jitter: oldest model %.1f ms; longer way: stale for %.1f s, then %.2f N\n", (double)oldest_us * 1e-3,
           1 + (double)stale_ticks * 1e-3, peak);
    /* the jitter and the distance of two models */
    CHECK_LE(oldest_us, 70000);
    CHECK(oldest_us > 50000);
    CHECK(stale_ticks > 5000 && stale_ticks < 14000);
    CHECK(peak > 0.5);
    rig_close(&r);
}

/* every 30 ms a model of a rising surface; from the second half on all are 10 ms late */
static void surface_of_a_late_model_moves_on_from_when_it_was_made(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 5);
    r.serving = false;
    r.model.patch[0].v_m_s[2] = 0.002f;
    for (int i = 0; i < 600; i++) {
        if (i % 30 == 0) rig_model(&r, r.now_ns - (i < 300 ? 0 : 10000000));
        rig_tick(&r);
        if (i % 300 == 299) CHECK_NEAR(r.view.proxy_m[0][2], 0.002 * (i < 300 ? 0.029 : 0.039), 0.002 * 0.003);
    }
    rig_close(&r);
}

static void emergency_stop_takes_force_away_within_two_ticks_and_stays(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    CHECK(rig_force(&r) > 0.1);
    pal_servo_estop(r.servo);
    rig_tick(&r);
    CHECK_NEAR(rig_force(&r), 0, 0);
    rig_tick(&r);
    rig_tick(&r);
    double given[3];
    pal_virtual_truth(r.device, NULL, NULL, given);
    CHECK_LE(fabs(given[2]), 0.2);
    rig_run(&r, 3);
    CHECK_NEAR(rig_force(&r), 0, 0);
    CHECK_INT(r.view.state, PAL_SERVO_ESTOP);
    CHECK(r.view.flags & PAL_WIRE_POSE_ESTOP);
    CHECK(rig_event(&r, PAL_EVENT_ESTOP));
    /* the server's flag does the same */
    pal_servo_rearm(r.servo);
    rig_run(&r, 3);
    CHECK(rig_force(&r) > 0.1);
    r.model.flags = PAL_WIRE_HAPTIC_FORCE_OFF;
    rig_run(&r, 0.02);
    CHECK_NEAR(rig_force(&r), 0, 0);
    rig_close(&r);
}

static void both_buttons_held_for_half_a_second_are_an_emergency_stop(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    CHECK(rig_force(&r) > 0.1);
    const double upright[4] = {1, 0, 0, 0};
    for (int turn = 0; turn < 2; turn++) {
        pal_virtual_set_handle(r.device, PAL_DEVICE_BUTTON_DEADMAN | PAL_DEVICE_BUTTON_GRASP | PAL_DEVICE_BUTTON_CLUTCH,
                               upright);
        rig_run(&r, turn ? 0.51 : 0.45);
        CHECK((r.view.state == PAL_SERVO_ESTOP) == (turn == 1));
        pal_virtual_set_handle(r.device, PAL_DEVICE_BUTTON_DEADMAN, upright);
        rig_run(&r, 1);
    }
    CHECK_INT(r.view.state, PAL_SERVO_ESTOP);
    CHECK_NEAR(rig_force(&r), 0, 0);
    rig_close(&r);
}

static void force_keeps_its_cap_and_rises_no_faster_than_the_cap_in_10_ms(void)
{
    trial r;
    REQUIRE(rig_open(&r, "omega3,hand=firm,script=press-hold,depth=40,clock=virtual", 2000));
    double at = 0, worst = 0, max = 0;
    for (int i = 0; i < 6000; i++) {
        rig_tick(&r);
        worst = fmax(worst, rig_force(&r) - at);
        at = rig_force(&r);
        max = fmax(max, at);
    }
    CHECK_LE(max, 3 + 1e-9);
    CHECK_NEAR(max, 3, 1e-6);
    CHECK_LE(worst, 0.3 + 1e-9);
    CHECK(r.view.n_saturated > 0);
    rig_close(&r);
}

static void continuous_rating_scales_a_long_push_down(void)
{
    trial r;
    REQUIRE(rig_open(&r, "touch,hand=firm,script=press-hold,depth=20,clock=virtual", 390));
    rig_run(&r, 12);
    CHECK(r.view.force_max_N > 1.2);
    CHECK_LE(r.view.force_rms_N, 1.1 * 0.88);
    rig_close(&r);
}

static void stiffness_above_the_device_is_rendered_at_its_clamp(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 3000));
    rig_run(&r, 4);
    CHECK_NEAR(r.view.rendered_stiffness_N_m, 800, 8);
    CHECK(r.view.flags & PAL_WIRE_POSE_STIFF_CLAMPED);
    pal_servo_set_degraded(r.servo, 1);
    rig_run(&r, 2);
    CHECK_NEAR(r.view.rendered_stiffness_N_m, 300, 3);
    pal_servo_set_degraded(r.servo, 2);
    rig_run(&r, 1);
    CHECK_NEAR(r.view.fade, 0, 0);
    CHECK_LE(rig_force(&r), 1e-9);
    CHECK(rig_event(&r, PAL_EVENT_RT_DEGRADED));
    rig_close(&r);
}

static void old_models_are_dropped_and_a_new_session_starts_afresh(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    const uint32_t seq = r.view.model_seq;
    pal_wire_haptic old = r.model;
    old.seq = seq - 3;
    r.serving = false;
    pal_servo_put_model(r.servo, &old, r.generation, r.now_ns);
    rig_tick(&r);
    CHECK_INT(r.view.model_seq, seq);
    CHECK_INT(r.view.n_model_old, 1);
    pal_servo_put_generation(r.servo, ++r.generation);
    rig_tick(&r);
    CHECK_INT(r.view.model_seq, 0);
    CHECK_LE(rig_force(&r), 0.05);
    /* a server that starts again counts from 1, and is believed */
    r.seq = 0;
    r.serving = true;
    r.next_model_ns = r.now_ns;
    rig_run(&r, 0.002);
    CHECK_INT(r.view.model_seq, 1);
    CHECK_LE(r.view.fade, 0.02);
    rig_run(&r, 1);
    CHECK(rig_force(&r) > 0.1);
    rig_close(&r);
}

static void numbers_that_are_not_finite_in_a_model_give_a_fault_not_a_force(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    r.model.patch[0].k1_N_m = NAN;
    for (int i = 0; i < 100; i++) {
        rig_tick(&r);
        CHECK(isfinite(rig_force(&r)));
    }
    CHECK_NEAR(rig_force(&r), 0, 0);
    CHECK(r.view.n_not_finite > 0);
    CHECK(rig_event(&r, PAL_EVENT_FAULT));
    rig_close(&r);
}

static void device_that_stops_answering_is_a_fault_that_stays(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual,fail=4000", 300));
    rig_run(&r, 3.999);
    CHECK(rig_force(&r) > 0.1);
    rig_run(&r, 0.003);
    CHECK_NEAR(rig_force(&r), 0, 0);
    rig_run(&r, 1);
    CHECK_INT(r.view.state, PAL_SERVO_FAULT);
    CHECK(rig_event(&r, PAL_EVENT_DEVICE_LOST));
    rig_close(&r);
}

static void handle_driven_faster_than_two_metres_a_second_loses_force(void)
{
    trial r;
    REQUIRE(rig_open(&r, "omega3,hand=off,clock=virtual", 300));
    const double none[3] = {0, 0, 0}, throw_N[3] = {0, 0, -20};
    pal_virtual_push(r.device, none);
    rig_run(&r, 2);
    pal_virtual_push(r.device, throw_N);
    double max_after = 0;
    bool fault = false;
    for (int i = 0; i < 100; i++) {
        rig_tick(&r);
        if (r.view.n_fault > 0) fault = true;
        if (fault) max_after = fmax(max_after, rig_force(&r));
    }
    CHECK(fault);
    CHECK_NEAR(max_after, 0, 0);
    rig_close(&r);
}

/* device z is the world's up, whichever that is; the frame is a rotation and x and y are level */
static void up_of_the_device_is_the_given_direction(void)
{
    const double ups[4][3] = {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}, {0.6, 0, -0.8}};
    for (int i = 0; i < 4; i++) {
        double r[9], q[4], turned[3];
        const double z[3] = {0, 0, 1}, x[3] = {1, 0, 0};
        pal_workspace_rotation(ups[i], r);
        pal_workspace_quat(r, q);
        for (int k = 0; k < 3; k++) CHECK_NEAR(r[3 * k + 2], ups[i][k], 1e-12);
        pal_quat_rotate(turned, q, z);
        CHECK_LE(pal_dist3(turned, ups[i]), 1e-12);
        pal_quat_rotate(turned, q, x);
        CHECK_NEAR(pal_dot3(turned, ups[i]), 0, 1e-12);
        for (int k = 0; k < 3; k++) CHECK_NEAR(turned[k], r[3 * k], 1e-12);
    }
}

/* up of the world is y: the press goes along -y, and a handle turned about the device's z turns about the world's y */
static void pose_and_force_are_those_of_the_world(void)
{
    pal_servo_options o = {0};
    const double up[3] = {0, 1, 0}, half = sqrt(0.5), quarter[4] = {half, 0, 0, half};
    pal_workspace_rotation(up, o.rotation);
    trial r;
    REQUIRE(rig_open_as(&r, "inverse3,script=press-hold,clock=virtual", 300, &o));
    r.model.patch[0].n[2] = 0, r.model.patch[0].n[1] = 1;
    pal_virtual_set_handle(r.device, PAL_DEVICE_BUTTON_DEADMAN, quarter);
    rig_run(&r, 4);
    CHECK(r.view.position_m[1] < -0.001);
    CHECK(r.view.force_N[1] > 0.3);
    CHECK_NEAR(fabs(r.view.force_N[0]) + fabs(r.view.force_N[2]), 0, 1e-9);
    /* handle's x is the device's y; the device's z stays the world's y */
    double q[4], turned[3], wanted[3];
    const double x[3] = {1, 0, 0}, z[3] = {0, 0, 1};
    memcpy(q, r.view.quat, sizeof q);
    pal_quat_rotate(turned, q, x);
    for (int k = 0; k < 3; k++) wanted[k] = o.rotation[3 * k + 1];
    CHECK_LE(pal_dist3(turned, wanted), 1e-9);
    pal_quat_rotate(turned, q, z);
    CHECK_LE(pal_dist3(turned, up), 1e-9);
    /* a turn of 0.2 rad/s about the device's z is one about the world's y */
    for (int i = 0; i < 100; i++) {
        const double at = 3.14159265358979 / 4 + 0.5 * 0.2e-3 * i, spin[4] = {cos(at), 0, 0, sin(at)};
        pal_virtual_set_handle(r.device, PAL_DEVICE_BUTTON_DEADMAN, spin);
        rig_tick(&r);
    }
    CHECK_NEAR(r.view.omega_rad_s[1], 0.2, 0.002);
    CHECK_NEAR(r.view.omega_rad_s[0], 0, 1e-9);
    rig_close(&r);
}

/* the frame of the workspace changes only without force, its scale only while the clutch is held */
static void workspace_moves_without_force_and_scales_while_clutched(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    pal_workspace_frame frame = {.origin_m = {0, 0, 0.05}, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .scale = 1};
    double before[3];
    pal_copy3(before, r.view.position_m);
    pal_servo_put_frame(r.servo, &frame);
    rig_run(&r, 0.1);
    CHECK_LE(pal_dist3(before, r.view.position_m), 1e-3);
    r.model.n_patch = 0;
    rig_run(&r, 0.5);
    CHECK_NEAR(r.view.position_m[2], before[2] + 0.05, 0.012);
    frame.scale = 2;
    pal_servo_put_frame(r.servo, &frame);
    rig_run(&r, 0.1);
    pal_copy3(before, r.view.position_m);
    rig_run(&r, 0.1);
    CHECK_LE(pal_dist3(before, r.view.position_m), 2e-3);
    rig_buttons(&r, PAL_DEVICE_BUTTON_CLUTCH);
    rig_run(&r, 0.2);
    pal_copy3(before, r.view.position_m);
    double x[3], x0[3];
    pal_virtual_truth(r.device, x0, NULL, NULL);
    const double up[3] = {0, 0, x0[2] + 0.004};
    rig_buttons(&r, 0);
    rig_run(&r, 0.1);
    pal_virtual_place(r.device, up);
    rig_tick(&r);
    rig_tick(&r);
    pal_virtual_truth(r.device, x, NULL, NULL);
    /* the world moves twice as far as the device */
    CHECK_NEAR(r.view.position_m[2] - before[2], 2 * (x[2] - x0[2]), 1e-3);
    rig_close(&r);
}

static void clutch_engages_below_its_force_and_holds_the_world_pose(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    CHECK(rig_force(&r) > 0.3);
    rig_buttons(&r, PAL_DEVICE_BUTTON_CLUTCH);
    rig_run(&r, 0.1);
    CHECK_INT(r.view.flags & PAL_WIRE_POSE_CLUTCHED, 0);
    CHECK(rig_force(&r) > 0.3);
    /* softer tissue: 0.2 N */
    rig_buttons(&r, 0);
    r.model.patch[0].k1_N_m = 30;
    rig_run(&r, 1);
    const double before = rig_force(&r);
    CHECK(before > 0.05 && before < 0.3);
    const double turned[4] = {0.8, 0, 0.6, 0};
    double held[3], quat[4];
    rig_buttons(&r, PAL_DEVICE_BUTTON_CLUTCH);
    rig_tick(&r);
    pal_copy3(held, r.view.position_m);
    memcpy(quat, r.view.quat, sizeof quat);
    CHECK(r.view.flags & PAL_WIRE_POSE_CLUTCHED);
    rig_run(&r, 0.051);
    CHECK_NEAR(rig_force(&r), 0, 1e-9);
    /* handle moved and turned: the world pose stands still */
    pal_virtual_set_handle(r.device, PAL_DEVICE_BUTTON_DEADMAN | PAL_DEVICE_BUTTON_CLUTCH, turned);
    const double away[3] = {0.02, -0.01, 0.015};
    rig_carry(&r, away);
    rig_run(&r, 0.2);
    CHECK_LE(pal_dist3(held, r.view.position_m), 1e-12);
    for (int k = 0; k < 4; k++) CHECK_NEAR(r.view.quat[k], quat[k], 1e-12);
    pal_virtual_set_handle(r.device, PAL_DEVICE_BUTTON_DEADMAN, turned);
    rig_tick(&r);
    CHECK_LE(pal_dist3(held, r.view.position_m), 2e-3);
    for (int k = 0; k < 4; k++) CHECK_NEAR(r.view.quat[k], quat[k], 1e-12);
    /* it fades in again over a quarter of a second */
    rig_run(&r, 0.1);
    CHECK(r.view.fade > 0.35 && r.view.fade < 0.45);
    rig_close(&r);
}

static void edge_of_the_workspace_is_a_soft_wall(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=still,clock=virtual", 300));
    r.model.n_patch = 0;
    rig_run(&r, 2.8);
    CHECK_NEAR(rig_force(&r), 0, 0);
    CHECK(!rig_event(&r, PAL_EVENT_WORKSPACE_EDGE));
    const double out[3] = {0, 0.1485, 0};
    rig_carry(&r, out);
    pal_virtual_place(r.device, out);
    rig_tick(&r);
    rig_tick(&r);
    double x[3];
    pal_virtual_truth(r.device, x, NULL, NULL);
    CHECK_NEAR(r.view.force_N[1], -200 * (0.1485 - 0.95 * 0.15), 0.1);
    CHECK(rig_event(&r, PAL_EVENT_WORKSPACE_EDGE));
    rig_close(&r);
}

/* devices that turn the hand get -r n x F of friction; others none */
static void torque_goes_to_devices_that_have_it(void)
{
    for (int dof = 3; dof <= 6; dof += 3) {
        trial r;
        pal_servo_options o = level;
        o.info.dof_out = dof;
        REQUIRE(rig_open_as(&r, "inverse3,script=stroke,depth=8,clock=virtual", 300, &o));
        r.model.patch[0].kt_N_m = 200, r.model.patch[0].mu_s = r.model.patch[0].mu_d = 0.3f;
        r.model.patch[0].radius_m = 1; /* of the patch; the arm is checked by its ratio */
        rig_run(&r, 4);
        double max = 0;
        for (int i = 0; i < 2000; i++) {
            rig_tick(&r);
            max = fmax(max, fabs(r.view.torque_N_m[0]));
            if (dof == 3) continue;
            /* (0 0 -1) x (fx fy fz) = (fy, -fx, 0) */
            CHECK_NEAR(r.view.torque_N_m[0], r.view.force_N[1], 0.02);
            CHECK_NEAR(r.view.torque_N_m[1], -r.view.force_N[0], 0.02);
        }
        if (dof == 6)
            CHECK(max > 0.1);
        else
            CHECK_NEAR(max, 0, 0);
        rig_close(&r);
    }
}

/* nothing arrives any more, or only repeats of an old number: without force after the stale time and its fade */
static void silence_and_repeats_of_an_old_model_end_the_force(void)
{
    for (int repeats = 0; repeats < 2; repeats++) {
        trial r;
        REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
        rig_run(&r, 4);
        CHECK(rig_force(&r) > 0.1);
        r.serving = false;
        for (int i = 0; i < 620; i++) {
            if (repeats && i % 16 == 0) pal_servo_put_model(r.servo, &r.model, r.generation, r.now_ns);
            rig_tick(&r);
        }
        CHECK_NEAR(r.view.fade, 0, 0);
        rig_run(&r, 0.3);
        CHECK_LE(rig_force(&r), 0.02); /* damping of the free handle */
        CHECK_INT(repeats ? r.view.n_model_old > 30 : r.view.n_model_old == 0, 1);
        rig_close(&r);
    }
}

/* a server that comes back as another session finds an empty tank: pressed deep, nothing kicks */
static void new_session_begins_with_an_empty_tank(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    CHECK(r.view.tank_mJ > 0.5);
    const double generated = r.view.generated_mJ;
    pal_servo_put_generation(r.servo, ++r.generation);
    r.serving = false;
    rig_run(&r, 0.002);
    CHECK_LE(r.view.tank_mJ, 0);
    CHECK_NEAR(r.view.fade, 0, 0);
    r.seq = 0;
    r.serving = true;
    r.next_model_ns = r.now_ns;
    double before = 0, step = 0;
    for (int i = 0; i < 3000; i++) {
        rig_tick(&r);
        step = fmax(step, rig_force(&r) - before);
        before = rig_force(&r);
    }
    CHECK_LE(step, 0.1);
    CHECK_LE(r.view.generated_mJ, fmax(generated, 0) + fmax(0, -r.view.tank_mJ) + 1e-9);
    rig_close(&r);
}

static void proxy_is_published_on_the_surface(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    CHECK_INT(r.view.n_proxy, 1);
    CHECK_NEAR(r.view.proxy_m[0][2], 0, 1e-6);
    CHECK(r.view.position_m[2] < -0.001);
    rig_close(&r);
}

static void jitter_histogram_finds_percentiles_within_a_step(void)
{
    static pal_jitter j;
    for (int i = 1; i <= 100000; i++) pal_jitter_add(&j, (uint64_t)i * 100);
    CHECK_NEAR(pal_jitter_at_us(&j, 0.5), 5000, 0.032 * 5000);
    CHECK_NEAR(pal_jitter_at_us(&j, 0.99), 9900, 0.032 * 9900);
    CHECK_NEAR(pal_jitter_at_us(&j, 1), 10000, 1e-9);
    for (int i = 0; i < 1000; i++) {
        static pal_jitter one;
        memset(&one, 0, sizeof one);
        const uint64_t ns = (uint64_t)1 << (i % 40) | (uint64_t)i * 7;
        pal_jitter_add(&one, ns);
        CHECK_NEAR(pal_jitter_at_us(&one, 0.5), (double)ns * 1e-3, 1e-9);
    }
}

int main(void)
{
    RUN(press_and_hold_on_a_plane_is_stable_and_feels_its_stiffness);
    RUN(stale_model_fades_out_in_100_and_500_ms_and_comes_back_slowly);
    RUN(model_that_comes_during_the_tick_is_fresh);
    RUN(models_of_a_stall_that_arrive_in_a_burst_are_stale);
    RUN(jitter_makes_nothing_stale_and_a_longer_way_becomes_the_usual_one);
    RUN(surface_of_a_late_model_moves_on_from_when_it_was_made);
    RUN(emergency_stop_takes_force_away_within_two_ticks_and_stays);
    RUN(both_buttons_held_for_half_a_second_are_an_emergency_stop);
    RUN(force_keeps_its_cap_and_rises_no_faster_than_the_cap_in_10_ms);
    RUN(continuous_rating_scales_a_long_push_down);
    RUN(stiffness_above_the_device_is_rendered_at_its_clamp);
    RUN(old_models_are_dropped_and_a_new_session_starts_afresh);
    RUN(numbers_that_are_not_finite_in_a_model_give_a_fault_not_a_force);
    RUN(device_that_stops_answering_is_a_fault_that_stays);
    RUN(handle_driven_faster_than_two_metres_a_second_loses_force);
    RUN(up_of_the_device_is_the_given_direction);
    RUN(pose_and_force_are_those_of_the_world);
    RUN(workspace_moves_without_force_and_scales_while_clutched);
    RUN(clutch_engages_below_its_force_and_holds_the_world_pose);
    RUN(edge_of_the_workspace_is_a_soft_wall);
    RUN(torque_goes_to_devices_that_have_it);
    RUN(silence_and_repeats_of_an_old_model_end_the_force);
    RUN(new_session_begins_with_an_empty_tank);
    RUN(proxy_is_published_on_the_surface);
    RUN(jitter_histogram_finds_percentiles_within_a_step);
    return check_report();
}
