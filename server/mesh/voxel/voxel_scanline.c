/* Exact scanline crossings of a surface with rows of voxel centres.
 *
 * Corners are rounded to 1/65536 of a voxel. Grid positions are below 2^27, edge functions below 2^53: they are exact
 * in 64 bits. Ties are broken by a symbolic shift of the centres (Edelsbrunner & Muecke 1990), which is a half-open
 * edge rule in the plane of the row's ends and its continuation along the row. */
#include "server/mesh/voxel/voxel_scanline.h"

#include "server/base/heap.h"
#include "server/mesh/geometry/tuning.h"
#include "server/num/sort.h"

#include <math.h>

__extension__ typedef __int128 wide;

/* rows of at least this many centres are first clipped to the triangle by division */
enum { WIDE_ROW = 8 };

/* the axes across a row, in ascending order: the first is shifted more by the symbolic shift */
static const int ACROSS[3][2] = {{1, 2}, {0, 2}, {0, 1}};

void pal_scan_surface_free(pal_scan_surface *scan)
{
    PAL_FREE(scan->point, scan->tri, scan->part, scan->hash, scan->near);
    memset(scan, 0, sizeof *scan);
}

static uint64_t hash_point(const int32_t p[3])
{
    uint64_t h = (uint64_t)(uint32_t)p[0] | (uint64_t)(uint32_t)p[1] << 32;
    h = (h ^ ((uint64_t)(uint32_t)p[2] * 0xD6E8FEB86659FD93u)) * 0x9E3779B97F4A7C15u;
    h ^= h >> 32;
    return h * 0xD6E8FEB86659FD93u;
}

static uint64_t hash_pair(uint64_t a, uint64_t b, int *sign)
{
    if (a == b) {
        *sign = 1;
        return 0;
    }
    uint64_t low = a < b ? a : b, high = a < b ? b : a;
    *sign = a < b ? 1 : -1;
    uint64_t h = (low ^ (high << 23 | high >> 41)) * 0xFF51AFD7ED558CCDu;
    h ^= h >> 33;
    return h * 0xC4CEB9FE1A85EC53u;
}

/* sums of edge hashes over all triangles: a closed chain's signed sum is 0, and an even one's exclusive or */
static void find_closed(pal_scan_surface *scan)
{
    uint64_t sum = 0, odd = 0;
    for (size_t t = 0; t < (size_t)scan->n_tri; t++) {
        const int32_t *c = scan->tri + 3 * t;
        for (int k = 0; k < 3; k++) {
            int sign;
            uint64_t h = hash_pair(scan->hash[c[k]], scan->hash[c[k == 2 ? 0 : k + 1]], &sign);
            sum += sign > 0 ? h : 0 - h;
            odd ^= h;
        }
    }
    scan->closed = sum == 0;
    scan->even = odd == 0;
}

pal_err pal_scan_drop_copies(pal_scan_surface *scan)
{
    size_t n = (size_t)scan->n_tri, cap = 16;
    pal_scan_surface fewer = *scan;
    pal_err err = PAL_ERR_OK;
    uint64_t *seen; /* hashes of the triangles so far, 0: free */
    while (cap < 2 * n) cap *= 2;
    PAL_ARRAY(&err, fewer.tri, 3 * n);
    PAL_ZEROED(&err, seen, cap);
    if (err) return PAL_FREED(err, fewer.tri, seen);
    fewer.n_tri = 0;
    for (size_t t = 0; t < n; t++) {
        const int32_t *c = scan->tri + 3 * t;
        /* the same for the three corners in any order */
        uint64_t a = scan->hash[c[0]], b = scan->hash[c[1]], e = scan->hash[c[2]];
        uint64_t key = (a + b + e) ^ (a ^ b ^ e) * 0x9E3779B97F4A7C15u;
        key += !key;
        size_t at = key & (cap - 1);
        while (seen[at] && seen[at] != key) at = (at + 1) & (cap - 1);
        if (seen[at]) continue;
        seen[at] = key;
        memcpy(fewer.tri + 3 * (size_t)fewer.n_tri++, c, 3 * sizeof *c);
    }
    if (fewer.n_tri < scan->n_tri) find_closed(&fewer);
    bool better = fewer.even || !scan->even;
    PAL_FREE(seen, better ? scan->tri : fewer.tri);
    if (better) *scan = fewer;
    return PAL_ERR_OK;
}

