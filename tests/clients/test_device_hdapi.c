/* HDAPI through a fake libHD.so with a scheduler thread of its own: axes, units, signs, and what faults do. */
#include "clients/haptic_bridge/device_hdapi.h"
#include "tests/clients/device_rig.h"

#include <pthread.h>

static device_rig rig;

static bool fake_found(void)
{
    char reason[PAL_DEVICE_TEXT];
    if (!rig.fake && pal_device_hdapi()->probe(reason, sizeof reason) > 0) rig.fake = rig_fake("libHD.so");
    return rig.fake != NULL;
}
/* presses tissue with the average hand */
static bool pressing(void)
{
    if (!fake_found()) return false;
    rig.fake->begin("touch,hand=average,depth=8", "");
    return !rig_open(&rig, pal_device_hdapi(), "") && rig_run(&rig) && rig_press(&rig);
}

/* a servo of our own: keeps what it reads, writes one force */
static pal_dev_state seen;
static int n_call;
static int keep_and_push(void *user)
{
    (void)user;
    const double force_N[3] = {0.1, 0.2, 0.3}, none[3] = {0, 0, 0};
    CHECK(pal_device_hdapi()->read(rig.o.device, &seen) == 0);
    pal_device_hdapi()->write(rig.o.device, force_N, none, 0);
    return ++n_call == 5;
}
static void *run(void *user)
{
    return pal_device_hdapi()->run(user, keep_and_push, NULL) ? user : NULL;
}

static void pose_force_buttons_and_limits_have_our_axes_and_units(void)
{
    REQUIRE(fake_found());
    rig.fake->begin("touch,script=still,hand=off", "buttons=2");
    REQUIRE(rig_open(&rig, pal_device_hdapi(), "") == 0);
    const pal_dev_info *info = &rig.o.info;
    CHECK_TEXT(info->name, "Fake Touch");
    CHECK_NEAR(info->peak_N, 3.3, 0);
    CHECK_NEAR(info->continuous_N, 0.88, 0);
    CHECK_NEAR(info->stiffness_max_N_m, 500, 1e-9); /* 0.5 N/mm */
    CHECK_INT(info->thread_model, PAL_DEVICE_CALLBACK);
    /* theirs: 320 mm to the right, 200 up, 80 to the user */
    CHECK_NEAR(info->high_m[0], 0.04, 1e-12);
    CHECK_NEAR(info->high_m[1], 0.16, 1e-12);
    CHECK_NEAR(info->high_m[2], 0.1, 1e-12);
    CHECK_NEAR(info->low_m[2], -0.1, 1e-12);
    const double at[3] = {0.01, -0.02, 0.03}, none[3] = {0, 0, 0};
    rig.fake->push(none);
    rig.fake->place(at);
    pal_device_hdapi()->force_enable(rig.o.device, 1);
    pthread_t thread;
    void *failed = NULL;
    REQUIRE(pthread_create(&thread, NULL, run, rig.o.device) == 0);
    rig.fake->frames(5);
    pthread_join(thread, &failed);
    CHECK(failed == NULL);
    CHECK_INT(n_call, 5);
    /* the handle has moved by less than one step of the encoders since: friction holds it */
    for (int k = 0; k < 3; k++) CHECK_NEAR(seen.position_m[k], at[k], 0.1e-3);
    CHECK_INT(seen.buttons, PAL_DEVICE_BUTTON_CLUTCH | PAL_DEVICE_BUTTON_DEADMAN);
    CHECK_NEAR(seen.motor_temperature, 0.4, 0);
    double written[3], motor[3];
    rig.fake->written(written);
    rig.fake->truth(NULL, motor);
    CHECK_NEAR(written[0], 0.2, 1e-12); /* right */
    CHECK_NEAR(written[1], 0.3, 1e-12); /* up */
    CHECK_NEAR(written[2], 0.1, 1e-12); /* to the user */
    for (int k = 0; k < 3; k++) CHECK_NEAR(motor[k], 0.1 * (k + 1), 0.01);
    for (int k = 0; k < 3; k++) CHECK_NEAR(seen.force_N[k], 0.1 * (k + 1), 1e-12);
    /* the fake's handle: its z axis, which is our x, lies along x of the device, our y: 90 degrees about our z */
    const double q[4] = {sqrt(0.5), 0, 0, sqrt(0.5)};
    for (int k = 0; k < 4; k++) CHECK_NEAR(seen.quat[k], q[k], 1e-12);
    pal_device_hdapi()->close(rig.o.device);
}

