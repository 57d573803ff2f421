/* Cells list the elements whose boxes, shrunk by a small margin, overlap them; a point searches all cells within that
 * margin, so that points on faces are found without listing every element in the cells of its neighbours too. Outside,
 * layers of cells grow around the projection q of the point p on the box of the grid until none farther out can be
 * nearer: for y in the box |p - y|^2 >= |p - q|^2 + |q - y|^2. */
#include "server/mesh/volume/locate.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"

/* the margin, in cells; tolerance of inside, in edges; cells per element */
#define HAIR   1e-6
#define INSIDE 1e-9
enum { MAX_CELL_PER_ELEMENT = 16, MAX_CELL_MORE = 4096 };

struct pal_locate {
    const pal_tets *tets;
    const pal_hexes *hexes; /* or NULL                    */
    int n_element, n[3];
    double low[3], cell_m;
    int64_t *start;   /* [cells + 1]                */
    int32_t *element; /* ascending within a cell    */
};

void pal_locate_destroy(pal_locate *locate)
{
    if (!locate) return;
    PAL_FREE(locate->start, locate->element, locate);
}

const pal_tets *pal_locate_mesh(const pal_locate *locate, bool *hex)
{
    *hex = locate->hexes != NULL;
    return locate->tets;
}

static const double *corner(const pal_locate *l, int element, int c)
{
    int32_t node =
        l->hexes ? l->hexes->node[8 * (size_t)element + (size_t)c] : l->tets->tet[4 * (size_t)element + (size_t)c];
    return l->tets->x + 3 * (size_t)node;
}

static void find_box(const pal_locate *l, int element, double low[3], double high[3])
{
    pal_box3_empty(low, high);
    for (int c = 0; c < (l->hexes ? 8 : 4); c++) pal_box3_add(low, high, corner(l, element, c));
}

static int cell_along(const pal_locate *l, int k, double x)
{
    double at = floor((x - l->low[k]) / l->cell_m);
    return !(at > 0) ? 0 : at > l->n[k] - 1 ? l->n[k] - 1 : (int)at;
}

/* cells that a box overlaps when shrunk by the margin, or a point's box when enlarged by it */
static void cell_range(const pal_locate *l, const double low[3], const double high[3], double hair, int from[3],
                       int to[3])
{
    for (int k = 0; k < 3; k++) {
        from[k] = cell_along(l, k, low[k] + hair);
        to[k] = cell_along(l, k, high[k] - hair);
        if (to[k] < from[k]) to[k] = from[k];
    }
}

static size_t cell_number(const pal_locate *l, int x, int y, int z)
{
    return (size_t)x + (size_t)l->n[0] * ((size_t)y + (size_t)l->n[1] * (size_t)z);
}

/* counts into start[cell + 2] (element NULL), then fills */
static void fill_cells(pal_locate *l, int64_t *start)
{
    for (int e = 0; e < l->n_element; e++) {
        double low[3], high[3];
        int from[3], to[3];
        find_box(l, e, low, high);
        cell_range(l, low, high, HAIR * l->cell_m, from, to);
        for (int z = from[2]; z <= to[2]; z++)
            for (int y = from[1]; y <= to[1]; y++)
                for (int x = from[0]; x <= to[0]; x++) {
                    size_t c = cell_number(l, x, y, z);
                    if (l->element)
                        l->element[start[c + 1]++] = e;
                    else
                        start[c + 2]++;
                }
    }
}

/* grid over all corners; cells of one voxel edge, larger where the body fills little of its box */
static void make_cells(pal_locate *l)
{
    double high[3], max = (double)MAX_CELL_PER_ELEMENT * l->n_element + MAX_CELL_MORE;
    pal_box3_empty(l->low, high);
    for (int e = 0; e < l->n_element; e++)
        for (int c = 0; c < (l->hexes ? 8 : 4); c++) pal_box3_add(l->low, high, corner(l, e, c));
    l->cell_m = l->tets->edge_m;
    for (;; l->cell_m *= 1.25) {
        double n[3];
        for (int k = 0; k < 3; k++) n[k] = fmax(1, ceil((high[k] - l->low[k]) / l->cell_m - HAIR));
        if (!(n[0] * n[1] * n[2] <= max)) continue;
        for (int k = 0; k < 3; k++) l->n[k] = (int)n[k];
        return;
    }
}

pal_err pal_locate_create(const pal_tets *tets, const pal_hexes *hexes, pal_locate **out)
{
    int n_element = hexes ? hexes->n_hex : tets->n_tet;
    if (n_element == 0 || !(tets->edge_m > 0)) return PAL_ERR_REFUSED;
    pal_locate *l = calloc(1, sizeof *l);
    if (!l) return PAL_ERR_MEMORY;
    l->tets = tets, l->hexes = hexes, l->n_element = n_element;
    make_cells(l);
    size_t n_cell = (size_t)l->n[0] * (size_t)l->n[1] * (size_t)l->n[2];
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, l->start, n_cell + 2);
    if (!err) {
        fill_cells(l, l->start);
        for (size_t c = 0; c < n_cell; c++) l->start[c + 2] += l->start[c + 1];
        PAL_ARRAY(&err, l->element, l->start[n_cell + 1]);
    }
    if (err) return PAL_FREED(err, l->start, l);
    fill_cells(l, l->start);
    *out = l;
    return PAL_ERR_OK;
}

