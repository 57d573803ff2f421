/* The back-end interface of the bridge, and the C ABI of a plug-in: a shared object that exports the function
 * `const pal_haptic_v1 *pal_haptic_entry(void)`. Every back end implements this table.
 *
 * Units: m, m/s, N, N m, s. Device axes: x to the user, y right, z up; origin at the centre of its workspace. Return
 * values: 0 ok, > 0 warning, < 0 error (text from strerror). Thread: probe, open, reopen, close, check, force_enable
 * [load]; run, read and write [servo]; stop [any], async-signal-safe; strerror: the thread that got the error. Between
 * open and close [servo] calls reopen, while there are no ticks. */
#ifndef PAL_HAPTIC_BRIDGE_DEVICE_H
#define PAL_HAPTIC_BRIDGE_DEVICE_H
#include <stddef.h>
#include <stdint.h>

#define PAL_HAPTIC_ABI 1

enum { PAL_DEVICE_POLLED = 0, PAL_DEVICE_CALLBACK = 1, PAL_DEVICE_REQUEST_REPLY = 2 }; /* thread_model */
enum { PAL_DEVICE_BUTTON_GRASP = 1, PAL_DEVICE_BUTTON_CLUTCH = 2, PAL_DEVICE_BUTTON_DEADMAN = 1 << 30 };

typedef struct pal_dev_info {
    uint32_t size; /* sizeof of the caller's struct */
    char name[64];
    double peak_N, continuous_N; /* maximum force, peak and continuous */
    double stiffness_max_N_m;    /* largest contact stiffness rendered stably */
    double damping_max_Ns_m;
    double low_m[3], high_m[3]; /* workspace bounds */
    int32_t dof_in, dof_out;
    int32_t pose_only; /* 1: no force                                       */
    int32_t thread_model;
} pal_dev_info;

typedef struct pal_dev_state {
    uint32_t size;
    uint32_t buttons; /* PAL_DEVICE_BUTTON_*                                          */
    double position_m[3];
    double quat[4];           /* w x y z, handle to device                                    */
    double grip;              /* gripper opening, rad or m */
    uint64_t stamp_us;        /* device clock */
    double motor_temperature; /* fraction of the limit; 0: unknown */
    int32_t has_force;        /* 1: force_N is what the device gives, less than written where it limits or filters */
    double force_N[3];
} pal_dev_state;

typedef struct pal_haptic_v1 {
    uint32_t abi, size;                   /* PAL_HAPTIC_ABI, sizeof of this table */
    const char *name;                     /* "virtual"                              */
    int (*probe)(char *reason, size_t n); /* returns the number of devices, or < 0; both with a sentence in `reason` */
    /* id: the text after "name:". < 0: *handle may be set all the same, for strerror, and is to be closed then */
    int (*open)(void **handle, const char *id, pal_dev_info *out);
    int (*read)(void *handle, pal_dev_state *state);
    int (*write)(void *handle, const double force_N[3], const double torque_N_m[3], double grip);
    /* Devices that are not polled (thread_model): calls tick at the pace of the device, from whichever thread, which
     * reads and writes once, until it returns other than 0. < 0: the device is lost, and read fails until reopen; so
     * it is when no tick has come for 2 s. */
    int (*run)(void *handle, int (*tick)(void *), void *user);
    int (*force_enable)(void *handle, int on);
    int (*stop)(void *handle); /* zero force and brake, until force_enable */
    void (*close)(void *handle);
    const char *(*strerror)(void *handle, int error); /* one sentence */
    /* the rest may be NULL, or missing from the table of a plug-in (size) */
    int (*reopen)(void *handle); /* connects a lost device again; < 0: not yet */
    /* Step 0, 1, ... of an examination, first with a NULL handle, then with an open one: 1 good, 0 no more steps, -1
     * not good. text: "library: what was found, or what to do" */
    int (*check)(void *handle, int step, char *text, size_t n);
} pal_haptic_v1;

/* back ends of this build; NULL beyond the last */
const pal_haptic_v1 *pal_device_backend(int index);
/* finds a back end by name of n_name bytes; NULL: none */
const pal_haptic_v1 *pal_device_find(const char *name, size_t n_name);
#endif
