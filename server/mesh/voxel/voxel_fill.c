/* From a surface to voxels (paper B section 2.2): inside, border, components.
 *
 * The grid begins one voxel outside the corner of the box of the surface, so the first centre lies half a voxel inside
 * it. Inside voxels are bits, so that their face neighbours are a shift and two neighbouring rows. */
#include "server/mesh/voxel/voxels.h"

#include "server/base/clock.h"
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"
#include "server/mesh/voxel/voxel_classify.h"
#include "server/mesh/voxel/voxel_fraction.h"

void pal_voxels_free(pal_voxels *voxels)
{
    free(voxels->kind);
    memset(voxels, 0, sizeof *voxels);
}

static pal_err make_grid(const pal_surface *surface, const pal_voxel_options *options, pal_voxels *grid,
                         pal_diagnostic *diag)
{
    double low[3], high[3], longest = 0;
    if (options->resolution < 1 || options->resolution > MAX_RESOLUTION)
        return PAL_REFUSE(diag, "resolution %d is not within 1..%d", options->resolution, MAX_RESOLUTION);
    /* the box of the finite corners of triangles: vertices of no triangle do not count */
    pal_box3_empty(low, high);
    for (size_t i = 0; i < 3 * (size_t)surface->n_tri; i++) {
        const double *x = surface->x + 3 * (size_t)surface->tri[i];
        if (pal_finite3(x)) pal_box3_add(low, high, x);
    }
    if (!(low[0] <= high[0]))
        return PAL_REFUSE(diag, "no volume (reason 1): none of %d triangles has finite corners", surface->n_tri);
    for (int k = 0; k < 3; k++) longest = fmax(longest, high[k] - low[k]);
    if (!(longest > 0) || !isfinite(longest) || !isnormal(longest / MAX_RESOLUTION / PAL_SCAN_ONE))
        return PAL_REFUSE(diag, "no volume (reason 1): the box of %d triangles is %g x %g x %g m across",
                          surface->n_tri, high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    grid->edge_m = longest / options->resolution;
    for (int k = 0; k < 3; k++) {
        double ahead = fmin(fmax(options->ahead[k], 0), 1);
        int n = (int)ceil((high[k] - low[k]) / grid->edge_m + ahead - 1e-6);
        grid->n[k] = (n < 1 ? 1 : n) + 2;
        grid->low_m[k] = low[k] - (1 + ahead) * grid->edge_m;
        grid->origin_m[k] = surface->origin_m[k];
    }
    return PAL_ERR_OK;
}

/* face neighbours of inside voxels that are not inside themselves */
static void find_border(const pal_bits *inside, pal_bits *border)
{
    int n_word = inside->n_word;
    for (int z = 1; z < inside->n[2] - 1; z++)
        for (int y = 1; y < inside->n[1] - 1; y++) {
            const uint64_t *row = pal_bits_row(inside, y, z);
            bool any = false;
            for (int w = 0; w < n_word; w++) any |= row[w] != 0;
            if (!any) continue;
            uint64_t *to = pal_bits_row(border, y, z), *south = pal_bits_row(border, y - 1, z),
                     *north = pal_bits_row(border, y + 1, z), *below = pal_bits_row(border, y, z - 1),
                     *above = pal_bits_row(border, y, z + 1);
            for (int w = 0; w < n_word; w++) {
                uint64_t b = row[w];
                uint64_t left = w + 1 < n_word ? row[w + 1] << 63 : 0, right = w > 0 ? row[w - 1] >> 63 : 0;
                to[w] |= b << 1 | right | b >> 1 | left;
                south[w] |= b;
                north[w] |= b;
                below[w] |= b;
                above[w] |= b;
            }
        }
    for (size_t i = 0; i < pal_bits_words(inside); i++) border->word[i] &= ~inside->word[i];
}

/* bits to bytes: one table look-up turns 8 bits into 8 bytes */
static void write_kind(const pal_bits *inside, const pal_bits *border, uint8_t *kind)
{
    uint64_t spread[256];
    for (int b = 0; b < 256; b++) {
        uint8_t byte[8];
        for (int k = 0; k < 8; k++) byte[k] = b >> k & 1;
        memcpy(&spread[b], byte, 8);
    }
    int n_x = inside->n[0];
    size_t n_row = (size_t)inside->n[1] * (size_t)inside->n[2];
    for (size_t row = 0; row < n_row; row++) {
        const uint64_t *in = inside->word + (size_t)inside->n_word * row;
        const uint64_t *out = border->word + (size_t)inside->n_word * row;
        uint8_t *to = kind + (size_t)n_x * row;
        for (int x = 0; x < n_x; x += 8) {
            int w = x >> 6, s = x & 63;
            uint64_t i = in[w] >> s & 255, b = out[w] >> s & 255;
            if (!(i | b)) continue;
            uint64_t bytes = 2 * spread[i] + spread[b];
            memcpy(to + x, &bytes, n_x - x < 8 ? (size_t)(n_x - x) : 8);
        }
    }
}

/* voxels of which at least min lies inside */
typedef struct filled_voxels {
    pal_bits bits;
    double min;
} filled_voxels;

static void take_layer(void *self, int z, const double *fraction)
{
    filled_voxels *f = self;
    const int n_x = f->bits.n[0];
    for (int y = 0; y < f->bits.n[1]; y++) {
        uint64_t *row = pal_bits_row(&f->bits, y, z);
        const double *from = fraction + (size_t)y * (size_t)n_x;
        for (int x = 0; x < n_x; x++) row[x >> 6] |= (uint64_t)(from[x] >= f->min) << (x & 63);
    }
}

/* inside voxels and those that share a face, an edge or a corner with one */
static void find_touching(const pal_bits *inside, pal_bits *to)
{
    const int n_word = inside->n_word;
    for (int i = 0; i < (inside->n[1] - 2) * (inside->n[2] - 2); i++) {
        const int y = 1 + i % (inside->n[1] - 2), z = 1 + i / (inside->n[1] - 2);
        const uint64_t *row = pal_bits_row(inside, y, z);
        for (int w = 0; w < n_word; w++) {
            const uint64_t left = w + 1 < n_word ? row[w + 1] << 63 : 0, right = w > 0 ? row[w - 1] >> 63 : 0;
            const uint64_t b = row[w] | row[w] << 1 | right | row[w] >> 1 | left;
            for (int k = 0; k < 9 && b; k++) pal_bits_row(to, y + k % 3 - 1, z + k / 3 - 1)[w] |= b;
        }
    }
}

/* What is left out of the filled voxels: voxels inside other components, and those that touch these and no voxel inside
 * this one. Of a flap of another component thinner than a voxel parts may stay */
static pal_err leave_out(const pal_bits *others, const pal_bits *inside, pal_bits *filled)
{
    pal_bits near = {.word = NULL}, far = {.word = NULL};
    pal_err err = pal_bits_create(inside->n, &near);
    if (!err) err = pal_bits_create(inside->n, &far);
    if (!err) find_touching(inside, &near), find_touching(others, &far);
    for (size_t i = 0; i < pal_bits_words(filled) && !err; i++)
        filled->word[i] &= ~(others->word[i] | (far.word[i] & ~near.word[i]));
    pal_bits_free(&near), pal_bits_free(&far);
    return err;
}

/* In place of the face neighbours of the inside: all voxels of which min lies inside and that faces join to it, some
 * through others, as at an edge of the body. others: voxels inside components that are left out, word NULL: none */
static pal_err keep_filled(const pal_surface *surface, const pal_bits *inside, const pal_bits *others, double min,
                           const pal_voxels *grid, pal_bits *border, int64_t *n_dropped, pal_diagnostic *diag)
{
    filled_voxels filled = {.min = min};
    PAL_TRY(pal_bits_create(inside->n, &filled.bits));
    const size_t n_word = pal_bits_words(inside);
    uint64_t *kept = filled.bits.word;
    pal_err err = pal_voxels_fraction(surface, grid, false, take_layer, &filled, diag);
    for (size_t i = 0; i < n_word; i++) *n_dropped += __builtin_popcountll(border->word[i] & ~kept[i]);
    if (!err && others->word) err = leave_out(others, inside, &filled.bits);
    for (size_t i = 0; i < n_word; i++) kept[i] |= inside->word[i];
    if (!err) err = pal_bits_keep_joined(&filled.bits, inside);
    for (size_t i = 0; i < n_word; i++) border->word[i] = kept[i] & ~inside->word[i];
    pal_bits_free(&filled.bits);
    return err;
}

/* border, dropped border voxels, components, counts, budget, bytes */
static pal_err keep_voxels(const pal_surface *surface, const pal_bits *inside, const pal_bits *others,
                           const pal_voxel_options *options, pal_voxels *voxels, pal_voxel_report *report,
                           pal_diagnostic *diag)
{
    pal_bits border;
    pal_err err = PAL_ERR_OK;
    PAL_TRY(pal_bits_create(inside->n, &border));
    if (options->border) find_border(inside, &border);
    if (options->border && options->min_fill > 0)
        err = keep_filled(surface, inside, others, options->min_fill, voxels, &border, &report->n_dropped, diag);
    /* components of all kept voxels */
    for (size_t i = 0; i < pal_bits_words(inside); i++) border.word[i] |= inside->word[i];
    if (!err) err = pal_bits_components(&border, false, &report->n_component);
    for (size_t i = 0; i < pal_bits_words(inside); i++) border.word[i] &= ~inside->word[i];
    voxels->n_inside = pal_bits_count(inside);
    voxels->n_border = pal_bits_count(&border);
    int64_t max = options->max_voxel > 0 ? options->max_voxel : MAX_VOXEL;
    if (!err && voxels->n_inside + voxels->n_border > max)
        err =
            pal_diagnostic_set(diag, PAL_ERR_BUDGET, "resolution %d makes %lld voxels, the limit is %lld: ask for less",
                               options->resolution, (long long)(voxels->n_inside + voxels->n_border), (long long)max);
    PAL_ZEROED(&err, voxels->kind, (size_t)voxels->n[0] * (size_t)voxels->n[1] * (size_t)voxels->n[2]);
    if (!err) write_kind(inside, &border, voxels->kind);
    pal_bits_free(&border);
    return err;
}

/* others: the voxels that were inside and are so no more */
static pal_err keep_largest(pal_bits *inside, pal_bits *others)
{
    int n;
    PAL_TRY(pal_bits_create(inside->n, others));
    memcpy(others->word, inside->word, pal_bits_words(inside) * sizeof *inside->word);
    PAL_TRY(pal_bits_components(inside, true, &n));
    for (size_t i = 0; i < pal_bits_words(inside); i++) others->word[i] &= ~inside->word[i];
    return PAL_ERR_OK;
}

pal_err pal_voxels_fill(const pal_surface *surface, const pal_voxel_options *options, pal_voxels *out,
                        pal_voxel_report *report, pal_diagnostic *diag)
{
    double began = pal_clock_s();
    pal_voxels voxels = {0};
    pal_voxel_report measured = {0};
    pal_bits inside = {0}, others = {0};
    PAL_TRY(make_grid(surface, options, &voxels, diag));
    pal_err err = pal_bits_create(voxels.n, &inside);
    if (!err) err = pal_voxels_classify(surface, options, &voxels, &inside, &measured, diag);
    if (!err && options->largest_only) err = keep_largest(&inside, &others);
    if (!err) err = keep_voxels(surface, &inside, &others, options, &voxels, &measured, diag);
    pal_bits_free(&inside), pal_bits_free(&others);
    if (err == PAL_ERR_MEMORY)
        pal_diagnostic_set(diag, err, "out of memory for %d x %d x %d voxels", voxels.n[0], voxels.n[1], voxels.n[2]);
    if (err) return err;
    measured.inside_volume_m3 = (double)voxels.n_inside * voxels.edge_m * voxels.edge_m * voxels.edge_m;
    measured.fill_s = pal_clock_s() - began - measured.tree_s;
    *out = voxels;
    if (report) *report = measured;
    return PAL_ERR_OK;
}
