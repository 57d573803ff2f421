/* Transfer of places, velocities and energy (transfer.h). Read pal_transfer_apply, at the end, first. */
#include "server/sim/transfer/transfer.h"

#include "server/base/vec3.h"
#include "server/num/conjugate_gradient.h"
#include "server/sim/core/best_rotation.h"
#include "server/sim/core/rigid_motion.h"
#include "server/sim/implicit/system.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/transfer/transfer_core.h"
#include "server/sim/transfer/transfer_world.h"

#include <float.h>
#include <string.h>

/* ---- sums ---- */

static bool elastic(const pal_effect *e)
{
    return e->stage == PAL_STAGE_FORCE && e->energy && (e->internal || e->bounds.stiffness);
}

/* of a body's elastic components where it is; some know their energy as of the last forces */
static double elastic_energy_J(pal_world *w, int body)
{
    double sum = 0;
    if (pal_world_assemble_forces(w, body)) return NAN;
    for (int i = 0; i < w->plan.n_component; i++) {
        const pal_component *component = &w->plan.component[i];
        if (w->plan.component_body[i] == body && elastic(component->effect))
            sum += component->effect->energy(component->self, &w->plan.body[body]);
    }
    return sum;
}

static double world_energy_J(pal_world *w)
{
    double sum = 0;
    for (int b = 0; b < w->plan.n_body; b++) sum += elastic_energy_J(w, b) + pal_body_kinetic_J(&w->plan.body[b]);
    return sum;
}

/* Elastic energy of the old body, and of its world unless all_J is NULL; sets t->unbalanced. f and g are then those of
 * all components but tools, and of a blend that still acts, so that one switch after the other removes no force at
 * once. Its loads stay those of its last step */
static double evaluate_old(pal_transfer *t, pal_world *old, double *all_J)
{
    pal_body *from = &old->plan.body[t->body];
    size_t n = 3 * (size_t)from->n_node, n_byte = n * sizeof(double);
    memcpy(t->load, from->load, n_byte);
    if (all_J)
        *all_J = world_energy_J(old);
    else
        (void)elastic_energy_J(old, t->body);
    for (size_t i = 0; i < n; i++) t->unbalanced[i] = t->load[i] + from->f[i] - from->load[i];
    double sum = elastic_energy_J(old, t->body);
    memset(t->old, 0, n_byte);
    pal_blend_components_add(&old->blends, t->body, 1, from->interpolation ? t->old : from->f);
    if (from->interpolation) pal_interpolation_apply_transpose(from->interpolation, t->old, from->g);
    memcpy(from->load, t->load, n_byte);
    return sum;
}

static bool is_free(const pal_body *body)
{
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) return false;
    return true;
}

/* ---- places and velocities ---- */

void pal_transfer_interpolate_nodes(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    for (int i = 0; i < 3 * from->n_node; i++) t->old[i] = from->d[i] - from->node_rest[i];
    pal_interpolation_apply(&t->A_new, t->old, t->node_x);
    for (int i = 0; i < 3 * to->n_node; i++) t->node_x[i] += to->node_rest[i];
}

typedef struct squares {
    const pal_body *body;
    double *node, regularisation;
} squares;

/* A'A + regularisation, without what is held */
static void multiply(void *user, const double *p, double *out)
{
    const squares *s = user;
    const pal_body *b = s->body;
    pal_interpolation_apply(b->interpolation, p, s->node);
    for (int i = 0; i < 3 * b->n_dof; i++) out[i] = s->regularisation * p[i];
    pal_interpolation_apply_transpose(b->interpolation, s->node, out);
    pal_system_clear_supported(b, out);
}

static void precondition(void *user, const double *r, double *out)
{
    memcpy(out, r, pal_body_bytes3(((const squares *)user)->body));
}

