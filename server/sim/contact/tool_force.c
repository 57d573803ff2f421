/* Caps of forces (tool_force.h). */
#include "server/sim/contact/tool_force.h"

#include "server/base/vec3.h"

double pal_tool_force_share(const pal_body *body, const pal_tool *tool, const double force_N[3], double max_node_N)
{
    /* |g + s f|^2 <= cap^2, g the force so far */
    double cap = tool->force_cap_N * tool->ramp, share = 1;
    double a = pal_dot3(force_N, force_N), b = pal_dot3(tool->force_N, force_N);
    double c = pal_dot3(tool->force_N, tool->force_N) - cap * cap;
    if (a > 0 && a + 2 * b + c > 0) share = c >= 0 ? 0 : fmin(fmax((-b + sqrt(b * b - a * c)) / a, 0), 1);
    return body->load_cap_N > 0 && max_node_N > body->load_cap_N ? fmin(share, body->load_cap_N / max_node_N) : share;
}
