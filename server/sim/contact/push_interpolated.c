/* Explicit contact where points carry the nodes (central_cg): contact is as stiff as with implicit solvers, and the
 * solver hears before its sub-steps begin what the points near a tool will want, so that they are short enough. Beyond
 * that alpha is 0.3; the eigenvalue is bounded by the sum of the points' own. */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"

void pal_push_want(pal_push *push, const pal_body *body, double *bound_N_m)
{
    for (int i = 0; i < push->n_tool; i++) {
        pal_tool_contact *t = &push->tool[i];
        double radius = t->limits.radius_m, x[3];
        t->wanted_1_s2 = 0;
        for (int k = 0; k < t->n_list && t->active; k++) {
            int point = t->list[k];
            pal_contact_points_position(&push->points, point, x);
            if (!(pal_dist3(x, t->proxy.x) < WANTED_RADII * radius)) continue;
            double stiffness =
                push->regime->pressure_Pa_m(push, body, point, radius) * push->points.sample.area_m2[point];
            /* damping over dt/2 takes as much of a step's stability as the stiffness */
            t->wanted_1_s2 += 0.5 * pal_contact_points_bound(&push->points, body, point, 2 * stiffness, bound_N_m);
        }
    }
}

/* the sum of the eigenvalues is no less than the largest, and a point between nodes moves no more than their mean */
static double eigenvalue_1_s2(pal_contact_points *points, const pal_body *body, const pal_contact *contact, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += pal_contact_points_bound(points, body, contact[i].point, contact[i].k_N_m, NULL);
    return sum;
}

const pal_push_regime pal_push_interpolated = {.reach_radii = 1,
                                               .pressure_Pa_m = pal_push_pressure_of_tissue,
                                               .act = pal_push_act_explicit,
                                               .stiffness_limit = 0.3,
                                               .damping_steps = 0.5,
                                               .eigenvalue_1_s2 = eigenvalue_1_s2};
