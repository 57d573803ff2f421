/* Explicit contact: penalty forces with damping in every sub-step.
 *
 * A contact at depth d is pushed away from the proxy's centre with f = k (d - gamma dt v_away), v_away the tissue's own
 * speed. With a and b the ratios of stiffness and damping to m / dt^2 and m / dt:
 *
 * explicit: gamma = 1/2. verlet takes the stiffness K implicitly by a diagonal D (body->load_stiffness), so that
 *     neither the sub-step nor the stiffness is bounded (verlet.c). Another solver has a common factor on k, which
 *     keeps the largest eigenvalue of contact stiffness over mass below alpha / dt^2.
 * held load (rk4 of adaptive bodies): loads lag by dt/2. With gamma = 1, the nodes' own velocity and alpha = 0.5, b = a
 *     exceeds a/2, which makes up for the lag, and a + b <= 1: tissue is stopped and not thrown back. Where other
 *     triangles are drawn, as a finer surface bulges, the ramp of the contact falls so far that the force does not rise
 *     at that moment, and rises again.
 * interpolated (central_cg): contact is as stiff as with implicit solvers, and the solver is told before its sub-steps
 *     begin what stiffness the points near a tool will need. Beyond that alpha is 0.5; the eigenvalue is bounded by the
 *     sum of the points' own.
 *
 * D is a share of Gershgorin's row sums of K, the largest eigenvalue of K over them (two power iterations, at the first
 * touch and once a step). Skinned points need a tenth, as forces of turning frames cancel. Nodes are heavier by dt^2 D,
 * which delays them: with whole row sums a press is 4 times as far off and a strike is felt a third too hard.
 *
 * In a sub-step with D a node receives f - dt D dv: f at its begin, dv its change of velocity. Once dv is known, the
 * tool is told the opposite of the sum of that, within its cap; tissue that comes toward a tool at its cap receives up
 * to a tenth more. */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"
#include "server/sim/core/blend.h"

#include <string.h>

/* Coulomb friction: the tool's displacement across the tissue stretches a spring as stiff as the contact, which slips
 * at friction times the normal force; shared out like the normal force */
static void add_friction(pal_push *push, pal_tool_contact *t, const pal_tool *tool, const double sum[3],
                         double stiffness, double dt_s)
{
    double size = pal_norm3(sum), drift[3], along[3], total = 0;
    if (push->friction <= 0 || !pal_unit3(along, sum, 0)) return;
    pal_push_surface_velocity(t, tool, drift);
    for (int i = 0; i < t->n_contact; i++) total += pal_norm3(t->contact[i].force);
    for (int i = 0; i < t->n_contact; i++) {
        double v[3];
        pal_contact_points_at(&push->points, t->contact[i].point, push->points.v, v);
        pal_axpy3(drift, -pal_norm3(t->contact[i].force) / total, v);
    }
    if (!pal_tool_contact_friction(t, stiffness, t->slip)) pal_axpy3(t->slip, dt_s, drift);
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
    if (step->body->load_stiffness) t->share = 1;
    if (t->n_contact == 0 || step->body->load_stiffness) return;
    for (const pal_tool_contact *other = push->tool; other < push->tool + n_tool; other++)
        if (other != t && other->n_contact > 0)
            n_share += pal_contact_points_overlap(&push->points, step->body, t->contact, t->n_contact, other->contact,
                                                  other->n_contact);
    double rate =
        EIGENVALUE_SAFETY * n_share *
        push->regime->eigenvalue_1_s2(&push->points, step->body, step->body->mass_kg, t->contact, t->n_contact);
    double max_rate =
        fmax(push->regime->stiffness_limit / (step->dt_s * step->dt_s), EIGENVALUE_SAFETY * n_share * t->wanted_1_s2);
    double share = rate > max_rate ? max_rate / rate : 1;
    t->share = share < t->share ? share : fmin(share, t->share * (1 + step->dt_s / PAL_BLEND_S));
}

