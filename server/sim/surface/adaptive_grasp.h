/* Grasps (tool_grasp) on a body whose nodes come and go: while it adapts (adaptive_surface.h), and when a transfer
 * gives the same surface another number of levels (transfer.h).
 *
 * A grasp holds a share of every vertex of all levels, as of its begin; the share of a vertex that was not a node then
 * is the mean of the ends of its edge. It acts on those that are nodes now, and in place of others on the ends of their
 * edges. So the held tissue, and its offset o to the tool (tool_grasp.c), follow from the present refinement alone,
 * whatever its history; only where all of it is finer than this surface and than one in between, the ends of the
 * coarser one's edges continue. o follows the held tissue's position at rest, rotated as the body was at the begin. The
 * force is continuous at a change of nodes, and of k, which depends on the solver's sub-step: F = k (tool + o + shift -
 * y), where shift fades in PAL_BLEND_S. Memory: the caller's, `known` is heap. Thread: [sim]. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_GRASP_H
#define PAL_SIM_SURFACE_ADAPTIVE_GRASP_H
#include "server/sim/core/body.h"

typedef struct pal_adaptive_grasp {
    double axes[9]; /* from rest to the tool's axes at the begin, by the rotation of the body then        */
    double y[3], shift[3], k_N_m, dt_s; /* held tissue and spring of the last sub-step */
    double left_s;                      /* remaining time of the blend of shift */
    double moved[3];                    /* change of o since then, in the tool's axes */
    bool retriangulated;                /* other nodes since then                     */
    /* shares of all vertices of an earlier, finer surface, until its levels return [n_known] */
    uint16_t *known;
    int n_known; /* 0: none */
} pal_adaptive_grasp;

/* begins a grasp by a tool with the orientation quat; share [n_node] is known for the present nodes, and then for all
 * vertices */
void pal_adaptive_grasp_begin(pal_adaptive_grasp *live, const pal_body *body, const double quat[4], uint16_t *share);
/* weight [n_node] += share of each present node */
void pal_adaptive_grasp_weights(const pal_body *body, const uint16_t *share, double *weight);
/* takes over live and share [body->n_node] of a grasp on `from`. Without memory, levels finer than the body's are lost
 */
void pal_adaptive_grasp_transfer(pal_adaptive_grasp *live, const pal_body *body, uint16_t *share,
                                 const pal_adaptive_grasp *before, const pal_body *from, const uint16_t *share_before);
/* the nodes have changed: moves offset by the change of the held tissue's position at rest, from `was` to `is` */
void pal_adaptive_grasp_renew(pal_adaptive_grasp *live, const double was[3], const double is[3], double offset[3]);
/* goal of the spring such that its force is continuous when nodes or k change; y, v: position and velocity of the held
 * tissue, quat: orientation of the tool */
void pal_adaptive_grasp_goal(pal_adaptive_grasp *live, const double quat[4], const double y[3], const double v[3],
                             double k_N_m, double dt_s, double goal[3]);
void pal_adaptive_grasp_free(pal_adaptive_grasp *live); /* heap memory; NULL is fine */
#endif
