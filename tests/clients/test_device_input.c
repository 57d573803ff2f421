/* Controllers without force: events through a pipe as evdev gives them, and libspnav through a fake. */
#include "clients/haptic_bridge/device_input.h"
#include "tests/clients/device_rig.h"

#include <fcntl.h>
#include <linux/input.h>
#include <sys/stat.h>

static device_rig rig;
static char path[64];
static int pipe_end;
static pal_dev_state state;

static bool opened(void)
{
    snprintf(path, sizeof path, "/tmp/palpate_input_%d", (int)getpid());
    unlink(path);
    if (mkfifo(path, 0600)) return false;
    pipe_end = open(path, O_RDWR | O_NONBLOCK);
    return pipe_end >= 0 && !rig_open(&rig, pal_device_input(), path);
}
static void end(void)
{
    if (pipe_end >= 0) close(pipe_end);
    unlink(path);
}

static void put(int type, int code, int value)
{
    const struct input_event event = {.type = (unsigned short)type, .code = (unsigned short)code, .value = value};
    CHECK(write(pipe_end, &event, sizeof event) == (ssize_t)sizeof event);
}
/* reads once a millisecond */
static void pass_ms(int n)
{
    for (int i = 0; i < n; i++) {
        manual_clock_advance(&rig.clock, RIG_MS_NS);
        CHECK_INT(pal_device_input()->read(rig.o.device, &state), 0);
    }
}

static void full_deflection_moves_at_full_speed_along_the_right_axis(void)
{
    REQUIRE(opened());
    CHECK_INT(rig.o.info.pose_only, 1);
    pass_ms(1);
    put(EV_ABS, ABS_X, 500); /* to the right */
    pass_ms(500);
    CHECK_NEAR(state.position_m[1], 0.05, 1e-9); /* 0.1 m/s */
    put(EV_ABS, ABS_X, 20);                      /* within the dead zone of 5 % */
    put(EV_ABS, ABS_Y, 500);                     /* to the user */
    pass_ms(200);
    CHECK_NEAR(state.position_m[0], 0.02, 1e-9);
    CHECK_NEAR(state.position_m[1], 0.05, 1e-9);
    put(EV_ABS, ABS_Y, 0);
    put(EV_ABS, ABS_Z, 262); /* half of what is beyond the dead zone, down: a quarter of the speed */
    pass_ms(1000);
    CHECK_NEAR(state.position_m[2], -0.1 / 4, 2e-4);
    put(EV_ABS, ABS_Z, -500);
    pass_ms(3000);
    CHECK_NEAR(state.position_m[2], 0.1, 1e-12); /* the edge of the workspace */
    put(EV_ABS, ABS_Z, 0);
    /* 1 rad/s about the axis to the right, for 1 s */
    put(EV_ABS, ABS_RX, 500);
    pass_ms(1000);
    CHECK_NEAR(state.quat[0], cos(0.5), 1e-6);
    CHECK_NEAR(state.quat[2], sin(0.5), 1e-6);
    pal_device_input()->close(rig.o.device);
    end();
}

static void buttons_are_those_of_the_bridge_and_lost_events_are_rest(void)
{
    REQUIRE(opened());
    put(EV_KEY, BTN_0, 1);
    pass_ms(1);
    CHECK_INT(state.buttons, PAL_DEVICE_BUTTON_GRASP | PAL_DEVICE_BUTTON_DEADMAN);
    put(EV_KEY, BTN_0, 0);
    put(EV_KEY, BTN_1, 1);
    pass_ms(1);
    CHECK_INT(state.buttons, PAL_DEVICE_BUTTON_CLUTCH | PAL_DEVICE_BUTTON_DEADMAN);
    put(EV_ABS, ABS_X, 500);
    put(EV_SYN, SYN_DROPPED, 0);
    const double before = state.position_m[1];
    pass_ms(100);
    CHECK_NEAR(state.position_m[1], before, 0);
    CHECK_INT(state.buttons, 0);
    pal_device_input()->close(rig.o.device);
    end();
}

static void relative_axis_that_falls_silent_has_been_let_go(void)
{
    REQUIRE(opened());
    pass_ms(1);
    for (int i = 0; i < 20; i++) {
        put(EV_REL, REL_X, 500);
        pass_ms(10);
    }
    CHECK_NEAR(state.position_m[1], 0.02, 1e-9);
    pass_ms(1000);
    CHECK_NEAR(state.position_m[1], 0.029, 2e-4); /* 100 ms after the last, of which 10 are over */
    pal_device_input()->close(rig.o.device);
    end();
}

