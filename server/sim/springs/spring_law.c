/* Spring constants from E, nu and the mesh. */
#include "server/sim/springs/spring_law.h"

#include "server/num/trilinear.h"

#include <stdlib.h>
#include <string.h>

void pal_spring_factors(double poisson, bool without_area, double factor[3])
{
    double nu = poisson < 0.26 ? 0.26 : poisson;
    double shear = 1 / (2 * (1 + nu)), bulk = 1 / (3 * (1 - 2 * nu));
    double share = without_area ? 0 : fmin(0.5, (bulk / shear - 5.0 / 3) / 10);
    factor[PAL_SPRING_DISTANCE] = (1 - share) * shear * 3 / 2;
    factor[PAL_SPRING_AREA] = share * shear * 9 / 4;
    factor[PAL_SPRING_VOLUME] = bulk - (5.0 / 3 + 5 * share) * shear;
}

static double derived_J(const pal_spring *spring, const pal_material *material, double edge_m)
{
    double factor[3];
    pal_spring_factors(material->poisson, spring->without_area, factor);
    return factor[spring->kind] * material->young_Pa * edge_m * edge_m * edge_m;
}

pal_err pal_spring_read(pal_spring_kind kind, pal_config_entry *item, const pal_build *build, pal_spring *out)
{
    bool on_grid = build->def->spring_grid.k_J[kind] != NULL, given = on_grid || pal_entry_has(item, "k_J");
    static const char *const weights[] = {"equal", "volume"};
    int by = given ? 0 : 1;
    *out = (pal_spring){.kind = kind, .given = given, .on_grid = on_grid};
    if (on_grid && pal_entry_has(item, "k_J"))
        return PAL_REFUSE(build->diag, "%s.k_J: stands beside a grid that gives the same", item->path);
    PAL_TRY(pal_entry_read_choice(item, "weights", weights, 2, &by, build->diag));
    out->by_volume = by == 1;
    PAL_TRY(pal_entry_read_bool(item, "without_area", &out->without_area, build->diag));
    out->k_J = on_grid ? 1 : derived_J(out, &build->def->material, build->body->edge_m);
    PAL_TRY(pal_entry_read_number(item, "k_J", 0, 1e60, &out->k_J, build->diag));
    PAL_TRY(pal_entry_read_number(item, "c_Js", 0, 1e60, &out->c_Js, build->diag));
    return pal_entry_check_unused(item, build->diag);
}

void pal_spring_material(pal_spring *spring, const pal_body *body, const pal_material *material)
{
    if (!spring->given) spring->k_J = derived_J(spring, material, body->edge_m);
}

static double inside_m3(const pal_body *body, int t)
{
    const double *x[PAL_CORNERS];
    pal_spring_points(body->tets->x, body->tets->tet + 4 * t, 4, x);
    return fabs(pal_spring_measure(PAL_SPRING_VOLUME, x)) / 6 * (body->fill ? (double)body->fill[t] : 1);
}

double pal_spring_volume_m3(const pal_body *body)
{
    double sum = 0;
    for (int t = 0; t < body->tets->n_tet; t++) sum += inside_m3(body, t);
    return sum;
}

/* a spring by its nodes in ascending order, to find it from the tetrahedra around it */
typedef struct known {
    int32_t node[4], item;
} known;

static int compare_known(const void *a, const void *b)
{
    return memcmp(a, b, sizeof((known *)0)->node);
}

static void set_known(known *k, const int32_t *node, int n)
{
    memset(k, 0, sizeof *k);
    for (int i = 0; i < n; i++) {
        int j = i;
        for (; j > 0 && k->node[j - 1] > node[i]; j--) k->node[j] = k->node[j - 1];
        k->node[j] = node[i];
    }
}

pal_err pal_spring_find_sides(const pal_tets *tets, const int32_t *item, int n_item, int n_corner, int32_t *of_tet)
{
    known *table = calloc((size_t)n_item + 1, sizeof *table);
    if (!table) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_item; i++) {
        set_known(&table[i], item + n_corner * i, n_corner);
        table[i].item = i;
    }
    qsort(table, (size_t)n_item, sizeof *table, compare_known);
    for (int t = 0; t < tets->n_tet; t++)
        for (unsigned set = 1; set < 16; set++) {
            if (__builtin_popcount(set) != n_corner) continue;
            int32_t node[4];
            int n = 0;
            for (int c = 0; c < 4; c++)
                if (set >> c & 1) node[n++] = tets->tet[4 * t + c];
            known key;
            set_known(&key, node, n_corner);
            const known *found = bsearch(&key, table, (size_t)n_item, sizeof key, compare_known);
            *of_tet++ = found ? found->item : -1;
        }
    free(table);
    return PAL_ERR_OK;
}

