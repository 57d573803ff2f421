/* Geometric multigrid on levels of cells, as a preconditioner in single precision: Galerkin matrices of 3x3 blocks on
 * every level, Chebyshev smoothing, one cycle, and a Cholesky factor of the coarsest level.
 *
 * A coarse cell is a connected group of the cells in a block of 2 x 2 x 2 (composite elements: Dick, Georgii,
 * Westermann 2011), so that parts that a cut separates stay apart on every level. The finest level, on which the caller
 * smooths without a matrix, is not kept here; its interpolation from the first level is level[0].start and from. The
 * smoother is the optimised Chebyshev iteration of the fourth kind on D^-1 A (Lottes 2022; Phillips and Fischer 2022),
 * D a third of the trace of each diagonal block. Memory: heap, freed by destroy; no heap call in a cycle. Thread:
 * [load] to make, then one thread at a time. */
#ifndef PAL_NUM_MULTIGRID_H
#define PAL_NUM_MULTIGRID_H
#include "server/base/team.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What a cycle does on each level besides the coarser ones' correction. V: the smoother of degree 3 before and after
 * it; symmetric. SAWTOOTH (Wesseling 1992): the smoother of degree 5 after it alone. That is a product with A fewer,
 * and takes more of the error in the first iterations of conjugate gradients. As it is not symmetric, many of them may
 * stagnate */
typedef enum pal_cycle { PAL_CYCLE_V, PAL_CYCLE_SAWTOOTH } pal_cycle;

/* Chebyshev iteration: weights of the directions (Phillips and Fischer 2022) */
typedef struct pal_chebyshev {
    int degree;
    float weight[5]; /* [degree] */
} pal_chebyshev;
const pal_chebyshev *pal_cycle_smoother(pal_cycle cycle); /* [any] */
/* the factor that keeps an estimated largest eigenvalue on the safe side */
#define PAL_CHEBYSHEV_SAFE 1.1
/* products of the power iteration that estimates it to a few per cent (tests/sim/implicit/test_preconditioner.c) */
enum { PAL_POWER_ITERATIONS = 15 };
/* d = keep d + take D^-1 r / lambda in step i of the iteration */
static inline float pal_chebyshev_keep(int i)
{
    return (float)(2 * i - 1) / (float)(2 * i + 3);
}
static inline float pal_chebyshev_take(int i)
{
    return (float)(8 * i + 4) / (float)(2 * i + 3);
}

/* The largest eigenvalue of D^-1 A, or a little more, by power iteration on a direction d of the caller: size_of gives
 * sqrt(d' D d), a norm in which D^-1 A is symmetric; apply sets d = scale D^-1 A d. Before the call d is to be
 * pal_chebyshev_start at point i and axis c, which is not smooth, and 0 where D is none */
float pal_chebyshev_lambda(double (*size_of)(void *user), void (*apply)(void *user, float scale), void *user);
static inline float pal_chebyshev_start(int i, int c)
{
    return (float)((7 * i + 3 * c) % 11 - 5);
}

/* one level of coarse cells, and what the next finer one is on it */
typedef struct pal_grid_level {
    int n_cell, n_node;
    int32_t *node;   /* corners of each cell, x = 1, y = 2, z = 4                              [n_cell][8]      */
    uint8_t *fixed;  /* no free node of the finer level takes part in it                       [n_node]         */
    int32_t *child;  /* finer cells, sorted by the cell that contains them                     [n_finer_cell]   */
    int32_t *first;  /* first child of each cell                                               [n_cell + 1]     */
    uint8_t *octant; /* place of each finer cell in its cell, bits as of corners               [n_finer_cell]   */
    int32_t *start;  /* first entry in `from` of each finer node                               [n_finer_node + 1] */
    int32_t *from;   /* nodes whose mean a finer node is; none: it is fixed                 [start[n_finer_node]] */
    int32_t *begin;  /* first entry in `finer` of each node                                 [n_node + 1]     */
    int32_t *finer;  /* the finer nodes that take part in a node, ascending                 [start[n_finer_node]] */
} pal_grid_level;
enum { PAL_GRID_LEVELS_MAX = 12 };
typedef struct pal_grid_hierarchy {
    int n_level; /* 0: the finest level is coarse already */
    pal_grid_level level[PAL_GRID_LEVELS_MAX];
} pal_grid_hierarchy;

typedef struct pal_multigrid pal_multigrid;

/* makes patterns and vectors for a hierarchy of at least one level, which must outlive it. MEMORY. [load] */
pal_err pal_multigrid_create(const pal_grid_hierarchy *grid, pal_multigrid **out);
void pal_multigrid_destroy(pal_multigrid *mg); /* NULL is fine */

/* New values of the first level's cells that are marked in changed [n_cell], the first time and after an error all:
 * begin, then add, in ascending order, the matrices of all cells that are wanted and the lumped masses of all finest
 * nodes, then finish. Wanted are the marked cells and those that share a node with one; every row of the matrices that
 * a marked cell has a part in is summed again, here and on the coarser levels, in the order of the whole, so that the
 * result is the same to the bit. The largest eigenvalues of the smoothers and the factor of the coarsest level are
 * always found in full. A cell may become nothing (a matrix of zeros) where masses keep the coarsest matrix positive
 * definite; a cut that adds nodes needs another hierarchy. NUMERIC: the coarsest matrix is not positive definite;
 * MEMORY. No solve may follow then */
void pal_multigrid_begin(pal_multigrid *mg, const uint8_t *changed);
bool pal_multigrid_wants(const pal_multigrid *mg, int cell);
void pal_multigrid_add_cell(pal_multigrid *mg, int cell, double k[24][24]);
void pal_multigrid_add_mass(pal_multigrid *mg, int finest_node, double mass);
pal_err pal_multigrid_finish(pal_multigrid *mg);

/* answer ~ A^-1 P' residual on the first level; residual: of the finest nodes, each over the number of nodes that it is
 * interpolated from, x y z 0 [n_finest][4]; answer: x y z 0 of the first level's nodes [n_node][4], until the next
 * solve. team: NULL, or threads that share the work; the same bits with any number */
const float *pal_multigrid_solve(pal_multigrid *mg, pal_cycle cycle, const float *residual, pal_team *team);

/* k [24][24], the symmetric matrix of a finer cell in corners and axes, interpolated from the corners of the cell that
 * contains it at `octant` and added to `to`; corners whose bits are set in `fixed` do not move */
void pal_multigrid_coarsen_cell(double k[24][24], int octant, unsigned fixed, double to[24][24]);
#endif
