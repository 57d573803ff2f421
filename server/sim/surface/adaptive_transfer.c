/* One adaptive surface after another: refinement, places. */
#include "server/sim/surface/adaptive_transfer.h"

#include "server/base/vec3.h"

void pal_adaptive_copy_refinement(pal_body *to, const pal_body *from)
{
    const pal_levels *levels = &to->model.adaptive->levels;
    int n_level =
        levels->n_level < from->model.adaptive->levels.n_level ? levels->n_level : from->model.adaptive->levels.n_level;
    pal_adaptive_set_level(to->model.adaptive, to, 0);
    (void)pal_adaptive_update(to->model.adaptive, to);
    for (int32_t f = 0; n_level > 1 && f < levels->first_face[n_level - 1]; f++)
        if (from->model.adaptive->face_state[f] == PAL_FACE_SPLIT)
            (void)pal_adaptive_split(to->model.adaptive, to, f, 0);
    (void)pal_adaptive_update(to->model.adaptive, to);
}

void pal_adaptive_transfer_state(const pal_body *to, const pal_body *from, double *x, double *v)
{
    const pal_levels *levels = &to->model.adaptive->levels;
    for (int32_t i = 0; i < to->n_dof; i++) {
        double *xi = x + 3 * (size_t)i, *vi = v + 3 * (size_t)i;
        pal_copy3(xi, to->x_rest + 3 * (size_t)i);
        pal_set3(vi, 0, 0, 0);
        if (!pal_adaptive_has(to->model.adaptive, i)) continue;
        if (pal_dofs_has(&from->dofs, i)) {
            pal_copy3(xi, from->x + 3 * (size_t)i);
            if (to->support[i] != PAL_FIXED) pal_copy3(vi, from->v + 3 * (size_t)i);
            continue;
        }
        if (to->support[i] == PAL_FIXED) continue;
        const int32_t *end = levels->edge[pal_levels_vertex_parent(levels, i)].vertex;
        for (int k = 0; k < 2; k++) {
            pal_axpy3(xi, 0.5, x + 3 * (size_t)end[k]);
            pal_axpy3(xi, -0.5, to->x_rest + 3 * (size_t)end[k]);
            pal_axpy3(vi, 0.5, v + 3 * (size_t)end[k]);
        }
    }
}
