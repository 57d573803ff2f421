/* The model's side of pal_dofs (dofs.h) for adaptive surfaces. */
#include "server/sim/surface/adaptive_surface.h"

#include "server/base/vec3.h"

static void scale_mass(pal_body *body, double factor)
{
    pal_adaptive_surface *s = body->model.adaptive;
    s->options.mass_kg *= factor;
    for (int k = 0; k < s->levels.n_level; k++) s->level_mass_kg[k] *= factor;
}

static pal_err check_memory(const pal_body *body, size_t n_byte, pal_diagnostic *diag)
{
    return pal_adaptive_check_bytes(body->model.adaptive, n_byte, diag);
}

/* ---- transfer between two surfaces with the same coarse triangles, whatever number of levels both have ---- */

/* splits in `to` the faces that are split in `from`, as far as its levels go, from rest; with the same levels the state
 * is the same */
static void copy_refinement(pal_body *to, const pal_body *from)
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

/* positions and velocities [to->n_dof][3] of the present nodes of `to`: those of `from`; a vertex that is no node there
 * is between the ends of its edge, as far off it as at rest, or at rest when it is fixed. x, v may be those of `to`
 */
static void transfer_state(const pal_body *to, const pal_body *from, double *x, double *v)
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

static void transfer(pal_body *to, const pal_body *from, bool refine, double *x, double *v)
{
    if (refine) copy_refinement(to, from);
    transfer_state(to, from, x, v);
}

void pal_adaptive_fill_dofs(pal_adaptive_surface *s, pal_body *body)
{
    body->dofs = (pal_dofs){.levels = &s->levels,
                            .edge_split = s->edge_split,
                            .face_state = s->face_state,
                            .finest = s->finest,
                            .n_spring = s->n_spring,
                            .ramp = {&s->spring_ramp, &s->shape_ramp},
                            .n_slot = s->n_slot,
                            .slot = s->slot,
                            .n_log = s->n_log,
                            .n_log_room = s->n_log_room,
                            .log = s->log,
                            .scale_mass = scale_mass,
                            .check_memory = check_memory,
                            .transfer = transfer};
}
