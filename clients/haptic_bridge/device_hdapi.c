#include "clients/haptic_bridge/device_hdapi.h"
#include "clients/haptic_bridge/device_common.h"
#include "clients/haptic_bridge/device_tuning.h"
#include "server/base/vec3.h"

#include <dlfcn.h>
#include <errno.h>
#include <glob.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* names and values of HDAPI, as its reference has them */
typedef struct hd_error_info {
    unsigned code;
    int internal;
    unsigned device;
} hd_error_info;
typedef unsigned (*hd_callback)(void *user);
enum {
    HD_CURRENT_BUTTONS = 0x2000,
    HD_CURRENT_TRANSFORM = 0x2052,
    HD_DEVICE_MODEL_TYPE = 0x2501,
    HD_USABLE_WORKSPACE_DIMENSIONS = 0x2551,
    HD_NOMINAL_MAX_STIFFNESS = 0x2602,
    HD_NOMINAL_MAX_FORCE = 0x2603,
    HD_NOMINAL_MAX_CONTINUOUS_FORCE = 0x2604,
    HD_MOTOR_TEMPERATURE = 0x2605,
    HD_CURRENT_FORCE = 0x2700,
    HD_FORCE_OUTPUT = 0x4000,
    HD_MAX_FORCE_CLAMPING = 0x4001,
    HD_FORCE_RAMPING = 0x4002,
    HD_CALIBRATION_OK = 0x5000,
    HD_CALIBRATION_NEEDS_UPDATE = 0x5001,
    HD_WARM_FIRST = 0x200,
    HD_WARM_LAST = 0x204,
    HD_CALLBACK_DONE = 0,
    HD_CALLBACK_CONTINUE = 1,
    HD_PRIORITY_MAX = 65535
};
#define HD_INVALID_HANDLE 0xFFFFFFFFu

#define HD_FUNCTIONS(F)                                                                                                \
    F(unsigned, hdInitDevice, (const char *), true)                                                                    \
    F(void, hdDisableDevice, (unsigned), true)                                                                         \
    F(void, hdMakeCurrentDevice, (unsigned), true)                                                                     \
    F(void, hdBeginFrame, (unsigned), true)                                                                            \
    F(void, hdEndFrame, (unsigned), true)                                                                              \
    F(hd_error_info, hdGetError, (void), true)                                                                         \
    F(void, hdEnable, (unsigned), true)                                                                                \
    F(void, hdGetIntegerv, (unsigned, int *), true)                                                                    \
    F(void, hdGetDoublev, (unsigned, double *), true)                                                                  \
    F(void, hdSetDoublev, (unsigned, const double *), true)                                                            \
    F(unsigned long, hdScheduleAsynchronous, (hd_callback, void *, unsigned short), true)                              \
    F(void, hdUnschedule, (unsigned long), true)                                                                       \
    F(void, hdStartScheduler, (void), true)                                                                            \
    F(void, hdStopScheduler, (void), true)                                                                             \
    F(const char *, hdGetString, (unsigned), false)                                                                    \
    F(const char *, hdGetErrorString, (unsigned), false)                                                               \
    F(unsigned, hdCheckCalibration, (void), false)                                                                     \
    F(unsigned, hdCheckCalibrationStyle, (void), false)                                                                \
    F(void, hdUpdateCalibration, (unsigned), false)

#define HD_POINTER(result, name, arguments, required) result(*name) arguments;
#define HD_ENTRY(result, name, arguments, required)   {#name, &hd.name, required},
static struct {
    HD_FUNCTIONS(HD_POINTER)
} hd;
static const pal_device_function hd_function[] = {HD_FUNCTIONS(HD_ENTRY)};
enum { HD_FUNCTION_COUNT = sizeof hd_function / sizeof hd_function[0] };
static void *hd_library;
static char hd_library_text[PAL_DEVICE_TEXT];
static atomic_int hd_n_running; /* devices whose tick is scheduled: the scheduler is one for all */

