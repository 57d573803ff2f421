/* The model's side of pal_dofs (dofs.h) for adaptive surfaces. */
#include "server/sim/surface/adaptive_surface.h"
#include "server/sim/surface/adaptive_transfer.h"

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

static void transfer(pal_body *to, const pal_body *from, bool refine, double *x, double *v)
{
    if (refine) pal_adaptive_copy_refinement(to, from);
    pal_adaptive_transfer_state(to, from, x, v);
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
