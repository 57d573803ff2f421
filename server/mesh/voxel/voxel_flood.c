/* Flood fill that casts a segment to each of six neighbours (paper B section 2.2).
 *
 * Departure (erratum B15): seeds behind every triangle, not one, so every component and every cavity is found. The
 * method of the paper leaks through one missing triangle and takes a wall that a segment crosses twice for a border. It
 * is kept for comparison with the scanline, which has neither fault. */
#include "server/mesh/voxel/voxel_flood.h"

#include "server/base/vec3.h"

#include <stdlib.h>
#include <string.h>

typedef struct flood {
    const pal_box_tree *tree;
    const pal_voxels *grid;
    pal_bits *inside;
    int32_t *stack; /* voxels x, y, z whose neighbours are still to be visited */
    size_t n, cap;
    bool leaked;
} flood;

static void centre_of(const pal_voxels *g, const int32_t at[3], double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = g->low_m[k] + g->edge_m * (at[k] + 0.5);
}

/* marks a voxel and remembers it; false: out of memory */
static bool reach(flood *f, const int32_t at[3])
{
    uint64_t *word = &pal_bits_row(f->inside, at[1], at[2])[at[0] >> 6], bit = (uint64_t)1 << (at[0] & 63);
    if (*word & bit) return true;
    for (int k = 0; k < 3; k++) f->leaked |= at[k] == 0 || at[k] == f->grid->n[k] - 1;
    *word |= bit;
    if (f->n == f->cap) {
        size_t cap = f->cap ? 2 * f->cap : 4096;
        int32_t *stack = realloc(f->stack, cap * 3 * sizeof *stack);
        if (!stack) return false;
        f->stack = stack;
        f->cap = cap;
    }
    memcpy(f->stack + 3 * f->n++, at, 3 * sizeof *at);
    return true;
}

static bool spread(flood *f)
{
    while (f->n && !f->leaked) {
        int32_t at[3], next[3];
        double from[3], to[3];
        memcpy(at, f->stack + 3 * --f->n, sizeof at);
        centre_of(f->grid, at, from);
        for (int side = 0; side < 6; side++) {
            memcpy(next, at, sizeof next);
            next[side / 2] += side & 1 ? 1 : -1;
            if (pal_bits_get(f->inside, next[0], next[1], next[2])) continue;
            centre_of(f->grid, next, to);
            if (!pal_box_tree_segment(f->tree, from, to, NULL) && !reach(f, next)) return false;
        }
    }
    return true;
}

/* a point a thousandth of a voxel behind the triangle, or half way to the next wall when that is nearer; false for
 * triangles without area */
static bool seed_point(const flood *f, const pal_surface *s, int t, double side, double out[3])
{
    const int32_t *c = s->tri + 3 * (size_t)t;
    const double *a = s->x + 3 * (size_t)c[0], *b = s->x + 3 * (size_t)c[1], *e = s->x + 3 * (size_t)c[2];
    double u[3], v[3], inward[3], start[3], h = f->grid->edge_m;
    pal_sub3(u, b, a);
    pal_sub3(v, e, a);
    pal_cross3(inward, u, v);
    if (!pal_unit3(inward, inward, 0)) return false;
    pal_scale3(inward, -side, inward);
    for (int k = 0; k < 3; k++) start[k] = (a[k] + b[k] + e[k]) / 3 + 1e-7 * h * inward[k];
    if (!pal_finite3(start)) return false;
    double wall = pal_box_tree_ray(f->tree, start, inward, 2e-3 * h, NULL);
    for (int k = 0; k < 3; k++) out[k] = start[k] + (wall >= 0 ? wall / 2 : 1e-3 * h) * inward[k];
    return true;
}

pal_err pal_voxels_flood(const pal_surface *surface, const pal_box_tree *tree, const pal_voxels *grid, pal_bits *inside,
                         pal_diagnostic *diag)
{
    flood f = {.tree = tree, .grid = grid, .inside = inside};
    double side = pal_surface_volume(surface) < 0 ? -1 : 1;
    bool ok = true;
    for (int t = 0; ok && !f.leaked && t < surface->n_tri; t++) {
        double seed[3], centre[3];
        int32_t at[3];
        if (!seed_point(&f, surface, t, side, seed)) continue;
        bool within = true;
        for (int k = 0; k < 3; k++) {
            at[k] = (int32_t)((seed[k] - grid->low_m[k]) / grid->edge_m);
            within &= at[k] >= 0 && at[k] < grid->n[k];
        }
        if (!within || pal_bits_get(inside, at[0], at[1], at[2])) continue;
        centre_of(grid, at, centre);
        if (pal_box_tree_segment(tree, seed, centre, NULL)) continue;
        ok = reach(&f, at) && spread(&f);
    }
    free(f.stack);
    if (!ok) return PAL_ERR_MEMORY;
    if (f.leaked)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "flood fill leaks: it reached the border of the %d x %d x %d grid", grid->n[0],
                                  grid->n[1], grid->n[2]);
    return PAL_ERR_OK;
}