pal_err pal_scan_snap(const pal_surface *surface, const double low[3], double h, pal_scan_surface *out)
{
    size_t n_vertex = (size_t)surface->n_vertex, n_tri = (size_t)surface->n_tri;
    pal_scan_surface scan = {.n_vertex = surface->n_vertex};
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, scan.point, 3 * n_vertex);
    PAL_ARRAY(&err, scan.tri, 3 * n_tri);
    PAL_ARRAY(&err, scan.hash, n_vertex);
    if (err) {
        pal_scan_surface_free(&scan);
        return err;
    }
    double scale = PAL_SCAN_ONE / h;
    for (size_t v = 0; v < n_vertex; v++) {
        const double *x = surface->x + 3 * v;
        int32_t *p = scan.point + 3 * v;
        for (int k = 0; k < 3; k++) {
            double g = (x[k] - low[k]) * scale + 0.5;
            p[k] = g > -1e9 && g < 1e9 ? (int32_t)floor(g) : INT32_MIN;
        }
        scan.hash[v] = hash_point(p);
    }
    for (size_t t = 0; t < n_tri; t++) {
        const int32_t *c = surface->tri + 3 * t;
        bool finite = true;
        for (int k = 0; k < 9; k++) finite &= scan.point[3 * (size_t)c[k / 3] + (size_t)(k % 3)] != INT32_MIN;
        if (!finite) continue;
        memcpy(scan.tri + 3 * (size_t)scan.n_tri++, c, 3 * sizeof *c);
    }
    find_closed(&scan);
    *out = scan;
    return PAL_ERR_OK;
}

/* crossings in the order they are found, with their rows */
typedef struct found {
    pal_crossing crossing;
    int32_t row;
} found;

typedef struct scanner {
    int n_p, n_q, n_place, axis; /* n_place: voxels along the axis */
    int64_t n, max;              /* crossings and their budget */
    found *item;
} scanner;

/* does the shifted centre lie behind a crossing exactly at the centre? The surface near there moves along the axis by
 * -(normal across . shift) / normal along */
static bool tie_is_behind(const int32_t *a, const int32_t *b, const int32_t *c, int axis)
{
    int64_t e[3], f[3], normal[3];
    for (int k = 0; k < 3; k++) e[k] = (int64_t)b[k] - a[k], f[k] = (int64_t)c[k] - a[k];
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        normal[k] = e[i] * f[j] - e[j] * f[i];
    }
    /* axes before this one are shifted more than the centre itself, axes after it less */
    for (int k = 0; k < axis; k++)
        if (normal[k] != 0) return (normal[k] > 0) == (normal[axis] > 0);
    return true;
}

/* first voxel whose centre is behind the crossing, and the crossing's depth; weights of b and c over area */
static int32_t find_index(const int32_t *a, const int32_t *b, const int32_t *c, int axis, int64_t weight_b,
                          int64_t weight_c, int64_t area, int32_t *depth)
{
    int64_t to_b = (int64_t)b[axis] - a[axis], to_c = (int64_t)c[axis] - a[axis];
    double t = ((double)weight_b * (double)to_b + (double)weight_c * (double)to_c) / (double)area + (double)a[axis];
    *depth = (int32_t)floor(t);
    double in_voxels = (t - PAL_SCAN_HALF) / PAL_SCAN_ONE, whole = floor(in_voxels + 0.5);
    if (fabs(in_voxels - whole) > 1e-7) return (int32_t)floor(in_voxels) + 1;

    /* close to a centre: compare in whole numbers */
    int32_t place = (int32_t)whole;
    wide rise = (wide)weight_b * to_b + (wide)weight_c * to_c;
    wide centre = ((wide)place * PAL_SCAN_ONE + PAL_SCAN_HALF - a[axis]) * area;
    if (rise != centre) return rise < centre ? place : place + 1;
    return tie_is_behind(a, b, c, axis) ? place : place + 1;
}

/* edge function from u to v at (p, q) and its tie rule as a bias, so that inside is value + bias >= 0 */
typedef struct edge_rule {
    int64_t dp, dq, at, bias;
} edge_rule;

