/* libHD.so: HDAPI's functions over the fake plant. Its scheduler is a thread of 1,000 frames a second, or of as many as
 * the test calls for. What a program may not do is an error here as well: a force outside of a frame, a frame in a
 * frame. -D FAKE_WITHOUT_STOP leaves a function out. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "tests/fakes/fake_plant.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>

typedef struct error_info {
    unsigned code;
    int internal;
    unsigned device;
} error_info;
typedef unsigned (*callback)(void *user);
enum { CALLBACKS = 4, BAD_HANDLE = -1 };

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static pthread_t thread;
static bool running, stopping, stalled, in_frame;
static int n_wanted;
static struct {
    callback call;
    void *user;
} scheduled[CALLBACKS];
static _Atomic unsigned pending; /* one error, of all threads */
static double force_hd[3];

#define EXPORT __attribute__((visibility("default")))
EXPORT unsigned hdInitDevice(const char *name);
EXPORT void hdDisableDevice(unsigned device);
EXPORT void hdMakeCurrentDevice(unsigned device);
EXPORT void hdBeginFrame(unsigned device);
EXPORT void hdEndFrame(unsigned device);
EXPORT error_info hdGetError(void);
EXPORT void hdEnable(unsigned what);
EXPORT void hdGetIntegerv(unsigned what, int *out);
EXPORT void hdGetDoublev(unsigned what, double *out);
EXPORT void hdSetDoublev(unsigned what, const double *in);
EXPORT const char *hdGetString(unsigned what);
EXPORT const char *hdGetErrorString(unsigned code);
EXPORT unsigned hdCheckCalibration(void);
EXPORT unsigned long hdScheduleAsynchronous(callback call, void *user, unsigned short priority);
EXPORT void hdUnschedule(unsigned long handle);
EXPORT void hdStartScheduler(void);
EXPORT void hdStopScheduler(void);
EXPORT const fake_control *fake_entry(void);

static void raise_error(unsigned code)
{
    unsigned none = 0;
    atomic_compare_exchange_strong(&pending, &none, code);
}

unsigned hdInitDevice(const char *name)
{
    fake_begin();
    const long failed = fake_value(FAKE_UNPLUGGED) ? 0x302 : fake_value(FAKE_INIT);
    if (failed) raise_error((unsigned)failed);
    if (name && strcmp(name, "Left")) raise_error(0x104); /* a set-up with the default device and one more */
    return pending ? (unsigned)BAD_HANDLE : 0;
}
void hdDisableDevice(unsigned device)
{
    (void)device;
}
void hdMakeCurrentDevice(unsigned device)
{
    if (device) raise_error(0x104);
}
void hdBeginFrame(unsigned device)
{
    (void)device;
    if (in_frame) raise_error(0x400);
    in_frame = true;
}
void hdEndFrame(unsigned device)
{
    (void)device;
    if (!in_frame) raise_error(0x401);
    in_frame = false;
    const double ours[3] = {force_hd[2], force_hd[0], force_hd[1]};
    fake_step(1e-3, ours, force_hd);
    pal_set3(force_hd, 0, 0, 0); /* a frame without a force has none */
    if (fake_value(FAKE_UNPLUGGED)) raise_error(0x302);
    if (fake_due(FAKE_ERROR_AT)) raise_error((unsigned)fake_value(FAKE_ERROR));
    if (fake_due(FAKE_WARM_AT)) {
        raise_error(0x200);
        fake_entry()->set(FAKE_WARM_AT, 0);
    }
}
error_info hdGetError(void)
{
    return (error_info){.code = atomic_exchange(&pending, 0)};
}
void hdEnable(unsigned what)
{
    if (what < 0x4000 || what > 0x4004) raise_error(0x100);
}
void hdGetIntegerv(unsigned what, int *out)
{
    if (what == 0x2000)
        *out = (int)fake_value(FAKE_BUTTONS);
    else
        raise_error(0x100);
}
void hdGetDoublev(unsigned what, double *out)
{
    double at[3];
    /* turned by 90 degrees about its y axis, up: its z (to the user) is the handle's x */
    static const double turned[16] = {0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1};
    static const double box[6] = {-160, -70, -40, 160, 130, 40};
    switch (what) {
    case 0x2052:
        if (!in_frame) raise_error(0x402);
        memcpy(out, turned, sizeof turned);
        fake_read(at);
        /* the plant's middle is that of the box, its x to the user is z here */
        out[12] = 1e3 * at[1], out[13] = 1e3 * at[2] + 30, out[14] = 1e3 * at[0];
        break;
    case 0x2551:
        memcpy(out, box, sizeof box);
        break;
    case 0x2602:
        *out = 0.5;
        break; /* N/mm */
    case 0x2603:
        *out = 3.3;
        break;
    case 0x2604:
        *out = 0.88;
        break;
    case 0x2605:
        pal_set3(out, 0.1, 0.4, 0.2);
        break;
    default:
        raise_error(0x100);
    }
}
void hdSetDoublev(unsigned what, const double *in)
{
    if (what != 0x2700) raise_error(0x100);
    if (!in_frame) raise_error(0x402);
    pal_copy3(force_hd, in);
}
const char *hdGetString(unsigned what)
{
    if (what == 0x2501) return "Fake Touch";
    raise_error(0x100);
    return NULL;
}
const char *hdGetErrorString(unsigned code)
{
    return code == 0x302 ? "HD_COMM_ERROR" : "fake error";
}
unsigned hdCheckCalibration(void)
{
    return 0x5000;
}

