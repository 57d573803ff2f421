/* kd-tree of points: the k nearest, deterministic (ties by smaller index). Thread: [load] to build, then read-only. */
#ifndef PAL_MESH_NEAR_H
#define PAL_MESH_NEAR_H
#include "server/base/err.h"

#include <stdint.h>

typedef struct pal_near pal_near;

pal_err pal_near_create(const double *x, int n_point, pal_near **out); /* copies x [n_point][3]; MEMORY */
void pal_near_destroy(pal_near *near_tree);
/* up to k nearest points in ascending distance: index [k], squared distance [k] (may be NULL, then k <= 64);
 * number found */
int pal_near_find(const pal_near *near_tree, const double p[3], int k, int32_t *index, double *distance2);
#endif
