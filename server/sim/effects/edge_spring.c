/* Component edge_spring: the springs of an adaptive surface, f = -[k (l - l0) + c (dv.dx)/l] dx/l on the first end
 * and the opposite on the second (paper C, eq. 2). Keys: k_N_m, c_Ns_m, of a spring of level 0.
 *
 * Every spring has k times its share (the body's law, adaptive_surface.h) and c in the same proportion (paper C, eq.
 * 8: KD_l = KD_0 KS_l / KS_0). With material regions, k is also scaled by E at the spring's middle at rest over the
 * body's E. Constants that are not given follow the material: k = sqrt(3)/2 E thickness, c = 0.02 sqrt(k m_0).
 * spring_ramp multiplies k.
 *
 * Departure: a spring shorter than 1e-9 of its rest length takes its rest direction, without damping, so that a
 * collapsed surface opens again.
 *
 * The list of active springs is rebuilt when the revision of the surface changes. Their ends are indices into
 * body->active_nodes, so position and velocity of an end are one load, and a force is one load and one store. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/surface/active_nodes.h"
#include "server/sim/surface/adaptive_measure.h"
#include "server/sim/surface/adaptive_surface.h"

/* springs per batch, so that the processor has several blocks in flight */
enum { BATCH = 8 };

typedef struct edge_spring {
    double k_N_m, c_Ns_m; /* c_Ns_m only when given */
    double thickness_m;
    bool k_given, c_given;
    const pal_adaptive_surface *adaptive;
    double young_Pa; /* of the body, the reference for E of regions */
    float *young;    /* E at the middles of all edges, NaN: the body's; NULL: no regions [n edges] */

    uint64_t revision; /* revision of the surface that the arrays below belong to; 0: none yet */
    int n_block, n_node;
    int32_t *place; /* index of a vertex in shell->node [finest vertices] */
    uint32_t *end;  /* 8 times the indices of both ends, in blocks of 8: first, then second [n_block][2][8] */
    double *w2, *q; /* 1/l0^2 and share; 0 in lanes without a spring                       [n_block][8]    */
    double *bound;  /* sum of 2 q over the springs of a node                               [n_node]        */
} edge_spring;

static double derived_k(const edge_spring *e, double young_Pa)
{
    return e->k_given ? e->k_N_m : sqrt(3) / 2 * young_Pa * e->thickness_m;
}

/* a live material edit changes the masses after the components */
static double damping_now(const edge_spring *e)
{
    return e->c_given ? e->c_Ns_m : 0.02 * sqrt(e->k_N_m * e->adaptive->level_mass_kg[0]);
}

/* E at the middles of all edges */
static pal_err find_young(edge_spring *e, const pal_build *build)
{
    const pal_levels *levels = &e->adaptive->levels;
    int32_t n_edge = levels->first_edge[levels->n_level];
    if (build->def->n_region == 0) return PAL_ERR_OK;
    e->young = PAL_NEW(build->arena, float, n_edge);
    if (!e->young) return PAL_ERR_MEMORY;
    pal_material base = build->def->material, at;
    base.young_Pa = NAN;
    for (int32_t i = 0; i < n_edge; i++) {
        const int32_t *vertex = levels->edge[i].vertex;
        double middle[3];
        pal_add3(middle, levels->x + 3 * (size_t)vertex[0], levels->x + 3 * (size_t)vertex[1]);
        pal_scale3(middle, 0.5, middle);
        pal_material_overlay(build->def, &base, middle, &at);
        e->young[i] = (float)at.young_Pa;
    }
    return PAL_ERR_OK;
}

