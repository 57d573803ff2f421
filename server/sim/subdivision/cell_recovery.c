/* Regions of inverted elements (cell_kernel.h, "recovery from inversion"). */

#include "server/base/vec3.h"
#include "server/num/union_find.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/subdivision/cell_kernel.h"
#include "server/sim/subdivision/tuning.h"

#include <math.h>
#include <string.h>

enum { EDGES_MAX = 12 };

/* ---- load ---- */

pal_err pal_cell_recovery_make(const pal_subdivision_solid *solid, pal_arena *arena, pal_cell_recovery *out)
{
    *out = (pal_cell_recovery){.n_node = solid->rows.n_row};
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        out->first[kind] = out->n_cell, out->n_cell += solid->elements.n[kind];
    const size_t n = (size_t)out->n_cell;
    out->k_N_m = PAL_NEW(arena, double, n);
    out->shear_J = PAL_NEW(arena, double, n);
    out->ratio[0] = PAL_NEW(arena, double, n);
    out->ratio[1] = PAL_NEW(arena, double, n);
    out->element_J = PAL_NEW(arena, double, n);
    out->region = PAL_NEW(arena, int32_t, n);
    out->before = PAL_NEW(arena, int32_t, n);
    out->root = PAL_NEW(arena, int32_t, out->n_node);
    out->of = PAL_NEW(arena, pal_inverted_region, n);
    out->old = PAL_NEW(arena, pal_inverted_region, n);
    out->edge = PAL_NEW(arena, pal_region_edge, EDGES_MAX * n);
    bool all = out->k_N_m && out->shear_J && out->ratio[0] && out->ratio[1] && out->element_J && out->region &&
               out->before && out->root && out->of && out->old && out->edge;
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_cell_kind kind_of(const pal_cell_recovery *t, int cell, int *element)
{
    pal_cell_kind kind = cell >= t->first[PAL_CELL_PYRAMID] ? PAL_CELL_PYRAMID
                         : cell >= t->first[PAL_CELL_HEX]   ? PAL_CELL_HEX
                                                            : PAL_CELL_CUBIC;
    *element = cell - t->first[kind];
    return kind;
}

/* nodes of the cell itself: 8, or 5 of a pyramid; returns how many */
static int corners(const pal_cell_recovery *t, const pal_subdivision_solid *solid, int cell, int32_t out[8])
{
    static const int own[8] = {21, 22, 25, 26, 37, 38, 41, 42}; /* of the 64 of a cubic element */
    int e, n = 8;
    const pal_cell_kind kind = kind_of(t, cell, &e);
    const int32_t *node = pal_subdivision_solid_nodes(solid, kind, e);
    if (kind == PAL_CELL_PYRAMID) n = PAL_PYRAMID_NODES;
    for (int c = 0; c < n; c++) out[c] = node[kind == PAL_CELL_CUBIC ? own[c] : c];
    return n;
}

/* both nodes of each edge; returns how many there are */
static int edges(const pal_cell_recovery *t, const pal_subdivision_solid *solid, int cell, int32_t out[EDGES_MAX][2])
{
    int32_t node[8];
    int n = corners(t, solid, cell, node), k = 0;
    for (int a = 0; a < n; a++)
        for (int b = a + 1; b < n; b++) {
            const int apart = a ^ b;
            const bool edge = n == 8 ? apart == 1 || apart == 2 || apart == 4 : b == 4 || b == a + 1 || b == a + 3;
            if (edge) out[k][0] = node[a], out[k++][1] = node[b];
        }
    return k;
}

void pal_cell_recovery_refresh(pal_cell_recovery *t, const pal_cells_elastic *c)
{
    const pal_subdivision_solid *solid = c->solid;
    for (int cell = 0; cell < t->n_cell; cell++) {
        int e, n;
        int32_t edge[EDGES_MAX][2];
        const pal_cell_kind kind = kind_of(t, cell, &e);
        double sum = 0, square = 0;
        for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
            double mu, lambda;
            pal_cell_lame(solid, kind, e, p, &mu, &lambda);
            sum += mu * solid->samples[kind].volume_m3[e * PAL_CELL_GAUSS_POINTS + p];
        }
        n = edges(t, solid, cell, edge);
        for (int i = 0; i < n; i++)
            square +=
                pow(pal_dist3(solid->node_rest + 3 * (size_t)edge[i][0], solid->node_rest + 3 * (size_t)edge[i][1]), 2);
        t->k_N_m[cell] = 3 * sum / square;
        t->shear_J[cell] = sum;
    }
}

