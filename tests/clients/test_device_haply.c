/* Haply's service through a fake one on a real websocket: axes, signs, exactly one message for each, and faults. */
#include "clients/haptic_bridge/device_haply.h"
#include "clients/haptic_bridge/device_haply_scan.h"
#include "tests/clients/device_rig.h"
#include "tests/fakes/fake_haply.h"

#include <pthread.h>

static device_rig rig;
static char id[64], address[80];

static bool service(const char *device, const char *faults)
{
    const int port = fake_haply_start();
    snprintf(id, sizeof id, "049D@127.0.0.1:%d", port);
    snprintf(address, sizeof address, "device 049D of Haply's service at ws://127.0.0.1:%d", port);
    rig.fake = fake_entry();
    rig.fake->begin(device, faults);
    return port > 0;
}
/* opened in the middle of the workspace, then pressing tissue that begins there */
static bool pressing(void)
{
    const double middle[3] = {0, 0, 0};
    if (!service("inverse3,script=still,hand=average", "")) return false;
    rig.fake->place(middle);
    if (rig_open(&rig, pal_device_haply(), id)) return false;
    rig.fake->begin("inverse3,hand=average,depth=8", "");
    return rig_run(&rig) && rig_press(&rig);
}
static void check_lost(const char *why)
{
    char sentence[PAL_DEVICE_TEXT];
    snprintf(sentence, sizeof sentence, "%s: %s", address, why);
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, sentence);
    CHECK_INT(rig.view.state, PAL_SERVO_FAULT);
    CHECK_NEAR(rig.view.force_N[2], 0, 0);
}

static pal_dev_state seen;
static int n_call;
static int keep_and_push(void *user)
{
    (void)user;
    const double force_N[3] = {0.05, 0.1, -0.15}, none[3] = {0, 0, 0};
    CHECK_INT(pal_device_haply()->read(rig.o.device, &seen), 0);
    pal_device_haply()->write(rig.o.device, force_N, none, 0);
    return ++n_call == 6;
}
static void *run(void *user)
{
    return pal_device_haply()->run(user, keep_and_push, NULL) ? user : NULL;
}

static void pose_force_and_buttons_have_our_axes(void)
{
    const double middle[3] = {0.005, 0.006, 0.007}, at[3] = {0.015, -0.014, 0.037}, none[3] = {0, 0, 0};
    REQUIRE(service("inverse3,script=still,hand=off", "buttons=2"));
    rig.fake->push(none);
    rig.fake->place(middle);
    REQUIRE(rig_open(&rig, pal_device_haply(), id) == 0);
    CHECK_TEXT(rig.o.info.name, "Inverse3 049D");
    CHECK_INT(rig.o.info.thread_model, PAL_DEVICE_REQUEST_REPLY);
    rig.fake->place(at);
    pal_device_haply()->force_enable(rig.o.device, 1);
    const long before = rig.fake->frame();
    pthread_t thread;
    void *failed = NULL;
    REQUIRE(pthread_create(&thread, NULL, run, rig.o.device) == 0);
    rig.fake->frames(6);
    double written[3], motor[3];
    rig.fake->written(written);
    rig.fake->truth(NULL, motor);
    pthread_join(thread, &failed);
    CHECK(failed == NULL);
    CHECK_INT(n_call, 6);
    CHECK_INT(rig.fake->frame() - before, 6); /* one state for each message of force, no more */
    /* from where it was opened; two steps of the encoder */
    CHECK_NEAR(seen.position_m[0], 0.01, 0.04e-3);
    CHECK_NEAR(seen.position_m[1], -0.02, 0.04e-3);
    CHECK_NEAR(seen.position_m[2], 0.03, 0.04e-3);
    CHECK_INT(seen.buttons, PAL_DEVICE_BUTTON_CLUTCH | PAL_DEVICE_BUTTON_DEADMAN);
    /* theirs: x is our right, y away from the user */
    CHECK_NEAR(written[0], 0.1, 1e-6);
    CHECK_NEAR(written[1], -0.05, 1e-6);
    CHECK_NEAR(written[2], -0.15, 1e-6);
    CHECK(seen.has_force);
    CHECK_NEAR(seen.force_N[0], 0.05, 1e-6);
    CHECK_NEAR(seen.force_N[1], 0.1, 1e-6);
    CHECK_NEAR(seen.force_N[2], -0.15, 1e-6);
    CHECK(motor[0] > 0.03 && motor[1] > 0.06 && motor[2] < -0.1); /* within 1 ms of the actuator */
    /* turned about their x, our y */
    CHECK_NEAR(seen.quat[0], 0.8, 0);
    CHECK_NEAR(seen.quat[1], 0, 0);
    CHECK_NEAR(seen.quat[2], 0.6, 0);
    CHECK_NEAR(seen.quat[3], 0, 0);
    rig.fake->set(FAKE_WALL, 1);
    pal_device_haply()->close(rig.o.device);
}

