/* Transfer of a tool's contact (tool_contact.h). */
#include "server/sim/contact/tool_contact.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"

#include <stdlib.h>
#include <string.h>

void pal_tool_contact_end_blend(pal_tool_contact *h)
{
    h->hold.acts = h->hold.friction_due = false;
    h->hold.share = h->hold.part = 0;
    pal_set3(h->hold.now_N, 0, 0, 0);
}

void pal_tool_contact_free(pal_tool_contact *h)
{
    free(h->hold.node);
    free(h->hold.force_N);
    h->hold = (pal_contact_blend){.acts = false};
}

/* a force on an old node to the new nodes at its place */
static void add_node(const pal_interpolation *place, int32_t node, double scale, const double force_N[3], double *sum)
{
    for (int32_t k = place->start[node]; k < place->start[node + 1]; k++)
        pal_axpy3(sum + 3 * (size_t)place->point[k], scale * place->weight[k], force_N);
}

/* sum [body n_node][3] of the contacts' forces and of a transferred force that still acts */
static void sum_nodes(const pal_tool_contact *from, const pal_body *old, pal_contact_points *points,
                      const pal_interpolation *place, double *sum)
{
    pal_contact_points_begin_slots(points);
    for (int i = 0; i < from->n_contact; i++)
        pal_contact_points_add_force(points, old, from->contact[i].point, from->contact[i].force);
    (void)pal_contact_points_assemble(points, old);
    for (int i = 0; i < points->n_node; i++)
        add_node(place, points->node[i], 1, points->force + 3 * (size_t)points->node[i], sum);
    for (int i = 0; i < from->hold.n_node && from->hold.acts; i++)
        add_node(place, from->hold.node[i], from->hold.part, from->hold.force_N + 3 * (size_t)i, sum);
}

static bool keep_nodes(pal_contact_blend *hold, const double *sum, int n_node)
{
    int n = 0;
    for (int i = 0; i < n_node; i++) n += pal_dot3(sum + 3 * (size_t)i, sum + 3 * (size_t)i) > 0;
    hold->node = malloc(sizeof *hold->node * (size_t)(n + 1));
    hold->force_N = malloc(3 * sizeof *hold->force_N * (size_t)(n + 1));
    if (!hold->node || !hold->force_N) return false;
    for (int i = 0; i < n_node; i++) {
        if (!(pal_dot3(sum + 3 * (size_t)i, sum + 3 * (size_t)i) > 0)) continue;
        pal_copy3(hold->force_N + 3 * (size_t)hold->n_node, sum + 3 * (size_t)i);
        hold->node[hold->n_node++] = i;
    }
    return true;
}

static void take_force(pal_tool_contact *to, const pal_body *body, const pal_tool_contact *from, const pal_body *old,
                       pal_contact_points *points, const pal_interpolation *place)
{
    double *sum = calloc(3 * (size_t)body->n_node + 1, sizeof *sum);
    if (sum && pal_finite3(from->total) && pal_norm3(from->total) > 0) {
        sum_nodes(from, old, points, place, sum);
        to->hold.acts = keep_nodes(&to->hold, sum, body->n_node);
    }
    free(sum);
    if (!to->hold.acts) return;
    to->hold.friction_due = true;
    pal_set3(to->hold.total_N, 0, 0, 0);
    for (int i = 0; i < to->hold.n_node; i++)
        pal_sub3(to->hold.total_N, to->hold.total_N, to->hold.force_N + 3 * (size_t)i);
    pal_copy3(to->total, to->hold.total_N);
}

/* the same body in another world */
static void keep_state(pal_tool_contact *to, const pal_tool_contact *from)
{
    to->share = from->share;
    to->stiffness = from->stiffness;
    if (!to->implicit || !from->implicit) return;
    pal_copy3(to->implicit->solve.next_slip_m, from->implicit->solve.next_slip_m);
    to->implicit->solve.next_slides = from->implicit->solve.next_slides;
    to->implicit->solve.normal_N = from->implicit->solve.normal_N;
}

void pal_tool_contact_transfer(pal_tool_contact *to, const pal_body *body, const pal_tool_contact *from,
                               const pal_body *old, pal_contact_points *points, const pal_interpolation *place,
                               double k_N_m)
{
    pal_tool_contact_free(to);
    to->active = from->active;
    to->proxy = from->proxy;
    to->ramp = from->ramp;
    to->time_behind_s = from->time_behind_s;
    to->uncapped_N = from->uncapped_N;
    to->patches = from->patches;
    pal_copy3(to->slip, from->slip);
    if (!from->active) return;
    if (to->implicit) {
        pal_copy3(to->implicit->last_m, from->implicit ? from->implicit->last_m : from->limits.b);
        to->implicit->back_m = from->implicit ? from->implicit->back_m : 0;
    }
    if (!place) keep_state(to, from);
    if (!place) return;
    pal_copy3(to->hold.at_m, from->implicit ? from->implicit->last_m : from->limits.b);
    to->hold.k_N_m = k_N_m;
    take_force(to, body, from, old, points, place);
}

void pal_tool_contact_blend(pal_tool_contact *h, pal_step *step, pal_tool *tool, const double here_m[3])
{
    pal_contact_blend *hold = &h->hold;
    double back[3], size = pal_norm3(hold->total_N);
    if (!hold->acts) return;
    if (!hold->begun) hold->ramp = tool->ramp, hold->share = 1, hold->begun = true;
    hold->share = pal_blend_toward(hold->share, 0, step->dt_s, PAL_BLEND_S);
    if (hold->share == 0) pal_tool_contact_end_blend(h);
    if (!hold->acts) return;
    pal_sub3(back, here_m, hold->at_m);
    double less_N = hold->k_N_m * fmax(0, pal_dot3(back, hold->total_N) / size);
    hold->part = hold->share * fmax(0, 1 - less_N / size) * (hold->ramp > 0 ? fmin(1, tool->ramp / hold->ramp) : 0);
    for (int i = 0; i < hold->n_node; i++)
        pal_axpy3(step->body->load + 3 * (size_t)hold->node[i], hold->part, hold->force_N + 3 * (size_t)i);
    pal_scale3(hold->now_N, hold->part, hold->total_N);
    pal_add3(tool->force_N, tool->force_N, hold->now_N);
    tool->touching = tool->touching || hold->part > 0;
}

bool pal_tool_contact_friction(pal_tool_contact *h, double stiffness_N_m, double slip_m[3])
{
    if (!h->hold.friction_due || !(stiffness_N_m > 0) || !(h->hold.share < 1)) return false;
    h->hold.friction_due = false;
    /* on tissue; contact has 1 - s of its stiffness as yet */
    pal_scale3(slip_m, -(1 - h->hold.share) / stiffness_N_m, h->hold.total_N);
    return true;
}
