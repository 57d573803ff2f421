/* Voxel hexahedra: layout, material, assembly. */
#include "server/sim/elements/elastic_hex.h"

#include <math.h>

/* least share of material of a border voxel, so that no node is left nearly without stiffness and mass */
static const double least_share = 0.02;
/* of the split: inverted voxels have no volume to keep, and five tetrahedra a voxel lock well below 0.5 */
static const double max_poisson = 0.3;

void pal_hex_material(pal_elastic_hexes *row, const pal_material *material)
{
    for (int e = 0; e < row->n_hex; e++) {
        int lane = row->simd_blocks.place[e];
        double mu, lambda, scale = row->share[lane] * row->edge_m / 16;
        pal_elastic_regions_lame(&row->parts, material, e, &mu, &lambda);
        row->mu[lane] = scale * mu;
        row->lambda[lane] = scale * lambda;
        /* the dilatation or a shear of modes, whose squares are 8 times those of corners */
        row->bound[lane] = 8 * scale * fmax(2 * mu, 2 * mu + 3 * lambda);
    }
    if (row->split) pal_elastic_tets_material(row->split, material);
    pal_force_cache_invalidate(&row->kept);
}

void pal_hex_reset(pal_elastic_hexes *row)
{
    for (int b = 0; b < row->n_block; b++)
        for (int l = 0; l < PAL_LANES; l++) {
            for (int i = 0; i < 4; i++) row->q[(4 * b + i) * PAL_LANES + l] = i == 0;
            for (int i = 0; i < 9; i++) row->turn[(9 * b + i) * PAL_LANES + l] = i % 4 == 0;
        }
    pal_hex_recovery_reset(row);
    pal_force_cache_invalidate(&row->kept);
    row->n_inversion = row->n_switch = 0;
    row->n_slow = 0;
    if (row->split) pal_elastic_tets_reset(row->split), row->split->n_single_rotation = 0;
}

/* the five-tetrahedra split: every five tetrahedra fill the cube of the same number */
static pal_err check_split(const pal_hexes *hexes, const pal_tets *tets, const char *path, pal_diagnostic *diag)
{
    if (!tets || tets->n_tet != 5 * hexes->n_hex)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %d tetrahedra are no split of %d voxels", path,
                                  tets ? tets->n_tet : 0, hexes->n_hex);
    for (int i = 0; i < 4 * tets->n_tet; i++) {
        const int32_t *node = hexes->node + 8 * (i / 20);
        int c = 0;
        while (c < 8 && node[c] != tets->tet[i]) c++;
        if (c == 8)
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: tetrahedron %d is not part of voxel %d", path, i / 4,
                                      i / 20);
    }
    return PAL_ERR_OK;
}

static pal_err make_split(pal_elastic_hexes *row, pal_build *build, const char *path)
{
    const pal_tets *tets = build->body->tets;
    PAL_TRY(check_split(row->hexes, tets, path, build->diag));
    row->split = PAL_NEW(build->arena, pal_elastic_tets, 1);
    row->split_fill = PAL_NEW(build->arena, float, tets->n_tet);
    if (!row->split || !row->split_fill) return PAL_ERR_MEMORY;
    for (int t = 0; t < tets->n_tet; t++) row->split_fill[t] = (float)row->share[row->simd_blocks.place[t / 5]];
    const pal_elastic_tets_options wish = {.law = PAL_LAW_COROTATIONAL,
                                           .recover = true,
                                           .max_poisson = max_poisson,
                                           .n_corner = 4,
                                           .n_tet = tets->n_tet,
                                           .tet = tets->tet,
                                           .fill = row->split_fill};
    return pal_elastic_tets_make(&wish, build, row->split);
}

