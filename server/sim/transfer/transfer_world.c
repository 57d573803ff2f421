/* Transfer of a world (transfer_world.h). */
#include "server/sim/transfer/transfer_world.h"

#include "server/base/vec3.h"
#include "server/sim/springs/spring_recovery.h"
#include "server/sim/world/world_core.h"

#include <string.h>

/* lasting loads of the same body in both worlds; without memory it has none */
static void copy_loads(pal_world *w, int b, const pal_body *from)
{
    double *to = from->external_force ? pal_world_external_force(w, b) : NULL;
    if (to) memcpy(to, from->external_force, 3 * sizeof *to * (size_t)from->n_node);
}

/* the node nearest to a place at rest, scene frame */
static int nearest_node(const pal_body *body, const double at_m[3])
{
    double x[3], min = INFINITY;
    int best = 0;
    pal_sub3(x, at_m, body->offset_m);
    for (int i = 0; i < body->n_node; i++) {
        double far = pal_dist3(body->node_rest + 3 * (size_t)i, x);
        if (far < min) min = far, best = i;
    }
    return best;
}

void pal_world_transfer_loads(pal_world *w, int b, const pal_world *before)
{
    const pal_body *from = &before->plan.body[b];
    const pal_body *to = &w->plan.body[b];
    double *load = from->external_force && to->n_node > 0 ? pal_world_external_force(w, b) : NULL;
    if (!load) return;
    memset(load, 0, 3 * sizeof *load * (size_t)to->n_node);
    for (int i = 0; i < from->n_node; i++) {
        const double *force = from->external_force + 3 * (size_t)i;
        double at[3];
        if (pal_dot3(force, force) == 0) continue;
        pal_add3(at, from->node_rest + 3 * (size_t)i, from->offset_m);
        double *sum = load + 3 * (size_t)nearest_node(to, at);
        pal_add3(sum, sum, force);
    }
}

static bool same_surface(const pal_body *a, const pal_body *b)
{
    return a->active && b->active && a->n_dof == b->n_dof && a->dofs.levels->n_level == b->dofs.levels->n_level &&
           a->dofs.n_slot == b->dofs.n_slot;
}

/* an adaptive surface takes over refinement, state and what its ADAPT components know */
static void transfer_surface(pal_world *w, int b, const pal_world *before)
{
    const pal_body *from = &before->plan.body[b];
    pal_body *to = &w->plan.body[b];
    to->dofs.transfer(to, from, w->plan.n_of[PAL_STAGE_ADAPT][b] > 0, to->x, to->v);
    for (int k = 0; k < 2; k++) *to->dofs.ramp[k] = *from->dofs.ramp[k];
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_ADAPT][b] && i < before->plan.n_of[PAL_STAGE_ADAPT][b]; i++) {
        const pal_component *row = &w->plan.row[w->plan.first[PAL_STAGE_ADAPT][b] + i];
        const pal_component *was = &before->plan.row[before->plan.first[PAL_STAGE_ADAPT][b] + i];
        if (row->effect == was->effect && row->effect->transfer)
            row->effect->transfer(row->self, to, was->self, &(pal_component_transfer){.from = from});
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
    size_t n_byte = 3 * sizeof(double) * (size_t)to->n_dof;
    pal_transfer_set_state(to, x, v);
    to->frozen = from->frozen;
    memcpy(to->reason, from->reason, sizeof to->reason);
    to->safeguards = from->safeguards;
    to->stiffening_damping_1_s = from->stiffening_damping_1_s, to->stiffening_damping_s = from->stiffening_damping_s;
    const bool same = to->recovery && from->recovery && to->n_node == from->n_node;
    if (same && !memcmp(to->x_rest, from->x_rest, n_byte)) pal_spring_recovery_transfer(to->recovery, from->recovery);
    pal_world_invalidate_limits(w, b);
}

void pal_world_transfer(pal_world *world, const pal_world *before, int edited, const double *x, const double *v)
{
    pal_world *w = world;
    w->time_s = before->time_s, w->tick = before->tick, w->end_ns = before->end_ns;
    w->tools = before->tools;
    memcpy(w->asked, before->asked, sizeof w->asked);
    memcpy(w->has_requested_pose, before->has_requested_pose, sizeof w->has_requested_pose);
    memcpy(w->pose_ns, before->pose_ns, sizeof w->pose_ns);
    for (int b = 0; b < w->plan.n_body && b < before->plan.n_body; b++) {
        const pal_body *from = &before->plan.body[b];
        /* changed while this world was made */
        if (memcmp(&w->material[b], &before->material[b], sizeof w->material[b]) != 0)
            (void)pal_world_material(w, b, &before->material[b], NULL);
        bool other = b != edited, adaptive = other && same_surface(&w->plan.body[b], from),
             same = other && !w->plan.body[b].active && w->plan.body[b].n_dof == from->n_dof;
        if (adaptive) transfer_surface(w, b, before);
        if (adaptive || same) copy_loads(w, b, from);
        transfer_body(w, b, from, same ? from->x : other ? NULL : x, same ? from->v : other ? NULL : v);
    }
    pal_world_show_all(w);
}
