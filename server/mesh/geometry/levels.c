/* Detail levels: checks, edges of the coarse surface, then split by split (paper C, pre-processing phase). Departure:
 * the corners of the boundary, which the four-point rule would round off, are found by their angle at rest. */
#include "server/mesh/geometry/levels.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

#define OFFER "prepare it as voxels: palpate prepare"

void pal_levels_free(pal_levels *l)
{
    PAL_FREE(l->x, l->edge, l->face, l->face_edge, l->vertex_level, l->edge_level, l->face_level, l->spoke, l->corner,
             l->stencil_start, l->stencil_vertex, l->stencil_weight);
    memset(l, 0, sizeof *l);
}

static pal_err check_face(const pal_surface *s, int t, pal_diagnostic *diag)
{
    const int32_t *c = s->tri + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
        if (c[k] < 0 || c[k] >= s->n_vertex)
            return PAL_REFUSE(diag, "levels: triangle %d has vertex %d, there are %d", t, c[k], s->n_vertex);
        if (c[k] == c[(k + 1) % 3]) return PAL_REFUSE(diag, "levels: triangle %d has vertex %d twice", t, c[k]);
    }
    double longest = 0, n[3];
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, pal_dist3(s->x + 3 * (size_t)c[k], s->x + 3 * (size_t)c[(k + 1) % 3]));
    pal_normal3(n, s->x + 3 * (size_t)c[0], s->x + 3 * (size_t)c[1], s->x + 3 * (size_t)c[2]);
    if (pal_norm3(n) > LEVEL_FLAT * longest * longest) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "levels: triangle %d (vertices %d, %d, %d) has no area: clean the surface", t, c[0], c[1],
                      c[2]);
}

static pal_err check_input(const pal_surface *s, const pal_levels_options *o, pal_diagnostic *diag)
{
    if (o->n_level < 1 || o->n_level > PAL_LEVELS_MAX)
        return PAL_REFUSE(diag, "levels: %d levels asked for, 1 to %d are made", o->n_level, PAL_LEVELS_MAX);
    if (s->n_tri < 1 || s->n_vertex < 3)
        return PAL_REFUSE(diag, "levels: a surface of %d vertices and %d triangles", s->n_vertex, s->n_tri);
    if (s->n_tri > INT32_MAX / 8 || s->n_vertex > INT32_MAX / 8)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "levels: %d vertices and %d triangles, at most %d are taken",
                                  s->n_vertex, s->n_tri, INT32_MAX / 8);
    for (int v = 0; v < s->n_vertex; v++) {
        const double *x = s->x + 3 * (size_t)v;
        for (int a = 0; a < 3; a++)
            if (!(fabs(x[a]) <= MAX_COORDINATE_M))
                return PAL_REFUSE(diag, "levels: vertex %d stands at (%g, %g, %g) m", v, x[0], x[1], x[2]);
    }
    for (int t = 0; t < s->n_tri; t++) PAL_TRY(check_face(s, t, diag));
    return PAL_ERR_OK;
}

/* what the coarse surface gives: its edges with their ends and faces, the edges of its faces, room for the largest
 * stencil (no vertex has more edges than 3 n_tri) */
typedef struct coarse {
    const pal_surface *s;
    pal_winged_edge *edge;    /* [3 n_tri]      */
    int32_t *face_edge;       /* [3 n_tri]      */
    pal_stencil_entry *entry; /* [6 n_tri + 16] */
    int32_t n_edge;
    int64_t irregular; /* K (K + 1), summed over irregular vertices of K edges */
    pal_diagnostic *diag;
} coarse;

/* one edge of a vertex from its n sides; the first gives its direction */
static pal_err make_edge(coarse *c, int32_t low, const pal_surface_side *side, int n)
{
    int32_t high = side->high, a = c->s->tri[side->corner];
    if (n > 2)
        return PAL_REFUSE(c->diag,
                          "levels: %d triangles (%d, %d, %d%s) share the edge of vertices %d and %d, a surface has two "
                          "at most; " OFFER,
                          n, side[0].corner / 3, side[1].corner / 3, side[2].corner / 3, n > 3 ? ", ..." : "", low,
                          high);
    if (n == 2 && c->s->tri[side[1].corner] == a)
        return PAL_REFUSE(c->diag,
                          "levels: triangles %d and %d run the same way through the edge of vertices %d and %d: turn "
                          "one over, or " OFFER,
                          side[0].corner / 3, side[1].corner / 3, low, high);
    c->edge[c->n_edge] = (pal_winged_edge){.vertex = {a, a == low ? high : low},
                                           .face = {side[0].corner / 3, n == 2 ? side[1].corner / 3 : -1}};
    for (int k = 0; k < n; k++) c->face_edge[side[k].corner] = c->n_edge;
    c->n_edge++;
    return PAL_ERR_OK;
}

