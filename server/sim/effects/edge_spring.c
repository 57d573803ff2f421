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
 * body->active_nodes, so position and velocity of an end are one load, and a force is one load and one store.
 *
 * Where threads share a step (active_nodes.h), the owner of a node computes: a part evaluates every spring that touches
 * one of its nodes, with copies of the other ends, and takes the sums at its own nodes. Its springs stand in the order
 * of all of them and every operation is lane by lane, so a node gets the terms of one thread in their order. */
#include "server/base/team.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/surface/active_nodes.h"
#include "server/sim/surface/adaptive_measure.h"
#include "server/sim/surface/adaptive_surface.h"

#include <string.h>

/* springs per batch, so that the processor has several blocks in flight */
enum { BATCH = 8 };

/* springs in blocks of 8 */
typedef struct spring_blocks {
    int n_block;
    uint32_t *end;  /* 8 times the indices of both ends: first, then second                [n_block][2][8] */
    double *w2, *q; /* 1/l0^2 and share; 0 in lanes without a spring                       [n_block][8]    */
} spring_blocks;

typedef struct edge_spring {
    double k_N_m, c_Ns_m; /* c_Ns_m only when given */
    double thickness_m;
    bool k_given, c_given;
    const pal_adaptive_surface *adaptive;
    double young_Pa; /* of the body, the reference for E of regions */
    float *young;    /* E at the middles of all edges, NaN: the body's; NULL: no regions [n edges] */

    uint64_t revision; /* revision of the surface that the arrays below belong to; 0: none yet */
    int n_node;
    int32_t *place; /* index of a vertex in adaptive->node [finest vertices] */
    spring_blocks all;
    double *bound; /* sum of 2 q over the springs of a node                                [n_node]        */

    /* for threads; NULL: one */
    int n_part, n_asked; /* 1: the caller evaluates all; parts that there would be with room for copies    */
    spring_blocks *part; /* of a part, in memory that follows that of the part before it       [threads]   */
    int *first_copy;     /* first of `copied` of each part                                     [threads + 1] */
    int32_t *copied;     /* nodes of other parts that a part's springs touch; -1: none         [first_copy[n_part]] */
    int32_t *copy_of;    /* the last copy of a node, -1: none yet                              [n_node]    */
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

static bool allocate_blocks(spring_blocks *blocks, size_t n_lane, pal_arena *arena)
{
    blocks->end = PAL_NEW(arena, uint32_t, 2 * n_lane);
    return PAL_NEW_DOUBLES(arena, n_lane, &blocks->w2, &blocks->q) && blocks->end;
}

/* a spring has two ends, so that it is in two parts at most */
static bool allocate_parts(edge_spring *e, const pal_active_nodes *pack, size_t n_vertex, size_t n_lane, int threads,
                           pal_arena *arena)
{
    e->part = PAL_NEW(arena, spring_blocks, threads);
    e->first_copy = PAL_NEW(arena, int, threads + 1);
    e->copied = PAL_NEW(arena, int32_t, pack->n_copy);
    e->copy_of = PAL_NEW(arena, int32_t, n_vertex);
    return e->part && e->first_copy && e->copied && e->copy_of &&
           allocate_blocks(&e->part[0], 2 * n_lane + PAL_LANES * (size_t)threads, arena);
}

static pal_err allocate(edge_spring *e, const pal_build *build)
{
    const pal_levels *levels = &e->adaptive->levels;
    pal_arena *arena = build->arena;
    int finest = levels->n_level - 1, threads = build->scene->threads;
    size_t n_vertex = (size_t)levels->n_vertex[finest];
    size_t n_lane = ((size_t)pal_levels_n_edge(levels, finest) + PAL_LANES - 1) / PAL_LANES * PAL_LANES;
    PAL_TRY(pal_active_nodes_make(build));
    e->place = PAL_NEW(arena, int32_t, n_vertex);
    e->bound = PAL_NEW(arena, double, n_vertex);
    bool all = e->place && e->bound && allocate_blocks(&e->all, n_lane, arena);
    if (threads > 1) all = all && allocate_parts(e, build->body->active_nodes, n_vertex, n_lane, threads, arena);
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
    PAL_TRY(allocate(e, build));
    *self = e;
    return PAL_ERR_OK;
}

/* the active springs, distributed over blocks so that successive springs share no end and need not wait */
static void take_all(edge_spring *e)
{
    const pal_adaptive_surface *adaptive = e->adaptive;
    const double *x = adaptive->levels.x;
    spring_blocks *all = &e->all;
    e->n_node = adaptive->n_node;
    all->n_block = (adaptive->n_spring + PAL_LANES - 1) / PAL_LANES;
    for (int k = 0; k < e->n_node; k++) {
        e->place[adaptive->node[k]] = k;
        e->bound[k] = 0;
    }
    for (int s = 0; s < PAL_LANES * all->n_block; s++) {
        uint32_t *end = all->end + 2 * (s / PAL_LANES * PAL_LANES) + s % PAL_LANES;
        end[0] = end[PAL_LANES] = 0;
        all->w2[s] = all->q[s] = 0;
        int k = s % PAL_LANES * all->n_block + s / PAL_LANES;
        if (k >= adaptive->n_spring) continue;
        int32_t edge = adaptive->spring[k], a = adaptive->levels.edge[edge].vertex[0],
                b = adaptive->levels.edge[edge].vertex[1];
        double d[3];
        pal_sub3(d, x + 3 * (size_t)b, x + 3 * (size_t)a);
        end[0] = PAL_LANES * (uint32_t)e->place[a], end[PAL_LANES] = PAL_LANES * (uint32_t)e->place[b];
        all->w2[s] = 1 / pal_dot3(d, d);
        double young = e->young && !isnan(e->young[edge]) ? (double)e->young[edge] : e->young_Pa;
        all->q[s] = (double)adaptive->spring_share[k] * (young / e->young_Pa);
        e->bound[e->place[a]] += 2 * all->q[s];
        e->bound[e->place[b]] += 2 * all->q[s];
    }
}

/* index of a node for a part that begins its copies at `first`: of its copy where it is not one of the part's own;
 * -1: there is no room for another copy */
static int find_end(edge_spring *e, const pal_active_nodes *pack, int node, bool own, int first, int *n_copy)
{
    if (own) return node;
    if (e->copy_of[node] < first) {
        if (*n_copy == pack->n_copy) return -1;
        e->copied[*n_copy] = node;
        e->copy_of[node] = (*n_copy)++;
    }
    return pack->first_copy + e->copy_of[node];
}

/* the springs of the nodes from first_node to end_node; copies from n_copy on, of which the new number is returned; -1:
 * there is no room */
static int take_part(edge_spring *e, const pal_active_nodes *pack, spring_blocks *part, int first_node, int end_node,
                     int n_copy)
{
    const spring_blocks *all = &e->all;
    const int first_copy = n_copy;
    int n = 0;
    for (int s = 0; s < PAL_LANES * all->n_block; s++) {
        const uint32_t *from = all->end + 2 * (s / PAL_LANES * PAL_LANES) + s % PAL_LANES;
        const int a = (int)(from[0] / PAL_LANES), b = (int)(from[PAL_LANES] / PAL_LANES);
        const bool own_a = a >= first_node && a < end_node, own_b = b >= first_node && b < end_node;
        if (!(all->w2[s] > 0) || (!own_a && !own_b)) continue;
        const int at[2] = {find_end(e, pack, a, own_a, first_copy, &n_copy),
                           find_end(e, pack, b, own_b, first_copy, &n_copy)};
        if (at[0] < 0 || at[1] < 0) return -1;
        uint32_t *to = part->end + 2 * (n / PAL_LANES * PAL_LANES) + n % PAL_LANES;
        to[0] = PAL_LANES * (uint32_t)at[0], to[PAL_LANES] = PAL_LANES * (uint32_t)at[1];
        part->w2[n] = all->w2[s], part->q[n++] = all->q[s];
    }
    part->n_block = (n + PAL_LANES - 1) / PAL_LANES;
    for (; n < PAL_LANES * part->n_block; n++) {
        uint32_t *to = part->end + 2 * (n / PAL_LANES * PAL_LANES) + n % PAL_LANES;
        to[0] = to[PAL_LANES] = PAL_LANES * (uint32_t)first_node;
        part->w2[n] = part->q[n] = 0;
    }
    return n_copy;
}

/* one part where there is no room for the copies */
static void take_parts(edge_spring *e, const pal_body *body)
{
    const pal_active_nodes *pack = body->active_nodes;
    const int n_part = pal_active_parts(body);
    int n_copy = 0;
    e->n_part = 1, e->n_asked = n_part;
    if (!e->part || n_part == 1) return;
    memset(e->copy_of, -1, sizeof *e->copy_of * (size_t)e->n_node);
    for (int p = 0; p < n_part; p++) {
        spring_blocks *part = &e->part[p];
        const size_t n_lane = p > 0 ? PAL_LANES * (size_t)part[-1].n_block : 0;
        if (p > 0) *part = (spring_blocks){0, part[-1].end + 2 * n_lane, part[-1].w2 + n_lane, part[-1].q + n_lane};
        e->first_copy[p] = n_copy;
        n_copy =
            take_part(e, pack, part, pal_active_first(body, n_part, p), pal_active_first(body, n_part, p + 1), n_copy);
        if (n_copy < 0) return;
        /* copies of two parts share no line of the caches */
        while (n_copy % PAL_LANES && n_copy < pack->n_copy) e->copied[n_copy++] = -1;
    }
    e->first_copy[n_part] = n_copy;
    e->n_part = n_part;
}

static void take_springs(edge_spring *e, const pal_body *body)
{
    const bool known = e->revision == e->adaptive->revision && e->all.n_block > 0;
    if (!known) take_all(e);
    if (!known || e->n_asked != pal_active_parts(body)) take_parts(e, body);
    e->revision = e->adaptive->revision;
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
PAL_INLINE void measure_blocks(const spring_blocks *e, const double *xv, int first, int n, pal_quad *d, pal_v8 *q,
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
static double run_springs(const spring_blocks *e, const pal_active_nodes *pack, double k, double c)
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
static void reopen(const edge_spring *e, const spring_blocks *blocks, const pal_active_nodes *pack, double k)
{
    for (int s = 0; s < PAL_LANES * blocks->n_block; s++) {
        const uint32_t *end = blocks->end + 2 * (s / PAL_LANES * PAL_LANES) + s % PAL_LANES;
        const int32_t a = (int32_t)(end[0] / PAL_LANES), b = (int32_t)(end[PAL_LANES] / PAL_LANES);
        pal_quad d = pal_v8_low(pack->xv[b]) - pal_v8_low(pack->xv[a]);
        if (!(blocks->w2[s] > 0) || pal_quad_dot(d, d) * blocks->w2[s] >= PAL_ROUNDING * PAL_ROUNDING) continue;
        d = pack->rest[b < e->n_node ? b : e->copied[b - pack->first_copy]] -
            pack->rest[a < e->n_node ? a : e->copied[a - pack->first_copy]];
        d[3] = 0;
        pack->f[b] += k * blocks->q[s] * d;
        pack->f[a] -= k * blocks->q[s] * d;
    }
}

typedef struct force_pass {
    const edge_spring *e;
    const pal_active_nodes *pack;
    double k, c;
} force_pass;

static void run_blocks(const force_pass *p, const spring_blocks *blocks)
{
    if (run_springs(blocks, p->pack, p->k, p->c) < PAL_ROUNDING * PAL_ROUNDING) reopen(p->e, blocks, p->pack, p->k);
}

static void run_part(void *user, int worker, int part)
{
    const force_pass *p = user;
    const edge_spring *e = p->e;
    const pal_active_nodes *pack = p->pack;
    (void)worker;
    for (int i = e->first_copy[part]; i < e->first_copy[part + 1] && e->copied[i] >= 0; i++) {
        pack->xv[pack->first_copy + i] = pack->xv[e->copied[i]];
        pack->f[pack->first_copy + i] = (pal_quad){0};
    }
    run_blocks(p, &e->part[part]);
}

static pal_err compute_forces(void *self, pal_step *step)
{
    edge_spring *e = self;
    take_springs(e, step->body);
    force_pass p = {
        .e = e, .pack = step->body->active_nodes, .k = e->k_N_m * e->adaptive->spring_ramp, .c = damping_now(e)};
    if (e->n_part > 1)
        pal_team_run(step->body->team, e->n_part, run_part, &p);
    else
        run_blocks(&p, &e->all);
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    return pal_active_nodes_run(self, step, compute_forces);
}

static double energy(void *self, const pal_body *body)
{
    edge_spring *e = self;
    take_springs(e, body);
    pal_active_nodes_load(body);
    pal_v8 sum = {0};
    for (int b = 0; b < e->all.n_block; b++) {
        pal_quad d[PAL_LANES];
        pal_v8 q, rate, none = {0}, share = pal_load8(e->all.q + PAL_LANES * b),
                        w2 = pal_load8(e->all.w2 + PAL_LANES * b);
        measure_blocks(&e->all, (const double *)body->active_nodes->xv, b, 1, d, &q, &rate);
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
    take_springs(e, body);
    double k = e->k_N_m * e->adaptive->spring_ramp;
    for (int i = 0; i < e->n_node; i++) bound_N_m[e->adaptive->node[i]] += k * e->bound[i];
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    edge_spring *e = self;
    take_springs(e, body);
    double c = damping_now(e);
    for (int i = 0; i < e->n_node; i++) bound_Ns_m[e->adaptive->node[i]] += c * e->bound[i];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    edge_spring *e = self;
    (void)body, (void)diag;
    if (!e->k_given) e->young_Pa = to->young_Pa;
    e->k_N_m = derived_k(e, e->young_Pa);
    e->all.n_block = 0;
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
