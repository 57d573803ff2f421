/* Triangle surfaces: memory, measures, fans, edge-connected components and the topology report.
 *
 * Edges are found without hashing: every directed edge goes into the row of its smaller corner, and each row is sorted
 * by the larger corner, so that equal edges lie side by side. */
#include "server/mesh/geometry/surface.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/num/sort.h"
#include "server/num/union_find.h"

void pal_surface_free(pal_surface *surface)
{
    PAL_FREE(surface->x, surface->tri, surface->image_at);
    memset(surface, 0, sizeof *surface);
}

pal_err pal_surface_copy(const pal_surface *from, pal_surface *to)
{
    pal_surface copy = *from;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, copy.x, 3 * (size_t)from->n_vertex);
    PAL_ARRAY(&err, copy.tri, 3 * (size_t)from->n_tri);
    if (from->image_at) PAL_ARRAY(&err, copy.image_at, 9 * (size_t)from->n_tri);
    if (!err && from->image_at) memcpy(copy.image_at, from->image_at, 9 * (size_t)from->n_tri * sizeof *copy.image_at);
    if (!err && from->n_vertex) memcpy(copy.x, from->x, 3 * (size_t)from->n_vertex * sizeof *copy.x);
    if (!err && from->n_tri) memcpy(copy.tri, from->tri, 3 * (size_t)from->n_tri * sizeof *copy.tri);
    if (err)
        pal_surface_free(&copy);
    else
        *to = copy;
    return err;
}

void pal_surface_box(const pal_surface *surface, double low_m[3], double high_m[3])
{
    const double *x = surface->x, zero[3] = {0, 0, 0};
    pal_copy3(low_m, surface->n_vertex ? x : zero);
    pal_copy3(high_m, low_m);
    for (size_t i = 1; i < (size_t)surface->n_vertex; i++) pal_box3_add(low_m, high_m, x + 3 * i);
}

void pal_surface_recentre(pal_surface *surface)
{
    double low[3], high[3];
    pal_surface_box(surface, low, high);
    for (size_t a = 0; a < 3; a++) {
        double middle = (low[a] + high[a]) / 2;
        for (size_t i = 0; i < (size_t)surface->n_vertex; i++) surface->x[3 * i + a] -= middle;
        surface->origin_m[a] += middle;
    }
}

/* twice the area vector of a triangle */
static void area_vector(const pal_surface *surface, int t, double r[3])
{
    const int32_t *c = surface->tri + 3 * (size_t)t;
    const double *a = surface->x + 3 * (size_t)c[0];
    pal_normal3(r, a, surface->x + 3 * (size_t)c[1], surface->x + 3 * (size_t)c[2]);
}

double pal_surface_area(const pal_surface *surface)
{
    double sum = 0;
    for (int t = 0; t < surface->n_tri; t++) {
        double n[3];
        area_vector(surface, t, n);
        sum += pal_norm3(n);
    }
    return sum / 2;
}

double pal_surface_volume(const pal_surface *surface)
{
    double sum = 0;
    for (int t = 0; t < surface->n_tri; t++) {
        double n[3];
        area_vector(surface, t, n);
        sum += pal_dot3(n, surface->x + 3 * (size_t)surface->tri[3 * (size_t)t]);
    }
    return sum / 6;
}

void pal_surface_normals(const pal_surface *surface, double *normal)
{
    for (size_t i = 0; i < 3 * (size_t)surface->n_vertex; i++) normal[i] = 0;
    for (int t = 0; t < surface->n_tri; t++) {
        double n[3];
        area_vector(surface, t, n);
        for (size_t k = 0; k < 3; k++) {
            double *sum = normal + 3 * (size_t)surface->tri[3 * (size_t)t + k];
            pal_add3(sum, sum, n);
        }
    }
    for (int i = 0; i < surface->n_vertex; i++) {
        double *n = normal + 3 * (size_t)i;
        if (!pal_unit3(n, n, 0)) pal_set3(n, 0, 0, 0);
    }
}

void pal_surface_drop_unused(pal_surface *s, int32_t *map)
{
    int n = 0;
    for (int i = 0; i < s->n_vertex; i++) map[i] = -1;
    for (size_t c = 0; c < 3 * (size_t)s->n_tri; c++) map[s->tri[c]] = 0;
    for (int i = 0; i < s->n_vertex; i++) {
        if (map[i] < 0) continue;
        map[i] = n;
        pal_copy3(s->x + 3 * (size_t)n++, s->x + 3 * (size_t)i);
    }
    s->n_vertex = n;
    PAL_FREE(s->image_at);
    s->image_at = NULL;
    for (size_t c = 0; c < 3 * (size_t)s->n_tri; c++) s->tri[c] = map[s->tri[c]];
}