static pal_err find_edges(coarse *c)
{
    int32_t *start;
    pal_surface_side *side;
    pal_err err = pal_surface_sides(c->s, &start, &side);
    if (err) return err;
    for (int32_t v = 0; v < c->s->n_vertex; v++)
        for (int32_t i = start[v], end = i; !err && i < start[v + 1]; i = end) {
            while (end < start[v + 1] && side[end].high == side[i].high) end++;
            err = make_edge(c, v, side + i, end - i);
        }
    return PAL_FREED(err, start, side);
}

/* faces, walks and spokes of a level from its faces' edges and its edges' ends; edge e of the level has face[1] = -1
 * when it is a boundary edge. False when two boundary edges start at one vertex, *bad. */
static bool link_level(pal_levels *l, int level, int32_t *bad)
{
    pal_winged_edge *edge = l->edge;
    int32_t *spoke = l->spoke + l->first_spoke[level];
    for (int32_t v = 0; v < l->n_vertex[level]; v++) spoke[v] = -1;
    for (int32_t f = l->first_face[level]; f < l->first_face[level + 1]; f++)
        for (int k = 0; k < 3; k++) {
            const int32_t *side = l->face_edge + 3 * (size_t)f;
            int32_t v = l->face[3 * (size_t)f + (size_t)k];
            pal_winged_edge *e = &edge[side[k]];
            int s = e->vertex[0] == v ? 0 : 1;
            e->face[s] = f, e->prev[s] = side[(k + 2) % 3], e->next[s] = side[(k + 1) % 3];
            if (spoke[v] < 0 || e->face[1] < 0) spoke[v] = side[k];
        }
    for (int32_t e = l->first_edge[level]; e < l->first_edge[level + 1]; e++) {
        if (edge[e].face[1] >= 0) continue;
        if (spoke[edge[e].vertex[0]] != e) {
            *bad = edge[e].vertex[0];
            return false;
        }
        /* walked against their direction, hole on the left, the next after an edge starts where this one ends */
        int32_t before = spoke[edge[e].vertex[1]];
        edge[e].prev[1] = before;
        edge[before].next[1] = e;
    }
    return true;
}

static pal_err refuse_fans(int32_t v, pal_diagnostic *diag)
{
    return PAL_REFUSE(diag, "levels: parts of the surface touch in vertex %d only: split that vertex, or " OFFER, v);
}

/* every vertex has one fan of at least three faces, or one or more at the boundary */
static pal_err check_fans(const pal_levels *l, coarse *from)
{
    pal_err err = PAL_ERR_OK;
    int32_t *count;
    PAL_ZEROED(&err, count, l->n_vertex[0]);
    for (int32_t c = 0; c < 3 * l->first_face[1] && !err; c++) count[l->face[c]]++;
    for (int32_t v = 0; v < l->n_vertex[0] && !err; v++) {
        if (count[v] == 0)
            return PAL_FREED(PAL_REFUSE(from->diag, "levels: vertex %d belongs to no triangle: clean the surface", v),
                             count);
        int32_t e = l->spoke[v], n_face = 0, n_edge = 0;
        do {
            n_face += pal_wing_face(l->edge, e, v) >= 0, n_edge++;
            e = pal_wing_next_around(l->edge, e, v);
        } while (e != l->spoke[v] && n_edge <= count[v] + 1);
        if (n_face != count[v])
            err = refuse_fans(v, from->diag);
        else if (n_edge < 3 && n_face == n_edge)
            err = PAL_REFUSE(from->diag, "levels: triangles %d and %d have the same corners",
                             l->edge[l->spoke[v]].face[0], l->edge[l->spoke[v]].face[1]);
        else if (n_edge != (n_face == n_edge ? 6 : 4))
            from->irregular += (int64_t)n_edge * (n_edge + 1);
    }
    return PAL_FREED(err, count);
}

