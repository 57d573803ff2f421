/* Grasps with explicit solvers. Where the solver takes the stiffness of loads implicitly, k and c are what the scene
 * says, and row sums (k + c/dt) W_i go to it; the tool is told the force at the end of the sub-step, as by contacts
 * (push_explicit.c). Elsewhere they are kept below the limits alpha m_i / dt^2 and alpha m_i /
 * dt of every free node, m_i being shared by the tools that hold it; where nodes are interpolated, alpha times what the
 * tissue held weighs at least. */
#include "server/base/vec3.h"
#include "server/sim/contact/grasp.h"
#include "server/sim/contact/tuning.h"

/* least mass that the spring moves. Of interpolated nodes: W' C W <= sum W_i C_ii, C their mobility */
static double min_mass_kg(const pal_grasps *grasps, const pal_grasp *g, const pal_body *body)
{
    double mass = INFINITY, mobility = 0;
    for (int i = 0; i < g->n_node; i++) {
        const int node = g->node[i];
        if (body->interpolation)
            mobility += grasps->sum_weight[node] * pal_body_inverse_mass_1_kg(body, node);
        else if (!body->support[node])
            mass = fmin(mass, body->mass_kg[node] / grasps->sum_weight[node]);
    }
    return mobility > 0 ? 1 / mobility : mass;
}

/* for a haptic bridge, in the last sub-step */
static void publish(pal_grasp *g, pal_tool *tool, pal_step *step, double k, double c)
{
    const pal_body *body = step->body;
    if (step->sub != step->n_sub - 1) return;
    if (!body->frozen && tool->haptic)
        pal_grasp_compliance_update(&g->compliance, body, body->compliance, g->node, g->weight, g->n_node, tool->here_m,
                                    SHALLOW_RADII * tool->radius_m, FOLLOW_S, step->dt_s * step->n_sub, step->scratch);
    pal_grasp_publish(g, tool, k, c);
}

void pal_grasp_act_explicit(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double y[3], v[3], goal[3], damper[3], scaled[3];

    pal_grasp_mean(g, body->d, y);
    pal_grasp_mean(g, body->dv, v);
    double k = pal_grasp_stiffness_N_m(grasps, pal_grasp_reach_m(grasps, tool)), c = k * grasps->damping_s;
    g->row_sum_N_m = 0;
    if (!body->load_stiffness) {
        const double limit_kg = GRASP_SHARE * min_mass_kg(grasps, g, body);
        k = fmin(k, limit_kg / (step->dt_s * step->dt_s));
        c = fmin(k * grasps->damping_s, limit_kg / step->dt_s);
    }
    for (int d = 0; d < 3; d++) damper[d] = c * (tool->velocity_m_s[d] - v[d]), scaled[d] = tool->ramp * damper[d];
    pal_grasp_find_goal(g, tool, step, tool->ramp * k, scaled, goal);
    if (g->adaptive) pal_adaptive_grasp_goal(g->adaptive, tool->requested.quat, y, v, k, step->dt_s, goal);
    /* the tissue is where it is at the begin of the sub-step, so the tool is too */
    if (body->load_stiffness) pal_axpy3(goal, -step->dt_s, tool->velocity_m_s);
    for (int d = 0; d < 3; d++) g->force[d] = -tool->ramp * (k * (goal[d] - y[d]) + damper[d]);
    if (!pal_finite3(g->force)) {
        pal_set3(g->force, 0, 0, 0);
        return;
    }
    double max_node_N = pal_grasp_max_weight(g) * pal_norm3(g->force), on_tissue[3];
    const double share = pal_tool_force_share(body, tool, g->force, max_node_N);
    if (body->load_stiffness) g->row_sum_N_m = share * tool->ramp * (k + c / step->dt_s);
    for (int i = 0; i < g->n_node && body->load_stiffness; i++)
        body->load_stiffness[g->node[i]] += g->row_sum_N_m * g->weight[i];
    pal_scale3(g->force, share, g->force);
    pal_scale3(on_tissue, -1, g->force);
    pal_grasp_add_force(g, on_tissue, body->load);
    pal_add3(tool->force_N, tool->force_N, g->force);
    tool->holding = true;
    if (!body->load_stiffness) publish(g, tool, step, k, c);
}

/* the force at the end: what the nodes received, as of contacts (push_explicit.c) */
static void settle_tool(pal_grasp *g, pal_tool *tool, pal_step *step, const double *moved)
{
    double less[3];
    pal_grasp_mean(g, moved, less);
    pal_scale3(less, g->row_sum_N_m, less);
    if (!pal_finite3(less)) return;
    for (int i = 0; i < g->n_node; i++) {
        const size_t at = 3 * (size_t)g->node[i];
        pal_axpy3(step->body->load + at, -g->row_sum_N_m * g->weight[i], moved + at);
    }
    const double share = pal_tool_force_share(step->body, tool, less, 0);
    pal_axpy3(g->force, share, less);
    pal_axpy3(tool->force_N, share, less);
}

bool pal_grasp_settle_explicit(pal_grasps *grasps, pal_step *step, const double *moved, bool last)
{
    pal_tools *tools = step->tools;
    const int n_tool = tools->n_tool < grasps->n_tool ? tools->n_tool : grasps->n_tool;
    for (int t = 0; t < n_tool && last; t++) {
        if (!grasps->grasp[t].closed) continue;
        const double k = pal_grasp_stiffness_N_m(grasps, pal_grasp_reach_m(grasps, &tools->tool[t]));
        settle_tool(&grasps->grasp[t], &tools->tool[t], step, moved);
        publish(&grasps->grasp[t], &tools->tool[t], step, k, k * grasps->damping_s);
    }
    return false;
}