/* the regions are known: which elements act, and the edges of the others */
static void show(pal_cell_recovery *t, pal_cells_elastic *c)
{
    t->n_edge = 0;
    for (int cell = 0; cell < t->n_cell; cell++) {
        int e;
        int32_t edge[EDGES_MAX][2];
        const int region = t->region[cell];
        const pal_cell_kind kind = kind_of(t, cell, &e);
        c->group[kind].here[e] = region < 0;
        for (int i = region < 0 ? -1 : edges(t, c->solid, cell, edge) - 1; i >= 0; i--)
            t->edge[t->n_edge++] = (pal_region_edge){{edge[i][0], edge[i][1]}, region, cell};
    }
}

void pal_cell_recovery_reset(pal_cell_recovery *t, pal_cells_elastic *c)
{
    for (int cell = 0; cell < t->n_cell; cell++) t->region[cell] = -1;
    t->n_region = t->n_recovering = 0;
    t->n_inversion = t->n_change = 0;
    show(t, c);
}

/* ---- regions ---- */

static double edge_N_m(const void *self, int cell)
{
    return ((const pal_cell_recovery *)self)->k_N_m[cell];
}

double pal_cell_recovery_force(pal_cell_recovery *t, const pal_subdivision_solid *solid, const double *d, double *f)
{
    const pal_region_edges in_regions = {t->n_edge, t->edge, edge_N_m, t, solid->node_rest};
    pal_regions_fit(t->of, t->n_region, &in_regions, d);
    return pal_regions_energy(t->of, t->n_region, &in_regions, d, NULL, 0, f);
}

void pal_cell_recovery_multiply(const pal_cell_recovery *t, double k, const double *p, double *out)
{
    for (int i = 0; i < t->n_edge; i++) {
        const pal_region_edge *e = &t->edge[i];
        const size_t from = 3 * (size_t)e->end[0], to = 3 * (size_t)e->end[1];
        const double by = k * t->of[e->region].scale * t->k_N_m[e->owner];
        double x[3];
        pal_sub3(x, p + to, p + from);
        pal_axpy3(out + from, -by, x), pal_axpy3(out + to, by, x);
    }
}

/* ---- detection ---- */

static bool is_bad(const pal_cell_recovery *t, int cell)
{
    return t->ratio[0][cell] < PAL_INVERTED_LOW || t->ratio[1][cell] > PAL_INVERTED_HIGH;
}
static bool is_good(const pal_cell_recovery *t, int cell)
{
    return t->ratio[0][cell] > PAL_RECOVERED_LOW && t->ratio[1][cell] < PAL_RECOVERED_HIGH;
}

/* energies of the regions and of their elements at d */
static void weigh(pal_cell_recovery *t, const pal_cells_elastic *c, const double *d)
{
    for (int p = 0; p < t->n_region; p++) {
        pal_inverted_region *region = &t->of[p];
        region->region_J = region->element_J = region->size_J = 0, region->bad = false, region->n = 0;
    }
    (void)pal_cell_recovery_force(t, c->solid, d, NULL);
    for (int cell = 0; cell < t->n_cell; cell++) {
        if (t->region[cell] < 0) continue;
        pal_inverted_region *region = &t->of[t->region[cell]];
        region->element_J += t->element_J[cell];
        region->size_J += t->shear_J[cell];
        region->bad |= !is_good(t, cell);
        region->n++;
    }
}