static void find_corners(pal_levels *l)
{
    for (int32_t v = 0; v < l->n_vertex[0]; v++) {
        if (!pal_levels_on_boundary(l, v)) continue;
        const pal_winged_edge *out = &l->edge[l->spoke[v]], *in = &l->edge[out->next[1]];
        double a[3], b[3];
        pal_sub3(a, l->x + 3 * (size_t)v, l->x + 3 * (size_t)in->vertex[0]);
        pal_sub3(b, l->x + 3 * (size_t)out->vertex[1], l->x + 3 * (size_t)v);
        l->corner[v] = pal_dot3(a, b) < CORNER_COS * pal_norm3(a) * pal_norm3(b);
    }
}

/* counts of all levels; false beyond int32 */
static bool count_levels(pal_levels *l, int32_t n_vertex, int32_t n_edge, int32_t n_face)
{
    int64_t v = n_vertex, e = n_edge, f = n_face, all_v = 0, all_e = 0, all_f = 0;
    for (int k = 0; k < l->n_level; k++) {
        l->n_vertex[k] = (int32_t)v, l->first_spoke[k] = (int32_t)all_v;
        l->first_edge[k] = (int32_t)all_e, l->first_face[k] = (int32_t)all_f;
        all_v += v, all_e += e, all_f += f;
        if (all_v > INT32_MAX || all_e > INT32_MAX / 8 || all_f > INT32_MAX / 4) return false;
        v += e, e = 2 * e + 3 * f, f = 4 * f;
    }
    l->first_spoke[l->n_level] = (int32_t)all_v;
    l->first_edge[l->n_level] = (int32_t)all_e, l->first_face[l->n_level] = (int32_t)all_f;
    return true;
}

/* bytes of all arrays but the entries of stencils */
static size_t plain_bytes(const pal_levels *l)
{
    int last = l->n_level - 1;
    size_t v = (size_t)l->n_vertex[last], e = (size_t)l->first_edge[last + 1], f = (size_t)l->first_face[last + 1];
    size_t rows = v - (size_t)l->n_vertex[0] + 1, spokes = (size_t)l->first_spoke[last + 1];
    return v * (3 * sizeof(double) + 1) + e * (sizeof(pal_winged_edge) + 1) + f * (6 * sizeof(int32_t) + 1) +
           (rows + spokes) * sizeof(int32_t) + (size_t)l->n_vertex[0];
}

#define ENTRY_BYTES (sizeof(int32_t) + sizeof(double))

static pal_err refuse_budget(double byte, size_t budget, const pal_levels *l, pal_diagnostic *diag)
{
    return pal_diagnostic_set(
        diag, PAL_ERR_BUDGET,
        "levels: %d levels need %.4g MiB, the budget is %.4g MiB: ask for fewer levels or a coarser surface",
        l->n_level, byte / 1048576, (double)budget / 1048576);
}

static pal_err get_memory(pal_levels *l)
{
    int last = l->n_level - 1;
    int32_t v = l->n_vertex[last], e = l->first_edge[last + 1];
    size_t f = (size_t)l->first_face[last + 1];
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, l->x, 3 * (size_t)v);
    PAL_ARRAY(&err, l->edge, e);
    PAL_ARRAY(&err, l->face, 3 * f);
    PAL_ARRAY(&err, l->face_edge, 3 * f);
    PAL_ARRAY(&err, l->vertex_level, v);
    PAL_ARRAY(&err, l->edge_level, e);
    PAL_ARRAY(&err, l->face_level, f);
    PAL_ARRAY(&err, l->spoke, l->first_spoke[last + 1]);
    PAL_ZEROED(&err, l->stencil_start, v - l->n_vertex[0] + 1);
    PAL_ZEROED(&err, l->corner, l->n_vertex[0]);
    for (int k = 0; !err && k <= last; k++) {
        int32_t from = k ? l->n_vertex[k - 1] : 0;
        memset(l->vertex_level + from, k, (size_t)(l->n_vertex[k] - from));
        memset(l->edge_level + l->first_edge[k], k, (size_t)pal_levels_n_edge(l, k));
        memset(l->face_level + l->first_face[k], k, (size_t)pal_levels_n_face(l, k));
    }
    return err;
}

/* rows of stencils are written one after another: room for the most there can be, 8 for an edge with regular ends and,
 * on every level, K + 1 more for the K edges of an irregular vertex */
