/* What the back ends of real devices share: libraries found at run time, the clock, one sentence for each error, and
 * the examination of a pose. Thread: as device.h has it. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_COMMON_H
#define PAL_HAPTIC_BRIDGE_DEVICE_COMMON_H
#include "clients/haptic_bridge/device.h"
#include "server/base/clock.h"

#include <stdbool.h>

/* errors that every back end may return beside those of its own, which are below PAL_DEVICE_OWN */
enum {
    PAL_DEVICE_ERROR_MEMORY = -1,
    PAL_DEVICE_ERROR_LIBRARY = -2,
    PAL_DEVICE_ERROR_NONE = -3, /* no such device */
    PAL_DEVICE_ERROR_POSE = -4, /* position or orientation is not a number */
    PAL_DEVICE_ERROR_FROZEN = -5,
    PAL_DEVICE_ERROR_SILENT = -6, /* the device or its library has stopped calling */
    PAL_DEVICE_OWN = -16
};
enum { PAL_DEVICE_TEXT = 256 };

/* time of all back ends of real devices; NULL: pal_clock_monotonic. Set before any is open (tests). [load] */
void pal_device_set_clock(const pal_clock *clock);
double pal_device_time_s(void);

/* One function of a library: the name and where its address goes. required: without it the library is not usable */
typedef struct pal_device_function {
    const char *name;
    void *address; /* of the pointer to the function; which is NULL when the library lacks it */
    bool required;
} pal_device_function;

/* Loads the first of `file` (ends with NULL; the linker's search path, or a path with a slash) and its functions.
 * NULL: none, text says what was looked for, or which function lacks. Never unloaded: libHD does not load twice, and
 * its threads may outlive a device. global: its symbols serve libraries loaded later. */
void *pal_device_library_load(const char *const *file, bool global, const pal_device_function *function, int n_function,
                              char *text, size_t n);
/* which file a loaded function stands in */
const char *pal_device_library_path(void *address);

/* A pose is good while it is finite, its quaternion has a length, and it moves: a hand cannot hold a handle so still
 * that all steps of the encoders stay the same for 3 s under more than 0.5 N. */
typedef struct pal_device_guard {
    double position_m[3], quat[4], since_s;
} pal_device_guard;
int pal_device_guard_pose(pal_device_guard *guard, const pal_dev_state *state, const double force_N[3]);

/* Share of the force that a device gives while it cannot give all: fades out and in at the rates of device_tuning.h, dt
 * by pal_device_time_s. {0} is none yet */
typedef struct pal_device_fade {
    double share, last_s;
} pal_device_fade;
double pal_device_fade_step(pal_device_fade *fade, bool on);

/* the sentence of a common error about `what`; NULL for an error of the back end's own */
const char *pal_device_error_text(int error, const char *what, char text[PAL_DEVICE_TEXT]);

/* w x y z of a rotation, row-major */
void pal_device_quat(double q[4], const double r[9]);
#endif