/* energy of the body's motion and elements; the energies of regions are known */
static double whole(const pal_cell_recovery *t, double kinetic_J)
{
    double sum = kinetic_J + pal_regions_sum_J(t->of, t->n_region);
    for (int cell = 0; cell < t->n_cell; cell++)
        if (t->region[cell] < 0) sum += t->element_J[cell];
    return sum;
}

enum { NOT = -1, NEW = -2 };

/* inverted elements enter with their neighbours, and so do the neighbours of regions that do not recover, but not under
 * a lasting load: the load inverts them, and larger regions are softer. True: any */
static bool enter(pal_cell_recovery *t, const pal_subdivision_solid *solid, bool loaded)
{
    bool any = false;
    memset(t->root, 0, sizeof *t->root * (size_t)t->n_node);
    for (int p = 0; p < t->n_region; p++) t->of[p].bad = pal_region_grows(&t->of[p], loaded);
    for (int cell = 0; cell < t->n_cell; cell++) {
        int32_t node[8];
        if (t->region[cell] >= 0 ? !t->of[t->region[cell]].bad : !is_bad(t, cell)) continue;
        for (int k = corners(t, solid, cell, node) - 1; k >= 0; k--) t->root[node[k]] = 1;
    }
    for (int cell = 0; cell < t->n_cell; cell++) {
        int32_t node[8];
        bool beside = false;
        if (t->region[cell] >= 0) continue;
        for (int k = corners(t, solid, cell, node) - 1; k >= 0; k--) beside |= t->root[node[k]];
        if (beside) t->region[cell] = NEW;
        any |= beside;
    }
    return any;
}

/* the elements that share the volume of a control cell enter a region together */
static void enter_whole_cells(pal_cell_recovery *t, const pal_cells_elastic *c)
{
    /* sums and pushes are computed before each use */
    double *mark = c->volume.push;
    memset(mark, 0, sizeof *mark * (size_t)c->volume.n);
    for (int pass = 0; pass < 2; pass++)
        for (int cell = 0; cell < t->n_cell; cell++) {
            int e;
            const pal_cell_kind kind = kind_of(t, cell, &e);
            const int32_t home = c->group[kind].home[e];
            if (pass == 0 && t->region[cell] != NOT) mark[home] = 1;
            if (pass == 1 && t->region[cell] == NOT && mark[home] > 0) t->region[cell] = NEW;
        }
}

/* numbers the regions of elements connected by nodes */
static void number(pal_cell_recovery *t, const pal_subdivision_solid *solid)
{
    int32_t node[8];
    pal_union_find_init(t->root, t->n_node);
    for (int cell = 0; cell < t->n_cell; cell++) {
        if (t->region[cell] == NOT) continue;
        for (int k = corners(t, solid, cell, node) - 1; k > 0; k--) pal_union_find_join(t->root, node[0], node[k]);
    }
    for (int i = 0; i < t->n_node; i++) t->root[i] = pal_union_find_root(t->root, i);
    t->n_region = t->n_recovering = 0;
    /* roots are the least nodes of their regions: -1 - number once they have one */
    for (int cell = 0; cell < t->n_cell; cell++) {
        if (t->region[cell] == NOT) continue;
        corners(t, solid, cell, node);
        int at = t->root[node[0]] >= 0 ? t->root[node[0]] : node[0];
        if (t->root[at] >= 0) {
            t->of[t->n_region] = (pal_inverted_region){.scale = 1};
            t->root[at] = -1 - t->n_region++;
        }
        t->region[cell] = -1 - t->root[at];
        t->n_recovering++;
    }
}

