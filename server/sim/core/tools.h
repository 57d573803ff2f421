/* Tools: poses in, forces and contact patches out. A tool is a sphere moved by one member. SI, scene frame. Forces are
 * those on the tool, and so on the hand; tissue receives the opposite. Thread: [sim]. */
#ifndef PAL_SIM_CORE_TOOLS_H
#define PAL_SIM_CORE_TOOLS_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum { PAL_TOOL_MAX = 8, PAL_CONTACT_PATCH_MAX = 4 };

/* pal_pose.buttons: the hand grasps; its client renders no haptic model, so that nobody feels the force */
enum { PAL_POSE_GRASP = 1, PAL_POSE_NO_HAPTICS = 2 };

/* pose of a tool as its client sends it */
typedef struct pal_pose {
    double position_m[3];
    double quat[4];         /* w x y z, unit */
    double velocity_m_s[3]; /* 0 when unknown */
    uint32_t buttons;       /* PAL_POSE_* */
    uint32_t seq;           /* client's count, echoed */
    uint64_t stamp_us;      /* client's clock, echoed */
    /* of the device, for status only: what it commanded at this pose, and the opening of its gripper, rad or m */
    bool commands_force;
    double force_N[3], opening;
} pal_pose;

/* Contact model for a haptic bridge, linearised at the tool: the plane of zero force in the configuration space of the
 * tool's centre, with F = n (k1 d + k2 d^2 - b n.v), d = n.(p - x) > 0 in contact. The bridge evaluates it at the rate
 * of its servo loop */
typedef struct pal_contact_patch {
    int16_t id, group;      /* id persists while the neighbourhood does; convex contacts share a group */
    double point_m[3];      /* p: zero-force surface                                                  */
    double normal[3];       /* n: outward unit                                                        */
    double velocity_m_s[3]; /* of the surface itself, not of the tool's own push                      */
    double k1_N_m, k2_N_m2; /* tangent stiffness and its slope                                        */
    double b_Ns_m;          /* damping                                                                */
    double kt_N_m;          /* tangential stiffness                                                   */
    double mu_static, mu_dynamic;
    double radius_m; /* validity                                                               */
} pal_contact_patch;

/* One tool during a step. here_m moves linearly from `last` to `requested` over the sub-steps, so that a fast tool
 * sweeps its path */
typedef struct pal_tool {
    double radius_m, force_cap_N;
    bool present; /* a member holds it                                              */
    double ramp;  /* 0 to 1, scales its forces: rises over PAL_BLEND_S once the tool appears, falls when it is
                     released */
    pal_pose requested, last; /* at the end of this step, of the last one */
    double here_m[3];         /* position at the end of the current sub-step                                  */
    double velocity_m_s[3];   /* of `here`                                                                    */
    double omega_rad_s[3];    /* from the orientation of the last step to this one's, for friction             */
    bool grasp;               /* PAL_POSE_GRASP of requested while present                                          */
    bool haptic;              /* a device renders its haptic models                                                 */
    double force_N[3];        /* on the tool, this sub-step; CONTACT components add                              */
    double mean_force_N[3];   /* mean over the step's sub-steps                                               */
    double torque_Nm[3];      /* of contacts and grasps about its centre, in the last sub-step; components add */
    bool grasped_before;      /* it held tissue in the last step: it does not push what it holds */
    bool touching, holding;   /* presses tissue, holds tissue in this step                                    */
    int n_patch;
    pal_contact_patch patch[PAL_CONTACT_PATCH_MAX]; /* written by CONTACT components in the last sub-step */
    bool has_grasp; /* bilateral part: f = f0 - k (x - x0) - b v                              */
    double grasp_x0_m[3], grasp_f0_N[3], grasp_k_N_m[6], grasp_b_Ns_m; /* k: xx xy xz yy yz zz                    */
    double grasp_arm_m[3]; /* from its centre to where f acts, turned with it: torque arm x f                    */
} pal_tool;

typedef struct pal_tools {
    int n_tool;
    pal_tool tool[PAL_TOOL_MAX];
} pal_tools;

/* is every number finite, the position within reach of limit_m, the velocity at most 1000 limit_m a second, the
 * quaternion near unit? (poses are untrusted) */
bool pal_pose_ok(const pal_pose *pose, double limit_m);
/* before a step: takes the requested pose (NULL: released) and updates the ramp; a tool that appears does not sweep its
 * path */
void pal_tool_begin_step(pal_tool *tool, const pal_pose *pose, double dt_s);
/* between steps: it has been at the pose for long, with its whole force; NULL: it has been away */
void pal_tool_place(pal_tool *tool, const pal_pose *pose);
/* before sub-step `sub` of `n_sub`: sets here_m and velocity, clears the force */
void pal_tools_begin_substep(pal_tools *tools, int sub, int n_sub, double dt_s);
/* after the step: mean force, last = requested */
void pal_tools_end_step(pal_tools *tools, int n_sub);
#endif
