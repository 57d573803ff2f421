/* Solver verlet: v += dt f/m, x += dt v (the velocity form of paper B section 4.1).
 *
 * Departures. Drag is implicit: v <- (v + dt f/m) / (1 + dt rate), where the rate is the sum of the components' drag
 * rates; it is stable for every rate. The sub-step is `safety` (key, 0.9) of the stability limit by Gershgorin's
 * bound: with K and C the row sums of stiffness and explicit damping, dt = safety * 2 t where t is the largest with
 * t^2 K + t C <= m at every free node. Voxel bodies of springs are stable up to 1.5 times that limit and more (power
 * iteration, at rest and pulled); those of edges alone less far, but their row sums do not change. The bound is
 * recomputed when a node may have moved a fifth of an element; where it does in every sub-step of half of the limit, in
 * one of four of these. Prescribed nodes keep their velocity. step_guard.h limits displacements.
 *
 * Contact takes no part of the stability. Its stiffness K_c is taken implicitly by a diagonal D (body->load_stiffness):
 * (m + dt^2 D) dv = dt f, as in a linearly implicit Euler step with a lumped matrix. With D >= K_c / 2 and a damping of
 * contact of dt/2 K_c, x'(dt^2 K + 2 dt^2 K_c) x < 4 x'(M + dt^2 D) x whenever dt^2 K < 4 M: stable for any stiffness
 * of contact, which therefore does not depend on the sub-step. A node at rest has the same balance. Grasps, whose
 * damper is k damping_s, add k + c/dt; friction is a part of K_c that D leaves out, far below what tissue leaves. The
 * lumped mass is heavier than the tissue held: a light free body that is grasped starts more slowly. m dv = dt (f - dt
 * D dv) is what a node receives, and dt dv goes to the components that told f (settle).
 *
 * Forces of springs are in single precision (springs/spring_single.h) while a body with supports moves. Roundings of
 * its positions, 1e-6 of an element, are random kicks, which do not let it come to rest: where no node moves by a
 * hundred times as much in a sub-step, forces are in double precision. So are those of a free body, which would keep
 * what roundings of sums give it as momentum, and of one that reaches so far that the kicks alone keep it moving.
 *
 * Where the budget of sub-steps is exhausted (step->adds_mass), mass is added to the nodes that break the inequality at
 * PAL_FAST_SAFETY: such bodies are far from the shape that the bound is of.
 * Changes of added mass would add energy, so such a node loses up to a hundredth of its velocity per sub-step.
 * Components check for inverted elements whenever the bound is computed, and in every step while there are any. */
#include "server/base/clock.h"
#include "server/base/team.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/step_guard.h"
#include "server/sim/solvers/tuning.h"

#include <string.h>

/* what a part of the nodes has come to in a sub-step */
typedef struct part_result {
    double max2, non_finite; /* largest v^2, m^2/s^2; 0, or NaN where one is not finite */
    uint64_t n_clamped, ns;  /* nodes whose move was shortened, and the time that took  */
} part_result;

