/* Component edge_distance: every edge keeps its length. C = (l - l0)/l0, E = k/2 C^2, f_i = +(k C + c C') (d/l)/l0
 * and the opposite on j, d from i to j (paper B section 4.1, F_D).
 *
 * Departures: erratum B1 (the paper's force lacks 1/l0^2). An edge shorter than 1e-9 of its rest length takes its
 * rest direction, so that a body collapsed to a plane or a point opens again. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/effects/spring_effect.h"
#include "server/sim/elements/elastic_law.h"

#include <stdlib.h>

typedef struct edge_distance {
    pal_spring_set set; /* first: see pal_spring_set_material */
    int n_dof;
    double *node_bound; /* sum of 2 q / l0^2 over the edges of each node            [n_dof] */
    double *node_J;     /* constants at the nodes, of a grid; NULL: set.k_J everywhere [n_dof] */
} edge_distance;

static void sum_bounds(edge_distance *e)
{
    for (int i = 0; i < e->n_dof; i++) e->node_bound[i] = 0;
    for (int i = 0; i < 2 * e->set.n_item; i++) {
        int lane = e->set.simd_blocks.place[i / 2];
        e->node_bound[e->set.item[i]] += 2 * e->set.q[lane] * e->set.w[lane] * e->set.w[lane];
    }
    e->set.changed = false;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    edge_distance *e = PAL_NEW(build->arena, edge_distance, 1);
    int32_t *edge;
    int n_edge;
    PAL_TRY(pal_spring_set_check(item, build));
    if (!e) return PAL_ERR_MEMORY;
    PAL_TRY(pal_tets_edges(build->body->tets, &edge, &n_edge));
    pal_err err = pal_spring_set_make(PAL_SPRING_DISTANCE, item, build, edge, n_edge,
                                      1e-9 * build->body->length_scale_m, &e->set);
    free(edge);
    PAL_TRY(err);
    e->n_dof = build->body->n_dof;
    e->node_bound = PAL_NEW(build->arena, double, build->body->n_dof);
    if (!e->node_bound) return PAL_ERR_MEMORY;
    sum_bounds(e);
    if (e->set.spring.on_grid) {
        e->node_J = PAL_NEW(build->arena, double, build->body->n_dof);
        if (!e->node_J) return PAL_ERR_MEMORY;
        pal_spring_nodes(&build->def->spring_grid, PAL_SPRING_DISTANCE, build->body, e->node_J);
    }
    if (e->set.spring.given)
        build->body->spring_young_Pa = pal_spring_young_Pa(&e->set, build->body, build->def->material.poisson);
    *self = e;
    return pal_spring_lattice_join(&e->set, build);
}

/* with r = l/l0 = sqrt(q): C (d/l)/l0 = (r - 1)/r d/l0^2 */
PAL_INLINE void kernel(const double *p[][3], pal_wide w, pal_wide kq, pal_wide f[][3], pal_wide *min)
{
    const pal_wide floor = PAL_ROUNDING * PAL_ROUNDING - (pal_wide){0}, one = 1 - (pal_wide){0};
    pal_wide dx = pal_wide_load(p[1][0]) - pal_wide_load(p[0][0]), dy = pal_wide_load(p[1][1]) - pal_wide_load(p[0][1]),
             dz = pal_wide_load(p[1][2]) - pal_wide_load(p[0][2]), w2 = w * w;
    pal_wide q = (dx * dx + dy * dy + dz * dz) * w2, known = pal_wide_select(w > 0, q, one);
    *min = pal_wide_select(known < *min, known, *min);
    pal_wide r = pal_wide_sqrt(pal_wide_select(q < floor, floor, q)), s = kq * w2 * ((1 - r) / r);
    f[0][0] = s * dx, f[0][1] = s * dy, f[0][2] = s * dz;
}

/* adds what the kernel omits: edges without length, below the root of `min2` of that at rest, push their ends apart
 * along the rest direction */
static void reopen(const pal_spring_set *set, const pal_body *body, double min2)
{
    for (int i = 0; i < set->n_item; i++) {
        int a = 3 * set->item[2 * i], b = 3 * set->item[2 * i + 1], lane = set->simd_blocks.place[i];
        double d[3], w = set->w[lane];
        pal_sub3(d, body->d + b, body->d + a);
        if (pal_dot3(d, d) * w * w >= min2) continue;
        pal_sub3(d, body->x_rest + b, body->x_rest + a);
        double s = set->spring.k_J * set->q[lane] * w * w;
        pal_axpy3(body->f + b, s, d);
        pal_axpy3(body->f + a, -s, d);
    }
}

PAL_SPRING_FORCES(2)

