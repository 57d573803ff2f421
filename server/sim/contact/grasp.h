/* Grasps: damped springs between tools and the tissue that they closed on (effects/tool_grasp.c).
 *
 * A grasp holds nodes i with weights W_i, sum 1, whose mean is y = sum W_i x_i. With o = y - tool when it closed,
 * turned with the tool since, F = k (tool + o - y) - c v_rel,   node i gets W_i F, the tool gets -F, so nothing jumps
 * when it closes, and force and torque balance about y. The regime is chosen at load by the solver: explicit, within
 * the limits of its sub-steps (grasp_explicit.c), or implicit (grasp_implicit.c). Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_GRASP_H
#define PAL_SIM_CONTACT_GRASP_H
#include "server/sim/contact/grasp_transfer.h"
#include "server/sim/contact/haptic_stiffness.h"
#include "server/sim/contact/stiffness_fit.h"
#include "server/sim/contact/tool_force.h"
#include "server/sim/core/effect.h"
#include "server/sim/surface/adaptive_grasp.h"

/* what a grasp needs beside with an implicit solver */
typedef struct pal_grasp_implicit {
    bool pulls, constant;   /* in this sub-step; the load stays as it is whatever tissue does              */
    bool found;             /* compliance was looked for in this sub-step                                  */
    pal_solved_force force; /* on the tool                                                                 */
    double k_N_m, pull[3];  /* at the sub-step's begin: stiffness, force of the spring on tissue           */
    double load[3];         /* force on tissue in body->load                                               */
    double stretch_m;       /* at the end of the last sub-step                                             */
    pal_grasp_compliance compliance;
} pal_grasp_implicit;

/* the grasp of one tool */
typedef struct pal_grasp {
    bool closed, button; /* has tissue; button in the last step      */
    bool by_vertex;      /* share is that of the tissue              */
    int n_node;
    int32_t *node;                /* [n_node]                                                                   */
    double *weight;               /* sum 1 [n_node]                                                             */
    uint16_t *share;              /* of each shown vertex, PAL_GRASP_WHOLE: 1                       [n_shown]   */
    double quat[4], at_m[3];      /* of the tool when it closed, and where of the tissue at rest                */
    double reach_m;               /* then                                                                       */
    double offset[3];             /* o, in the tool's axes at quaternion 1                                      */
    double k_max_N_m, c_max_Ns_m; /* explicit limits in this sub-step                                           */
    double force[3];              /* on the tool, this sub-step                                                 */
    pal_adaptive_grasp *adaptive; /* adaptive bodies only, else NULL                                            */
    pal_stiffness_fit fit;        /* rendered stiffness                                                         */
    pal_grasp_implicit *implicit; /* implicit solvers only, else NULL                                           */
    pal_grasp_transfer *transfer; /* heap, after a transfer; else NULL                                          */
} pal_grasp;

#define PAL_GRASP_WHOLE 65535.0

typedef struct pal_grasps pal_grasps;
struct pal_grasps {
    /* the regime: force of one grasp in this sub-step */
    void (*act)(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step);
    int n_tool;
    pal_grasp *grasp;                           /* [n_tool] */
    double *sum_weight;                         /* of all tools that hold a node [n_node] */
    double *gather;                             /* weights of a new grasp [n_node], 0 between */
    double asked_N_m, damping_s, asked_reach_m; /* keys */
    double young_Pa, poisson;
    uint64_t revision; /* adaptive bodies: of the nodes that are held */
};

void pal_grasp_act_explicit(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step);
void pal_grasp_act_implicit(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step);
/* pal_tangent of the implicit regime */
void pal_grasp_multiply(void *self, const pal_body *body, double k, double c, const double *p, double *out);
bool pal_grasp_settle(void *self, pal_step *step, const double *moved, bool last);

/* ---- for the regimes ---- */

double pal_grasp_reach_m(const pal_grasps *grasps, const pal_tool *tool);
/* k as the scene says, or 16 E reach */
double pal_grasp_stiffness_N_m(const pal_grasps *grasps, double reach_m);
/* weighted mean of p [n_node][3] over the nodes held */
void pal_grasp_mean(const pal_grasp *g, const double *p, double mean[3]);
/* to [n_node][3] += a force on the tissue */
void pal_grasp_add_force(const pal_grasp *g, const double force_N[3], double *to);
double pal_grasp_max_weight(const pal_grasp *g);
/* where the spring would have y, body frame. A grasp that was transferred begins with the force that it had, of which
 * the damper gives damper_N */
void pal_grasp_find_goal(pal_grasp *g, const pal_tool *tool, const pal_step *step, double k_N_m,
                         const double damper_N[3], double goal[3]);
/* the bilateral part for a haptic bridge, f0 - K (x - x0) - b v, in the last sub-step; k_N_m of the spring, c of it */
void pal_grasp_publish(pal_grasp *g, pal_tool *tool, double k_N_m, double c_Ns_m);
#endif
