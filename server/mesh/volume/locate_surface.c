/* Part of a surface as quadrature points in the elements of a mesh.
 *
 * Triangles are cut by the box, then by the planes of the voxel lattice, whose pieces lie in one hexahedron each. In
 * tetrahedra a piece is peeled: the element around its centre takes the part within its four planes, and the rest, in
 * convex pieces, is treated likewise. Cuts lose no area, so areas sum exactly. */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/polygon.h"
#include "server/mesh/volume/locate.h"
#include "server/num/shape_functions.h"

/* cosine of the largest angle to the given normal; pieces smaller than this fraction of their triangle are rounding;
 * barycentric coordinates within this of 0 lie on the face */
#define COS_OFF 0.90630778703664996324
#define CRUMB   1e-15
#define ON_FACE 1e-12
/* of a voxel: a piece in a plane between voxels belongs to the one beyond it */
#define BEYOND 1e-7
enum { MAX_PEEL = 24 };

typedef struct cutter {
    const pal_locate *locate;
    const pal_tets *tets;
    bool hex;
    double low[3], h; /* of the voxel lattice */
    double normal[3]; /* of the triangle at hand */
    double crumb_m2;
    int axis;          /* of the plane that pieces are projected on; -1: they stay */
    double side, at_m; /* +-1, the direction beyond the plane; its place            */
    pal_quadrature_point *piece;
    size_t n;
    bool full; /* out of memory */
} cutter;

static double area_of(const cutter *c, const pal_polygon *p)
{
    double sum = 0;
    for (int i = 1; i + 1 < p->n; i++) {
        double cross[3];
        pal_normal3(cross, p->x[0], p->x[i], p->x[i + 1]);
        sum += pal_dot3(cross, c->normal) / 2;
    }
    return sum;
}

/* a polygon within an element, as a fan of triangles with six points each */
static void add_points(cutter *c, const pal_polygon *p, int element)
{
    for (int i = 1; i + 1 < p->n && !c->full; i++) {
        const double *corner[3] = {p->x[0], p->x[i], p->x[i + 1]};
        double cross[3];
        pal_normal3(cross, corner[0], corner[1], corner[2]);
        double area = pal_dot3(cross, c->normal) / 2;
        if (!(area > 0)) continue;
        for (int q = 0; q < 6; q++) {
            double x[3] = {0};
            for (int k = 0; k < 3; k++) pal_axpy3(x, pal_tri_gauss[q][k], corner[k]);
            c->full = c->n == INT32_MAX || !PAL_GROW(c->piece, c->n);
            if (c->full) return;
            pal_quadrature_point *piece = &c->piece[c->n++];
            piece->element = element;
            piece->area_m2 = area * pal_tri_gauss[q][3];
            pal_copy3(piece->normal, c->normal);
            if (c->axis >= 0) {
                piece->area_m2 *= c->side * c->normal[c->axis];
                for (int k = 0; k < 3; k++) piece->normal[k] = k == c->axis ? c->side : 0;
                x[c->axis] = c->at_m;
            }
            pal_locate_local(c->locate, element, x, piece->local);
        }
    }
}

static int element_at_middle(const cutter *c, const pal_polygon *p, double *outside_m)
{
    double middle[3] = {0}, local[4];
    for (int i = 0; i < p->n; i++) pal_axpy3(middle, 1.0 / p->n, p->x[i]);
    if (c->axis >= 0) middle[c->axis] = c->at_m + BEYOND * c->side * c->h;
    /* what cancels must be in the same element, also where there is none at the middle */
    for (int k = 0; k < 3 && c->axis >= 0; k++)
        middle[k] = c->low[k] + c->h * (floor((middle[k] - c->low[k]) / c->h) + 0.5);
    return pal_locate_point(c->locate, middle, local, outside_m);
}

/* heights of the corners over face f of a tetrahedron, rounding taken off; true when they lie on both sides */
static bool find_heights(const cutter *c, const pal_polygon *p, int element, int f, double height[PAL_POLYGON_MAX])
{
    bool below = false, above = false;
    for (int i = 0; i < p->n; i++) {
        double local[4];
        pal_locate_local(c->locate, element, p->x[i], local);
        height[i] = fabs(local[f]) < ON_FACE ? 0 : local[f];
        below |= height[i] < 0;
        above |= height[i] > 0;
    }
    return below && above;
}

