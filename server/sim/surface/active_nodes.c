/* Packing of a body's active dofs, and FORCE components on them. */
#include "server/sim/surface/active_nodes.h"

pal_err pal_active_nodes_make(pal_body *body, pal_arena *arena)
{
    if (body->active_nodes) return PAL_ERR_OK;
    pal_active_nodes *pack = PAL_NEW(arena, pal_active_nodes, 1);
    if (!pack) return PAL_ERR_MEMORY;
    pack->xv = PAL_NEW(arena, pal_v8, body->n_dof);
    pack->f = PAL_NEW(arena, pal_quad, body->n_dof);
    pack->rest = PAL_NEW(arena, pal_quad, body->n_dof);
    if (!pack->xv || !pack->f || !pack->rest) return PAL_ERR_MEMORY;
    body->active_nodes = pack;
    return PAL_ERR_OK;
}

void pal_active_nodes_load(const pal_body *body)
{
    pal_active_nodes *pack = body->active_nodes;
    for (int k = 0; k < body->n_active; k++) {
        size_t i = (size_t)pal_body_point(body, k);
        pal_quad rest = pal_quad_load(body->x_rest + 3 * i);
        rest[3] = body->mass_kg[i];
        pack->rest[k] = rest;
        pack->xv[k] = pal_v8_join(pal_quad_load(body->x + 3 * i), pal_quad_load(body->v + 3 * i));
    }
}

bool pal_active_nodes_complete(const pal_step *step)
{
    for (int i = 0; i < step->n_force; i++) {
        const pal_effect *effect = step->force[i].effect;
        if (!effect->compute_forces && !(step->drag_separate && effect->drag)) return false;
    }
    return !step->body->interpolation;
}

pal_err pal_active_nodes_run(void *self, pal_step *step, pal_err (*pull)(void *self, pal_step *step))
{
    pal_body *body = step->body;
    pal_active_nodes_load(body);
    for (int k = 0; k < body->n_active; k++) body->active_nodes->f[k] = (pal_quad){0};
    PAL_TRY(pull(self, step));
    for (int k = 0; k < body->n_active; k++) {
        double *f = body->f + 3 * (size_t)pal_body_point(body, k);
        pal_quad_store(f, pal_quad_load(f) + body->active_nodes->f[k]);
    }
    return PAL_ERR_OK;
}
