/* Voxel hexahedra: layout, material, assembly. */
#include "server/sim/elements/elastic_hex.h"

#include "server/sim/elements/tuning.h"

#include <math.h>
#include <string.h>

void pal_hex_material(pal_elastic_hexes *cubes, const pal_material *material)
{
    const double *was[2] = {cubes->recovery ? cubes->whole[0] : cubes->mu,
                            cubes->recovery ? cubes->whole[1] : cubes->lambda};
    cubes->n_edit++;
    for (int e = 0; e < cubes->n_hex; e++) {
        int lane = cubes->simd_blocks.place[e];
        double mu, lambda, scale = cubes->share[lane] * cubes->edge_m / 16;
        pal_elastic_regions_lame(&cubes->parts, material, e, &mu, &lambda);
        if (was[0][lane] != scale * mu || was[1][lane] != scale * lambda) cubes->edited[e] = cubes->n_edit;
        cubes->mu[lane] = scale * mu;
        cubes->lambda[lane] = scale * lambda;
        /* the dilatation or a shear of modes, whose squares are 8 times those of corners */
        cubes->bound[lane] = 8 * scale * fmax(2 * mu, 2 * mu + 3 * lambda);
    }
    pal_force_cache_invalidate(&cubes->force_cache);
    if (!cubes->recovery) return;
    const size_t n = sizeof(double) * PAL_LANES * (size_t)cubes->n_block;
    memcpy(cubes->whole[0], cubes->mu, n), memcpy(cubes->whole[1], cubes->lambda, n);
    pal_recovery_refresh(cubes->recovery);
}

void pal_hex_reset(pal_elastic_hexes *cubes)
{
    for (int b = 0; b < cubes->n_block; b++)
        for (int l = 0; l < PAL_LANES; l++) {
            for (int i = 0; i < 4; i++) cubes->q[(4 * b + i) * PAL_LANES + l] = i == 0;
            for (int i = 0; i < 9; i++) cubes->rotation[(9 * b + i) * PAL_LANES + l] = i % 4 == 0;
        }
    if (cubes->recovery) pal_recovery_reset(cubes->recovery);
    pal_force_cache_invalidate(&cubes->force_cache);
}

