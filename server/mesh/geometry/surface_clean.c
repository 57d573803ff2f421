/* Cleaning of a surface as read: welding, and dropping triangles without area and duplicates.
 *
 * Welding joins a vertex to the first earlier kept vertex within the tolerance. Kept vertices are farther apart than
 * the tolerance, so a cell of four tolerances holds a bounded number of them for any file. */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/surface.h"
#include "server/mesh/geometry/tuning.h"
#include "server/num/sort.h"

typedef struct cleaner {
    pal_surface *surface;
    double eps;        /* welding distance; 0: equal positions only                            */
    double low[3];     /* box corner, so that cell numbers stay small                          */
    int32_t *map;      /* vertex that stands for each vertex, -1: dropped         [n_vertex]   */
    int32_t *next;     /* next vertex of the same bucket, -1: last                [n_vertex]   */
    int32_t *bucket;   /* first vertex or triangle of each bucket                 [n_bucket]   */
    uint64_t n_bucket; /* a power of two                                                       */
    pal_surface_report *count;
} cleaner;

static uint64_t mix(uint64_t h, uint64_t word)
{
    h = (h ^ word) * 0x9E3779B97F4A7C15u;
    return h ^ (h >> 29);
}

static uint64_t bucket_of(const cleaner *k, const int64_t key[3])
{
    return mix(mix(mix(1, (uint64_t)key[0]), (uint64_t)key[1]), (uint64_t)key[2]) & (k->n_bucket - 1);
}

static uint64_t point_bucket(const cleaner *k, const double p[3])
{
    double x[3] = {p[0] + 0.0, p[1] + 0.0, p[2] + 0.0}; /* minus zero becomes zero */
    int64_t bits[3];
    memcpy(bits, x, sizeof bits);
    return bucket_of(k, bits);
}

/* drops triangles with a corner that is not finite, and marks vertices of no triangle (map -1, else 0) */
static void drop_nonfinite(cleaner *k)
{
    pal_surface *s = k->surface;
    int n = 0;
    for (int i = 0; i < s->n_vertex; i++) k->map[i] = -1;
    for (int t = 0; t < s->n_tri; t++) {
        int32_t c[3];
        memcpy(c, s->tri + 3 * (size_t)t, sizeof c);
        bool good = true;
        for (int a = 0; a < 9; a++) good &= fabs(s->x[3 * (size_t)c[a / 3] + (size_t)(a % 3)]) <= COORDINATE_LIMIT;
        if (!good) continue;
        for (int a = 0; a < 3; a++) k->map[c[a]] = 0;
        memcpy(s->tri + 3 * (size_t)n++, c, sizeof c);
    }
    k->count->n_nonfinite += s->n_tri - n;
    s->n_tri = n;
    for (int i = 0; i < s->n_vertex; i++) k->count->n_unused += k->map[i] < 0;
}

/* the kept vertex of one bucket within the tolerance of p with the smallest index, if smaller than best */
static int32_t weld_partner(const cleaner *k, uint64_t bucket, const double p[3], int32_t best)
{
    for (int32_t j = k->bucket[bucket]; j >= 0; j = k->next[j]) {
        const double *q = k->surface->x + 3 * (size_t)j;
        bool same = k->eps > 0 ? pal_dist3(p, q) <= k->eps : p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
        if (same && (best < 0 || j < best)) best = j;
    }
    return best;
}

