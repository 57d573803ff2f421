/* What recovery asks of springs. */
#include "server/sim/springs/spring_lattice.h"

#include <string.h>

static double volume_ratio(const pal_spring_set *volumes, int i, const double *d)
{
    const double *x[PAL_CORNERS];
    pal_spring_corners(volumes, d, i, x);
    return volumes->w[volumes->simd_blocks.place[i]] * pal_spring_measure(PAL_SPRING_VOLUME, x);
}

static void range(void *self, const pal_body *body, double out[2])
{
    const pal_spring_lattice *l = self;
    pal_spring_volume_range(l->of[PAL_SPRING_VOLUME], body->node_order, body->d, out);
}

static void ratios(void *self, const pal_body *body, float *low, float *high, float *middle)
{
    const pal_spring_lattice *l = self;
    const pal_spring_set *volumes = l->of[PAL_SPRING_VOLUME];
    for (int t = 0; t < l->tets->n_tet; t++) {
        const int i = volumes->of_tet[t];
        low[t] = high[t] = middle[t] = i < 0 ? 1 : (float)volume_ratio(volumes, i, body->d);
    }
}

static int edges(const void *self, int e, int32_t out[][2])
{
    const int32_t *node = ((const pal_spring_lattice *)self)->tets->tet + 4 * (size_t)e;
    int n = 0;
    for (int a = 0; a < 4; a++)
        for (int b = 0; b < a; b++) out[n][0] = node[a], out[n++][1] = node[b];
    return n;
}

/* an edge has k_ij l0^2 = k q */
static double stiffness(const void *self, int e)
{
    const pal_spring_set *set = ((const pal_spring_lattice *)self)->of[PAL_SPRING_DISTANCE];
    double sum_J = 0, square_m2 = 0;
    for (int c = 0; c < 6 && set; c++) {
        const int i = set->of_tet[6 * (size_t)e + (size_t)c];
        if (i < 0) continue;
        const int lane = set->simd_blocks.place[i];
        sum_J += set->spring.k_J * set->all[lane] / set->around[lane];
        square_m2 += 1 / (set->w[lane] * set->w[lane]);
    }
    return sum_J > 0 ? sum_J / square_m2 : 0;
}

/* q of what acts: the part of the tetrahedra around a spring that act, all of it where all do */
static void act_set(pal_spring_set *set, int n_tet, const uint8_t *on)
{
    const int n_side = pal_spring_sides(set->spring.kind);
    const pal_simd_blocks *blocks = &set->simd_blocks;
    for (int i = 0; i < set->n_item; i++) set->q[blocks->place[i]] = 0;
    for (int t = 0; t < n_tet; t++)
        for (int c = 0; c < n_side && on[t]; c++) {
            const int i = set->of_tet[n_side * (size_t)t + (size_t)c];
            if (i >= 0) set->q[blocks->place[i]]++;
        }
    for (int i = 0; i < set->n_item; i++) {
        const int lane = blocks->place[i];
        set->q[lane] = set->all[lane] * (set->q[lane] / set->around[lane]);
    }
    pal_spring_set_changed(set);
}

static void act(void *self, const uint8_t *on)
{
    pal_spring_lattice *l = self;
    for (int kind = 0; kind < 3; kind++)
        if (l->of[kind]) act_set(l->of[kind], l->tets->n_tet, on);
}

static double energy(void *self, const pal_body *body)
{
    const pal_spring_lattice *l = self;
    double sum = 0;
    for (int kind = 0; kind < 3; kind++)
        if (l->of[kind]) sum += pal_spring_energy(l->of[kind], body, (pal_spring_kind)kind);
    return sum;
}

pal_err pal_spring_lattice_make(pal_body *body, pal_arena *arena)
{
    pal_spring_lattice *l = PAL_NEW(arena, pal_spring_lattice, 1);
    if (!l) return PAL_ERR_MEMORY;
    l->tets = body->tets;
    const pal_recovery_model model = {.self = l,
                                      .n_element = l->tets->n_tet,
                                      .edges = edges,
                                      .stiffness_N_m = stiffness,
                                      .range = range,
                                      .ratios = ratios,
                                      .act = act,
                                      .energy = energy};
    PAL_TRY(pal_recovery_make(&model, body->n_node, body->x_rest, arena, &l->recovery));
    body->model.springs = l;
    return PAL_ERR_OK;
}

pal_err pal_spring_lattice_join(pal_spring_set *set, const pal_build *build)
{
    pal_spring_lattice *l = build->body->model.springs;
    if (!l) return PAL_ERR_OK;
    const size_t n_lane = (size_t)set->simd_blocks.n_lane,
                 n_side = (size_t)l->tets->n_tet * (size_t)pal_spring_sides(set->spring.kind);
    set->of_tet = PAL_NEW(build->arena, int32_t, n_side);
    if (!PAL_NEW_DOUBLES(build->arena, n_lane, &set->all, &set->around) || !set->of_tet) return PAL_ERR_MEMORY;
    PAL_TRY(pal_spring_find_sides(l->tets, set->item, set->n_item, set->n_corner, set->of_tet));
    memcpy(set->all, set->q, sizeof *set->q * n_lane);
    for (size_t s = 0; s < n_side; s++)
        if (set->of_tet[s] >= 0) set->around[set->simd_blocks.place[set->of_tet[s]]]++;
    set->lattice = l, set->recovery = l->recovery, l->of[set->spring.kind] = set;
    pal_recovery_refresh(l->recovery);
    return PAL_ERR_OK;
}

void pal_spring_lattice_leave(pal_spring_set *set)
{
    if (!set->lattice) return;
    set->lattice->of[set->spring.kind] = NULL;
    pal_recovery_reset(set->recovery);
    set->lattice = NULL, set->recovery = NULL;
}
