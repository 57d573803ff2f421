#include "tests/fakes/fake_plant.h"
#include "clients/haptic_bridge/device_virtual.h"
#include "server/base/vec3.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const fault_name[] = {"init",    "error_at",  "error",  "stall_at", "frozen_at", "nan_at",
                                         "warm_at", "unplugged", "status", "buttons",  "wall",      "force_off"};
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static void *plant;
static long value[FAKE_COUNT], n_frame;
static void (*wake_fake)(void);
static double library_force_N[3], last_m[3];

static void begin(const char *device, const char *faults)
{
    pthread_mutex_lock(&lock);
    const pal_haptic_v1 *virtual = pal_device_virtual();
    char id[256];
    pal_dev_info info;
    if (!device) device = getenv("PAL_FAKE_DEVICE");
    if (!faults) faults = getenv("PAL_FAKE");
    snprintf(id, sizeof id, "%s,clock=virtual", device ? device : "touch,script=still");
    if (plant) virtual->close(plant);
    if (virtual->open(&plant, id, &info)) {
        fprintf(stderr, "fake: no virtual device \"%s\"\n", id);
        abort();
    }
    virtual->force_enable(plant, 1);
    n_frame = 0;
    memset(value, 0, sizeof value);
    value[FAKE_STATUS] = 16;
    char text[256] = "", *rest = NULL;
    if (faults) snprintf(text, sizeof text, "%s", faults);
    for (char *word = strtok_r(text, ",", &rest); word; word = strtok_r(NULL, ",", &rest)) {
        const size_t n = strcspn(word, "=");
        int known = 0;
        for (int i = 0; i < FAKE_COUNT; i++)
            if (strlen(fault_name[i]) == n && !strncmp(word, fault_name[i], n) && word[n])
                value[i] = strtol(word + n + 1, NULL, 0), known = 1;
        if (known) continue;
        fprintf(stderr, "fake: no fault \"%s\"\n", word);
        abort();
    }
    pthread_mutex_unlock(&lock);
}

void fake_begin(void)
{
    if (!plant) begin(NULL, NULL);
}

long fake_value(int fault)
{
    pthread_mutex_lock(&lock);
    const long v = value[fault];
    pthread_mutex_unlock(&lock);
    return v;
}

bool fake_due(int fault)
{
    pthread_mutex_lock(&lock);
    const bool due = value[fault] > 0 && n_frame >= value[fault];
    pthread_mutex_unlock(&lock);
    return due;
}

static void set(int fault, long v)
{
    pthread_mutex_lock(&lock);
    value[fault] = v;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
    if (wake_fake) wake_fake();
}
static long frame(void)
{
    pthread_mutex_lock(&lock);
    const long n = n_frame;
    pthread_mutex_unlock(&lock);
    return n;
}
static void set_in(int fault, long frames)
{
    set(fault, frame() + frames);
}

void fake_wait(void (*leave)(void), void (*enter)(void))
{
    if (!fake_due(FAKE_STALL_AT)) return;
    leave();
    pthread_mutex_lock(&lock);
    while (value[FAKE_STALL_AT] > 0) pthread_cond_wait(&changed, &lock);
    pthread_mutex_unlock(&lock);
    enter();
}

void fake_read(double position_m[3])
{
    pal_dev_state state;
    const bool frozen = fake_due(FAKE_FROZEN_AT), broken = fake_due(FAKE_NAN_AT);
    pthread_mutex_lock(&lock);
    pal_device_virtual()->read(plant, &state);
    if (!frozen) pal_copy3(last_m, state.position_m);
    pal_copy3(position_m, last_m);
    if (broken) position_m[1] = NAN;
    pthread_mutex_unlock(&lock);
}

void fake_step(double dt_s, const double force_N[3], const double library_N[3])
{
    const double none[3] = {0, 0, 0};
    pthread_mutex_lock(&lock);
    pal_device_virtual()->write(plant, force_N, none, 0);
    pal_copy3(library_force_N, library_N);
    pal_virtual_advance(plant, dt_s);
    n_frame++;
    pthread_mutex_unlock(&lock);
}

static void place(const double position_m[3])
{
    pthread_mutex_lock(&lock);
    pal_virtual_place(plant, position_m);
    pthread_mutex_unlock(&lock);
}
static void push(const double force_N[3])
{
    pthread_mutex_lock(&lock);
    pal_virtual_push(plant, force_N);
    pthread_mutex_unlock(&lock);
}
static void truth(double position_m[3], double force_N[3])
{
    pthread_mutex_lock(&lock);
    pal_virtual_truth(plant, position_m, NULL, force_N);
    pthread_mutex_unlock(&lock);
}
static void written(double force_N[3])
{
    pthread_mutex_lock(&lock);
    pal_copy3(force_N, library_force_N);
    pthread_mutex_unlock(&lock);
}

fake_control *fake_common(void (*frames)(int n), void (*wake)(void))
{
    wake_fake = wake;
    static fake_control control;
    control = (fake_control){.begin = begin,
                             .set = set,
                             .set_in = set_in,
                             .frames = frames,
                             .frame = frame,
                             .place = place,
                             .push = push,
                             .truth = truth,
                             .written = written};
    return &control;
}
