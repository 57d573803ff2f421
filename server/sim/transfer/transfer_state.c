/* Transfer of places, velocities and energy (transfer.h). Read pal_transfer_apply, at the end, first. */
#include "server/sim/transfer/transfer.h"

#include "server/base/vec3.h"
#include "server/num/conjugate_gradient.h"
#include "server/num/polar.h"
#include "server/sim/transfer/transfer_core.h"
#include "server/sim/transfer/transfer_world.h"
#include "server/sim/world/world_core.h"

#include <stdlib.h>
#include <string.h>

/* rounds of smoothing: usually, after a rehearsal has done most of them, and where the energy is FAR times that of
 * before. A round is one evaluation of forces */
enum { SMOOTH_ROUNDS = 40, SMOOTH_AGAIN_ROUNDS = 10, SMOOTH_FAR_ROUNDS = 200, SCALE_ROUNDS = 8 };
#define FAR 1.5
/* relative difference of energies that counts as none: far below the 2 % that a switch may change (test_switch) */
#define SAME_ENERGY 1e-4
/* of the last move that goes on in Polyak's heavy ball: stable, as forces over bounds have no eigenvalue above 1 */
#define INERTIA 0.8
/* share of all energy that the kinetic one may be off by before velocities are scaled */
#define SPARE_ENERGY 0.01
/* pull to rest of the least squares, over their largest weight: decides only what nodes leave open */
#define REST_PULL 1e-6

/* ---- sums ---- */

static bool elastic(const pal_effect *e)
{
    return e->stage == PAL_STAGE_FORCE && e->energy && (e->internal || e->stiffness);
}

/* of a body's elastic components where it is; some know their energy as of the last forces */
static double elastic_energy_J(pal_world *w, int body)
{
    double sum = 0;
    if (pal_world_assemble_forces(w, body)) return NAN;
    for (int i = 0; i < w->plan.n_row; i++) {
        const pal_component *row = &w->plan.row[i];
        if (w->plan.component_body[i] == body && elastic(row->effect))
            sum += row->effect->energy(row->self, &w->plan.body[body]);
    }
    return sum;
}

/* the same, and f and g are then those of all that pulls but tools: of what an earlier switch still lets go as well, so
 * that one switch after the other takes nothing away at once */
static double blended_elastic_J(pal_world *w, int body)
{
    double sum = elastic_energy_J(w, body);
    pal_body *b = &w->plan.body[body];
    if (!b->interpolation) {
        pal_blend_components_add(&w->blends, body, 1, b->f);
        return sum;
    }
    double *blended = calloc(3 * (size_t)b->n_node + 1, sizeof *blended);
    if (!blended) return sum;
    pal_blend_components_add(&w->blends, body, 1, blended);
    pal_interpolation_apply_transpose(b->interpolation, blended, b->g);
    free(blended);
    return sum;
}

static double world_energy_J(pal_world *w)
{
    double sum = 0;
    for (int b = 0; b < w->plan.n_body; b++) sum += elastic_energy_J(w, b) + pal_body_kinetic_J(&w->plan.body[b]);
    return sum;
}

/* blended_elastic_J of the old body, t->moving, and the energy of its world unless NULL; its loads stay those of its
 * last step
 */
static double evaluate_old(pal_transfer *t, pal_world *old, double *all_J)
{
    pal_body *from = &old->plan.body[t->body];
    size_t n = 3 * (size_t)from->n_node;
    memcpy(t->load, from->load, n * sizeof *t->load);
    if (all_J)
        *all_J = world_energy_J(old);
    else
        (void)elastic_energy_J(old, t->body);
    for (size_t i = 0; i < n; i++) t->moving[i] = t->load[i] + from->f[i] - from->load[i];
    double sum = blended_elastic_J(old, t->body);
    memcpy(from->load, t->load, n * sizeof *t->load);
    return sum;
}

