/* All detail levels of a triangle surface (paper C; server/mesh/README.md, levels of a surface). Level l's vertices are
 * the first n_vertex[l] of one array; edges and faces stand level after level in one array each. All numbers are
 * global, and the family tree follows from them:
 *
 *   midpoint of edge e of level l   n_vertex[l] + i                      with i = e - first_edge[l]
 *   its halves                      first_edge[l+1] + 2 i + {0, 1}       start to midpoint, midpoint to end
 *   inner edges of face f           first_edge[l+1] + 2 E_l + 3 j + k    with j = f - first_face[l], E_l edges of level
 * l children of face f              first_face[l+1] + 4 j + {0, 1, 2, 3}
 *
 * Child k < 3 keeps corner k and has it as corner k; child 3 is the middle one, its corner k being the midpoint of the
 * face's edge k (from corner k to k + 1). Inner edge k cuts off corner k; child 3 lies on its left, child k on its
 * right.
 *
 * The edges' adjacency is winged (butterfly.h) within each level; pal_levels_spoke and pal_wing_next_around walk the
 * edges and faces of any level around a vertex. A pal_levels owns its arrays (heap); it is constant once made and may
 * be shared. Memory: about 330 bytes per finest vertex. Thread: [load] to make, [any] to read. */
#ifndef PAL_MESH_GEOMETRY_LEVELS_H
#define PAL_MESH_GEOMETRY_LEVELS_H
#include "server/mesh/geometry/butterfly.h"
#include "server/mesh/geometry/surface.h"

#define PAL_LEVELS_MAX 10

typedef struct pal_levels_options {
    int n_level;        /* 1..PAL_LEVELS_MAX, the coarse surface counts as one              */
    size_t budget_byte; /* most memory the levels may take; 0: 512 MiB                       */
} pal_levels_options;

typedef struct pal_levels {
    int n_level;
    int32_t n_vertex[PAL_LEVELS_MAX];       /* vertices of level l and all coarser ones              */
    int32_t first_edge[PAL_LEVELS_MAX + 1]; /* entry n_level: edges of all levels together           */
    int32_t first_face[PAL_LEVELS_MAX + 1]; /* entry n_level: faces of all levels together           */
    bool closed;
    int32_t n_component;   /* pieces without a common edge                                              */
    double *x;             /* rest position relative to origin_m, m          [n_vertex[n_level-1]][3]    */
    double origin_m[3];    /* position in the file's frame = x + origin_m                               */
    pal_winged_edge *edge; /* neighbours are edges and faces of the same level                [n]    */
    int32_t *face;         /* corners, counter-clockwise seen from outside                    [n][3] */
    int32_t *face_edge;    /* edge k runs from corner k to k + 1                              [n][3] */
    uint8_t *vertex_level; /* coarsest level that has it                          [n_vertex]         */
    uint8_t *edge_level;   /* [n edges]                                                              */
    uint8_t *face_level;   /* [n faces]                                                              */
    int32_t *spoke;        /* an edge of each vertex and level; at the boundary the one that starts there with the
                            * hole on its right. Level l from first_spoke[l]                         */
    int32_t first_spoke[PAL_LEVELS_MAX + 1];
    int32_t *stencil_start;  /* rows of the vertices from n_vertex[0] on          [n_vertex - n_vertex[0] + 1]  */
    int32_t *stencil_vertex; /* of a coarser level than the row's vertex, ascending                    */
    double *stencil_weight;  /* sum 1 in each row                                                      */
    uint8_t *corner;         /* 1: the boundary turns by more than 75 degrees at rest       [n_vertex[0]]       */
    size_t n_byte;           /* memory of all arrays                                                   */
} pal_levels;

/* Makes the levels of a surface; its arrays are copied. REFUSED, with the first fault: no triangle, n_level out of
 * range, a corner out of range or repeated, a position that is NaN or beyond 1e9 m, a face without area, a vertex of no
 * face, an edge with more than two faces or two faces in the same direction, a vertex with more than one fan, two faces
 * with the same corners, a level whose edges shrink to nothing. BUDGET, with both numbers; MEMORY. */