static void peel(cutter *c, pal_polygon *p, int depth)
{
    double outside, height[PAL_POLYGON_MAX];
    if (p->n < 3 || area_of(c, p) <= c->crumb_m2) return;
    int element = element_at_middle(c, p, &outside);
    for (int f = 0; f < 4 && depth < MAX_PEEL && outside == 0; f++) {
        pal_polygon off, on;
        if (!find_heights(c, p, element, f, height)) continue;
        pal_polygon_cut(p, height, -1, 0, &off, &on);
        peel(c, &off, depth + 1);
        *p = on;
    }
    if (p->n >= 3) add_points(c, p, element);
}

/* cuts by the lattice planes of one axis after the other */
static void cut_lattice(cutter *c, pal_polygon *p, int axis)
{
    if (p->n < 3 || area_of(c, p) <= c->crumb_m2) return;
    if (axis == 3) {
        if (c->hex)
            add_points(c, p, element_at_middle(c, p, NULL));
        else
            peel(c, p, 0);
        return;
    }
    double min, max;
    pal_polygon_range(p, axis, &min, &max);
    for (double i = floor((min - c->low[axis]) / c->h); !c->full; i++) {
        double at = c->low[axis] + i * c->h;
        if (at >= max) break;
        if (at <= min) continue;
        pal_polygon low, high;
        pal_polygon_cut_axis(p, axis, at, &low, &high);
        cut_lattice(c, &low, axis + 1);
        *p = high;
    }
    cut_lattice(c, p, axis + 1);
}

static void add_triangle(cutter *c, const pal_surface *surface, size_t t, const double low[3], const double high[3],
                         const double *normal)
{
    pal_polygon p = {.n = 3};
    double cross[3];
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++)
            p.x[k][d] = surface->x[3 * (size_t)surface->tri[3 * t + (size_t)k] + (size_t)d] + surface->origin_m[d] -
                        c->tets->origin_m[d];
    pal_normal3(cross, p.x[0], p.x[1], p.x[2]);
    if (!pal_unit3(c->normal, cross, 0)) return;
    if (normal && pal_dot3(c->normal, normal) < COS_OFF) return;
    c->crumb_m2 = CRUMB * pal_norm3(cross) / 2;
    for (int k = 0; k < 3; k++) pal_polygon_clip(&p, k, low[k], high[k]);
    cut_lattice(c, &p, 0);
}

static pal_err cut_surface(cutter *c, const pal_surface *surface, const double low[3], const double high[3],
                           const double *normal, pal_quadrature_point **out, int *n_piece)
{
    double top[3];
    c->tets = pal_locate_mesh(c->locate, &c->hex);
    c->h = c->tets->edge_m;
    /* the lattice of a voxel split begins at the lowest corner of the mesh */
    pal_box3_empty(c->low, top);
    for (size_t i = 0; i < (size_t)c->tets->n_node; i++) pal_box3_add(c->low, top, c->tets->x + 3 * i);
    for (size_t t = 0; t < (size_t)surface->n_tri && !c->full; t++) add_triangle(c, surface, t, low, high, normal);
    if (c->full) {
        free(c->piece);
        return PAL_ERR_MEMORY;
    }
    *out = c->piece;
    *n_piece = (int)c->n;
    return PAL_ERR_OK;
}

pal_err pal_locate_surface(const pal_locate *locate, const pal_surface *surface, const double low[3],
                           const double high[3], const double *normal, pal_quadrature_point **out, int *n_piece)
{
    double unit[3];
    cutter c = {.locate = locate, .axis = -1};
    if (normal && !pal_unit3(unit, normal, 0)) normal = NULL;
    return cut_surface(&c, surface, low, high, normal ? unit : NULL, out, n_piece);
}

pal_err pal_locate_section(const pal_locate *locate, const pal_surface *surface, const double low[3],
                           const double high[3], int axis, int side, pal_quadrature_point **out, int *n_piece)
{
    double from[3], to[3];
    cutter c = {.locate = locate, .axis = axis, .side = side, .at_m = side > 0 ? high[axis] : low[axis]};
    pal_copy3(from, low), pal_copy3(to, high);
    from[axis] = side > 0 ? c.at_m : -INFINITY;
    to[axis] = side > 0 ? INFINITY : c.at_m;
    return cut_surface(&c, surface, from, to, NULL, out, n_piece);
}