/* momentum and, about c, its moment of the vectors q [n][3] at x; mass NULL: q are forces already */
static void moments(int n, const double *mass, const double *x, const double *q, const double c[3], double p[3],
                    double l[3])
{
    pal_set3(p, 0, 0, 0);
    pal_set3(l, 0, 0, 0);
    for (int i = 0; i < n; i++) {
        double arm[3], turn[3], m = mass ? mass[i] : 1;
        pal_sub3(arm, x + 3 * i, c);
        pal_cross3(turn, arm, q + 3 * i);
        pal_axpy3(p, m, q + 3 * i);
        pal_axpy3(l, m, turn);
    }
}

static double centre_of(int n, const double *mass, const double *x, double c[3])
{
    double sum = 0;
    pal_set3(c, 0, 0, 0);
    for (int i = 0; i < n; i++) sum += mass[i], pal_axpy3(c, mass[i], x + 3 * i);
    if (sum > 0) pal_scale3(c, 1 / sum, c);
    return sum;
}

typedef struct rigid {
    double centre[3], v[3], spin[3];
} rigid;

/* the rigid motion that has momentum p and moment l about the centre of mass */
static void find_rigid(int n, const double *mass, const double *x, const double p[3], const double l[3], rigid *out)
{
    double inertia[9] = {0}, kg = centre_of(n, mass, x, out->centre), w[3], axis[9];
    for (int i = 0; i < n; i++) {
        double r[3];
        pal_sub3(r, x + 3 * i, out->centre);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) inertia[3 * a + b] += mass[i] * ((a == b) * pal_dot3(r, r) - r[a] * r[b]);
    }
    pal_scale3(out->v, kg > 0 ? 1 / kg : 0, p);
    pal_set3(out->spin, 0, 0, 0);
    pal_eigen3(inertia, w, axis);
    for (int k = 0; k < 3; k++)
        if (w[k] > 1e-12 * w[2]) pal_axpy3(out->spin, pal_dot3(axis + 3 * k, l) / w[k], axis + 3 * k);
}

static void rigid_at(const rigid *r, const double x[3], double v[3])
{
    double arm[3];
    pal_sub3(arm, x, r->centre);
    pal_cross3(v, r->spin, arm);
    pal_add3(v, v, r->v);
}

static bool is_free(const pal_body *body)
{
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) return false;
    return true;
}

/* ---- places and velocities ---- */

void pal_transfer_place_nodes(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    for (int i = 0; i < 3 * from->n_node; i++) t->old[i] = from->d[i] - from->node_rest[i];
    pal_interpolation_apply(&t->in, t->old, t->place);
    for (int i = 0; i < 3 * to->n_node; i++) t->place[i] += to->node_rest[i];
}

typedef struct squares {
    const pal_body *body;
    double *node, pull;
} squares;

/* A'A + pull, without what is held */
static void multiply(void *user, const double *p, double *out)
{
    const squares *s = user;
    const pal_body *b = s->body;
    pal_interpolation_apply(b->interpolation, p, s->node);
    for (int i = 0; i < 3 * b->n_dof; i++) out[i] = s->pull * p[i];
    pal_interpolation_apply_transpose(b->interpolation, s->node, out);
    for (int i = 0; i < b->n_dof; i++)
        if (b->support[i]) pal_set3(out + 3 * i, 0, 0, 0);
}

static void no_change(void *user, const double *r, double *out)
{
    const squares *s = user;
    memcpy(out, r, 3 * sizeof *r * (size_t)s->body->n_dof);
}