/* points out [n_dof][3] that carry the nodes nearest to `want` [n_node][3]; of what is held 0 */
static void min_squares(pal_transfer *t, const pal_body *to, const double *want, double *out)
{
    const size_t n_byte = pal_body_bytes3(to);
    double *r = t->work[0], max = 0;
    squares s = {.body = to, .node = t->force};
    const pal_interpolation *A = to->interpolation;
    memset(out, 0, n_byte);
    memset(t->work[1], 0, n_byte);
    pal_system_restrict(to, want, r);
    for (int32_t k = 0; k < A->start[A->n_row]; k++) t->work[1][A->point[k]] += A->weight[k] * A->weight[k];
    for (int i = 0; i < to->n_dof; i++) max = fmax(max, t->work[1][i]);
    pal_system_clear_supported(to, r);
    s.regularisation = FLT_EPSILON * max;
    pal_conjugate_gradient cg = {.n = 3 * to->n_dof,
                                 .multiply = multiply,
                                 .precondition = precondition,
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
        for (int i = 0; i < 3 * to->n_node; i++) t->node_x[i] -= to->node_rest[i];
        min_squares(t, to, t->node_x, t->x);
        min_squares(t, to, t->node_v, t->v);
        for (int i = 0; i < 3 * to->n_dof; i++) t->x[i] += to->x_rest[i];
        return;
    }
    memcpy(t->x, t->node_x, n_byte);
    memcpy(t->v, t->node_v, n_byte);
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
    pal_interpolation_free(&t->A_old);
    pal_interpolation_builder_begin(&rows, from->n_node, to->n_node, INT32_MAX);
    for (int32_t i = 0; i < from->n_node && !rows.err; i++) {
        if (pal_dofs_has(&from->dofs, i)) add_vertex(&rows, &from->dofs, &to->dofs, i, 1);
        pal_interpolation_builder_end_row(&rows);
    }
    return pal_interpolation_builder_finish(&rows, &t->A_old) == PAL_ERR_OK;
}

/* ---- forces ---- */

/* releases the difference of forces gradually; on a free body it has no net force and no net moment */
static void blend_forces(pal_transfer *t, pal_world *next)
{
    pal_body *to = &next->plan.body[t->body];
    if (pal_world_assemble_forces(next, t->body)) return;
    for (int i = 0; i < to->n_node; i++) {
        pal_sub3(t->force + 3 * i, t->force + 3 * i, to->f + 3 * i);
        if (!to->interpolation && to->support[i]) pal_set3(t->force + 3 * i, 0, 0, 0);
    }
    if (is_free(to)) pal_rigid_motion_remove(to->n_node, to->node_mass_kg, to->d, true, t->force);
    (void)pal_world_blend_force(next, t->body, t->force);
}

/* ---- energy ---- */

/* false: the rows know no bound of their stiffness */
static bool find_bound(const pal_world *w, int body, double *bound)
{
    const pal_body *to = &w->plan.body[body];
    bool any = false;
    memset(bound, 0, sizeof *bound * (size_t)to->n_node);
    for (int i = 0; i < w->plan.n_of[PAL_STAGE_FORCE][body]; i++) {
        const pal_component *component = &w->plan.component[w->plan.first[PAL_STAGE_FORCE][body] + i];
        if (component->effect->bounds.stiffness)
            component->effect->bounds.stiffness(component->self, to, bound), any = true;
    }
    return any;
}

/* moves nodes by their force residual over their bound, with some of the move before (Polyak's heavy ball: stable, as
 * forces over bounds have no eigenvalue above 1), until the energy has come down; then back to where it was least, as
 * rounds that began far from a balance may end higher. Returns the number of rounds */
