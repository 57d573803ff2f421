/* The bridge's servo in virtual time against a simulated server: states, limits, felt stiffness, workspace. */
#include "clients/haptic_bridge/jitter.h"
#include "tests/fixtures/servo_trial.h"

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
    RUN(emergency_stop_takes_force_away_within_two_ticks_and_stays);
    RUN(both_buttons_held_for_half_a_second_are_an_emergency_stop);
    RUN(force_keeps_its_cap_and_rises_no_faster_than_the_cap_in_10_ms);
    RUN(continuous_rating_scales_a_long_push_down);
    RUN(stiffness_above_the_device_is_rendered_at_its_clamp);
    RUN(device_that_stops_answering_is_a_fault_that_stays);
    RUN(handle_driven_faster_than_two_metres_a_second_loses_force);
    RUN(up_of_the_device_is_the_given_direction);
    RUN(pose_and_force_are_those_of_the_world);
    RUN(workspace_moves_without_force_and_scales_while_clutched);
    RUN(clutch_engages_below_its_force_and_holds_the_world_pose);
    RUN(edge_of_the_workspace_is_a_soft_wall);
    RUN(torque_goes_to_devices_that_have_it);
    RUN(proxy_is_published_on_the_surface);
    RUN(jitter_histogram_finds_percentiles_within_a_step);
    return check_report();
}
