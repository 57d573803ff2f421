/* Nodes that come and go under a grip (tool_grab) on a body that adapts (shell.h).
 *
 * A grip goes on when nodes come and go: a new midpoint weighs as its edge's ends do in the mean, one that goes leaves
 * the others their weights, and its own to the ends of its edge where neither was held. The force is the same on both
 * sides of the change: o (tool_grab.c) goes with y, and F = k (tool + o + shift - y), where shift makes up for another
 * k and fades in PAL_LIVE_SHIFT_S. Memory: the arena given. Thread: [sim], pal_in_use_make [load]. */
#ifndef PAL_SIM_SHELL_GRIP_H
#define PAL_SIM_SHELL_GRIP_H
#include "server/sim/body.h"

/* points of the body that were in use when it was last looked at */
typedef struct pal_in_use {
    uint64_t revision; /* of the body then */
    int n;
    int32_t *point; /* [n] */
    uint8_t *known; /* 1: in the list [n_node] */
} pal_in_use;

/* looks as well; MEMORY */
pal_err pal_in_use_make(const pal_body *body, pal_arena *arena, pal_in_use **out);
void pal_in_use_look(pal_in_use *use, const pal_body *body);
/* weight [body n_node], >= 0 and not 0 at node [n_node] only, points of the last look: moves it to the points that are
 * in use now */
void pal_in_use_weigh(const pal_in_use *use, const pal_body *body, const int32_t *node, int n_node, double *weight);

#define PAL_LIVE_SHIFT_S 0.15

typedef struct pal_live_grip {
    double *even;                       /* weights but for the masses of nodes [n_node]   */
    double y[3], shift[3], k_N_m, dt_s; /* patch and spring in the sub-step before        */
    bool renewed;                       /* other nodes since then                         */
} pal_live_grip;

/* goal, with the force as it was before the nodes changed, and the hold offset (in the tool's axes, quat). The patch y,
 * as fast as v, of the new nodes is the same tissue, so the hold goes with it for good */
void pal_live_grip_keep(pal_live_grip *live, const double quat[4], const double y[3], const double v[3], double k_N_m,
                        double dt_s, double offset[3], double goal[3]);
#endif
