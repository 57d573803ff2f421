/* Flood fill that crosses from a voxel to each of six neighbours where no triangle lies between the centres (paper B
 * section 2.2), to compare the scanlines with.
 *
 * Departure (erratum B15): seeds behind every triangle, not one, so every component and every cavity is found. The
 * segments between centres are those of the rows, so the crossings of the rows are the walls. The method of the paper
 * leaks through one missing triangle and takes a wall that a segment crosses twice for a border. */
#ifndef PAL_TESTS_MESH_VOXEL_FLOOD_H
#define PAL_TESTS_MESH_VOXEL_FLOOD_H
#include "server/base/heap.h"
#include "server/mesh/voxel/voxel_scanline.h"
#include "server/mesh/voxel/voxels.h"

typedef struct flood {
    pal_bits *inside, wall[3]; /* wall: the surface lies between the voxel and the one before it along the axis */
    int32_t *stack;            /* voxels x, y, z whose neighbours are still to be visited */
    size_t n;
    bool leaked;
} flood;

static void set_bit(pal_bits *bits, const int32_t at[3])
{
    pal_bits_row(bits, at[1], at[2])[at[0] >> 6] |= (uint64_t)1 << (at[0] & 63);
}

/* marks a voxel and remembers it; false: out of memory */
static bool reach(flood *f, const int32_t at[3])
{
    if (pal_bits_get(f->inside, at[0], at[1], at[2])) return true;
    for (int k = 0; k < 3; k++) f->leaked |= at[k] == 0 || at[k] == f->inside->n[k] - 1;
    set_bit(f->inside, at);
    if (!pal_heap_grow(&f->stack, f->n, 3 * sizeof *f->stack)) return false;
    memcpy(f->stack + 3 * f->n++, at, 3 * sizeof *at);
    return true;
}

static bool spread(flood *f)
{
    while (f->n && !f->leaked) {
        int32_t at[3], next[3];
        memcpy(at, f->stack + 3 * --f->n, sizeof at);
        for (int side = 0; side < 6; side++) {
            memcpy(next, at, sizeof next);
            next[side / 2] += side & 1 ? 1 : -1;
            const int32_t *behind = side & 1 ? next : at;
            if (!pal_bits_get(&f->wall[side / 2], behind[0], behind[1], behind[2]) && !reach(f, next)) return false;
        }
    }
    return true;
}

/* the walls along one axis, or the seeds: centres between two crossings of which the row enters at the first or leaves
 * at the second */
static pal_err scan(flood *f, const pal_scan_surface *surface, int axis, bool seeds, int enter)
{
    const int *n = f->inside->n, p = axis == 0 ? 1 : 0, q = axis == 2 ? 1 : 2;
    pal_crossings rows;
    bool ok = true;
    PAL_TRY(pal_scan_axis(surface, n, axis, &rows));
    for (int row = 0; row < rows.n_row; row++)
        for (int64_t i = rows.start[row]; i < rows.start[row + 1] && ok; i++) {
            const pal_crossing *c = &rows.item[i], *next = i + 1 < rows.start[row + 1] ? c + 1 : NULL;
            int32_t at[3];
            at[axis] = c->place, at[p] = row % n[p], at[q] = row / n[p];
            if (c->place == n[axis]) continue;
            if (!seeds)
                set_bit(&f->wall[axis], at);
            else if (next && next->place > c->place && (c->sign == enter || next->sign != enter))
                ok = reach(f, at);
        }
    pal_crossings_free(&rows);
    return ok ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* the voxels that a flood fill reaches from the centres next to every crossing of the surface, on its inner side;
 * inward: its triangles face inward. REFUSED when it reaches the border of the grid (the surface leaks) */
static pal_err flood_fill(const pal_scan_surface *surface, bool inward, pal_bits *inside, pal_diagnostic *diag)
{
    flood f = {.inside = inside};
    pal_err err = PAL_ERR_OK;
    for (int axis = 0; axis < 3 && !err; axis++) err = pal_bits_create(inside->n, &f.wall[axis]);
    for (int k = 0; k < 6 && !err; k++) err = scan(&f, surface, k % 3, k >= 3, inward ? -1 : 1);
    if (!err && !spread(&f)) err = PAL_ERR_MEMORY;
    for (int axis = 0; axis < 3; axis++) pal_bits_free(&f.wall[axis]);
    free(f.stack);
    return !err && f.leaked ? pal_diagnostic_set(diag, PAL_ERR_REFUSED, "flood fill leaks") : err;
}

/* voxels as pal_voxels_fill makes them, in its grid, but inside is what the flood fill reaches */
static pal_err flood_voxels(const pal_surface *s, int resolution, pal_voxels *out, pal_diagnostic *diag)
{
    pal_voxel_options options = {.resolution = resolution, .border = true};
    pal_scan_surface snapped = {0};
    pal_bits inside = {0};
    PAL_TRY(pal_voxels_fill(s, &options, out, NULL, diag));
    pal_err err = pal_scan_snap(s, out->low_m, out->edge_m, &snapped);
    if (!err) err = pal_bits_create(out->n, &inside);
    if (!err) err = flood_fill(&snapped, pal_surface_volume(s) < 0, &inside, diag);
    out->n_inside = out->n_border = 0;
    const int *n = out->n;
    for (int z = 0; z < n[2] && !err; z++)
        for (int y = 0; y < n[1]; y++)
            for (int x = 0; x < n[0]; x++) {
                uint8_t *kind = out->kind + ((size_t)z * (size_t)n[1] + (size_t)y) * (size_t)n[0] + (size_t)x;
                *kind = pal_bits_get(&inside, x, y, z) ? 2 : 0;
                for (int side = 0; side < 6 && *kind == 0; side++) {
                    int at[3] = {x, y, z};
                    at[side / 2] += side & 1 ? 1 : -1;
                    bool within = at[side / 2] >= 0 && at[side / 2] < n[side / 2];
                    *kind = within && pal_bits_get(&inside, at[0], at[1], at[2]);
                }
                out->n_inside += *kind == 2, out->n_border += *kind == 1;
            }
    pal_bits_free(&inside);
    pal_scan_surface_free(&snapped);
    if (err) pal_voxels_free(out);
    return err;
}
#endif
