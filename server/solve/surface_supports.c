/* Supports on their true surface. */
#include "server/solve/surface_supports.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/num/shape_functions.h"
#include "server/sim/elements/elastic_hex.h"
#include "server/solve/tuning.h"

#include <math.h>

/* of h^2: a smaller area is rounding */
#define AREA_ROUNDING 1e-9
/* of the edge of a voxel: a region that reaches no further into voxels ends at their border */
#define FITS 0.005

typedef struct maker {
    const pal_problem *problem;
    const pal_locate *locate;
    pal_prepared *mesh;
    double young_Pa, sign; /* sign: +1, -1 of a surface that faces inward */
    int32_t *index;        /* of the support's items, of each voxel, -1: none [n_hex] */
    pal_ground_item *item;
    size_t n;
} maker;

/* the region in the frame of the mesh */
static void box_of(const maker *m, int support, double low[3], double high[3])
{
    const pal_box *box = &m->problem->support[support].region;
    for (int c = 0; c < 3; c++) {
        low[c] = box->all ? -INFINITY : box->low_m[c] - m->mesh->tets.origin_m[c];
        high[c] = box->all ? INFINITY : box->high_m[c] - m->mesh->tets.origin_m[c];
    }
}

static double young_of(const maker *m, int e)
{
    double x[3];
    const double h = m->mesh->tets.edge_m;
    if (!isnan(m->young_Pa)) return m->young_Pa;
    pal_add3(x, m->mesh->tets.x + 3 * (size_t)m->mesh->hexes.node[8 * (size_t)e], m->mesh->tets.origin_m);
    for (int c = 0; c < 3; c++) x[c] += h / 2;
    const pal_problem_material *material = pal_case_material_at(m->problem, x);
    return material ? material->young_Pa : 0;
}

static pal_err add_point(maker *m, int support, const pal_quadrature_point *point)
{
    const int e = point->element;
    double shape[8];
    if (m->index[e] < 0) {
        if (!PAL_GROW(m->item, m->n)) return PAL_ERR_MEMORY;
        m->index[e] = (int32_t)m->n;
        m->item[m->n++] = (pal_ground_item){.element = e, .support = support};
    }
    pal_element_shape(PAL_HEX_CORNERS, point->local, shape);
    const double k = PAL_SUPPORT_GAMMA * young_of(m, e) / m->mesh->tets.edge_m * m->sign * point->area_m2;
    double *to = m->item[m->index[e]].k_N_m;
    for (int c = 0; c < 8; c++)
        for (int d = c; d < 8; d++) to[pal_hex_pair(c, d)] += k * shape[c] * shape[d];
    return PAL_ERR_OK;
}

/* adds the points and frees them; *area_m2 += their area */
static pal_err add_points(maker *m, int support, pal_quadrature_point *point, int n, double *area_m2)
{
    const double h = m->mesh->tets.edge_m;
    double sum = 0;
    pal_err err = PAL_ERR_OK;
    for (int i = 0; i < n; i++) sum += m->sign * point[i].area_m2;
    for (int i = 0; i < n && !err && sum > AREA_ROUNDING * h * h; i++) err = add_point(m, support, &point[i]);
    if (sum > AREA_ROUNDING * h * h) *area_m2 += sum;
    return PAL_FREED(err, point);
}

/* from and to [3]: where voxel e lies in the box, 0..1 of its edges; returns the part of it that does */
static double overlap(const pal_prepared *mesh, int e, const double low[3], const double high[3], double from[3],
                      double to[3])
{
    const double *corner = mesh->tets.x + 3 * (size_t)mesh->hexes.node[8 * (size_t)e], h = mesh->tets.edge_m;
    double part = 1;
    for (int c = 0; c < 3; c++) {
        from[c] = fmin(1, fmax(0, (low[c] - corner[c]) / h));
        to[c] = fmax(from[c], fmin(1, (high[c] - corner[c]) / h));
        part *= to[c] - from[c];
    }
    return part;
}

/* integral from 0 to x of the shape function (1 -+ sqrt 3 (2 x - 1)) / 2 of a Gauss point on the low or high side */
static double shape_integral(bool is_high, double x)
{
    return (x + (is_high ? sqrt(3) : -sqrt(3)) * x * (x - 1)) / 2;
}

/* The region of a support holds nodes, all of whole voxels, and next to nothing of these. Of cut voxels nodes may lie
 * beyond the region that the body fills */
static bool fits(const pal_problem *problem, int support, const pal_prepared *mesh)
{
    const pal_box *box = &problem->support[support].region;
    const pal_tets *tets = &mesh->tets;
    double low[3], high[3], from[3], to[3], deep = 0;
    bool any = false;
    if (problem->support[support].has_normal || box->all) return false;
    pal_sub3(low, box->low_m, tets->origin_m), pal_sub3(high, box->high_m, tets->origin_m);
    for (size_t i = 0; i < 8 * (size_t)mesh->hexes.n_hex; i++) {
        double x[3];
        pal_add3(x, tets->x + 3 * (size_t)mesh->hexes.node[i], tets->origin_m);
        if (pal_box_contains(box, x, pal_case_tolerance_m(tets))) {
            if ((double)mesh->hexes.fill[i / 8] < 1 - FITS) return false;
            any = true;
        }
        if (i % 8 == 0) deep = fmax(deep, overlap(mesh, (int)(i / 8), low, high, from, to));
    }
    return any && deep < FITS;
}

