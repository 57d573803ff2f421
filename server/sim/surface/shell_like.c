/* One adaptive surface after another: refinement, places. */
#include "server/sim/surface/shell_like.h"

#include "server/base/vec3.h"

void pal_shell_like(pal_body *to, const pal_body *from)
{
    const pal_levels *levels = &to->shell->levels;
    int n_level = levels->n_level < from->shell->levels.n_level ? levels->n_level : from->shell->levels.n_level;
    pal_shell_level(to->shell, to, 0);
    (void)pal_shell_update(to->shell, to);
    for (int32_t f = 0; n_level > 1 && f < levels->first_face[n_level - 1]; f++)
        if (from->shell->face_state[f] == PAL_FACE_SPLIT) (void)pal_shell_split(to->shell, to, f, 0);
    (void)pal_shell_update(to->shell, to);
}

void pal_shell_places(const pal_body *to, const pal_body *from, double *x, double *v)
{
    const pal_levels *levels = &to->shell->levels;
    for (int32_t i = 0; i < to->n_dof; i++) {
        double *xi = x + 3 * (size_t)i, *vi = v + 3 * (size_t)i;
        pal_copy3(xi, to->x_rest + 3 * (size_t)i);
        pal_set3(vi, 0, 0, 0);
        if (!pal_shell_has(to->shell, i)) continue;
        if (pal_shell_uses(from->shell, i)) {
            pal_copy3(xi, from->x + 3 * (size_t)i);
            if (to->held[i] != 1) pal_copy3(vi, from->v + 3 * (size_t)i);
            continue;
        }
        if (to->held[i] == 1) continue;
        const int32_t *end = levels->edge[pal_levels_vertex_parent(levels, i)].vertex;
        for (int k = 0; k < 2; k++) {
            pal_axpy3(xi, 0.5, x + 3 * (size_t)end[k]);
            pal_axpy3(xi, -0.5, to->x_rest + 3 * (size_t)end[k]);
            pal_axpy3(vi, 0.5, v + 3 * (size_t)end[k]);
        }
    }
}
