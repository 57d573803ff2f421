/* What explicit and implicit grasps share (grasp.h). */
#include "server/sim/contact/grasp.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"
#include "server/sim/core/blend.h"

double pal_grasp_reach_m(const pal_grasps *grasps, const pal_tool *tool)
{
    return grasps->asked_reach_m > 0 ? grasps->asked_reach_m : 2 * tool->radius_m;
}

double pal_grasp_stiffness_N_m(const pal_grasps *grasps, double reach_m)
{
    return grasps->asked_N_m > 0 ? grasps->asked_N_m : TISSUE_RATIO * grasps->young_Pa * reach_m;
}

void pal_grasp_mean(const pal_grasp *g, const double *p, double mean[3])
{
    pal_set3(mean, 0, 0, 0);
    for (int i = 0; i < g->n_node; i++) pal_axpy3(mean, g->weight[i], p + 3 * (size_t)g->node[i]);
}

void pal_grasp_add_force(const pal_grasp *g, const double force_N[3], double *to)
{
    for (int i = 0; i < g->n_node; i++) pal_axpy3(to + 3 * (size_t)g->node[i], g->weight[i], force_N);
}

double pal_grasp_max_weight(const pal_grasp *g)
{
    double max = 0;
    for (int i = 0; i < g->n_node; i++) max = fmax(max, g->weight[i]);
    return max;
}

/* sets the shift of a transferred grasp, so that the spring pulls as it did */
static void begin_transfer(pal_grasp *g, const pal_tool *tool, const pal_body *body, double k_N_m,
                           const double damper_N[3])
{
    pal_grasp_transfer *h = g->transfer;
    double y[3], at[3], hold[3], shift[3];
    pal_grasp_mean(g, body->d, y);
    pal_sub3(at, tool->last.position_m, body->offset_m);
    pal_quat_rotate(hold, tool->last.quat, g->offset);
    h->due = false;
    h->left_s = PAL_BLEND_GRASP_S;
    if (g->implicit && h->k_N_m > 0) {
        /* caps and the limit of the stretch shortened the spring: the shift keeps that */
        pal_quat_rotate(shift, tool->last.quat, h->hold);
        pal_sub3(shift, shift, hold);
        pal_add3(shift, shift, h->shift);
        pal_sub3(shift, shift, h->y);
        pal_axpy3(shift, -1 / h->k_N_m, h->force_N);
    } else {
        for (int c = 0; c < 3; c++) shift[c] = -at[c] - hold[c];
        pal_axpy3(shift, -1 / k_N_m, damper_N);
    }
    pal_add3(shift, shift, y);
    pal_axpy3(shift, 1 / k_N_m, h->force_N);
    if (!pal_finite3(shift)) pal_set3(shift, 0, 0, 0);
    pal_copy3(h->shift, shift);
    if (g->implicit) g->implicit->stretch_m = pal_norm3(h->force_N) / k_N_m;
}

void pal_grasp_find_goal(pal_grasp *g, const pal_tool *tool, const pal_step *step, double k_N_m,
                         const double damper_N[3], double goal[3])
{
    if (g->transfer && g->transfer->due && k_N_m > 0) begin_transfer(g, tool, step->body, k_N_m, damper_N);
    pal_quat_rotate(goal, tool->requested.quat, g->offset);
    pal_add3(goal, goal, tool->here_m), pal_sub3(goal, goal, step->body->offset_m);
    if (!g->transfer) return;
    pal_add3(goal, goal, g->transfer->shift);
    pal_scale3(g->transfer->shift, pal_blend_release(&g->transfer->left_s, step->dt_s), g->transfer->shift);
}

void pal_grasp_publish(pal_grasp *g, pal_tool *tool, double k_N_m, double c_Ns_m)
{
    double on_tissue[3], *k = &g->fit.k_N_m, *K = tool->grasp_k_N_m;
    pal_scale3(on_tissue, -1, g->force);
    pal_stiffness_fit_add(&g->fit, tool->here_m, on_tissue, tool->radius_m);
    *k = fmax(STIFFNESS_N_M.low, fmin(*k, k_N_m));
    tool->has_grasp = true;
    pal_copy3(tool->grasp_x0_m, tool->here_m);
    pal_copy3(tool->grasp_f0_N, g->force);
    K[1] = K[2] = K[4] = 0;
    K[0] = K[3] = K[5] = *k;
    if (pal_grasp_compliance_series(&g->compliance, k_N_m, K)) *k = fmax(STIFFNESS_N_M.low, (K[0] + K[3] + K[5]) / 3);
    /* the spring pulls at the tool's end of it, which turns with the tool */
    pal_quat_rotate(tool->grasp_arm_m, tool->requested.quat, g->offset);
    pal_sub3(tool->torque_Nm, tool->torque_Nm, g->torque_Nm);
    pal_cross3(g->torque_Nm, tool->grasp_arm_m, g->force);
    pal_add3(tool->torque_Nm, tool->torque_Nm, g->torque_Nm);
    tool->grasp_b_Ns_m = c_Ns_m * *k / fmax(k_N_m, STIFFNESS_N_M.low);
}
