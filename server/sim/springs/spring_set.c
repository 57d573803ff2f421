/* Making a row of springs: constraints -> weights -> strips -> lanes. */
#include "server/sim/springs/spring_set.h"

#include "server/base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void corners_at(const double *x, const int32_t *node, int n, const double *to[PAL_CORNERS])
{
    for (int c = 0; c < PAL_CORNERS; c++) to[c] = x + 3 * node[c < n ? c : 0];
}

/* ---- regions ---- */

/* weights of the body's material as it is; those of regions keep what they give. What is off stays so until the next
 * look */
static void weigh(pal_spring_set *row, const pal_material *material)
{
    double *q = row->all ? row->all : row->q;
    double factor[3], young_Pa = material->young_Pa;
    pal_spring_factors(material->poisson, row->spring.without_area, factor);
    const double f = factor[row->spring.kind], over[4] = {1, 1 / young_Pa, 1 / f, 1 / (young_Pa * f)};
    for (int i = 0; i < row->simd_blocks.n_lane; i++) {
        q[i] = 0;
        for (int k = 0; k < 4; k++) q[i] += over[k] * row->part[k][i];
    }
    if (row->all) memcpy(row->q, q, sizeof *q * (size_t)row->simd_blocks.n_lane);
    for (int k = 0; row->all && k < row->n_off; k++) row->q[row->simd_blocks.place[row->off[k]]] = 0;
}

/* what each tetrahedron counts, by what its region gives: nothing, E, Poisson's ratio, both [4][n_tet]; false: all are
 * of the body's material */
static bool shares(const pal_spring_set *row, const pal_build *build, double *share)
{
    const pal_tets *tets = build->body->tets;
    bool any = false;
    for (int t = 0; t < tets->n_tet; t++) {
        double centre[3] = {0}, factor[3];
        pal_material at, base = build->def->material;
        base.young_Pa = base.poisson = NAN;
        for (int c = 0; c < 4; c++) pal_axpy3(centre, 0.25, tets->x + 3 * (size_t)tets->tet[4 * t + c]);
        pal_material_overlay(build->def, &base, centre, &at);
        bool young = !isnan(at.young_Pa), poisson = !isnan(at.poisson);
        if (poisson) pal_spring_factors(at.poisson, row->spring.without_area, factor);
        share[(young + 2 * poisson) * tets->n_tet + t] =
            (young ? at.young_Pa : 1) * (poisson ? factor[row->spring.kind] : 1);
        any = any || young || poisson;
    }
    return any;
}

/* weight [n_item]: room */
static pal_err take_regions(pal_spring_set *row, const pal_build *build, double *weight)
{
    const pal_body *body = build->body;
    size_t n_tet = (size_t)body->tets->n_tet, n_lane = (size_t)row->simd_blocks.n_lane;
    if (build->def->n_region == 0 || row->spring.given) return PAL_ERR_OK;
    double *share = calloc(4 * n_tet, sizeof *share);
    pal_err err = share ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err && shares(row, build, share)) {
        row->whole = PAL_NEW(build->arena, double, n_lane);
        if (row->whole) memcpy(row->whole, row->q, n_lane * sizeof *row->q);
        for (int k = 0; k < 4 && !err; k++) {
            row->part[k] = PAL_NEW(build->arena, double, n_lane);
            if (!row->part[k] || !row->whole)
                err = PAL_ERR_MEMORY;
            else
                err = pal_spring_weights(&row->spring, body, share + (size_t)k * n_tet, row->item, row->n_item,
                                         row->n_corner, weight);
            for (int i = 0; i < row->n_item && !err; i++) row->part[k][row->simd_blocks.place[i]] = weight[i];
        }
        if (!err) weigh(row, &build->def->material);
    }
    free(share);
    return err;
}

/* ---- making ---- */

