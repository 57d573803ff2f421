/* Triangle surfaces: memory, measures, fans, edge-connected components and the topology report.
 *
 * Edges are found without hashing: every directed edge goes into the row of its smaller corner, and each row is sorted
 * by the larger corner, so that equal edges lie side by side. */
#include "server/mesh/geometry/surface.h"

#include "server/base/vec3.h"
#include "server/num/union_find.h"

#include <stdlib.h>
#include <string.h>

void pal_surface_free(pal_surface *surface)
{
    free(surface->x);
    free(surface->tri);
    memset(surface, 0, sizeof *surface);
}

pal_err pal_surface_copy(const pal_surface *from, pal_surface *to)
{
    size_t x_size = 3 * (size_t)from->n_vertex * sizeof(double), tri_size = 3 * (size_t)from->n_tri * sizeof(int32_t);
    double *x = malloc(x_size + 1);
    int32_t *tri = malloc(tri_size + 1);
    if (!x || !tri) {
        free(x);
        free(tri);
        return PAL_ERR_MEMORY;
    }
    if (x_size) memcpy(x, from->x, x_size);
    if (tri_size) memcpy(tri, from->tri, tri_size);
    *to = *from;
    to->x = x;
    to->tri = tri;
    return PAL_ERR_OK;
}

void pal_surface_box(const pal_surface *surface, double low_m[3], double high_m[3])
{
    pal_set3(low_m, 0, 0, 0);
    pal_set3(high_m, 0, 0, 0);
    for (int i = 0; i < surface->n_vertex; i++)
        for (int a = 0; a < 3; a++) {
            double x = surface->x[3 * (size_t)i + (size_t)a];
            if (i == 0 || x < low_m[a]) low_m[a] = x;
            if (i == 0 || x > high_m[a]) high_m[a] = x;
        }
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
    double u[3], v[3];
    pal_sub3(u, surface->x + 3 * (size_t)c[1], a);
    pal_sub3(v, surface->x + 3 * (size_t)c[2], a);
    pal_cross3(r, u, v);
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

pal_err pal_surface_fans(const pal_surface *surface, int32_t **start, int32_t **item)
{
    size_t n_vertex = (size_t)surface->n_vertex, n_corner = 3 * (size_t)surface->n_tri;
    int32_t *row = calloc(n_vertex + 2, sizeof *row), *list = malloc((n_corner + 1) * sizeof *list);
    if (!row || !list) {
        free(row);
        free(list);
        return PAL_ERR_MEMORY;
    }
    /* counts are shifted by two entries, so that filling leaves each row's start in place */
    for (size_t c = 0; c < n_corner; c++) row[surface->tri[c] + 2]++;
    for (size_t i = 2; i < n_vertex + 2; i++) row[i] += row[i - 1];
    for (size_t c = 0; c < n_corner; c++) list[row[surface->tri[c] + 1]++] = (int32_t)(c / 3);
    *start = row;
    *item = list;
    return PAL_ERR_OK;
}

/* one side of a triangle in the row of its smaller corner */
typedef struct side {
    int32_t high, corner; /* larger corner; 3 t + k for the side from corner k to corner k + 1 of triangle t */
} side;

static int side_order(const void *a, const void *b)
{
    const side *s = a, *t = b;
    if (s->high != t->high) return s->high < t->high ? -1 : 1;
    return s->corner < t->corner ? -1 : s->corner > t->corner;
}

/* rows are short, except in hostile input */
static void sort_sides(side *s, int n)
{
    if (n > 32) {
        qsort(s, (size_t)n, sizeof *s, side_order);
        return;
    }
    for (int i = 1; i < n; i++) {
        side one = s[i];
        int j = i;
        for (; j > 0 && side_order(&one, &s[j - 1]) < 0; j--) s[j] = s[j - 1];
        s[j] = one;
    }
}

static int32_t corner_next(int32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

/* all sides, equal edges side by side: row [n_vertex + 2] (entry i to i + 1 is the row of vertex i), sides [3 n_tri] */
static pal_err sides_of(const pal_surface *surface, int32_t **row_out, side **sides_out)
{
    size_t n_vertex = (size_t)surface->n_vertex, n_corner = 3 * (size_t)surface->n_tri;
    int32_t *row = calloc(n_vertex + 2, sizeof *row);
    side *sides = malloc((n_corner + 1) * sizeof *sides);
    if (!row || !sides) {
        free(row);
        free(sides);
        return PAL_ERR_MEMORY;
    }
    for (int pass = 0; pass < 2; pass++) {
        for (size_t c = 0; c < n_corner; c++) {
            int32_t a = surface->tri[c], b = surface->tri[corner_next((int32_t)c)];
            int32_t low = a < b ? a : b, high = a < b ? b : a;
            if (pass == 0)
                row[low + 2]++;
            else
                sides[row[low + 1]++] = (side){high, (int32_t)c};
        }
        for (size_t i = 2; pass == 0 && i < n_vertex + 2; i++) row[i] += row[i - 1];
    }
    for (size_t i = 0; i < n_vertex; i++) sort_sides(sides + row[i], row[i + 1] - row[i]);
    *row_out = row;
    *sides_out = sides;
    return PAL_ERR_OK;
}

pal_err pal_surface_components(const pal_surface *surface, int32_t *label, int *n_component)
{
    int32_t *row;
    side *sides;
    PAL_TRY(sides_of(surface, &row, &sides));
    pal_union_find_init(label, surface->n_tri);
    for (int i = 0; i < surface->n_vertex; i++)
        for (int k = row[i] + 1; k < row[i + 1]; k++)
            if (sides[k].high == sides[k - 1].high)
                pal_union_find_join(label, sides[k].corner / 3, sides[k - 1].corner / 3);
    free(row);
    free(sides);
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
    int32_t *row, n_corner = 3 * surface->n_tri;
    side *sides;
    PAL_TRY(sides_of(surface, &row, &sides));
    int32_t *parent = malloc(((size_t)n_corner + 1) * sizeof *parent);
    if (!parent) {
        free(row);
        free(sides);
        return PAL_ERR_MEMORY;
    }
    pal_surface_topology found = {0};
    for (int32_t c = 0; c < n_corner; c++) parent[c] = c;
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
    free(row);
    free(sides);
    free(parent);
    found.closed = surface->n_tri > 0 && found.n_open_edge == 0;
    found.manifold = found.n_nonmanifold_edge == 0 && found.n_nonmanifold_vertex == 0;
    found.oriented = found.n_misoriented_edge == 0;
    *out = found;
    return PAL_ERR_OK;
}
