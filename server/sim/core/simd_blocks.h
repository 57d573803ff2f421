/* Elements in blocks of 8 whose corners are side by side in memory, so that a kernel loads, computes and adds whole
 * vectors instead of gathering and scattering node by node.
 *
 * Each node of a voxel mesh has a slot: rows along the longest axis, the even nodes of a row before the odd ones,
 * because the five-tetrahedra split repeats every second voxel. Elements of one shape (equal slot differences between
 * their corners) at successive slots form a strip. The others, and meshes that are no lattice, go into loose blocks of
 * 8 elements with nodes of their own. Lanes without an element have zero constants. Memory from the arena. Thread:
 * [load] to build, then [sim]. */
#ifndef PAL_SIM_CORE_SIMD_BLOCKS_H
#define PAL_SIM_CORE_SIMD_BLOCKS_H
#include "server/base/arena.h"
#include "server/base/team.h"
#include "server/mesh/geometry/tets.h"

#define PAL_INLINE static inline __attribute__((always_inline))

enum { PAL_LANES = 8, PAL_CORNERS = 4, PAL_SIMD_CORNERS_MAX = 8 };

/* slots of a body's nodes, and working arrays that its components use in turn */
typedef struct pal_node_order {
    int n_node, n_slot;
    int32_t *slot;               /* of each node                                        [n_node]    */
    double *x;                   /* positions by slot, 0 in empty ones; x, y, z          [3][n_slot] */
    double *f;                   /* forces by slot, zero between runs                    [3][n_slot] */
    pal_team *team;              /* threads that share passes over nodes and blocks; NULL: the caller's alone */
    int n_part;                  /* of an order that is divided between threads (pal_node_order_divide), else 0 */
    struct pal_node_order *part; /* the same slots with x and f of their own                        [n_part] */
    /* Positions and forces as x and f in single precision, NULL: not made. Positions are relative to a node in the
     * middle of the list, in units of unit_m; forces in units of unit_N, the largest of the body's springs (0: none
     * has stiffness) */
    float *single_x, *single_f;
    double unit_m, unit_N, origin_m[3];
    bool single; /* these are in use, and not x and f; between begin and end */
    /* between pal_node_order_begin and _end; x, or the x of all parts, is loaded; a component of the body is not
     * divided */
    bool shares, loaded, undivided;
} pal_node_order;

/* the blocks of one component */
typedef struct pal_simd_blocks {
    int n_corner;
    int n_strip, n_loose;
    int32_t *base;  /* first slot of each corner of a strip                 [n_strip][n_corner]        */
    int32_t *node;  /* slots of a loose block, lane by lane                 [n_loose][n_corner][8]     */
    int32_t *place; /* lane (8 * block + lane, strips first) of each constraint [n_item]               */
    int n_lane;     /* 8 * (n_strip + n_loose)                                                         */
} pal_simd_blocks;

/* Blocks in parts for several threads. Blocks of different parts of a round share no node, so that the parts of a round
 * run side by side, and rounds one after the other: sums at nodes are in one order whatever the number of threads. On a
 * lattice a part is a layer of cells across its shortest axis, and a round every second layer; blocks that
 * reach several layers, also with lanes without an element, are a round of their own, as is everything on a mesh that
 * is no lattice. */
typedef struct pal_block_rounds {
    int n_round;
    int32_t *part;  /* first part of each round        [n_round + 1]     */
    int32_t *first; /* first block in `order` of each part [n_part + 1]  */
    int32_t *order; /* blocks                          [n_block]         */
} pal_block_rounds;

/* The blocks of each part of a divided order, for several threads: the owner of a node computes. A part evaluates every
 * block that touches one of its nodes, in arrays of its own, and takes the sums at its own nodes; blocks at a border
 * are evaluated by each part that they touch. Parts run side by side, and a node receives the same terms in the same
 * order as by one thread that runs through all blocks, so that the bits are the same for any number of parts. For
 * kernels that are cheap beside what a round of pal_block_rounds costs, and change nothing but forces. */
