/* The side a tool is on: a sphere that follows the tool and never sinks into tissue by more than max_depth_m.
 *
 * The tool's own centre may be deep inside or beyond the organ, where a penetration has no direction. The proxy
 * (god-object of Zilles & Salisbury) stays on the side it came from: it moves to the tool along the straight line,
 * stops where a contact point would come closer than allowed, and slides along. Every contact point allows a depth of
 * at most max_depth_m, and in one sub-step at most max_rise_m more than it has now: that clamps the correction of
 * penetration, and because points block a swept sphere no tool passes through at any speed. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_PROXY_H
#define PAL_SIM_CONTACT_PROXY_H
#include <stdbool.h>

typedef struct pal_proxy {
    double x[3];      /* centre, body frame, m                            */
    double v[3];      /* of the last move, m/s                            */
    double normal[3]; /* mean direction from tissue to the proxy, unit; 0: no contact yet */
} pal_proxy;

typedef struct pal_proxy_limits {
    double radius_m, max_depth_m, max_rise_m;
    double tool_move_length_m;  /* of the tool itself in this sub-step */
    double a[3], b[3], slack_m; /* where contact points are known: the proxy stays within slack of segment a..b */
} pal_proxy_limits;

/* moves toward target among points p [n][3]; core [n] is scratch. Afterwards no point that was outside the allowed
 * depth before is deeper than allowed, however far the target is. */
void pal_proxy_move(pal_proxy *proxy, const double target[3], const double *p, int n, const pal_proxy_limits *limits,
                    double dt_s, double *core);
#endif