static pal_err take_memory(pal_elastic_hexes *cubes, pal_arena *arena)
{
    size_t n = (size_t)cubes->n_block * PAL_LANES;
    cubes->hex = PAL_NEW(arena, int32_t, n);
    cubes->share = PAL_NEW(arena, double, n);
    cubes->mu = PAL_NEW(arena, double, n);
    cubes->lambda = PAL_NEW(arena, double, n);
    cubes->bound = PAL_NEW(arena, double, n);
    cubes->q = PAL_NEW(arena, double, 4 * n);
    cubes->rotation = PAL_NEW(arena, double, 9 * n);
    cubes->reference = pal_arena_array(arena, 36, sizeof *cubes->reference);
    if (!cubes->hex || !cubes->share || !cubes->mu || !cubes->lambda || !cubes->bound || !cubes->q ||
        !cubes->rotation || !cubes->reference)
        return PAL_ERR_MEMORY;
    cubes->edited = PAL_NEW(arena, uint32_t, cubes->n_hex);
    if (!cubes->edited) return PAL_ERR_MEMORY;
    if (!cubes->implicit || cubes->law != PAL_LAW_NEO_HOOKEAN) return PAL_ERR_OK;
    cubes->tangent = PAL_NEW(arena, double, 231 * n);
    return cubes->tangent ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

void pal_hex_weights(const pal_elastic_hexes *cubes, int lane, double weight[8])
{
    const int block = lane / PAL_LANES;
    for (int q = 0; q < 8; q++)
        weight[q] = pal_hex_is_cut(cubes, block)
                        ? cubes->weight[(8 * cubes->cut[block] + q) * PAL_LANES + lane % PAL_LANES]
                        : 0.125;
}

/* the weights of an element's points and their sum */
static double find_weights(const pal_elastic_hexes *cubes, int e, double weight[8])
{
    double sum = 0;
    if (!cubes->fill || !cubes->hexes->fill) return 1;
    double fill = pal_hexes_weights(cubes->hexes, e, PAL_FILL_MIN, weight);
    if (!cubes->moment_fitting) return fill;
    for (int q = 0; q < 8; q++) sum += weight[q] = (1 - PAL_VOID_STIFFNESS) * weight[q] + PAL_VOID_STIFFNESS / 8;
    for (int q = 0; q < 8; q++) weight[q] /= sum;
    return sum;
}

/* whole: all weights are equal */
static bool is_whole(const pal_elastic_hexes *cubes, int e)
{
    const float *weight = cubes->fill && cubes->moment_fitting ? cubes->hexes->weight + 8 * (size_t)e : NULL;
    bool equal = true;
    for (int q = 1; weight && q < 8; q++) equal = equal && weight[q] == weight[0];
    return equal;
}

static pal_err make_weights(pal_elastic_hexes *cubes, pal_arena *arena)
{
    int n_cut = 0;
    for (int b = 0; b < cubes->n_block; b++) {
        bool whole = true;
        for (int l = 0; l < PAL_LANES; l++) {
            const int e = cubes->hex[PAL_LANES * b + l];
            whole = whole && (e < 0 || is_whole(cubes, e));
        }
        if (whole) continue;
        if (n_cut == 0) {
            cubes->cut = PAL_NEW(arena, int32_t, cubes->n_block);
            if (!cubes->cut) return PAL_ERR_MEMORY;
            for (int i = 0; i < cubes->n_block; i++) cubes->cut[i] = -1;
        }
        cubes->cut[b] = n_cut++;
    }
    if (n_cut == 0) return PAL_ERR_OK;
    cubes->weight = PAL_NEW(arena, double, 8 * PAL_LANES * (size_t)n_cut);
    cubes->row = pal_arena_array(arena, PAL_LANES * (size_t)n_cut, sizeof *cubes->row);
    if (!cubes->weight || !cubes->row) return PAL_ERR_MEMORY;
    for (int lane = 0; lane < PAL_LANES * cubes->n_block; lane++) {
        const int cut = cubes->cut[lane / PAL_LANES], l = lane % PAL_LANES;
        double weight[8] = {0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125};
        if (cut < 0) continue;
        if (cubes->hex[lane] >= 0 && !is_whole(cubes, cubes->hex[lane])) find_weights(cubes, cubes->hex[lane], weight);
        for (int q = 0; q < 8; q++) cubes->weight[(8 * cut + q) * PAL_LANES + l] = weight[q];
    }
    pal_hex_corot_find_rows(cubes);
    return PAL_ERR_OK;
}

pal_err pal_hex_make(const pal_hex_options *options, pal_build *build, const char *path, pal_elastic_hexes *out)
{
    pal_body *body = build->body;
    if (!body->hexes || body->hexes->n_hex < 1 || !body->tets)
        return PAL_REFUSE(build->diag, "%s: \"hex_elastic\" needs a body of voxels", path);
    *out = (pal_elastic_hexes){.law = options->law,
                               .element = options->element,
                               .fill = options->fill,
                               .moment_fitting = options->moment_fitting && body->hexes->weight,
                               .recover = options->recover,
                               .twist = options->twist,
                               .implicit = body->implicit,
                               .hexes = body->hexes,
                               .ground = body->ground,
                               .n_hex = body->hexes->n_hex,
                               .edge_m = body->tets->edge_m};
    out->beta[0] = options->element == PAL_HEX_BBAR ? -2.0 / 3 : 0;
    out->beta[1] = options->element == PAL_HEX_BBAR ? 0 : 1;
    if (!body->node_order)
        PAL_TRY(pal_node_order_make(body->x_rest, body->n_node, body->tets->edge_m, build->arena, &body->node_order));
    PAL_TRY(pal_simd_blocks_make_ordered(body->node_order, out->hexes->node, out->n_hex, 8, build->arena,
                                         &out->simd_blocks));
    out->n_block = out->simd_blocks.n_lane / PAL_LANES;
    PAL_TRY(pal_block_rounds_make(&out->simd_blocks, body->node_order, body->x_rest, out->edge_m, out->hexes->node,
                                  out->n_hex, build->arena, &out->rounds));
    out->part_energy_J = PAL_NEW(build->arena, double, out->rounds.part[out->rounds.n_round]);
    if (!out->part_energy_J) return PAL_ERR_MEMORY;
    PAL_TRY(pal_elastic_regions_make(build, out->hexes->node, out->n_hex, 8, 8, &out->parts));
    PAL_TRY(take_memory(out, build->arena));
    if (out->implicit) PAL_TRY(pal_force_cache_make(body->n_node, build->arena, &out->force_cache));
    for (int i = 0; i < out->simd_blocks.n_lane; i++) out->hex[i] = -1;
    for (int e = 0; e < out->n_hex; e++) {
        int lane = out->simd_blocks.place[e];
        double weight[8];
        out->hex[lane] = e;
        out->share[lane] = find_weights(out, e, weight);
    }
    pal_hex_fill_reference(out);
    PAL_TRY(make_weights(out, build->arena));
    if (options->recover && options->law != PAL_LAW_LINEAR) PAL_TRY(pal_hex_recovery_make(out, build));
    pal_hex_material(out, &build->def->material);
    pal_hex_reset(out);
    return PAL_ERR_OK;
}

double *pal_hex_block(const pal_block_matrix *to, int i, int j, bool *transposed)
{
    *transposed = i < j;
    return to->value + 9 * (size_t)(i < j ? pal_block_matrix_find(to, j, i) : pal_block_matrix_find(to, i, j));
}

/* adds the 36 blocks of one lane where they belong */
static void add_blocks(const int32_t *node, const double *part, const pal_block_matrix *matrix)
{
    for (int c = 0; c < 8; c++)
        for (int d = c; d < 8; d++) {
            const double *from = part + 9 * PAL_LANES * pal_hex_pair(c, d);
            bool transposed;
            double *to = pal_hex_block(matrix, node[c], node[d], &transposed);
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) to[transposed ? 3 * j + i : 3 * i + j] += from[(3 * i + j) * PAL_LANES];
        }
}