typedef struct pal_part_blocks {
    int32_t *first;       /* first block of each part; NULL: not made                  [n_part + 1]           */
    int32_t *block;       /* ascending in a part                                       [first[n_part]]        */
    int32_t *other_first; /* first of `other` of each part                             [n_part + 1]           */
    int32_t *other;       /* nodes of other parts that the part's blocks touch         [other_first[n_part]]  */
} pal_part_blocks;

pal_err pal_node_order_make(const double *x_rest, int n_node, double edge_m, pal_arena *arena, pal_node_order **out);
/* item [n_item][n_corner] nodes, sorts the corners of each item by their slots; MEMORY */
pal_err pal_simd_blocks_make(const pal_node_order *node_order, int32_t *item, int n_item, int n_corner,
                             pal_arena *arena, pal_simd_blocks *out);
/* the same for up to PAL_SIMD_CORNERS_MAX corners, which keep their order */
pal_err pal_simd_blocks_make_ordered(const pal_node_order *node_order, const int32_t *item, int n_item, int n_corner,
                                     pal_arena *arena, pal_simd_blocks *out);
/* item [n_item][n_corner] as in pal_simd_blocks_make_ordered, x_rest [n_node][3]; MEMORY */
pal_err pal_block_rounds_make(const pal_simd_blocks *blocks, const pal_node_order *order, const double *x_rest,
                              double edge_m, const int32_t *item, int n_item, pal_arena *arena, pal_block_rounds *out);
/* calls piece(user, part) for every part, round by round; team may be NULL */
void pal_block_rounds_run(const pal_block_rounds *rounds, pal_team *team, void (*piece)(void *user, int part),
                          void *user);
/* makes single_x and single_f of an order that is not yet divided; unit_N is the caller's. MEMORY */
pal_err pal_node_order_make_single(pal_node_order *node_order, double unit_m, pal_arena *arena);
/* Divides the nodes into at most n_part parts of successive ones, about as many in each; passes over nodes then have as
 * many pieces, so that the memory of a node stays with one thread. MEMORY */
pal_err pal_node_order_divide(pal_node_order *node_order, int n_part, pal_arena *arena);
/* parts of an order: 1 where it is not divided or NULL; first node of a part, for part n_part the number of nodes */
static inline int pal_node_order_parts(const pal_node_order *node_order)
{
    return node_order && node_order->n_part > 0 ? node_order->n_part : 1;
}
static inline int pal_part_first(int n_node, int n_part, int part)
{
    return (int)((int64_t)n_node * part / n_part);
}
/* Makes nothing where the order is not divided, or where the largest part would have so many of the blocks that threads
 * would repeat each other's work (PAL_PART_MAX); MEMORY */
pal_err pal_part_blocks_make(const pal_simd_blocks *blocks, pal_node_order *node_order, pal_arena *arena,
                             pal_part_blocks *out);
/* positions x [n_node][3] to the arrays of a part, as far as its blocks read them; force [n_node][3] += the forces at
 * the part's own nodes, and the arrays are zero afterwards. Of components that share an order (begin to end below) the
 * first loads the part's own nodes, and their forces stay for the end */
void pal_part_load(const pal_part_blocks *blocks, const pal_node_order *node_order, int part, const double *x);
void pal_part_add(const pal_part_blocks *blocks, const pal_node_order *node_order, int part, double *force);
/* the node that positions in single precision are relative to */
static inline int pal_node_order_origin(const pal_node_order *node_order)
{
    return node_order->n_node / 2;
}
/* Components of one evaluation of forces share an order: positions are loaded once, and the sums of all are added once,
 * to force [n_node][3]. All of a body run in parts, or none. Elsewhere each loads and adds */
/* single: in single precision, where the order has that; x [n_node][3]: the positions that will be loaded */
void pal_node_order_begin(pal_node_order *node_order, bool single, const double *x);
void pal_node_order_end(pal_node_order *node_order, double *force);
/* node_order->x = positions x [n_node][3] */
void pal_node_order_load(pal_node_order *node_order, const double *x);
/* force [n_node][3] += node_order->f, which is zero afterwards */
void pal_node_order_add(pal_node_order *node_order, double *force);
#endif
