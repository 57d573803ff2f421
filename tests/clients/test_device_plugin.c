/* A back end from a file: its device is felt, and what a file may have wrong is refused in one sentence. */
#include "clients/haptic_bridge/device_plugin.h"
#include "tests/clients/device_rig.h"

static device_rig rig;

static bool opened(void)
{
    if (rig_open(&rig, pal_device_plugin(), "libfake_plugin.so,one")) return false;
    rig.fake = rig_fake("libfake_plugin.so");
    if (rig.fake) rig.fake->begin("touch,hand=average,depth=8", "");
    return rig.fake != NULL;
}

static void device_of_a_plug_in_is_felt(void)
{
    REQUIRE(opened());
    CHECK_TEXT(rig.o.info.name, "Fake plug-in");
    REQUIRE(rig_run(&rig) && rig_press(&rig));
    rig_ticks(&rig, 1000);
    double at[3], motor[3];
    rig.fake->truth(at, motor);
    CHECK_NEAR(motor[2], -RIG_STIFFNESS * at[2], 0.055e-3 * RIG_STIFFNESS);
    CHECK_INT(rig.n_lost, 0);
    rig_close(&rig, NULL);
}

static void device_unplugged_while_it_presses_has_no_force_and_comes_back(void)
{
    REQUIRE(opened() && rig_run(&rig) && rig_press(&rig));
    CHECK(rig_motor_force(&rig) > 0.5);
    rig.fake->set(FAKE_UNPLUGGED, 1);
    rig_ticks(&rig, 20);
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, "libfake_plugin.so: nothing is plugged in (-40)");
    double written[3];
    rig.fake->written(written);
    CHECK_NEAR(written[2], 0, 0);
    rig.fake->set(FAKE_UNPLUGGED, 0);
    rig_wait(&rig, 2100, 2);
    CHECK_INT(rig.n_back, 1);
    CHECK(rig_press(&rig));
    rig_close(&rig, NULL);
}

static void position_that_is_no_number_takes_the_force(void)
{
    REQUIRE(opened() && rig_run(&rig) && rig_press(&rig));
    rig.fake->set_in(FAKE_NAN_AT, 1);
    rig_ticks(&rig, 4);
    CHECK_INT(rig.n_lost, 1);
    CHECK_TEXT(rig.lost, "libfake_plugin.so: its pose is not a number");
    CHECK_NEAR(rig.view.force_N[2], 0, 0);
    rig_close(&rig, NULL);
}

static void check_refused(const char *id, const char *sentence)
{
    const int error = rig_open(&rig, pal_device_plugin(), id);
    CHECK(error < 0);
    CHECK_TEXT(pal_device_plugin()->strerror(rig.o.device, error), sentence);
    pal_device_plugin()->close(rig.o.device);
}
static void wrong_files_are_refused_by_name(void)
{
    check_refused("libnothing.so", "looked for libnothing.so: not there");
    check_refused("libdhd.so", "libdhd.so has no function pal_haptic_entry: another version?");
    char sentence[PAL_DEVICE_TEXT];
    snprintf(sentence, sizeof sentence,
             "libfake_plugin_2.so: its table is of ABI 2 with %zu bytes, wanted 1 with %zu or more",
             sizeof(pal_haptic_v1), offsetof(pal_haptic_v1, reopen));
    check_refused("libfake_plugin_2.so", sentence);
    check_refused("libfake_plugin.so,two", "libfake_plugin.so: no device of this name (-41)");
}

int main(void)
{
    RUN(device_of_a_plug_in_is_felt);
    RUN(device_unplugged_while_it_presses_has_no_force_and_comes_back);
    RUN(position_that_is_no_number_takes_the_force);
    RUN(wrong_files_are_refused_by_name);
    return check_report();
}