static edge_rule edge_make(const int32_t *u, const int32_t *v, int p, int q, int64_t at_p, int64_t at_q)
{
    edge_rule e = {.dp = (int64_t)v[p] - u[p], .dq = (int64_t)v[q] - u[q]};
    e.at = e.dp * (at_q - u[q]) - e.dq * (at_p - u[p]);
    e.bias = e.dq < 0 || (e.dq == 0 && e.dp > 0) ? 0 : -1;
    return e;
}

/* clips from..to, counted from the position of the edge function, to the centres of a row on the inner side of the edge
 */
static void narrow(const edge_rule *e, int64_t *from, int64_t *to)
{
    int64_t value = e->at + e->bias, step = e->dq * PAL_SCAN_ONE;
    if (step == 0) {
        if (value < 0) *to = *from - 1;
    } else if (step > 0) {
        int64_t last = value < 0 ? -1 : value / step;
        if (last < *to) *to = last;
    } else if (value < 0) {
        int64_t first = (-value - step - 1) / -step;
        if (first > *from) *from = first;
    }
}

/* voxels whose centres lie below a coordinate, and at or below it */
static inline int32_t centres_below(int32_t at)
{
    return (at - PAL_SCAN_HALF + PAL_SCAN_ONE - 1) >> 16;
}
static inline int32_t last_centre(int32_t at)
{
    return (at - PAL_SCAN_HALF) >> 16;
}

pal_err pal_scan_find_near(pal_scan_surface *scan)
{
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, scan->near, scan->n_tri);
    if (err) return err;
    scan->n_near = 0;
    for (int32_t t = 0; t < scan->n_tri; t++) {
        const int32_t *a = pal_scan_corner(scan, (size_t)t, 0), *b = pal_scan_corner(scan, (size_t)t, 1),
                      *c = pal_scan_corner(scan, (size_t)t, 2);
        int n_axis = 0;
        for (int k = 0; k < 3; k++) {
            int32_t low = a[k] < b[k] ? a[k] : b[k], high = a[k] < b[k] ? b[k] : a[k];
            low = c[k] < low ? c[k] : low, high = c[k] > high ? c[k] : high;
            n_axis += centres_below(low) <= last_centre(high);
        }
        scan->near[scan->n_near] = t;
        scan->n_near += n_axis >= 2;
    }
    return PAL_ERR_OK;
}

/* first and last centre within the range of three coordinates, within 0..n-1 */
static bool centre_range(int32_t a, int32_t b, int32_t c, int n, int *from, int *to)
{
    int32_t sorted[3];
    pal_sort3(sorted, (const int32_t[3]){a, b, c});
    *from = centres_below(sorted[0]);
    *to = last_centre(sorted[2]);
    if (*from < 0) *from = 0;
    if (*to > n - 1) *to = n - 1;
    return *from <= *to;
}