static pal_err get_entries(pal_levels *l, int64_t irregular, size_t budget, pal_diagnostic *diag)
{
    double n = 8.0 * l->first_edge[l->n_level - 1] + (double)(l->n_level - 1) * (double)irregular;
    double byte = (double)plain_bytes(l) + n * (double)ENTRY_BYTES;
    if (byte > (double)budget || n > INT32_MAX) return refuse_budget(byte, budget, l, diag);
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, l->stencil_vertex, n);
    PAL_ARRAY(&err, l->stencil_weight, n);
    return err;
}

/* returns the memory that the stencils did not need */
static void trim_entries(pal_levels *l)
{
    size_t n = (size_t)l->stencil_start[l->n_vertex[l->n_level - 1] - l->n_vertex[0]];
    int32_t *vertex = realloc(l->stencil_vertex, (n + 1) * sizeof *vertex);
    if (vertex) l->stencil_vertex = vertex;
    double *weight = realloc(l->stencil_weight, (n + 1) * sizeof *weight);
    if (weight) l->stencil_weight = weight;
    l->n_byte = plain_bytes(l) + n * ENTRY_BYTES;
}

/* entry: room for the largest stencil */
static void place_midpoints(pal_levels *l, int level, pal_stencil_entry *entry)
{
    pal_winged_mesh wings = {l->edge, l->corner, l->n_vertex[0]};
    int32_t v = l->n_vertex[level];
    for (int32_t e = l->first_edge[level]; e < l->first_edge[level + 1]; e++, v++) {
        int32_t *start = l->stencil_start + (v - l->n_vertex[0]), n = pal_butterfly_stencil(&wings, e, entry);
        for (int32_t k = 0; k < n; k++)
            l->stencil_vertex[start[0] + k] = entry[k].vertex, l->stencil_weight[start[0] + k] = entry[k].weight;
        start[1] = start[0] + n;
        pal_levels_midpoint(l, v, l->x, l->x + 3 * (size_t)v);
    }
}

/* children of one face: three at the corners, one in the middle */
static void split_face(pal_levels *l, int32_t f)
{
    const int32_t *v = l->face + 3 * (size_t)f, *e = l->face_edge + 3 * (size_t)f;
    int32_t mid[3], inner[3], child = pal_levels_face_child(l, f, 0), middle = child + 3;
    for (int k = 0; k < 3; k++)
        mid[k] = pal_levels_edge_midpoint(l, e[k]), inner[k] = pal_levels_face_inner_edge(l, f, k);
    for (int k = 0; k < 3; k++, child++) {
        int before = (k + 2) % 3, after = (k + 1) % 3;
        int32_t *c = l->face + 3 * (size_t)child, *ce = l->face_edge + 3 * (size_t)child;
        /* corner k of the child is the face's; the halves touch it */
        c[k] = v[k], c[after] = mid[k], c[before] = mid[before];
        ce[k] = pal_levels_edge_half(l, e[k], l->edge[e[k]].vertex[0] != v[k]);
        ce[after] = inner[k];
        ce[before] = pal_levels_edge_half(l, e[before], l->edge[e[before]].vertex[0] != v[k]);
        l->face[3 * (size_t)middle + (size_t)k] = mid[k];
        /* the middle face runs from midpoint k - 1 to k along inner edge k */
        l->face_edge[3 * (size_t)middle + (size_t)before] = inner[k];
        l->edge[inner[k]] = (pal_winged_edge){.vertex = {mid[before], mid[k]}};
    }
}

/* faces and edges of the level below */
static void split_level(pal_levels *l, int level)
{
    for (int32_t e = l->first_edge[level]; e < l->first_edge[level + 1]; e++) {
        pal_winged_edge from = l->edge[e], *half = &l->edge[pal_levels_edge_half(l, e, 0)];
        int32_t mid = pal_levels_edge_midpoint(l, e), right = from.face[1] < 0 ? -1 : 0;
        half[0] = (pal_winged_edge){.vertex = {from.vertex[0], mid}, .face = {0, right}};
        half[1] = (pal_winged_edge){.vertex = {mid, from.vertex[1]}, .face = {0, right}};
    }
    for (int32_t f = l->first_face[level]; f < l->first_face[level + 1]; f++) split_face(l, f);
}