/* adds every tetrahedron's volume (fill [n_tet] of it, unless NULL) times share [n_tet] to its sides */
static void add_volumes(const pal_body *body, const double *share, const int32_t *of_tet, int n_side, double *out)
{
    for (int t = 0; t < body->tets->n_tet; t++) {
        double volume = inside_m3(body, t) * (share ? share[t] : 1);
        for (int c = 0; c < n_side; c++)
            if (of_tet[n_side * t + c] >= 0) out[of_tet[n_side * t + c]] += volume;
    }
}

static double mean_square_edge(const double *x, const int32_t *node, int n)
{
    double sum = 0;
    for (int a = 0; a < n; a++)
        for (int b = a + 1; b < n; b++) {
            double d = pal_dist3(x + 3 * node[a], x + 3 * node[b]);
            sum += d * d;
        }
    return 2 * sum / (n * (n - 1));
}

/* volumes around springs by their share -> out, over all of it where weights are equal */
static pal_err sum_volumes(const pal_spring *spring, const pal_body *body, const double *share, const int32_t *item,
                           int n_item, int n_corner, double *out)
{
    const int n_side = pal_spring_sides(spring->kind);
    int32_t *of_tet = malloc(sizeof *of_tet * ((size_t)n_side * (size_t)body->tets->n_tet + 1));
    double *all = spring->by_volume ? NULL : calloc((size_t)n_item + 1, sizeof *all);
    pal_err err = of_tet && (spring->by_volume || all)
                      ? pal_spring_find_sides(body->tets, item, n_item, n_corner, of_tet)
                      : PAL_ERR_MEMORY;
    if (!err) {
        memset(out, 0, sizeof *out * (size_t)n_item);
        add_volumes(body, share, of_tet, n_side, out);
        if (all) add_volumes(body, NULL, of_tet, n_side, all);
        for (int i = 0; i < n_item && all; i++) out[i] = all[i] > 0 ? out[i] / all[i] : 0;
    }
    free(of_tet), free(all);
    return err;
}

pal_err pal_spring_weights(const pal_spring *spring, const pal_body *body, const double *share, const int32_t *item,
                           int n_item, int n_corner, double *out)
{
    for (int i = 0; i < n_item; i++) out[i] = 1;
    if (!spring->by_volume && !share) return PAL_ERR_OK;
    PAL_TRY(sum_volumes(spring, body, share, item, n_item, n_corner, out));
    if (!spring->by_volume) return PAL_ERR_OK;
    double h = body->edge_m;
    for (int i = 0; i < n_item; i++) {
        double l2 = n_corner == 4 ? h * h : mean_square_edge(body->x_rest, item + n_corner * i, n_corner);
        out[i] *= l2 / (h * h * h * h * h);
    }
    return PAL_ERR_OK;
}

static double node_constant(const pal_spring_grid *g, pal_spring_kind kind, const double x[3])
{
    const pal_grid grid = {{g->n[0], g->n[1], g->n[2]},
                           {g->low_m[0], g->low_m[1], g->low_m[2]},
                           {g->high_m[0], g->high_m[1], g->high_m[2]}};
    return pal_trilinear_at(&grid, g->k_J[kind], x);
}

void pal_spring_nodes(const pal_spring_grid *grid, pal_spring_kind kind, const pal_body *body, double *out_J)
{
    for (int i = 0; i < body->n_node; i++) out_J[i] = node_constant(grid, kind, body->x_rest + 3 * (size_t)i);
}

void pal_spring_on_grid(pal_spring *spring, const pal_spring_grid *grid, const pal_body *body, const int32_t *item,
                        int n_item, int n_corner, double *weight)
{
    if (!spring->on_grid || n_item == 0) return;
    double mean_J = 0;
    for (int i = 0; i < n_item; i++) {
        double k_J = 0;
        for (int c = 0; c < n_corner; c++)
            k_J += node_constant(grid, spring->kind, body->x_rest + 3 * (size_t)item[n_corner * i + c]) / n_corner;
        weight[i] *= k_J;
        mean_J += k_J / n_item;
    }
    spring->c_Js /= mean_J;
}
