/* Packing of a body's active dofs, and FORCE components on them. */
#include "server/sim/surface/active_nodes.h"

#include "server/sim/core/tuning.h"

pal_err pal_active_nodes_make(const pal_build *build)
{
    pal_body *body = build->body;
    pal_arena *arena = build->body_arena ? build->body_arena : build->arena;
    if (body->active_nodes) return PAL_ERR_OK;
    pal_active_nodes *pack = PAL_NEW(arena, pal_active_nodes, 1);
    if (!pack) return PAL_ERR_MEMORY;
    const int n_line = (body->n_dof + PAL_LANES - 1) & -PAL_LANES;
    if (build->scene->threads > 1) pack->first_copy = pack->n_copy = n_line;
    pack->xv = PAL_NEW(arena, pal_v8, n_line + pack->n_copy);
    pack->f = PAL_NEW(arena, pal_quad, n_line + pack->n_copy);
    pack->rest = PAL_NEW(arena, pal_quad, body->n_dof);
    if (!pack->xv || !pack->f || !pack->rest) return PAL_ERR_MEMORY;
    body->active_nodes = pack;
    return PAL_ERR_OK;
}

int pal_active_parts(const pal_body *body)
{
    const int max = body->n_active / PAL_PART_ACTIVE, size = body->team ? pal_team_size(body->team) : 1;
    return max < 1 ? 1 : max < size ? max : size;
}

static void load_part(void *user, int worker, int part)
{
    const pal_body *body = *(const pal_body *const *)user;
    const int n_part = pal_active_parts(body), end = pal_active_first(body, n_part, part + 1);
    (void)worker;
    for (int k = pal_active_first(body, n_part, part); k < end; k++) pal_active_node_load(body, k);
}

void pal_active_nodes_load(const pal_body *body)
{
    pal_team_run(body->team, pal_active_parts(body), load_part, &body);
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