/* edges that shrink to nothing have no direction for a spring */
static pal_err check_edges(const pal_levels *l, double diagonal, pal_diagnostic *diag)
{
    for (int32_t e = 0; e < l->first_edge[l->n_level]; e++) {
        const int32_t *end = l->edge[e].vertex;
        double length = pal_dist3(l->x + 3 * (size_t)end[0], l->x + 3 * (size_t)end[1]);
        if (!(length > LEVEL_FLAT * diagonal))
            return PAL_REFUSE(diag,
                              "levels: the edge of vertices %d and %d of level %d is %.3g m long in a surface of %.3g "
                              "m: smooth the surface or ask for fewer levels",
                              end[0], end[1], l->edge_level[e], length, diagonal);
    }
    return PAL_ERR_OK;
}

/* the coarse level in l's arrays, linked and checked */
static pal_err take_coarse(pal_levels *l, coarse *from)
{
    const pal_surface *s = from->s;
    size_t n_corner = 3 * (size_t)s->n_tri;
    int32_t bad, *label;
    memcpy(l->x, s->x, 3 * (size_t)s->n_vertex * sizeof *l->x);
    memcpy(l->face, s->tri, n_corner * sizeof *l->face);
    memcpy(l->face_edge, from->face_edge, n_corner * sizeof *l->face_edge);
    memcpy(l->edge, from->edge, (size_t)from->n_edge * sizeof *l->edge);
    memcpy(l->origin_m, s->origin_m, sizeof l->origin_m);
    if (!link_level(l, 0, &bad)) return refuse_fans(bad, from->diag);
    PAL_TRY(check_fans(l, from));
    find_corners(l);
    l->closed = true;
    for (int32_t e = 0; e < from->n_edge; e++) l->closed = l->closed && l->edge[e].face[1] >= 0;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, label, s->n_tri);
    if (!err) err = pal_surface_components(s, label, &l->n_component);
    return PAL_FREED(err, label);
}

static pal_err make_levels(const pal_levels_options *o, pal_levels *l, coarse *from)
{
    const pal_surface *s = from->s;
    size_t budget = o->budget_byte ? o->budget_byte : HIERARCHY_BUDGET_BYTE;
    double low[3], high[3];
    PAL_TRY(find_edges(from));
    if (!count_levels(l, s->n_vertex, from->n_edge, s->n_tri))
        return pal_diagnostic_set(from->diag, PAL_ERR_BUDGET,
                                  "levels: %d levels of %d triangles make more than %d edges", l->n_level, s->n_tri,
                                  INT32_MAX / 8);
    if (plain_bytes(l) > budget) return refuse_budget((double)plain_bytes(l), budget, l, from->diag);
    PAL_TRY(get_memory(l));
    PAL_TRY(take_coarse(l, from));
    PAL_TRY(get_entries(l, from->irregular, budget, from->diag));
    for (int k = 0; k + 1 < l->n_level; k++) {
        int32_t none;
        place_midpoints(l, k, from->entry);
        split_level(l, k);
        if (!link_level(l, k + 1, &none)) return PAL_ERR_INTERNAL;
    }
    trim_entries(l);
    pal_surface_box(s, low, high);
    return check_edges(l, pal_dist3(low, high), from->diag);
}

pal_err pal_levels_make(const pal_surface *surface, const pal_levels_options *options, pal_levels *out,
                        pal_diagnostic *diag)
{
    PAL_TRY(check_input(surface, options, diag));
    pal_levels l = {.n_level = options->n_level};
    coarse from = {.s = surface, .diag = diag};
    size_t n_corner = 3 * (size_t)surface->n_tri;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, from.edge, n_corner);
    PAL_ARRAY(&err, from.face_edge, n_corner);
    PAL_ARRAY(&err, from.entry, 2 * n_corner + 16);
    if (!err) err = make_levels(options, &l, &from);
    PAL_FREE(from.edge, from.face_edge, from.entry);
    if (err)
        pal_levels_free(&l);
    else
        *out = l;
    return err;
}

pal_err pal_levels_surface(const pal_levels *levels, int level, pal_surface *out)
{
    pal_surface view = {.n_vertex = levels->n_vertex[level], .n_tri = pal_levels_n_face(levels, level), .x = levels->x};
    view.tri = levels->face + 3 * (size_t)levels->first_face[level];
    memcpy(view.origin_m, levels->origin_m, sizeof view.origin_m);
    return pal_surface_copy(&view, out);
}
