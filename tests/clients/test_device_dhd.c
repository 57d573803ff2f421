/* The DHD library through a fake libdhd.so, which does nothing by itself: axes, units, and what faults do. */
#include "clients/haptic_bridge/device_dhd.h"
#include "tests/clients/device_rig.h"

static device_rig rig;

static bool fake_found(void)
{
    char reason[PAL_DEVICE_TEXT];
    if (!rig.fake && pal_device_dhd()->probe(reason, sizeof reason) > 0) rig.fake = rig_fake("libdhd.so");
    return rig.fake != NULL;
}
static bool pressing(const char *faults)
{
    if (!fake_found()) return false;
    rig.fake->begin("omega3,hand=average,depth=8", faults);
    return !rig_open(&rig, pal_device_dhd(), "") && rig_run(&rig) && rig_press(&rig);
}
static double written_z(void)
{
    double force_N[3];
    rig.fake->written(force_N);
    return force_N[2];
}

static void pose_force_buttons_and_limits_are_the_librarys(void)
{
    REQUIRE(fake_found());
    rig.fake->begin("omega3,script=still,hand=off", "buttons=1");
    REQUIRE(rig_open(&rig, pal_device_dhd(), "0") == 0);
    CHECK_TEXT(rig.o.info.name, "Fake omega.7");
    CHECK_NEAR(rig.o.info.peak_N, 12, 0);
    CHECK_NEAR(rig.o.info.stiffness_max_N_m, 5000, 0);
    CHECK_INT(rig.o.info.dof_in, 6);
    CHECK_INT(rig.o.info.dof_out, 3);
    const pal_haptic_v1 *dhd = pal_device_dhd();
    const double at[3] = {0.01, -0.02, 0.03}, none[3] = {0, 0, 0}, force_N[3] = {0.1, 0.2, -0.25};
    pal_dev_state state;
    rig.fake->push(none);
    rig.fake->place(at);
    dhd->force_enable(rig.o.device, 1);
    for (int n = 0; n < 300; n++) {
        CHECK(dhd->read(rig.o.device, &state) == 0);
        CHECK(dhd->write(rig.o.device, force_N, none, 0) >= 0);
        manual_clock_advance(&rig.clock, RIG_MS_NS);
    }
    /* less than the friction of 0.3 N along each axis: the handle stays */
    double motor[3];
    rig.fake->truth(NULL, motor);
    for (int k = 0; k < 3; k++) {
        CHECK_NEAR(state.position_m[k], at[k], 0.02e-3);
        CHECK_NEAR(motor[k], force_N[k], 1e-9);
        CHECK_NEAR(state.force_N[k], force_N[k], 1e-12);
    }
    CHECK_INT(state.buttons, PAL_DEVICE_BUTTON_GRASP | PAL_DEVICE_BUTTON_DEADMAN);
    CHECK_NEAR(state.grip, 0.25, 0);
    const double q[4] = {sqrt(0.5), 0, 0, sqrt(0.5)};
    for (int k = 0; k < 4; k++) CHECK_NEAR(state.quat[k], q[k], 1e-12);
    dhd->close(rig.o.device);
}

/* the library's array of states has grown from 16 to 17 ints, and may grow to 32 */
static void longer_status_of_another_version_does_no_harm(void)
{
    const char *const size[] = {"status=16", "status=17", "status=32"};
    for (int i = 0; i < 3; i++) {
        REQUIRE(pressing(size[i]));
        CHECK(rig_motor_force(&rig) > 0.5);
        rig_close(&rig, NULL);
    }
}

static void tissue_feels_as_stiff_as_its_model(void)
{
    REQUIRE(pressing(""));
    rig_ticks(&rig, 1000);
    double at[3], motor[3];
    rig.fake->truth(at, motor);
    CHECK(at[2] < -0.0025);
    CHECK_NEAR(motor[2], -RIG_STIFFNESS * at[2], 0.02e-3 * RIG_STIFFNESS);
    CHECK_INT(rig.n_lost, 0);
    rig_close(&rig, NULL);
}

static void refused_device_is_one_sentence_with_name_and_code(void)
{
    REQUIRE(fake_found());
    rig.fake->begin("omega3", "init=12");
    int error = rig_open(&rig, pal_device_dhd(), "");
    CHECK_TEXT(pal_device_dhd()->strerror(rig.o.device, error),
               "device 0 of the DHD library: error 12, device not ready: let it initialise: switch it on and wait for "
               "its light");
    pal_device_dhd()->close(rig.o.device);
    rig.fake->begin("omega3", "unplugged=1");
    error = rig_open(&rig, pal_device_dhd(), "");
    CHECK_TEXT(pal_device_dhd()->strerror(rig.o.device, error), "device 0 of the DHD library: there is no such device");
    pal_device_dhd()->close(rig.o.device);
}

