/* The fraction of a voxel, or of each of its octants, that lies inside a surface.
 *
 * A point lies inside a closed outward surface when a ray from it along +x leaves once more often than it enters.
 * Integrated over a voxel this is the divergence theorem (server/mesh/README.md, fill), exact for triangles.
 *
 * Where the winding number may differ from 0 and 1 (overlapping or doubled parts) or has no meaning (open surfaces),
 * samples on a finer grid are classified as the voxels are, and counted. */
#include "server/mesh/voxel/voxel_fraction.h"

#include "server/base/heap.h"
#include "server/mesh/geometry/polygon.h"
#include "server/mesh/voxel/voxel_classify.h"
#include "server/num/sort.h"

#include <math.h>

/* fractions within this of 0 or 1 are rounding */
#define ROUNDING 1e-6
/* limits of the samples per axis and in total */
enum { SUBSAMPLES = 6, MAX_SAMPLE_AXIS = 2040, MAX_SAMPLE = 1 << 28 };
/* largest coordinate that exact crossings allow, grid units (voxel_scanline.c) */
enum { MAX_PLACE = 1 << 27 };

typedef struct sweep {
    const pal_scan_surface *scan;
    int split;     /* parts of a voxel along an axis                           */
    int n[3];      /* parts of the grid                                        */
    double sign;   /* +1, or -1 for a surface that faces inward                */
    int32_t *tri;  /* triangles by their first layer              [n_tri]      */
    int32_t *from; /* where a layer's triangles begin             [n2+2]       */
    int32_t *live; /* triangles that reach into the layer         [n_tri]      */
    double *own;   /* of pieces in the part itself                [n1][n0]     */
    double *pass;  /* of pieces behind: for all parts before them   [n1][n0+1] */
    bool *met;     /* rows that the surface meets                   [n1]       */
} sweep;

static double grid_units(int32_t p)
{
    return (double)p / PAL_SCAN_ONE;
}

static int clamp_int(double value, int low, int high)
{
    return value < low ? low : value > high ? high : (int)value;
}

/* projected area of a piece and its moment along x about `at` */
static void add_piece(const sweep *s, const pal_polygon *p, int x, int y)
{
    double area = 0, moment = 0;
    for (int i = 1; i + 1 < p->n; i++) {
        const double *a = p->x[0], *b = p->x[i], *c = p->x[i + 1];
        double part = ((b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])) / 2;
        area += part;
        moment += part * ((a[0] + b[0] + c[0]) / 3 - x);
    }
    size_t row = (size_t)y * (size_t)s->n[0];
    if (x < s->n[0]) s->own[row + (size_t)x] += moment;
    s->pass[row + (size_t)y + (size_t)x] += area;
}

/* a polygon within one layer and one row of voxels, cut along x; what lies before the row adds nothing */
static void add_row(const sweep *s, pal_polygon *p, int y)
{
    double min, max;
    if (p->n < 3) return;
    pal_polygon_range(p, 0, &min, &max);
    if (max <= 0) return;
    pal_polygon low, high;
    s->met[y] = true;
    pal_polygon_clip(p, 0, 0, INFINITY);
    int from = clamp_int(floor(min), 0, s->n[0]), to = clamp_int(ceil(max) - 1, from, s->n[0]);
    for (int x = from; x < to; x++) {
        pal_polygon_cut_axis(p, 0, x + 1, &low, &high);
        if (low.n >= 3) add_piece(s, &low, x, y);
        *p = high;
        if (p->n < 3) return;
    }
    add_piece(s, p, to, y);
}

static void add_triangle(const sweep *s, size_t t, int z)
{
    pal_polygon p = {.n = 3}, low, high;
    for (int k = 0; k < 9; k++) p.x[k / 3][k % 3] = s->split * grid_units(pal_scan_corner(s->scan, t, k / 3)[k % 3]);
    double min, max;
    pal_polygon_clip(&p, 2, z, z + 1);
    if (p.n < 3) return;
    pal_polygon_range(&p, 1, &min, &max);
    if (max <= 0 || min >= s->n[1]) return;
    int from = clamp_int(floor(min), 0, s->n[1] - 1), to = clamp_int(ceil(max) - 1, from, s->n[1] - 1);
    pal_polygon_clip(&p, 1, 0, INFINITY);
    for (int y = from; y <= to && p.n >= 3; y++) {
        pal_polygon_cut_axis(&p, 1, y + 1, &low, &high);
        add_row(s, &low, y);
        p = high;
    }
}