static void tissue_feels_as_stiff_as_its_model(void)
{
    REQUIRE(pressing());
    rig_ticks(&rig, 1000);
    double at[3], motor[3];
    rig.fake->truth(at, motor);
    CHECK(at[2] < -0.0025);
    CHECK_NEAR(motor[2], -RIG_STIFFNESS * at[2], 0.04e-3 * RIG_STIFFNESS);
    CHECK_INT(rig.n_lost, 0);
    pal_servo_timing timing;
    rig_close(&rig, &timing);
    CHECK_INT(timing.n_watchdog, 0);
    CHECK_INT(timing.n_missed, 0);
    double written[3];
    fake_haply_start(); /* it has seen the end */
    rig.fake->written(written);
    CHECK_NEAR(written[2], 0, 0); /* the last message has no force */
}

static void device_unplugged_while_it_presses_has_no_force_and_comes_back(void)
{
    REQUIRE(pressing());
    CHECK(rig_motor_force(&rig) > 0.5);
    rig.fake->set(FAKE_UNPLUGGED, 1); /* ends the connection at once */
    rig_wait(&rig, 1, 2);
    check_lost("the service has closed the connection");
    rig_wait(&rig, 5000, 2);
    CHECK_INT(rig.n_lost, 1);
    rig.fake->set(FAKE_UNPLUGGED, 0);
    rig.fake->set(FAKE_BUTTONS, 0);
    rig_wait(&rig, 900, 2);
    manual_clock_advance(&rig.clock, 100 * RIG_MS_NS); /* the third attempt, at 6 s */
    rig_ticks(&rig, 500);
    CHECK_INT(rig.n_back, 1);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    double written[3];
    rig.fake->written(written);
    CHECK_NEAR(written[2], 0, 0);
    rig_close(&rig, NULL);
}

static void lost_power_and_broken_positions_and_messages_take_the_force(void)
{
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_ERROR_AT, 1);
    rig_ticks(&rig, 1);
    rig_wait(&rig, 1, 2);
    check_lost("it has no power: plug its supply in");
    rig_close(&rig, NULL);
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_NAN_AT, 1);
    rig_ticks(&rig, 2);
    rig_wait(&rig, 1, 2);
    check_lost("its pose is not a number");
    rig_close(&rig, NULL);
    REQUIRE(pressing());
    fake_haply_send("{\"inverse3\":[{\"device_id\":");
    rig_tick(&rig);
    rig_wait(&rig, 1, 2);
    fake_haply_send(NULL);
    check_lost("the service sent what is no message of state: another version?");
    rig_close(&rig, NULL);
}

static void frozen_encoder_takes_the_force_after_three_seconds(void)
{
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_FROZEN_AT, 1);
    for (int n = 0; n < 3010 && !rig.n_lost; n++) rig_tick(&rig);
    rig_wait(&rig, 1, 2);
    check_lost("its pose stands still under force (an encoder is frozen, or the handle is held fast)");
    rig_close(&rig, NULL);
}