static int smooth(pal_transfer *t, pal_world *next, double want_J)
{
    pal_body *to = &next->plan.body[t->body];
    double *step = t->work[0], *best = t->work[1], now_J = elastic_energy_J(next, t->body), max_J = 1.5 * now_J;
    const size_t n_byte = 3 * sizeof *step * (size_t)to->n_dof;
    double best_J = now_J;
    int n = 0;
    if (to->interpolation || !find_bound(next, t->body, t->bound)) return 0;
    memset(step, 0, n_byte);
    memcpy(best, to->x, n_byte);
    int n_max = now_J > PAL_TRANSFER_MAX_SCALE * want_J ? 5 * PAL_TRANSFER_ROUNDS
                : t->has_rehearsed                      ? PAL_TRANSFER_ROUNDS / 4
                                                        : PAL_TRANSFER_ROUNDS;
    for (; n < n_max && now_J > (1 + PAL_SOLVER_TOLERANCE * PAL_SOLVER_TOLERANCE) * want_J && now_J < max_J; n++) {
        for (int k = 0; k < to->n_active; k++) {
            int i = pal_body_point(to, k);
            if (to->support[i] || !(t->bound[i] > 0)) continue;
            for (int c = 3 * i; c < 3 * i + 3; c++) {
                step[c] = PAL_TRANSFER_INERTIA * step[c] + (to->f[c] - t->force[c]) / t->bound[i];
                to->x[c] += step[c];
            }
        }
        pal_body_update_nodes(to);
        now_J = elastic_energy_J(next, t->body); /* and f */
        if (now_J < best_J) best_J = now_J, memcpy(best, to->x, n_byte);
    }
    if (!(now_J <= best_J)) {
        memcpy(to->x, best, n_byte);
        pal_body_update_nodes(to);
        (void)elastic_energy_J(next, t->body);
    }
    return n;
}