typedef struct verlet {
    double *stiff, *damp; /* Gershgorin row sums, N/m and Ns/m [n_dof] */
    double *moved_by_m;   /* dt dv of the last sub-step where body->load_stiffness is not 0 [n_dof][3] */
    double safety;        /* of the stability limit             */
    double stable_s;      /* that limit                         */
    double moved_m;       /* upper bound of motion since the bound was computed */
    double speed_m_s;     /* largest of the last sub-step                        */
    part_result *result;  /* of the last sub-step                              [n_part] */
    int n_since;          /* sub-steps since then                                */
    bool known;           /* stable_s holds                                      */
    bool suits_single;    /* forces may be in single precision where nodes move */
    bool has_inversion;   /* bounds must be computed again in the coming step */
} verlet;

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double safety = 0.9;
    PAL_TRY(pal_entry_read_number(item, "safety", 0.01, 0.9, &safety, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    verlet *solver = PAL_NEW(build->arena, verlet, 1);
    if (!solver) return PAL_ERR_MEMORY;
    if (!PAL_NEW_DOUBLES(build->arena, build->body->n_dof, &solver->stiff, &solver->damp, &build->body->load_stiffness))
        return PAL_ERR_MEMORY;
    solver->moved_by_m = PAL_NEW(build->arena, double, 3 * (size_t)build->body->n_dof);
    if (!solver->moved_by_m) return PAL_ERR_MEMORY;
    solver->result = PAL_NEW(build->arena, part_result, pal_node_order_parts(build->body->node_order));
    if (!solver->result) return PAL_ERR_MEMORY;
    solver->safety = safety;
    *self = solver;
    return PAL_ERR_OK;
}

/* nodes pass a fifth of an element in each sub-step of half of the limit */
static bool is_fast(const verlet *solver, double move_m)
{
    return solver->speed_m_s * PAL_FAST_SAFETY * solver->stable_s > move_m;
}

static double usable_s(const verlet *solver, double move_m)
{
    return (is_fast(solver, move_m) ? fmin(solver->safety, PAL_FAST_SAFETY) : solver->safety) * solver->stable_s;
}

/* largest speed of a node: what the last sub-step left, wherever the state has come from since */
static double max_speed_m_s(const pal_body *body)
{
    double max2 = 0;
    for (int i = 0; i < body->n_dof; i++) max2 = fmax(max2, pal_dot3(body->v + 3 * i, body->v + 3 * i));
    return sqrt(max2);
}

/* a node is fixed or prescribed, so that momentum comes and goes, and all are near the one that positions are relative
 * to */
static bool suits_single(const pal_body *body)
{
    if (!body->node_order) return false;
    const double *origin = body->d + 3 * (size_t)pal_node_order_origin(body->node_order);
    bool held = false;
    double far_m = 0;
    for (int i = 0; i < body->n_dof; i++) held |= body->support[i] != 0;
    for (int i = 0; i < body->n_node && held; i++) far_m = fmax(far_m, pal_dist3(body->d + 3 * i, origin));
    return held && far_m <= PAL_SINGLE_REACH * body->edge_m;
}

/* safety times the smallest over free nodes of 2 t, t the positive root of t^2 K + t C = m */
static double limit(void *self, pal_step *step)
{
    verlet *solver = self;
    const pal_body *body = step->body;
    bool contact = step->sub == 0 && pal_guard_has_bounds(step->contact, step->n_contact);
    bool has_inversion = step->sub == 0 && solver->has_inversion;
    const double move_m = PAL_GUARD_MOVE * body->edge_m;
    const bool holds = solver->moved_m <= move_m || (is_fast(solver, move_m) && solver->n_since < PAL_FAST_SUBSTEPS);
    if (solver->known && !contact && !has_inversion && holds) return usable_s(solver, move_m);
    if (!solver->known) solver->speed_m_s = max_speed_m_s(body);
    solver->has_inversion = pal_guard_recover(step) & PAL_INVERTED;
    size_t n_byte = sizeof(double) * (size_t)body->n_dof;
    memset(solver->stiff, 0, n_byte);
    memset(solver->damp, 0, n_byte);
    pal_guard_add_bounds(step->force, step->n_force, body, solver->stiff, solver->damp);
    pal_guard_add_bounds(step->contact, step->n_contact, body, solver->stiff, solver->damp);
    double min = INFINITY, sum = 0;
    for (int i = 0; i < body->n_dof; i++) {
        double k = solver->stiff[i], c = solver->damp[i], m = body->mass_kg[i];
        sum += 0 * k + 0 * c;
        if (body->support[i] || k + c == 0) continue;
        double dt = 4 * m / (c + sqrt(c * c + 4 * k * m));
        if (dt < min) min = dt;
    }
    solver->stable_s = sum == 0 ? min : NAN;
    solver->suits_single = suits_single(body);
    solver->moved_m = 0;
    solver->n_since = 0;
    solver->known = true;
    return usable_s(solver, move_m);
}

typedef struct pass {
    verlet *solver;
    pal_body *body;
    double dt, keep, max_m; /* keep: by drag, of a velocity; max_m: of a node */
    bool adds_mass;
    int n_part;
} pass;

/* new velocities of nodes; largest of their squares, and 0 or NaN */
static void push_nodes(const pass *p, int first, int end, part_result *out)
{
    const verlet *solver = p->solver;
    const pal_body *body = p->body;
    const double dt = p->dt, root = dt / (2 * fmin(solver->safety, PAL_FAST_SAFETY));
    double max2 = 0, non_finite = 0;
    for (int i = first; i < end; i++) {
        double *v = body->v + 3 * i, m = body->mass_kg[i];
        const double *g = body->g + 3 * i;
        const double load_kg = dt * dt * body->load_stiffness[i];
        double s = body->support[i] ? 0 : dt / (m + load_kg), k = !body->support[i]       ? p->keep
                                                                  : body->support[i] == 2 ? 1
                                                                                          : 0;
        if (p->adds_mass && !body->support[i]) {
            double heavy = fmax(m, root * (root * solver->stiff[i] + solver->damp[i]));
            s = dt / (heavy + load_kg), k *= 1 - PAL_HEAVY_LOSS * (1 - m / heavy);
        }
        if (load_kg > 0) pal_scale3(solver->moved_by_m + 3 * (size_t)i, dt * s, g);
        for (int c = 0; c < 3; c++) v[c] = k * (v[c] + s * g[c]);
        double v2 = pal_dot3(v, v);
        max2 = v2 > max2 ? v2 : max2;
        non_finite += 0 * v2;
    }
    out->max2 = max2, out->non_finite = non_finite;
}

/* velocities and positions of a part of the nodes */
static void move_part(void *user, int worker, int part)
{
    const pass *p = user;
    const pal_body *body = p->body;
    const int first = pal_part_first(body->n_dof, p->n_part, part),
              end = pal_part_first(body->n_dof, p->n_part, part + 1);
    part_result made = {0};
    (void)worker;
    push_nodes(p, first, end, &made);
    if (sqrt(made.max2) * p->dt > p->max_m) {
        uint64_t before = pal_clock_ns();
        for (int i = first; i < end; i++) {
            double *v = body->v + 3 * i;
            pal_scale3(v, pal_guard_shorten(pal_norm3(v) * p->dt, p->max_m, &made.n_clamped), v);
        }
        made.ns = pal_clock_ns() - before;
    }
    for (int i = 3 * first; i < 3 * end; i++) body->x[i] += p->dt * body->v[i];
    p->solver->result[part] = made;
}

/* moves far enough in a sub-step that roundings of positions are nothing beside */
static bool takes_single(const verlet *solver, const pal_body *body, double dt_s)
{
    return solver->suits_single && solver->speed_m_s * dt_s > PAL_SINGLE_MOVE * body->edge_m;
}

/* tells tools the forces at the end of the sub-step */
static void settle(const verlet *solver, const pal_step *step)
{
    pal_step contact = *step;
    contact.drag_separate = contact.single = false;
    for (int i = 0; i < step->n_contact; i++) {
        const pal_tangent *tangent = step->contact[i].effect->tangent;
        if (tangent && tangent->settle)
            (void)tangent->settle(step->contact[i].self, &contact, solver->moved_by_m, true);
    }
}

static pal_err run(void *self, pal_step *step)
{
    verlet *solver = self;
    pal_body *body = step->body;
    double dt = step->dt_s, max2 = 0, non_finite = 0;
    pass p = {.solver = solver,
              .body = body,
              .dt = dt,
              .keep = 1 / (1 + dt * pal_guard_drag_1_s(step->force, step->n_force)),
              .max_m = pal_guard_max_move_m(body),
              .adds_mass = step->adds_mass,
              .n_part = pal_node_order_parts(body->node_order)};
    step->drag_separate = true, step->single = takes_single(solver, body, dt);
    PAL_TRY(pal_assemble_forces(step));
    pal_team_run(body->team, p.n_part, move_part, &p);
    for (int i = 0; i < p.n_part; i++) {
        const part_result *made = &solver->result[i];
        max2 = made->max2 > max2 ? made->max2 : max2;
        non_finite += made->non_finite;
        body->safeguards.n_clamped += made->n_clamped, body->safeguards.ns += made->ns;
    }
    /* a non-finite velocity makes the displacement, and so the next limit, non-finite */
    solver->speed_m_s = fmin(sqrt(max2), p.max_m / dt) + non_finite;
    solver->moved_m += solver->speed_m_s * dt;
    solver->n_since++;
    settle(solver, step);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    verlet *solver = self;
    solver->known = false;
}

const pal_effect pal_effect_verlet = {PAL_EFFECT("verlet", SOLVE), .moves_nodes = true, .bounds.limit = limit,
                                      .reset = reset};
