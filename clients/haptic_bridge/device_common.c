#include "clients/haptic_bridge/device_common.h"
#include "clients/haptic_bridge/device_tuning.h"
#include "server/base/vec3.h"

#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

static const pal_clock *device_clock;

void pal_device_set_clock(const pal_clock *clock)
{
    device_clock = clock;
}

double pal_device_time_s(void)
{
    return 1e-9 * (double)pal_clock_now_ns(device_clock ? device_clock : &pal_clock_monotonic);
}

void *pal_device_library_load(const char *const *file, bool global, const pal_device_function *function, int n_function,
                              char *text, size_t n)
{
    void *library = NULL;
    const char *loaded = "";
    char other[PAL_DEVICE_TEXT] = "";
    int end = snprintf(text, n, "looked for");
    for (int i = 0; file[i] && !library; i++) {
        library = dlopen(file[i], RTLD_LAZY | (global ? RTLD_GLOBAL : RTLD_LOCAL));
        loaded = file[i];
        if (library) break;
        const char *why = dlerror();
        /* "FILE: cannot open" only means the next one; a library that is there and cannot be loaded is the news */
        if (!strstr(why, "cannot open shared object file") || strncmp(why, file[i], strlen(file[i])))
            snprintf(other, sizeof other, "%s cannot be loaded: %s", file[i], why);
        if (end >= 0 && (size_t)end < n) end += snprintf(text + end, n - (size_t)end, "%s %s", i ? "," : "", file[i]);
    }
    if (!library) {
        if (other[0])
            snprintf(text, n, "%s", other);
        else if (end >= 0 && (size_t)end < n)
            snprintf(text + end, n - (size_t)end, ": not there");
        return NULL;
    }
    for (int i = 0; i < n_function; i++) {
        void *address = dlsym(library, function[i].name);
        memcpy(function[i].address, &address, sizeof address);
        if (address || !function[i].required) continue;
        snprintf(text, n, "%s has no function %s: another version?", loaded, function[i].name);
        return NULL;
    }
    text[0] = 0;
    return library;
}

const char *pal_device_library_path(void *address)
{
    Dl_info info;
    return dladdr(address, &info) && info.dli_fname ? info.dli_fname : "?";
}

int pal_device_guard_pose(pal_device_guard *guard, const pal_dev_state *state, const double force_N[3])
{
    const double *q = state->quat;
    const double length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!pal_finite3(state->position_m) || !(length > 0 && length < INFINITY)) return PAL_DEVICE_ERROR_POSE;
    const bool moves = memcmp(guard->position_m, state->position_m, sizeof guard->position_m) ||
                       memcmp(guard->quat, q, sizeof guard->quat);
    const double now = pal_device_time_s();
    if (moves || pal_norm3(force_N) < PAL_DEVICE_FROZEN_FORCE_N) guard->since_s = now;
    memcpy(guard->position_m, state->position_m, sizeof guard->position_m);
    memcpy(guard->quat, q, sizeof guard->quat);
    return now - guard->since_s > PAL_DEVICE_FROZEN_S ? PAL_DEVICE_ERROR_FROZEN : 0;
}

double pal_device_fade_step(pal_device_fade *fade, bool on)
{
    const double now = pal_device_time_s(), dt = fade->last_s > 0 ? now - fade->last_s : 0;
    fade->last_s = now;
    fade->share += on ? dt / PAL_DEVICE_FADE_IN_S : -dt / PAL_DEVICE_FADE_OUT_S;
    return fade->share = fmin(fmax(fade->share, 0), 1);
}

const char *pal_device_error_text(int error, const char *what, char text[PAL_DEVICE_TEXT])
{
    const char *const sentence[] = {
        "ok",
        "memory is short",
        "the library is not usable",
        "there is no such device",
        "its pose is not a number",
        "its pose stands still under force (an encoder is frozen, or the handle is held fast)",
        "it has stopped answering",
    };
    if (error > 0) return "the device limits the force";
    if (error <= PAL_DEVICE_OWN || -error >= (int)(sizeof sentence / sizeof *sentence)) return NULL;
    snprintf(text, PAL_DEVICE_TEXT, "%s: %s", what, sentence[-error]);
    return text;
}

void pal_device_quat(double q[4], const double r[9])
{
    /* the largest of the four squares, so that no division is by a small number */
    const double trace = r[0] + r[4] + r[8];
    double square[4] = {1 + trace, 1 + 2 * r[0] - trace, 1 + 2 * r[4] - trace, 1 + 2 * r[8] - trace};
    int max = 0;
    for (int i = 1; i < 4; i++)
        if (square[i] > square[max]) max = i;
    const double s = sqrt(square[max] > 0 ? square[max] : 0), f = s > 0 ? 0.5 / s : 0;
    const double wx = r[7] - r[5], wy = r[2] - r[6], wz = r[3] - r[1];
    const double xy = r[1] + r[3], xz = r[2] + r[6], yz = r[5] + r[7];
    const double row[4][4] = {{0, wx, wy, wz}, {wx, 0, xy, xz}, {wy, xy, 0, yz}, {wz, xz, yz, 0}};
    for (int i = 0; i < 4; i++) q[i] = i == max ? 0.5 * s : f * row[max][i];
}
