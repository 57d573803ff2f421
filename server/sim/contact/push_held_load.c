/* Contact with a solver that holds loads over a sub-step (rk4 of adaptive bodies), so that they lag by dt/2: with
 * gamma = 1, the nodes' own velocity and alpha = 0.5, b = a is beyond a/2, which makes up for the lag, and a + b <= 1:
 * tissue that comes in is stopped and not thrown back.
 *
 * When other triangles are drawn contact changes at once, as a finer surface bulges where the coarse one was flat: the
 * ramp of the contact then falls so far that the force does not rise at that moment, and rises again. */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"

static double limit_rise(pal_tool_contact *t, double sum[3])
{
    double size = pal_norm3(sum), part = 1;
    if (t->retriangulated && size > t->uncapped_N) {
        part = fmax(t->uncapped_N / size, MIN_RAMP);
        t->ramp *= part;
        pal_scale3(sum, part, sum);
        for (int i = 0; i < t->n_contact; i++) pal_scale3(t->contact[i].force, part, t->contact[i].force);
    }
    t->retriangulated = false;
    t->uncapped_N = part * size;
    return part;
}

const pal_push_regime pal_push_held_load = {.reach_radii = 1,
                                            .pressure_Pa_m = pal_push_pressure_of_radius,
                                            .act = pal_push_act_explicit,
                                            .stiffness_limit = 0.5,
                                            .damping_steps = 1,
                                            .eigenvalue_1_s2 = pal_contact_points_max_eigenvalue,
                                            .limit_rise = limit_rise};