typedef struct hdapi_device {
    unsigned device;
    char name[64]; /* "": default */
    char what[96], text[PAL_DEVICE_TEXT];
    double middle_m[3]; /* of the workspace, in our axes */
    bool has_temperature;
    int (*tick)(void *);
    void *user;
    unsigned long schedule;
    sem_t changed; /* the tick is no longer called */
    atomic_bool ended, stopped, enabled, abandoned;
    _Atomic unsigned n_frame;
    /* of the library's thread while it runs */
    int error;   /* why the tick is called no more */
    int reading; /* result of read in this frame */
    double force_N[3], given_N[3];
    double warm_until_s; /* motors are spared until then */
    pal_device_fade fade;
    pal_dev_state state;
    pal_device_guard guard;
} hdapi_device;

/* HDAPI's x right, y up, z to the user -> x to the user, y right, z up; and back */
static void hdapi_to_ours(double ours[3], const double theirs[3])
{
    pal_set3(ours, theirs[2], theirs[0], theirs[1]);
}
static void hdapi_from_ours(double theirs[3], const double ours[3])
{
    pal_set3(theirs, ours[1], ours[2], ours[0]);
}

static int hdapi_load(void)
{
    static const char *const interface[] = {"libPhantomIOLib42.so",
                                            NULL}; /* of drivers since 2022, which libHD.so wants */
    static const char *const file[] = {"libHD.so", "libHD.so.3.4", "libHD.so.3.0", NULL};
    if (hd_library) return 0;
    (void)pal_device_library_load(interface, true, NULL, 0, hd_library_text, sizeof hd_library_text);
    hd_library =
        pal_device_library_load(file, true, hd_function, HD_FUNCTION_COUNT, hd_library_text, sizeof hd_library_text);
    return hd_library ? 0 : PAL_DEVICE_ERROR_LIBRARY;
}

static int hdapi_probe(char *reason, size_t n)
{
    if (hdapi_load()) {
        snprintf(reason, n, "%s", hd_library_text);
        return -1;
    }
    snprintf(reason, n, "%s; --doctor --device hdapi: tries the device",
             pal_device_library_path(*(void **)&hd.hdInitDevice));
    return 1;
}

/* drops what the library has on its stack of errors; the first of it */
static unsigned hdapi_errors(void)
{
    unsigned first = 0, code;
    for (int i = 0; i < 16 && (code = hd.hdGetError().code); i++)
        if (!first) first = code;
    return first;
}

static int hdapi_init(hdapi_device *h)
{
    const char *const usual[] = {NULL, "Default Device", "Default PHANToM"};
    unsigned code = 0;
    hdapi_errors();
    for (int i = 0; i < (h->name[0] ? 1 : 3); i++) {
        h->device = hd.hdInitDevice(h->name[0] ? h->name : usual[i]);
        const unsigned failed = hdapi_errors();
        /* the first name is the one that works with today's drivers: its error is the one that helps */
        if (!code) code = failed ? failed : HD_INVALID_HANDLE;
        if (!failed && h->device != HD_INVALID_HANDLE) {
            hd.hdEnable(HD_FORCE_OUTPUT);
            hd.hdEnable(HD_FORCE_RAMPING);
            hd.hdEnable(HD_MAX_FORCE_CLAMPING);
            hdapi_errors();
            return h->error = 0;
        }
    }
    h->device = HD_INVALID_HANDLE;
    return code == HD_INVALID_HANDLE ? PAL_DEVICE_ERROR_NONE : -(int)code;
}

/* a value of the device, or what stands for it when the library does not know it, or it cannot be */
static double hdapi_limit(unsigned name, double unit, double max, double otherwise)
{
    double value[16] = {0};
    hd.hdGetDoublev(name, value);
    return hdapi_errors() == 0 && value[0] > 0 && value[0] * unit <= max ? value[0] * unit : otherwise;
}

