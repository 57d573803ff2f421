/* Modified butterfly stencils, paper C eq. 3-5, after Zorin, Schroeder, Sweldens, "Interpolating subdivision for meshes
 * with arbitrary topology" (SIGGRAPH 1996) and, for the boundary, Zorin, Schroeder, "Subdivision for modeling and
 * animation" (SIGGRAPH 2000 course notes, modified butterfly).
 *
 *   edge                                               midpoint
 *   boundary                                           four points of the boundary, (-1, 9, 9, -1)/16
 *   both ends regular (6 faces; 3 at the boundary)     eq. 3, eight points
 *   one end not regular                                the rule of that end
 *   both ends not regular, both inner or both boundary mean of their rules
 *   not regular, inner and boundary                    mean of their rules
 *   an end is a corner of the boundary                 straight: half of each end
 *
 * Rules of ends: inner, K faces: eq. 5 with 3/4 of the vertex; boundary, k faces: the crease weights of the course
 * notes, which are exact for linear functions on k equal angles of a half plane.
 *
 * Departures: eq. 4 lacks the centre (errata C2), the boundary weight -9/16 is +9/16 (C3). The paper is silent about
 * stencils that leave the mesh: a missing point of eq. 3 is the reflection p* = a + b - opposite across boundary edge
 * a b, which keeps the rule exact for linear functions on a regular grid. At corners the boundary ends: the missing
 * fourth point is 2 c - p, so that a sheet keeps its corners and straight sides. */
#include "server/mesh/geometry/butterfly.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

double pal_butterfly_ring(int K, int i)
{
    if (K == 3) return i == 0 ? 5.0 / 12 : -1.0 / 12;
    if (K == 4) return i == 0 ? 3.0 / 8 : i == 2 ? -1.0 / 8 : 0;
    double a = 2 * PI * i / K;
    return (0.25 + cos(a) + 0.5 * cos(2 * a)) / K;
}

double pal_butterfly_boundary(int k, int i, int j)
{
    double a = PI / k;
    if (j < 0) return 1 - sin(a) * sin(i * a) / (k * (1 - cos(a)));
    if (j > 0 && j < k) return (sin(i * a) * sin(j * a) + 0.5 * sin(2 * i * a) * sin(2 * j * a)) / k;
    double end = 0.25 * cos(i * a) - sin(2 * a) * sin(2 * i * a) / (4 * k * (cos(a) - cos(2 * a)));
    return j == 0 ? end : -end;
}

/* the fan of v: edges around it, whether one of the gaps is a hole, and the first edge after the hole (or e) */
typedef struct fan {
    int n_edge;
    bool rim;
    int32_t first;
} fan;

static fan fan_of(const pal_winged_mesh *w, int32_t e, int32_t v)
{
    fan f = {0, false, e};
    int32_t at = e;
    do {
        int32_t after = pal_wing_next_around(w->edge, at, v);
        if (pal_wing_face(w->edge, at, v) < 0) f.rim = true, f.first = after;
        f.n_edge++;
        at = after;
    } while (at != e);
    return f;
}

static bool is_corner(const pal_winged_mesh *w, int32_t v)
{
    return w->corner && v < w->n_corner && w->corner[v];
}

static bool is_regular(const fan *f)
{
    return f->n_edge == (f->rim ? 4 : 6);
}

int pal_butterfly_max_entries(const pal_winged_mesh *wings, int32_t e)
{
    int n = 8;
    for (int end = 0; end < 2 && wings->edge[e].face[1] >= 0; end++) {
        fan f = fan_of(wings, e, wings->edge[e].vertex[end]);
        if (!is_regular(&f)) n += f.n_edge + 1;
    }
    return n;
}

/* entries as they are found: an index may come more than once */
typedef struct entries {
    int n;
    int32_t *index;
    double *weight;
} entries;

static void set_entry(entries *to, int32_t index, double weight)
{
    if (weight == 0) return;
    to->index[to->n] = index;
    to->weight[to->n++] = weight;
}

/* adds to the entry of this index, for the few of the short rules */
static void add(entries *to, int32_t index, double weight)
{
    int k = 0;
    while (k < to->n && to->index[k] != index) k++;
    if (k == to->n)
        set_entry(to, index, weight);
    else
        to->weight[k] += weight;
}

/* third vertex of the face on one side of an edge */
static int32_t opposite(const pal_winged_mesh *w, int32_t e, int side)
{
    return pal_wing_other_end(w->edge, w->edge[e].next[side], w->edge[e].vertex[1 - side]);
}

