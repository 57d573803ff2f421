/* kd-tree of points: the k nearest, deterministic (ties by smaller index).
 *
 * The order of the points is the tree: the middle point of a range splits it along the range's longest side, and the
 * two halves are the subtrees; ranges of up to LEAF points are searched linearly. No node structs, no pointers. */
#include "server/mesh/geometry/kd_tree.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { LEAF = 8 };

struct pal_kd_tree {
    int n;
    double *x;      /* points in tree order        [n][3] */
    int32_t *index; /* caller's index of each      [n]    */
    uint8_t *axis;  /* split axis at middle points [n]    */
};

static void swap_points(pal_kd_tree *tree, int a, int b)
{
    int32_t i = tree->index[a];
    tree->index[a] = tree->index[b];
    tree->index[b] = i;
    for (int k = 0; k < 3; k++) {
        double d = tree->x[3 * (size_t)a + k];
        tree->x[3 * (size_t)a + k] = tree->x[3 * (size_t)b + k];
        tree->x[3 * (size_t)b + k] = d;
    }
}

static bool before(const pal_kd_tree *tree, int a, int b, int axis)
{
    double p = tree->x[3 * (size_t)a + axis], q = tree->x[3 * (size_t)b + axis];
    return p < q || (p == q && tree->index[a] < tree->index[b]);
}

/* quickselect with a median-of-three pivot: moves the point of rank middle to its position, smaller ones before it */
static void select_middle(pal_kd_tree *tree, int low, int high, int middle, int axis)
{
    while (low < high) {
        int a = low + (high - low) / 2;
        if (before(tree, a, low, axis)) swap_points(tree, a, low);
        if (before(tree, high, low, axis)) swap_points(tree, high, low);
        if (before(tree, high, a, axis)) swap_points(tree, high, a);
        swap_points(tree, a, high); /* pivot to the end */
        int place = low;
        for (int i = low; i < high; i++)
            if (before(tree, i, high, axis)) swap_points(tree, i, place++);
        swap_points(tree, place, high);
        if (place == middle) return;
        if (place < middle)
            low = place + 1;
        else
            high = place - 1;
    }
}

/* low..high inclusive; depth is log2 n because the middle is exact */
static void build(pal_kd_tree *tree, int low, int high)
{
    if (high - low < LEAF) return;
    double min[3], max[3];
    memcpy(min, tree->x + 3 * (size_t)low, sizeof min);
    memcpy(max, min, sizeof max);
    for (int i = low + 1; i <= high; i++)
        for (int k = 0; k < 3; k++) {
            double v = tree->x[3 * (size_t)i + k];
            if (v < min[k]) min[k] = v;
            if (v > max[k]) max[k] = v;
        }
    int axis = 0, middle = low + (high - low) / 2;
    for (int k = 1; k < 3; k++)
        if (max[k] - min[k] > max[axis] - min[axis]) axis = k;
    select_middle(tree, low, high, middle, axis);
    tree->axis[middle] = (uint8_t)axis;
    build(tree, low, middle - 1);
    build(tree, middle + 1, high);
}

pal_err pal_kd_tree_create(const double *x, int n_point, pal_kd_tree **out)
{
    size_t n = n_point > 0 ? (size_t)n_point : 0, room = n ? n : 1;
    pal_kd_tree *tree = calloc(1, sizeof *tree);
    if (!tree) return PAL_ERR_MEMORY;
    *tree = (pal_kd_tree){(int)n, malloc(room * 3 * sizeof(double)), malloc(room * sizeof(int32_t)), calloc(room, 1)};
    if (!tree->x || !tree->index || !tree->axis) {
        pal_kd_tree_destroy(tree);
        return PAL_ERR_MEMORY;
    }
    if (n) memcpy(tree->x, x, n * 3 * sizeof *x);
    for (size_t i = 0; i < n; i++) tree->index[i] = (int32_t)i;
    build(tree, 0, (int)n - 1);
    *out = tree;
    return PAL_ERR_OK;
}

void pal_kd_tree_destroy(pal_kd_tree *tree)
{
    if (!tree) return;
    free(tree->x);
    free(tree->index);
    free(tree->axis);
    free(tree);
}

typedef struct query {
    const pal_kd_tree *tree;
    const double *p;
    int k, found;
    int32_t *index;
    double *distance2;
} query;

/* keeps the k best, ascending by distance, then index */
static void consider(query *q, int i)
{
    const double *x = q->tree->x + 3 * (size_t)i;
    double a = x[0] - q->p[0], b = x[1] - q->p[1], c = x[2] - q->p[2], d = a * a + b * b + c * c;
    int32_t index = q->tree->index[i];
    int place = q->found;
    while (place > 0 && (d < q->distance2[place - 1] || (d == q->distance2[place - 1] && index < q->index[place - 1])))
        place--;
    if (place >= q->k) return;
    int last = q->found < q->k ? q->found++ : q->k - 1;
    for (int j = last; j > place; j--) {
        q->index[j] = q->index[j - 1];
        q->distance2[j] = q->distance2[j - 1];
    }
    q->index[place] = index;
    q->distance2[place] = d;
}

static void descend(query *q, int low, int high)
{
    if (high - low < LEAF) {
        for (int i = low; i <= high; i++) consider(q, i);
        return;
    }
    int middle = low + (high - low) / 2, axis = q->tree->axis[middle];
    double to_plane = q->p[axis] - q->tree->x[3 * (size_t)middle + axis];
    consider(q, middle);
    bool first_low = to_plane < 0;
    for (int side = 0; side < 2; side++) {
        bool far_side = side == 1;
        /* equal distances count, so that ties go to the smaller index wherever it is stored */
        if (far_side && q->found == q->k && to_plane * to_plane > q->distance2[q->k - 1]) return;
        if (first_low != far_side)
            descend(q, low, middle - 1);
        else
            descend(q, middle + 1, high);
    }
}

int pal_kd_tree_nearest(const pal_kd_tree *kd_tree, const double p[3], int k, int32_t *index, double *distance2)
{
    enum { LOCAL = 64 };
    double local[LOCAL];
    if (k > LOCAL && !distance2) k = LOCAL;
    if (k <= 0) return 0;
    query q = {kd_tree, p, k, 0, index, distance2 ? distance2 : local};
    descend(&q, 0, kd_tree->n - 1);
    return q.found;
}
