/* Explicit contact: penalty forces with damping in every sub-step.
 *
 * A contact at depth d is pushed away from the proxy's centre with f = k (d - gamma dt v_away), v_away the tissue's own
 * speed. A common factor on k keeps the largest eigenvalue of contact stiffness over mass below alpha / dt^2. With a
 * and b the ratios of stiffness and damping to m / dt^2 and m / dt, symplectic steps are stable for a + 2 b < 4: the
 * solver's own limit leaves a <= 1 to the tissue, contact adds a <= alpha = 1.2 and b <= gamma alpha = 0.6. */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"

/* Coulomb friction: the tool's way sideways over the tissue it presses stretches a spring as stiff as the contact,
 * which slips at friction times the normal force; shared out like the normal force */
static void add_friction(pal_push *push, pal_tool_contact *t, const double sum[3], double stiffness, double dt_s)
{
    double size = pal_norm3(sum), drift[3], along[3], total = 0;
    if (push->friction <= 0 || !pal_unit3(along, sum, 0)) return;
    pal_copy3(drift, t->proxy.v);
    for (int i = 0; i < t->n_contact; i++) total += pal_norm3(t->contact[i].force);
    for (int i = 0; i < t->n_contact; i++) {
        double v[3];
        pal_contact_points_velocity(&push->points, t->contact[i].point, v);
        pal_axpy3(drift, -pal_norm3(t->contact[i].force) / total, v);
    }
    if (!pal_tool_contact_friction(t, along, stiffness, t->slip)) pal_axpy3(t->slip, dt_s, drift);
    pal_axpy3(t->slip, -pal_dot3(t->slip, along), along);
    double limit_m = push->friction * size / stiffness, slip = pal_norm3(t->slip);
    if (slip > limit_m) pal_scale3(t->slip, limit_m / slip, t->slip);
    for (int i = 0; i < t->n_contact; i++)
        pal_axpy3(t->contact[i].force, pal_norm3(t->contact[i].force) / total * stiffness, t->slip);
}

/* how much of the asked stiffness a tool may have; tools that press on the same nodes share it */
static void find_share(pal_push *push, pal_tool_contact *t, int n_tool, pal_step *step)
{
    int n_share = 1;
    if (t->n_contact == 0) return;
    for (const pal_tool_contact *other = push->tool; other < push->tool + n_tool; other++)
        if (other != t && other->n_contact > 0 &&
            pal_dist3(other->proxy.x, t->proxy.x) <= 0.5 * step->body->length_scale_m)
            n_share += pal_contact_points_overlap(&push->points, step->body, t->contact, t->n_contact, other->contact,
                                                  other->n_contact);
    double rate = EIGENVALUE_SAFETY * n_share *
                  push->regime->eigenvalue_1_s2(&push->points, step->body, t->contact, t->n_contact);
    double max_rate =
        fmax(push->regime->stiffness_limit / (step->dt_s * step->dt_s), EIGENVALUE_SAFETY * n_share * t->wanted_1_s2);
    double share = rate > max_rate ? max_rate / rate : 1;
    t->share = share < t->share ? share : fmin(share, t->share * (1 + step->dt_s / SHARE_RISE_S));
}

/* forces of one tool to the nodes and back */
static void press(pal_push *push, pal_tool_contact *t, pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double scale = tool->ramp * t->ramp * t->share * (1 - t->hold.share), sum[3] = {0}, stiffness = 0;
    double damping_s = step->dt_s * push->regime->damping_steps;
    if (t->n_contact == 0 || scale <= 0) {
        pal_set3(t->slip, 0, 0, 0);
        t->uncapped_N = 0;
        return;
    }
    for (int i = 0; i < t->n_contact; i++) {
        pal_contact *c = &t->contact[i];
        double v[3], k = scale * c->k_N_m;
        pal_contact_points_velocity(&push->points, c->point, v);
        pal_scale3(c->force, fmax(0, k * (c->depth_m - damping_s * pal_dot3(v, c->away))), c->away);
        pal_add3(sum, sum, c->force);
        stiffness += k;
    }
    if (push->regime->limit_rise) stiffness *= push->regime->limit_rise(t, sum);
    if (!pal_finite3(sum) || pal_dot3(sum, sum) == 0) return;
    add_friction(push, t, sum, stiffness, step->dt_s);
    pal_set3(sum, 0, 0, 0);
    pal_contact_points_force_begin(&push->points);
    for (int i = 0; i < t->n_contact; i++) {
        pal_contact_points_add_force(&push->points, body, t->contact[i].point, t->contact[i].force);
        pal_sub3(sum, sum, t->contact[i].force);
    }
    double share = pal_tool_force_share(body, tool, sum, pal_contact_points_assemble(&push->points, body));
    pal_contact_points_apply(&push->points, body, share);
    pal_scale3(t->total, share, sum);
    for (int i = 0; i < t->n_contact; i++) pal_scale3(t->contact[i].force, share, t->contact[i].force);
    pal_add3(tool->force_N, tool->force_N, t->total);
    pal_add3(t->total, t->total, t->hold.now_N);
    tool->touching = true;
    pal_push_follow_side(t, t->proxy.normal);
}

void pal_push_act_explicit(pal_push *push, int n_tool, pal_step *step)
{
    for (int t = 0; t < n_tool; t++) find_share(push, &push->tool[t], n_tool, step);
    for (int t = 0; t < n_tool; t++) press(push, &push->tool[t], &step->tools->tool[t], step);
    for (int t = 0; t < n_tool && step->sub == step->n_sub - 1; t++)
        pal_push_publish(push, &push->tool[t], &step->tools->tool[t], step);
}

const pal_push_regime pal_push_explicit = {.reach_radii = 1,
                                           .pressure_Pa_m = pal_push_pressure_of_radius,
                                           .act = pal_push_act_explicit,
                                           .stiffness_limit = 1.2,
                                           .damping_steps = 0.5,
                                           .eigenvalue_1_s2 = pal_contact_points_max_eigenvalue};