static pal_err fill(pal_spring_set *row, const pal_build *build, double *weight)
{
    const pal_body *body = build->body;
    pal_arena *arena = build->arena;
    PAL_TRY(pal_simd_blocks_make(body->node_order, row->item, row->n_item, row->n_corner, arena, &row->simd_blocks));
    PAL_TRY(pal_spring_weights(&row->spring, body, NULL, row->item, row->n_item, row->n_corner, weight));
    pal_spring_on_grid(&row->spring, &build->def->spring_grid, body, row->item, row->n_item, row->n_corner, weight);
    row->w = PAL_NEW(arena, double, row->simd_blocks.n_lane);
    row->q = PAL_NEW(arena, double, row->simd_blocks.n_lane);
    if (!row->w || !row->q) return PAL_ERR_MEMORY;
    for (int i = 0; i < row->n_item; i++) {
        const double *x[PAL_CORNERS];
        corners_at(body->x_rest, row->item + row->n_corner * i, row->n_corner, x);
        row->w[row->simd_blocks.place[i]] = 1 / pal_spring_measure(row->spring.kind, x);
        row->q[row->simd_blocks.place[i]] = weight[i];
    }
    return take_regions(row, build, weight);
}

static pal_err keep_all(pal_spring_set *row, pal_arena *arena)
{
    row->all = PAL_NEW(arena, double, row->simd_blocks.n_lane);
    row->off = PAL_NEW(arena, int32_t, row->n_item);
    if (!row->all || !row->off) return PAL_ERR_MEMORY;
    row->fresh = true;
    memcpy(row->all, row->q, sizeof *row->q * (size_t)row->simd_blocks.n_lane);
    return PAL_ERR_OK;
}

pal_err pal_spring_set_check(const pal_config_entry *entry, const pal_build *build)
{
    if (build->body->tets && build->body->tets->n_tet > 0) return PAL_ERR_OK;
    return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: \"%s\" needs a body of tetrahedra", entry->path,
                              entry->name);
}

pal_err pal_spring_set_make(pal_spring_kind kind, pal_config_entry *entry, pal_build *build, int32_t *item, int n_item,
                            double least, pal_spring_set *out)
{
    const pal_body *body = build->body;
    const int n_corner = pal_spring_corner_count(kind);
    PAL_TRY(pal_spring_read(kind, entry, build, &out->spring));
    out->n_corner = n_corner;
    for (int i = 0; i < n_item; i++) {
        const double *x[PAL_CORNERS];
        corners_at(body->x_rest, item + n_corner * i, n_corner, x);
        if (!(fabs(pal_spring_measure(kind, x)) > least)) continue;
        memmove(item + n_corner * out->n_item++, item + n_corner * i, sizeof *item * (size_t)n_corner);
    }
    size_t n = (size_t)out->n_item * (size_t)n_corner;
    out->item = PAL_NEW(build->arena, int32_t, n);
    double *weight = malloc(sizeof *weight * ((size_t)out->n_item + 1));
    if (!out->item || !weight) {
        free(weight);
        return PAL_ERR_MEMORY;
    }
    memcpy(out->item, item, n * sizeof *item);
    pal_err err = fill(out, build, weight);
    free(weight);
    return err || !body->recovery ? err : keep_all(out, build->arena);
}

pal_err pal_spring_set_material(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag)
{
    (void)diag;
    pal_spring_set *row = self;
    pal_spring_material(&row->spring, body, material);
    if (row->whole) weigh(row, material);
    return PAL_ERR_OK;
}

double pal_spring_young_Pa(const pal_spring_set *row, const pal_body *body, double poisson)
{
    double factor[3], sum_N_m = 0;
    pal_spring_factors(poisson, row->spring.without_area, factor);
    for (int i = 0; i < row->n_item; i++) {
        const int lane = row->simd_blocks.place[i];
        sum_N_m += row->spring.k_J * row->q[lane] * row->w[lane] * row->w[lane];
    }
    return sum_N_m * body->edge_m * body->edge_m / (6 * factor[PAL_SPRING_DISTANCE] * pal_spring_volume_m3(body));
}