/* finds the partner of vertex i or records i as kept */
static void weld_vertex(cleaner *k, int32_t i)
{
    const double *p = k->surface->x + 3 * (size_t)i;
    int32_t partner = -1;
    uint64_t home;
    if (k->eps > 0) {
        int64_t low[3], high[3], own[3], cell[3];
        for (int a = 0; a < 3; a++) {
            double x = p[a] - k->low[a], size = 4 * k->eps;
            low[a] = (int64_t)floor((x - k->eps) / size);
            high[a] = (int64_t)floor((x + k->eps) / size);
            own[a] = (int64_t)floor(x / size);
        }
        home = bucket_of(k, own);
        for (cell[2] = low[2]; cell[2] <= high[2]; cell[2]++)
            for (cell[1] = low[1]; cell[1] <= high[1]; cell[1]++)
                for (cell[0] = low[0]; cell[0] <= high[0]; cell[0]++)
                    partner = weld_partner(k, bucket_of(k, cell), p, partner);
    } else {
        home = point_bucket(k, p);
        partner = weld_partner(k, home, p, -1);
    }
    if (partner >= 0) {
        k->map[i] = partner;
        k->count->n_welded++;
        k->count->max_weld_m = fmax(k->count->max_weld_m, pal_dist3(p, k->surface->x + 3 * (size_t)partner));
        return;
    }
    k->map[i] = i;
    k->next[i] = k->bucket[home];
    k->bucket[home] = i;
}

static void weld(cleaner *k)
{
    pal_surface *s = k->surface;
    for (uint64_t b = 0; b < k->n_bucket; b++) k->bucket[b] = -1;
    for (int32_t i = 0; i < s->n_vertex; i++)
        if (k->map[i] >= 0) weld_vertex(k, i);
    for (size_t c = 0; c < 3 * (size_t)s->n_tri; c++) s->tri[c] = k->map[s->tri[c]];
}

static bool repeats_corner(const int32_t *c)
{
    return c[0] == c[1] || c[1] == c[2] || c[2] == c[0];
}

static bool has_area(const pal_surface *s, const int32_t c[3])
{
    if (repeats_corner(c)) return false;
    double u[3], v[3], w[3], n[3];
    pal_sub3(u, s->x + 3 * (size_t)c[1], s->x + 3 * (size_t)c[0]);
    pal_sub3(v, s->x + 3 * (size_t)c[2], s->x + 3 * (size_t)c[0]);
    pal_sub3(w, v, u);
    pal_cross3(n, u, v);
    double longest2 = fmax(pal_dot3(u, u), fmax(pal_dot3(v, v), pal_dot3(w, w)));
    return pal_norm3(n) > MIN_SHAPE * longest2;
}

static void drop_degenerate(cleaner *k)
{
    pal_surface *s = k->surface;
    int n = 0;
    for (int t = 0; t < s->n_tri; t++)
        if (has_area(s, s->tri + 3 * (size_t)t))
            memmove(s->tri + 3 * (size_t)n++, s->tri + 3 * (size_t)t, 3 * sizeof *s->tri);
    k->count->n_degenerate += s->n_tri - n;
    s->n_tri = n;
}

/* the only other triangle at the edge of corners a and b of triangle t, -1: none or several */
static int32_t neighbour(const pal_surface *s, const int32_t *start, const int32_t *item, int32_t t, int32_t a,
                         int32_t b)
{
    int32_t found = -1, n = 0;
    if (start[a + 1] - start[a] > MAX_FAN) return -1;
    for (int k = start[a]; k < start[a + 1]; k++) {
        const int32_t *c = s->tri + 3 * (size_t)item[k];
        if (item[k] == t || (c[0] != b && c[1] != b && c[2] != b)) continue;
        found = item[k];
        n++;
    }
    return n == 1 ? found : -1;
}

/* a flat triangle with three corners lies along its longest edge a-c with b in between: the triangle a-c-d on the other
 * side is split at b, which keeps the surface closed; dropping the flat one would leave a slit */
