/* Grasps with implicit solvers. Nothing limits k, c is 0 as the step itself damps, the solver takes the spring
 * implicitly, and the forces are those of the end of the sub-step. The spring stretches by at most GRASP_STRETCH
 * more than at the end of the last sub-step (a tool that jumps) and by no more than brings the force to 1 - FORCE_SHARE
 * of the caps once the tissue has followed, as far as its compliance is known, so that tissue follows a faster tool
 * late. Where caps leave less than the spring's force, it becomes a constant force and the solver solves once more. */
#include "server/base/vec3.h"
#include "server/sim/contact/grasp.h"
#include "server/sim/contact/tuning.h"

void pal_grasp_act_implicit(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step)
{
    const pal_body *body = step->body;
    pal_grasp_implicit *implicit = g->implicit;
    double y[3], goal[3], rise = GRASP_STRETCH * body->length_scale_m * (step->dt_s / FRAME_S);
    double k = tool->ramp * pal_grasp_stiffness_N_m(grasps, pal_grasp_reach_m(grasps, tool));
    implicit->k_N_m = k;
    pal_grasp_mean(g, body->d, y);
    pal_grasp_find_goal(g, tool, step, k, (double[3]){0}, goal);
    pal_sub3(goal, goal, y);
    double cap = tool->force_cap_N * tool->ramp, stretch = pal_norm3(goal);
    if (body->load_cap_N > 0) cap = fmin(cap, body->load_cap_N / pal_grasp_max_weight(g));
    double kept = fmin(implicit->stretch_m, (1 - FORCE_SHARE) * cap / k);
    double lead = pal_grasp_compliance_along(&g->compliance, k, fmin(k, g->fit.k_N_m), goal);
    const double by_cap_m = ((1 - FORCE_SHARE) * cap - k * kept) / lead, max_m = kept + fmin(rise, by_cap_m);
    implicit->capped = by_cap_m < rise && stretch > max_m;
    if (stretch > max_m) pal_scale3(goal, max_m / stretch, goal);
    implicit->pulls = pal_finite3(goal);
    implicit->constant = implicit->found = false;
    pal_set3(implicit->total_N, 0, 0, 0);
    pal_set3(g->force, 0, 0, 0);
    if (!implicit->pulls) return;
    pal_scale3(implicit->pull, k, goal);
    pal_copy3(implicit->load, implicit->pull);
    pal_grasp_add_force(g, implicit->load, body->load);
}

/* a spring, and no constant force, in this sub-step */
static bool is_spring(const pal_grasp *g)
{
    return g->closed && g->implicit->pulls && !g->implicit->constant;
}

int pal_grasp_mean_springs(const void *self, pal_mean_spring *out, int max)
{
    const pal_grasps *grasps = self;
    int n = 0;
    for (int t = 0; t < grasps->n_tool && n < max; t++) {
        const pal_grasp *g = &grasps->grasp[t];
        if (is_spring(g))
            out[n++] = (pal_mean_spring){.k_N_m = g->implicit->k_N_m,
                                         .n_node = g->n_node,
                                         .node = g->node,
                                         .weight = g->weight,
                                         .revision = g->revision};
    }
    return n;
}

void pal_grasp_multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    const pal_grasps *grasps = self;
    (void)body;
    for (int t = 0; t < grasps->n_tool; t++) {
        const pal_grasp *g = &grasps->grasp[t];
        if (!is_spring(g)) continue;
        double mean[3];
        pal_grasp_mean(g, p, mean);
        pal_scale3(mean, k * g->implicit->k_N_m, mean);
        pal_grasp_add_force(g, mean, out);
    }
}

/* the load after a stage; true: beyond a cap, it is a constant one from now on */
static bool keep_caps(pal_grasp *g, const pal_tool *tool, pal_body *body, const double *moved)
{
    pal_grasp_implicit *implicit = g->implicit;
    double mean[3], change[3];
    if (implicit->constant) return false;
    pal_grasp_mean(g, moved, mean);
    for (int c = 0; c < 3; c++) implicit->load[c] = implicit->pull[c] - implicit->k_N_m * mean[c];
    if (!pal_finite3(implicit->load)) pal_set3(implicit->load, 0, 0, 0);
    pal_scale3(g->force, -1, implicit->load);
    double share = pal_tool_force_share(body, tool, g->force, pal_grasp_max_weight(g) * pal_norm3(g->force));
    if (share >= 1) return false;
    pal_scale3(implicit->load, share, implicit->load);
    pal_sub3(change, implicit->load, implicit->pull);
    pal_grasp_add_force(g, change, body->load);
    implicit->constant = true;
    return true;
}

/* force of one tool after a stage; true: beyond a cap */
static bool settle_tool(pal_grasp *g, pal_tool *tool, pal_body *body, const double *moved)
{
    pal_grasp_implicit *implicit = g->implicit;
    pal_sub3(tool->force_N, tool->force_N, implicit->total_N);
    bool capped = keep_caps(g, tool, body, moved);
    pal_scale3(g->force, -1, implicit->load);
    /* the stretch that this force would keep */
    implicit->stretch_m = implicit->k_N_m > 0 ? pal_norm3(implicit->load) / implicit->k_N_m : 0;
    pal_copy3(implicit->total_N, g->force);
    pal_add3(tool->force_N, tool->force_N, g->force);
    tool->holding = true;
    return capped;
}

bool pal_grasp_settle_implicit(pal_grasps *grasps, pal_step *step, const double *moved, bool last)
{
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < grasps->n_tool ? tools->n_tool : grasps->n_tool;
    bool again = false;
    for (int t = 0; t < n_tool; t++) {
        pal_grasp *g = &grasps->grasp[t];
        pal_tool *tool = &tools->tool[t];
        if (!g->closed || !g->implicit->pulls) continue;
        again |= settle_tool(g, tool, step->body, moved);
        if (!last || step->sub != step->n_sub - 1) continue;
        pal_grasp_implicit *implicit = g->implicit;
        /* a grasp that was transferred leads as the one before from its second step on */
        const bool transferred = g->transfer && g->transfer->left_s > 0;
        int n_find = implicit->found ? 0 : transferred && g->compliance.n_known < 3 ? 3 : 1;
        implicit->found = true;
        /* else nobody asks for it */
        for (int k = 0; k < n_find && (tool->haptic || implicit->capped); k++)
            pal_grasp_compliance_update(&g->compliance, step->body, step->body->compliance, g->node, g->weight,
                                        g->n_node, tool->here_m, SHALLOW_RADII * tool->radius_m,
                                        tool->haptic ? FOLLOW_S : NO_HAPTICS_FOLLOW_S, step->dt_s * step->n_sub,
                                        step->scratch);
        pal_grasp_publish(g, tool, implicit->k_N_m, implicit->k_N_m * grasps->damping_s);
    }
    return again;
}