void pal_locate_local(const pal_locate *l, int element, const double x[3], double local[4])
{
    double e[3][3], d[3], cross[3], six = 0;
    const double *low = corner(l, element, 0);
    if (l->hexes) {
        const double *high = corner(l, element, 7);
        for (int k = 0; k < 3; k++) local[k] = ((x[k] - low[k]) + (x[k] - high[k])) / (high[k] - low[k]);
        local[3] = 0;
        return;
    }
    for (int k = 0; k < 3; k++) pal_sub3(e[k], corner(l, element, k + 1), low);
    pal_sub3(d, x, low);
    for (int k = 0; k < 3; k++) {
        pal_cross3(cross, e[(k + 1) % 3], e[(k + 2) % 3]);
        if (k == 0) six = pal_dot3(e[0], cross);
        local[k + 1] = pal_dot3(d, cross) / six;
    }
    local[0] = 1 - local[1] - local[2] - local[3];
}

static double segment_distance(const double p[3], const double a[3], const double b[3])
{
    double ab[3], ap[3];
    pal_sub3(ab, b, a);
    pal_sub3(ap, p, a);
    double t = pal_dot3(ap, ab) / pal_dot3(ab, ab);
    pal_axpy3(ap, -(t < 0 ? 0 : t > 1 ? 1 : t), ab);
    return pal_norm3(ap);
}

/* to the triangle's plane where the foot lies in it, else to its edges */
static double triangle_distance(const double p[3], const double *c[3])
{
    double ab[3], ac[3], ap[3], n[3], cross[3];
    pal_sub3(ab, c[1], c[0]);
    pal_sub3(ac, c[2], c[0]);
    pal_sub3(ap, p, c[0]);
    pal_cross3(n, ab, ac);
    double nn = pal_dot3(n, n);
    pal_cross3(cross, ap, ac);
    double u = pal_dot3(cross, n) / nn;
    pal_cross3(cross, ab, ap);
    double v = pal_dot3(cross, n) / nn;
    if (u >= 0 && v >= 0 && u + v <= 1) return fabs(pal_dot3(ap, n)) / sqrt(nn);
    return fmin(segment_distance(p, c[0], c[1]),
                fmin(segment_distance(p, c[1], c[2]), segment_distance(p, c[2], c[0])));
}

static double element_distance(const pal_locate *l, int element, const double x[3])
{
    if (l->hexes) {
        const double *low = corner(l, element, 0), *high = corner(l, element, 7);
        double away[3];
        for (int k = 0; k < 3; k++) away[k] = fmax(0, fmax(low[k] - x[k], x[k] - high[k]));
        return pal_norm3(away);
    }
    double local[4], best = INFINITY;
    pal_locate_local(l, element, x, local);
    if (local[0] >= 0 && local[1] >= 0 && local[2] >= 0 && local[3] >= 0) return 0;
    for (int f = 0; f < 4; f++) {
        if (local[f] > 0) continue;
        const double *c[3] = {corner(l, element, (f + 1) & 3), corner(l, element, (f + 2) & 3),
                              corner(l, element, (f + 3) & 3)};
        best = fmin(best, triangle_distance(x, c));
    }
    return best;
}

typedef struct nearest {
    int element;
    double away;
} nearest;

/* the first of the elements within rounding of the point, else the nearest, the first of equals */
static void search_cell(const pal_locate *l, size_t cell, const double x[3], nearest *best)
{
    for (int64_t i = l->start[cell]; i < l->start[cell + 1]; i++) {
        int e = l->element[i];
        double away = element_distance(l, e, x);
        if (away < INSIDE * l->tets->edge_m) away = 0;
        if (away < best->away || (away == best->away && e < best->element)) *best = (nearest){e, away};
    }
}

/* cells at most r cells from c along every axis and r along one */
static void search_outward(const pal_locate *l, const int c[3], int r, const double x[3], nearest *best)
{
    for (int z = c[2] - r; z <= c[2] + r; z++)
        for (int y = c[1] - r; y <= c[1] + r; y++) {
            if (z < 0 || y < 0 || z >= l->n[2] || y >= l->n[1]) continue;
            bool rim = abs(z - c[2]) == r || abs(y - c[1]) == r;
            for (int at = c[0] - r; at <= c[0] + r; at += rim || r == 0 ? 1 : 2 * r)
                if (at >= 0 && at < l->n[0]) search_cell(l, cell_number(l, at, y, z), x, best);
        }
}

int pal_locate_point(const pal_locate *l, const double x[3], double local[4], double *outside_m)
{
    nearest best = {0, INFINITY};
    int from[3], to[3], max = 0;
    cell_range(l, x, x, -2 * HAIR * l->cell_m, from, to);
    for (int cz = from[2]; cz <= to[2]; cz++)
        for (int cy = from[1]; cy <= to[1]; cy++)
            for (int cx = from[0]; cx <= to[0]; cx++) search_cell(l, cell_number(l, cx, cy, cz), x, &best);
    if (best.away > 0) {
        double off[3];
        for (int k = 0; k < 3; k++) {
            double high = l->low[k] + l->cell_m * l->n[k];
            off[k] = fmax(0, fmax(l->low[k] - x[k], x[k] - high));
            max = l->n[k] > max ? l->n[k] : max;
        }
        for (int r = 0; r <= max; r++) {
            search_outward(l, from, r, x, &best);
            double reach = (r - HAIR * 4) * l->cell_m;
            if (r > 0 && best.away * best.away <= pal_dot3(off, off) + reach * reach) break;
        }
    }
    pal_locate_local(l, best.element, x, local);
    if (outside_m) *outside_m = best.away;
    return best.element;
}