static bool split_neighbour(cleaner *k, const int32_t *start, const int32_t *item, int32_t t)
{
    pal_surface *s = k->surface;
    int32_t *c = s->tri + 3 * (size_t)t;
    double length[3];
    int longest = 0;
    for (int i = 0; i < 3; i++) {
        length[i] = pal_dist3(s->x + 3 * (size_t)c[i], s->x + 3 * (size_t)c[(i + 1) % 3]);
        if (length[i] > length[longest]) longest = i;
    }
    int32_t to = c[longest], from = c[(longest + 1) % 3], b = c[(longest + 2) % 3];
    int32_t other = neighbour(s, start, item, t, to, from);
    if (other < 0) return false;
    int32_t *e = s->tri + 3 * (size_t)other;
    int i = 0;
    while (i < 3 && !(e[i] == from && e[(i + 1) % 3] == to)) i++;
    if (i == 3) return false;
    int32_t d = e[(i + 2) % 3];
    const int32_t one[3] = {from, b, d}, two[3] = {b, to, d};
    bool busy = start[b + 1] - start[b] > MAX_FAN || k->next[to] || k->next[from] || k->next[b] || k->next[d];
    if (busy || !has_area(s, one) || !has_area(s, two)) return false;
    for (int m = start[b]; m < start[b + 1]; m++)
        for (int a = 0; a < 3; a++)
            if (s->tri[3 * (size_t)item[m] + (size_t)a] == d) return false;
    k->next[to] = k->next[from] = k->next[b] = k->next[d] = 1;
    memcpy(c, one, sizeof one);
    memcpy(e, two, sizeof two);
    k->count->n_repaired++;
    return true;
}

static bool is_flat(const pal_surface *s, int t)
{
    const int32_t *c = s->tri + 3 * (size_t)t;
    return !repeats_corner(c) && !has_area(s, c);
}

/* repairs flat triangles in rounds; a vertex takes part once in a round, so that its fan is still valid */
static pal_err repair_flat(cleaner *k)
{
    pal_surface *s = k->surface;
    for (int round = 0, n = 1; round < 16 && n > 0; round++) {
        int first = 0;
        while (first < s->n_tri && !is_flat(s, first)) first++;
        if (first == s->n_tri) return PAL_ERR_OK;
        int32_t *start, *item;
        PAL_TRY(pal_surface_fans(s, &start, &item));
        memset(k->next, 0, (size_t)s->n_vertex * sizeof *k->next);
        n = 0;
        for (int t = first; t < s->n_tri; t++)
            if (is_flat(s, t)) n += split_neighbour(k, start, item, t);
        PAL_FREE(start, item);
    }
    return PAL_ERR_OK;
}

/* 1 or -1: parity of the corners against their sorted order */
static int orientation(const int32_t c[3])
{
    return (c[0] < c[1]) + (c[1] < c[2]) + (c[2] < c[0]) == 2 ? 1 : -1;
}

/* drops triangles of balance zero (as many in one orientation as in the other) if the rest has no more open edges
 * without them: such a fin encloses nothing, but a body whose triangles all exist in both orientations is kept */
static pal_err drop_folded(cleaner *k, const int8_t *balance)
{
    pal_surface *s = k->surface, rest = *s;
    pal_surface_topology with, without;
    rest.tri = malloc((3 * (size_t)s->n_tri + 1) * sizeof *rest.tri);
    if (!rest.tri) return PAL_ERR_MEMORY;
    rest.n_tri = 0;
    for (size_t t = 0; t < (size_t)s->n_tri; t++)
        if (balance[t]) memcpy(rest.tri + 3 * (size_t)rest.n_tri++, s->tri + 3 * t, 3 * sizeof *rest.tri);
    pal_err err = pal_surface_check(s, &with);
    if (!err) err = pal_surface_check(&rest, &without);
    if (!err && rest.n_tri > 0 && rest.n_tri < s->n_tri && without.n_open_edge <= with.n_open_edge) {
        memcpy(s->tri, rest.tri, 3 * (size_t)rest.n_tri * sizeof *rest.tri);
        k->count->n_folded += s->n_tri - rest.n_tri;
        s->n_tri = rest.n_tri;
    }
    return PAL_FREED(err, rest.tri);
}