static void hdapi_info(hdapi_device *h, pal_dev_info *out)
{
    /* the Touch, for what the library does not say */
    *out = (pal_dev_info){.size = sizeof *out,
                          .peak_N = hdapi_limit(HD_NOMINAL_MAX_FORCE, 1, 50, 3.3),
                          .continuous_N = hdapi_limit(HD_NOMINAL_MAX_CONTINUOUS_FORCE, 1, 50, 0.88),
                          .stiffness_max_N_m = hdapi_limit(HD_NOMINAL_MAX_STIFFNESS, 1e3, 5e3, 400),
                          .damping_max_Ns_m = 4,
                          .dof_in = 6,
                          .dof_out = 3,
                          .thread_model = PAL_DEVICE_CALLBACK};
    double box_mm[16] = {0}, low[3], high[3];
    hd.hdGetDoublev(HD_USABLE_WORKSPACE_DIMENSIONS, box_mm);
    hdapi_to_ours(low, box_mm);
    hdapi_to_ours(high, box_mm + 3);
    const bool known = hdapi_errors() == 0 && low[0] < high[0] && low[1] < high[1] && low[2] < high[2];
    for (int k = 0; k < 3; k++) {
        h->middle_m[k] = known ? 0.5e-3 * (low[k] + high[k]) : 0;
        out->high_m[k] = known ? 0.5e-3 * (high[k] - low[k]) : 0.075;
        out->low_m[k] = -out->high_m[k];
    }
    double warmth[16] = {0};
    hd.hdGetDoublev(HD_MOTOR_TEMPERATURE, warmth);
    h->has_temperature = hdapi_errors() == 0;
    const char *model = hd.hdGetString ? hd.hdGetString(HD_DEVICE_MODEL_TYPE) : NULL;
    hdapi_errors();
    snprintf(out->name, sizeof out->name, "%s", model ? model : "HDAPI device");
}

static int hdapi_open(void **handle, const char *id, pal_dev_info *out)
{
    hdapi_device *h = calloc(1, sizeof *h);
    *handle = h;
    if (!h) return PAL_DEVICE_ERROR_MEMORY;
    h->device = HD_INVALID_HANDLE;
    h->fade.share = 1;
    h->reading = PAL_DEVICE_ERROR_SILENT;
    sem_init(&h->changed, 0, 0);
    snprintf(h->name, sizeof h->name, "%s", id);
    snprintf(h->what, sizeof h->what, "device \"%s\" of libHD.so", h->name[0] ? h->name : "default");
    h->error = hdapi_load();
    if (!h->error) h->error = hdapi_init(h);
    if (!h->error) hdapi_info(h, out);
    return h->error;
}

static int hdapi_reopen(void *handle)
{
    hdapi_device *h = handle;
    if (atomic_load(&h->abandoned)) return PAL_DEVICE_ERROR_SILENT;
    if (h->device != HD_INVALID_HANDLE) hd.hdDisableDevice(h->device);
    h->guard = (pal_device_guard){.since_s = pal_device_time_s()};
    h->fade = (pal_device_fade){.share = 1};
    return h->error = hdapi_init(h);
}

static void hdapi_take_state(hdapi_device *h)
{
    double m[16], at_mm[3];
    int buttons = 0;
    hd.hdGetDoublev(HD_CURRENT_TRANSFORM, m);
    hd.hdGetIntegerv(HD_CURRENT_BUTTONS, &buttons);
    pal_dev_state *s = &h->state;
    *s = (pal_dev_state){.size = sizeof *s, .has_force = 1, .stamp_us = (uint64_t)(1e6 * pal_device_time_s())};
    hdapi_to_ours(at_mm, m + 12);
    for (int k = 0; k < 3; k++) s->position_m[k] = 1e-3 * at_mm[k] - h->middle_m[k];
    /* columns and rows both change places: handle and device have the same axes */
    double r[9], column[3], ours[3];
    for (int j = 0; j < 3; j++) {
        const double unit[3] = {j == 0, j == 1, j == 2};
        double theirs[3];
        hdapi_from_ours(theirs, unit);
        for (int k = 0; k < 3; k++) column[k] = m[k] * theirs[0] + m[4 + k] * theirs[1] + m[8 + k] * theirs[2];
        hdapi_to_ours(ours, column);
        for (int k = 0; k < 3; k++) r[3 * k + j] = ours[k];
    }
    pal_device_quat(s->quat, r);
    if (buttons & 1) s->buttons |= PAL_DEVICE_BUTTON_GRASP;
    if (buttons & 2) s->buttons |= PAL_DEVICE_BUTTON_CLUTCH;
    if (buttons) s->buttons |= PAL_DEVICE_BUTTON_DEADMAN;
    if (h->has_temperature) {
        double warmth[16] = {0};
        hd.hdGetDoublev(HD_MOTOR_TEMPERATURE, warmth);
        for (int k = 0; k < 3; k++) s->motor_temperature = fmax(s->motor_temperature, warmth[k]);
    }
    pal_copy3(s->force_N, h->given_N);
    h->reading = pal_device_guard_pose(&h->guard, s, h->given_N);
}

