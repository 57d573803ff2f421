/* The device in the world: x_w = origin + scale R (x_d - centre), q_w = R q_d q_h. While the clutch is held the world
 * pose stands still and centre and handle's turn follow the device. Velocities are filtered differences of the device's
 * pose. Soft walls stand at 95 % of the device's workspace. Thread: [servo]; no heap, no locks. */
#ifndef PAL_HAPTIC_BRIDGE_WORKSPACE_H
#define PAL_HAPTIC_BRIDGE_WORKSPACE_H
#include "clients/haptic_bridge/device.h"

#include <stdbool.h>

/* how device and world lie to each other */
typedef struct pal_workspace_frame {
    double origin_m[3]; /* world position of the workspace's centre */
    double rotation[9]; /* device axes to world, row-major; a proper rotation */
    double scale;       /* world metres per device metre */
} pal_workspace_frame;

/* rotation whose device axis z (up) is up, a unit vector; x, to the user, and y, to the right, are level */
void pal_workspace_rotation(const double up[3], double rotation[9]);
void pal_workspace_quat(const double rotation[9], double q[4]); /* w x y z of a rotation */

typedef struct pal_workspace {
    pal_workspace_frame frame; /* set by the caller, then pal_workspace_restart */
    double frame_quat[4];      /* of its rotation */
    double centre_m[3];        /* device axes */
    double handle_quat[4];     /* tool to handle: what the handle was turned by while the clutch was held */
    bool known, clutched;
    /* at the newest pose; step and turn since the one before */
    double x_d[3], step_d[3], turn_d[3], v_d[3], omega_d[3], quat_d[4];
    double x_w[3], v_w[3], omega_w[3], quat_w[4];
} pal_workspace;

/* after the frame has changed: the next pose is the first one */
void pal_workspace_restart(pal_workspace *w);
/* takes the pose of the device after dt_s. hold: whether the clutch is held */
void pal_workspace_move(pal_workspace *w, const pal_dev_state *state, bool hold, double dt_s);
void pal_workspace_to_device(const pal_workspace *w, const double world[3], double device[3]); /* directions */
void pal_workspace_to_world(const pal_workspace *w, const double device[3], double world[3]);
/* force and energy of the walls at the newest pose, device axes; false: within them */
bool pal_workspace_walls(const pal_workspace *w, const pal_dev_info *info, double damping_floor_s, double force_N[3],
                         double *energy_J);
#endif