static void scale_contact(pal_contact *contact, double share)
{
    contact->normal_N *= share;
    pal_scale3(contact->force, share, contact->force);
}

/* after other triangles were drawn the force begins at that of before; returns the part of it */
static double limit_rise(pal_tool_contact *t, double sum[3])
{
    double size = pal_norm3(sum), part = t->retriangulated && size > t->uncapped_N ? t->uncapped_N / size : 1;
    t->retriangulated = false;
    t->uncapped_N = part * size;
    if (part == 1) return 1;
    t->ramp *= part;
    pal_scale3(sum, part, sum);
    for (int i = 0; i < t->n_contact; i++) scale_contact(&t->contact[i], part);
    return part;
}

/* row sums of the stiffness of a tool's contacts, scaled, for a solver that takes them implicitly */
static void add_stiffness(pal_push *push, pal_tool_contact *t, double scale, const pal_step *step)
{
    pal_body *body = step->body;
    pal_contact_points *points = &push->points;
    pal_contact_row_sums *rows = &t->rows;
    double *sum = push->row_sum_N_m;
    if (!body->load_stiffness) return;
    pal_contact_points_begin_slots(points);
    for (int i = 0; i < t->n_contact; i++)
        pal_contact_points_add_bound(points, body, &t->contact[i], scale * t->contact[i].k_N_m);
    pal_contact_points_assemble_bound(points, body, sum);
    rows->n_node = points->n_node;
    memcpy(rows->node, points->node, sizeof *rows->node * (size_t)rows->n_node);
    if (step->sub == 0 || rows->share == 0) {
        const double largest = pal_contact_points_max_eigenvalue(points, body, sum, t->contact, t->n_contact);
        rows->share = fmin(1, EIGENVALUE_SAFETY * scale * largest);
    }
    for (int i = 0; i < rows->n_node; i++) {
        const int node = rows->node[i];
        rows->sum_N_m[i] = rows->share * sum[node];
        body->load_stiffness[node] += rows->sum_N_m[i];
        sum[node] = 0;
    }
}

/* forces of one tool to the nodes and back */
static void press(pal_push *push, pal_tool_contact *t, pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double scale = tool->ramp * t->ramp * t->share * (1 - t->hold.share), sum[3] = {0}, stiffness = 0;
    double damping_s = step->dt_s * push->regime->damping_steps;
    t->rows.n_node = 0;
    if (t->n_contact == 0 || scale <= 0) {
        pal_set3(t->slip, 0, 0, 0);
        t->uncapped_N = t->rows.share = 0;
        return;
    }
    for (int i = 0; i < t->n_contact; i++) {
        pal_contact *c = &t->contact[i];
        double v[3], k = scale * c->k_N_m;
        pal_contact_points_at(&push->points, c->point, push->points.v, v);
        c->normal_N = fmax(0, k * (c->depth_m - damping_s * pal_dot3(v, c->away)));
        pal_scale3(c->force, c->normal_N, c->away);
        pal_add3(sum, sum, c->force);
        stiffness += k;
    }
    if (push->regime->limits_rise) stiffness *= limit_rise(t, sum);
    if (!pal_finite3(sum) || pal_dot3(sum, sum) == 0) return;
    add_friction(push, t, tool, sum, stiffness, step->dt_s);
    pal_set3(sum, 0, 0, 0);
    pal_contact_points_begin_slots(&push->points);
    for (int i = 0; i < t->n_contact; i++) {
        pal_contact_points_add_force(&push->points, body, t->contact[i].point, t->contact[i].force);
        pal_sub3(sum, sum, t->contact[i].force);
    }
    double share = pal_tool_force_share(body, tool, sum, pal_contact_points_assemble(&push->points, body));
    for (int i = 0; i < push->points.n_node; i++) {
        const size_t at = 3 * (size_t)push->points.node[i];
        pal_axpy3(body->load + at, share, push->points.force + at);
    }
    add_stiffness(push, t, share * scale, step);
    pal_scale3(t->total, share, sum);
    for (int i = 0; i < t->n_contact; i++) scale_contact(&t->contact[i], share);
    pal_add3(tool->force_N, tool->force_N, t->total);
    pal_add3(t->total, t->total, t->hold.now_N);
    tool->touching = true;
    pal_push_follow_side(t, t->proxy.normal, step->dt_s);
}