/* one frame of the library: [servo] */
static unsigned hdapi_on_frame(void *user)
{
    hdapi_device *h = user;
    int end = 1;
    hd.hdMakeCurrentDevice(h->device);
    hd.hdBeginFrame(h->device);
    if (!atomic_load(&h->abandoned)) {
        hdapi_take_state(h);
        end = h->tick(h->user);
    } else
        pal_set3(h->force_N, 0, 0, 0);
    const bool off = atomic_load(&h->stopped) || !atomic_load(&h->enabled);
    const double share = pal_device_fade_step(&h->fade, pal_device_time_s() >= h->warm_until_s);
    pal_scale3(h->given_N, off ? 0 : share, h->force_N);
    double theirs[3];
    hdapi_from_ours(theirs, h->given_N);
    hd.hdSetDoublev(HD_CURRENT_FORCE, theirs);
    hd.hdEndFrame(h->device);
    atomic_fetch_add(&h->n_frame, 1);
    for (unsigned i = 0, code; i < 16 && (code = hd.hdGetError().code); i++) {
        if (code >= HD_WARM_FIRST && code <= HD_WARM_LAST)
            h->warm_until_s = pal_device_time_s() + PAL_DEVICE_RETRY_S;
        else if (!h->error)
            h->error = -(int)code;
    }
    if (!end && !h->error) return HD_CALLBACK_CONTINUE;
    atomic_store(&h->ended, true);
    atomic_store(&h->abandoned, false);
    sem_post(&h->changed);
    return HD_CALLBACK_DONE;
}

/* waits for the end, at most 2 s; false: no frame has come meanwhile */
static bool hdapi_frames_come(hdapi_device *h)
{
    const unsigned before = atomic_load(&h->n_frame);
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_sec += (time_t)PAL_DEVICE_RETRY_S;
    while (!atomic_load(&h->ended))
        if (sem_clockwait(&h->changed, CLOCK_MONOTONIC, &until) && errno != EINTR)
            return atomic_load(&h->n_frame) != before;
    return true;
}

static int hdapi_run(void *handle, int (*tick)(void *), void *user)
{
    hdapi_device *h = handle;
    h->tick = tick, h->user = user;
    atomic_store(&h->ended, false);
    h->schedule = hd.hdScheduleAsynchronous(hdapi_on_frame, h, HD_PRIORITY_MAX);
    const unsigned code = hdapi_errors();
    if (code) return h->error = -(int)code;
    if (atomic_fetch_add(&hd_n_running, 1) == 0) hd.hdStartScheduler();
    /* from here on the library's thread has its errors, and ours, until it has ended */
    while (!atomic_load(&h->ended)) {
        if (hdapi_frames_come(h)) continue;
        /* the library hangs, and what is called in it would as well: it is left alone */
        atomic_store(&h->abandoned, true);
        return PAL_DEVICE_ERROR_SILENT;
    }
    hd.hdUnschedule(h->schedule);
    if (atomic_fetch_sub(&hd_n_running, 1) == 1) hd.hdStopScheduler();
    hdapi_errors();
    return h->error;
}

static int hdapi_read(void *handle, pal_dev_state *state)
{
    hdapi_device *h = handle;
    if (atomic_load(&h->abandoned)) return PAL_DEVICE_ERROR_SILENT;
    *state = h->state;
    return h->error ? h->error : h->reading;
}

static int hdapi_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    (void)torque_N_m, (void)grip;
    pal_copy3(((hdapi_device *)handle)->force_N, force_N);
    return 0;
}

static int hdapi_force_enable(void *handle, int on)
{
    hdapi_device *h = handle;
    atomic_store(&h->enabled, on != 0);
    if (on) atomic_store(&h->stopped, false);
    return 0;
}

static int hdapi_stop(void *handle)
{
    hdapi_device *h = handle;
    atomic_store(&h->stopped, true);
    return 0;
}

static void hdapi_close(void *handle)
{
    hdapi_device *h = handle;
    if (!h || atomic_load(&h->abandoned)) return; /* the thread of a library that hangs may still look at it */
    if (h->device != HD_INVALID_HANDLE) hd.hdDisableDevice(h->device);
    sem_destroy(&h->changed);
    free(h);
}

