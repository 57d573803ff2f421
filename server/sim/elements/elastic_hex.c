/* Voxel hexahedra: layout, material, untangling. */
#include "server/sim/elements/elastic_hex_simd.h"

/* least share of material (numerics.md, border voxels), and the corner determinant below which cubes are tangled */
static const double least_share = 0.02, least_corner = 0.05;
/* and above which: blown up, where the neo-Hookean energy, which grows with the square, lets nothing else count, and
 * where nearly incompressible bodies take detours */
static const double most_corner = 30;
/* where a body on its split is whole again, at least and at most */
static const double least_whole = 0.3, most_needed = 0.9, most_whole = 20;
/* tangled again within so many looks, one a Newton iteration: in vain; then its corners have to be that much better */
enum { SOON = 600 };
static const double better = 0.05;
/* of the split: turned over voxels have no volume to keep, and five tetrahedra each lock well below 0.5 */
static const double max_poisson = 0.3;

/* K for mu = 1 and for lambda = 1, times 16 / h, in pairs of corners */
static void fill_reference(pal_elastic_hexes *row)
{
    for (int part = 0; part < 2; part++)
        for (int d = 0; d < 8; d++)
            for (int j = 0; j < 3; j++) {
                pal_wide u[3][8] = {{{0}}};
                u[j][d] = wide_of(1);
                for (int i = 0; i < 3; i++) walsh(u[i]);
                hex_stress(wide_of(part == 0), wide_of(part == 1), wide_of(row->beta[part]), u);
                for (int i = 0; i < 3; i++) unwalsh(u[i]);
                for (int c = 0; c <= d; c++)
                    for (int i = 0; i < 3; i++) row->reference[pal_hex_pair(c, d)][part][3 * i + j] = u[i][c][0];
            }
}

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
    row->has_inversion = false;
    row->n_whole = SOON, row->needed = row->tried = least_whole;
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
    fill_reference(out);
    if (wish->recover && wish->law != PAL_LAW_LINEAR) PAL_TRY(make_split(out, build, path));
    pal_hex_material(out, &build->def->material);
    pal_hex_reset(out);
    return PAL_ERR_OK;
}

/* least and largest of the determinants of the three edges at each corner */
PAL_WIDE_INLINE void range_of_corners(const hex_view *v, int l, pal_wide *low, pal_wide *high)
{
    pal_wide x[8][3], least = wide_of(INFINITY), most = wide_of(-INFINITY);
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 3; d++) x[c][d] = wide_load(v->x[c][d] + l);
    for (int c = 0; c < 8; c++) {
        pal_wide a[3], b[3], e[3];
        for (int d = 0; d < 3; d++) {
            a[d] = x[c | 1][d] - x[c & 6][d];
            b[d] = x[c | 2][d] - x[c & 5][d];
            e[d] = x[c | 4][d] - x[c & 3][d];
        }
        pal_wide det = a[0] * (b[1] * e[2] - b[2] * e[1]) + a[1] * (b[2] * e[0] - b[0] * e[2]) +
                       a[2] * (b[0] * e[1] - b[1] * e[0]);
        least = wide_pick(det < least, det, least);
        most = wide_pick(det > most, det, most);
    }
    *low = least, *high = most;
}

/* over all voxels, h^3 */
static void corner_range(const pal_elastic_hexes *row, const pal_body *body, double *low, double *high)
{
    const double volume = row->edge_m * row->edge_m * row->edge_m;
    pal_wide least = wide_of(INFINITY), most = wide_of(-INFINITY);
    pal_node_order_load(body->node_order, body->d);
    for (int b = 0; b < row->n_block; b++) {
        hex_view v;
        hex_open(row, body->node_order, b, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide small, large;
            range_of_corners(&v, l, &small, &large);
            pal_wide_mask live = wide_load(row->share + PAL_LANES * b + l) > 0;
            least = wide_pick(live & (small < least), small, least);
            most = wide_pick(live & (large > most), large, most);
        }
    }
    *low = INFINITY, *high = -INFINITY;
    for (int l = 0; l < PAL_WIDE; l++) *low = fmin(*low, least[l] / volume), *high = fmax(*high, most[l] / volume);
}

double pal_hex_min_corner(const pal_elastic_hexes *row, const pal_body *body)
{
    double low, high;
    corner_range(row, body, &low, &high);
    return low;
}

bool pal_hex_recover(pal_elastic_hexes *row, const pal_body *body)
{
    if (!row->split) return false;
    double low, high;
    corner_range(row, body, &low, &high);
    const bool before = row->has_inversion;
    if (before) {
        row->has_inversion = low < row->needed || high > most_whole;
        if (!row->has_inversion) row->n_whole = 0, row->tried = low;
    } else {
        row->has_inversion = low < least_corner || high > most_corner;
        if (row->n_whole < SOON) row->n_whole++;
    }
    if (row->has_inversion && !before) {
        row->needed = row->n_whole < SOON ? fmin(fmax(row->needed, row->tried) + better, most_needed) : least_whole;
        pal_elastic_tets_reset(row->split);
    }
    row->n_inversion += row->has_inversion;
    row->n_switch += row->has_inversion != before;
    return row->has_inversion != before;
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