/* points out [n_dof][3] that carry the nodes nearest to `want` [n_node][3]; of what is held 0 */
static void min_squares(pal_transfer *t, const pal_body *to, const double *want, double *out)
{
    size_t n_byte = 3 * sizeof(double) * (size_t)to->n_dof;
    double *r = t->work[0], max = 0;
    squares s = {.body = to, .node = t->pull};
    memset(r, 0, n_byte);
    memset(out, 0, n_byte);
    memset(t->work[1], 0, n_byte);
    pal_interpolation_apply_transpose(to->interpolation, want, r);
    for (int32_t k = 0; k < to->interpolation->start[to->interpolation->n_row]; k++)
        t->work[1][to->interpolation->point[k]] += to->interpolation->weight[k] * to->interpolation->weight[k];
    for (int i = 0; i < to->n_dof; i++) {
        max = fmax(max, t->work[1][i]);
        if (to->support[i]) pal_set3(r + 3 * i, 0, 0, 0);
    }
    s.pull = REST_PULL * max;
    pal_conjugate_gradient cg = {.n = 3 * to->n_dof,
                                 .multiply = multiply,
                                 .precondition = no_change,
                                 .user = &s,
                                 .r = r,
                                 .z = t->work[1],
                                 .p = t->work[2],
                                 .q = t->work[3]};
    double size = sqrt(pal_dot_product(cg.n, r, r));
    pal_conjugate_gradient_run(&cg, out, 1e-10 * size, 0, 400);
}

/* the points of the new body from its nodes */
static void set_points(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    size_t n_byte = 3 * sizeof(double) * (size_t)to->n_dof;
    if (t->same_control_points) {
        memcpy(t->x, from->x, n_byte);
        memcpy(t->v, from->v, n_byte);
        return;
    }
    if (to->interpolation) {
        for (int i = 0; i < 3 * to->n_node; i++) t->place[i] -= to->node_rest[i];
        min_squares(t, to, t->place, t->x);
        min_squares(t, to, t->rate, t->v);
        for (int i = 0; i < 3 * to->n_dof; i++) t->x[i] += to->x_rest[i];
        return;
    }
    memcpy(t->x, t->place, n_byte);
    memcpy(t->v, t->rate, n_byte);
    for (int i = 0; i < to->n_dof; i++) {
        if (to->support[i] != PAL_FIXED) continue;
        pal_copy3(t->x + 3 * i, to->x_rest + 3 * i);
        pal_set3(t->v + 3 * i, 0, 0, 0);
    }
}

/* ---- adaptive surfaces ---- */

/* an old vertex by new ones: itself, or the ends of its edge */
static void add_vertex(pal_interpolation_builder *rows, const pal_dofs *from, const pal_dofs *to, int32_t i,
                       double weight)
{
    if (pal_dofs_has(to, i)) {
        pal_interpolation_builder_add(rows, i, weight);
        return;
    }
    const int32_t *end = from->levels->edge[pal_levels_vertex_parent(from->levels, i)].vertex;
    for (int k = 0; k < 2; k++) add_vertex(rows, from, to, end[k], 0.5 * weight);
}

/* rows of the old vertices; false: no memory, forces and grasps are not carried then */
static bool make_back(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    pal_interpolation_builder rows;
    pal_interpolation_free(&t->back);
    pal_interpolation_builder_begin(&rows, from->n_node, to->n_node, INT32_MAX);
    for (int32_t i = 0; i < from->n_node && !rows.err; i++) {
        if (pal_dofs_has(&from->dofs, i)) add_vertex(&rows, &from->dofs, &to->dofs, i, 1);
        pal_interpolation_builder_end_row(&rows);
    }
    return pal_interpolation_builder_finish(&rows, &t->back) == PAL_ERR_OK;
}

static bool refines(const pal_world *w, int b)
{
    return w->plan.n_of[PAL_STAGE_ADAPT][b] > 0;
}

/* ---- forces ---- */

