/* Mass matrices of subdivided solids. In an element a control point has the shape function G A at the Gauss points, so
 * that M~ = sum over points p of s_p W_p' W_p, s the mass at p: elements are never multiplied out node by node. */
#include "server/sim/subdivision/subdivision_mass.h"

#include "server/num/conjugate_gradient.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* shape functions of the nodes of one kind of element at its Gauss points, [node][point] */
typedef struct kind_table {
    int n_node;
    double n[PAL_CELL_MAX_NODES][PAL_CELL_GAUSS_POINTS];
} kind_table;

static void fill_table(kind_table *t, pal_cell_kind kind)
{
    t->n_node = pal_cell_kind_nodes(kind);
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double at[3], n[PAL_CELL_MAX_NODES];
        pal_cell_gauss_point(p, at);
        pal_cell_shape(t->n_node, at, n, NULL);
        for (int m = 0; m < t->n_node; m++) t->n[m][p] = n[m];
    }
}

/* mass at the Gauss points of an element, kg, and damping there, kg/s */
static void sample_masses(const pal_subdivision_solid *solid, pal_cell_kind kind, int element,
                          double mass[PAL_CELL_GAUSS_POINTS], double damping[PAL_CELL_GAUSS_POINTS])
{
    const pal_material_samples *s = &solid->samples[kind];
    const size_t first = (size_t)element * PAL_CELL_GAUSS_POINTS;
    for (size_t p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        mass[p] = s->volume_m3[first + p] * (double)s->density_kg_m3[first + p];
        damping[p] = mass[p] * (double)s->damping_1_s[first + p];
    }
}

/* ---- the pattern ---- */

/* points of an element's nodes, each once, into list; local [n_point] is -1 for all others else the place in it */
static int gather_points(const pal_subdivision_solid *solid, pal_cell_kind kind, int element, int32_t *list,
                         int32_t *local)
{
    const int32_t *node = pal_subdivision_solid_nodes(solid, kind, element);
    const pal_interpolation *rows = &solid->rows;
    int n = 0;
    for (int m = 0; m < pal_cell_kind_nodes(kind); m++)
        for (int32_t k = rows->start[node[m]]; k < rows->start[node[m] + 1]; k++) {
            int32_t point = rows->point[k];
            if (local[point] < 0) local[point] = n, list[n++] = point;
        }
    return n;
}

static void clear_local(int n, const int32_t *list, int32_t *local)
{
    for (int i = 0; i < n; i++) local[list[i]] = -1;
}

/* lists of points by element, for the time of loading */
typedef struct element_points {
    int64_t n_finest;
    int n_element, max;
    int64_t *start; /* [n_element + 1] */
    int32_t *point; /* [n_finest]         */
} element_points;

static pal_err list_points(const pal_subdivision_solid *solid, int32_t *list, int32_t *local, element_points *out)
{
    int64_t capacity = 0;
    out->start = calloc((size_t)pal_cell_elements_count(&solid->elements) + 1, sizeof *out->start);
    if (!out->start) return PAL_ERR_MEMORY;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int e = 0; e < solid->elements.n[kind]; e++) {
            int n = gather_points(solid, kind, e, list, local);
            clear_local(n, list, local);
            if (out->n_finest + n > capacity) {
                capacity = 2 * (out->n_finest + n);
                int32_t *point = realloc(out->point, (size_t)capacity * sizeof *point);
                if (!point) return PAL_ERR_MEMORY;
                out->point = point;
            }
            memcpy(out->point + out->n_finest, list, (size_t)n * sizeof *list);
            out->start[++out->n_element] = out->n_finest += n;
            if (n > out->max) out->max = n;
        }
    return PAL_ERR_OK;
}

static int ascending(const void *a, const void *b)
{
    int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
    return (i > j) - (i < j);
}

/* elements of every point: element[start[i]] .. element[start[i + 1] - 1] */
static void invert_lists(const element_points *from, int n_point, int64_t *start, int32_t *element)
{
    for (int64_t k = 0; k < from->n_finest; k++) start[from->point[k] + 1]++;
    for (int i = 0; i < n_point; i++) start[i + 1] += start[i];
    for (int e = from->n_element; e-- > 0;)
        for (int64_t k = from->start[e]; k < from->start[e + 1]; k++) element[--start[from->point[k] + 1]] = e;
    /* every start has moved to that of its own row, which is one entry too far */
    for (int i = 0; i < n_point; i++) start[i] = start[i + 1];
    start[n_point] = from->n_finest;
}

