/* Lowest angular frequency at rest. */
#include "server/sim/implicit/lowest_frequency.h"

#include "server/num/lowest_mode.h"
#include "server/num/random.h"
#include "server/sim/implicit/preconditioner.h"
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
    pal_rest_preconditioner own;
    const pal_rest_preconditioner *incomplete; /* own, or found before */
    bool coarsens;                             /* multigrid in its place */
    pal_node_rotations rotations;
    pal_preconditioner multigrid;
    double scale_1_s2; /* of the order of the square of the highest frequency */
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
    search *s = user;
    if (s->coarsens)
        pal_preconditioner_solve(&s->multigrid, PAL_CYCLE_V, r, out);
    else
        pal_rest_preconditioner_solve(s->incomplete, r, out);
}

/* ---- the search ---- */

/* pattern and values of K */
static pal_err assemble(search *s, const pal_build *build, bool tangents)
{
    s->system.mass = 0, s->system.stiff = 1, s->system.damp = 0;
    if (!tangents) {
        s->assembled = true;
        return pal_rest_stiffness_find(&s->system, build->arena, &s->blocks);
    }
    PAL_TRY(pal_system_pattern(&s->system, build->arena, &s->blocks));
    pal_system_linearise_rest(&s->system);
    (void)pal_system_probe(&s->system, INT_MAX);
    pal_system_assemble(&s->system, &s->blocks);
    return PAL_ERR_OK;
}

/* REFUSED: the body is not of the kind that has levels, or too small */
static pal_err coarsen(search *s, const pal_build *build)
{
    pal_diagnostic diag;
    const pal_preconditioner_options options = {.kind = PAL_PRECONDITION_MULTIGRID};
    if (!pal_preconditioner_suits_multigrid(&s->system)) return PAL_ERR_REFUSED;
    s->system.mass = 0, s->system.stiff = 1, s->system.damp = 0;
    pal_system_linearise_rest(&s->system);
    PAL_TRY(pal_node_rotations_make(&s->system, NULL, build->arena, &s->rotations));
    PAL_TRY(pal_preconditioner_make(&options, &s->system, &s->rotations, build->arena, &diag, &s->multigrid));
    s->coarsens = true;
    PAL_TRY(pal_preconditioner_update(&s->multigrid));
    s->scale_1_s2 = pal_hex_multigrid_stiffest(&s->multigrid.multigrid);
    return PAL_ERR_OK;
}

/* K, what multiplies with it, and the preconditioner */
static pal_err prepare(search *s, const pal_build *build, const pal_rest_values *rest, bool tangents)
{
    pal_err err = tangents ? coarsen(s, build) : PAL_ERR_REFUSED;
    if (err != PAL_ERR_REFUSED) return err;
    if (rest && rest->blocks.value) {
        s->assembled = true, s->blocks = rest->blocks, s->incomplete = rest->preconditioner;
        s->scale_1_s2 = pal_rest_stiffness_scale_1_s2(s->body, &s->blocks, s->skip);
        return PAL_ERR_OK;
    }
    PAL_TRY(assemble(s, build, tangents));
    s->scale_1_s2 = pal_rest_stiffness_scale_1_s2(s->body, &s->blocks, s->skip);
    s->incomplete = &s->own;
    return pal_rest_preconditioner_make(s->body, &s->blocks, s->skip, build->arena, &s->own);
}

/* five digits: damping and sleep, which follow from the frequency, are then the same with every library that factors */
static double round_digits(double w_1_s)
{
    const double digit = pow(10, floor(log10(w_1_s)) - 4);
    return digit * nearbyint(w_1_s / digit);
}

static pal_err find(search *s, const pal_build *build, const pal_rest_values *rest, double *mode)
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
    PAL_TRY(prepare(s, build, rest, tangents));
    for (size_t i = 0; i < n; i++) m.work[i] = pal_random_unit(7, i) - 0.5;
    multiply_mass(s, m.work, m.work + n);
    precondition(s, m.work + n, m.x);
    pal_lowest_mode_run(&m, PAL_SEARCH_TOLERANCE, PAL_FREQUENCY_ITERATIONS);
    if (!(m.lambda > PAL_FREQUENCY_ZERO * s->scale_1_s2)) return PAL_ERR_OK;
    body->lowest_1_s = round_digits(sqrt(m.lambda));
    body->lowest_error = m.error;
    return PAL_ERR_OK;
}

pal_err pal_lowest_frequency_find(const pal_build *build, const pal_rest_values *rest, double *mode)
{
    pal_arena *arena = pal_arena_create(1 << 20, true);
    if (!arena) return PAL_ERR_MEMORY;
    search s = {.body = build->body};
    pal_build own = *build;
    own.arena = arena, own.diag = NULL;
    build->body->lowest_1_s = build->body->lowest_error = 0;
    pal_err err = find(&s, &own, rest, mode);
    pal_rest_preconditioner_destroy(&s.own);
    pal_preconditioner_destroy(&s.multigrid);
    pal_arena_destroy(arena);
    /* without a preconditioner, or beyond the bounded work, it is not known */
    return err == PAL_ERR_NUMERIC || err == PAL_ERR_BUDGET ? PAL_ERR_OK : err;
}
