#include "clients/haptic_bridge/device_dhd.h"
#include "clients/haptic_bridge/device_common.h"
#include "clients/haptic_bridge/device_tuning.h"
#include "server/base/vec3.h"

#include <glob.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

/* names and values of the library. `char id` is an optional argument of its C++ header: C passes it always */
enum {
    DHD_STATUS_FORCE = 5, /* forces are on */
    DHD_STATUS_INTS = 32, /* 16 or 17 by version; more than any has */
    DHD_ERROR_NO_DEVICE_FOUND = 5
};
#define DHD_FUNCTIONS(F)                                                                                               \
    F(int, dhdOpen, (void), true)                                                                                      \
    F(int, dhdClose, (char), true)                                                                                     \
    F(int, dhdGetPosition, (double *, double *, double *, char), true)                                                 \
    F(int, dhdSetForce, (double, double, double, char), true)                                                          \
    F(int, dhdOpenID, (char), false)                                                                                   \
    F(int, dhdGetDeviceCount, (void), false)                                                                           \
    F(int, dhdStop, (char), false)                                                                                     \
    F(int, dhdErrorGetLast, (void), false)                                                                             \
    F(const char *, dhdErrorGetStr, (int), false)                                                                      \
    F(int, dhdGetSystemType, (char), false)                                                                            \
    F(const char *, dhdGetSystemName, (char), false)                                                                   \
    F(int, dhdEnableForce, (unsigned char, char), false)                                                               \
    F(int, dhdSetGravityCompensation, (int, char), false)                                                              \
    F(int, dhdGetStatus, (int *, char), false)                                                                         \
    F(int, dhdGetOrientationFrame, (double *, char), false)                                                            \
    F(int, dhdSetForceAndTorque, (double, double, double, double, double, double, char), false)                        \
    F(unsigned, dhdGetButtonMask, (char), false)                                                                       \
    F(int, dhdGetGripperAngleRad, (double *, char), false)                                                             \
    F(double, dhdGetComFreq, (char), false)                                                                            \
    F(bool, dhdHasWrist, (char), false)                                                                                \
    F(bool, dhdHasActiveWrist, (char), false)                                                                          \
    F(bool, dhdHasGripper, (char), false)                                                                              \
    F(int, dhdEnableExpertMode, (void), false)                                                                         \
    F(int, dhdSetWatchdog, (unsigned char, char), false)

#define DHD_POINTER(result, name, arguments, required) result(*name) arguments;
#define DHD_ENTRY(result, name, arguments, required)   {#name, &dhd.name, required},
static struct {
    DHD_FUNCTIONS(DHD_POINTER)
} dhd;
static const pal_device_function dhd_function[] = {DHD_FUNCTIONS(DHD_ENTRY)};
enum { DHD_FUNCTION_COUNT = sizeof dhd_function / sizeof dhd_function[0] };
static void *dhd_library;
static char dhd_library_text[PAL_DEVICE_TEXT];

/* limits by type of system; the last row, which is cautious, is for all that are not in the table */
static const struct {
    int type;
    double peak_N, stiffness_N_m, damping_Ns_m, radius_m;
} dhd_limit[] = {{33, 12, 5000, 30, 0.075}, {34, 12, 5000, 30, 0.075}, {35, 12, 5000, 30, 0.075},
                 {36, 12, 5000, 30, 0.075}, {37, 12, 5000, 30, 0.075}, {60, 8, 3000, 20, 0.04},
                 {-1, 8, 2000, 10, 0.075}};

typedef struct dhd_device {
    char id;
    int wanted; /* number; -1: the first */
    char what[96], text[PAL_DEVICE_TEXT];
    bool has_wrist, has_torque, has_gripper, has_watchdog;
    int error; /* of the last write */
    double given_N[3];
    pal_device_fade fade;
    pal_device_guard guard;
    atomic_bool stopped, enabled;
} dhd_device;

