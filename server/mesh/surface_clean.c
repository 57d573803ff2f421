/* Cleaning of a surface as read: welding, and dropping what carries no area or says the same twice.
 *
 * Welding joins a vertex to the first earlier kept vertex within the tolerance. Kept vertices are farther than the
 * tolerance apart, so a cell of four tolerances holds a bounded number of them however the file is made. */
#include "server/base/vec3.h"
#include "server/mesh/surface.h"

#include <stdlib.h>
#include <string.h>

/* a coordinate beyond this cannot be cubed and summed any more, and counts as infinite */
#define COORDINATE_LIMIT 1e30
/* a triangle whose height is below this part of its longest side has no area */
#define HEIGHT_LIMIT 1e-12

typedef struct cleaner {
    pal_surface *surface;
    double eps;        /* welding distance; 0: equal positions only                            */
    double low[3];     /* box corner, so that cell numbers stay small                          */
    int32_t *map;      /* vertex that stands for each vertex, -1: dropped         [n_vertex]   */
    int32_t *next;     /* next vertex of the same bucket, -1: last                [n_vertex]   */
    int32_t *bucket;   /* first vertex or triangle of each bucket                 [n_bucket]   */
    uint64_t n_bucket; /* a power of two                                                       */
    pal_surface_report count;
} cleaner;

static uint64_t mix(uint64_t h, uint64_t word)
{
    h = (h ^ word) * 0x9E3779B97F4A7C15u;
    return h ^ (h >> 29);
}

static uint64_t cell_bucket(const cleaner *k, const int64_t cell[3])
{
    return mix(mix(mix(1, (uint64_t)cell[0]), (uint64_t)cell[1]), (uint64_t)cell[2]) & (k->n_bucket - 1);
}

static uint64_t point_bucket(const cleaner *k, const double p[3])
{
    uint64_t h = 1;
    for (int a = 0; a < 3; a++) {
        double x = p[a] + 0.0; /* minus zero becomes zero */
        uint64_t bits;
        memcpy(&bits, &x, sizeof bits);
        h = mix(h, bits);
    }
    return h & (k->n_bucket - 1);
}

static bool usable(const double p[3])
{
    return fabs(p[0]) <= COORDINATE_LIMIT && fabs(p[1]) <= COORDINATE_LIMIT && fabs(p[2]) <= COORDINATE_LIMIT;
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
        for (int a = 0; a < 3; a++) good &= usable(s->x + 3 * (size_t)c[a]);
        if (!good) continue;
        for (int a = 0; a < 3; a++) k->map[c[a]] = 0;
        memcpy(s->tri + 3 * (size_t)n++, c, sizeof c);
    }
    k->count.n_nonfinite += s->n_tri - n;
    s->n_tri = n;
    for (int i = 0; i < s->n_vertex; i++) k->count.n_unused += k->map[i] < 0;
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

/* finds the partner of vertex i or files i as kept */
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
        home = cell_bucket(k, own);
        for (cell[2] = low[2]; cell[2] <= high[2]; cell[2]++)
            for (cell[1] = low[1]; cell[1] <= high[1]; cell[1]++)
                for (cell[0] = low[0]; cell[0] <= high[0]; cell[0]++)
                    partner = weld_partner(k, cell_bucket(k, cell), p, partner);
    } else {
        home = point_bucket(k, p);
        partner = weld_partner(k, home, p, -1);
    }
    if (partner >= 0) {
        k->map[i] = partner;
        k->count.n_welded++;
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

static bool has_area(const pal_surface *s, const int32_t c[3])
{
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) return false;
    double u[3], v[3], w[3], n[3];
    pal_sub3(u, s->x + 3 * (size_t)c[1], s->x + 3 * (size_t)c[0]);
    pal_sub3(v, s->x + 3 * (size_t)c[2], s->x + 3 * (size_t)c[0]);
    pal_sub3(w, v, u);
    pal_cross3(n, u, v);
    double longest2 = fmax(pal_dot3(u, u), fmax(pal_dot3(v, v), pal_dot3(w, w)));
    return pal_norm3(n) > HEIGHT_LIMIT * longest2;
}

static void drop_degenerate(cleaner *k)
{
    pal_surface *s = k->surface;
    int n = 0;
    for (int t = 0; t < s->n_tri; t++) {
        int32_t c[3];
        memcpy(c, s->tri + 3 * (size_t)t, sizeof c);
        if (has_area(s, c)) memcpy(s->tri + 3 * (size_t)n++, c, sizeof c);
    }
    k->count.n_degenerate += s->n_tri - n;
    s->n_tri = n;
}