unsigned long hdScheduleAsynchronous(callback call, void *user, unsigned short priority)
{
    (void)priority;
    pthread_mutex_lock(&lock);
    unsigned long k = 0;
    while (k < CALLBACKS && scheduled[k].call) k++;
    if (k < CALLBACKS)
        scheduled[k].call = call, scheduled[k].user = user;
    else
        raise_error(0x501);
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
    return k;
}
void hdUnschedule(unsigned long handle)
{
    pthread_mutex_lock(&lock);
    if (handle < CALLBACKS) scheduled[handle].call = NULL;
    pthread_mutex_unlock(&lock);
}

/* both with the lock */
static bool has_callback(void)
{
    for (int k = 0; k < CALLBACKS; k++)
        if (scheduled[k].call) return true;
    return false;
}
static void one_frame(void)
{
    for (int k = 0; k < CALLBACKS; k++) {
        const callback call = scheduled[k].call;
        void *user = scheduled[k].user;
        if (!call) continue;
        pthread_mutex_unlock(&lock);
        const bool done = call(user) == 0;
        pthread_mutex_lock(&lock);
        if (done && scheduled[k].call == call) scheduled[k].call = NULL;
    }
}

static void leave(void)
{
    stalled = true;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}
static void enter(void)
{
    pthread_mutex_lock(&lock);
    stalled = false;
    pthread_cond_broadcast(&changed);
}

static void *schedule(void *user)
{
    (void)user;
    pthread_mutex_lock(&lock);
    while (!stopping) {
        if (fake_value(FAKE_WALL)) {
            pthread_mutex_unlock(&lock);
            pal_clock_sleep_until_ns(pal_clock_ns() + 1000000);
            pthread_mutex_lock(&lock);
        } else if (n_wanted == 0 || !has_callback()) {
            pthread_cond_broadcast(&changed);
            pthread_cond_wait(&changed, &lock);
            continue;
        } else
            n_wanted--;
        fake_wait(leave, enter);
        one_frame();
    }
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
    return NULL;
}

void hdStartScheduler(void)
{
    if (running) raise_error(0x102);
    pthread_mutex_lock(&lock);
    stopping = false;
    pthread_mutex_unlock(&lock);
    if (!running) running = pthread_create(&thread, NULL, schedule, NULL) == 0;
}
#ifndef FAKE_WITHOUT_STOP
void hdStopScheduler(void)
{
    pthread_mutex_lock(&lock);
    stopping = true;
    n_wanted = 0;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
    if (running) pthread_join(thread, NULL);
    running = false;
}
#endif

/* waits until somebody wants to be called, then until the frames are over or nobody wants them any more */
static void frames(int n)
{
    pthread_mutex_lock(&lock);
    while (!has_callback()) pthread_cond_wait(&changed, &lock);
    n_wanted = n;
    pthread_cond_broadcast(&changed);
    const long end = fake_entry()->frame() + n;
    while (!fake_value(FAKE_WALL) && !(stalled && fake_due(FAKE_STALL_AT)) && !stopping && has_callback() &&
           (n_wanted > 0 || fake_entry()->frame() < end))
        pthread_cond_wait(&changed, &lock);
    n_wanted = 0;
    pthread_mutex_unlock(&lock);
}

static void settle(void)
{
    pthread_mutex_lock(&lock);
    while (has_callback()) pthread_cond_wait(&changed, &lock);
    pthread_mutex_unlock(&lock);
}

static void wake(void)
{
    pthread_mutex_lock(&lock);
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}

const fake_control *fake_entry(void)
{
    static fake_control *control;
    if (!control) {
        control = fake_common(frames, wake);
        control->settle = settle;
    }
    return control;
}
