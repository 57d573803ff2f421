/* Stiffness at rest by differences of forces, and its preconditioner (rest_stiffness.h). */
#include "server/sim/implicit/rest_stiffness.h"

#include "server/sim/implicit/tuning.h"

#include <math.h>
#include <string.h>

/* the elements whose edges are springs; false: the body has none of these */
static bool find_elements(const pal_body *body, pal_cliques *out)
{
    if (body->active)
        *out = (pal_cliques){.n_item = body->dofs.n_slot, .n_corner = 3, .node = body->dofs.slot};
    else if (body->element)
        *out = (pal_cliques){.n_item = body->n_element, .n_corner = body->n_corner, .node = body->element};
    else if (body->tets)
        *out = (pal_cliques){.n_item = body->tets->n_tet, .n_corner = 4, .node = body->tets->tet};
    return body->active || body->element || body->tets;
}

/* body->g with the group's points moved by move_m along the axis from rest */
static void find_forces(const pal_system *system, const int32_t *point, int n, int axis, double move_m)
{
    pal_body *body = system->body;
    pal_step step = {.body = body, .force = system->force, .n_force = system->n_force, .drag_separate = true};
    for (int i = 0; i < n; i++) body->x[3 * point[i] + axis] = body->x_rest[3 * point[i] + axis] + move_m;
    (void)pal_assemble_forces(&step);
    for (int i = 0; i < n; i++) body->x[3 * point[i] + axis] = body->x_rest[3 * point[i] + axis];
}

pal_err pal_rest_stiffness_find(const pal_system *system, pal_arena *arena, pal_block_matrix *out)
{
    pal_body *body = system->body;
    pal_cliques elements;
    if (!find_elements(body, &elements)) return PAL_ERR_BUDGET;
    PAL_TRY(pal_block_matrix_make(body->n_dof, &elements, 1, arena, out));
    pal_interpolated_system groups = {.rest = *out};
    PAL_TRY(pal_interpolated_system_group(&groups, body, arena));
    if (6.0 * groups.n_group * body->n_dof > PAL_PROBE_WORK_MAX) return PAL_ERR_BUDGET;
    double *low = PAL_NEW(arena, double, 3 * (size_t)body->n_dof), move_m = PAL_DIFFERENCE_H * body->edge_m;
    if (!low) return PAL_ERR_MEMORY;
    for (int move = 0; move < 3 * groups.n_group; move++) {
        const int axis = move % 3, first = groups.start[move / 3], n = groups.start[move / 3 + 1] - first;
        const int32_t *point = groups.point + first;
        find_forces(system, point, n, axis, -move_m);
        memcpy(low, body->g, pal_body_bytes3(body));
        find_forces(system, point, n, axis, move_m);
        for (int32_t i = 0; i < n; i++)
            for (int32_t k = out->start[point[i]]; k < out->start[point[i] + 1]; k++)
                for (int c = 0; c < 3; c++) {
                    const int at = 3 * out->row[k] + c;
                    out->value[9 * (size_t)k + (size_t)(3 * c + axis)] = (low[at] - body->g[at]) / (2 * move_m);
                }
    }
    memset(body->g, 0, pal_body_bytes3(body));
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    /* forces leave traces in what components keep from one to the next: a new world equals a reset one */
    for (int i = 0; i < system->n_force; i++)
        if (system->force[i].effect->reset) system->force[i].effect->reset(system->force[i].self, body);
    return PAL_ERR_OK;
}

double pal_rest_stiffness_scale_1_s2(const pal_body *body, const pal_block_matrix *blocks, const uint8_t *skip)
{
    double max = 0;
    for (int i = 0; i < body->n_dof; i++)
        for (size_t c = 0; c < 3 && !skip[i] && body->mass_kg[i] > 0; c++)
            max = fmax(max, blocks->value[9 * (size_t)blocks->start[i] + 4 * c] / body->mass_kg[i]);
    return max;
}

pal_err pal_rest_preconditioner_make(const pal_body *body, pal_block_matrix *blocks, const uint8_t *skip,
                                     pal_arena *arena, pal_rest_preconditioner *out)
{
    const double spacing_m = body->dofs.spacing_m > 0 ? body->dofs.spacing_m : body->edge_m,
                 scale_1_s2 = pal_rest_stiffness_scale_1_s2(body, blocks, skip);
    memset(out, 0, sizeof *out);
    for (int i = 0; i < body->n_dof; i++)
        for (size_t c = 0; c < 3; c++) {
            double *at = &blocks->value[9 * (size_t)blocks->start[i] + 4 * c];
            *at += PAL_FREQUENCY_SHIFT * fmax(scale_1_s2 * body->mass_kg[i], *at);
        }
    PAL_TRY(
        pal_rigid_clusters_make(blocks, body->x_rest, skip, PAL_FREQUENCY_CLUSTER * spacing_m, arena, &out->clusters));
    PAL_TRY(pal_incomplete_cholesky_make(blocks, skip, arena, &out->incomplete));
    return pal_incomplete_cholesky_factor(&out->incomplete, blocks);
}

void pal_rest_preconditioner_solve(const pal_rest_preconditioner *p, const double *r, double *out)
{
    pal_incomplete_cholesky_solve(&p->incomplete, r, out);
    pal_rigid_clusters_add(&p->clusters, r, out);
}

void pal_rest_preconditioner_destroy(pal_rest_preconditioner *p)
{
    pal_rigid_clusters_destroy(&p->clusters);
}
