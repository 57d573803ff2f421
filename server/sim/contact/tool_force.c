/* Forces of contact on a tool (tool_force.h). */
#include "server/sim/contact/tool_force.h"

#include "server/base/vec3.h"

/* |g + s f|^2 <= cap^2, g the force so far */
static double tool_share(const pal_tool *tool, const double force_N[3])
{
    double cap = tool->force_cap_N * tool->ramp;
    double a = pal_dot3(force_N, force_N), b = pal_dot3(tool->force_N, force_N);
    double c = pal_dot3(tool->force_N, tool->force_N) - cap * cap;
    if (!(a > 0) || a + 2 * b + c <= 0) return 1;
    if (c >= 0) return 0;
    double s = (-b + sqrt(b * b - a * c)) / a;
    return s < 0 ? 0 : s > 1 ? 1 : s;
}

double pal_tool_force_share(const pal_body *body, const pal_tool *tool, const double force_N[3], double max_node_N)
{
    double cap = body->load_cap_N, share = tool_share(tool, force_N);
    return cap > 0 && max_node_N > cap ? fmin(share, cap / max_node_N) : share;
}

void pal_solved_force_remove(const pal_solved_force *force, pal_tool *tool)
{
    if (force->counted) pal_sub3(tool->force_N, tool->force_N, force->total_N);
}

void pal_solved_force_add(pal_solved_force *force, pal_tool *tool)
{
    pal_add3(tool->force_N, tool->force_N, force->total_N);
    force->counted = true;
}
