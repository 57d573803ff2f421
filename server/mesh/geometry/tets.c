/* Tetrahedral meshes at rest: boundary, unique edges and faces, components, faults.
 *
 * One method serves all: the faces (or edges) of all tets are sorted into buckets by their smallest node and then
 * inside the bucket, so equal ones are adjacent. Linear in tets, since a node has a bounded number of tets around it; a
 * hostile mesh whose tets all meet in one node takes n log n. */
#include "server/mesh/geometry/tets.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/surface.h"
#include "server/num/sort.h"
#include "server/num/union_find.h"

/* face opposite to each corner, counter-clockwise from outside of a tet of positive volume */
static const uint8_t OPPOSITE[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
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
    PAL_FREE(tets->x, tets->tet, tets->face, tets->on_surface);
    memset(tets, 0, sizeof *tets);
}

double pal_tet_volume(const double *x, const int32_t *corner)
{
    double e[3], n[3];
    const double *o = x + 3 * (size_t)corner[0];
    pal_sub3(e, x + 3 * (size_t)corner[1], o);
    pal_normal3(n, o, x + 3 * (size_t)corner[2], x + 3 * (size_t)corner[3]);
    return pal_dot3(e, n) / 6;
}

double pal_tets_volume(const pal_tets *tets)
{
    double sum = 0;
    for (int t = 0; t < tets->n_tet; t++) sum += pal_tet_volume(tets->x, tets->tet + 4 * (size_t)t);
    return sum;
}

static int compare_sides(const void *a, const void *b)
{
    const side *s = a, *t = b;
    if (s->middle != t->middle) return PAL_COMPARE(s->middle, t->middle);
    if (s->largest != t->largest) return PAL_COMPARE(s->largest, t->largest);
    return PAL_COMPARE(s->from, t->from);
}

PAL_SORT(sort_nodes, int32_t, pal_compare_int32)
PAL_SORT(sort_sides, side, compare_sides)

/* smallest, middle, largest node of a face */
static void sort_face(const int32_t *corner, int opposite, int32_t node[3])
{
    const uint8_t *o = OPPOSITE[opposite];
    pal_sort3(node, (const int32_t[3]){corner[o[0]], corner[o[1]], corner[o[2]]});
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
    PAL_FREE(s->start, s->item);
}

static pal_err sides_make(const pal_tets *tets, sides *out)
{
    size_t n_node = (size_t)tets->n_node, n_tet = (size_t)tets->n_tet;
    pal_err err = PAL_ERR_OK;
    int64_t *start;
    side *item;
    PAL_ZEROED(&err, start, n_node + 1);
    PAL_ARRAY(&err, item, 4 * n_tet);
    if (err) return PAL_FREED(err, start, item);
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

    for (size_t i = 0; i < n_node; i++) sort_sides(item + start[i], (size_t)(start[i + 1] - start[i]));
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
    pal_err err = PAL_ERR_OK;
    uint8_t *alone, *on_surface;
    int32_t *face;
    PAL_ZEROED(&err, alone, n_side);
    PAL_ZEROED(&err, on_surface, tets->n_node);
    if (!err)
        for (int i = 0; i < tets->n_node; i++)
            for (int64_t a = s.start[i], n; a < s.start[i + 1]; a += n) {
                n = same_sides(&s, a, s.start[i + 1]);
                if (n != 1) continue;
                alone[s.item[a].from] = 1;
                n_face++;
            }
    sides_free(&s);
    PAL_ARRAY(&err, face, 3 * n_face);
    if (err) return PAL_FREED(err, alone, on_surface, face);
    int32_t *to = face;
    for (size_t from = 0; from < n_side; from++)
        if (alone[from])
            for (int k = 0; k < 3; k++, to++) {
                *to = tets->tet[(from & ~(size_t)3) + OPPOSITE[from & 3][k]];
                on_surface[*to] = 1;
            }
    PAL_FREE(alone, tets->face, tets->on_surface);
    tets->face = face;
    tets->on_surface = on_surface;
    tets->n_face = (int)n_face;
    return PAL_ERR_OK;
}

