/* What of a voxel lies inside a surface: its volume, or its integrals of trilinear functions.
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
    int n[3];      /* voxels of the grid                                       */
    int n_sum;     /* of a voxel: 1, or 8 for weights                          */
    int n_pass;    /* of what is passed on: 1, or 4                            */
    double sign;   /* +1, or -1 for a surface that faces inward                */
    int32_t *tri;  /* triangles by their first layer              [n_tri]      */
    int32_t *from; /* where a layer's triangles begin             [n2+2]       */
    int32_t *live; /* triangles that reach into the layer         [n_tri]      */
    double *own;   /* of pieces in the voxel itself       [n1][n0][n_sum]      */
    double *pass;  /* of pieces behind: for all voxels before them [n1][n0+1][n_pass] */
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

/* points and weights of the triangle that are exact for polynomials of degree 4 (Dunavant 1985) */
static const double dunavant[6][4] = {{0.108103018168070, 0.445948490915965, 0.445948490915965, 0.223381589678011},
                                      {0.445948490915965, 0.108103018168070, 0.445948490915965, 0.223381589678011},
                                      {0.445948490915965, 0.445948490915965, 0.108103018168070, 0.223381589678011},
                                      {0.816847572980459, 0.091576213509771, 0.091576213509771, 0.109951743655322},
                                      {0.091576213509771, 0.816847572980459, 0.091576213509771, 0.109951743655322},
                                      {0.091576213509771, 0.091576213509771, 0.816847572980459, 0.109951743655322}};

/* Adds the integrals over a triangle, projected along x, of 1, y, z, yz to pass and of x and x^2 / 2 times these to
 * own, in voxel coordinates from `corner`: by the divergence theorem the integrals over what lies before the triangle
 * of 1, x, y, xy, z, xz, yz, xyz, in the order of bits x = 1, y = 2, z = 4 */
static void add_moments(const double *a, const double *b, const double *c, double area, const double corner[3],
                        double own[8], double pass[4])
{
    for (int i = 0; i < 6; i++) {
        const double *w = dunavant[i];
        const double x = w[0] * a[0] + w[1] * b[0] + w[2] * c[0] - corner[0],
                     y = w[0] * a[1] + w[1] * b[1] + w[2] * c[1] - corner[1],
                     z = w[0] * a[2] + w[1] * b[2] + w[2] * c[2] - corner[2];
        const double product[4] = {w[3] * area, w[3] * area * y, w[3] * area * z, w[3] * area * y * z};
        for (int k = 0; k < 4; k++) {
            pass[k] += product[k];
            own[2 * k] += product[k] * x;
            own[2 * k + 1] += product[k] * x * x / 2;
        }
    }
}

/* projected area of a piece and its moment along x about the voxel's low side; with weights, all moments */
static void add_piece(const sweep *s, const pal_polygon *p, int x, int y, int z)
{
    double own[8] = {0}, pass[4] = {0};
    for (int i = 1; i + 1 < p->n; i++) {
        const double *a = p->x[0], *b = p->x[i], *c = p->x[i + 1];
        double part = ((b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])) / 2;
        if (s->n_sum > 1) {
            add_moments(a, b, c, part, (const double[3]){x, y, z}, own, pass);
        } else {
            pass[0] += part;
            own[0] += part * ((a[0] + b[0] + c[0]) / 3 - x);
        }
    }
    const size_t row = (size_t)y * (size_t)s->n[0], at = row + (size_t)x, after = at + (size_t)y;
    for (int m = 0; m < s->n_sum && x < s->n[0]; m++) s->own[at * (size_t)s->n_sum + (size_t)m] += own[m];
    for (int m = 0; m < s->n_pass; m++) s->pass[after * (size_t)s->n_pass + (size_t)m] += pass[m];
}

/* a polygon within one layer and one row of voxels, cut along x; what lies before the row adds nothing */
static void add_row(const sweep *s, pal_polygon *p, int y, int z)
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
        if (low.n >= 3) add_piece(s, &low, x, y, z);
        *p = high;
        if (p->n < 3) return;
    }
    add_piece(s, p, to, y, z);
}

