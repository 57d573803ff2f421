/* Transfer of a world (transfer_world.h). */
#include "server/sim/transfer/transfer_world.h"

#include "server/base/vec3.h"
#include "server/sim/recovery/recovery.h"
#include "server/sim/world/world_core.h"

#include <string.h>

/* the node nearest at rest to x, body frame; guess: the node of the same number */
static int nearest_node(const pal_body *body, const double x[3], int guess)
{
    int best = guess < body->n_node ? guess : 0;
    double min = pal_dist3(body->node_rest + 3 * (size_t)best, x);
    for (int i = 0; i < body->n_node && min > 0; i++) {
        double distance = pal_dist3(body->node_rest + 3 * (size_t)i, x);
        if (distance < min) min = distance, best = i;
    }
    return best;
}

void pal_world_transfer_loads(pal_world *w, int b, const pal_body *from, const pal_interpolation *A)
{
    const pal_body *to = &w->plan.body[b];
    double *load = from->external_force && to->n_node > 0 ? pal_world_external_force(w, b) : NULL, shift[3];
    if (!load) return;
    memset(load, 0, 3 * sizeof *load * (size_t)to->n_node);
    pal_sub3(shift, from->offset_m, to->offset_m);
    if (A) pal_interpolation_apply_transpose(A, from->external_force, load);
    for (int i = 0; i < from->n_node && !A; i++) {
        const double *force = from->external_force + 3 * (size_t)i;
        double x[3];
        if (pal_dot3(force, force) == 0) continue;
        pal_add3(x, from->node_rest + 3 * (size_t)i, shift);
        double *sum = load + 3 * (size_t)nearest_node(to, x, i);
        pal_add3(sum, sum, force);
    }
}

static bool same_surface(const pal_body *a, const pal_body *b)
{
    return a->active && b->active && a->n_dof == b->n_dof && a->dofs.levels->n_level == b->dofs.levels->n_level &&
           a->dofs.n_slot == b->dofs.n_slot;
}

void pal_transfer_components(pal_world *next, int b, const pal_world *before, pal_stage stage,
                             const pal_component_transfer *by)
{
    const pal_plan *to = &next->plan, *from = &before->plan;
    for (int i = to->first[stage][b]; i < to->first[stage][b] + to->n_of[stage][b]; i++)
        for (int k = from->first[stage][b]; k < from->first[stage][b] + from->n_of[stage][b]; k++) {
            const pal_effect *effect = to->component[i].effect;
            if (effect != from->component[k].effect || !effect->transfer) continue;
            effect->transfer(to->component[i].self, &to->body[b], from->component[k].self, by);
            break;
        }
}

void pal_transfer_set_state(pal_body *body, const double *x, const double *v)
{
    size_t n_byte = 3 * sizeof(double) * (size_t)body->n_dof;
    if (x) memcpy(body->x, x, n_byte);
    if (v) memcpy(body->v, v, n_byte);
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i] == PAL_FIXED) pal_set3(body->v + 3 * (size_t)i, 0, 0, 0);
    pal_body_update_nodes(body);
}

static void transfer_body(pal_world *w, int b, const pal_body *from, const double *x, const double *v)
{
    pal_body *to = &w->plan.body[b];
    pal_transfer_set_state(to, x, v);
    to->frozen = from->frozen;
    memcpy(to->reason, from->reason, sizeof to->reason);
    to->safeguards = from->safeguards;
    pal_world_invalidate_limits(w, b);
}

static pal_recovery *find_recovery(const pal_world *w, int b)
{
    const pal_component *force = w->plan.component + w->plan.first[PAL_STAGE_FORCE][b];
    pal_recovery *found = NULL;
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_FORCE][b] && !found; i++)
        if (force[i].effect->recovery.state) found = force[i].effect->recovery.state(force[i].self);
    return found;
}

/* Recovery goes on where a body has the same elements, as at a switch of its supports. Other elements that are inverted
 * are found at once, so that what follows sees the forces of the next step */
static void transfer_recovery(pal_world *w, int b, const pal_world *before)
{
    pal_body *to = &w->plan.body[b];
    const pal_body *from = &before->plan.body[b];
    pal_recovery *of[2] = {find_recovery(w, b), find_recovery(before, b)};
    if (!of[0] || !pal_recovery_acts(of[1])) return;
    if (to->n_node == from->n_node &&
        !memcmp(to->node_rest, from->node_rest, 3 * sizeof(double) * (size_t)to->n_node)) {
        const bool same = to->n_dof == from->n_dof && !memcmp(to->support, from->support, (size_t)to->n_dof);
        pal_recovery_transfer(of[0], of[1], same);
        return;
    }
    pal_step step = {.body = to,
                     .force = w->plan.component + w->plan.first[PAL_STAGE_FORCE][b],
                     .n_force = w->plan.n_of[PAL_STAGE_FORCE][b],
                     .time_s = w->time_s};
    (void)pal_recovery_update(of[0], &step);
}

void pal_world_transfer(pal_world *world, const pal_world *before, int edited, const double *x, const double *v)
{
    pal_world *w = world;
    w->time_s = before->time_s, w->tick = before->tick, w->end_ns = before->end_ns;
    w->tools = before->tools;
    memcpy(w->requested_pose, before->requested_pose, sizeof w->requested_pose);
    memcpy(w->has_requested_pose, before->has_requested_pose, sizeof w->has_requested_pose);
    memcpy(w->pose_ns, before->pose_ns, sizeof w->pose_ns);
    for (int b = 0; b < w->plan.n_body && b < before->plan.n_body; b++) {
        const pal_body *from = &before->plan.body[b];
        /* changed while this world was made */
        if (memcmp(&w->material[b], &before->material[b], sizeof w->material[b]) != 0)
            (void)pal_world_material(w, b, &before->material[b], NULL);
        bool other = b != edited, adaptive = other && same_surface(&w->plan.body[b], from),
             same = other && !w->plan.body[b].active && w->plan.body[b].n_dof == from->n_dof;
        if (adaptive) { /* refinement, state and what its ADAPT components know */
            pal_body *to = &w->plan.body[b];
            to->dofs.transfer(to, from, w->plan.n_of[PAL_STAGE_ADAPT][b] > 0, to->x, to->v);
            for (int k = 0; k < 2; k++) *to->dofs.ramp[k] = *from->dofs.ramp[k];
            pal_transfer_components(w, b, before, PAL_STAGE_ADAPT, &(pal_component_transfer){.from = from});
        }
        if (adaptive || same) pal_world_transfer_loads(w, b, from, NULL);
        transfer_body(w, b, from, same ? from->x : other ? NULL : x, same ? from->v : other ? NULL : v);
        transfer_recovery(w, b, before);
    }
    pal_world_show_all(w);
}