pal_err pal_surface_fans(const pal_surface *surface, int32_t **start, int32_t **item)
{
    size_t n_vertex = (size_t)surface->n_vertex, n_corner = 3 * (size_t)surface->n_tri;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, *start, n_vertex + 2);
    PAL_ARRAY(&err, *item, n_corner);
    if (err) return PAL_FREED(err, *start, *item);
    int32_t *row = *start;
    /* counts are shifted by two entries, so that filling leaves each row's start in place */
    for (size_t c = 0; c < n_corner; c++) row[surface->tri[c] + 2]++;
    for (size_t i = 2; i < n_vertex + 2; i++) row[i] += row[i - 1];
    for (size_t c = 0; c < n_corner; c++) (*item)[row[surface->tri[c] + 1]++] = (int32_t)(c / 3);
    return PAL_ERR_OK;
}

static int side_order(const void *a, const void *b)
{
    const pal_surface_side *s = a, *t = b;
    return s->high != t->high ? PAL_COMPARE(s->high, t->high) : PAL_COMPARE(s->corner, t->corner);
}

PAL_SORT(sort_sides, pal_surface_side, side_order)

static int32_t corner_next(int32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

pal_err pal_surface_sides(const pal_surface *surface, int32_t **start, pal_surface_side **side)
{
    size_t n_vertex = (size_t)surface->n_vertex, n_corner = 3 * (size_t)surface->n_tri;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, *start, n_vertex + 2);
    PAL_ARRAY(&err, *side, n_corner);
    if (err) return PAL_FREED(err, *start, *side);
    int32_t *row = *start;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t c = 0; c < n_corner; c++) {
            int32_t a = surface->tri[c], b = surface->tri[corner_next((int32_t)c)];
            int32_t low = a < b ? a : b, high = a < b ? b : a;
            if (pass == 0)
                row[low + 2]++;
            else
                (*side)[row[low + 1]++] = (pal_surface_side){high, (int32_t)c};
        }
        for (size_t i = 2; pass == 0 && i < n_vertex + 2; i++) row[i] += row[i - 1];
    }
    for (size_t i = 0; i < n_vertex; i++) sort_sides(*side + row[i], (size_t)(row[i + 1] - row[i]));
    return PAL_ERR_OK;
}

pal_err pal_surface_components(const pal_surface *surface, int32_t *label, int *n_component)
{
    int32_t *row;
    pal_surface_side *sides;
    PAL_TRY(pal_surface_sides(surface, &row, &sides));
    pal_union_find_init(label, surface->n_tri);
    for (int i = 0; i < surface->n_vertex; i++)
        for (int k = row[i] + 1; k < row[i + 1]; k++)
            if (sides[k].high == sides[k - 1].high)
                pal_union_find_join(label, sides[k].corner / 3, sides[k - 1].corner / 3);
    PAL_FREE(row, sides);
    *n_component = pal_union_find_label(label, surface->n_tri);
    return PAL_ERR_OK;
}

/* joins the corners that two triangles have at the two ends of their common edge */
static void unite_corners(const pal_surface *surface, int32_t *parent, int32_t one, int32_t other)
{
    int32_t a = one, b = corner_next(one), c = other, d = corner_next(other);
    if (surface->tri[a] != surface->tri[c]) {
        c = d;
        d = other;
    }
    pal_union_find_join(parent, a, c);
    pal_union_find_join(parent, b, d);
}

pal_err pal_surface_check(const pal_surface *surface, pal_surface_topology *out)
{
    int32_t *row, *parent, n_corner = 3 * surface->n_tri;
    pal_surface_side *sides;
    pal_err err = pal_surface_sides(surface, &row, &sides);
    if (err) return err;
    PAL_ARRAY(&err, parent, n_corner);
    if (err) return PAL_FREED(err, row, sides);
    pal_surface_topology found = {0};
    pal_union_find_init(parent, n_corner);
    for (int i = 0; i < surface->n_vertex; i++)
        for (int k = row[i], end = k; k < row[i + 1]; k = end) {
            int n_up = 0;
            for (; end < row[i + 1] && sides[end].high == sides[k].high; end++) {
                n_up += surface->tri[sides[end].corner] == i;
                if (end > k) unite_corners(surface, parent, sides[k].corner, sides[end].corner);
            }
            found.n_open_edge += end - k == 1;
            found.n_nonmanifold_edge += end - k > 2;
            found.n_misoriented_edge += end - k == 2 && n_up != 1;
        }
    /* a vertex with k fans has k roots among its corners */
    for (int i = 0; i < surface->n_vertex; i++) row[i] = 0;
    for (int32_t c = 0; c < n_corner; c++)
        if (parent[c] == c) found.n_nonmanifold_vertex += ++row[surface->tri[c]] == 2;
    PAL_FREE(row, sides, parent);
    found.closed = surface->n_tri > 0 && found.n_open_edge == 0;
    found.manifold = found.n_nonmanifold_edge == 0 && found.n_nonmanifold_vertex == 0;
    found.oriented = found.n_misoriented_edge == 0;
    *out = found;
    return PAL_ERR_OK;
}