static void add_triangle(const sweep *s, size_t t, int z)
{
    pal_polygon p = {.n = 3}, low, high;
    for (int k = 0; k < 9; k++) p.x[k / 3][k % 3] = grid_units(pal_scan_corner(s->scan, t, k / 3)[k % 3]);
    double min, max;
    pal_polygon_clip(&p, 2, z, z + 1);
    if (p.n < 3) return;
    pal_polygon_range(&p, 1, &min, &max);
    if (max <= 0 || min >= s->n[1]) return;
    int from = clamp_int(floor(min), 0, s->n[1] - 1), to = clamp_int(ceil(max) - 1, from, s->n[1] - 1);
    pal_polygon_clip(&p, 1, 0, INFINITY);
    for (int y = from; y <= to && p.n >= 3; y++) {
        pal_polygon_cut_axis(&p, 1, y + 1, &low, &high);
        add_row(s, &low, y, z);
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
    if (layer[2] <= 0 || layer[0] >= s->n[2] * (int64_t)PAL_SCAN_ONE) return false;
    *from = clamp_int(floor(grid_units(layer[0])), 0, s->n[2] - 1);
    *to = clamp_int(ceil(grid_units(layer[2])) - 1, *from, s->n[2] - 1);
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

/* integrals of 1, x, y, .. xyz over what is inside to those of the shape functions of the Gauss points, (1 -+ sqrt 3 (2
 * x - 1)) / 2 along each axis. Exactly 0 and 1/8 where all is outside or inside */
static void find_weights(double m[8])
{
    if (m[0] < ROUNDING || m[0] > 1 - ROUNDING) {
        const double all = m[0] < ROUNDING ? 0 : 0.125;
        for (int q = 0; q < 8; q++) m[q] = all;
        return;
    }
    for (int axis = 1; axis < 8; axis *= 2)
        for (int q = 0; q < 8; q++) {
            if (q & axis) continue;
            const double mean = m[q] / 2, slope = sqrt(3) * (m[q + axis] - mean);
            m[q] = mean - slope, m[q + axis] = mean + slope;
        }
}

/* sums the pieces, in place of own; a row that the surface does not meet is outside */
static void close_layer(const sweep *s)
{
    const size_t n_x = (size_t)s->n[0], n_sum = (size_t)s->n_sum, n_pass = (size_t)s->n_pass;
    for (size_t y = 0; y < (size_t)s->n[1]; y++) {
        if (!s->met[y]) continue;
        double *own = s->own + n_x * y * n_sum, *pass = s->pass + (n_x + 1) * y * n_pass, behind[4] = {0};
        for (size_t x = n_x; x-- > 0;) {
            double *to = own + x * n_sum;
            for (size_t k = 0; k < n_pass; k++) behind[k] += pass[(x + 1) * n_pass + k];
            /* the integral of x over a voxel that is passed is half of that of 1 */
            for (size_t m = 0; m < n_sum; m++) to[m] = s->sign * (to[m] + behind[m / 2] * (m % 2 ? 0.5 : 1));
            if (n_sum > 1)
                find_weights(to);
            else
                *to = *to < ROUNDING ? 0 : *to > 1 - ROUNDING ? 1 : *to;
        }
    }
}

static void sweep_layers(const sweep *s, pal_fraction_layer take, void *self)
{
    const size_t n_own = (size_t)s->n[0] * (size_t)s->n_sum, n_pass = ((size_t)s->n[0] + 1) * (size_t)s->n_pass;
    int n_live = 0;
    sort_triangles(s);
    for (int z = 0; z < s->n[2]; z++) {
        /* what the last layer left */
        for (size_t y = 0; y < (size_t)s->n[1]; y++) {
            if (!s->met[y]) continue;
            s->met[y] = false;
            memset(s->own + n_own * y, 0, n_own * sizeof *s->own);
            memset(s->pass + n_pass * y, 0, n_pass * sizeof *s->pass);
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

static pal_err fractions_exactly(const pal_scan_surface *scan, const pal_voxels *grid, bool weights, double sign,
                                 pal_fraction_layer take, void *self)
{
    const int *n = grid->n;
    sweep s = {
        .scan = scan, .n = {n[0], n[1], n[2]}, .n_sum = weights ? 8 : 1, .n_pass = weights ? 4 : 1, .sign = sign};
    size_t n_plane = (size_t)s.n[0] * (size_t)s.n[1];
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, s.tri, scan->n_tri);
    PAL_ARRAY(&err, s.live, scan->n_tri);
    PAL_ZEROED(&err, s.from, s.n[2] + 2);
    PAL_ZEROED(&err, s.own, n_plane * (size_t)s.n_sum);
    PAL_ZEROED(&err, s.pass, (n_plane + (size_t)s.n[1]) * (size_t)s.n_pass);
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

static int count_samples(const pal_bits *sample, const int at[3], int n_sub)
{
    int count = 0;
    for (int z = 0; z < n_sub; z++)
        for (int y = 0; y < n_sub; y++)
            for (int x = 0; x < n_sub; x++)
                count += pal_bits_get(sample, n_sub * at[0] + x, n_sub * at[1] + y, n_sub * at[2] + z);
    return count;
}

/* of the set samples of one voxel, the integrals of the Gauss points' shape functions; shape: at the samples along an
 * axis */
static void weigh_samples(const pal_bits *sample, const int at[3], int n_sub, double shape[2][SUBSAMPLES], double to[8])
{
    const double part = 1.0 / ((double)n_sub * n_sub * n_sub);
    for (int z = 0; z < n_sub; z++)
        for (int y = 0; y < n_sub; y++)
            for (int x = 0; x < n_sub; x++) {
                if (!pal_bits_get(sample, n_sub * at[0] + x, n_sub * at[1] + y, n_sub * at[2] + z)) continue;
                for (int q = 0; q < 8; q++) to[q] += part * shape[q & 1][x] * shape[q >> 1 & 1][y] * shape[q >> 2][z];
            }
}

/* fractions or weights of a layer of voxels */
static void close_sampled_layer(const pal_bits *sample, const int n[3], int z, int n_sub, bool weights, double *layer)
{
    double shape[2][SUBSAMPLES];
    const int all = n_sub * n_sub * n_sub;
    for (int i = 0; i < n_sub; i++)
        for (int side = 0; side < 2; side++)
            shape[side][i] = (1 + (side ? sqrt(3) : -sqrt(3)) * ((2 * i + 1.0) / n_sub - 1)) / 2;
    for (int i = 0; i < n[0] * n[1]; i++) {
        const int at[3] = {i % n[0], i / n[0], z}, count = count_samples(sample, at, n_sub);
        double *to = layer + (size_t)i * (weights ? 8 : 1);
        if (!weights) to[0] = (double)count / all;
        for (int q = 0; q < 8 && weights; q++) to[q] = count == all ? 0.125 : 0;
        if (weights && count > 0 && count < all) weigh_samples(sample, at, n_sub, shape, to);
    }
}

/* a grid on which the surface is refused (a sheet that encloses few samples) is replaced by a coarser one */
static pal_err fractions_by_samples(const pal_surface *surface, const pal_voxels *grid, bool weights,
                                    pal_fraction_layer take, void *self, pal_diagnostic *diag)
{
    const int *n = grid->n;
    double n_cell = (double)n[0] * n[1] * n[2];
    int n_sub = SUBSAMPLES, longest = n[0] > n[1] ? n[0] : n[1];
    longest = n[2] > longest ? n[2] : longest;
    while (n_sub > (weights ? 2 : 1) && (n_sub * longest > MAX_SAMPLE_AXIS || n_cell * pow(n_sub, 3) > MAX_SAMPLE))
        n_sub--;
    double *layer = malloc((size_t)n[0] * (size_t)n[1] * (weights ? 8 : 1) * sizeof *layer);
    pal_err err = layer ? PAL_ERR_REFUSED : PAL_ERR_MEMORY;
    for (; err == PAL_ERR_REFUSED && n_sub > 0; n_sub--) {
        pal_voxel_options options = {.resolution = n_sub * longest};
        pal_voxel_report report = {0};
        pal_voxels fine = {.n = {n_sub * n[0], n_sub * n[1], n_sub * n[2]}, .edge_m = grid->edge_m / n_sub};
        pal_bits sample;
        memcpy(fine.low_m, grid->low_m, sizeof fine.low_m);
        err = pal_bits_create(fine.n, &sample);
        if (err) break;
        err = pal_voxels_classify(surface, &options, &fine, &sample, &report, diag);
        for (int z = 0; !err && z < n[2]; z++) {
            close_sampled_layer(&sample, n, z, n_sub, weights, layer);
            take(self, z, layer);
        }
        pal_bits_free(&sample);
    }
    return PAL_FREED(err, layer);
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

pal_err pal_voxels_fraction(const pal_surface *surface, const pal_voxels *grid, bool weights, pal_fraction_layer take,
                            void *self, pal_diagnostic *diag)
{
    pal_scan_surface scan;
    bool plain = false;
    if (!fits(surface, grid))
        return PAL_REFUSE(diag, "the surface reaches %d voxels of %g m beyond the mesh", MAX_PLACE / PAL_SCAN_ONE,
                          grid->edge_m);
    PAL_TRY(pal_scan_snap(surface, grid->low_m, grid->edge_m, &scan));
    pal_err err = find_plain(&scan, grid, &plain);
    if (!err && plain) err = fractions_exactly(&scan, grid, weights, closed_volume(&scan) < 0 ? -1 : 1, take, self);
    pal_scan_surface_free(&scan);
    return err || plain ? err : fractions_by_samples(surface, grid, weights, take, self, diag);
}
