/* Coarse-to-fine vertex order and predictor table of a surface, built once per topology.
 *
 * The wire index of a vertex is its place in this order. Each vertex is predicted from up to four vertices of coarser
 * levels, all of smaller wire index, with weights that reproduce affine displacement fields of the rest pose as far as
 * the neighbours allow. Works for any triangle soup: several components, loose vertices, non-manifold edges.
 * Thread: any; the result is constant. */
#ifndef PAL_PROTOCOL_FRAME_ORDER_H
#define PAL_PROTOCOL_FRAME_ORDER_H
#include "protocol/refusal.h"

#include <stdint.h>

#define PAL_ORDER_VERTEX_MAX   (1u << 22)
#define PAL_ORDER_TRIANGLE_MAX (1u << 24)
#define PAL_ORDER_ONE          4096 /* weights are Q12; a vertex with a prediction has weights that sum exactly to this */
#define PAL_ORDER_ABS_MAX      8191 /* largest allowed sum of |weight|: keeps the prediction inside int32               */

typedef struct pal_frame_order {
    uint32_t n_vertex;
    uint32_t n_level;
    uint32_t *level_begin; /* first wire index of each level, coarse first   [n_level + 1]  */
    uint32_t *vertex_of;   /* vertex of each wire index, a permutation       [n_vertex]     */
    uint32_t *neighbour;   /* wire indices, each < own; 0 where the weight is 0  [n_vertex][4]  */
    int16_t *weight;       /* Q12: sum 4096, or all 0: predicted as rest     [n_vertex][4]  */
} pal_frame_order;

/* [load] rest_m [n_vertex][3] finite, triangle [n_triangle][3] with indices < n_vertex, both borrowed for the call.
 * O(n log n), about 0.03 s for 30,000 vertices. The caller frees *out with pal_frame_order_destroy. */
int pal_frame_order_create(const float *rest_m, uint32_t n_vertex, const uint32_t *triangle, uint32_t n_triangle,
                           pal_frame_order **out);
/* [load] Order of a surface made by halving edges: vertices below n_coarse are those of the coarsest level, with its
 * triangles; vertex i >= n_coarse is the midpoint of the smaller vertices parent[2 (i - n_coarse)], parent[.. + 1].
 * The coarse ones come first, in the order of pal_frame_order_create, then the midpoints in vertex order, predicted as
 * the mean of their parents: exact for any motion that is linear on coarse triangles, and what is right for vertices
 * that are not in use. All borrowed. COUNT: n_coarse is 0 or above n_vertex; RANGE: a parent that is not smaller; as
 * pal_frame_order_create */
int pal_frame_order_hierarchy(const float *rest_m, uint32_t n_vertex, uint32_t n_coarse, const uint32_t *parent,
                              const uint32_t *coarse_triangle, uint32_t n_coarse_triangle, pal_frame_order **out);
/* [load] an order of so many vertices and levels to be filled, all predicted as rest; NULL: no memory */
pal_frame_order *pal_frame_order_allocate(uint32_t n_vertex, uint32_t n_level);
void pal_frame_order_destroy(pal_frame_order *order); /* NULL allowed */

/* Checks all that a frame decoder trusts: vertex_of is a permutation, every neighbour is smaller than its own index,
 * weights sum to 4096 or are all zero, sum |w| <= PAL_ORDER_ABS_MAX. */
int pal_frame_order_check(const pal_frame_order *order);
#endif
