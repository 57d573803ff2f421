/* Making a set of springs: constraints -> weights -> strips -> lanes. */
#include "server/sim/springs/spring_set.h"

#include "server/base/vec3.h"
#include "server/sim/recovery/recovery.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void pal_spring_set_changed(pal_spring_set *set)
{
    for (int i = 0; i < set->simd_blocks.n_lane; i++) set->single_q[i] = (float)set->q[i];
    set->changed = true;
}

/* ---- regions ---- */

/* weights of the body's material as it is */
static void weigh(pal_spring_set *set, const pal_material *material)
{
    double *q = set->all ? set->all : set->q;
    double factor[3], young_Pa = material->young_Pa;
    pal_spring_factors(material->poisson, set->spring.without_area, factor);
    const double f = factor[set->spring.kind], over[4] = {1, 1 / young_Pa, 1 / f, 1 / (young_Pa * f)};
    for (int i = 0; i < set->simd_blocks.n_lane; i++) {
        q[i] = 0;
        for (int k = 0; k < 4; k++) q[i] += over[k] * set->part[k][i];
    }
    if (set->all) memcpy(set->q, q, sizeof *q * (size_t)set->simd_blocks.n_lane);
    pal_spring_set_changed(set);
}

/* what each tetrahedron counts, by what its region gives: nothing, E, Poisson's ratio, both [4][n_tet]; false: all are
 * of the body's material */
static bool shares(const pal_spring_set *set, const pal_build *build, double *share)
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
        if (poisson) pal_spring_factors(at.poisson, set->spring.without_area, factor);
        share[(young + 2 * poisson) * tets->n_tet + t] =
            (young ? at.young_Pa : 1) * (poisson ? factor[set->spring.kind] : 1);
        any = any || young || poisson;
    }
    return any;
}

/* weight [n_item]: scratch */
static pal_err take_regions(pal_spring_set *set, const pal_build *build, double *weight)
{
    const pal_body *body = build->body;
    size_t n_tet = (size_t)body->tets->n_tet, n_lane = (size_t)set->simd_blocks.n_lane;
    if (build->def->n_region == 0 || set->spring.given) return PAL_ERR_OK;
    double *share = calloc(4 * n_tet, sizeof *share);
    pal_err err = share ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err && shares(set, build, share)) {
        set->whole = PAL_NEW(build->arena, double, n_lane);
        if (set->whole) memcpy(set->whole, set->q, n_lane * sizeof *set->q);
        for (int k = 0; k < 4 && !err; k++) {
            set->part[k] = PAL_NEW(build->arena, double, n_lane);
            if (!set->part[k] || !set->whole)
                err = PAL_ERR_MEMORY;
            else
                err = pal_spring_weights(&set->spring, body, share + (size_t)k * n_tet, set->item, set->n_item,
                                         set->n_corner, weight);
            for (int i = 0; i < set->n_item && !err; i++) set->part[k][set->simd_blocks.place[i]] = weight[i];
        }
        if (!err) weigh(set, &build->def->material);
    }
    free(share);
    return err;
}

/* ---- making ---- */

/* what the sub-steps read (spring_single.h) */
static pal_err fill_single(pal_spring_set *set, pal_node_order *order, pal_arena *arena)
{
    const int n_lane = set->simd_blocks.n_lane, power[3] = {2, 2, 3};
    const double scale = pow(order->unit_m, power[set->spring.kind]);
    double max = 0;
    set->single_w = PAL_NEW(arena, float, n_lane);
    set->single_q = PAL_NEW(arena, float, n_lane);
    if (!set->single_w || !set->single_q) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_lane; i++) {
        const double w = set->w[i];
        set->single_w[i] = (float)(scale * (set->spring.kind == PAL_SPRING_DISTANCE ? w * w : w));
        max = fmax(max, set->q[i]);
    }
    /* a power of two, so that roundings, and with them states, do not depend on it */
    const double size_N = set->spring.k_J * max / order->unit_m;
    if (size_N > 0) order->unit_N = fmax(order->unit_N, exp2(floor(log2(size_N))));
    pal_spring_set_changed(set);
    return PAL_ERR_OK;
}

static pal_err fill(pal_spring_set *set, const pal_build *build, double *weight)
{
    const pal_body *body = build->body;
    pal_arena *arena = build->arena;
    PAL_TRY(pal_simd_blocks_make(body->node_order, set->item, set->n_item, set->n_corner, arena, &set->simd_blocks));
    PAL_TRY(pal_part_blocks_make(&set->simd_blocks, body->node_order, arena, &set->part_blocks));
    PAL_TRY(pal_spring_weights(&set->spring, body, NULL, set->item, set->n_item, set->n_corner, weight));
    pal_spring_on_grid(&set->spring, &build->def->spring_grid, body, set->item, set->n_item, set->n_corner, weight);
    set->w = PAL_NEW(arena, double, set->simd_blocks.n_lane);
    set->q = PAL_NEW(arena, double, set->simd_blocks.n_lane);
    if (!set->w || !set->q) return PAL_ERR_MEMORY;
    for (int i = 0; i < set->n_item; i++) {
        const double *x[PAL_CORNERS];
        pal_spring_points(body->x_rest, set->item + set->n_corner * i, set->n_corner, x);
        set->w[set->simd_blocks.place[i]] = 1 / pal_spring_measure(set->spring.kind, x);
        set->q[set->simd_blocks.place[i]] = weight[i];
    }
    PAL_TRY(fill_single(set, body->node_order, arena));
    return take_regions(set, build, weight);
}

pal_err pal_spring_set_check(const pal_config_entry *entry, const pal_build *build)
{
    if (build->body->tets && build->body->tets->n_tet > 0 && build->body->node_order) return PAL_ERR_OK;
    return PAL_REFUSE(build->diag, "%s: \"%s\" needs a body of tetrahedra", entry->path, entry->name);
}

pal_err pal_spring_set_make(pal_spring_kind kind, pal_config_entry *entry, pal_build *build, int32_t *item, int n_item,
                            double min, pal_spring_set *out)
{
    const pal_body *body = build->body;
    const int n_corner = pal_spring_corner_count(kind);
    PAL_TRY(pal_spring_read(kind, entry, build, &out->spring));
    out->n_corner = n_corner;
    for (int i = 0; i < n_item; i++) {
        const double *x[PAL_CORNERS];
        pal_spring_points(body->x_rest, item + n_corner * i, n_corner, x);
        if (!(fabs(pal_spring_measure(kind, x)) > min)) continue;
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
    return err;
}

pal_err pal_spring_set_material(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag)
{
    (void)diag;
    pal_spring_set *set = self;
    pal_spring_material(&set->spring, body, material);
    if (set->whole) weigh(set, material);
    pal_recovery_refresh(set->recovery);
    return PAL_ERR_OK;
}

double pal_spring_young_Pa(const pal_spring_set *set, const pal_body *body, double poisson)
{
    double factor[3], sum_N_m = 0;
    pal_spring_factors(poisson, set->spring.without_area, factor);
    for (int i = 0; i < set->n_item; i++) {
        const int lane = set->simd_blocks.place[i];
        sum_N_m += set->spring.k_J * set->q[lane] * set->w[lane] * set->w[lane];
    }
    return sum_N_m * body->edge_m * body->edge_m / (6 * factor[PAL_SPRING_DISTANCE] * pal_spring_volume_m3(body));
}