pal_err pal_push_make_explicit(pal_push *push, pal_build *build)
{
    push->springs = PAL_NEW(build->arena, pal_contact_springs, 1);
    if (!push->springs) return PAL_ERR_MEMORY;
    PAL_TRY(
        pal_contact_springs_make(&push->points, build->body, PAL_CONTACT_IMPLICIT_MAX, build->arena, push->springs));
    const size_t n_node = build->body->interpolation ? 0 : (size_t)build->body->n_node;
    push->row_sum_N_m = PAL_NEW(build->arena, double, n_node);
    bool all = push->row_sum_N_m != NULL;
    for (int i = 0; i < push->n_tool; i++) {
        pal_contact_row_sums *rows = &push->tool[i].rows;
        rows->node = PAL_NEW(build->arena, int32_t, n_node);
        rows->sum_N_m = PAL_NEW(build->arena, double, n_node);
        all = all && rows->node && rows->sum_N_m;
    }
    if (!all) return PAL_ERR_MEMORY;
    size_t scratch = pal_haptic_stiffness_scratch(build->body) + PAL_CONTACT_IMPLICIT_MAX * sizeof(pal_contact) +
                     (size_t)push->points.sample.max_point * 4 * sizeof(double) + CONTACT_MAX + 256;
    if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    build->body->wants_compliance = true;
    return PAL_ERR_OK;
}

/* each tool in turn is the first to have its patches' stiffness found */
static void publish(pal_push *push, int n_tool, pal_step *step)
{
    push->n_step++, push->n_stiffness = 0;
    if (step->body->compliance) step->body->compliance->begin(step->body->compliance->self, step);
    for (int k = 0; k < n_tool; k++) {
        const int t = (k + push->n_step) % n_tool;
        pal_push_publish(push, &push->tool[t], &step->tools->tool[t], step);
    }
}

static void act(pal_push *push, int n_tool, pal_step *step)
{
    for (int t = 0; t < n_tool; t++) find_share(push, &push->tool[t], n_tool, step);
    for (int t = 0; t < n_tool; t++) {
        press(push, &push->tool[t], &step->tools->tool[t], step);
        if (step->sub == step->n_sub - 1) pal_push_add_torque(&push->tool[t], &step->tools->tool[t]);
    }
    if (step->sub == step->n_sub - 1 && !step->body->load_stiffness) publish(push, n_tool, step);
}

/* what the nodes received less than the contacts' forces, by row sums times `moved`: less on the tool, by as much as
 * its cap allows, and on its contacts in proportion to their forces */
static void settle_tool(pal_tool_contact *t, pal_tool *tool, pal_step *step, const double *moved)
{
    const pal_contact_row_sums *rows = &t->rows;
    pal_body *body = step->body;
    double less[3] = {0}, torque[3] = {0}, here[3], sum = 0;
    pal_sub3(here, tool->here_m, body->offset_m);
    for (int i = 0; i < rows->n_node; i++) {
        const size_t at = 3 * (size_t)rows->node[i];
        double f[3], arm[3], m[3];
        pal_scale3(f, rows->sum_N_m[i], moved + at);
        pal_sub3(body->load + at, body->load + at, f);
        /* from where the node was when the force was found */
        pal_sub3(arm, body->d + at, here);
        pal_axpy3(arm, -step->dt_s, body->dv + at);
        pal_cross3(m, arm, f);
        pal_add3(less, less, f);
        pal_add3(torque, torque, m);
    }
    if (rows->n_node == 0 || !pal_finite3(less) || !pal_finite3(torque)) return;
    const double share = pal_tool_force_share(body, tool, less, 0);
    pal_axpy3(tool->force_N, share, less);
    pal_axpy3(t->total, share, less);
    if (step->sub == step->n_sub - 1) {
        pal_axpy3(tool->torque_Nm, share, torque);
        pal_axpy3(t->torque_Nm, share, torque);
    }
    for (int i = 0; i < t->n_contact; i++) sum += t->contact[i].normal_N;
    for (int i = 0; i < t->n_contact && sum > 0; i++) {
        pal_contact *c = &t->contact[i];
        const double part = share * c->normal_N / sum;
        pal_axpy3(c->force, -part, less);
        c->normal_N = fmax(0, c->normal_N - part * pal_dot3(less, c->away));
    }
}

