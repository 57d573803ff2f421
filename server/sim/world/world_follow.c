/* A world that goes on where another is (pal_world_follow). */
#include "server/base/vec3.h"
#include "server/sim/springs/spring_tangle.h"
#include "server/sim/surface/shell_like.h"
#include "server/sim/world/world_parts.h"

#include <string.h>

/* lasting loads of a body that is the same one in both worlds; without memory it has none */
static void copy_loads(pal_world *w, pal_body *to, const pal_body *from)
{
    size_t n = 3 * (size_t)to->n_node;
    if (!from->outer || to->n_node != from->n_node) return;
    if (!to->outer) to->outer = PAL_NEW(w->arena, double, n);
    if (to->outer) memcpy(to->outer, from->outer, n * sizeof *to->outer);
}

/* the node nearest to a place at rest, scene frame */
static int nearest_node(const pal_body *body, const double at_m[3])
{
    double x[3], least = INFINITY;
    int best = 0;
    pal_sub3(x, at_m, body->offset_m);
    for (int i = 0; i < body->n_node; i++) {
        double far = pal_dist3(body->node_rest + 3 * (size_t)i, x);
        if (far < least) least = far, best = i;
    }
    return best;
}

void pal_world_loads_by_place(pal_world *w, int b, const pal_world *before)
{
    const pal_body *from = &before->plan.body[b];
    pal_body *to = &w->plan.body[b];
    size_t n = 3 * (size_t)to->n_node;
    if (!from->outer || n == 0) return;
    if (!to->outer) to->outer = PAL_NEW(w->arena, double, n);
    if (!to->outer) return;
    memset(to->outer, 0, n * sizeof *to->outer);
    for (int i = 0; i < from->n_node; i++) {
        const double *force = from->outer + 3 * (size_t)i;
        double at[3];
        if (pal_dot3(force, force) == 0) continue;
        pal_add3(at, from->node_rest + 3 * (size_t)i, from->offset_m);
        double *sum = to->outer + 3 * (size_t)nearest_node(to, at);
        pal_add3(sum, sum, force);
    }
}

static bool same_shell(const pal_body *a, const pal_body *b)
{
    return a->shell && b->shell && a->n_dof == b->n_dof && a->shell->levels.n_level == b->shell->levels.n_level &&
           a->shell->n_slot == b->shell->n_slot;
}

/* a surface as it is refined and stands there */
static void follow_shell(pal_world *w, int b, const pal_world *before)
{
    const pal_body *from = &before->plan.body[b];
    pal_body *to = &w->plan.body[b];
    if (w->plan.n_of[PAL_STAGE_ADAPT][b] > 0) pal_shell_like(to, from);
    pal_shell_places(to, from, to->x, to->v);
    to->shell->spring_ramp = from->shell->spring_ramp;
    to->shell->shape_ramp = from->shell->shape_ramp;
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_ADAPT][b] && i < before->plan.n_of[PAL_STAGE_ADAPT][b]; i++) {
        const pal_row *row = &w->plan.row[w->plan.first[PAL_STAGE_ADAPT][b] + i];
        const pal_row *was = &before->plan.row[before->plan.first[PAL_STAGE_ADAPT][b] + i];
        if (row->effect == was->effect && row->effect->hand)
            row->effect->hand(row->self, to, was->self, &(pal_hand){.from = from});
    }
}

static void follow_body(pal_world *w, int b, const pal_body *from, const double *x, const double *v)
{
    pal_body *to = &w->plan.body[b];
    size_t n_byte = 3 * sizeof(double) * (size_t)to->n_dof;
    if (x) memcpy(to->x, x, n_byte);
    if (v) memcpy(to->v, v, n_byte);
    /* what is held from now on stands still */
    for (int i = 0; i < to->n_dof; i++)
        if (to->held[i] == 1) pal_set3(to->v + 3 * (size_t)i, 0, 0, 0);
    pal_body_place(to);
    to->frozen = from->frozen;
    memcpy(to->why, from->why, sizeof to->why);
    to->rescue = from->rescue;
    to->brake_1_s = from->brake_1_s, to->brake_s = from->brake_s;
    const bool same = to->tangle && from->tangle && to->n_node == from->n_node;
    if (same && !memcmp(to->x_rest, from->x_rest, n_byte)) pal_spring_tangle_follow(to->tangle, from->tangle);
    pal_world_moved(w, b);
}

void pal_world_follow(pal_world *world, const pal_world *before, int edited, const double *x, const double *v)
{
    pal_world *w = world;
    w->time_s = before->time_s, w->tick = before->tick, w->end_ns = before->end_ns;
    w->tools = before->tools;
    memcpy(w->asked, before->asked, sizeof w->asked);
    memcpy(w->has_asked, before->has_asked, sizeof w->has_asked);
    memcpy(w->pose_ns, before->pose_ns, sizeof w->pose_ns);
    for (int b = 0; b < w->plan.n_body && b < before->plan.n_body; b++) {
        const pal_body *from = &before->plan.body[b];
        /* changed while this world was made */
        if (memcmp(&w->material[b], &before->material[b], sizeof w->material[b]) != 0)
            (void)pal_world_material(w, b, &before->material[b], NULL);
        bool other = b != edited, shell = other && same_shell(&w->plan.body[b], from),
             same = other && !w->plan.body[b].shell && w->plan.body[b].n_dof == from->n_dof;
        if (shell) follow_shell(w, b, before);
        if (shell || same) copy_loads(w, &w->plan.body[b], from);
        follow_body(w, b, from, same ? from->x : other ? NULL : x, same ? from->v : other ? NULL : v);
    }
    pal_world_show_all(w);
}
