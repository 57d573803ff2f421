/* Nodes that come and go under a grip (tool_grasp) on a body that adapts (adaptive_surface.h), and under one that goes
 * on on the same surface with another number of levels (transfer.h).
 *
 * What a grip holds is a share of every vertex of all levels, as it was when it closed: that of a vertex that was not
 * in use then is the mean of its edge's ends. Of these it pulls on those in use, and where none of them is, on the ends
 * of the edges of those that are not. So the patch, and with it the hold o (tool_grasp.c), follows from the surface's
 * refinement alone, by whatever way it came to it: only where all that is held is finer than this surface and than one
 * in between the ends of the coarser one's edges go on holding. o goes by what the patch's place at rest does, turned
 * as the body was when the grip closed. The force is the same on both sides of a change of nodes, and of k, which goes
 * with the solver's sub-step (a jump at each would shake the tissue): F = k (tool + o + shift - y), and shift fades in
 * PAL_BLEND_GRASP_NODES_S, after which the force is that of the new patch and k.
 * Memory: the caller's, but for `known`, which is heap. Thread: [sim]. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_GRASP_H
#define PAL_SIM_SURFACE_ADAPTIVE_GRASP_H
#include "server/sim/core/body.h"

typedef struct pal_adaptive_grasp {
    double axes[9]; /* from rest to the tool's axes, as the body was turned when the grip closed       */
    double y[3], shift[3], k_N_m, dt_s; /* patch and spring in the sub-step before */
    double left_s;                      /* of the fade of shift                       */
    double moved[3];                    /* o since then, in the tool's axes        */
    bool retriangulated;                /* other nodes since then                  */
    /* of all vertices of a finer surface before, until its levels are back [n_known] */
    uint16_t *known;
    int n_known; /* 0: none */
} pal_adaptive_grasp;

/* a grip closed by a tool that is turned by quat: share [n_node] is known of vertices in use, and then of all */
void pal_adaptive_grasp_begin(pal_adaptive_grasp *live, const pal_body *body, const double quat[4], uint16_t *share);
/* how much of each node in use it holds, [n_node] += */
void pal_adaptive_grasp_weights(const pal_body *body, const uint16_t *share, double *weight);
/* live and share [body->n_node] of a grip that goes on where that of `from` is. Without memory finer levels than the
 * body's are forgotten */
void pal_adaptive_grasp_transfer(pal_adaptive_grasp *live, const pal_body *body, uint16_t *share,
                                 const pal_adaptive_grasp *before, const pal_body *from, const uint16_t *share_before);
/* other nodes on this body: offset by what the patch's place at rest goes from `was` to `is` */
void pal_adaptive_grasp_renew(pal_adaptive_grasp *live, const double was[3], const double is[3], double offset[3]);
/* goal, with the force as it was before nodes or k changed; the patch y of now goes by v, the tool is turned by quat */
void pal_adaptive_grasp_goal(pal_adaptive_grasp *live, const double quat[4], const double y[3], const double v[3],
                             double k_N_m, double dt_s, double goal[3]);
void pal_adaptive_grasp_free(pal_adaptive_grasp *live); /* heap memory; NULL is fine */
#endif