static void tissue_feels_as_stiff_as_its_model(void)
{
    REQUIRE(pressing());
    rig_ticks(&rig, 1000);
    double at[3], motor[3];
    rig.fake->truth(at, motor);
    CHECK(at[2] < -0.0025);
    /* at rest: one step of the encoders is 0.055 mm */
    CHECK_NEAR(motor[2], -RIG_STIFFNESS * at[2], 0.055e-3 * RIG_STIFFNESS);
    CHECK_NEAR(motor[0], 0, 0.01);
    CHECK_NEAR(motor[1], 0, 0.01);
    CHECK_INT(rig.n_lost, 0);
    rig_close(&rig, NULL);
}

static void refused_device_is_one_sentence_with_library_name_and_code(void)
{
    REQUIRE(fake_found());
    rig.fake->begin("touch", "init=0x302");
    const int error = rig_open(&rig, pal_device_hdapi(), "");
    CHECK_INT(error, -0x302);
    CHECK_TEXT(pal_device_hdapi()->strerror(rig.o.device, error),
               "device \"default\" of libHD.so: error 0x302, no communication: is it plugged in and on, and may you "
               "write to its port?");
    pal_device_hdapi()->close(rig.o.device);
    rig.fake->begin("touch", "");
    CHECK_INT(rig_open(&rig, pal_device_hdapi(), "Right"), -0x104);
    pal_device_hdapi()->close(rig.o.device);
    CHECK_INT(rig_open(&rig, pal_device_hdapi(), "Left"), 0);
    pal_device_hdapi()->close(rig.o.device);
}

static void device_unplugged_while_it_presses_has_no_force_and_comes_back(void)
{
    /* in and out once a second: the force comes back as the hand works */
    REQUIRE(fake_found());
    rig.fake->begin("touch,hand=average,depth=8,script=cycle", "");
    REQUIRE(!rig_open(&rig, pal_device_hdapi(), "") && rig_run(&rig) && rig_press(&rig));
    CHECK(rig_until_force(&rig, 0.5));
    rig.fake->set(FAKE_UNPLUGGED, 1);
    rig_tick(&rig);
    rig_wait(&rig, 1, 2);
    CHECK_INT(rig.view.state, PAL_SERVO_FAULT);
    CHECK_NEAR(rig.view.force_N[2], 0, 0);
    CHECK_TEXT(rig.lost, "device \"default\" of libHD.so: error 0x302, no communication: is it plugged in and on, and "
                         "may you write to its port?");
    rig_wait(&rig, 5000, 2); /* two attempts that fail */
    CHECK_INT(rig.n_lost, 1);
    CHECK_INT(rig.n_back, 0);
    rig.fake->set(FAKE_UNPLUGGED, 0);
    rig_wait(&rig, 900, 2);
    manual_clock_advance(&rig.clock, 100 * RIG_MS_NS); /* the third attempt, at 6 s */
    rig.fake->set(FAKE_BUTTONS, 0);
    rig_ticks(&rig, 1000);
    CHECK_INT(rig.n_back, 1);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    CHECK_NEAR(rig_motor_force(&rig), 0, 1e-12);
    REQUIRE(rig_press(&rig));
    CHECK(rig_until_force(&rig, 0.5));
    CHECK_INT(rig.n_lost, 1);
    rig_close(&rig, NULL);
}

static void error_after_frames_ends_with_its_code(void)
{
    REQUIRE(pressing());
    rig.fake->set(FAKE_ERROR, 0x300);
    rig.fake->set_in(FAKE_ERROR_AT, 10);
    rig_ticks(&rig, 9);
    CHECK_INT(rig.n_lost, 0);
    rig_tick(&rig);
    rig_wait(&rig, 1, 2);
    CHECK_INT(rig.n_lost, 1);
    CHECK(strstr(rig.lost, "error 0x300, fault of the device") != NULL);
    rig_close(&rig, NULL);
}

static void warm_motors_fade_out_and_have_force_again_two_seconds_later(void)
{
    REQUIRE(pressing());
    rig_ticks(&rig, 300);
    const double before = rig_motor_force(&rig);
    rig.fake->set_in(FAKE_WARM_AT, 1);
    rig_ticks(&rig, 251); /* half of the fade of 0.5 s, in which the hand sinks in */
    double written[3];
    rig.fake->written(written);
    CHECK(written[1] > 0.2 * before && written[1] < 0.8 * before);
    rig_ticks(&rig, 260);
    rig.fake->written(written);
    CHECK_NEAR(written[1], 0, 1e-12);
    rig_ticks(&rig, 1485);
    rig.fake->written(written);
    CHECK_NEAR(written[1], 0, 1e-12);
    double step = 0, last = 0;
    for (int i = 0; i < 300; i++) {
        rig_tick(&rig);
        rig.fake->written(written);
        step = fmax(step, fabs(written[1] - last));
        last = written[1];
    }
    CHECK(last > 0.5 * before);
    CHECK_LE(step, 0.05); /* 3 N over 250 ticks, and the hand that is pushed out */
    CHECK_INT(rig.n_lost, 0);
    rig_close(&rig, NULL);
}