pal_err pal_levels_make(const pal_surface *surface, const pal_levels_options *options, pal_levels *out,
                        pal_diagnostic *diag);
/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_levels_free(pal_levels *levels);
/* one level as a surface of its own, vertices numbered alike; MEMORY */
pal_err pal_levels_surface(const pal_levels *levels, int level, pal_surface *out);

static inline int32_t pal_levels_n_edge(const pal_levels *l, int level)
{
    return l->first_edge[level + 1] - l->first_edge[level];
}
static inline int32_t pal_levels_n_face(const pal_levels *l, int level)
{
    return l->first_face[level + 1] - l->first_face[level];
}

/* parents and children of an edge; -1: none */
static inline int32_t pal_levels_edge_midpoint(const pal_levels *l, int32_t e)
{
    int level = l->edge_level[e];
    return level + 1 < l->n_level ? l->n_vertex[level] + (e - l->first_edge[level]) : -1;
}
static inline int32_t pal_levels_edge_half(const pal_levels *l, int32_t e, int half)
{
    int level = l->edge_level[e];
    return level + 1 < l->n_level ? l->first_edge[level + 1] + 2 * (e - l->first_edge[level]) + half : -1;
}
/* the edge that e is a half of; -1: of level 0, or an inner edge of a face */
static inline int32_t pal_levels_edge_parent(const pal_levels *l, int32_t e)
{
    int level = l->edge_level[e];
    if (level == 0) return -1;
    int32_t i = e - l->first_edge[level];
    return i < 2 * pal_levels_n_edge(l, level - 1) ? l->first_edge[level - 1] + i / 2 : -1;
}

/* parents and children of a face */
static inline int32_t pal_levels_face_child(const pal_levels *l, int32_t f, int k)
{
    int level = l->face_level[f];
    return level + 1 < l->n_level ? l->first_face[level + 1] + 4 * (f - l->first_face[level]) + k : -1;
}
static inline int32_t pal_levels_face_inner_edge(const pal_levels *l, int32_t f, int k)
{
    int level = l->face_level[f];
    if (level + 1 >= l->n_level) return -1;
    return l->first_edge[level + 1] + 2 * pal_levels_n_edge(l, level) + 3 * (f - l->first_face[level]) + k;
}
static inline int32_t pal_levels_face_parent(const pal_levels *l, int32_t f)
{
    int level = l->face_level[f];
    return level > 0 ? l->first_face[level - 1] + (f - l->first_face[level]) / 4 : -1;
}

/* the edge that the vertex is the midpoint of; -1: a vertex of level 0 */
static inline int32_t pal_levels_vertex_parent(const pal_levels *l, int32_t v)
{
    int level = l->vertex_level[v];
    return level > 0 ? l->first_edge[level - 1] + (v - l->n_vertex[level - 1]) : -1;
}
/* an edge of the level at v, v < n_vertex[level]: the start of a walk around it, all its faces before the hole */
static inline int32_t pal_levels_spoke(const pal_levels *l, int level, int32_t v)
{
    return l->spoke[l->first_spoke[level] + v];
}
/* on the boundary of the surface? The same on every level that has v */
static inline bool pal_levels_on_boundary(const pal_levels *l, int32_t v)
{
    const pal_winged_edge *e = &l->edge[pal_levels_spoke(l, l->vertex_level[v], v)];
    return e->face[1] < 0;
}

/* Applies the stencil of vertex v >= n_vertex[0] to positions or any other triple per vertex x [][3]. The vertices of a
 * stencil are of coarser levels, so midpoints can be computed in ascending order. out may be the row of v in x, because
 * no stencil contains its own vertex. */
static inline void pal_levels_midpoint(const pal_levels *l, int32_t v, const double *x, double out[3])
{
    const int32_t row = v - l->n_vertex[0];
    double a = 0, b = 0, c = 0;
    for (int32_t k = l->stencil_start[row]; k < l->stencil_start[row + 1]; k++) {
        const double *p = x + 3 * (size_t)l->stencil_vertex[k], w = l->stencil_weight[k];
        a += w * p[0], b += w * p[1], c += w * p[2];
    }
    out[0] = a, out[1] = b, out[2] = c;
}
#endif