static int dhd_load(void)
{
    if (dhd_library) return 0;
    struct utsname machine;
    char pattern[512];
    glob_t found = {0};
    const char *sdk = getenv("FDSDK"), *home = getenv("HOME");
    uname(&machine);
    snprintf(pattern, sizeof pattern, "%s/lib/release/lin-%s-gcc/libdrd.so.*", sdk ? sdk : "", machine.machine);
    if (sdk) (void)glob(pattern, 0, NULL, &found);
    snprintf(pattern, sizeof pattern, "%s/.local/lib/libdrd.so*", home ? home : "");
    if (home) (void)glob(pattern, found.gl_pathc ? GLOB_APPEND : 0, NULL, &found);
    const char *const usual[] = {"libdrd.so", "libdrd.so.3", "libdhd.so", "libdhd.so.3", "/usr/local/lib/libdrd.so"};
    enum { USUAL = sizeof usual / sizeof usual[0], FILES = 16 };
    const char *file[FILES + 1] = {NULL};
    size_t n = 0;
    while (n < FILES - USUAL && n < found.gl_pathc) file[n] = found.gl_pathv[n], n++;
    for (size_t i = 0; i < USUAL; i++) file[n++] = usual[i];
    dhd_library = pal_device_library_load(file, false, dhd_function, DHD_FUNCTION_COUNT, dhd_library_text,
                                          sizeof dhd_library_text);
    globfree(&found);
    return dhd_library ? 0 : PAL_DEVICE_ERROR_LIBRARY;
}

static int dhd_probe(char *reason, size_t n)
{
    if (dhd_load()) {
        snprintf(reason, n, "%s", dhd_library_text);
        return -1;
    }
    const int count = dhd.dhdGetDeviceCount ? dhd.dhdGetDeviceCount() : 1;
    snprintf(reason, n, "%s", pal_device_library_path(*(void **)&dhd.dhdOpen));
    return count;
}

/* the library's last error as ours */
static int dhd_error(void)
{
    const int code = dhd.dhdErrorGetLast ? dhd.dhdErrorGetLast() : 1;
    return code == DHD_ERROR_NO_DEVICE_FOUND ? PAL_DEVICE_ERROR_NONE : PAL_DEVICE_OWN - code;
}

static int dhd_init(dhd_device *h)
{
    const int id = h->wanted >= 0 && dhd.dhdOpenID ? dhd.dhdOpenID((char)h->wanted) : dhd.dhdOpen();
    if (id < 0) return dhd_error();
    h->id = (char)id;
    if (dhd.dhdEnableExpertMode && dhd.dhdSetWatchdog && dhd.dhdEnableExpertMode() >= 0)
        h->has_watchdog = dhd.dhdSetWatchdog(PAL_DEVICE_DHD_WATCHDOG, h->id) >= 0;
    if (dhd.dhdSetGravityCompensation) dhd.dhdSetGravityCompensation(1, h->id);
    h->has_wrist = dhd.dhdGetOrientationFrame && dhd.dhdHasWrist && dhd.dhdHasWrist(h->id);
    h->has_torque = dhd.dhdSetForceAndTorque && dhd.dhdHasActiveWrist && dhd.dhdHasActiveWrist(h->id);
    h->has_gripper = dhd.dhdGetGripperAngleRad && dhd.dhdHasGripper && dhd.dhdHasGripper(h->id);
    h->fade = (pal_device_fade){0};
    h->guard = (pal_device_guard){.since_s = pal_device_time_s()};
    return h->error = 0;
}