/* What lies in the region is left out: of each weight the part that a whole voxel's has there, which of a cut voxel is
 * an approximation */
static void leave_out(maker *m, const double low[3], const double high[3])
{
    pal_hexes *hexes = &m->mesh->hexes;
    for (int e = 0; e < hexes->n_hex; e++) {
        double from[3], to[3], weight[8];
        if (!(overlap(m->mesh, e, low, high, from, to) > 0)) continue;
        for (int q = 0; q < 8; q++) {
            double within = 1;
            for (int c = 0; c < 3; c++)
                within *= 2 * (shape_integral(q >> c & 1, to[c]) - shape_integral(q >> c & 1, from[c]));
            weight[q] = (double)hexes->weight[8 * (size_t)e + (size_t)q] * (1 - within);
        }
        pal_hexes_set_weights(hexes, e, weight);
    }
}

static pal_err add_support(maker *m, int support, pal_diagnostic *diag)
{
    const pal_problem_support *s = &m->problem->support[support];
    const pal_surface *surface = &m->mesh->surface;
    double low[3], high[3], area = 0;
    pal_quadrature_point *point = NULL;
    int n = 0;
    box_of(m, support, low, high);
    for (int e = 0; e < m->mesh->hexes.n_hex; e++) m->index[e] = -1;
    if (s->has_normal) {
        PAL_TRY(pal_locate_surface(m->locate, surface, low, high, s->normal, &point, &n));
        for (int i = 0; i < n; i++) point[i].area_m2 *= m->sign;
        PAL_TRY(add_points(m, support, point, n, &area));
    }
    for (int face = 0; face < 6 && !s->has_normal; face++) {
        const int axis = face / 2, side = face % 2 ? 1 : -1;
        if (!isfinite(side > 0 ? high[axis] : low[axis])) continue;
        PAL_TRY(pal_locate_section(m->locate, surface, low, high, axis, side, &point, &n));
        PAL_TRY(add_points(m, support, point, n, &area));
    }
    if (area > 0) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "supports[%d]: %s meets nothing of the body", support, pal_box_describe(&s->region).text);
}

static int by_element(const void *a, const void *b)
{
    const pal_ground_item *p = a, *q = b;
    return p->element != q->element ? (p->element > q->element) - (p->element < q->element)
                                    : (p->support > q->support) - (p->support < q->support);
}

pal_err pal_surface_supports_make(const pal_problem *problem, double young_Pa, const pal_locate *locate,
                                  pal_prepared *mesh, pal_ground *out, pal_diagnostic *diag)
{
    maker m = {.problem = problem, .locate = locate, .mesh = mesh, .young_Pa = young_Pa};
    m.sign = pal_surface_volume(&mesh->surface) < 0 ? -1 : 1;
    m.index = malloc((size_t)mesh->hexes.n_hex * sizeof *m.index);
    pal_err err = m.index ? PAL_ERR_OK : PAL_ERR_MEMORY;
    bool fit[PAL_PROBLEM_REGIONS];
    for (int k = 0; k < problem->n_support && !err; k++)
        if (!(fit[k] = fits(problem, k, mesh))) err = add_support(&m, k, diag);
    for (int k = 0; k < problem->n_support && !err; k++) {
        double low[3], high[3];
        box_of(&m, k, low, high);
        if (!problem->support[k].has_normal && !fit[k]) leave_out(&m, low, high);
    }
    free(m.index);
    if (err) {
        free(m.item);
        return err == PAL_ERR_MEMORY ? pal_diagnostic_set(diag, err, "no memory for the supports") : err;
    }
    if (m.n > 0) qsort(m.item, m.n, sizeof *m.item, by_element);
    *out = (pal_ground){.n = (int)m.n, .item = m.item};
    return PAL_ERR_OK;
}

int pal_surface_supports_held(const pal_problem *problem, const pal_prepared *mesh,
                              pal_support_def out[PAL_PROBLEM_REGIONS])
{
    const pal_tets *tets = &mesh->tets;
    int n = 0;
    for (int k = 0; k < problem->n_support; k++) {
        const pal_box *box = &problem->support[k].region;
        pal_support_def to = {.lowest = false};
        bool any = false;
        if (problem->support[k].has_normal || box->all) continue;
        /* a node further than a voxel within has no element beyond */
        const double slack = pal_case_tolerance_m(tets), within = fits(problem, k, mesh) ? 0 : tets->edge_m;
        for (int c = 0; c < 3; c++) {
            to.low_m[c] = box->low_m[c] - tets->origin_m[c] + within - slack;
            to.high_m[c] = box->high_m[c] - tets->origin_m[c] - within + slack;
        }
        for (int i = 0; i < tets->n_node && !any; i++) {
            any = true;
            for (int c = 0; c < 3; c++)
                any = any && tets->x[3 * i + c] >= to.low_m[c] && tets->x[3 * i + c] <= to.high_m[c];
        }
        if (any) out[n++] = to;
    }
    return n;
}

void pal_surface_supports_move(pal_ground *ground, const pal_problem *problem, double share)
{
    for (int i = 0; i < ground->n; i++)
        pal_scale3(ground->item[i].move_m, share, problem->support[ground->item[i].support].move_m);
}
