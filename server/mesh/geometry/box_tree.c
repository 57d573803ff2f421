/* A dipole per box gives the winding number (Barill et al. 2018, first order). Triangles are split at the median of the
 * centroids along the longest side, so the depth is log2 n for any input. Nodes are in depth-first order: the left
 * child follows its parent. Triangles with a non-finite corner are left out.
 */
#include "server/mesh/geometry/box_tree.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/kd_tree.h"
#include "server/mesh/geometry/tuning.h"

enum { LEAF = 4, STACK = 128 };

typedef struct node {
    double low[3], high[3];
    double centre[3], area_normal[3], area, radius; /* dipole: area-weighted centroid and normal, farthest corner */
    int32_t right;                                  /* index of the right child; leaf: first item             */
    int32_t n_item;                                 /* 0: inner node                                          */
} node;

struct pal_box_tree {
    const pal_surface *surface;
    int n_node, n_item;
    node *nodes;
    int32_t *item; /* triangles in tree order */
};

typedef struct builder {
    pal_box_tree *tree;
    double *centroid; /* of each triangle [n_tri][3] */
} builder;

static void corners_of(const pal_surface *s, int32_t tri, const double *corner[3])
{
    for (int k = 0; k < 3; k++) corner[k] = s->x + 3 * (size_t)s->tri[3 * (size_t)tri + (size_t)k];
}

/* distance of the farthest corner of the box from the dipole's centroid */
static void find_radius(node *n)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double reach = fmax(n->high[k] - n->centre[k], n->centre[k] - n->low[k]);
        sum += reach * reach;
    }
    n->radius = sqrt(sum);
}

/* box and dipole of a leaf */
static void measure_leaf(const builder *b, node *to)
{
    const pal_surface *s = b->tree->surface;
    double middle[3] = {0};
    pal_box3_empty(to->low, to->high);
    for (int i = to->right; i < to->right + to->n_item; i++) {
        const double *c[3], *g = b->centroid + 3 * (size_t)b->tree->item[i];
        double normal[3];
        corners_of(s, b->tree->item[i], c);
        for (int k = 0; k < 3; k++) pal_box3_add(to->low, to->high, c[k]);
        pal_normal3(normal, c[0], c[1], c[2]);
        double area = 0.5 * pal_norm3(normal);
        pal_axpy3(to->area_normal, 0.5, normal);
        pal_axpy3(to->centre, area, g);
        pal_add3(middle, middle, g);
        to->area += area;
    }
    pal_scale3(to->centre, to->area > 0 ? 1 / to->area : 1.0 / to->n_item, to->area > 0 ? to->centre : middle);
    find_radius(to);
}

/* box and dipole of an inner node from its children */
static void measure_inner(const node *left, const node *right, node *to)
{
    double area = left->area + right->area, share = area > 0 ? left->area / area : 0.5;
    for (int k = 0; k < 3; k++) {
        to->low[k] = fmin(left->low[k], right->low[k]), to->high[k] = fmax(left->high[k], right->high[k]);
        to->centre[k] = share * left->centre[k] + (1 - share) * right->centre[k];
        to->area_normal[k] = left->area_normal[k] + right->area_normal[k];
    }
    to->area = area;
    find_radius(to);
}

static int build(const builder *b, int first, int n)
{
    pal_box_tree *tree = b->tree;
    int self = tree->n_node++;
    node *me = &tree->nodes[self];
    memset(me, 0, sizeof *me);
    if (n <= LEAF) {
        me->right = first;
        me->n_item = n;
        measure_leaf(b, me);
        return self;
    }
    int half = n / 2;
    pal_kd_split(b->centroid, tree->item + first, n, half);
    int left = build(b, first, half);
    me->right = build(b, first + half, n - half);
    measure_inner(&tree->nodes[left], &tree->nodes[me->right], me);
    return self;
}

pal_err pal_box_tree_create(const pal_surface *surface, pal_box_tree **out)
{
    pal_err err = PAL_ERR_OK;
    pal_box_tree *tree = calloc(1, sizeof *tree);
    if (!tree) return PAL_ERR_MEMORY;
    builder b = {.tree = tree};
    tree->surface = surface;
    /* halves of more than LEAF items have at least LEAF / 2: at most n leaves */
    PAL_ARRAY(&err, tree->nodes, surface->n_tri);
    PAL_ARRAY(&err, tree->item, surface->n_tri);
    PAL_ARRAY(&err, b.centroid, 3 * (size_t)surface->n_tri);
    if (err) {
        free(b.centroid);
        pal_box_tree_destroy(tree);
        return err;
    }
    for (int32_t t = 0; t < surface->n_tri; t++) {
        const double *c[3];
        double *g = b.centroid + 3 * (size_t)t;
        corners_of(surface, t, c);
        for (int d = 0; d < 3; d++) g[d] = (c[0][d] + c[1][d] + c[2][d]) / 3;
        if (pal_finite3(g)) tree->item[tree->n_item++] = t;
    }
    if (tree->n_item) build(&b, 0, tree->n_item);
    free(b.centroid);
    *out = tree;
    return PAL_ERR_OK;
}

void pal_box_tree_destroy(pal_box_tree *tree)
{
    if (!tree) return;
    PAL_FREE(tree->nodes, tree->item, tree);
}

double pal_solid_angle(const double *corner[3], const double p[3])
{
    double a[3], b[3], c[3], cross[3];
    pal_sub3(a, corner[0], p);
    pal_sub3(b, corner[1], p);
    pal_sub3(c, corner[2], p);
    double la = pal_norm3(a), lb = pal_norm3(b), lc = pal_norm3(c);
    pal_cross3(cross, b, c);
    double high = pal_dot3(a, cross);
    double low = la * lb * lc + pal_dot3(a, b) * lc + pal_dot3(b, c) * la + pal_dot3(c, a) * lb;
    return high == 0 ? 0 : 2 * atan2(high, low);
}

double pal_box_tree_winding(const pal_box_tree *tree, const double p[3])
{
    int stack[STACK], n_stack = 0;
    double sum = 0;
    if (tree->n_node) stack[n_stack++] = 0;
    while (n_stack) {
        const node *n = &tree->nodes[stack[--n_stack]];
        double to[3];
        pal_sub3(to, n->centre, p);
        double distance2 = pal_dot3(to, to);
        if (distance2 > FAR_RADII * FAR_RADII * n->radius * n->radius) {
            sum += pal_dot3(n->area_normal, to) / (distance2 * sqrt(distance2));
        } else if (!n->n_item) {
            stack[n_stack++] = n->right;
            stack[n_stack++] = (int)(n - tree->nodes) + 1;
        } else {
            for (int i = 0; i < n->n_item; i++) {
                const double *c[3];
                corners_of(tree->surface, tree->item[n->right + i], c);
                sum += pal_solid_angle(c, p);
            }
        }
    }
    return sum / (4 * M_PI);
}