pal_err pal_tets_edges(const pal_tets *tets, int32_t **out, int *n_edge)
{
    size_t n_node = (size_t)tets->n_node, n_tet = (size_t)tets->n_tet;
    pal_err err = PAL_ERR_OK;
    int64_t *start;
    int32_t *end;
    PAL_ZEROED(&err, start, n_node + 1);
    PAL_ARRAY(&err, end, 6 * n_tet);
    if (err) return PAL_FREED(err, start, end);
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
        sort_nodes(end + a, (size_t)(b - a));
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
    PAL_FREE(start, end);
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

/* a kind of fault: how many there are, and what the message says of the first */
typedef struct faults {
    long long n;
    int first;
} faults;

static void count_fault(faults *f, int i)
{
    if (f->n++ == 0) f->first = i;
}

/* indices out of range, repeated corners */
static void check_corners(const pal_tets *tets, faults *index, faults *repeated)
{
    for (int t = 0; t < tets->n_tet; t++) {
        const int32_t *c = tets->tet + 4 * (size_t)t;
        bool in = true, twice = false;
        for (int k = 0; k < 4; k++) {
            in &= c[k] >= 0 && c[k] < tets->n_node;
            for (int l = 0; l < k; l++) twice |= c[k] == c[l];
        }
        if (!in || twice) count_fault(in ? repeated : index, t);
    }
    for (size_t k = 0; k < 3 * (size_t)tets->n_face; k++)
        if (tets->face[k] < 0 || tets->face[k] >= tets->n_node) count_fault(index, (int)(k / 3));
}

/* faces of more than two tets, and the nodes of the first */
static pal_err check_sides(const pal_tets *tets, faults *f, int32_t node[3])
{
    sides s;
    PAL_TRY(sides_make(tets, &s));
    for (int i = 0; i < tets->n_node; i++)
        for (int64_t a = s.start[i], n; a < s.start[i + 1]; a += n) {
            n = same_sides(&s, a, s.start[i + 1]);
            if (n <= 2) continue;
            if (f->n == 0) node[0] = i, node[1] = s.item[a].middle, node[2] = s.item[a].largest;
            count_fault(f, 0);
        }
    sides_free(&s);
    return PAL_ERR_OK;
}

/* every boundary edge must be run through equally often in both directions */
static pal_err check_boundary(const pal_tets *tets, long long *n_open)
{
    const pal_surface boundary = {.n_vertex = tets->n_node, .n_tri = tets->n_face, .tri = tets->face};
    int32_t *start;
    pal_surface_side *run;
    PAL_TRY(pal_surface_sides(&boundary, &start, &run));
    for (int32_t i = 0; i < tets->n_node; i++)
        for (int32_t a = start[i], b = a; a < start[i + 1]; a = b) {
            int sum = 0;
            for (; b < start[i + 1] && run[b].high == run[a].high; b++) sum += tets->face[run[b].corner] == i ? 1 : -1;
            *n_open += sum != 0;
        }
    PAL_FREE(start, run);
    return PAL_ERR_OK;
}

static pal_err check_unused(const pal_tets *tets, faults *f)
{
    uint8_t *used = calloc(tets->n_node ? (size_t)tets->n_node : 1, 1);
    if (!used) return PAL_ERR_MEMORY;
    for (size_t k = 0; k < 4 * (size_t)tets->n_tet; k++) used[tets->tet[k]] = 1;
    for (int i = 0; i < tets->n_node; i++)
        if (!used[i]) count_fault(f, i);
    free(used);
    return PAL_ERR_OK;
}

pal_err pal_tets_check(const pal_tets *tets, pal_diagnostic *diag)
{
    faults index = {0}, repeated = {0}, flat = {0}, crowded = {0}, unused = {0};
    long long n_open = 0;
    int32_t node[3] = {0};
    check_corners(tets, &index, &repeated);
    if (index.n)
        return PAL_REFUSE(diag, "%lld index%s out of range of %d nodes, the first in element %d", index.n,
                          index.n > 1 ? "es" : "", tets->n_node, index.first);
    if (repeated.n)
        return PAL_REFUSE(diag, "%lld tetrahedra with a corner used twice, the first is %d", repeated.n,
                          repeated.first);
    for (int t = 0; t < tets->n_tet; t++)
        if (!(pal_tet_volume(tets->x, tets->tet + 4 * (size_t)t) > 0)) count_fault(&flat, t);
    if (flat.n) return PAL_REFUSE(diag, "%lld tetrahedra without positive volume, the first is %d", flat.n, flat.first);
    PAL_TRY(check_sides(tets, &crowded, node));
    if (crowded.n)
        return PAL_REFUSE(diag, "%lld faces of more than two tetrahedra, the first has nodes %d %d %d", crowded.n,
                          node[0], node[1], node[2]);
    PAL_TRY(check_boundary(tets, &n_open));
    if (n_open) return PAL_REFUSE(diag, "the boundary is not closed: %lld edges without a partner", n_open);
    PAL_TRY(check_unused(tets, &unused));
    if (unused.n) return PAL_REFUSE(diag, "%lld nodes of no tetrahedron, the first is %d", unused.n, unused.first);
    return PAL_ERR_OK;
}
