/* Coarse correction for a preconditioner of an elastic body: points are gathered into clusters, boxes of a few
 * elements, and the correction is the best motion in which every cluster is rigid, P (P' A P)^-1 P' r with six columns
 * of P for a cluster. Added to an incomplete factor, it removes what that is slow at, the smooth motions of a large or
 * slender body (two-level additive Schwarz; Vanek, Mandel and Brezina 1996 for the rigid motions). Memory: the caller's
 * arena, and a factor on the heap. Thread: [load] to make, then one thread at a time. */
#ifndef PAL_NUM_RIGID_CLUSTERS_H
#define PAL_NUM_RIGID_CLUSTERS_H
#include "server/num/cholesky.h"

typedef struct pal_rigid_clusters {
    int n, n_cluster; /* points and clusters                                            */
    int32_t *cluster; /* of each point; -1: fixed                                [n]   */
    double *arm;      /* from the middle of its cluster, over its size [n][3]   */
    double *r, *z;    /* work [n_cluster][2][3]: a translation and a rotation             */
    pal_cholesky *factor;
} pal_rigid_clusters;

/* a: symmetric positive definite but for the fixed points; x [n][3] m; cluster_m: edge of a cluster's box. NUMERIC: no
 * factor; MEMORY; BUDGET: the boxes are too many. Destroy it also after an error */
pal_err pal_rigid_clusters_make(const pal_block_matrix *a, const double *x, const uint8_t *fixed, double cluster_m,
                                pal_arena *arena, pal_rigid_clusters *out);
/* out [n][3] += the correction for r [n][3]. No heap */
void pal_rigid_clusters_add(const pal_rigid_clusters *p, const double *r, double *out);
void pal_rigid_clusters_destroy(pal_rigid_clusters *p);
#endif
