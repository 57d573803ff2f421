/* Tool bookkeeping between poses and CONTACT rows. */
#include "server/sim/core/tools.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"

#include <string.h>

bool pal_pose_ok(const pal_pose *pose, double limit_m)
{
    double far2 = pal_dot3(pose->position_m, pose->position_m), quat2 = 0;
    double fast2 = pal_dot3(pose->velocity_m_s, pose->velocity_m_s);
    for (int c = 0; c < 4; c++) quat2 += pose->quat[c] * pose->quat[c];
    /* false of numbers that are not finite */
    return far2 <= limit_m * limit_m && fast2 <= 1e6 * limit_m * limit_m && quat2 > 0.9 && quat2 < 1.1;
}

/* the rotation q = requested * conjugate(last) about axis by angle: q = (cos, axis sin) of half of it */
static void find_omega(pal_tool *tool, double dt_s)
{
    const double *a = tool->requested.quat, *b = tool->last.quat;
    const double w = a[0] * b[0] + pal_dot3(a + 1, b + 1);
    double v[3];
    pal_cross3(v, b + 1, a + 1);
    for (int c = 0; c < 3; c++) v[c] = b[0] * a[c + 1] - a[0] * b[c + 1] + v[c];
    const double sine = pal_norm3(v);
    pal_scale3(tool->omega_rad_s, sine > 0 ? 2 * atan2(w < 0 ? -sine : sine, fabs(w)) / (sine * dt_s) : 0, v);
}

void pal_tool_begin_step(pal_tool *tool, const pal_pose *pose, double dt_s)
{
    if (pose) {
        tool->requested = *pose;
        /* a tool that appears is where it is: its way there touches nothing, and its forces begin at zero */
        if (!tool->present) {
            tool->ramp = 0;
            tool->last = *pose;
            memcpy(tool->here_m, pose->position_m, sizeof tool->here_m);
        }
    } else {
        /* a released tool stays where it is while its forces fade */
        tool->requested = tool->last;
    }
    tool->ramp = pal_blend_toward(tool->ramp, pose ? 1 : 0, dt_s, PAL_BLEND_S);
    tool->present = pose != NULL;
    tool->grasp = tool->present && (tool->requested.buttons & PAL_POSE_GRASP);
    tool->haptic = !(tool->requested.buttons & PAL_POSE_NO_HAPTICS);
    tool->grasped_before = tool->holding;
    tool->touching = tool->holding = false;
    tool->n_patch = 0;
    tool->has_grasp = false;
    memset(tool->grasp_arm_m, 0, sizeof tool->grasp_arm_m);
    for (int c = 0; c < 3; c++) tool->force_N[c] = tool->mean_force_N[c] = tool->torque_Nm[c] = 0;
    find_omega(tool, dt_s);
}

void pal_tool_place(pal_tool *tool, const pal_pose *pose)
{
    tool->present = pose != NULL;
    tool->ramp = tool->present;
    if (!pose) return;
    tool->requested = tool->last = *pose;
    memcpy(tool->here_m, pose->position_m, sizeof tool->here_m);
}

void pal_tools_begin_substep(pal_tools *tools, int sub, int n_sub, double dt_s)
{
    for (int t = 0; t < tools->n_tool; t++) {
        pal_tool *tool = &tools->tool[t];
        for (int c = 0; c < 3; c++) {
            /* the rest of the way in equal parts; the last part ends on the pose exactly */
            double from = tool->here_m[c], to = tool->requested.position_m[c];
            double here = sub >= n_sub - 1 ? to : from + (to - from) / (n_sub - sub);
            tool->velocity_m_s[c] = (here - from) / dt_s;
            tool->here_m[c] = here;
            tool->mean_force_N[c] += tool->force_N[c];
            tool->force_N[c] = 0;
        }
    }
}

void pal_tools_end_step(pal_tools *tools, int n_sub)
{
    for (int t = 0; t < tools->n_tool; t++) {
        pal_tool *tool = &tools->tool[t];
        for (int c = 0; c < 3; c++)
            tool->mean_force_N[c] = (tool->mean_force_N[c] + tool->force_N[c]) / (n_sub > 0 ? n_sub : 1);
        tool->last = tool->requested;
    }
}
