/* Lowest angular frequency at rest. */
#include "server/sim/implicit/lowest_frequency.h"

#include "server/num/incomplete_cholesky.h"
#include "server/num/lowest_mode.h"
#include "server/num/random.h"
#include "server/num/rigid_clusters.h"
#include "server/sim/implicit/system.h"
#include "server/sim/implicit/tuning.h"

#include <limits.h>
#include <math.h>
#include <string.h>

typedef struct search {
    pal_body *body;
    pal_system system;
    pal_block_matrix blocks; /* K + shift M at rest */
    bool assembled;          /* blocks give K v; else the components' tangents do */
    uint8_t *skip;           /* dofs that do not move [n_dof] */
    pal_incomplete_cholesky incomplete;
    pal_rigid_clusters clusters;
} search;

static void clear(const search *s, double *v)
{
    for (int i = 0; i < s->body->n_dof; i++)
        if (s->skip[i]) v[3 * i] = v[3 * i + 1] = v[3 * i + 2] = 0;
}

static void multiply_mass(void *user, const double *v, double *out)
{
    const search *s = user;
    pal_system_multiply_inertia(&s->system, 1, 0, v, out);
    clear(s, out);
}

static void multiply_stiffness(void *user, const double *v, double *out)
{
    const search *s = user;
    memset(out, 0, pal_body_bytes3(s->body));
    if (s->assembled)
        pal_block_matrix_multiply(&s->blocks, 1, v, out);
    else
        pal_system_multiply_stiffness(&s->system, 1, v, out);
    clear(s, out);
}

static void precondition(void *user, const double *r, double *out)
{
    const search *s = user;
    pal_incomplete_cholesky_solve(&s->incomplete, r, out);
    pal_rigid_clusters_add(&s->clusters, r, out);
}

/* ---- K by differences of forces ---- */

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
static void find_forces(const search *s, const int32_t *point, int n, int axis, double move_m)
{
    pal_body *body = s->body;
    pal_step step = {.body = body, .force = s->system.force, .n_force = s->system.n_force, .drag_separate = true};
    for (int i = 0; i < n; i++) body->x[3 * point[i] + axis] = body->x_rest[3 * point[i] + axis] + move_m;
    (void)pal_assemble_forces(&step);
    for (int i = 0; i < n; i++) body->x[3 * point[i] + axis] = body->x_rest[3 * point[i] + axis];
}

static pal_err probe(search *s, pal_arena *arena)
{
    pal_body *body = s->body;
    pal_interpolated_system groups = {.rest = s->blocks};
    PAL_TRY(pal_interpolated_system_group(&groups, body, arena));
    if (6.0 * groups.n_group * body->n_dof > PAL_PROBE_WORK_MAX) return PAL_ERR_BUDGET;
    double *low = PAL_NEW(arena, double, 3 * (size_t)body->n_dof), move_m = PAL_DIFFERENCE_H * body->edge_m;
    if (!low) return PAL_ERR_MEMORY;
    for (int move = 0; move < 3 * groups.n_group; move++) {
        const int axis = move % 3, first = groups.start[move / 3], n = groups.start[move / 3 + 1] - first;
        const int32_t *point = groups.point + first;
        find_forces(s, point, n, axis, -move_m);
        memcpy(low, body->g, pal_body_bytes3(body));
        find_forces(s, point, n, axis, move_m);
        for (int32_t i = 0; i < n; i++)
            for (int32_t k = s->blocks.start[point[i]]; k < s->blocks.start[point[i] + 1]; k++)
                for (int c = 0; c < 3; c++) {
                    const int at = 3 * s->blocks.row[k] + c;
                    s->blocks.value[9 * (size_t)k + (size_t)(3 * c + axis)] = (low[at] - body->g[at]) / (2 * move_m);
                }
    }
    memset(body->g, 0, pal_body_bytes3(body));
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    return PAL_ERR_OK;
}

/* ---- the search ---- */

/* pattern and values of K */
static pal_err assemble(search *s, const pal_build *build, bool tangents)
{
    pal_cliques elements;
    s->system.mass = 0, s->system.stiff = 1, s->system.damp = 0;
    if (!tangents) {
        if (!find_elements(s->body, &elements)) return PAL_ERR_BUDGET;
        PAL_TRY(pal_block_matrix_make(s->body->n_dof, &elements, 1, build->arena, &s->blocks));
        s->assembled = true;
        return probe(s, build->arena);
    }
    PAL_TRY(pal_system_pattern(&s->system, build->arena, &s->blocks));
    pal_system_linearise_rest(&s->system);
    (void)pal_system_probe(&s->system, INT_MAX);
    pal_system_assemble(&s->system, &s->blocks);
    return PAL_ERR_OK;
}

