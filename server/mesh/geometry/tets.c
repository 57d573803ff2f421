/* Tetrahedral meshes at rest: boundary, unique edges and faces, components, faults.
 *
 * One method serves all: the faces (or edges) of all tets are sorted into buckets by their smallest node and then
 * inside the bucket, so equal ones are adjacent. Linear in tets, since a node has a bounded number of tets around it; a
 * hostile mesh whose tets all meet in one node takes n log n. */
#include "server/mesh/geometry/tets.h"

#include "server/base/vec3.h"
#include "server/num/union_find.h"

#include <stdlib.h>
#include <string.h>

/* face opposite to each corner, counter-clockwise from outside of a tet of positive volume */
static const uint8_t OPPOSITE[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
enum { SHORT = 96 };
static const uint8_t EDGE[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* one face in the bucket of its smallest node */
typedef struct side {
    int32_t middle, largest; /* its other nodes, ascending */
    uint32_t from;           /* tet * 4 + opposite corner  */
} side;

typedef struct sides {
    int64_t *start; /* bucket of each node [n_node+1] */
    side *item;     /* [4 n_tet]                      */
} sides;

void pal_tets_free(pal_tets *tets)
{
    free(tets->x);
    free(tets->tet);
    free(tets->face);
    free(tets->on_surface);
    memset(tets, 0, sizeof *tets);
}

static double tet_volume(const pal_tets *tets, int t)
{
    const int32_t *corner = tets->tet + 4 * (size_t)t;
    double e[3][3], c[3];
    for (int k = 0; k < 3; k++) pal_sub3(e[k], tets->x + 3 * (size_t)corner[k + 1], tets->x + 3 * (size_t)corner[0]);
    pal_cross3(c, e[1], e[2]);
    return pal_dot3(e[0], c) / 6;
}

double pal_tets_volume(const pal_tets *tets)
{
    double sum = 0;
    for (int t = 0; t < tets->n_tet; t++) sum += tet_volume(tets, t);
    return sum;
}

static int compare_sides(const void *a, const void *b)
{
    const side *s = a, *t = b;
    if (s->middle != t->middle) return s->middle < t->middle ? -1 : 1;
    if (s->largest != t->largest) return s->largest < t->largest ? -1 : 1;
    return s->from < t->from ? -1 : s->from > t->from;
}

static int compare_nodes(const void *a, const void *b)
{
    int32_t s = *(const int32_t *)a, t = *(const int32_t *)b;
    return s < t ? -1 : s > t;
}

/* buckets are short: insertion sort, and qsort for long ones */
static void sort_nodes(int32_t *node, int64_t n)
{
    if (n > SHORT) {
        qsort(node, (size_t)n, sizeof *node, compare_nodes);
        return;
    }
    for (int64_t a = 1; a < n; a++) {
        int32_t moved = node[a];
        int64_t b = a;
        for (; b > 0 && moved < node[b - 1]; b--) node[b] = node[b - 1];
        node[b] = moved;
    }
}

static void sort_sides(side *s, int64_t n)
{
    if (n > SHORT) {
        qsort(s, (size_t)n, sizeof *s, compare_sides);
        return;
    }
    for (int64_t a = 1; a < n; a++) {
        side moved = s[a];
        int64_t b = a;
        for (; b > 0 && compare_sides(&moved, &s[b - 1]) < 0; b--) s[b] = s[b - 1];
        s[b] = moved;
    }
}

/* smallest, middle, largest node of a face */
static void sort_face(const int32_t *corner, int opposite, int32_t node[3])
{
    int32_t a = corner[OPPOSITE[opposite][0]], b = corner[OPPOSITE[opposite][1]], c = corner[OPPOSITE[opposite][2]];
    int32_t low = a < b ? a : b, high = a < b ? b : a;
    node[0] = c < low ? c : low;
    node[2] = c > high ? c : high;
    node[1] = c < low ? low : c > high ? high : c;
}

/* turns counts at start[i + 1] into starts */
static void prefix_sum(int64_t *start, int n)
{
    for (int i = 0; i < n; i++) start[i + 1] += start[i];
}

/* undoes the filling pass, which moved every start to its bucket's end */
static void restore_starts(int64_t *start, int n)
{
    memmove(start + 1, start, sizeof *start * (size_t)n);
    start[0] = 0;
}

static void sides_free(sides *s)
{
    free(s->start);
    free(s->item);
}

static pal_err sides_make(const pal_tets *tets, sides *out)
{
    size_t n_node = (size_t)tets->n_node, n_tet = (size_t)tets->n_tet;
    int64_t *start = calloc(n_node + 1, sizeof *start);
    side *item = malloc((n_tet ? 4 * n_tet : 1) * sizeof *item);
    if (!start || !item) {
        free(start);
        free(item);
        return PAL_ERR_MEMORY;
    }
    int32_t node[3];
    for (size_t t = 0; t < n_tet; t++)
        for (int k = 0; k < 4; k++) {
            sort_face(tets->tet + 4 * t, k, node);
            start[node[0] + 1]++;
        }
    prefix_sum(start, tets->n_node);
    for (size_t t = 0; t < n_tet; t++)
        for (int k = 0; k < 4; k++) {
            sort_face(tets->tet + 4 * t, k, node);
            item[start[node[0]]++] = (side){node[1], node[2], (uint32_t)(4 * t) + (uint32_t)k};
        }
    restore_starts(start, tets->n_node);

    for (size_t i = 0; i < n_node; i++) sort_sides(item + start[i], start[i + 1] - start[i]);
    *out = (sides){start, item};
    return PAL_ERR_OK;
}

/* number of sides from item a on (before end) that are the same face */
static int64_t same_sides(const sides *s, int64_t a, int64_t end)
{
    int64_t b = a + 1;
    while (b < end && s->item[b].middle == s->item[a].middle && s->item[b].largest == s->item[a].largest) b++;
    return b - a;
}

pal_err pal_tets_find_boundary(pal_tets *tets)
{
    sides s;
    PAL_TRY(sides_make(tets, &s));

    /* a face of one tet only is boundary; mark it by its tet and opposite corner, so that the faces come out in the
     * order of the tets */
    size_t n_side = 4 * (size_t)tets->n_tet, n_face = 0;
    uint8_t *alone = calloc(n_side ? n_side : 1, 1);
    uint8_t *on_surface = calloc(tets->n_node ? (size_t)tets->n_node : 1, 1);
    if (alone && on_surface)
        for (int i = 0; i < tets->n_node; i++)
            for (int64_t a = s.start[i], n; a < s.start[i + 1]; a += n) {
                n = same_sides(&s, a, s.start[i + 1]);
                if (n != 1) continue;
                alone[s.item[a].from] = 1;
                n_face++;
            }
    sides_free(&s);
    int32_t *face = malloc((n_face ? n_face : 1) * 3 * sizeof *face);
    if (!alone || !on_surface || !face) {
        free(alone);
        free(on_surface);
        free(face);
        return PAL_ERR_MEMORY;
    }
    int32_t *to = face;
    for (size_t from = 0; from < n_side; from++)
        if (alone[from])
            for (int k = 0; k < 3; k++, to++) {
                *to = tets->tet[(from & ~(size_t)3) + OPPOSITE[from & 3][k]];
                on_surface[*to] = 1;
            }
    free(alone);
    free(tets->face);
    free(tets->on_surface);
    tets->face = face;
    tets->on_surface = on_surface;
    tets->n_face = (int)n_face;
    return PAL_ERR_OK;
}

pal_err pal_tets_edges(const pal_tets *tets, int32_t **out, int *n_edge)
{
    size_t n_node = (size_t)tets->n_node, n_tet = (size_t)tets->n_tet;
    int64_t *start = calloc(n_node + 1, sizeof *start);
    int32_t *end = malloc((n_tet ? 6 * n_tet : 1) * sizeof *end);
    if (!start || !end) {
        free(start);
        free(end);
        return PAL_ERR_MEMORY;
    }
    for (int pass = 0; pass < 2; pass++) {
        for (size_t t = 0; t < n_tet; t++)
            for (int k = 0; k < 6; k++) {
                int32_t a = tets->tet[4 * t + EDGE[k][0]], b = tets->tet[4 * t + EDGE[k][1]];
                int32_t low = a < b ? a : b;
                if (pass == 0)
                    start[low + 1]++;
                else
                    end[start[low]++] = a < b ? b : a;
            }
        if (pass == 0) prefix_sum(start, tets->n_node);
    }
    restore_starts(start, tets->n_node);

    /* sort each bucket and keep the different ends, packed to the front of the same array */
    int64_t n_kept = 0;
    for (size_t i = 0; i < n_node; i++) {
        int64_t a = start[i], b = start[i + 1];
        sort_nodes(end + a, b - a);
        start[i] = n_kept;
        for (int64_t k = a; k < b; k++)
            if (k == a || end[k] != end[k - 1]) end[n_kept++] = end[k];
    }
    start[n_node] = n_kept;
    int32_t *edge = malloc((n_kept ? (size_t)n_kept : 1) * 2 * sizeof *edge);
    if (edge)
        for (size_t i = 0; i < n_node; i++)
            for (int64_t k = start[i]; k < start[i + 1]; k++) {
                edge[2 * k] = (int32_t)i;
                edge[2 * k + 1] = end[k];
            }
    free(start);
    free(end);
    if (!edge) return PAL_ERR_MEMORY;
    *out = edge;
    *n_edge = (int)n_kept;
    return PAL_ERR_OK;
}

pal_err pal_tets_faces(const pal_tets *tets, int32_t **out, int *n_face)
{
    sides s;
    PAL_TRY(sides_make(tets, &s));
    size_t n = 0;
    for (int i = 0; i < tets->n_node; i++)
        for (int64_t a = s.start[i]; a < s.start[i + 1]; a += same_sides(&s, a, s.start[i + 1])) n++;
    int32_t *face = malloc((n ? n : 1) * 3 * sizeof *face), *to = face;
    if (face)
        for (int i = 0; i < tets->n_node; i++)
            for (int64_t a = s.start[i]; a < s.start[i + 1]; a += same_sides(&s, a, s.start[i + 1])) {
                *to++ = i;
                *to++ = s.item[a].middle;
                *to++ = s.item[a].largest;
            }
    sides_free(&s);
    if (!face) return PAL_ERR_MEMORY;
    *out = face;
    *n_face = (int)n;
    return PAL_ERR_OK;
}

pal_err pal_tets_components(const pal_tets *tets, int32_t *label, int *n_component)
{
    sides s;
    PAL_TRY(sides_make(tets, &s));
    int32_t *parent = malloc((tets->n_tet ? (size_t)tets->n_tet : 1) * sizeof *parent);
    if (!parent) {
        sides_free(&s);
        return PAL_ERR_MEMORY;
    }
    pal_union_find_init(parent, tets->n_tet);
    for (int i = 0; i < tets->n_node; i++)
        for (int64_t a = s.start[i]; a + 1 < s.start[i + 1]; a++) {
            if (same_sides(&s, a, a + 2) < 2) continue;
            pal_union_find_join(parent, (int32_t)(s.item[a].from >> 2), (int32_t)(s.item[a + 1].from >> 2));
        }
    sides_free(&s);
    *n_component = pal_union_find_label(parent, tets->n_tet);
    if (label) memcpy(label, parent, (size_t)tets->n_tet * sizeof *label);
    free(parent);
    return PAL_ERR_OK;
}

/* what pal_tets_check counts */
typedef struct faults {
    int64_t bad_index, repeated, flat, crowded, open, unused;
    int first_index, first_repeated, first_flat, first_crowded, first_unused;
    int32_t crowded_node[3];
} faults;

static void count_first(int64_t *count, int *first, int i)
{
    if ((*count)++ == 0) *first = i;
}

/* indices out of range, repeated corners */
static void check_corners(const pal_tets *tets, faults *f)
{
    for (int t = 0; t < tets->n_tet; t++) {
        const int32_t *c = tets->tet + 4 * (size_t)t;
        bool in = true, twice = false;
        for (int k = 0; k < 4; k++) {
            in &= c[k] >= 0 && c[k] < tets->n_node;
            for (int l = 0; l < k; l++) twice |= c[k] == c[l];
        }
        if (!in)
            count_first(&f->bad_index, &f->first_index, t);
        else if (twice)
            count_first(&f->repeated, &f->first_repeated, t);
    }
    for (size_t k = 0; k < 3 * (size_t)tets->n_face; k++)
        if (tets->face[k] < 0 || tets->face[k] >= tets->n_node)
            count_first(&f->bad_index, &f->first_index, (int)(k / 3));
}

/* faces of more than two tets */
static pal_err check_sides(const pal_tets *tets, faults *f)
{
    sides s;
    PAL_TRY(sides_make(tets, &s));
    for (int i = 0; i < tets->n_node; i++)
        for (int64_t a = s.start[i], n; a < s.start[i + 1]; a += n) {
            n = same_sides(&s, a, s.start[i + 1]);
            if (n <= 2) continue;
            if (f->crowded == 0) {
                f->crowded_node[0] = i;
                f->crowded_node[1] = s.item[a].middle;
                f->crowded_node[2] = s.item[a].largest;
            }
            count_first(&f->crowded, &f->first_crowded, (int)(s.item[a].from >> 2));
        }
    sides_free(&s);
    return PAL_ERR_OK;
}

static int compare_pairs(const void *a, const void *b)
{
    const int32_t *s = a, *t = b;
    for (int k = 0; k < 2; k++)
        if (s[k] != t[k]) return s[k] < t[k] ? -1 : 1;
    return s[2] < t[2] ? -1 : s[2] > t[2];
}

/* every boundary edge must be run through equally often in both directions */
static pal_err check_boundary(const pal_tets *tets, faults *f)
{
    size_t n = 3 * (size_t)tets->n_face;
    int32_t *run = malloc((n ? n : 1) * 3 * sizeof *run);
    if (!run) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) {
        int32_t a = tets->face[i], b = tets->face[i % 3 == 2 ? i - 2 : i + 1];
        run[3 * i] = a < b ? a : b;
        run[3 * i + 1] = a < b ? b : a;
        run[3 * i + 2] = a < b ? 1 : -1;
    }
    qsort(run, n, 3 * sizeof *run, compare_pairs);
    for (size_t a = 0, b; a < n; a = b) {
        int sum = 0;
        for (b = a; b < n && run[3 * b] == run[3 * a] && run[3 * b + 1] == run[3 * a + 1]; b++) sum += run[3 * b + 2];
        f->open += sum != 0;
    }
    free(run);
    return PAL_ERR_OK;
}

static pal_err check_unused(const pal_tets *tets, faults *f)
{
    uint8_t *used = calloc(tets->n_node ? (size_t)tets->n_node : 1, 1);
    if (!used) return PAL_ERR_MEMORY;
    for (size_t k = 0; k < 4 * (size_t)tets->n_tet; k++) used[tets->tet[k]] = 1;
    for (int i = 0; i < tets->n_node; i++)
        if (!used[i]) count_first(&f->unused, &f->first_unused, i);
    free(used);
    return PAL_ERR_OK;
}

pal_err pal_tets_check(const pal_tets *tets, pal_diagnostic *diag)
{
    faults f = {0};
    check_corners(tets, &f);
    if (f.bad_index)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "%lld index%s out of range of %d nodes, the first in element %d",
                                  (long long)f.bad_index, f.bad_index > 1 ? "es" : "", tets->n_node, f.first_index);
    if (f.repeated)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%lld tetrahedra with a corner used twice, the first is %d",
                                  (long long)f.repeated, f.first_repeated);
    for (int t = 0; t < tets->n_tet; t++)
        if (!(tet_volume(tets, t) > 0)) count_first(&f.flat, &f.first_flat, t);
    if (f.flat)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%lld tetrahedra without positive volume, the first is %d",
                                  (long long)f.flat, f.first_flat);
    PAL_TRY(check_sides(tets, &f));
    if (f.crowded)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                  "%lld faces of more than two tetrahedra, the first has nodes %d %d %d",
                                  (long long)f.crowded, f.crowded_node[0], f.crowded_node[1], f.crowded_node[2]);
    PAL_TRY(check_boundary(tets, &f));
    if (f.open)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "the boundary is not closed: %lld edges without a partner",
                                  (long long)f.open);
    PAL_TRY(check_unused(tets, &f));
    if (f.unused)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%lld nodes of no tetrahedron, the first is %d",
                                  (long long)f.unused, f.first_unused);
    return PAL_ERR_OK;
}