/* points that share an element with point i, ascending */
static int couple(const element_points *of, const int64_t *start, const int32_t *element, int32_t i, int32_t *list,
                  int32_t *local)
{
    int n = 0;
    for (int64_t s = start[i]; s < start[i + 1]; s++)
        for (int64_t k = of->start[element[s]]; k < of->start[element[s] + 1]; k++) {
            int32_t point = of->point[k];
            if (local[point] < 0) local[point] = n, list[n++] = point;
        }
    clear_local(n, list, local);
    qsort(list, (size_t)n, sizeof *list, ascending);
    return n;
}

static pal_err make_pattern(const element_points *of, int32_t *list, pal_arena *arena, pal_mass_operator *out)
{
    const int n_point = out->n_point;
    int64_t *start = calloc((size_t)n_point + 2, sizeof *start), n_entry = 0;
    int32_t *element = malloc((size_t)of->n_finest * sizeof *element + 1);
    pal_err err = start && element ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) invert_lists(of, n_point, start, element);
    for (int i = 0; i < n_point && !err; i++) n_entry += couple(of, start, element, i, list, out->local);
    if (n_entry > INT32_MAX) err = PAL_ERR_MEMORY;
    out->n_entry = err ? 0 : (int)n_entry;
    out->point = err ? NULL : PAL_NEW(arena, int32_t, n_entry);
    if (!out->point) err = PAL_ERR_MEMORY;
    for (int i = 0; i < n_point && !err; i++) {
        int n = couple(of, start, element, i, list, out->local);
        memcpy(out->point + out->start[i], list, (size_t)n * sizeof *list);
        out->start[i + 1] = out->start[i] + n;
    }
    free(start), free(element);
    return err;
}

pal_err pal_subdivision_mass_make(const pal_subdivision_solid *solid, pal_arena *arena, pal_mass_operator *out)
{
    const int n_point = solid->rows.n_point;
    element_points of = {0};
    int32_t *list = malloc((size_t)n_point * sizeof *list + 1);
    *out = (pal_mass_operator){.n_point = n_point};
    out->start = PAL_NEW(arena, int32_t, n_point + 1);
    out->local = PAL_NEW(arena, int32_t, n_point);
    pal_err err = list && out->start && out->local ? PAL_ERR_OK : PAL_ERR_MEMORY;
    for (int i = 0; i < n_point && !err; i++) out->local[i] = -1;
    if (!err) err = list_points(solid, list, out->local, &of);
    if (!err) err = make_pattern(&of, list, arena, out);
    out->n_max = of.max;
    free(of.start), free(of.point), free(list);
    PAL_TRY(err);
    out->element_point = PAL_NEW(arena, int32_t, out->n_max);
    out->shape = PAL_NEW(arena, double, (size_t)out->n_max *PAL_CELL_GAUSS_POINTS);
    out->mass_kg = PAL_NEW(arena, double, out->n_entry);
    out->scratch_kg_s = PAL_NEW(arena, double, out->n_entry);
    if (!out->element_point || !out->shape || !out->mass_kg || !out->scratch_kg_s) return PAL_ERR_MEMORY;
    pal_subdivision_mass_fill(solid, out);
    return PAL_ERR_OK;
}

/* ---- the values ---- */

/* the points' shape functions at the Gauss points of an element; returns how many points */
static int find_shapes(const pal_subdivision_solid *solid, const kind_table *t, pal_cell_kind kind, int element,
                       pal_mass_operator *mass)
{
    const int32_t *node = pal_subdivision_solid_nodes(solid, kind, element);
    const pal_interpolation *rows = &solid->rows;
    int n = gather_points(solid, kind, element, mass->element_point, mass->local);
    memset(mass->shape, 0, (size_t)n * PAL_CELL_GAUSS_POINTS * sizeof *mass->shape);
    for (int m = 0; m < t->n_node; m++)
        for (int32_t k = rows->start[node[m]]; k < rows->start[node[m] + 1]; k++) {
            double *restrict to = mass->shape + (size_t)mass->local[rows->point[k]] * PAL_CELL_GAUSS_POINTS;
            const double weight = rows->weight[k], *restrict from = t->n[m];
            for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) to[p] += weight * from[p];
        }
    return n;
}

/* adds the shapes' products to the upper half of the rows of the element's points */
static void add_products(const pal_mass_operator *mass, int n, double *to)
{
    for (int a = 0; a < n; a++) {
        int32_t i = mass->element_point[a];
        const double *shape = mass->shape + (size_t)a * PAL_CELL_GAUSS_POINTS;
        for (int32_t k = mass->start[i + 1]; k-- > mass->start[i] && mass->point[k] >= i;) {
            int32_t b = mass->local[mass->point[k]];
            if (b >= 0)
                to[k] += pal_dot_product(PAL_CELL_GAUSS_POINTS, shape, mass->shape + (size_t)b * PAL_CELL_GAUSS_POINTS);
        }
    }
}