/* largest of diagonal over mass: of the order of the square of the highest frequency, 1/s^2 */
static double find_scale(const search *s)
{
    double max = 0;
    for (int i = 0; i < s->body->n_dof; i++)
        for (size_t c = 0; c < 3 && !s->skip[i] && s->body->mass_kg[i] > 0; c++)
            max = fmax(max, s->blocks.value[9 * (size_t)s->blocks.start[i] + 4 * c] / s->body->mass_kg[i]);
    return max;
}

/* an incomplete factor of K and the rigid motions of its clusters; K is shifted by a little mass where it is singular
 */
static pal_err make_preconditioner(search *s, pal_arena *arena, double scale_1_s2)
{
    const pal_body *body = s->body;
    const double spacing_m = body->dofs.spacing_m > 0 ? body->dofs.spacing_m : body->edge_m;
    for (int i = 0; i < body->n_dof; i++)
        for (size_t c = 0; c < 3; c++) {
            double *at = &s->blocks.value[9 * (size_t)s->blocks.start[i] + 4 * c];
            *at += PAL_FREQUENCY_SHIFT * fmax(scale_1_s2 * body->mass_kg[i], *at);
        }
    PAL_TRY(pal_rigid_clusters_make(&s->blocks, body->x_rest, s->skip, PAL_FREQUENCY_CLUSTER * spacing_m, arena,
                                    &s->clusters));
    PAL_TRY(pal_incomplete_cholesky_make(&s->blocks, s->skip, arena, &s->incomplete));
    return pal_incomplete_cholesky_factor(&s->incomplete, &s->blocks);
}

/* five digits: damping and sleep, which follow from the frequency, are then the same with every library that factors */
static double round_digits(double w_1_s)
{
    const double digit = pow(10, floor(log10(w_1_s)) - 4);
    return digit * nearbyint(w_1_s / digit);
}

static pal_err find(search *s, const pal_build *build, double *mode)
{
    pal_body *body = s->body;
    /* elements under an explicit solver are not made to linearise */
    bool tangents = body->implicit || body->interpolation;
    const size_t n = 3 * (size_t)body->n_dof;
    for (int i = 0; i < build->n_made; i++)
        tangents &= !build->made[i].effect->internal || build->made[i].effect->drag || build->made[i].effect->tangent;
    if (!tangents && body->interpolation) return PAL_ERR_BUDGET;
    PAL_TRY(pal_system_make(build, &s->system));
    s->skip = PAL_NEW(build->arena, uint8_t, body->n_dof);
    pal_lowest_mode m = {.n = (int)n,
                         .stiffness = multiply_stiffness,
                         .mass = multiply_mass,
                         .precondition = precondition,
                         .user = s,
                         .x = mode ? mode : PAL_NEW(build->arena, double, n),
                         .work = PAL_NEW(build->arena, double, 9 * n)};
    if (!s->skip || !m.x || !m.work) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_dof; i++) s->skip[i] = body->support[i] || (body->active && !(body->mass_kg[i] > 0));
    PAL_TRY(assemble(s, build, tangents));
    const double scale_1_s2 = find_scale(s);
    PAL_TRY(make_preconditioner(s, build->arena, scale_1_s2));
    for (size_t i = 0; i < n; i++) m.work[i] = pal_random_unit(7, i) - 0.5;
    multiply_mass(s, m.work, m.work + n);
    precondition(s, m.work + n, m.x);
    pal_lowest_mode_run(&m, PAL_FREQUENCY_TOLERANCE, PAL_FREQUENCY_ITERATIONS);
    if (!(m.lambda > PAL_FREQUENCY_ZERO * scale_1_s2)) return PAL_ERR_OK;
    body->lowest_1_s = round_digits(sqrt(m.lambda));
    body->lowest_error = m.error;
    return PAL_ERR_OK;
}

pal_err pal_lowest_frequency_find(const pal_build *build, double *mode)
{
    pal_arena *arena = pal_arena_create(1 << 20, true);
    if (!arena) return PAL_ERR_MEMORY;
    search s = {.body = build->body};
    pal_build own = *build;
    own.arena = arena, own.diag = NULL;
    build->body->lowest_1_s = build->body->lowest_error = 0;
    pal_err err = find(&s, &own, mode);
    pal_rigid_clusters_destroy(&s.clusters);
    pal_arena_destroy(arena);
    /* without a preconditioner, or beyond the bounded work, it is not known */
    return err == PAL_ERR_NUMERIC || err == PAL_ERR_BUDGET ? PAL_ERR_OK : err;
}