/* chooses G and s of changed regions */
static void begin(pal_cell_recovery *t, pal_cells_elastic *c, const pal_body *body)
{
    for (int cell = 0; cell < t->n_cell; cell++)
        if (t->region[cell] >= 0) t->of[t->region[cell]].n++;
    pal_regions_fix(t->of, t->n_region, body, t->n_cell);
    weigh(t, c, body->d);
    for (int p = 0; p < t->n_region; p++) t->of[p].element_J = 0;
    for (int cell = 0; cell < t->n_cell; cell++) {
        if (t->region[cell] < 0) continue;
        const int was = t->before[cell];
        /* an old region's share by its elements' number: only the sum matters, and an old region never parts */
        t->of[t->region[cell]].element_J += was >= 0 ? t->old[was].region_J / t->old[was].n : t->element_J[cell];
    }
    for (int p = 0; p < t->n_region; p++) {
        pal_inverted_region *region = &t->of[p];
        if (region->region_J > region->element_J)
            region->scale = fmax(PAL_FILL_MIN, region->element_J / region->region_J);
        region->region_J *= region->scale;
    }
}

/* tissue under a lasting load would hang by a region that began soft, and be drawn out by 1 / s: s returns to 1. True:
 * one has changed */
static bool stiffen(pal_cell_recovery *t, double passed_s)
{
    bool any = false;
    for (int p = 0; p < t->n_region; p++) {
        pal_inverted_region *region = &t->of[p];
        if (region->scale >= 1 ||
            floor(region->grow_s / PAL_CELL_STIFFEN_S) <= floor((region->grow_s - passed_s) / PAL_CELL_STIFFEN_S))
            continue;
        region->scale = fmin(1, PAL_CELL_STIFFEN_FACTOR * region->scale);
        t->stiffened_J += PAL_CELL_STIFFEN_FACTOR * region->region_J;
        any = true;
    }
    return any;
}

bool pal_cell_recovery_update(pal_cell_recovery *t, pal_cells_elastic *c, const pal_body *body, double time_s,
                              bool loaded)
{
    bool bad = t->n_region > 0;
    const double passed_s = fmax(0, time_s - t->time_s);
    t->time_s = time_s;
    t->stiffened_J = 0;
    pal_cells_elastic_ratios(c, body->d);
    for (int cell = 0; cell < t->n_cell; cell++) bad |= is_bad(t, cell);
    if (!bad) return false;
    t->n_inversion++;
    t->weighs = true;
    (void)pal_cells_elastic_energy(c, body->d, NULL);
    t->weighs = false;
    for (int cell = 0; cell < t->n_cell; cell++) {
        int e;
        const pal_cell_kind kind = kind_of(t, cell, &e);
        t->element_J[cell] = c->group[kind].energy_J[e];
    }
    weigh(t, c, body->d);
    memcpy(t->old, t->of, sizeof *t->of * (size_t)t->n_region);
    const bool first = t->n_region == 0;
    const double kinetic_J = pal_body_kinetic_J(body), rest_J = PAL_REST_SHARE * pal_regions_sum_J(t->of, t->n_region);
    /* forces of operator edges have no energy, and it adds energy to larger motions */
    const double max_share = c->op == PAL_CELL_EDGES ? PAL_REST_SHARE : PAL_REGION_LEAVE_SHARE;
    t->at_rest = kinetic_J < rest_J;
    for (int p = 0; p < t->n_region; p++) t->of[p].kinetic_J = kinetic_J;
    bool changed = pal_regions_leave(t->of, t->n_region, first ? 0 : t->first_J - whole(t, kinetic_J), max_share,
                                     INFINITY, rest_J, passed_s);
    for (int cell = 0; cell < t->n_cell && changed; cell++)
        if (t->region[cell] >= 0 && t->of[t->region[cell]].n == 0) t->region[cell] = NOT;
    memcpy(t->before, t->region, sizeof *t->region * (size_t)t->n_cell);
    changed |= enter(t, c->solid, loaded);
    if (changed && c->volume.n > 0) enter_whole_cells(t, c);
    if (!changed) return loaded && stiffen(t, passed_s);
    number(t, c->solid);
    show(t, c);
    begin(t, c, body);
    if (first) t->first_J = whole(t, kinetic_J);
    t->n_change++;
    return true;
}