static void sort_corners(int32_t r[3], const int32_t c[3])
{
    int32_t low = c[0] < c[1] ? c[0] : c[1], high = c[0] < c[1] ? c[1] : c[0];
    r[0] = c[2] < low ? c[2] : low;
    r[2] = c[2] > high ? c[2] : high;
    r[1] = (int32_t)((int64_t)c[0] + c[1] + c[2] - r[0] - r[2]);
}

/* keeps the first of the triangles with the same three corners; open addressing, at most half full */
static void drop_duplicate(cleaner *k)
{
    pal_surface *s = k->surface;
    int n = 0;
    for (uint64_t b = 0; b < k->n_bucket; b++) k->bucket[b] = -1;
    for (int t = 0; t < s->n_tri; t++) {
        int32_t c[3], key[3], other[3];
        memcpy(c, s->tri + 3 * (size_t)t, sizeof c);
        sort_corners(key, c);
        uint64_t b = mix(mix(mix(1, (uint64_t)key[0]), (uint64_t)key[1]), (uint64_t)key[2]) & (k->n_bucket - 1);
        bool again = false;
        for (; k->bucket[b] >= 0 && !again; b = again ? b : (b + 1) & (k->n_bucket - 1)) {
            sort_corners(other, s->tri + 3 * (size_t)k->bucket[b]);
            again = memcmp(key, other, sizeof key) == 0;
        }
        if (again) continue;
        k->bucket[b] = n;
        memcpy(s->tri + 3 * (size_t)n++, c, sizeof c);
    }
    k->count.n_duplicate += s->n_tri - n;
    s->n_tri = n;
}

/* keeps the vertices in use, in their order, and puts the box centre at zero */
static void compact(cleaner *k)
{
    pal_surface *s = k->surface;
    for (int i = 0; i < s->n_vertex; i++) k->map[i] = k->map[i] == i ? -2 : -1;
    for (size_t c = 0; c < 3 * (size_t)s->n_tri; c++) k->map[s->tri[c]] = 0;
    int n = 0;
    for (int i = 0; i < s->n_vertex; i++) {
        k->count.n_unused += k->map[i] == -2;
        if (k->map[i] < 0) continue;
        k->map[i] = n;
        memmove(s->x + 3 * (size_t)n++, s->x + 3 * (size_t)i, 3 * sizeof(double));
    }
    s->n_vertex = n;
    for (size_t c = 0; c < 3 * (size_t)s->n_tri; c++) s->tri[c] = k->map[s->tri[c]];
    pal_surface_recentre(s);
}

/* box of the usable vertices in use: the welding distance and the cells' corner */
static void measure(cleaner *k, double tolerance)
{
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    bool first = true;
    for (int i = 0; i < k->surface->n_vertex; i++) {
        if (k->map[i] < 0) continue;
        for (int a = 0; a < 3; a++) {
            double x = k->surface->x[3 * (size_t)i + (size_t)a];
            if (first || x < low[a]) low[a] = x;
            if (first || x > high[a]) high[a] = x;
        }
        first = false;
    }
    pal_copy3(k->low, low);
    k->eps = tolerance >= 1e-15 ? fmin(tolerance, 1) * pal_dist3(low, high) : 0;
}

pal_err pal_surface_clean(pal_surface *surface, double tolerance, pal_surface_report *report, pal_note *note)
{
    size_t n_vertex = (size_t)surface->n_vertex, most = n_vertex;
    if ((size_t)surface->n_tri > most) most = (size_t)surface->n_tri;
    cleaner k = {.surface = surface, .n_bucket = 16};
    while (k.n_bucket < 2 * most) k.n_bucket *= 2;
    k.map = malloc((n_vertex + 1) * sizeof *k.map);
    k.next = malloc((n_vertex + 1) * sizeof *k.next);
    k.bucket = malloc(k.n_bucket * sizeof *k.bucket);
    pal_err err = PAL_ERR_OK;
    if (!k.map || !k.next || !k.bucket) {
        err = pal_note_set(note, PAL_ERR_MEMORY, "no memory to clean %d triangles", surface->n_tri);
    } else {
        drop_nonfinite(&k);
        measure(&k, tolerance);
        weld(&k);
        drop_degenerate(&k);
        drop_duplicate(&k);
        compact(&k);
        if (surface->n_tri == 0)
            err = pal_note_set(
                note, PAL_ERR_REFUSED, "no triangle is left: %lld without area, %lld doubled, %lld not finite",
                (long long)k.count.n_degenerate, (long long)k.count.n_duplicate, (long long)k.count.n_nonfinite);
    }
    if (report) {
        report->n_welded += k.count.n_welded;
        report->n_degenerate += k.count.n_degenerate;
        report->n_duplicate += k.count.n_duplicate;
        report->n_nonfinite += k.count.n_nonfinite;
        report->n_unused += k.count.n_unused;
    }
    free(k.map);
    free(k.next);
    free(k.bucket);
    return err;
}
