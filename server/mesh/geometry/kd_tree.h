/* kd-tree of points: the k nearest, deterministic (ties by smaller index). Thread: [load] to build, then read-only. */
#ifndef PAL_MESH_GEOMETRY_KD_TREE_H
#define PAL_MESH_GEOMETRY_KD_TREE_H
#include "server/base/err.h"

#include <stdint.h>

typedef struct pal_kd_tree pal_kd_tree;

pal_err pal_kd_tree_create(const double *x, int n_point, pal_kd_tree **out); /* copies x [n_point][3]; MEMORY */
void pal_kd_tree_destroy(pal_kd_tree *kd_tree);
/* up to k nearest points in ascending distance: index [k], squared distance [k]; number found */
int pal_kd_tree_nearest(const pal_kd_tree *kd_tree, const double p[3], int k, int32_t *index, double *distance2);
/* Orders the items [n] of points x so that the one of rank `middle` along the longest side of their box is in its
 * place, smaller ones before it (ties by number); returns that axis */
int pal_kd_split(const double *x, int32_t *item, int n, int middle);
#endif