static void event_in_two_pieces_is_one(void)
{
    REQUIRE(opened());
    const struct input_event event = {.type = EV_KEY, .code = BTN_0, .value = 1};
    CHECK(write(pipe_end, &event, 5) == 5);
    pass_ms(1);
    CHECK_INT(state.buttons, 0);
    CHECK(write(pipe_end, (const char *)&event + 5, sizeof event - 5) == (ssize_t)sizeof event - 5);
    pass_ms(1);
    CHECK(state.buttons != 0);
    pal_device_input()->close(rig.o.device);
    end();
}

static void servo_reports_an_unplugged_controller_once_and_takes_it_back(void)
{
    REQUIRE(opened());
    rig.o.pose_only = true;
    REQUIRE(rig_run(&rig));
    put(EV_ABS, ABS_X, 500);
    rig_ticks(&rig, 100);
    CHECK_INT(rig.view.state, PAL_SERVO_FREE);
    CHECK(rig.view.position_m[1] > 0.009);
    close(pipe_end);
    rig_ticks(&rig, 3);
    CHECK_INT(rig.n_lost, 1);
    char sentence[PAL_DEVICE_TEXT];
    snprintf(sentence, sizeof sentence, "%s: it has stopped answering", path);
    CHECK_TEXT(rig.lost, sentence);
    CHECK_INT(rig.view.state, PAL_SERVO_FAULT);
    unlink(path);
    rig_wait(&rig, 5000, 2); /* there is no such file */
    REQUIRE(mkfifo(path, 0600) == 0);
    pipe_end = open(path, O_RDWR | O_NONBLOCK);
    rig_wait(&rig, 2000, 2);
    CHECK_INT(rig.n_lost, 1);
    CHECK_INT(rig.n_back, 1);
    CHECK_INT(rig.view.state, PAL_SERVO_FREE);
    rig_close(&rig, NULL);
    end();
}

static void daemon_of_space_mice_has_its_own_axes(void)
{
    REQUIRE(rig_open(&rig, pal_device_input(), "spnav") == 0);
    void *library = dlopen("libspnav.so", RTLD_LAZY | RTLD_NOLOAD), *address;
    void (*fake_put)(const int event[7]) = NULL;
    REQUIRE(library && (address = dlsym(library, "fake_spnav_put")));
    memcpy(&fake_put, &address, sizeof fake_put);
    pass_ms(1);
    const int right_up[7] = {1, 350, 350}, away[7] = {1, 0, 0, 350}, press[7] = {2, 1, 1}, release[7] = {2, 0, 1};
    fake_put(right_up);
    fake_put(press);
    pass_ms(100);
    CHECK_NEAR(state.position_m[1], 0.01, 1e-9);
    CHECK_NEAR(state.position_m[2], 0.01, 1e-9);
    CHECK_INT(state.buttons, PAL_DEVICE_BUTTON_CLUTCH | PAL_DEVICE_BUTTON_DEADMAN);
    fake_put(away);
    fake_put(release);
    pass_ms(100);
    CHECK_NEAR(state.position_m[0], -0.01, 1e-9);
    CHECK_INT(state.buttons, 0);
    pal_device_input()->close(rig.o.device);
}

static void missing_file_is_refused_by_name(void)
{
    const int error = rig_open(&rig, pal_device_input(), "/tmp/palpate_none");
    CHECK_INT(error, PAL_DEVICE_ERROR_NONE);
    CHECK_TEXT(pal_device_input()->strerror(rig.o.device, error), "/tmp/palpate_none: there is no such device");
    pal_device_input()->close(rig.o.device);
}

int main(void)
{
    RUN(full_deflection_moves_at_full_speed_along_the_right_axis);
    RUN(buttons_are_those_of_the_bridge_and_lost_events_are_rest);
    RUN(relative_axis_that_falls_silent_has_been_let_go);
    RUN(event_in_two_pieces_is_one);
    RUN(servo_reports_an_unplugged_controller_once_and_takes_it_back);
    RUN(daemon_of_space_mice_has_its_own_axes);
    RUN(missing_file_is_refused_by_name);
    return check_report();
}