/* the difference of forces goes out in steps; of a body that nothing holds it moves and turns nothing */
static void blend_forces(pal_transfer *t, pal_world *next)
{
    pal_body *to = &next->plan.body[t->body];
    double c[3], p[3], l[3], a[3];
    rigid r;
    if (pal_world_assemble_forces(next, t->body)) return;
    for (int i = 0; i < to->n_node; i++) {
        pal_sub3(t->pull + 3 * i, t->pull + 3 * i, to->f + 3 * i);
        if (!to->interpolation && to->support[i]) pal_set3(t->pull + 3 * i, 0, 0, 0);
    }
    if (is_free(to)) {
        (void)centre_of(to->n_node, to->node_mass_kg, to->d, c);
        moments(to->n_node, NULL, to->d, t->pull, c, p, l);
        find_rigid(to->n_node, to->node_mass_kg, to->d, p, l, &r);
        for (int i = 0; i < to->n_node; i++) {
            rigid_at(&r, to->d + 3 * i, a);
            pal_axpy3(t->pull + 3 * i, -to->node_mass_kg[i], a);
        }
    }
    (void)pal_world_blend_force(next, t->body, t->pull);
}

/* ---- energy ---- */

/* false: the rows know no bound of their stiffness */
static bool find_bound(const pal_world *w, int body, double *bound)
{
    const pal_body *to = &w->plan.body[body];
    bool any = false;
    memset(bound, 0, sizeof *bound * (size_t)to->n_node);
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_FORCE][body]; i++) {
        const pal_component *row = &w->plan.row[w->plan.first[PAL_STAGE_FORCE][body] + i];
        if (row->effect->stiffness) row->effect->stiffness(row->self, to, bound), any = true;
    }
    return any;
}

/* moves nodes by their missing force over their bound, with some of the move before (Polyak's heavy ball: stable, as
 * forces over bounds have no eigenvalue above 1), until the energy has come down; rounds taken */
static int smooth(pal_transfer *t, pal_world *next, double want_J)
{
    pal_body *to = &next->plan.body[t->body];
    double *way = t->work[0], now_J = elastic_energy_J(next, t->body), max_J = 1.5 * now_J;
    int n = 0;
    if (to->interpolation || !find_bound(next, t->body, t->bound)) return 0;
    memset(way, 0, 3 * sizeof *way * (size_t)to->n_dof);
    int n_max = now_J > FAR * want_J ? SMOOTH_FAR_ROUNDS : t->has_rehearsed ? SMOOTH_AGAIN_ROUNDS : SMOOTH_ROUNDS;
    for (; n < n_max && now_J > (1 + SAME_ENERGY) * want_J && now_J < max_J; n++) {
        for (int k = 0; k < to->n_active; k++) {
            int i = pal_body_point(to, k);
            if (to->support[i] || !(t->bound[i] > 0)) continue;
            for (int c = 3 * i; c < 3 * i + 3; c++) {
                way[c] = INERTIA * way[c] + (to->f[c] - t->pull[c]) / t->bound[i];
                to->x[c] += way[c];
            }
        }
        pal_body_update_nodes(to);
        now_J = elastic_energy_J(next, t->body); /* and f */
    }
    return n;
}

