/* AABB tree over the triangles of a surface (paper B section 2.2), with a dipole per box for the winding number (Barill
 * et al. 2018, first order).
 *
 * Triangles are split at the median of the centroids along the longest side, so the depth is log2 n for any input.
 * Nodes are in depth-first order: the left child follows its parent. Triangles with a non-finite corner are left out.
 */
#include "server/mesh/geometry/box_tree.h"

#include "server/base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LEAF = 4, STACK = 128 };
/* a box is far when its distance exceeds this number of its radii */
#define FAR_RADII 2.3
#define PI        3.14159265358979323846

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

/* state of the recursive build */
typedef struct builder {
    pal_box_tree *tree;
    double *centroid; /* of each triangle [n_tri][3] */
} builder;

static void corners_of(const pal_surface *s, int32_t tri, const double *corner[3])
{
    for (int k = 0; k < 3; k++) corner[k] = s->x + 3 * (size_t)s->tri[3 * (size_t)tri + (size_t)k];
}

/* quickselect: moves the item of rank middle to its position by coordinate (ties by index) */
static void select_middle(const builder *b, int low, int high, int middle, int axis)
{
    int32_t *item = b->tree->item;
    while (low < high) {
        int32_t pivot = item[low + (high - low) / 2];
        double value = b->centroid[3 * (size_t)pivot + (size_t)axis];
        int i = low, j = high;
        while (i <= j) {
            for (;; i++) {
                double v = b->centroid[3 * (size_t)item[i] + (size_t)axis];
                if (!(v < value || (v == value && item[i] < pivot))) break;
            }
            for (;; j--) {
                double v = b->centroid[3 * (size_t)item[j] + (size_t)axis];
                if (!(v > value || (v == value && item[j] > pivot))) break;
            }
            if (i <= j) {
                int32_t swap = item[i];
                item[i++] = item[j];
                item[j--] = swap;
            }
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            return;
    }
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
    for (int k = 0; k < 3; k++) to->low[k] = INFINITY, to->high[k] = -INFINITY;
    for (int i = to->right; i < to->right + to->n_item; i++) {
        const double *c[3], *g = b->centroid + 3 * (size_t)b->tree->item[i];
        double e[3], f[3], normal[3];
        corners_of(s, b->tree->item[i], c);
        for (int k = 0; k < 3; k++)
            for (int d = 0; d < 3; d++) {
                to->low[d] = c[k][d] < to->low[d] ? c[k][d] : to->low[d];
                to->high[d] = c[k][d] > to->high[d] ? c[k][d] : to->high[d];
            }
        pal_sub3(e, c[1], c[0]);
        pal_sub3(f, c[2], c[0]);
        pal_cross3(normal, e, f);
        double area = 0.5 * pal_norm3(normal);
        pal_axpy3(to->area_normal, 0.5, normal);
        pal_axpy3(to->centre, area, g);
        pal_add3(middle, middle, g);
        to->area += area;
    }
    if (to->area > 0)
        pal_scale3(to->centre, 1 / to->area, to->centre);
    else
        pal_scale3(to->centre, 1.0 / to->n_item, middle);
    find_radius(to);
}

/* box and dipole of an inner node from its children */
static void measure_inner(const node *left, const node *right, node *to)
{
    double area = left->area + right->area, share = area > 0 ? left->area / area : 0.5;
    for (int k = 0; k < 3; k++) {
        to->low[k] = left->low[k] < right->low[k] ? left->low[k] : right->low[k];
        to->high[k] = left->high[k] > right->high[k] ? left->high[k] : right->high[k];
        to->centre[k] = share * left->centre[k] + (1 - share) * right->centre[k];
        to->area_normal[k] = left->area_normal[k] + right->area_normal[k];
    }
    to->area = area;
    find_radius(to);
}

/* the axis along which the centroids spread most */
static int widest_axis(const builder *b, int first, int n)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = first; i < first + n; i++) {
        const double *g = b->centroid + 3 * (size_t)b->tree->item[i];
        for (int k = 0; k < 3; k++) {
            low[k] = g[k] < low[k] ? g[k] : low[k];
            high[k] = g[k] > high[k] ? g[k] : high[k];
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    return axis;
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
    select_middle(b, first, first + n - 1, first + half, widest_axis(b, first, n));
    int left = build(b, first, half);
    me->right = build(b, first + half, n - half);
    measure_inner(&tree->nodes[left], &tree->nodes[me->right], me);
    return self;
}

pal_err pal_box_tree_create(const pal_surface *surface, pal_box_tree **out)
{
    size_t n = (size_t)surface->n_tri, room = n ? n : 1;
    pal_box_tree *tree = calloc(1, sizeof *tree);
    if (!tree) return PAL_ERR_MEMORY;
    tree->surface = surface;
    /* halves of more than LEAF items have at least LEAF / 2: at most n leaves */
    tree->nodes = malloc(room * sizeof *tree->nodes);
    tree->item = malloc(room * sizeof *tree->item);
    builder b = {tree, malloc(room * 3 * sizeof *b.centroid)};
    if (!tree->nodes || !tree->item || !b.centroid) {
        free(b.centroid);
        pal_box_tree_destroy(tree);
        return PAL_ERR_MEMORY;
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
    free(tree->nodes);
    free(tree->item);
    free(tree);
}

/* parameter range 0..most of a + t d within the box, widened by rounding; false when empty */
static bool meets_box(const node *n, const double a[3], const double inverse[3], double max)
{
    double from = 0, to = max;
    for (int k = 0; k < 3; k++) {
        double t0 = (n->low[k] - a[k]) * inverse[k], t1 = (n->high[k] - a[k]) * inverse[k];
        /* 0 times infinity: the start lies on the slab's plane and stays there */
        if (isnan(t0)) t0 = -INFINITY;
        if (isnan(t1)) t1 = INFINITY;
        from = fmax(from, fmin(t0, t1) * (1 - 1e-12));
        to = fmin(to, fmax(t0, t1) * (1 + 1e-12));
    }
    return from <= to;
}

/* six times the signed volume of d, u, v: its sign tells on which side of edge u-v the line passes */
static double side_of(const double d[3], const double u[3], const double v[3])
{
    double c[3];
    pal_cross3(c, u, v);
    return pal_dot3(d, c);
}

/* where the line a + t d meets the triangle; edges and corners belong to all their triangles; NAN: nowhere */
static double meet_triangle(const double *corner[3], const double a[3], const double d[3])
{
    double p[3][3], e[3], f[3], normal[3];
    for (int k = 0; k < 3; k++) pal_sub3(p[k], corner[k], a);
    double s0 = side_of(d, p[0], p[1]), s1 = side_of(d, p[1], p[2]), s2 = side_of(d, p[2], p[0]);
    if (!((s0 >= 0 && s1 >= 0 && s2 >= 0) || (s0 <= 0 && s1 <= 0 && s2 <= 0))) return NAN;
    pal_sub3(e, corner[1], corner[0]);
    pal_sub3(f, corner[2], corner[0]);
    pal_cross3(normal, e, f);
    double along = pal_dot3(normal, d);
    return along != 0 ? pal_dot3(normal, p[0]) / along : NAN;
}

/* smallest t in 0 < t < most where a + t d meets a triangle, or a negative number; any: the first found will do */
static double cast(const pal_box_tree *tree, const double a[3], const double d[3], double max, bool any, int *tri)
{
    int stack[STACK], n_stack = 0, best_tri = -1;
    double inverse[3] = {1 / d[0], 1 / d[1], 1 / d[2]}, best = max;
    if (tree->n_node) stack[n_stack++] = 0;
    while (n_stack) {
        const node *n = &tree->nodes[stack[--n_stack]];
        if (!meets_box(n, a, inverse, best)) continue;
        if (!n->n_item) {
            stack[n_stack++] = n->right;
            stack[n_stack++] = (int)(n - tree->nodes) + 1;
            continue;
        }
        for (int i = 0; i < n->n_item; i++) {
            const double *c[3];
            corners_of(tree->surface, tree->item[n->right + i], c);
            double t = meet_triangle(c, a, d);
            if (!(t > 0 && t < best)) continue;
            best = t;
            best_tri = tree->item[n->right + i];
            if (any) n_stack = 0;
        }
    }
    if (best_tri < 0) return -1;
    if (tri) *tri = best_tri;
    return best;
}

bool pal_box_tree_segment(const pal_box_tree *tree, const double a[3], const double b[3], int *tri)
{
    double d[3];
    pal_sub3(d, b, a);
    return cast(tree, a, d, 1, true, tri) >= 0;
}

double pal_box_tree_ray(const pal_box_tree *tree, const double a[3], const double d[3], double length, int *tri)
{
    return cast(tree, a, d, length, false, tri);
}

/* nearest point of a triangle: inside when the foot of the perpendicular lies there, else on its edges */
static double nearest_on_triangle(const double *corner[3], const double p[3], double out[3])
{
    double e[3], f[3], normal[3], from[3], best = INFINITY;
    pal_sub3(e, corner[1], corner[0]);
    pal_sub3(f, corner[2], corner[0]);
    pal_cross3(normal, e, f);
    pal_sub3(from, p, corner[0]);
    double n2 = pal_dot3(normal, normal), c[3];
    if (n2 > 0) {
        pal_cross3(c, from, f);
        double u = pal_dot3(c, normal) / n2;
        pal_cross3(c, e, from);
        double v = pal_dot3(c, normal) / n2;
        if (u >= 0 && v >= 0 && u + v <= 1) {
            for (int k = 0; k < 3; k++) out[k] = corner[0][k] + u * e[k] + v * f[k];
            return pal_dist3(p, out);
        }
    }
    for (int k = 0; k < 3; k++) {
        const double *a = corner[k], *b = corner[(k + 1) % 3];
        double ab[3], ap[3], foot[3];
        pal_sub3(ab, b, a);
        pal_sub3(ap, p, a);
        double length2 = pal_dot3(ab, ab), t = length2 > 0 ? pal_dot3(ap, ab) / length2 : 0;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        for (int i = 0; i < 3; i++) foot[i] = a[i] + t * ab[i];
        double distance = pal_dist3(p, foot);
        if (distance >= best) continue;
        best = distance;
        pal_copy3(out, foot);
    }
    return best;
}

static double box_distance(const node *n, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double out = fmax(0, fmax(n->low[k] - p[k], p[k] - n->high[k]));
        sum += out * out;
    }
    return sqrt(sum);
}

double pal_box_tree_nearest(const pal_box_tree *tree, const double p[3], double nearest[3], int *tri)
{
    int stack[STACK], n_stack = 0;
    double best = INFINITY;
    if (tree->n_node) stack[n_stack++] = 0;
    while (n_stack) {
        const node *n = &tree->nodes[stack[--n_stack]];
        if (box_distance(n, p) >= best) continue;
        if (!n->n_item) {
            /* the nearer child is searched first */
            int left = (int)(n - tree->nodes) + 1, right = n->right;
            bool left_first = box_distance(&tree->nodes[left], p) <= box_distance(&tree->nodes[right], p);
            stack[n_stack++] = left_first ? right : left;
            stack[n_stack++] = left_first ? left : right;
            continue;
        }
        for (int i = 0; i < n->n_item; i++) {
            const double *c[3];
            double point[3] = {0};
            corners_of(tree->surface, tree->item[n->right + i], c);
            double distance = nearest_on_triangle(c, p, point);
            if (distance >= best) continue;
            best = distance;
            pal_copy3(nearest, point);
            if (tri) *tri = tree->item[n->right + i];
        }
    }
    return best;
}

/* solid angle of a triangle (van Oosterom & Strackee 1983); 0 from a point in its plane */
static double solid_angle(const double *corner[3], const double p[3])
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
                sum += solid_angle(c, p);
            }
        }
    }
    return sum / (4 * PI);
}