static void stalled_service_gets_no_force_and_arms_again(void)
{
    REQUIRE(pressing());
    rig.fake->set_in(FAKE_STALL_AT, 1);
    rig_tick(&rig);
    rig_wait(&rig, 50, 1);
    rig.fake->set(FAKE_STALL_AT, 0);
    rig_ticks(&rig, 3);
    CHECK_INT(rig.n_fault, 1);
    CHECK_INT(rig.n_lost, 0);
    CHECK_INT(rig.view.state, PAL_SERVO_ARMING);
    double written[3];
    rig.fake->written(written);
    CHECK_NEAR(written[2], 0, 0);
    pal_servo_timing timing;
    rig_close(&rig, &timing);
    CHECK_INT(timing.n_watchdog, 1);
}

static void check_refused(const char *device, const char *why)
{
    char sentence[PAL_DEVICE_TEXT];
    const int error = rig_open(&rig, pal_device_haply(), device);
    CHECK(error < 0);
    snprintf(sentence, sizeof sentence, "%s: %s", address, why);
    CHECK_TEXT(pal_device_haply()->strerror(rig.o.device, error), sentence);
    pal_device_haply()->close(rig.o.device);
}
static void devices_that_cannot_be_used_are_refused_in_one_sentence(void)
{
    REQUIRE(service("inverse3,script=still", "init=1"));
    check_refused(id, "it is not calibrated: follow the service's own page");
    REQUIRE(service("inverse3,script=still", "unplugged=2"));
    check_refused(id, "there is no such device");
    REQUIRE(service("inverse3,script=still", ""));
    snprintf(address, sizeof address, "device 049D of Haply's service at ws://127.0.0.1:9");
    check_refused("049D@127.0.0.1:9", "no answer: is the service installed and running?");
}

/* the longest field of a message is cut, and what it does not have keeps its value */
static void scanner_reads_numbers_flags_and_texts_of_the_chosen_device(void)
{
    static const char text[] =
        " {\"inverse3\" : [ {\"device_id\":\"049D\\\"with a name that is too long\", "
        "\"state\":{\"cursor_position\":{\"x\":"
        "-0.125,\"y\":25e-3,\"z\":1.5E+1}}}, "
        "{\"device_id\":\"B\",\"state\":{\"cursor_position\":{\"x\":0,\"y\":0,\"z\":7}}}],"
        "\"wireless_verse_grip\":[{\"state\":{\"buttons\":{\"button_0\":false,\"button_3\":true}}}], \"n\":null}\n";
    pal_haply_state s = {.button = {true}, .force_N = {3, 4, 5}};
    REQUIRE(pal_haply_scan(text, sizeof text - 1, 0, &s));
    CHECK_TEXT(s.device, "049D\\\"with a name that ");
    CHECK_NEAR(s.position_m[0], -0.125, 0);
    CHECK_NEAR(s.position_m[1], 0.025, 1e-17);
    CHECK_NEAR(s.position_m[2], 15, 0);
    CHECK(s.has_position && !s.has_force);
    CHECK(!s.button[0] && s.button[3]);
    CHECK_NEAR(s.force_N[2], 5, 0);
    REQUIRE(pal_haply_scan(text, sizeof text - 1, 1, &s));
    CHECK_TEXT(s.device, "B");
    CHECK_NEAR(s.position_m[2], 7, 0);
    /* the whole text and none of its beginnings */
    for (size_t n = 0; n < sizeof text - 2; n++) CHECK(!pal_haply_scan(text, n, 0, &s));
    CHECK(!pal_haply_scan("{} {}", 5, 0, &s));
    CHECK(!pal_haply_scan("[1,]", 4, 0, &s));
}

int main(void)
{
    RUN(scanner_reads_numbers_flags_and_texts_of_the_chosen_device);
    RUN(pose_force_and_buttons_have_our_axes);
    RUN(tissue_feels_as_stiff_as_its_model);
    RUN(device_unplugged_while_it_presses_has_no_force_and_comes_back);
    RUN(lost_power_and_broken_positions_and_messages_take_the_force);
    RUN(frozen_encoder_takes_the_force_after_three_seconds);
    RUN(stalled_service_gets_no_force_and_arms_again);
    RUN(devices_that_cannot_be_used_are_refused_in_one_sentence);
    fake_haply_stop();
    return check_report();
}