static int dhd_open(void **handle, const char *id, pal_dev_info *out)
{
    dhd_device *h = calloc(1, sizeof *h);
    *handle = h;
    if (!h) return PAL_DEVICE_ERROR_MEMORY;
    h->id = (char)-1;
    h->wanted = id[0] >= '0' && id[0] <= '9' ? atoi(id) : -1;
    snprintf(h->what, sizeof h->what, "device %.8s of the DHD library", id[0] ? id : "0");
    int error = dhd_load();
    if (!error && id[0] && h->wanted < 0) error = PAL_DEVICE_ERROR_NONE;
    if (!error) error = dhd_init(h);
    if (error) return error;
    const int type = dhd.dhdGetSystemType ? dhd.dhdGetSystemType(h->id) : -1;
    size_t k = 0;
    while (dhd_limit[k].type >= 0 && dhd_limit[k].type != type) k++;
    *out = (pal_dev_info){.size = sizeof *out,
                          .peak_N = dhd_limit[k].peak_N,
                          .continuous_N = dhd_limit[k].peak_N,
                          .stiffness_max_N_m = dhd_limit[k].stiffness_N_m,
                          .damping_max_Ns_m = dhd_limit[k].damping_Ns_m,
                          .dof_in = h->has_wrist ? 6 : 3,
                          .dof_out = h->has_torque ? 6 : 3};
    for (int i = 0; i < 3; i++) out->high_m[i] = dhd_limit[k].radius_m, out->low_m[i] = -out->high_m[i];
    const char *name = dhd.dhdGetSystemName ? dhd.dhdGetSystemName(h->id) : NULL;
    snprintf(out->name, sizeof out->name, "%s", name ? name : "DHD device");
    return 0;
}

static int dhd_reopen(void *handle)
{
    dhd_device *h = handle;
    dhd.dhdClose(h->id);
    return dhd_init(h);
}

static int dhd_read(void *handle, pal_dev_state *s)
{
    dhd_device *h = handle;
    if (h->error < 0) return h->error;
    *s = (pal_dev_state){
        .size = sizeof *s, .quat = {1, 0, 0, 0}, .has_force = 1, .stamp_us = (uint64_t)(1e6 * pal_device_time_s())};
    double frame[9]; /* [3][3] */
    int status[DHD_STATUS_INTS] = {[DHD_STATUS_FORCE] = 1};
    if (dhd.dhdGetPosition(&s->position_m[0], &s->position_m[1], &s->position_m[2], h->id) < 0) return dhd_error();
    if (h->has_wrist && dhd.dhdGetOrientationFrame(frame, h->id) >= 0) pal_device_quat(s->quat, frame);
    if (h->has_gripper) dhd.dhdGetGripperAngleRad(&s->grip, h->id);
    if (dhd.dhdGetStatus) dhd.dhdGetStatus(status, h->id);
    if (!status[DHD_STATUS_FORCE]) h->fade.share = 0;
    const unsigned buttons = dhd.dhdGetButtonMask ? dhd.dhdGetButtonMask(h->id) : 0;
    if (buttons & 1) s->buttons |= PAL_DEVICE_BUTTON_GRASP;
    if (buttons & 2) s->buttons |= PAL_DEVICE_BUTTON_CLUTCH;
    if (buttons) s->buttons |= PAL_DEVICE_BUTTON_DEADMAN;
    pal_copy3(s->force_N, h->given_N);
    if (!status[DHD_STATUS_FORCE]) pal_set3(s->force_N, 0, 0, 0);
    return pal_device_guard_pose(&h->guard, s, s->force_N);
}

static int dhd_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    dhd_device *h = handle;
    (void)grip;
    const bool off = atomic_load(&h->stopped) || !atomic_load(&h->enabled);
    const double share = off ? h->fade.share = 0 : pal_device_fade_step(&h->fade, true);
    double f[3], t[3];
    pal_scale3(f, share, force_N);
    pal_scale3(t, share, torque_N_m);
    const int result = h->has_torque ? dhd.dhdSetForceAndTorque(f[0], f[1], f[2], t[0], t[1], t[2], h->id)
                                     : dhd.dhdSetForce(f[0], f[1], f[2], h->id);
    if (result < 0) return h->error = dhd_error();
    pal_copy3(h->given_N, f);
    return result; /* too soon after the last, or motors saturated */
}

static int dhd_force_enable(void *handle, int on)
{
    dhd_device *h = handle;
    atomic_store(&h->enabled, on != 0);
    if (on) atomic_store(&h->stopped, false);
    return dhd.dhdEnableForce ? dhd.dhdEnableForce(on != 0, h->id) : 0;
}

static int dhd_stop(void *handle)
{
    dhd_device *h = handle;
    atomic_store(&h->stopped, true);
    /* a servo that hangs may hang in this library: the firmware's watchdog is the better stop */
    return h->has_watchdog || !dhd.dhdStop ? 0 : dhd.dhdStop(h->id);
}