static void stalled_library_is_stopped_by_the_watchdog_and_arms_again(void)
{
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_STALL_AT, 1);
    rig_ticks(&rig, 2);
    rig_wait(&rig, 50, 1);
    rig.fake->set(FAKE_STALL_AT, 0);
    rig_ticks(&rig, 3);
    CHECK_INT(rig.n_fault, 1);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    CHECK_INT(rig.n_lost, 0);
    double written[3];
    rig.fake->written(written);
    CHECK_NEAR(written[1], 0, 0);
    pal_servo_timing timing;
    rig_close(&rig, &timing);
    CHECK_INT(timing.n_watchdog, 1);
    CHECK(timing.lateness.max_ns >= 50 * RIG_MS_NS);
    CHECK(timing.n_missed >= 49);
}

/* run gives the library 2 s of the wall's clock; then it is left alone, and taken back when it returns */
static void library_that_hangs_is_lost_until_it_returns(void)
{
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_STALL_AT, 1);
    rig_ticks(&rig, 2);
    rig_wait(&rig, 50, 1);
    rig_wait(&rig, 1, 2); /* when both sleep, run has returned */
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, "device \"default\" of libHD.so: it has stopped answering");
    rig_wait(&rig, 2500, 2);
    CHECK_INT(rig.n_lost, 1);
    CHECK_INT(rig.n_back, 0);
    rig.fake->set(FAKE_BUTTONS, 0);
    const long before = rig.fake->frame();
    rig.fake->set(FAKE_STALL_AT, 0);
    rig.fake->settle();
    CHECK_INT(rig.fake->frame() - before, 1); /* the frame that hung, without force */
    double written[3];
    rig.fake->written(written);
    CHECK_NEAR(written[1], 0, 0);
    rig_wait(&rig, 1400, 2);
    manual_clock_advance(&rig.clock, 200 * RIG_MS_NS);
    rig_ticks(&rig, 100);
    CHECK_INT(rig.n_back, 1);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    rig_close(&rig, NULL);
}

static void position_that_is_no_number_takes_the_force(void)
{
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_NAN_AT, 1);
    rig_ticks(&rig, 2); /* one bad reading keeps the force, the second does not */
    double written[3];
    rig_tick(&rig);
    rig_wait(&rig, 1, 2);
    rig.fake->written(written);
    CHECK_NEAR(written[1], 0, 0);
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, "device \"default\" of libHD.so: its pose is not a number");
    rig_close(&rig, NULL);
}

static void frozen_encoder_takes_the_force_after_three_seconds(void)
{
    REQUIRE(pressing());
    CHECK(rig_motor_force(&rig) > 0.5);
    rig.fake->set_in(FAKE_FROZEN_AT, 1);
    int n = 0;
    while (n < 3010 && !rig.n_lost) rig_tick(&rig), n++;
    CHECK(n > 2500); /* the hand was still already, but not for long */
    CHECK_INT(rig.n_lost, 1);
    double written[3];
    rig.fake->written(written);
    CHECK_NEAR(written[1], 0, 0);
    CHECK(strstr(rig.lost, "stands still under force") != NULL);
    rig_close(&rig, NULL);
}

static void hand_that_strokes_is_no_frozen_encoder(void)
{
    REQUIRE(fake_found());
    rig.fake->begin("touch,hand=average,depth=8,script=stroke", "");
    REQUIRE(!rig_open(&rig, pal_device_hdapi(), "") && rig_run(&rig) && rig_press(&rig));
    CHECK(rig_motor_force(&rig) > 0.5);
    for (int n = 0; n < 6000 && !rig.n_lost; n++) rig_tick(&rig);
    CHECK_INT(rig.n_lost, 0);
    rig_close(&rig, NULL);
}

int main(void)
{
    RUN(pose_force_buttons_and_limits_have_our_axes_and_units);
    RUN(tissue_feels_as_stiff_as_its_model);
    RUN(refused_device_is_one_sentence_with_library_name_and_code);
    RUN(device_unplugged_while_it_presses_has_no_force_and_comes_back);
    RUN(error_after_frames_ends_with_its_code);
    RUN(warm_motors_fade_out_and_have_force_again_two_seconds_later);
    RUN(stalled_library_is_stopped_by_the_watchdog_and_arms_again);
    RUN(library_that_hangs_is_lost_until_it_returns);
    RUN(position_that_is_no_number_takes_the_force);
    RUN(frozen_encoder_takes_the_force_after_three_seconds);
    RUN(hand_that_strokes_is_no_frozen_encoder);
    return check_report();
}