void pal_hex_assemble(pal_elastic_hexes *cubes, double k, pal_block_matrix *to)
{
    double part[36 * 9 * PAL_LANES];
    for (int b = 0; b < cubes->n_block; b++) {
        if (cubes->law == PAL_LAW_NEO_HOOKEAN)
            pal_hex_neo_blocks(cubes, b, k, part);
        else
            pal_hex_corot_blocks(cubes, b, k, part);
        for (int l = 0; l < PAL_LANES; l++) {
            int e = cubes->hex[PAL_LANES * b + l];
            if (e >= 0) add_blocks(cubes->hexes->node + 8 * (size_t)e, part + l, to);
        }
    }
    pal_hex_ground_assemble(cubes, k, to);
}

typedef struct rotation_sum {
    const pal_elastic_hexes *cubes;
    double *sum;
} rotation_sum;

static void rotate_part(void *user, int part)
{
    const rotation_sum *to = user;
    const pal_elastic_hexes *cubes = to->cubes;
    for (int k = cubes->rounds.first[part]; k < cubes->rounds.first[part + 1]; k++) {
        const int b = cubes->rounds.order[k];
        for (int l = 0; l < PAL_LANES; l++) {
            const int lane = PAL_LANES * b + l, e = cubes->hex[lane];
            double r[9];
            for (int i = 0; i < 9; i++) r[i] = cubes->mu[lane] * cubes->rotation[(9 * b + i) * PAL_LANES + l];
            for (int c = 0; c < 8 && e >= 0; c++) {
                double *at = to->sum + 9 * cubes->hexes->node[8 * e + c];
                for (int i = 0; i < 9; i++) at[i] += r[i];
            }
        }
    }
}

void pal_hex_rotate(const pal_elastic_hexes *cubes, pal_team *team, double *rotation)
{
    rotation_sum to = {.cubes = cubes, .sum = rotation};
    pal_block_rounds_run(&cubes->rounds, team, rotate_part, &to);
}