static void dhd_close(void *handle)
{
    dhd_device *h = handle;
    if (h && h->id >= 0) {
        if (dhd.dhdStop) dhd.dhdStop(h->id);
        dhd.dhdClose(h->id);
    }
    free(h);
}

static const char *dhd_strerror(void *handle, int error)
{
    dhd_device *h = handle;
    if (!h) return "no memory for a device of the DHD library";
    if (error == PAL_DEVICE_ERROR_LIBRARY) return dhd_library_text;
    const char *common = pal_device_error_text(error, h->what, h->text);
    if (common) return common;
    static const char *const advice[] = {[2] = "is it plugged in and on?",
                                         [3] = "another program holds it",
                                         [4] = "libusb-1.0 is missing, or you may not use its USB port",
                                         [7] = "its answer is late",
                                         [12] = "let it initialise: switch it on and wait for its light",
                                         [20] = "another program holds it"};
    const int code = PAL_DEVICE_OWN - error;
    const char *meaning = dhd.dhdErrorGetStr ? dhd.dhdErrorGetStr(code) : NULL;
    const char *more = code > 0 && code < (int)(sizeof advice / sizeof *advice) ? advice[code] : NULL;
    snprintf(h->text, sizeof h->text, "%s: error %d, %.80s%s%s", h->what, code, meaning ? meaning : "see its manual",
             more ? ": " : "", more ? more : "");
    return h->text;
}

static int dhd_check(void *handle, int step, char *text, size_t n)
{
    dhd_device *h = handle;
    if (!h && step == 0) {
        const bool good = dhd_load() == 0;
        snprintf(text, n, "library: %s", good ? pal_device_library_path(*(void **)&dhd.dhdOpen) : dhd_library_text);
        return good ? 1 : -1;
    }
    if (!h && step == 1) {
        int found = 0;
        for (int i = 0; i < DHD_FUNCTION_COUNT; i++) found += *(void **)dhd_function[i].address != NULL;
        snprintf(text, n, "functions: %d of %d", found, DHD_FUNCTION_COUNT);
        return found == DHD_FUNCTION_COUNT ? 1 : -1;
    }
    if (!h && step == 2) {
        const char *sdk = getenv("FDSDK");
        snprintf(text, n, "environment: FDSDK %s", sdk ? sdk : "is not set, which is right for an installed library");
        return 1;
    }
    if (!h && step == 3) {
        const int count = dhd_library && dhd.dhdGetDeviceCount ? dhd.dhdGetDeviceCount() : -1;
        snprintf(text, n, "devices: %d%s", count < 0 ? 0 : count,
                 count > 0 ? "" : ": plug one in, switch it on, and let your user write to its USB port");
        return count > 0 ? 1 : -1;
    }
    if (h && step == 0) {
        int status[DHD_STATUS_INTS] = {0};
        const bool on = dhd.dhdGetStatus && dhd.dhdEnableForce && dhd.dhdEnableForce(1, h->id) >= 0 &&
                        dhd.dhdGetStatus(status, h->id) >= 0 && status[DHD_STATUS_FORCE];
        snprintf(text, n, "forces: %s",
                 on ? "on" : "off: press the force button of the device until its light stays on");
        return on ? 1 : -1;
    }
    if (h && step == 1) {
        snprintf(text, n, "firmware watchdog: %s", h->has_watchdog ? "10 ms" : "none: the library is older than 3.7");
        return h->has_watchdog ? 1 : -1;
    }
    return 0;
}

const pal_haptic_v1 *pal_device_dhd(void)
{
    static const pal_haptic_v1 table = {.abi = PAL_HAPTIC_ABI,
                                        .size = sizeof table,
                                        .name = "dhd",
                                        .probe = dhd_probe,
                                        .open = dhd_open,
                                        .read = dhd_read,
                                        .write = dhd_write,
                                        .force_enable = dhd_force_enable,
                                        .stop = dhd_stop,
                                        .close = dhd_close,
                                        .strerror = dhd_strerror,
                                        .reopen = dhd_reopen,
                                        .check = dhd_check};
    return &table;
}