static pal_err run(void *self, pal_step *step)
{
    const edge_distance *e = self;
    pal_body *body = step->body;
    spring_select(self, body);
    const double min2 =
        body->node_order->single ? PAL_SPRING_SINGLE_SHORT * PAL_SPRING_SINGLE_SHORT : PAL_ROUNDING * PAL_ROUNDING;
    if (spring_forces(&e->set, body) < min2) reopen(&e->set, body, min2);
    if (e->set.spring.c_Js > 0) pal_spring_damp(&e->set, body, PAL_SPRING_DISTANCE);
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    spring_select(self, body);
    return pal_spring_energy(self, body, PAL_SPRING_DISTANCE);
}

static void add_bounds(edge_distance *e, const pal_body *body, double constant, double *bound)
{
    spring_select(e, body);
    if (e->set.changed) sum_bounds(e);
    for (int i = 0; i < body->n_dof; i++) bound[i] += constant * e->node_bound[i];
}

/* |g| = 1/l0 at both ends whatever the deformation; the stiffness across the edge, k C/(l l0), is at most that along
 * it for l > l0 and zero for l < l0 */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    add_bounds(self, body, ((const pal_spring_set *)self)->spring.k_J, bound_N_m);
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    add_bounds(self, body, ((const pal_spring_set *)self)->spring.c_Js, bound_Ns_m);
}

/* constants of material regions at the nodes: means over their springs */
static void measure_regions(const pal_spring_set *set, double *sum, double *volume_m3)
{
    for (int i = 0; i < 2 * set->n_item; i++) {
        int lane = set->simd_blocks.place[i / 2], node = set->item[i];
        const double q = set->all ? set->all[lane] : set->q[lane];
        if (!(set->whole[lane] > 0)) continue;
        sum[node] += set->spring.k_J * q / set->whole[lane];
        volume_m3[node] += 1;
    }
}

/* strain or distortion of the tetrahedra, which the springs make no use of */
static void measure_tets(const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    for (int t = 0; t < body->tets->n_tet; t++) {
        const int32_t *node = body->tets->tet + 4 * (size_t)t;
        double rest[9], now[9], cofactor[9], f[9];
        for (int i = 0; i < 9; i++) {
            size_t a = 3 * (size_t)node[i % 3 + 1] + (size_t)(i / 3), b = 3 * (size_t)node[0] + (size_t)(i / 3);
            rest[i] = body->x_rest[a] - body->x_rest[b];
            now[i] = body->d[a] - body->d[b];
        }
        /* F = now rest^-1 */
        double det = pal_det3(rest), volume = fabs(det) / 6;
        if (!(volume > 0)) continue;
        pal_cofactor3(rest, cofactor);
        for (int i = 0; i < 9; i++) f[i] = pal_dot3(now + 3 * (i / 3), cofactor + 3 * (i % 3)) / det;
        double value = field == PAL_FIELD_STRAIN ? pal_largest_strain(f) : pal_det3(f) - 1;
        for (int k = 0; k < 4; k++) sum[node[k]] += volume * value, volume_m3[node[k]] += volume;
    }
}

/* of nodes, a quarter of each tetrahedron, for the energy density of all kinds of springs */
static void measure_volumes(const pal_body *body, double *volume_m3)
{
    for (int t = 0; t < body->tets->n_tet; t++) {
        const int32_t *node = body->tets->tet + 4 * (size_t)t;
        const double quarter = fabs(pal_tet_volume(body->x_rest, node)) / 4;
        for (int k = 0; k < 4; k++) volume_m3[node[k]] += quarter;
    }
}

/* the constant before the springs' weights, which differ between edges of a lattice */
static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    const edge_distance *e = self;
    if (field == PAL_FIELD_STRAIN || field == PAL_FIELD_DISTORTION) measure_tets(body, field, sum, volume_m3);
    if (field == PAL_FIELD_ENERGY_J_M3) {
        pal_spring_measure_energy(&e->set, body, PAL_SPRING_DISTANCE, sum);
        measure_volumes(body, volume_m3);
    }
    if (field == PAL_FIELD_DENSITY_KG_M3) pal_body_measure_density(body, sum, volume_m3);
    if (field != PAL_FIELD_STIFFNESS_J) return;
    if (e->set.whole) {
        measure_regions(&e->set, sum, volume_m3);
        return;
    }
    for (int i = 0; i < body->n_dof; i++) {
        sum[i] += e->node_J ? e->node_J[i] : e->set.spring.k_J;
        volume_m3[i] += 1;
    }
}

const pal_effect pal_effect_edge_distance = {
    PAL_EFFECT("edge_distance", FORCE),
    .destroy = spring_destroy,
    .internal = true,
    .energy = energy,
    .bounds = {.stiffness = stiffness, .damping = damping},
    .material = pal_spring_set_material,
    .inspect = {.measure = measure,
                .fields = 1u << PAL_FIELD_STIFFNESS_J | 1u << PAL_FIELD_STRAIN | 1u << PAL_FIELD_DISTORTION |
                          1u << PAL_FIELD_DENSITY_KG_M3 | 1u << PAL_FIELD_ENERGY_J_M3}};
