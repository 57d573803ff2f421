/* Modified butterfly stencils, paper C eq. 3-5, after Zorin, Schroeder, Sweldens, "Interpolating subdivision for meshes
 * with arbitrary topology" (SIGGRAPH 1996) and, for the boundary, Zorin, Schroeder, "Subdivision for modeling and
 * animation" (SIGGRAPH 2000 course notes, modified butterfly).
 *
 * server/mesh/README.md has the weights, errata and reflections. An end on the boundary is regular with 3 faces; else
 * it has the crease weights of the course notes, which are exact for linear functions on k equal angles of a half
 * plane. An edge with an end at a corner of the boundary is halved straight. At corners the boundary ends: the missing
 * fourth point is 2 c - p, so that a sheet keeps its corners and straight sides. */
#include "server/mesh/geometry/butterfly.h"

#include "server/num/sort.h"

#include <math.h>
#include <stdbool.h>

double pal_butterfly_ring(int K, int i)
{
    if (K == 3) return i == 0 ? 5.0 / 12 : -1.0 / 12;
    if (K == 4) return i == 0 ? 3.0 / 8 : i == 2 ? -1.0 / 8 : 0;
    double a = 2 * M_PI * i / K;
    return (0.25 + cos(a) + 0.5 * cos(2 * a)) / K;
}

double pal_butterfly_boundary(int k, int i, int j)
{
    double a = M_PI / k;
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

/* entries as they are found: a vertex may come more than once */
typedef struct entries {
    int n;
    pal_stencil_entry *item;
} entries;

static void add(entries *to, int32_t vertex, double weight)
{
    if (weight != 0) to->item[to->n++] = (pal_stencil_entry){vertex, weight};
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
        add(to, v, 0.75 * share);
        int32_t at = e;
        for (int i = 0; i < f.n_edge; i++, at = pal_wing_next_around(w->edge, at, v))
            add(to, pal_wing_other_end(w->edge, at, v), share * pal_butterfly_ring(f.n_edge, i));
        return;
    }
    int k = f.n_edge - 1, place = 0;
    int32_t at = f.first;
    while (at != e) at = pal_wing_next_around(w->edge, at, v), place++;
    add(to, v, share * pal_butterfly_boundary(k, place, -1));
    at = f.first;
    for (int j = 0; j <= k; j++, at = pal_wing_next_around(w->edge, at, v))
        add(to, pal_wing_other_end(w->edge, at, v), share * pal_butterfly_boundary(k, place, j));
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

static int by_vertex(const void *a, const void *b)
{
    return PAL_COMPARE(((const pal_stencil_entry *)a)->vertex, ((const pal_stencil_entry *)b)->vertex);
}

PAL_SORT(sort_entries, pal_stencil_entry, by_vertex)

/* merges entries of the same vertex and drops those that have cancelled; returns how many are left */
static int merge(entries *to)
{
    int n = 0;
    sort_entries(to->item, (size_t)to->n);
    for (int k = 0; k < to->n; n++) {
        pal_stencil_entry sum = {to->item[k].vertex, 0};
        for (; k < to->n && to->item[k].vertex == sum.vertex; k++) sum.weight += to->item[k].weight;
        to->item[n] = sum;
        if (fabs(sum.weight) < 1e-15) n--;
    }
    return n;
}

int pal_butterfly_stencil(const pal_winged_mesh *wings, int32_t e, pal_stencil_entry *entry)
{
    const pal_winged_edge *at = &wings->edge[e];
    entries to = {0, entry};
    int32_t a = at->vertex[0], b = at->vertex[1];
    if (at->face[1] < 0)
        boundary_rule(wings, e, &to);
    else if (is_corner(wings, a) || is_corner(wings, b)) {
        add(&to, a, 0.5);
        add(&to, b, 0.5);
    } else {
        fan left = fan_of(wings, e, a), right = fan_of(wings, e, b);
        bool odd_a = !is_regular(&left), odd_b = !is_regular(&right);
        if (!odd_a && !odd_b) regular_rule(wings, e, &to);
        if (odd_a) end_rule(wings, e, a, odd_b ? 0.5 : 1, &to);
        if (odd_b) end_rule(wings, e, b, odd_a ? 0.5 : 1, &to);
    }
    return merge(&to);
}
