/* What a multigrid preconditioner needs for strong contrasts of stiffness: coarser levels average stiff and soft
 * material that share a cell, and miss how a stiff part moves as a whole. The nodes of stiff elements have a factor of
 * their own, which corrects the finest level before and after the coarser ones: x += W S' (S A S')^-1 S W' (b - A x),
 * where S takes these nodes and W turns as the levels do (warp.h). So iterations to 1e-6 grow from 10 to 44 at a
 * contrast of 10,000, in place of 164 (tests/sim/implicit/test_ellipsoid.c). Memory: the heap. Thread: [load],
 * then [sim] or, for values in the making, the spare thread. */
#ifndef PAL_SIM_IMPLICIT_STIFF_NODES_H
#define PAL_SIM_IMPLICIT_STIFF_NODES_H
#include "server/num/cholesky.h"
#include "server/sim/elements/elastic_hex_single.h"
#include "server/sim/implicit/warp.h"

typedef struct pal_stiff_nodes {
    int n;                   /* 0: no contrast is strong, or more nodes are stiff than a factor is for */
    int32_t *node;           /* ascending [n] */
    int32_t *place;          /* in `node`; -1: not stiff [n_node] */
    pal_arena *arena;        /* of what follows */
    pal_block_matrix blocks; /* S A S' */
    pal_cholesky *factor;
    double *v; /* [n][3] */
} pal_stiff_nodes;

/* finds the nodes for the material in `single`, and makes the factor: A = diag(weight) + stiff K at `rotation`
 * (elastic_hex_single.h); weight by slot. The pattern is kept while the nodes are the same, the factor too while none
 * of them is in changed [n_node], the nodes of elements that are others than at the last update. MEMORY, NUMERIC: n is
 * 0 */
pal_err pal_stiff_nodes_update(pal_stiff_nodes *s, const pal_body *body, const pal_elastic_hexes_single *single,
                               const float *rotation, const float *weight, double stiff, const uint8_t *changed);
void pal_stiff_nodes_destroy(pal_stiff_nodes *s);
/* x += W S' (S A S')^-1 S W' (b - q); b, q, x by slot [3][n_slot] */
void pal_stiff_nodes_correct(pal_stiff_nodes *s, const pal_body *body, const pal_warp *warp, int n_slot, const float *b,
                             const float *q, float *x);
#endif