/* keeps the first of the triangles with the same three corners; open addressing, at most half full */
static pal_err drop_duplicate(cleaner *k)
{
    pal_surface *s = k->surface;
    int n = 0;
    int8_t *balance = malloc((size_t)s->n_tri + 1);
    if (!balance) return PAL_ERR_MEMORY;
    for (uint64_t b = 0; b < k->n_bucket; b++) k->bucket[b] = -1;
    for (int t = 0; t < s->n_tri; t++) {
        int32_t c[3], key[3], other[3];
        memcpy(c, s->tri + 3 * (size_t)t, sizeof c);
        pal_sort3(key, c);
        uint64_t b = bucket_of(k, (const int64_t[3]){key[0], key[1], key[2]});
        for (; k->bucket[b] >= 0; b = (b + 1) & (k->n_bucket - 1)) {
            pal_sort3(other, s->tri + 3 * (size_t)k->bucket[b]);
            if (memcmp(key, other, sizeof key) == 0) break;
        }
        int32_t first = k->bucket[b];
        if (first >= 0) {
            bool same = orientation(c) == orientation(s->tri + 3 * (size_t)first);
            if (balance[first] < 100 && balance[first] > -100) balance[first] += same ? 1 : -1;
            continue;
        }
        k->bucket[b] = n;
        balance[n] = 1;
        memcpy(s->tri + 3 * (size_t)n++, c, sizeof c);
    }
    bool again = n < s->n_tri;
    k->count->n_duplicate += s->n_tri - n;
    s->n_tri = n;
    pal_err err = again ? drop_folded(k, balance) : PAL_ERR_OK;
    return PAL_FREED(err, balance);
}

/* keeps the vertices in use, in their order, and puts the box centre at zero */
static void compact(cleaner *k)
{
    pal_surface *s = k->surface;
    for (int i = 0; i < s->n_vertex; i++) k->count->n_unused += k->map[i] == i;
    pal_surface_drop_unused(s, k->map);
    k->count->n_unused -= s->n_vertex;
    pal_surface_recentre(s);
}

/* box of the usable vertices in use: the welding distance and the cells' corner */
static void measure(cleaner *k, double tolerance)
{
    double high[3];
    pal_box3_empty(k->low, high);
    for (int i = 0; i < k->surface->n_vertex; i++)
        if (k->map[i] >= 0) pal_box3_add(k->low, high, k->surface->x + 3 * (size_t)i);
    k->eps = tolerance >= 1e-15 ? fmin(tolerance, 1) * pal_dist3(k->low, high) : 0;
}

pal_err pal_surface_clean(pal_surface *surface, double tolerance, pal_surface_report *report, pal_diagnostic *diag)
{
    pal_surface_report unused = {0};
    cleaner k = {.surface = surface, .n_bucket = 16, .count = report ? report : &unused};
    pal_err err = PAL_ERR_OK;
    while (k.n_bucket < 2 * (uint64_t)surface->n_vertex || k.n_bucket < 2 * (uint64_t)surface->n_tri) k.n_bucket *= 2;
    PAL_ARRAY(&err, k.map, surface->n_vertex);
    PAL_ARRAY(&err, k.next, surface->n_vertex);
    PAL_ARRAY(&err, k.bucket, k.n_bucket);
    if (!err) {
        drop_nonfinite(&k);
        measure(&k, tolerance);
        weld(&k);
        err = repair_flat(&k);
        drop_degenerate(&k);
        if (!err) err = drop_duplicate(&k);
        compact(&k);
    }
    if (err) pal_diagnostic_set(diag, err, "no memory to clean %d triangles", surface->n_tri);
    if (!err && surface->n_tri == 0)
        err = PAL_REFUSE(diag, "no triangle is left: %lld without area, %lld doubled, %lld not finite",
                         (long long)k.count->n_degenerate, (long long)k.count->n_duplicate,
                         (long long)k.count->n_nonfinite);
    return PAL_FREED(err, k.map, k.next, k.bucket);
}