/* reference of the displacement: rest, or for a body without supports its best rigid placement */
static void find_reference(const pal_body *to, double *out)
{
    double c[3], c_rest[3], pairs[9] = {0}, r[9], arm[3];
    memcpy(out, to->x_rest, 3 * sizeof *out * (size_t)to->n_dof);
    if (!is_free(to)) return;
    pal_rigid_centre(to->n_dof, to->mass_kg, to->x, c);
    pal_rigid_centre(to->n_dof, to->mass_kg, to->x_rest, c_rest);
    for (int i = 0; i < to->n_dof; i++) {
        pal_sub3(arm, to->x + 3 * i, c);
        pal_add_outer(pairs, to->mass_kg[i], arm, to->x_rest + 3 * i);
    }
    pal_best_rotation(pairs, r);
    for (int i = 0; i < to->n_dof; i++) {
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
    for (int round = 0; round < PAL_TRANSFER_SCALE_ROUNDS; round++) {
        double now_J = elastic_energy_J(next, t->body);
        if (!(now_J > 0) || !(want_J > 0) || fabs(now_J / want_J - 1) <= PAL_SOLVER_TOLERANCE * PAL_SOLVER_TOLERANCE)
            break;
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
    double p[3], l[3], all_J = pal_body_kinetic_J(to), rigid_J = 0, *v = t->work[0];
    size_t n_byte = 3 * sizeof *v * (size_t)to->n_dof;
    memset(v, 0, n_byte);
    if (!(all_J > 0)) return;
    if (is_free(to)) {
        pal_rigid_motion r;
        pal_rigid_motion_of(to->n_dof, to->mass_kg, to->x, to->v, p, l, &r);
        for (int k = 0; k < to->n_active; k++) {
            int i = pal_body_point(to, k);
            pal_rigid_motion_at(&r, to->x + 3 * i, v + 3 * i);
        }
        memcpy(t->work[1], to->v, n_byte);
        memcpy(to->v, v, n_byte);
        pal_body_update_nodes(to);
        rigid_J = pal_body_kinetic_J(to);
        memcpy(to->v, t->work[1], n_byte);
    }
    double s = 1;
    if (all_J > rigid_J * (1 + 1e-9))
        s = within(sqrt(fmax(want_J - rigid_J, 0) / (all_J - rigid_J)), PAL_TRANSFER_MAX_SCALE);
    for (int i = 0; i < 3 * to->n_dof; i++) to->v[i] = v[i] + s * (to->v[i] - v[i]);
    pal_body_update_nodes(to);
}

/* momentum and spin of before */
static void keep_momentum(const pal_body *from, pal_body *to)
{
    double c[3], p[3], l[3], q[3], m[3];
    pal_rigid_motion r;
    pal_rigid_centre(to->n_dof, to->mass_kg, to->x, c);
    pal_rigid_momenta(from->n_dof, from->mass_kg, from->x, from->v, c, p, l);
    pal_rigid_momenta(to->n_dof, to->mass_kg, to->x, to->v, c, q, m);
    pal_sub3(p, p, q);
    pal_sub3(l, l, m);
    pal_rigid_motion_find(to->n_dof, to->mass_kg, to->x, p, l, &r);
    for (int k = 0; k < to->n_active; k++) {
        int i = pal_body_point(to, k);
        double v[3];
        pal_rigid_motion_at(&r, to->x + 3 * i, v);
        pal_add3(to->v + 3 * i, to->v + 3 * i, v);
    }
    pal_body_update_nodes(to);
}

/* ---- the whole ---- */

/* components continue where those of the world before are; forces that they then put on other nodes are released too */
static void transfer_components(pal_transfer *t, pal_world *next, const pal_world *before)
{
    for (int b = 0; b < next->plan.n_body && b < before->plan.n_body; b++) {
        bool own = b == t->body;
        const pal_body *from = &before->plan.body[b];
        const pal_component_transfer by = {.from = from,
                                           .place = own ? pal_transfer_force_map(t) : NULL,
                                           .rest_m = next->part[b].rest_m,
                                           .same_shown = pal_transfer_same_shown(next, before, b),
                                           .left_N = own ? t->force : NULL};
        if (own ? t->A_old.n_row == 0 : next->plan.body[b].n_node != from->n_node) continue;
        pal_transfer_components(next, b, before, PAL_STAGE_CONTACT, &by);
        if (own) pal_transfer_components(next, b, before, PAL_STAGE_ADAPT, &by);
    }
}

static void place_points(pal_transfer *t, const pal_body *from, pal_world *next)
{
    pal_body *to = &next->plan.body[t->body];
    if (!t->adaptive) {
        pal_transfer_interpolate_nodes(t, from, to);
        pal_interpolation_apply(&t->A_new, from->dv, t->node_v);
        set_points(t, from, to);
        return;
    }
    to->dofs.transfer(to, from, next->plan.n_of[PAL_STAGE_ADAPT][t->body] > 0, t->x, t->v);
    (void)make_back(t, from, to);
}

/* from places by interpolation, with what a rehearsal added to them, to smooth ones; from->f and g are known. Rounds */
static int relax(pal_transfer *t, pal_world *next, const pal_body *from, double want_J)
{
    pal_body *to = &next->plan.body[t->body];
    for (int i = 0; i < 3 * to->n_dof && t->has_rehearsed; i++) to->x[i] += t->fix[i];
    if (t->has_rehearsed) pal_body_update_nodes(to);
    if (t->A_old.n_row == 0) return 0;
    pal_transfer_make_force_map(t, from, to);
    pal_world_transfer_loads(next, t->body, from, &t->A_old);
    pal_transfer_forces(t, from, to);
    return smooth(t, next, want_J);
}

void pal_transfer_apply(pal_transfer *transfer, pal_world *next, const pal_world *before, pal_transfer_report *out)
{
    pal_transfer *t = transfer;
    pal_world *old = (pal_world *)(uintptr_t)before; /* its forces are worked out again */
    pal_body *from = &old->plan.body[t->body], *to = &next->plan.body[t->body];
    *out = (pal_transfer_report){.scale = 1};
    double elastic_before_J = evaluate_old(t, old, &out->energy_before_J), kinetic_J = pal_body_kinetic_J(from);
    double spare_J = PAL_SOLVER_TOLERANCE * PAL_SOLVER_TOLERANCE * (elastic_before_J + kinetic_J);
    place_points(t, from, next);
    pal_world_transfer(next, before, t->body, t->x, t->v);
    out->interpolated_J = world_energy_J(next);
    out->n_smooth = relax(t, next, from, elastic_before_J);
    pal_world_invalidate_limits(next, t->body); /* components decide again about recovery */
    out->scale = scale_displacement(t, next, elastic_before_J);
    if (is_free(to)) keep_momentum(from, to);
    /* the velocity makes up for what the displacement could not */
    double now_J = pal_body_kinetic_J(to), left_J = elastic_before_J + kinetic_J - elastic_energy_J(next, t->body);
    scale_velocity(t, to, fmin(fmax(now_J, left_J - spare_J), left_J + spare_J));
    pal_transfer_set_state(to, NULL, NULL);
    to->safeguards = from->safeguards;
    pal_world_invalidate_limits(next, t->body);
    pal_world_show_all(next);
    transfer_components(t, next, before);
    if (t->A_old.n_row > 0) blend_forces(t, next);
    pal_brush_components_transfer(&next->brushes, &next->plan, &before->brushes, &before->plan);
    out->energy_after_J = world_energy_J(next);
    out->body_move_m = pal_transfer_body_move(t, from, to);
    pal_transfer_display(t, next, before, out);
}

/* ---- rehearsal, while the old world runs ---- */

/* copies an array into memory that *to keeps */
static bool save(pal_arena *arena, double **to, const double *from, int n)
{
    if (!*to && !(*to = PAL_NEW(arena, double, n))) return false;
    memcpy(*to, from, (size_t)n * sizeof **to);
    return true;
}

bool pal_transfer_snapshot(pal_transfer *t, const pal_world *before)
{
    pal_world *old = (pal_world *)(uintptr_t)before; /* its forces are computed again */
    const pal_body *from = &old->plan.body[t->body];
    pal_body had = t->snapshot, *s = &t->snapshot;
    int dof = 3 * from->n_dof, node = 3 * from->n_node;
    if (t->adaptive || from->frozen) return false;
    t->snapshot_energy_J = evaluate_old(t, old, NULL);
    *s = *from;
    s->x = had.x, s->v = had.v, s->g = had.g, s->f = had.f, s->d = had.d, s->dv = had.dv;
    s->mass_kg = had.mass_kg, s->node_mass_kg = had.node_mass_kg, s->support = had.support;
    if (from->external_force) s->external_force = had.external_force;
    if (!s->support && !(s->support = PAL_NEW(t->arena, uint8_t, from->n_dof))) return false;
    memcpy(s->support, from->support, (size_t)from->n_dof);
    return save(t->arena, &s->x, from->x, dof) && save(t->arena, &s->v, from->v, dof) &&
           save(t->arena, &s->g, from->g, dof) && save(t->arena, &s->f, from->f, node) &&
           save(t->arena, &s->d, from->d, node) && save(t->arena, &s->dv, from->dv, node) &&
           save(t->arena, &s->mass_kg, from->mass_kg, from->n_dof) &&
           save(t->arena, &s->node_mass_kg, from->node_mass_kg, from->n_node) &&
           (!from->external_force || save(t->arena, &s->external_force, from->external_force, node)) &&
           isfinite(t->snapshot_energy_J);
}

void pal_transfer_rehearse(pal_transfer *t, pal_world *next)
{
    pal_body *to = &next->plan.body[t->body];
    size_t n = 3 * (size_t)to->n_dof;
    if (!t->fix) t->fix = PAL_NEW(t->arena, double, n);
    if (!t->fix) return;
    place_points(t, &t->snapshot, next);
    pal_transfer_set_state(to, t->x, t->v);
    (void)relax(t, next, &t->snapshot, t->snapshot_energy_J);
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
