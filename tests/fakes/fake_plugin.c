/* A plug-in of the bridge: the fake plant behind the table of device.h. -D FAKE_ABI=2: one of another
 * ABI. */
#include "clients/haptic_bridge/device.h"
#include "server/base/vec3.h"
#include "tests/fakes/fake_plant.h"

#include <stdio.h>
#include <string.h>

#ifndef FAKE_ABI
#define FAKE_ABI PAL_HAPTIC_ABI
#endif
#define EXPORT __attribute__((visibility("default")))
EXPORT const pal_haptic_v1 *pal_haptic_entry(void);
EXPORT const fake_control *fake_entry(void);

enum { UNPLUGGED = -40, UNKNOWN = -41 };
static int device; /* there is one */
static bool enabled, stopped;

static int fake_probe(char *reason, size_t n)
{
    snprintf(reason, n, "one");
    return 1;
}
static int fake_open(void **handle, const char *id, pal_dev_info *out)
{
    fake_begin();
    *handle = &device;
    if (strcmp(id, "one")) return UNKNOWN;
    *out = (pal_dev_info){.size = sizeof *out,
                          .name = "Fake plug-in",
                          .peak_N = 5,
                          .continuous_N = 5,
                          .dof_in = 3,
                          .dof_out = 3,
                          .stiffness_max_N_m = 600,
                          .damping_max_Ns_m = 5};
    for (int k = 0; k < 3; k++) out->low_m[k] = -0.1, out->high_m[k] = 0.1;
    return fake_value(FAKE_UNPLUGGED) ? UNPLUGGED : 0;
}
static int fake_device_read(void *handle, pal_dev_state *state)
{
    (void)handle;
    if (fake_value(FAKE_UNPLUGGED)) return UNPLUGGED;
    state->quat[0] = 1;
    state->buttons = (uint32_t)fake_value(FAKE_BUTTONS) ? PAL_DEVICE_BUTTON_DEADMAN : 0;
    fake_read(state->position_m);
    return 0;
}
static int fake_device_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    const double none[3] = {0, 0, 0};
    (void)handle, (void)torque_N_m, (void)grip;
    fake_step(1e-3, enabled && !stopped ? force_N : none, force_N);
    return 0;
}
static int fake_force_enable(void *handle, int on)
{
    (void)handle;
    enabled = on, stopped = stopped && !on;
    return 0;
}
static int fake_stop(void *handle)
{
    (void)handle;
    stopped = true;
    return 0;
}
static void fake_close(void *handle)
{
    (void)handle;
}
static const char *fake_strerror(void *handle, int error)
{
    (void)handle;
    return error == UNPLUGGED ? "nothing is plugged in" : "no device of this name";
}
static int fake_reopen(void *handle)
{
    pal_dev_info info;
    return fake_open(&handle, "one", &info);
}

const pal_haptic_v1 *pal_haptic_entry(void)
{
    static const pal_haptic_v1 table = {.abi = FAKE_ABI,
                                        .size = sizeof table,
                                        .name = "fake",
                                        .probe = fake_probe,
                                        .open = fake_open,
                                        .read = fake_device_read,
                                        .write = fake_device_write,
                                        .force_enable = fake_force_enable,
                                        .stop = fake_stop,
                                        .close = fake_close,
                                        .strerror = fake_strerror,
                                        .reopen = fake_reopen};
    return &table;
}
const fake_control *fake_entry(void)
{
    static const fake_control *control;
    if (!control) control = fake_common(NULL, NULL);
    return control;
}
