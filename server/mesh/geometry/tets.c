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

/* a face as one tet has it */
typedef struct side {
    int32_t node[3]; /* ascending                 */
    uint32_t from;   /* tet * 4 + opposite corner */
} side;

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
    if (s->node[1] != t->node[1]) return PAL_COMPARE(s->node[1], t->node[1]);
    if (s->node[2] != t->node[2]) return PAL_COMPARE(s->node[2], t->node[2]);
    return PAL_COMPARE(s->from, t->from);
}

PAL_SORT(sort_nodes, int32_t, pal_compare_int32)
PAL_SORT(sort_sides, side, compare_sides)

/* the sides of all tets [4 n_tet], equal faces one after another, ascending; the caller frees them */
static pal_err list_sides(const pal_tets *tets, side **out)
{
    pal_err err = PAL_ERR_OK;
    int32_t n_node = tets->n_node;
    int64_t *start; /* bucket of each smallest node */
    side *item;
    PAL_ZEROED(&err, start, n_node + 2);
    PAL_ARRAY(&err, item, 4 * (size_t)tets->n_tet);
    if (err) return PAL_FREED(err, start, item);
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t from = 0; from < 4 * (uint32_t)tets->n_tet; from++) {
            const int32_t *c = tets->tet + (from & ~3u);
            const uint8_t *o = OPPOSITE[from & 3];
            side s = {.from = from};
            pal_sort3(s.node, (const int32_t[3]){c[o[0]], c[o[1]], c[o[2]]});
            if (pass == 0)
                start[s.node[0] + 2]++;
            else
                item[start[s.node[0] + 1]++] = s;
        }
        for (int32_t i = 0; pass == 0 && i < n_node; i++) start[i + 2] += start[i + 1];
    }
    for (int32_t i = 0; i < n_node; i++) sort_sides(item + start[i], (size_t)(start[i + 1] - start[i]));
    free(start);
    *out = item;
    return PAL_ERR_OK;
}

/* how many of the sides from a on (before end) are the same face */
static int64_t count_equal(const side *a, const side *end)
{
    const side *b = a + 1;
    while (b < end && !memcmp(b->node, a->node, sizeof a->node)) b++;
    return b - a;
}

pal_err pal_tets_find_boundary(pal_tets *tets)
{
    side *sides;
    PAL_TRY(list_sides(tets, &sides));

    /* a face of one tet only is boundary; mark it by its tet and opposite corner, so that the faces come out in the
     * order of the tets */
    size_t n_side = 4 * (size_t)tets->n_tet, n_face = 0;
    pal_err err = PAL_ERR_OK;
    uint8_t *alone, *on_surface;
    int32_t *face;
    PAL_ZEROED(&err, alone, n_side);
    PAL_ZEROED(&err, on_surface, tets->n_node);
    for (int64_t n, k = 0; !err && k < (int64_t)n_side; k += n) {
        n = count_equal(sides + k, sides + n_side);
        n_face += alone[sides[k].from] = n == 1;
    }
    free(sides);
    PAL_ARRAY(&err, face, 3 * n_face);
    if (err) return PAL_FREED(err, alone, on_surface, face);
    int32_t *to = face;
    for (size_t from = 0; from < n_side; from++)
        for (int k = 0; alone[from] && k < 3; k++, to++) {
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
    int32_t *end, *edge;
    PAL_ZEROED(&err, start, n_node + 2);
    PAL_ARRAY(&err, end, 6 * n_tet);
    for (int pass = 0; pass < 2 && !err; pass++) {
        for (size_t k = 0; k < 6 * n_tet; k++) {
            int32_t a = tets->tet[k / 6 * 4 + EDGE[k % 6][0]], b = tets->tet[k / 6 * 4 + EDGE[k % 6][1]];
            if (pass == 0)
                start[(a < b ? a : b) + 2]++;
            else
                end[start[(a < b ? a : b) + 1]++] = a < b ? b : a;
        }
        for (size_t i = 0; pass == 0 && i < n_node; i++) start[i + 2] += start[i + 1];
    }

    /* sort each bucket and keep the different ends, packed to the front of the same array */
    int64_t n_kept = 0;
    for (size_t i = 0; i < n_node && !err; i++) {
        int64_t a = start[i], b = start[i + 1];
        sort_nodes(end + a, (size_t)(b - a));
        start[i] = n_kept;
        for (int64_t k = a; k < b; k++)
            if (k == a || end[k] != end[k - 1]) end[n_kept++] = end[k];
    }
    PAL_ARRAY(&err, edge, 2 * n_kept);
    if (err) return PAL_FREED(err, start, end, edge);
    start[n_node] = n_kept;
    for (size_t i = 0; i < n_node; i++)
        for (int64_t k = start[i]; k < start[i + 1]; k++) edge[2 * k] = (int32_t)i, edge[2 * k + 1] = end[k];
    PAL_FREE(start, end);
    *out = edge;
    *n_edge = (int)n_kept;
    return PAL_ERR_OK;
}

pal_err pal_tets_faces(const pal_tets *tets, int32_t **out, int *n_face)
{
    side *sides;
    pal_err err = list_sides(tets, &sides);
    if (err) return err;
    int64_t n_side = 4 * (int64_t)tets->n_tet, n = 0;
    int32_t *face;
    for (int64_t k = 0; k < n_side; k += count_equal(sides + k, sides + n_side)) sides[n++] = sides[k];
    PAL_ARRAY(&err, face, 3 * n);
    if (err) return PAL_FREED(err, sides);
    for (int64_t k = 0; k < n; k++) memcpy(face + 3 * k, sides[k].node, sizeof sides[k].node);
    free(sides);
    *out = face;
    *n_face = (int)n;
    return PAL_ERR_OK;
}

pal_err pal_tets_components(const pal_tets *tets, int32_t *label, int *n_component)
{
    side *sides;
    PAL_TRY(list_sides(tets, &sides));
    pal_union_find_init(label, tets->n_tet);
    for (size_t k = 1; k < 4 * (size_t)tets->n_tet; k++)
        if (count_equal(&sides[k - 1], &sides[k + 1]) == 2)
            pal_union_find_join(label, (int32_t)(sides[k - 1].from >> 2), (int32_t)(sides[k].from >> 2));
    free(sides);
    *n_component = pal_union_find_label(label, tets->n_tet);
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
    side *sides;
    PAL_TRY(list_sides(tets, &sides));
    const side *end = sides + 4 * (size_t)tets->n_tet;
    int64_t n;
    for (const side *s = sides; s < end; s += n) {
        n = count_equal(s, end);
        if (n <= 2) continue;
        if (f->n == 0) memcpy(node, s->node, sizeof s->node);
        count_fault(f, 0);
    }
    free(sides);
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
    pal_err err = PAL_ERR_OK;
    uint8_t *used;
    PAL_ZEROED(&err, used, tets->n_node);
    if (err) return err;
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