static const char *hdapi_strerror(void *handle, int error)
{
    hdapi_device *h = handle;
    if (!h) return "no memory for a device of libHD.so";
    if (error == PAL_DEVICE_ERROR_LIBRARY) return hd_library_text;
    const char *common = pal_device_error_text(error, h->what, h->text);
    if (common) return common;
    static const struct {
        int code;
        const char *text;
    } known[] = {
        {0x300, "fault of the device: switch it off and on"},
        {0x301, "another program holds it"},
        {0x302, "no communication: is it plugged in and on, and may you write to its port?"},
        {0x303, "its set-up does not fit: run the vendor's set-up program, and set GTDD_HOME to its folder"},
        {0x304, "the library has no timer"},
        {0x600, "the library has no licence"},
    };
    const char *meaning = hd.hdGetErrorString ? hd.hdGetErrorString((unsigned)-error) : "see HDAPI's list of errors";
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i].code == -error) meaning = known[i].text;
    snprintf(h->text, sizeof h->text, "%s: error 0x%x, %s", h->what, (unsigned)-error, meaning);
    return h->text;
}

static int hdapi_check(void *handle, int step, char *text, size_t n)
{
    int n_found = 0;
    for (int i = 0; i < HD_FUNCTION_COUNT; i++) n_found += *(void **)hd_function[i].address != NULL;
    if (!handle && step == 0) {
        const bool good = hdapi_load() == 0;
        snprintf(text, n, "library: %s", good ? pal_device_library_path(*(void **)&hd.hdInitDevice) : hd_library_text);
        return good ? 1 : -1;
    }
    if (!handle && step == 1) {
        snprintf(text, n, "functions: %d of %d", n_found, HD_FUNCTION_COUNT);
        return n_found == HD_FUNCTION_COUNT ? 1 : -1;
    }
    if (!handle && step == 2) {
        const char *home = getenv("GTDD_HOME");
        snprintf(text, n, "environment: GTDD_HOME %s", home ? home : "is not set: set it to the folder of the set-up");
        return home ? 1 : -1;
    }
    if (!handle && step == 3) {
        /* the Touch by USB is a serial port; others are not seen here */
        glob_t port = {0};
        (void)glob("/dev/ttyACM*", 0, NULL, &port);
        const bool none = port.gl_pathc == 0, may = none || access(port.gl_pathv[0], R_OK | W_OK) == 0;
        snprintf(text, n, "permissions: %s%s",
                 none ? "no /dev/ttyACM*, which is right for a device by Ethernet or FireWire" : port.gl_pathv[0],
                 may ? "" : " may not be written: add your user to the group dialout, then log in again");
        globfree(&port);
        return may ? 1 : -1;
    }
    if (handle && step == 0) {
        const unsigned status = hd.hdCheckCalibration ? hd.hdCheckCalibration() : HD_CALIBRATION_OK;
        if (status == HD_CALIBRATION_NEEDS_UPDATE && hd.hdUpdateCalibration && hd.hdCheckCalibrationStyle)
            hd.hdUpdateCalibration(hd.hdCheckCalibrationStyle());
        hdapi_errors();
        const bool good = status == HD_CALIBRATION_OK || status == HD_CALIBRATION_NEEDS_UPDATE;
        snprintf(text, n, "calibration: %s",
                 good ? "good" : "by hand: put the stylus into the inkwell, then start this again");
        return good ? 1 : -1;
    }
    return 0;
}

const pal_haptic_v1 *pal_device_hdapi(void)
{
    static const pal_haptic_v1 table = {.abi = PAL_HAPTIC_ABI,
                                        .size = sizeof table,
                                        .name = "hdapi",
                                        .probe = hdapi_probe,
                                        .open = hdapi_open,
                                        .read = hdapi_read,
                                        .write = hdapi_write,
                                        .run = hdapi_run,
                                        .force_enable = hdapi_force_enable,
                                        .stop = hdapi_stop,
                                        .close = hdapi_close,
                                        .strerror = hdapi_strerror,
                                        .reopen = hdapi_reopen,
                                        .check = hdapi_check};
    return &table;
}