/* first and last layer of a triangle; false when it is parallel to the rows or outside the grid */
static bool find_layers(const sweep *s, size_t t, int *from, int *to)
{
    const int32_t *a = pal_scan_corner(s->scan, t, 0), *b = pal_scan_corner(s->scan, t, 1),
                  *e = pal_scan_corner(s->scan, t, 2);
    int32_t layer[3];
    if (((int64_t)b[1] - a[1]) * ((int64_t)e[2] - a[2]) == ((int64_t)b[2] - a[2]) * ((int64_t)e[1] - a[1]))
        return false;
    pal_sort3(layer, (const int32_t[3]){a[2], b[2], e[2]});
    if (layer[2] <= 0 || layer[0] >= s->n[2] / s->split * (int64_t)PAL_SCAN_ONE) return false;
    *from = clamp_int(floor(s->split * grid_units(layer[0])), 0, s->n[2] - 1);
    *to = clamp_int(ceil(s->split * grid_units(layer[2])) - 1, *from, s->n[2] - 1);
    return true;
}

/* distributes the triangles to their first layers */
static void sort_triangles(const sweep *s)
{
    int from, to;
    for (size_t t = 0; t < (size_t)s->scan->n_tri; t++)
        if (find_layers(s, t, &from, &to)) s->from[from + 2]++;
    for (int z = 0; z < s->n[2]; z++) s->from[z + 2] += s->from[z + 1];
    for (size_t t = 0; t < (size_t)s->scan->n_tri; t++)
        if (find_layers(s, t, &from, &to)) s->tri[s->from[from + 1]++] = (int32_t)t;
}

/* sums the pieces to fractions, in place of own; a row that the surface does not meet is outside */
static void close_layer(const sweep *s)
{
    size_t n_x = (size_t)s->n[0];
    for (size_t y = 0; y < (size_t)s->n[1]; y++) {
        if (!s->met[y]) continue;
        double *own = s->own + n_x * y, *pass = s->pass + (n_x + 1) * y, behind = pass[n_x];
        for (size_t x = n_x; x-- > 0;) {
            double fraction = s->sign * (own[x] + behind);
            behind += pass[x];
            own[x] = fraction < ROUNDING ? 0 : fraction > 1 - ROUNDING ? 1 : fraction;
        }
    }
}

static void sweep_layers(const sweep *s, pal_fraction_layer take, void *self)
{
    size_t n_x = (size_t)s->n[0];
    int n_live = 0;
    sort_triangles(s);
    for (int z = 0; z < s->n[2]; z++) {
        /* what the last layer left */
        for (size_t y = 0; y < (size_t)s->n[1]; y++) {
            if (!s->met[y]) continue;
            s->met[y] = false;
            memset(s->own + n_x * y, 0, n_x * sizeof *s->own);
            memset(s->pass + (n_x + 1) * y, 0, (n_x + 1) * sizeof *s->pass);
        }
        for (int32_t i = s->from[z]; i < s->from[z + 1]; i++) s->live[n_live++] = s->tri[i];
        int n_left = 0;
        for (int i = 0; i < n_live; i++) {
            int from, to;
            size_t t = (size_t)s->live[i];
            add_triangle(s, t, z);
            if (find_layers(s, t, &from, &to) && to > z) s->live[n_left++] = (int32_t)t;
        }
        n_live = n_left;
        close_layer(s);
        take(self, z, s->own);
    }
}

static pal_err fractions_exactly(const pal_scan_surface *scan, const pal_voxels *grid, int split, double sign,
                                 pal_fraction_layer take, void *self)
{
    const int *n = grid->n;
    sweep s = {.scan = scan, .split = split, .n = {split * n[0], split * n[1], split * n[2]}, .sign = sign};
    size_t n_plane = (size_t)s.n[0] * (size_t)s.n[1];
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, s.tri, scan->n_tri);
    PAL_ARRAY(&err, s.live, scan->n_tri);
    PAL_ZEROED(&err, s.from, s.n[2] + 2);
    PAL_ZEROED(&err, s.own, n_plane);
    PAL_ZEROED(&err, s.pass, n_plane + (size_t)s.n[1]);
    PAL_ZEROED(&err, s.met, s.n[1]);
    if (!err) sweep_layers(&s, take, self);
    return PAL_FREED(err, s.tri, s.live, s.from, s.own, s.pass, s.met);
}

/* volume of a closed surface in grid units */
static double closed_volume(const pal_scan_surface *scan)
{
    double sum = 0;
    for (size_t t = 0; t < (size_t)scan->n_tri; t++) {
        double x[3][3];
        for (int k = 0; k < 9; k++) x[k / 3][k % 3] = grid_units(pal_scan_corner(scan, t, k / 3)[k % 3]);
        sum += (x[0][0] + x[1][0] + x[2][0]) *
               ((x[1][1] - x[0][1]) * (x[2][2] - x[0][2]) - (x[1][2] - x[0][2]) * (x[2][1] - x[0][1])) / 6;
    }
    return sum;
}

