/* Forces of contact on a tool: what caps leave of them, and how they are counted while a solver may solve again.
 * Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_TOOL_FORCE_H
#define PAL_SIM_CONTACT_TOOL_FORCE_H
#include "server/sim/core/body.h"
#include "server/sim/core/tools.h"

/* largest s in [0, 1] for which s force_N, on the tool and beside what it feels already, keeps to the tool's cap at its
 * ramp, and s max_node_N, the largest force on a node, to body->load_cap_N */
double pal_tool_force_share(const pal_body *body, const pal_tool *tool, const double force_N[3], double max_node_N);

/* the force that one component found for one tool in a solve of this sub-step */
typedef struct pal_solved_force {
    bool counted; /* total_N is part of tool->force_N */
    double total_N[3];
} pal_solved_force;

/* before the force is found again, and after */
void pal_solved_force_remove(const pal_solved_force *force, pal_tool *tool);
void pal_solved_force_add(pal_solved_force *force, pal_tool *tool);
#endif