static pal_err allocate(edge_spring *e, pal_arena *arena)
{
    const pal_levels *levels = &e->adaptive->levels;
    int finest = levels->n_level - 1;
    size_t n_vertex = (size_t)levels->n_vertex[finest];
    size_t n_lane = ((size_t)pal_levels_n_edge(levels, finest) + PAL_LANES - 1) / PAL_LANES * PAL_LANES;
    e->place = PAL_NEW(arena, int32_t, n_vertex);
    e->end = PAL_NEW(arena, uint32_t, 2 * n_lane);
    e->bound = PAL_NEW(arena, double, n_vertex);
    const bool all = PAL_NEW_DOUBLES(arena, n_lane, &e->w2, &e->q) && e->place && e->end && e->bound;
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    const pal_adaptive_surface *adaptive = build->body->model.adaptive;
    if (!adaptive)
        return PAL_REFUSE(build->diag, "%s: \"%s\" needs a body of model adaptive_springs", item->path, item->name);
    edge_spring *e = PAL_NEW(build->arena, edge_spring, 1);
    if (!e) return PAL_ERR_MEMORY;
    e->adaptive = adaptive;
    e->k_given = pal_entry_has(item, "k_N_m");
    e->c_given = pal_entry_has(item, "c_Ns_m");
    PAL_TRY(pal_entry_read_number(item, "k_N_m", 0, 1e60, &e->k_N_m, build->diag));
    PAL_TRY(pal_entry_read_number(item, "c_Ns_m", 0, 1e60, &e->c_Ns_m, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    /* the model's key, also for an entry that replaces the model's component */
    pal_config_entry model = build->def->model;
    e->thickness_m = 0.003;
    PAL_TRY(pal_entry_read_number(&model, "thickness_m", 0, 1e9, &e->thickness_m, build->diag));
    e->young_Pa = build->def->material.young_Pa;
    e->k_N_m = derived_k(e, e->young_Pa);
    PAL_TRY(find_young(e, build));
    PAL_TRY(allocate(e, build->arena));
    PAL_TRY(pal_active_nodes_make(build->body, build->body_arena ? build->body_arena : build->arena));
    *self = e;
    return PAL_ERR_OK;
}

/* the active springs, distributed over blocks so that successive springs share no end and need not wait */
static void take_springs(edge_spring *e)
{
    const pal_adaptive_surface *adaptive = e->adaptive;
    const double *x = adaptive->levels.x;
    if (e->revision == adaptive->revision && e->n_block > 0) return;
    e->revision = adaptive->revision;
    e->n_node = adaptive->n_node;
    e->n_block = (adaptive->n_spring + PAL_LANES - 1) / PAL_LANES;
    for (int k = 0; k < e->n_node; k++) {
        e->place[adaptive->node[k]] = k;
        e->bound[k] = 0;
    }
    for (int s = 0; s < PAL_LANES * e->n_block; s++) {
        uint32_t *end = e->end + 2 * (s / PAL_LANES * PAL_LANES) + s % PAL_LANES;
        end[0] = end[PAL_LANES] = 0;
        e->w2[s] = e->q[s] = 0;
        int k = s % PAL_LANES * e->n_block + s / PAL_LANES;
        if (k >= adaptive->n_spring) continue;
        int32_t edge = adaptive->spring[k], a = adaptive->levels.edge[edge].vertex[0],
                b = adaptive->levels.edge[edge].vertex[1];
        double d[3];
        pal_sub3(d, x + 3 * (size_t)b, x + 3 * (size_t)a);
        end[0] = PAL_LANES * (uint32_t)e->place[a], end[PAL_LANES] = PAL_LANES * (uint32_t)e->place[b];
        e->w2[s] = 1 / pal_dot3(d, d);
        double young = e->young && !isnan(e->young[edge]) ? (double)e->young[edge] : e->young_Pa;
        e->q[s] = (double)adaptive->spring_share[k] * (young / e->young_Pa);
        e->bound[e->place[a]] += 2 * e->q[s];
        e->bound[e->place[b]] += 2 * e->q[s];
    }
}

/* halves of a vector as x y z 0: sums of the first halves of 8 vectors, and of the second */
PAL_INLINE void sum_halves(const pal_v8 p[PAL_LANES], pal_v8 *first, pal_v8 *second)
{
    pal_v8 s[4], t[2];
    /* x + y and z + 0 of two springs each */
    for (int k = 0; k < 4; k++)
        s[k] = __builtin_shufflevector(p[2 * k], p[2 * k + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
               __builtin_shufflevector(p[2 * k], p[2 * k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    for (int k = 0; k < 2; k++)
        t[k] = __builtin_shufflevector(s[2 * k], s[2 * k + 1], 0, 1, 4, 5, 8, 9, 12, 13) +
               __builtin_shufflevector(s[2 * k], s[2 * k + 1], 2, 3, 6, 7, 10, 11, 14, 15);
    *first = __builtin_shufflevector(t[0], t[1], 0, 1, 4, 5, 8, 9, 12, 13);
    *second = __builtin_shufflevector(t[0], t[1], 2, 3, 6, 7, 10, 11, 14, 15);
}

/* (l/l0)^2 of n blocks, and their strains' rates (dv.d)/l0^2; d [n][8] */
PAL_INLINE void measure_blocks(const edge_spring *e, const double *xv, int first, int n, pal_quad *d, pal_v8 *q,
                               pal_v8 *rate)
{
    for (int b = 0; b < n; b++) {
        const uint32_t *end = e->end + 2 * PAL_LANES * (first + b);
        pal_v8 w2 = pal_load8(e->w2 + PAL_LANES * (first + b)), p[PAL_LANES];
        for (int l = 0; l < PAL_LANES; l++) {
            p[l] = *(const pal_v8 *)(xv + end[PAL_LANES + l]) - *(const pal_v8 *)(xv + end[l]);
            d[PAL_LANES * b + l] = pal_v8_low(p[l]);
            p[l] *= pal_v8_join(pal_v8_low(p[l]), pal_v8_low(p[l]));
        }
        sum_halves(p, &q[b], &rate[b]);
        q[b] *= w2, rate[b] *= w2;
    }
}

/* with q = (l/l0)^2 and r = 1/sqrt(q): k (l - l0) d/l = k (1 - r) d, and c (dv.d)/l^2 d; returns the least q */
static double run_springs(const edge_spring *e, const pal_active_nodes *pack, double k, double c)
{
    const pal_v8 floor = PAL_ROUNDING * PAL_ROUNDING - (pal_v8){0}, none = {0}, one = 1 - none;
    pal_v8 min = one;
    const double *xv = (const double *)pack->xv;
    float *f = (float *)pack->f; /* 8 floats are as long as 4 doubles */
    for (int first = 0; first < e->n_block; first += BATCH) {
        const int n = e->n_block - first < BATCH ? e->n_block - first : BATCH;
        pal_quad d[BATCH * PAL_LANES];
        pal_v8 q[BATCH], rate[BATCH];
        double s[BATCH * PAL_LANES];
        measure_blocks(e, xv, first, n, d, q, rate);
        for (int b = 0; b < n; b++) {
            pal_v8 share = pal_load8(e->q + PAL_LANES * (first + b)), known = pal_select8(share > none, q[b], one);
            min = pal_select8(known < min, known, min);
            pal_v8 r = pal_inverse_sqrt8(pal_select8(q[b] < floor, floor, q[b])),
                   s8 = k * (one - r) + c * rate[b] * r * r;
            *(pal_v8_unaligned *)(s + PAL_LANES * b) = pal_select8(q[b] < floor, none, share * s8);
        }
        for (int b = 0; b < n; b++) {
            const uint32_t *end = e->end + 2 * PAL_LANES * (first + b);
            for (int l = 0; l < PAL_LANES; l++) {
                pal_quad force = s[PAL_LANES * b + l] * d[PAL_LANES * b + l];
                *(pal_quad *)(f + end[l]) += force;
                *(pal_quad *)(f + end[PAL_LANES + l]) -= force;
            }
        }
    }
    for (int l = 1; l < PAL_LANES; l++) min[0] = min[l] < min[0] ? min[l] : min[0];
    return min[0];
}

/* adds what the SIMD kernel omits: springs without length push their ends apart along the rest direction */
static void reopen(const edge_spring *e, const pal_active_nodes *pack, double k)
{
    for (int s = 0; s < PAL_LANES * e->n_block; s++) {
        const uint32_t *end = e->end + 2 * (s / PAL_LANES * PAL_LANES) + s % PAL_LANES;
        const uint32_t a = end[0] / PAL_LANES, b = end[PAL_LANES] / PAL_LANES;
        pal_quad d = pal_v8_low(pack->xv[b]) - pal_v8_low(pack->xv[a]);
        if (!(e->w2[s] > 0) || pal_quad_dot(d, d) * e->w2[s] >= PAL_ROUNDING * PAL_ROUNDING) continue;
        d = pack->rest[b] - pack->rest[a];
        d[3] = 0;
        pack->f[b] += k * e->q[s] * d;
        pack->f[a] -= k * e->q[s] * d;
    }
}

static pal_err compute_forces(void *self, pal_step *step)
{
    edge_spring *e = self;
    take_springs(e);
    double k = e->k_N_m * e->adaptive->spring_ramp;
    if (run_springs(e, step->body->active_nodes, k, damping_now(e)) < PAL_ROUNDING * PAL_ROUNDING)
        reopen(e, step->body->active_nodes, k);
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    return pal_active_nodes_run(self, step, compute_forces);
}

static double energy(void *self, const pal_body *body)
{
    edge_spring *e = self;
    take_springs(e);
    pal_active_nodes_load(body);
    pal_v8 sum = {0};
    for (int b = 0; b < e->n_block; b++) {
        pal_quad d[PAL_LANES];
        pal_v8 q, rate, none = {0}, share = pal_load8(e->q + PAL_LANES * b), w2 = pal_load8(e->w2 + PAL_LANES * b);
        measure_blocks(e, (const double *)body->active_nodes->xv, b, 1, d, &q, &rate);
        pal_v8 strain = pal_sqrt8(q) - 1;
        sum += pal_select8(w2 > none, share * strain * strain / w2, none);
    }
    double half = 0;
    for (int l = 0; l < PAL_LANES; l++) half += 0.5 * sum[l];
    return e->k_N_m * e->adaptive->spring_ramp * half;
}

/* k along the spring at both ends; across it k (1 - l0/l) is at most that for l > l0 and zero for l < l0 */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    edge_spring *e = self;
    (void)body;
    take_springs(e);
    double k = e->k_N_m * e->adaptive->spring_ramp;
    for (int i = 0; i < e->n_node; i++) bound_N_m[e->adaptive->node[i]] += k * e->bound[i];
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    edge_spring *e = self;
    (void)body;
    take_springs(e);
    double c = damping_now(e);
    for (int i = 0; i < e->n_node; i++) bound_Ns_m[e->adaptive->node[i]] += c * e->bound[i];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    edge_spring *e = self;
    (void)body, (void)diag;
    if (!e->k_given) e->young_Pa = to->young_Pa;
    e->k_N_m = derived_k(e, e->young_Pa);
    e->n_block = 0;
    return PAL_ERR_OK;
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *area_m2)
{
    const edge_spring *e = self;
    const pal_adaptive_springs springs = {.k_N_m = e->k_N_m * e->adaptive->spring_ramp,
                                          .thickness_m = e->thickness_m,
                                          .young_Pa = e->young_Pa,
                                          .edge_young = e->young};
    pal_adaptive_measure(e->adaptive, &springs, body->d, field, sum, area_m2);
}

const pal_effect pal_effect_edge_spring = {PAL_EFFECT("edge_spring", FORCE),
                                           .internal = true,
                                           .compute_forces = compute_forces,
                                           .energy = energy,
                                           .bounds = {.stiffness = stiffness, .damping = damping},
                                           .material = material,
                                           .inspect = {.measure = measure, .fields = PAL_ADAPTIVE_FIELDS}};