static void device_unplugged_while_it_presses_has_no_force_and_comes_back(void)
{
    /* in and out once a second: the force comes back as the hand works */
    REQUIRE(fake_found());
    rig.fake->begin("omega3,hand=average,depth=8,script=cycle", "");
    REQUIRE(!rig_open(&rig, pal_device_dhd(), "") && rig_run(&rig) && rig_press(&rig));
    CHECK(rig_until_force(&rig, 0.5));
    rig.fake->set(FAKE_UNPLUGGED, 1);
    rig_ticks(&rig, 2);
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, "device 0 of the DHD library: error 2, communication error: is it plugged in and on?");
    CHECK_INT(rig.view.state, PAL_SERVO_FAULT);
    CHECK_NEAR(rig.view.force_N[2], 0, 0);
    rig_wait(&rig, 5000, 2);
    rig.fake->set(FAKE_UNPLUGGED, 0);
    rig.fake->set(FAKE_BUTTONS, 0);
    rig_wait(&rig, 1500, 2);
    CHECK_INT(rig.n_lost, 1);
    CHECK_INT(rig.n_back, 1);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    CHECK_NEAR(written_z(), 0, 0);
    REQUIRE(rig_press(&rig));
    CHECK(rig_until_force(&rig, 0.5));
    rig_close(&rig, NULL);
}

static void error_of_the_library_ends_with_its_code(void)
{
    REQUIRE(pressing("error=7"));
    rig.fake->set_in(FAKE_ERROR_AT, 10);
    rig_ticks(&rig, 9);
    CHECK_INT(rig.n_lost, 0);
    rig_ticks(&rig, 4);
    CHECK_INT(rig.n_lost, 1);
    CHECK(strstr(rig.lost, "error 7, fake error: its answer is late") != NULL);
    CHECK_NEAR(rig.view.force_N[2], 0, 0);
    rig_close(&rig, NULL);
}

static void forces_switched_off_at_the_device_fade_in_when_they_are_on_again(void)
{
    REQUIRE(pressing(""));
    rig.fake->set(FAKE_FORCE_OFF, 1);
    rig_ticks(&rig, 100);
    CHECK_NEAR(rig_motor_force(&rig), 0, 1e-9);
    rig.fake->set(FAKE_FORCE_OFF, 0);
    double max = 0, last = written_z();
    for (int i = 0; i < 300; i++) {
        rig_tick(&rig);
        max = fmax(max, fabs(written_z() - last));
        last = written_z();
    }
    CHECK(last > 0.5);
    CHECK_LE(max, 0.05); /* all of the force at once is more than ten times that */
    rig_close(&rig, NULL);
}

static void stalled_library_is_stopped_by_the_watchdog_and_arms_again(void)
{
    REQUIRE(pressing(""));
    rig.fake->set_in(FAKE_STALL_AT, 1);
    rig_tick(&rig);
    manual_clock_advance(&rig.clock, RIG_MS_NS); /* in which the servo waits for the library */
    rig_wait(&rig, 50, 1);
    rig.fake->set(FAKE_STALL_AT, 0);
    rig_ticks(&rig, 3);
    CHECK_INT(rig.n_fault, 1);
    CHECK_INT(rig.n_lost, 0);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    CHECK_NEAR(written_z(), 0, 0);
    pal_servo_timing timing;
    rig_close(&rig, &timing);
    CHECK_INT(timing.n_watchdog, 1);
}

static void broken_and_frozen_positions_take_the_force(void)
{
    REQUIRE(pressing(""));
    rig.fake->set_in(FAKE_NAN_AT, 1);
    rig_ticks(&rig, 3);
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, "device 0 of the DHD library: its pose is not a number");
    CHECK_NEAR(written_z(), 0, 0);
    rig_close(&rig, NULL);
    REQUIRE(pressing(""));
    rig.fake->set_in(FAKE_FROZEN_AT, 1);
    for (int n = 0; n < 3010 && !rig.n_lost; n++) rig_tick(&rig);
    CHECK_INT(rig.n_lost, 1);
    CHECK(strstr(rig.lost, "stands still under force") != NULL);
    CHECK_NEAR(written_z(), 0, 0);
    rig_close(&rig, NULL);
}

int main(void)
{
    RUN(pose_force_buttons_and_limits_are_the_librarys);
    RUN(longer_status_of_another_version_does_no_harm);
    RUN(tissue_feels_as_stiff_as_its_model);
    RUN(refused_device_is_one_sentence_with_name_and_code);
    RUN(device_unplugged_while_it_presses_has_no_force_and_comes_back);
    RUN(error_of_the_library_ends_with_its_code);
    RUN(forces_switched_off_at_the_device_fade_in_when_they_are_on_again);
    RUN(stalled_library_is_stopped_by_the_watchdog_and_arms_again);
    RUN(broken_and_frozen_positions_take_the_force);
    return check_report();
}
