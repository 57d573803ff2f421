/* The order of the points is the tree: the middle point of a range splits it along the range's longest side, and the
 * two halves are the subtrees; ranges of up to LEAF points are searched linearly. No node structs, no pointers. */
#include "server/mesh/geometry/kd_tree.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"

enum { LEAF = 8 };

struct pal_kd_tree {
    int n;
    double *x;      /* points in tree order        [n][3] */
    int32_t *index; /* caller's index of each      [n]    */
    uint8_t *axis;  /* split axis at middle points [n]    */
};

static bool before(const double *x, int32_t a, int32_t b, int axis)
{
    double p = x[3 * (size_t)a + (size_t)axis], q = x[3 * (size_t)b + (size_t)axis];
    return p < q || (p == q && a < b);
}

int pal_kd_split(const double *x, int32_t *item, int n, int middle)
{
    double min[3], max[3];
    int axis = 0, low = 0, high = n - 1;
    pal_box3_empty(min, max);
    for (int i = 0; i < n; i++) pal_box3_add(min, max, x + 3 * (size_t)item[i]);
    for (int k = 1; k < 3; k++)
        if (max[k] - min[k] > max[axis] - min[axis]) axis = k;
    /* quickselect */
    while (low < high) {
        int32_t pivot = item[low + (high - low) / 2];
        int i = low, j = high;
        while (i <= j) {
            while (before(x, item[i], pivot, axis)) i++;
            while (before(x, pivot, item[j], axis)) j--;
            if (i > j) break;
            int32_t swap = item[i];
            item[i++] = item[j];
            item[j--] = swap;
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            break;
    }
    return axis;
}

/* n points from `first` on; depth is log2 n because the middle is exact */
static void build(pal_kd_tree *tree, const double *x, int first, int n)
{
    int half = (n - 1) / 2;
    if (n <= LEAF) return;
    tree->axis[first + half] = (uint8_t)pal_kd_split(x, tree->index + first, n, half);
    build(tree, x, first, half);
    build(tree, x, first + half + 1, n - half - 1);
}

pal_err pal_kd_tree_create(const double *x, int n_point, pal_kd_tree **out)
{
    pal_err err = PAL_ERR_OK;
    pal_kd_tree *tree = calloc(1, sizeof *tree);
    if (!tree) return PAL_ERR_MEMORY;
    tree->n = n_point;
    PAL_ARRAY(&err, tree->x, 3 * (size_t)n_point);
    PAL_ARRAY(&err, tree->index, n_point);
    PAL_ZEROED(&err, tree->axis, n_point);
    if (err) {
        pal_kd_tree_destroy(tree);
        return err;
    }
    for (int i = 0; i < n_point; i++) tree->index[i] = i;
    build(tree, x, 0, n_point);
    for (int i = 0; i < n_point; i++) pal_copy3(tree->x + 3 * (size_t)i, x + 3 * (size_t)tree->index[i]);
    *out = tree;
    return PAL_ERR_OK;
}

void pal_kd_tree_destroy(pal_kd_tree *tree)
{
    if (!tree) return;
    PAL_FREE(tree->x, tree->index, tree->axis, tree);
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
    for (int far = 0; far < 2; far++) {
        bool lower = (to_plane < 0) != far;
        /* equal distances count, so that ties go to the smaller index wherever it is stored */
        if (far && q->found == q->k && to_plane * to_plane > q->distance2[q->k - 1]) return;
        descend(q, lower ? low : middle + 1, lower ? middle - 1 : high);
    }
}

int pal_kd_tree_nearest(const pal_kd_tree *kd_tree, const double p[3], int k, int32_t *index, double *distance2)
{
    if (k <= 0) return 0;
    query q = {kd_tree, p, k, 0, index, distance2};
    descend(&q, 0, kd_tree->n - 1);
    return q.found;
}