static bool scan_triangle(scanner *s, const int32_t *a, const int32_t *b, const int32_t *c, int32_t part)
{
    int p = ACROSS[s->axis][0], q = ACROSS[s->axis][1], p0, p1, q0, q1;
    if (!centre_range(a[p], b[p], c[p], s->n_p, &p0, &p1)) return true;
    if (!centre_range(a[q], b[q], c[q], s->n_q, &q0, &q1)) return true;
    int64_t area = ((int64_t)b[p] - a[p]) * ((int64_t)c[q] - a[q]) - ((int64_t)b[q] - a[q]) * ((int64_t)c[p] - a[p]);
    if (area == 0) return true;

    /* seen along the axis the projected area is the component of the normal for axes 0 and 2, its negative for axis 1;
     * the row enters where the outward normal points against it */
    int32_t sign = (area < 0) == (s->axis != 1) ? 1 : -1;
    if (area < 0) {
        const int32_t *swap = b;
        b = c, c = swap;
        area = -area;
    }
    int64_t at_p = (int64_t)p0 * PAL_SCAN_ONE + PAL_SCAN_HALF, at_q = (int64_t)q0 * PAL_SCAN_ONE + PAL_SCAN_HALF;
    edge_rule ab = edge_make(a, b, p, q, at_p, at_q), bc = edge_make(b, c, p, q, at_p, at_q),
              ca = edge_make(c, a, p, q, at_p, at_q);
    for (int j = q0; j <= q1; j++) {
        int64_t from = 0, to = p1 - p0;
        if (to >= WIDE_ROW) {
            narrow(&ab, &from, &to);
            narrow(&bc, &from, &to);
            narrow(&ca, &from, &to);
        }
        int64_t value_ab = ab.at - from * ab.dq * PAL_SCAN_ONE, value_bc = bc.at - from * bc.dq * PAL_SCAN_ONE,
                value_ca = ca.at - from * ca.dq * PAL_SCAN_ONE;
        for (int64_t i = p0 + from; i <= p0 + to; i++) {
            if (((value_ab + ab.bias) | (value_bc + bc.bias) | (value_ca + ca.bias)) >= 0) {
                if (s->n == s->max || !PAL_GROW(s->item, s->n)) return false;
                found *f = &s->item[s->n++];
                int32_t place = find_index(a, b, c, s->axis, value_ca, value_ab, area, &f->crossing.depth);
                f->crossing.place = place < 0 ? 0 : place > s->n_place ? s->n_place : place;
                f->crossing.part = part, f->crossing.sign = sign;
                f->row = (int32_t)(j * (int64_t)s->n_p + i);
            }
            value_ab -= ab.dq * PAL_SCAN_ONE;
            value_bc -= bc.dq * PAL_SCAN_ONE;
            value_ca -= ca.dq * PAL_SCAN_ONE;
        }
        ab.at += ab.dp * PAL_SCAN_ONE;
        bc.at += bc.dp * PAL_SCAN_ONE;
        ca.at += ca.dp * PAL_SCAN_ONE;
    }
    return true;
}

static int compare_crossings(const void *a, const void *b)
{
    const pal_crossing *c = a, *d = b;
    if (c->place != d->place) return PAL_COMPARE(c->place, d->place);
    if (c->depth != d->depth) return PAL_COMPARE(c->depth, d->depth);
    if (c->part != d->part) return PAL_COMPARE(c->part, d->part);
    return PAL_COMPARE(c->sign, d->sign);
}

PAL_SORT(sort_row, pal_crossing, compare_crossings)

/* distributes the crossings to their rows and sorts each row */
static pal_err sort_rows(const scanner *s, pal_crossings *out)
{
    int n_row = s->n_p * s->n_q;
    pal_err err = PAL_ERR_OK;
    int64_t *start;
    pal_crossing *item;
    PAL_ZEROED(&err, start, n_row + 2);
    PAL_ARRAY(&err, item, s->n);
    if (err) return PAL_FREED(err, start, item);
    for (int64_t i = 0; i < s->n; i++) start[s->item[i].row + 2]++;
    for (int i = 0; i < n_row; i++) start[i + 2] += start[i + 1];
    for (int64_t i = 0; i < s->n; i++) item[start[s->item[i].row + 1]++] = s->item[i].crossing;
    for (int i = 0; i < n_row; i++) sort_row(item + start[i], (size_t)(start[i + 1] - start[i]));
    *out = (pal_crossings){n_row, start, item};
    return PAL_ERR_OK;
}

pal_err pal_scan_axis(const pal_scan_surface *scan, const int n[3], int axis, pal_crossings *out)
{
    scanner s = {.n_p = n[ACROSS[axis][0]], .n_q = n[ACROSS[axis][1]], .n_place = n[axis], .axis = axis};
    s.max = (int64_t)CROSSINGS_PER_ROW * s.n_p * s.n_q + (int64_t)CROSSINGS_PER_TRI * scan->n_tri + 4096;
    bool ok = true;
    const int n_near = scan->near ? scan->n_near : scan->n_tri;
    for (int i = 0; ok && i < n_near; i++) {
        const size_t t = (size_t)(scan->near ? scan->near[i] : i);
        ok = scan_triangle(&s, pal_scan_corner(scan, t, 0), pal_scan_corner(scan, t, 1), pal_scan_corner(scan, t, 2),
                           scan->part ? scan->part[t] : 0);
    }
    pal_err err = ok ? sort_rows(&s, out) : s.n == s.max ? PAL_ERR_BUDGET : PAL_ERR_MEMORY;
    return PAL_FREED(err, s.item);
}

void pal_crossings_free(pal_crossings *crossings)
{
    PAL_FREE(crossings->start, crossings->item);
    memset(crossings, 0, sizeof *crossings);
}
