/* Nodes that come and go under a grip (tool_grab) on a body that adapts (shell.h).
 *
 * A grip goes on when nodes come and go: a new midpoint weighs as its edge's ends do in the mean, one that goes leaves
 * the others their weights, and its own to the ends of its edge where neither was held.
 * Memory: the arena given. Thread: [sim], pal_in_use_make [load]. */
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
#endif