static pal_err take_memory(pal_elastic_hexes *row, pal_arena *arena)
{
    size_t n = (size_t)row->n_block * PAL_LANES;
    row->hex = PAL_NEW(arena, int32_t, n);
    row->share = PAL_NEW(arena, double, n);
    row->mu = PAL_NEW(arena, double, n);
    row->lambda = PAL_NEW(arena, double, n);
    row->bound = PAL_NEW(arena, double, n);
    row->q = PAL_NEW(arena, double, 4 * n);
    row->turn = PAL_NEW(arena, double, 9 * n);
    row->reference = pal_arena_array(arena, 36, sizeof *row->reference);
    if (!row->hex || !row->share || !row->mu || !row->lambda || !row->bound || !row->q || !row->turn || !row->reference)
        return PAL_ERR_MEMORY;
    if (!row->implicit) return PAL_ERR_OK;
    row->entry = PAL_NEW(arena, int32_t, 36 * (size_t)row->n_hex);
    if (!row->entry) return PAL_ERR_MEMORY;
    if (row->law != PAL_LAW_NEO_HOOKEAN) return PAL_ERR_OK;
    row->tangent = PAL_NEW(arena, double, 231 * n);
    return row->tangent ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_hex_make(const pal_hex_options *wish, pal_build *build, const char *path, pal_elastic_hexes *out)
{
    pal_body *body = build->body;
    if (!body->hexes || body->hexes->n_hex < 1 || !body->tets)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: \"hex_elastic\" needs a body of voxels", path);
    *out = (pal_elastic_hexes){.law = wish->law,
                               .element = wish->element,
                               .fill = wish->fill,
                               .recover = wish->recover,
                               .implicit = body->implicit,
                               .hexes = body->hexes,
                               .n_hex = body->hexes->n_hex,
                               .edge_m = body->tets->edge_m};
    out->beta[0] = wish->element == PAL_HEX_BBAR ? -2.0 / 3 : 0;
    out->beta[1] = wish->element == PAL_HEX_BBAR ? 0 : 1;
    if (!body->node_order)
        PAL_TRY(pal_node_order_make(body->x_rest, body->n_node, body->tets->edge_m, build->arena, &body->node_order));
    PAL_TRY(pal_simd_blocks_make_ordered(body->node_order, out->hexes->node, out->n_hex, 8, build->arena,
                                         &out->simd_blocks));
    out->n_block = out->simd_blocks.n_lane / PAL_LANES;
    PAL_TRY(pal_elastic_regions_make(build, out->hexes->node, out->n_hex, 8, 8, &out->parts));
    PAL_TRY(take_memory(out, build->arena));
    if (out->implicit) PAL_TRY(pal_force_cache_make(body->n_node, build->arena, &out->kept));
    for (int i = 0; i < out->simd_blocks.n_lane; i++) out->hex[i] = -1;
    for (int e = 0; e < out->n_hex; e++) {
        int lane = out->simd_blocks.place[e];
        bool filled = !out->fill || !out->hexes->fill;
        out->hex[lane] = e;
        out->share[lane] = filled ? 1 : fmax(least_share, fmin(1, (double)out->hexes->fill[e]));
    }
    pal_hex_fill_reference(out);
    if (wish->recover && wish->law != PAL_LAW_LINEAR) PAL_TRY(make_split(out, build, path));
    pal_hex_material(out, &build->def->material);
    pal_hex_reset(out);
    return PAL_ERR_OK;
}

/* where each pair of corners stands in the pattern */
static void find_entries(pal_elastic_hexes *row, const pal_block_matrix *to)
{
    row->entry_of = to, row->entry_row = to->row;
    for (int e = 0; e < row->n_hex; e++)
        for (int c = 0; c < 8; c++)
            for (int d = c; d < 8; d++) {
                int i = row->hexes->node[8 * e + c], j = row->hexes->node[8 * e + d];
                int at = i >= j ? pal_block_matrix_find(to, i, j) : ~pal_block_matrix_find(to, j, i);
                row->entry[36 * e + pal_hex_pair(c, d)] = at;
            }
}

/* adds the 36 blocks of one lane where they belong */
static void add_entries(const int32_t *entry, const double *part, double *value)
{
    for (int p = 0; p < 36; p++) {
        int at = entry[p];
        double *to = value + 9 * (at >= 0 ? at : ~at);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) to[at >= 0 ? 3 * i + j : 3 * j + i] += part[(9 * p + 3 * i + j) * PAL_LANES];
    }
}

void pal_hex_assemble(pal_elastic_hexes *row, double k, pal_block_matrix *to)
{
    double part[36 * 9 * PAL_LANES];
    if (!row->entry) return;
    if (row->entry_of != to || row->entry_row != to->row) find_entries(row, to);
    for (int b = 0; b < row->n_block; b++) {
        if (row->law == PAL_LAW_NEO_HOOKEAN)
            pal_hex_neo_blocks(row, b, k, part);
        else
            pal_hex_corot_blocks(row, b, k, part);
        for (int l = 0; l < PAL_LANES; l++) {
            int e = row->hex[PAL_LANES * b + l];
            if (e >= 0) add_entries(row->entry + 36 * e, part + l, to->value);
        }
    }
}

void pal_hex_rotate(const pal_elastic_hexes *row, double *turn)
{
    for (int e = 0; e < row->n_hex; e++) {
        int lane = row->simd_blocks.place[e];
        const double *at = row->turn + 9 * (lane / PAL_LANES) * PAL_LANES + lane % PAL_LANES;
        double r[9];
        for (int i = 0; i < 9; i++) r[i] = row->mu[lane] * at[i * PAL_LANES];
        for (int c = 0; c < 8; c++) {
            double *to = turn + 9 * row->hexes->node[8 * e + c];
            for (int i = 0; i < 9; i++) to[i] += r[i];
        }
    }
}
