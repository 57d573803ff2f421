/* What caps leave of a force on a tool. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_TOOL_FORCE_H
#define PAL_SIM_CONTACT_TOOL_FORCE_H
#include "server/sim/core/body.h"
#include "server/sim/core/tools.h"

/* largest s in [0, 1] for which s force_N, on the tool and beside what it feels already, keeps to the tool's cap at its
 * ramp, and s max_node_N, the largest force on a node, to body->load_cap_N */
double pal_tool_force_share(const pal_body *body, const pal_tool *tool, const double force_N[3], double max_node_N);
#endif