/* is the winding number 0 or 1 (or 0 or -1) along all rows of centres? */
static pal_err find_plain(const pal_scan_surface *scan, const pal_voxels *grid, bool *plain)
{
    *plain = false;
    if (!scan->closed) return PAL_ERR_OK;
    pal_bits inside;
    pal_crossings rows;
    PAL_TRY(pal_bits_create(grid->n, &inside));
    pal_err err = pal_scan_axis(scan, grid->n, 0, &rows);
    if (!err) {
        *plain = pal_scan_plain(&rows, &inside);
        pal_crossings_free(&rows);
    }
    pal_bits_free(&inside);
    return err;
}

/* counts the set samples of every part of layer z */
static void count_samples(const pal_bits *sample, const int n[3], int n_sub, int z, double *fraction)
{
    double one = 1.0 / ((double)n_sub * n_sub * n_sub);
    for (int y = 0; y < n[1]; y++)
        for (int x = 0; x < n[0]; x++) {
            int count = 0;
            for (int k = 0; k < n_sub; k++)
                for (int j = 0; j < n_sub; j++)
                    for (int i = 0; i < n_sub; i++)
                        count += pal_bits_get(sample, n_sub * x + i, n_sub * y + j, n_sub * z + k);
            fraction[(size_t)y * (size_t)n[0] + (size_t)x] = one * count;
        }
}

/* a grid on which the surface is refused (a sheet that encloses few samples) is replaced by a coarser one */
static pal_err fractions_by_samples(const pal_surface *surface, const pal_voxels *grid, int split,
                                    pal_fraction_layer take, void *self, pal_diagnostic *diag)
{
    const int n[3] = {split * grid->n[0], split * grid->n[1], split * grid->n[2]};
    double n_cell = (double)n[0] * n[1] * n[2];
    int n_sub = SUBSAMPLES / split, longest = n[0] > n[1] ? n[0] : n[1];
    longest = n[2] > longest ? n[2] : longest;
    while (n_sub > 1 && (n_sub * longest > MAX_SAMPLE_AXIS || n_cell * pow(n_sub, 3) > MAX_SAMPLE)) n_sub--;
    double *fraction = malloc((size_t)n[0] * (size_t)n[1] * sizeof *fraction);
    pal_err err = fraction ? PAL_ERR_REFUSED : PAL_ERR_MEMORY;
    for (; err == PAL_ERR_REFUSED && n_sub > 0; n_sub--) {
        pal_voxel_options options = {.resolution = n_sub * longest};
        pal_voxel_report report = {0};
        pal_voxels fine = {.n = {n_sub * n[0], n_sub * n[1], n_sub * n[2]}, .edge_m = grid->edge_m / (n_sub * split)};
        pal_bits sample;
        memcpy(fine.low_m, grid->low_m, sizeof fine.low_m);
        err = pal_bits_create(fine.n, &sample);
        if (err) break;
        err = pal_voxels_classify(surface, &options, &fine, &sample, &report, diag);
        for (int z = 0; !err && z < n[2]; z++) {
            count_samples(&sample, n, n_sub, z, fraction);
            take(self, z, fraction);
        }
        pal_bits_free(&sample);
    }
    return PAL_FREED(err, fraction);
}

/* does every finite corner lie where crossings are exact? */
static bool fits(const pal_surface *surface, const pal_voxels *grid)
{
    double max = MAX_PLACE / PAL_SCAN_ONE * grid->edge_m;
    for (size_t i = 0; i < 3 * (size_t)surface->n_tri; i++)
        for (size_t k = 0; k < 3; k++) {
            double away = fabs(surface->x[3 * (size_t)surface->tri[i] + k] - grid->low_m[k]);
            if (away > max && isfinite(away)) return false;
        }
    return true;
}

pal_err pal_voxels_fraction(const pal_surface *surface, const pal_voxels *grid, int split, pal_fraction_layer take,
                            void *self, pal_diagnostic *diag)
{
    pal_scan_surface scan;
    bool plain = false;
    if (!fits(surface, grid))
        return PAL_REFUSE(diag, "the surface reaches %d voxels of %g m beyond the mesh", MAX_PLACE / PAL_SCAN_ONE,
                          grid->edge_m);
    PAL_TRY(pal_scan_snap(surface, grid->low_m, grid->edge_m, &scan));
    pal_err err = find_plain(&scan, grid, &plain);
    if (!err && plain) err = fractions_exactly(&scan, grid, split, closed_volume(&scan) < 0 ? -1 : 1, take, self);
    pal_scan_surface_free(&scan);
    return err || plain ? err : fractions_by_samples(surface, grid, split, take, self, diag);
}