/* Forces at the end of the sub-step, of a solver that takes the stiffness implicitly: the momentum that nodes received
 * over its length, and so exactly what the tool receives */
static bool settle(pal_push *push, pal_step *step, const double *moved, bool last)
{
    pal_tools *tools = step->tools;
    const int n_tool = tools->n_tool < push->n_tool ? tools->n_tool : push->n_tool;
    for (int t = 0; t < n_tool && last; t++) settle_tool(&push->tool[t], &tools->tool[t], step, moved);
    if (last && step->sub == step->n_sub - 1) publish(push, n_tool, step);
    return false;
}

const pal_push_regime pal_push_explicit = {.pressure_Pa_m = pal_push_pressure_of_radius,
                                           .pressure = EXPLICIT_PRESSURE,
                                           .act = act,
                                           .settle = settle,
                                           .stiffness_limit = EXPLICIT_ALPHA,
                                           .damping_steps = 0.5,
                                           .eigenvalue_1_s2 = pal_contact_points_max_eigenvalue};

const pal_push_regime pal_push_held_load = {.pressure_Pa_m = pal_push_pressure_of_radius,
                                            .pressure = HELD_PRESSURE,
                                            .act = act,
                                            .settle = settle,
                                            .stiffness_limit = 0.5,
                                            .damping_steps = 1,
                                            .eigenvalue_1_s2 = pal_contact_points_max_eigenvalue,
                                            .limits_rise = true};

/* ---- interpolated ---- */

void pal_push_want(pal_push *push, const pal_body *body, double *bound_N_m)
{
    for (int i = 0; i < push->n_tool; i++) {
        pal_tool_contact *t = &push->tool[i];
        double radius = t->limits.radius_m, x[3];
        t->wanted_1_s2 = 0;
        for (int k = 0; k < t->n_list && t->active; k++) {
            int point = t->list[k];
            pal_contact_points_at(&push->points, point, push->points.x, x);
            if (!(pal_dist3(x, t->proxy.x) < (1 + 0.5 * MAX_DEPTH_RADII) * radius)) continue;
            double stiffness =
                push->regime->pressure_Pa_m(push, body, point, radius) * push->points.sample.area_m2[point];
            /* damping over dt/2 takes as much of a step's stability as the stiffness */
            t->wanted_1_s2 += 0.5 * pal_contact_points_bound(&push->points, body, point, 2 * stiffness, bound_N_m);
        }
    }
}

/* the sum of the eigenvalues is no less than the largest, and a point between nodes moves no more than their mean */
static double eigenvalue_1_s2(pal_contact_points *points, const pal_body *body, const double *mass_kg,
                              const pal_contact *contact, int n)
{
    double sum = 0;
    (void)mass_kg;
    for (int i = 0; i < n; i++) sum += pal_contact_points_bound(points, body, contact[i].point, contact[i].k_N_m, NULL);
    return sum;
}

const pal_push_regime pal_push_interpolated = {.pressure_Pa_m = pal_push_pressure_of_tissue,
                                               .act = act,
                                               .stiffness_limit = 0.5,
                                               .damping_steps = 0.5,
                                               .eigenvalue_1_s2 = eigenvalue_1_s2};