/* eq. 3; a point beyond the boundary is reflected across it */
static void regular_rule(const pal_winged_mesh *w, int32_t e, entries *to)
{
    const pal_winged_edge *edge = w->edge;
    for (int side = 0; side < 2; side++) {
        /* the face from start to end to top */
        int32_t start = edge[e].vertex[side], end = edge[e].vertex[1 - side], top = opposite(w, e, side);
        add(to, start, 0.5);
        add(to, top, 0.125);
        for (int k = 0; k < 2; k++) {
            int32_t outer = k == 0 ? edge[e].next[side] : edge[e].prev[side], from = k == 0 ? end : top;
            int outside = 1 - pal_wing_side(edge, outer, from);
            if (edge[outer].face[outside] >= 0) {
                add(to, opposite(w, outer, outside), -0.0625);
                continue;
            }
            add(to, edge[outer].vertex[0], -0.0625);
            add(to, edge[outer].vertex[1], -0.0625);
            add(to, k == 0 ? start : end, 0.0625);
        }
    }
}

/* the rule of the end v of an inner edge, with all weights times share */
static void end_rule(const pal_winged_mesh *w, int32_t e, int32_t v, double share, entries *to)
{
    fan f = fan_of(w, e, v);
    if (!f.rim) {
        set_entry(to, v, 0.75 * share);
        int32_t at = e;
        for (int i = 0; i < f.n_edge; i++, at = pal_wing_next_around(w->edge, at, v))
            set_entry(to, pal_wing_other_end(w->edge, at, v), share * pal_butterfly_ring(f.n_edge, i));
        return;
    }
    int k = f.n_edge - 1, place = 0;
    int32_t at = f.first;
    while (at != e) at = pal_wing_next_around(w->edge, at, v), place++;
    set_entry(to, v, share * pal_butterfly_boundary(k, place, -1));
    at = f.first;
    for (int j = 0; j <= k; j++, at = pal_wing_next_around(w->edge, at, v))
        set_entry(to, pal_wing_other_end(w->edge, at, v), share * pal_butterfly_boundary(k, place, j));
}

/* the four-point rule; the boundary ends at its corners */
static void boundary_rule(const pal_winged_mesh *w, int32_t e, entries *to)
{
    const pal_winged_edge *edge = w->edge;
    for (int end = 0; end < 2; end++) {
        /* the walk around the hole enters the edge at vertex[1]: beyond it lies prev, beyond vertex[0] next */
        int32_t v = edge[e].vertex[end], beyond = end == 0 ? edge[e].next[1] : edge[e].prev[1];
        add(to, v, 0.5625);
        if (is_corner(w, v)) {
            add(to, v, -0.125);
            add(to, edge[e].vertex[1 - end], 0.0625);
        } else
            add(to, pal_wing_other_end(edge, beyond, v), -0.0625);
    }
}

typedef struct entry {
    int32_t index;
    double weight;
} entry;

static int by_index(const void *a, const void *b)
{
    int32_t i = ((const entry *)a)->index, j = ((const entry *)b)->index;
    return i < j ? -1 : i > j;
}

/* sorts by index; few entries, except around vertices of hundreds of faces */
static void sort(entries *to)
{
    entry *heap = to->n > 64 ? malloc((size_t)to->n * sizeof *heap) : NULL;
    if (heap) {
        for (int k = 0; k < to->n; k++) heap[k] = (entry){to->index[k], to->weight[k]};
        qsort(heap, (size_t)to->n, sizeof *heap, by_index);
        for (int k = 0; k < to->n; k++) to->index[k] = heap[k].index, to->weight[k] = heap[k].weight;
        free(heap);
        return;
    }
    for (int i = 1; i < to->n; i++) {
        int32_t index = to->index[i];
        double weight = to->weight[i];
        int j = i;
        for (; j > 0 && to->index[j - 1] > index; j--)
            to->index[j] = to->index[j - 1], to->weight[j] = to->weight[j - 1];
        to->index[j] = index, to->weight[j] = weight;
    }
}

/* merges equal indices and drops entries that have cancelled */
static void merge(entries *to)
{
    int n = 0;
    sort(to);
    for (int k = 0; k < to->n; n++) {
        int32_t index = to->index[k];
        double weight = 0;
        for (; k < to->n && to->index[k] == index; k++) weight += to->weight[k];
        to->index[n] = index, to->weight[n] = weight;
        if (fabs(weight) < 1e-15) n--;
    }
    to->n = n;
}

int pal_butterfly_stencil(const pal_winged_mesh *wings, int32_t e, int32_t *index, double *weight)
{
    const pal_winged_edge *at = &wings->edge[e];
    entries to = {0, index, weight};
    int32_t a = at->vertex[0], b = at->vertex[1];
    if (at->face[1] < 0)
        boundary_rule(wings, e, &to);
    else if (is_corner(wings, a) || is_corner(wings, b)) {
        set_entry(&to, a, 0.5);
        set_entry(&to, b, 0.5);
    } else {
        fan left = fan_of(wings, e, a), right = fan_of(wings, e, b);
        bool odd_a = !is_regular(&left), odd_b = !is_regular(&right);
        if (!odd_a && !odd_b) regular_rule(wings, e, &to);
        if (odd_a) end_rule(wings, e, a, odd_b ? 0.5 : 1, &to);
        if (odd_b) end_rule(wings, e, b, odd_a ? 0.5 : 1, &to);
    }
    merge(&to);
    return to.n;
}
