/* Grasps: damped springs between tools and the tissue that they closed on (effects/tool_grasp.c).
 *
 * A grasp holds nodes i with weights W_i, sum 1, whose mean is y = sum W_i x_i. With o = y - tool when it closed,
 * turned with the tool since, F = k (tool + o - y) - c v_rel,   node i gets W_i F, the tool gets -F, so nothing jumps
 * when it closes, and force and torque balance about y. The regime is chosen at load by the solver: explicit, within
 * the limits of its sub-steps (grasp_explicit.c), or implicit (grasp_implicit.c). Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_GRASP_H
#define PAL_SIM_CONTACT_GRASP_H
#include "server/sim/contact/haptic_stiffness.h"
#include "server/sim/core/effect.h"
#include "server/sim/surface/adaptive_grasp.h"

/* The transfer of a grasp to another body in the same place (transfer.h). The force is at first what it was, by a shift
 * of o that is released over PAL_BLEND_GRASP_S, after which the new method's own force is felt (three levels of an
 * adaptive surface may pull three times as hard as one). A switch before that sets the shift again */
typedef struct pal_grasp_transfer {
    bool due; /* transferred, and no force was given since */
    /* on the body before: position of the tissue, force on it, o in the tool's axes; k of an implicit spring, else 0 */
    double y[3], force_N[3], hold[3], k_N_m;
    double shift[3], left_s; /* of o, axes of the world; its remaining time */
} pal_grasp_transfer;

/* additional state with an implicit solver */
typedef struct pal_grasp_implicit {
    bool pulls, constant;  /* in this sub-step; the load is a constant force                   */
    bool found;            /* the compliance was updated in this sub-step                      */
    bool capped;           /* caps let the spring stretch less than it would                   */
    double total_N[3];     /* on the tool, counted in its force                                */
    double k_N_m, pull[3]; /* at the sub-step's begin: stiffness, force of the spring on tissue */
    double load[3];        /* force on tissue in body->load                                    */
    double stretch_m;      /* at the end of the last sub-step                                  */
} pal_grasp_implicit;

/* the grasp of one tool */
typedef struct pal_grasp {
    bool closed, button; /* has tissue; button in the last step      */
    bool by_vertex;      /* share is that of the tissue              */
    int n_node;
    uint64_t revision;            /* of nodes and weights                                 */
    int32_t *node;                /* [n_node]                                             */
    double *weight;               /* sum 1 [n_node]                                       */
    uint16_t *share;              /* of each shown vertex, UINT16_MAX: 1        [n_shown] */
    double quat[4], at_m[3];      /* when it closed: of the tool; of the tissue at rest   */
    double reach_m;               /* when it closed                                       */
    double offset[3];             /* o, in the tool's axes at quaternion 1                */
    double force[3];              /* on the tool, this sub-step                           */
    double row_sum_N_m;           /* over weights, of what the solver takes implicitly; 0: nothing */
    double torque_Nm[3];          /* counted in the tool's                                */
    pal_adaptive_grasp *adaptive; /* adaptive bodies only, else NULL                      */
    pal_stiffness_fit fit;        /* rendered stiffness                                   */
    pal_grasp_compliance compliance;
    pal_grasp_implicit *implicit; /* implicit solvers only, else NULL                     */
    pal_grasp_transfer *transfer; /* heap, after a transfer; else NULL                    */
} pal_grasp;

typedef struct pal_grasps pal_grasps;
struct pal_grasps {
    /* the regime: force of one grasp in this sub-step; pal_tangent.settle */
    void (*act)(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step);
    bool (*settle)(pal_grasps *grasps, pal_step *step, const double *moved, bool last);
    int n_tool;
    pal_grasp *grasp;                           /* [n_tool] */
    double *sum_weight;                         /* of all tools that hold a node [n_node] */
    double *gather;                             /* weights of a new grasp [n_node], 0 between */
    double asked_N_m, damping_s, asked_reach_m; /* keys */
    double young_Pa, poisson;
    uint64_t revision; /* adaptive bodies: of the nodes that are held */
    uint64_t n_taken;  /* how often a grasp took nodes */
};

void pal_grasp_act_explicit(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step);
bool pal_grasp_settle_explicit(pal_grasps *grasps, pal_step *step, const double *moved, bool last);
void pal_grasp_act_implicit(const pal_grasps *grasps, pal_grasp *g, pal_tool *tool, pal_step *step);
/* pal_tangent of the implicit regime */
void pal_grasp_multiply(void *self, const pal_body *body, double k, const double *p, double *out);
int pal_grasp_mean_springs(const void *self, pal_mean_spring *out, int max);
bool pal_grasp_settle_implicit(pal_grasps *grasps, pal_step *step, const double *moved, bool last);

/* ---- for the regimes ---- */

double pal_grasp_reach_m(const pal_grasps *grasps, const pal_tool *tool);
/* k as the scene says, or TISSUE_RATIO E reach */
double pal_grasp_stiffness_N_m(const pal_grasps *grasps, double reach_m);
/* weighted mean of p [n_node][3] over the nodes held */
void pal_grasp_mean(const pal_grasp *g, const double *p, double mean[3]);
/* to [n_node][3] += a force on the tissue */
void pal_grasp_add_force(const pal_grasp *g, const double force_N[3], double *to);
double pal_grasp_max_weight(const pal_grasp *g);
/* goal of y, body frame. A transferred grasp begins with the force that it had, of which the damper gives damper_N */
void pal_grasp_find_goal(pal_grasp *g, const pal_tool *tool, const pal_step *step, double k_N_m,
                         const double damper_N[3], double goal[3]);
/* the bilateral part for a haptic bridge, f0 - K (x - x0) - b v, in the last sub-step; k_N_m of the spring, c of it */
void pal_grasp_publish(pal_grasp *g, pal_tool *tool, double k_N_m, double c_Ns_m);
#endif