/* where the displacement is measured from: rest, or of a body that nothing holds its best rigid place */
static void find_reference(const pal_body *to, double *out)
{
    double c[3], c_rest[3], f[9] = {0}, q[4] = {1, 0, 0, 0}, r[9];
    memcpy(out, to->x_rest, 3 * sizeof *out * (size_t)to->n_dof);
    if (!is_free(to)) return;
    (void)centre_of(to->n_dof, to->mass_kg, to->x, c);
    (void)centre_of(to->n_dof, to->mass_kg, to->x_rest, c_rest);
    for (int i = 0; i < to->n_dof; i++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                f[3 * a + b] += to->mass_kg[i] * (to->x[3 * i + a] - c[a]) * (to->x_rest[3 * i + b] - c_rest[b]);
    pal_polar_rotation(f, q, 100);
    pal_quat_matrix(q, r);
    for (int i = 0; i < to->n_dof; i++) {
        double arm[3];
        pal_sub3(arm, to->x_rest + 3 * i, c_rest);
        pal_mul33(arm, r, arm);
        pal_add3(out + 3 * i, c, arm);
    }
}

static double within(double s, double max)
{
    return fmin(fmax(s, 1 / max), max);
}

/* the displacement longer or shorter until the elastic energy is as wanted; by how much */
static double scale_displacement(pal_transfer *t, pal_world *next, double want_J)
{
    pal_body *to = &next->plan.body[t->body];
    double *ref = t->work[0], *base = t->work[1], s = 1, power = 2, last_J = NAN, last_s = 1;
    find_reference(to, ref);
    memcpy(base, to->x, 3 * sizeof *base * (size_t)to->n_dof);
    for (int round = 0; round < SCALE_ROUNDS; round++) {
        double now_J = elastic_energy_J(next, t->body);
        if (!(now_J > 0) || !(want_J > 0) || fabs(now_J / want_J - 1) <= SAME_ENERGY) break;
        /* the energy goes with a power of the length: 2 where little is bent, more beyond */
        if (last_J > 0 && s != last_s && now_J != last_J) power = log(now_J / last_J) / log(s / last_s);
        power = fmin(fmax(power, 1), 8);
        last_J = now_J, last_s = s;
        s = within(s * pow(want_J / now_J, 1 / power), PAL_TRANSFER_MAX_SCALE);
        for (int k = 0; k < to->n_active; k++) {
            size_t i = (size_t)pal_body_point(to, k);
            if (to->support[i]) continue;
            for (size_t c = 3 * i; c < 3 * i + 3; c++) to->x[c] = ref[c] + s * (base[c] - ref[c]);
        }
        pal_body_update_nodes(to);
    }
    return s;
}

/* the velocity beside that of the whole faster or slower, for the kinetic energy of before */
static void scale_velocity(pal_transfer *t, pal_body *to, double want_J)
{
    double c[3], p[3], l[3], all_J = pal_body_kinetic_J(to), rigid_J = 0, *v = t->work[0];
    size_t n_byte = 3 * sizeof *v * (size_t)to->n_dof;
    memset(v, 0, n_byte);
    if (!(all_J > 0)) return;
    if (is_free(to)) {
        rigid r;
        (void)centre_of(to->n_dof, to->mass_kg, to->x, c);
        moments(to->n_dof, to->mass_kg, to->x, to->v, c, p, l);
        find_rigid(to->n_dof, to->mass_kg, to->x, p, l, &r);
        for (int k = 0; k < to->n_active; k++) {
            int i = pal_body_point(to, k);
            rigid_at(&r, to->x + 3 * i, v + 3 * i);
        }
        memcpy(t->work[1], to->v, n_byte);
        memcpy(to->v, v, n_byte);
        pal_body_update_nodes(to);
        rigid_J = pal_body_kinetic_J(to);
        memcpy(to->v, t->work[1], n_byte);
    }
    double s = 1;
    if (all_J > rigid_J * (1 + 1e-9))
        s = within(sqrt(fmax(want_J - rigid_J, 0) / (all_J - rigid_J)), PAL_TRANSFER_MAX_VELOCITY_SCALE);
    for (int i = 0; i < 3 * to->n_dof; i++) to->v[i] = v[i] + s * (to->v[i] - v[i]);
    pal_body_update_nodes(to);
}

/* momentum and spin of before */
static void keep_momentum(const pal_body *from, pal_body *to)
{
    double c[3], p[3], l[3], q[3], m[3], next[3];
    rigid r;
    (void)centre_of(from->n_dof, from->mass_kg, from->x, c);
    (void)centre_of(to->n_dof, to->mass_kg, to->x, next);
    moments(from->n_dof, from->mass_kg, from->x, from->v, c, p, l);
    moments(to->n_dof, to->mass_kg, to->x, to->v, c, q, m);
    pal_sub3(p, p, q);
    pal_sub3(l, l, m);
    pal_sub3(next, next, c);
    pal_cross3(m, next, p);
    pal_sub3(l, l, m); /* about the new centre */
    find_rigid(to->n_dof, to->mass_kg, to->x, p, l, &r);
    for (int k = 0; k < to->n_active; k++) {
        int i = pal_body_point(to, k);
        double v[3];
        rigid_at(&r, to->x + 3 * i, v);
        pal_add3(to->v + 3 * i, to->v + 3 * i, v);
    }
    pal_body_update_nodes(to);
}

/* ---- the whole ---- */

static const pal_component *find_row(const pal_world *w, int body, const pal_effect *effect)
{
    for (int i = 0; i < w->plan.n_row; i++)
        if (w->plan.component_body[i] == body && w->plan.row[i].effect == effect) return &w->plan.row[i];
    return NULL;
}

/* rows that can go on where those of before are; forces that they put on other nodes now are to be released as well */
static void hand_over(pal_transfer *t, pal_world *next, const pal_world *before)
{
    for (int i = 0; i < next->plan.n_row; i++) {
        const pal_component *row = &next->plan.row[i];
        int b = next->plan.component_body[i];
        const pal_component *from = row->effect->transfer ? find_row(before, b, row->effect) : NULL;
        bool known = b == t->body ? t->back.n_row > 0 : next->plan.body[b].n_node == before->plan.body[b].n_node;
        if (from && known)
            row->effect->transfer(row->self, &next->plan.body[b], from->self,
                                  &(pal_component_transfer){.from = &before->plan.body[b],
                                                            .place = b == t->body ? pal_transfer_force_map(t) : NULL,
                                                            .rest_m = next->part[b].rest_m,
                                                            .same_shown = pal_transfer_same_shown(next, before, b),
                                                            .left_N = b == t->body ? t->pull : NULL});
    }
}

static void place_points(pal_transfer *t, const pal_body *from, pal_world *next)
{
    pal_body *to = &next->plan.body[t->body];
    if (!t->adaptive) {
        pal_transfer_place_nodes(t, from, to);
        pal_interpolation_apply(&t->in, from->dv, t->rate);
        set_points(t, from, to);
        return;
    }
    to->dofs.transfer(to, from, refines(next, t->body), t->x, t->v);
    (void)make_back(t, from, to);
}

/* from places by interpolation, with what a rehearsal added to them, to smooth ones; from->f and g are known. Rounds */
static int approach(pal_transfer *t, pal_world *next, const pal_body *from, double want_J)
{
    pal_body *to = &next->plan.body[t->body];
    for (int i = 0; i < 3 * to->n_dof && t->has_rehearsed; i++) to->x[i] += t->fix[i];
    if (t->has_rehearsed) pal_body_update_nodes(to);
    if (t->back.n_row == 0) return 0;
    pal_transfer_make_force_map(t, from, to);
    pal_transfer_loads(t, from, next);
    pal_transfer_forces(t, from, to);
    return smooth(t, next, want_J);
}

void pal_transfer_apply(pal_transfer *transfer, pal_world *next, const pal_world *before, pal_transfer_report *out)
{
    pal_transfer *t = transfer;
    pal_world *old = (pal_world *)(uintptr_t)before; /* its forces are worked out again */
    pal_body *from = &old->plan.body[t->body], *to = &next->plan.body[t->body];
    size_t n_byte = 3 * sizeof(double) * (size_t)to->n_dof;
    *out = (pal_transfer_report){.scale = 1};
    double elastic_before_J = evaluate_old(t, old, &out->energy_before_J), kinetic_J = pal_body_kinetic_J(from);
    double spare_J = SPARE_ENERGY * (elastic_before_J + kinetic_J);
    place_points(t, from, next);
    pal_world_transfer(next, before, t->body, t->x, t->v);
    out->interpolated_J = world_energy_J(next);
    out->n_smooth = approach(t, next, from, elastic_before_J);
    pal_world_invalidate_limits(next, t->body); /* rows look again at what is smooth now, as they will at the end */
    out->scale = scale_displacement(t, next, elastic_before_J);
    if (is_free(to)) keep_momentum(from, to);
    /* the velocity makes up for what the displacement could not */
    double now_J = pal_body_kinetic_J(to), left_J = elastic_before_J + kinetic_J - elastic_energy_J(next, t->body);
    scale_velocity(t, to, fmin(fmax(now_J, left_J - spare_J), left_J + spare_J));
    memcpy(t->x, to->x, n_byte);
    memcpy(t->v, to->v, n_byte);
    pal_world_transfer(next, before, t->body, t->x, t->v);
    hand_over(t, next, before);
    if (t->back.n_row > 0) blend_forces(t, next);
    pal_brush_components_transfer(&next->brushes, &next->plan, &before->brushes, &before->plan);
    out->energy_after_J = world_energy_J(next);
    out->body_move_m = pal_transfer_body_move(t, from, to);
    pal_transfer_display(t, next, before, out);
}

/* ---- while the old world goes on ---- */

/* room for what of a body changes while it runs: x, v, g, masses, what is held; d, dv, f, outer, masses of nodes */
static bool make_snapshot(pal_transfer *t, const pal_body *from)
{
    size_t dof = 3 * (size_t)from->n_dof, node = 3 * (size_t)from->n_node;
    if (t->snapshot_room) return true;
    t->snapshot_room = malloc(sizeof(double) * (3 * dof + 4 * node + (size_t)from->n_dof + (size_t)from->n_node) +
                              (size_t)from->n_dof);
    return t->snapshot_room != NULL;
}

static double *keep(double **room, const double *from, size_t n)
{
    double *to = *room;
    *room += n;
    memcpy(to, from, n * sizeof *to);
    return to;
}

bool pal_transfer_snapshot(pal_transfer *t, const pal_world *before)
{
    pal_world *old = (pal_world *)(uintptr_t)before; /* its forces are worked out again */
    const pal_body *from = &old->plan.body[t->body];
    if (t->adaptive || from->frozen || !make_snapshot(t, from)) return false;
    size_t dof = 3 * (size_t)from->n_dof, node = 3 * (size_t)from->n_node;
    double *room = t->snapshot_room;
    t->snapshot_energy_J = evaluate_old(t, old, NULL);
    t->snapshot = *from;
    t->snapshot.x = keep(&room, from->x, dof), t->snapshot.v = keep(&room, from->v, dof);
    t->snapshot.g = keep(&room, from->g, dof), t->snapshot.f = keep(&room, from->f, node);
    t->snapshot.d = keep(&room, from->d, node), t->snapshot.dv = keep(&room, from->dv, node);
    t->snapshot.mass_kg = keep(&room, from->mass_kg, (size_t)from->n_dof);
    t->snapshot.node_mass_kg = keep(&room, from->node_mass_kg, (size_t)from->n_node);
    if (from->external_force) t->snapshot.external_force = keep(&room, from->external_force, node);
    t->snapshot.support =
        (uint8_t *)(t->snapshot_room + 3 * dof + 4 * node + (size_t)from->n_dof + (size_t)from->n_node);
    memcpy(t->snapshot.support, from->support, (size_t)from->n_dof);
    return isfinite(t->snapshot_energy_J);
}

void pal_transfer_rehearse(pal_transfer *t, pal_world *next)
{
    pal_body *to = &next->plan.body[t->body];
    size_t n = 3 * (size_t)to->n_dof;
    if (!t->fix) t->fix = calloc(n + 1, sizeof *t->fix);
    if (!t->fix) return;
    place_points(t, &t->snapshot, next);
    pal_transfer_set_state(to, t->x, t->v);
    (void)approach(t, next, &t->snapshot, t->snapshot_energy_J);
    for (size_t i = 0; i < n; i++) t->fix[i] = to->x[i] - t->x[i];
    t->has_rehearsed = true;
}

double pal_transfer_drift_m(const pal_transfer *t, const pal_world *before)
{
    const pal_body *from = &before->plan.body[t->body];
    double max = 0;
    for (int i = 0; i < from->n_node; i++)
        max = fmax(max, pal_dist3(from->d + 3 * (size_t)i, t->snapshot.d + 3 * (size_t)i));
    return max;
}
