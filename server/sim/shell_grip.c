/* Weights of a grip on a body that adapts (shell_grip.h). */
#include "server/sim/shell_grip.h"

#include "server/base/vec3.h"
#include "server/sim/shell.h"

#include <math.h>

pal_err pal_in_use_make(const pal_body *body, pal_arena *arena, pal_in_use **out)
{
    size_t n_node = (size_t)body->n_node;
    pal_in_use *use = PAL_NEW(arena, pal_in_use, 1);
    if (!use) return PAL_ERR_MEMORY;
    use->point = PAL_NEW(arena, int32_t, n_node);
    use->known = PAL_NEW(arena, uint8_t, n_node);
    if (!use->point || !use->known) return PAL_ERR_MEMORY;
    pal_in_use_look(use, body);
    *out = use;
    return PAL_ERR_OK;
}

void pal_in_use_look(pal_in_use *use, const pal_body *body)
{
    for (int i = 0; i < use->n; i++) use->known[use->point[i]] = 0;
    use->n = body->n_active;
    for (int i = 0; i < use->n; i++) use->known[use->point[i] = body->active[i]] = 1;
    use->revision = body->revision;
}

/* what a point weighs, or would if it had been there before */
static double weight_of(const pal_in_use *use, const pal_levels *levels, int32_t point, const double *weight)
{
    int32_t edge = pal_levels_vertex_parent(levels, point);
    if (use->known[point] || edge < 0) return fabs(weight[point]);
    const int32_t *end = levels->edge[edge].vertex;
    return 0.5 * (weight_of(use, levels, end[0], weight) + weight_of(use, levels, end[1], weight));
}

/* a point that is gone: its weight to the ends of its edge, below 0 where they were not in the grip before, unless one
 * was; those that are gone themselves hand it on */
static void hand_on(const pal_shell *shell, int32_t point, double *weight)
{
    double own = fabs(weight[point]);
    const int32_t *end = shell->levels.edge[pal_levels_vertex_parent(&shell->levels, point)].vertex;
    weight[point] = 0;
    if (own == 0 || weight[end[0]] > 0 || weight[end[1]] > 0) return;
    for (int k = 0; k < 2; k++) {
        weight[end[k]] -= 0.5 * own;
        if (!pal_shell_has(shell, end[k])) hand_on(shell, end[k], weight);
    }
}

void pal_in_use_weigh(const pal_in_use *use, const pal_body *body, const int32_t *node, int n_node, double *weight)
{
    const pal_shell *shell = body->shell;
    /* finest first, so that the ends of an edge are asked while they still weigh */
    for (int level = shell->levels.n_level - 1; level > 0; level--)
        for (int i = 0; i < n_node; i++)
            if (shell->levels.vertex_level[node[i]] == level && !pal_shell_has(shell, node[i]))
                hand_on(shell, node[i], weight);
    for (int k = 0; k < body->n_active; k++) {
        int32_t i = body->active[k];
        if (!use->known[i]) weight[i] = weight_of(use, &shell->levels, i, weight);
    }
    for (int k = 0; k < body->n_active; k++) weight[body->active[k]] = fabs(weight[body->active[k]]);
}

void pal_live_grip_keep(pal_live_grip *l, const double quat[4], const double y[3], const double v[3], double k_N_m,
                        double dt_s, double offset[3], double goal[3])
{
    double fade = fmax(0, 1 - dt_s / PAL_LIVE_SHIFT_S);
    pal_scale3(l->shift, fade, l->shift);
    if (l->renewed && k_N_m > 0) {
        double moved[3], back[4] = {quat[0], -quat[1], -quat[2], -quat[3]};
        pal_sub3(moved, y, l->y);
        pal_axpy3(moved, -l->dt_s, v);
        pal_add3(goal, goal, moved);
        pal_quat_rotate(moved, back, moved);
        pal_add3(offset, offset, moved);
        pal_scale3(l->shift, l->k_N_m / k_N_m, l->shift);
        for (int c = 0; c < 3; c++) l->shift[c] += (l->k_N_m / k_N_m - 1) * (goal[c] - y[c]);
    }
    if (!pal_finite3(l->shift)) pal_set3(l->shift, 0, 0, 0);
    pal_add3(goal, goal, l->shift);
    pal_copy3(l->y, y);
    l->k_N_m = k_N_m;
    l->dt_s = dt_s;
    l->renewed = false;
}
