/* Modified butterfly subdivision (paper C eq. 3 to 5): the stencil of an edge's midpoint on a triangle surface.
 *
 * Surfaces have winged edges (paper C, implementation). An edge runs from vertex[0] to vertex[1]; side 0 is the face on
 * its left, walked along the edge, side 1 the face on its right, walked against it; prev and next are the edges before
 * and after it on that walk. A hole counts as a face with number -1 whose walk follows the boundary, so that prev and
 * next exist everywhere and are inverse to each other. A boundary edge has its hole on side 1. Every vertex has one fan
 * of faces. Thread: [any], no state. */
#ifndef PAL_MESH_GEOMETRY_BUTTERFLY_H
#define PAL_MESH_GEOMETRY_BUTTERFLY_H
#include <stdint.h>

typedef struct pal_winged_edge {
    int32_t vertex[2]; /* start, end                                  */
    int32_t face[2];   /* left, right; right is -1 at the boundary     */
    int32_t prev[2];   /* edge before on the walk around face[side]    */
    int32_t next[2];   /* edge after on the walk around face[side]     */
} pal_winged_edge;

/* side on which the edge leaves v (v is one of its ends) */
static inline int pal_wing_side(const pal_winged_edge *edge, int32_t e, int32_t v)
{
    return edge[e].vertex[0] == v ? 0 : 1;
}
/* the other end */
static inline int32_t pal_wing_other_end(const pal_winged_edge *edge, int32_t e, int32_t v)
{
    return edge[e].vertex[edge[e].vertex[0] == v];
}
/* the next edge around v, counter-clockwise seen from outside; the whole fan is a cycle, holes included */
static inline int32_t pal_wing_next_around(const pal_winged_edge *edge, int32_t e, int32_t v)
{
    return edge[e].prev[pal_wing_side(edge, e, v)];
}
/* the face between e and the next edge around v; -1: a hole */
static inline int32_t pal_wing_face(const pal_winged_edge *edge, int32_t e, int32_t v)
{
    return edge[e].face[pal_wing_side(edge, e, v)];
}

/* one level of a surface; arrays are borrowed */
typedef struct pal_winged_mesh {
    const pal_winged_edge *edge;
    const uint8_t *corner; /* 1: the boundary has a corner here, [n_corner]; later vertices have none */
    int32_t n_corner;
} pal_winged_mesh;

/* Weights of the ring of an inner vertex of K faces, entry i of 0..K-1 counter-clockwise from the split edge; K >= 3.
 * They sum to 1/4; the vertex itself has 3/4 (the printed eq. 4 leaves it out). */
double pal_butterfly_ring(int K, int i);
/* Weights of a boundary vertex of k faces for its edge i of 0..k, counter-clockwise from the boundary edge, 0 < i < k,
 * on ring vertex j of 0..k; j = -1: on the vertex itself. */
double pal_butterfly_boundary(int k, int i, int j);

typedef struct pal_stencil_entry {
    int32_t vertex;
    double weight;
} pal_stencil_entry;
/* The stencil of the midpoint of edge e, vertices ascending and each once; returns the number of entries. Weights sum
 * to 1. entry has room for 16 and for K + 1 more of each end of K edges that is irregular. */
int pal_butterfly_stencil(const pal_winged_mesh *wings, int32_t e, pal_stencil_entry *entry);
#endif
