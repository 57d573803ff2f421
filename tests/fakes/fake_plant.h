/* What the fakes of device libraries share: the plant and hand of the virtual device (clients/haptic_bridge), faults,
 * and the control that a test has over them. A fake is loaded by the bridge as the library that it stands for; a test
 * finds it again by dlopen(name, RTLD_NOLOAD) and the function fake_entry.
 *
 * Faults come from the environment, PAL_FAKE="name=number,...", or from the control's set, by name:
 *   init       error code of the next attempts to open           (0: none)
 *   error_at   frame from which the library reports an error, `error` is its code (HDAPI: 0x302; DHD: 2)
 *   stall_at   frame at which the library stops calling or answering, until it is 0 again
 *   frozen_at  frame from which the encoders stand still
 *   nan_at     frame from which the position is not a number
 *   warm_at    frame at which the motors are warm, for one frame
 *   unplugged  1: no device
 *   status     ints that dhdGetStatus writes                     (16)
 *   buttons    bits                                              (0)
 *   wall       1: frames come by the clock on the wall, 1,000 a second; else when the test calls for them
 *   force_off  1: the user has switched the forces off at the device (DHD)
 * PAL_FAKE_DEVICE is the id of the virtual device ("touch,script=still"). */
#ifndef TESTS_FAKES_FAKE_PLANT_H
#define TESTS_FAKES_FAKE_PLANT_H
#include <stdbool.h>

enum {
    FAKE_INIT,
    FAKE_ERROR_AT,
    FAKE_ERROR,
    FAKE_STALL_AT,
    FAKE_FROZEN_AT,
    FAKE_NAN_AT,
    FAKE_WARM_AT,
    FAKE_UNPLUGGED,
    FAKE_STATUS,
    FAKE_BUTTONS,
    FAKE_WALL,
    FAKE_FORCE_OFF,
    FAKE_COUNT
};

typedef struct fake_control {
    void (*begin)(const char *device, const char *faults); /* a new plant; NULL: of the environment */
    void (*set)(int fault, long value);
    void (*set_in)(int fault, long frames); /* the number of the frame that is so far away */
    void (*frames)(int n); /* n frames, in their own thread where the library has one; waits for them */
    void (*settle)(void);  /* waits until the library's thread has nobody to call; NULL: it has no thread */
    long (*frame)(void);   /* frames so far */
    void (*place)(const double position_m[3]);
    void (*push)(const double force_N[3]);
    /* exact position, and the force of the motors; x to the user, y right, z up */
    void (*truth)(double position_m[3], double force_N[3]);
    void (*written)(double force_N[3]); /* what was written last, in the library's own axes */
} fake_control;
const fake_control *fake_entry(void);

/* for the fakes themselves: any thread */
void fake_begin(void); /* the plant, when there is none yet */
long fake_value(int fault);
bool fake_due(int fault); /* the frame of this fault has come */
void fake_read(double position_m[3]);
/* one frame of dt under this force; `library`: the same in the library's own axes */
void fake_step(double dt_s, const double force_N[3], const double library_N[3]);
void fake_wait(void (*leave)(void), void (*enter)(void)); /* waits while a stall is due */
/* the control of a fake; wake, which may be NULL, is called after each set, so that nobody waits in vain */
fake_control *fake_common(void (*frames)(int n), void (*wake)(void));
#endif