/* multiplies the shapes at the Gauss points by the root of the ratio */
static void scale_shapes(pal_mass_operator *mass, int n, const double *over, const double *under)
{
    double root[PAL_CELL_GAUSS_POINTS];
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double ratio = under ? (under[p] > 0 ? over[p] / under[p] : 0) : over[p];
        root[p] = sqrt(fmax(ratio, 0));
    }
    for (int a = 0; a < n; a++)
        for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++)
            mass->shape[(size_t)a * PAL_CELL_GAUSS_POINTS + (size_t)p] *= root[p];
}

/* the lower half from the upper: entries (j, i) of a row j come in the order of i */
static void mirror(pal_mass_operator *mass, double *value)
{
    int32_t *next = mass->local;
    for (int i = 0; i < mass->n_point; i++) next[i] = mass->start[i];
    for (int i = 0; i < mass->n_point; i++)
        for (int32_t k = mass->start[i]; k < mass->start[i + 1]; k++)
            if (mass->point[k] > i) value[next[mass->point[k]]++] = value[k];
    for (int i = 0; i < mass->n_point; i++) next[i] = -1;
}

/* gamma over mu: the same everywhere, or NaN, and the most of all */
static void find_damping(const pal_subdivision_solid *solid, pal_mass_operator *mass)
{
    double min = INFINITY, max = 0;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (size_t i = 0; i < (size_t)solid->elements.n[kind] * PAL_CELL_GAUSS_POINTS; i++) {
            min = fmin(min, (double)solid->samples[kind].damping_1_s[i]);
            max = fmax(max, (double)solid->samples[kind].damping_1_s[i]);
        }
    bool same = !(min < max);
    mass->damping_max_1_s = max;
    mass->damping_1_s = same ? max : NAN;
    mass->damping_kg_s = same ? NULL : mass->scratch_kg_s;
}

void pal_subdivision_mass_fill(const pal_subdivision_solid *solid, pal_mass_operator *mass)
{
    kind_table table;
    find_damping(solid, mass);
    memset(mass->mass_kg, 0, (size_t)mass->n_entry * sizeof *mass->mass_kg);
    memset(mass->scratch_kg_s, 0, (size_t)mass->n_entry * sizeof *mass->scratch_kg_s);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        fill_table(&table, kind);
        for (int e = 0; e < solid->elements.n[kind]; e++) {
            double at[PAL_CELL_GAUSS_POINTS], damping[PAL_CELL_GAUSS_POINTS];
            int n = find_shapes(solid, &table, kind, e, mass);
            sample_masses(solid, kind, e, at, damping);
            scale_shapes(mass, n, at, NULL);
            add_products(mass, n, mass->mass_kg);
            if (mass->damping_kg_s) {
                scale_shapes(mass, n, damping, at);
                add_products(mass, n, mass->damping_kg_s);
            }
            clear_local(n, mass->element_point, mass->local);
        }
    }
    mirror(mass, mass->mass_kg);
    if (mass->damping_kg_s) mirror(mass, mass->damping_kg_s);
}

void pal_subdivision_mass_lump(const pal_subdivision_solid *solid, double *point_kg, double *node_kg)
{
    const pal_interpolation *rows = &solid->rows;
    kind_table table;
    if (point_kg) memset(point_kg, 0, (size_t)rows->n_point * sizeof *point_kg);
    if (node_kg) memset(node_kg, 0, (size_t)rows->n_row * sizeof *node_kg);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        fill_table(&table, kind);
        for (int e = 0; e < solid->elements.n[kind]; e++) {
            const int32_t *node = pal_subdivision_solid_nodes(solid, kind, e);
            double at[PAL_CELL_GAUSS_POINTS], damping[PAL_CELL_GAUSS_POINTS];
            sample_masses(solid, kind, e, at, damping);
            for (int m = 0; m < table.n_node; m++) {
                double kg = pal_dot_product(PAL_CELL_GAUSS_POINTS, table.n[m], at);
                if (node_kg) node_kg[node[m]] += kg;
                for (int32_t k = rows->start[node[m]]; k < rows->start[node[m] + 1] && point_kg; k++)
                    point_kg[rows->point[k]] += rows->weight[k] * kg;
            }
        }
    }
}
