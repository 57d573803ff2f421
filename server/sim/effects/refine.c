/* Component refine: splits the faces of an adaptive surface where it is pressed, moves or bends, and joins them
 * where it is quiet (paper C, criterion for refinement and simplification, fig. 2). Once in every_s of simulated time
 *
 *   split   every leaf that has a node beyond a threshold, as a corner or hanging on a side, by one level
 *   join    every face whose children are leaves if all their corners are below half of every threshold and the
 *           midpoints of its edges are where a split would put them: the coarse face loses less curvature than a
 *           quarter of the threshold, so that it is not split again for this loss
 *
 * Thresholds are of external force, speed relative to the rigid motion, and change of curvature (refine_measure.h).
 *
 * Departures. The paper has one threshold for both directions and flickers at it. Here a face keeps its state for
 * dwell_s, also where a finer neighbour would have it split, so that it switches at most 1/dwell_s times a second. A
 * face that was joined too early waits up to 8 times as long the next time. One that was split again four times under
 * the same loads stays split until they change, so that a body at rest stops switching. A node with a lasting load is
 * not removed. New nodes first relax towards equilibrium with the others fixed, while they store more energy than there
 * was before: a bent coarse face has no strain, but its finer springs would. The changes of one evaluation are one
 * switch, which conserves energy, momentum and angular momentum. The stiffness of springs and of anchors gets one
 * factor each that keeps their energies and returns to 1 in ramp_s. The velocities of the changed region (new nodes and
 * those of changed mass), or of the whole body where it is too small, get a rigid motion that restores both momenta,
 * and their deviations from it are scaled to restore the total energy.
 *
 * Keys: force_N (default: 0.005 k_0 h_0; k_0 the spring constant and h_0 the mean edge of level 0), speed_m_s
 * (default: 0.05 h_0 sqrt(k_0/m_0)), curvature_1_m (default: 0.3/h_0); 0 disables a criterion, and with all three
 * disabled nothing ever changes. dwell_s (0.2), every_s (1/120), most_node (0: no limit), ramp_s (0.15; 0: no
 * factors). A body unchanged since the last evaluation is evaluated again only after dwell_s; until that finds no
 * present or deferred change, the body does not sleep (component sleep). */
#include "server/base/vec3.h"
#include "server/sim/core/blend.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/rigid_motion.h"
#include "server/sim/effects/tuning.h"
#include "server/sim/surface/refine_measure.h"

#include <limits.h>
#include <string.h>

enum { NOTHING, SPLIT, JOIN };

/* nodes of a region, in the order of `node` [n_vertex] */
typedef struct gathered {
    int32_t *node;
    double *mass_kg, *x, *v_m_s;
} gathered;

typedef struct refine {
    pal_adaptive_surface *adaptive;
    pal_body *body;
    pal_refine_measure measure;
    pal_refine_limits limits;
    bool given_force, given_speed; /* given by the scene: a live material edit does not change them */
    double k_N_m;                  /* given by the model; 0: from the material             */
    double thickness_m, edge_m, kg_per_density;
    double dwell_s, every_s, ramp_s;
    int max_node;

    struct {
        double clock_s, wait_s;        /* simulated since reset; until the next evaluation              */
        double seen_s, seen_load2;     /* clock and sum of squared loads at the last one                */
        double moved_m;                /* bound of the displacement since then                          */
        double steady_s, steady_load2; /* since when that sum has been the same, and its value       */
        double spring_s, shape_s;      /* remaining blend of each factor to 1                           */
    } time;
    bool deferred;                /* the last evaluation had requests deferred by dwell_s                */
    bool seen_twice;              /* nothing had moved since the one before, and it changed nothing      */
    uint64_t seen_revision;       /* 0: there was no evaluation                                    */
    uint8_t *backoff;             /* log2 of the factor on a face's waiting time before it is joined; HELD: it is not,
                                   * while the loads are the same [n faces] */
    bool holds;                   /* a face is HELD                                                      */
    double *switched_s;           /* time of a face's last switch [n faces] */
    uint8_t *action;              /* request of each leaf of the list, or of its parent [n_slot] */
    double *mass_was;             /* values before the switch, valid where `seen` is its number [n_vertex] */
    uint64_t *seen;               /* [n_vertex]                                                     */
    double *zero_m_s, *bound_N_m; /* velocities [n_vertex][3]; stiffness of the components [n_vertex] */
    gathered gathered;
    double inner_J; /* kinetic energy without the rigid motion, before the switch */
    pal_refine_history report;
} refine;

enum { MAX_BACKOFF = 3, HELD = MAX_BACKOFF + 1, MAX_RELAX = 8 };

/* ---- load ---- */

static void clear(refine *state)
{
    const pal_levels *levels = &state->adaptive->levels;
    for (int32_t f = 0; f < levels->first_face[levels->n_level]; f++) {
        state->switched_s[f] = -INFINITY;
        state->backoff[f] = 0;
    }
    memset(&state->time, 0, sizeof state->time);
    state->seen_revision = 0;
    state->deferred = state->seen_twice = state->holds = false;
    memset(state->seen, 0, sizeof *state->seen * (size_t)levels->n_vertex[levels->n_level - 1]);
    state->report = (pal_refine_history){0};
    memcpy(state->measure.frame.quat, (double[4]){1}, sizeof state->measure.frame.quat);
}

/* defaults of the thresholds */
static void derive(refine *state, const pal_material *material)
{
    double k = state->k_N_m > 0 ? state->k_N_m : 0.5 * sqrt(3) * material->young_Pa * state->thickness_m;
    double m = state->kg_per_density * material->density_kg_m3;
    if (!state->given_force) state->limits.force_N = 0.005 * k * state->edge_m;
    if (!state->given_speed) state->limits.speed_m_s = 0.05 * state->edge_m * sqrt(k / m);
}

static pal_err read_keys(refine *state, pal_config_entry *item, const pal_build *build)
{
    pal_diagnostic *diag = build->diag;
    pal_config_entry model = build->def->model;
    state->thickness_m = 0.003, state->dwell_s = 0.2, state->every_s = 1.0 / 120, state->ramp_s = 0.15;
    PAL_TRY(pal_entry_read_number(&model, "thickness_m", 1e-9, 1e9, &state->thickness_m, diag));
    PAL_TRY(pal_entry_read_number(&model, "k_spring_N_m", 0, 1e30, &state->k_N_m, diag));
    state->given_force = pal_entry_has(item, "force_N"), state->given_speed = pal_entry_has(item, "speed_m_s");
    state->limits.curvature_1_m = 0.3 / state->edge_m;
    derive(state, &build->def->material);
    PAL_TRY(pal_entry_read_number(item, "force_N", 0, 1e12, &state->limits.force_N, diag));
    PAL_TRY(pal_entry_read_number(item, "speed_m_s", 0, 1e12, &state->limits.speed_m_s, diag));
    PAL_TRY(pal_entry_read_number(item, "curvature_1_m", 0, 1e12, &state->limits.curvature_1_m, diag));
    PAL_TRY(pal_entry_read_number(item, "dwell_s", 0, 1e6, &state->dwell_s, diag));
    PAL_TRY(pal_entry_read_number(item, "every_s", 0, 1e6, &state->every_s, diag));
    PAL_TRY(pal_entry_read_number(item, "ramp_s", 0, 1e6, &state->ramp_s, diag));
    PAL_TRY(pal_entry_read_count(item, "most_node", 0, INT_MAX, &state->max_node, diag));
    return pal_entry_check_unused(item, diag);
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_adaptive_surface *adaptive = build->body->model.adaptive;
    if (!adaptive)
        return PAL_REFUSE(build->diag, "%s: refine needs a surface of levels, model adaptive_springs", item->path);
    const pal_levels *levels = &adaptive->levels;
    size_t n_vertex = (size_t)levels->n_vertex[levels->n_level - 1];
    refine *state = PAL_NEW(build->arena, refine, 1);
    if (!state) return PAL_ERR_MEMORY;
    state->adaptive = adaptive;
    state->body = build->body;
    state->edge_m = pal_adaptive_mean_edge_m(levels, 0);
    state->kg_per_density = adaptive->level_mass_kg[0] / build->def->material.density_kg_m3;
    PAL_TRY(read_keys(state, item, build));
    PAL_TRY(pal_refine_measure_make(&state->measure, adaptive, build->arena));
    state->switched_s = PAL_NEW(build->arena, double, levels->first_face[levels->n_level]);
    state->backoff = PAL_NEW(build->arena, uint8_t, levels->first_face[levels->n_level]);
    state->action = PAL_NEW(build->arena, uint8_t, adaptive->n_slot);
    state->seen = PAL_NEW(build->arena, uint64_t, n_vertex);
    state->gathered.node = PAL_NEW(build->arena, int32_t, n_vertex);
    if (!PAL_NEW_DOUBLES(build->arena, n_vertex, &state->mass_was, &state->bound_N_m, &state->gathered.mass_kg) ||
        !PAL_NEW_DOUBLES(build->arena, 3 * n_vertex, &state->zero_m_s, &state->gathered.x, &state->gathered.v_m_s) ||
        !state->switched_s || !state->backoff || !state->action || !state->seen || !state->gathered.node)
        return PAL_ERR_MEMORY;
    clear(state);
    *self = state;
    return PAL_ERR_OK;
}

/* ---- requests from the present state ---- */

/* the loads have changed: no face is HELD any longer */
static void let_go(refine *state)
{
    const pal_levels *levels = &state->adaptive->levels;
    for (int32_t f = 0; f < levels->first_face[levels->n_level] && state->holds; f++)
        if (state->backoff[f] == HELD) state->backoff[f] = MAX_BACKOFF;
    state->holds = false;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    (void)body, (void)diag;
    derive(self, to);
    let_go(self);
    return PAL_ERR_OK;
}

/* true: the face has kept its state long enough */
static bool settled(const refine *state, int32_t face)
{
    bool split = state->adaptive->face_state[face] == PAL_FACE_SPLIT;
    return state->time.clock_s - state->switched_s[face] >=
           (split && state->backoff[face] == HELD
                ? INFINITY
                : ldexp(state->dwell_s, split ? state->backoff[face] : 0) * (1 - 1e-9));
}

/* A split soon after a join, or under the loads of that join, doubles the face's waiting time; under the same loads
 * the longest is not waited twice */
static void note_split(refine *state, int32_t face)
{
    const bool early = state->time.clock_s - state->switched_s[face] < ldexp(state->dwell_s, MAX_BACKOFF);
    const bool steady = state->time.steady_s < state->switched_s[face];
    state->backoff[face] = early || steady ? (uint8_t)fmin(state->backoff[face] + 1, steady ? HELD : MAX_BACKOFF) : 0;
    state->holds |= state->backoff[face] == HELD;
    state->switched_s[face] = state->time.clock_s;
}

/* true: the leaf may be split, with the coarser neighbours that the 2:1 rule requires */
static bool may_split(const refine *state, int32_t face)
{
    const pal_adaptive_surface *adaptive = state->adaptive;
    const pal_levels *levels = &adaptive->levels;
    if (!settled(state, face)) return false;
    for (int k = 0; k < 3; k++) {
        const pal_winged_edge *edge = &levels->edge[levels->face_edge[3 * (size_t)face + k]];
        int32_t beside = edge->face[edge->face[0] == face];
        if (beside < 0 || adaptive->face_state[beside] != PAL_FACE_ABSENT) continue;
        if (!may_split(state, pal_levels_face_parent(levels, beside))) return false;
    }
    return true;
}

static bool wants_split(const refine *state, int32_t leaf)
{
    const pal_adaptive_surface *adaptive = state->adaptive;
    const pal_levels *levels = &adaptive->levels;
    if (levels->face_level[leaf] + 1 >= levels->n_level) return false;
    bool any = false;
    for (int k = 0; k < 3 && !any; k++) {
        int32_t edge = levels->face_edge[3 * (size_t)leaf + k];
        any = state->measure.mark[levels->face[3 * (size_t)leaf + k]] == PAL_REFINE_REQUESTED ||
              (adaptive->edge_split[edge] > 0 &&
               state->measure.mark[pal_levels_edge_midpoint(levels, edge)] == PAL_REFINE_REQUESTED);
    }
    return any;
}

/* true: the edge's midpoint is where the coarse edge places it, up to a deflection far below the threshold */
static bool is_straight(const refine *state, const pal_body *body, int32_t edge)
{
    const pal_adaptive_surface *adaptive = state->adaptive;
    const int32_t *end = adaptive->levels.edge[edge].vertex, middle = pal_levels_edge_midpoint(&adaptive->levels, edge);
    if (!(state->limits.curvature_1_m > 0)) return true;
    double at[3], h = pal_dist3(body->x_rest + 3 * (size_t)end[0], body->x_rest + 3 * (size_t)end[1]);
    double bend = state->limits.curvature_1_m * ldexp(1, adaptive->levels.edge_level[edge]);
    pal_adaptive_midpoint(adaptive, body, edge, at);
    return pal_dist3(at, body->x + 3 * (size_t)middle) < 0.25 * bend * h * h / 8;
}

static bool wants_join(const refine *state, const pal_body *body, int32_t face)
{
    const pal_levels *levels = &state->adaptive->levels;
    bool all = true;
    for (int k = 0; k < 3 && all; k++) {
        const int32_t edge = levels->face_edge[3 * (size_t)face + k], middle = pal_levels_edge_midpoint(levels, edge);
        all = state->measure.mark[levels->face[3 * (size_t)face + k]] == PAL_REFINE_QUIET &&
              state->measure.mark[middle] == PAL_REFINE_QUIET && is_straight(state, body, edge) &&
              !(body->external_force && pal_norm3(body->external_force + 3 * (size_t)middle) > 0);
    }
    return all;
}

/* sets the requests of the leaves of the list; false: none */
static bool find_requests(refine *state, const pal_body *body)
{
    const pal_adaptive_surface *adaptive = state->adaptive;
    const pal_levels *levels = &adaptive->levels;
    bool any = false;
    state->deferred = false;
    for (int k = 0; k < adaptive->n_leaf; k++) {
        const int32_t leaf = adaptive->leaf[k];
        const int level = levels->face_level[leaf];
        /* the first child represents its parent */
        const bool first = level > 0 && (leaf - levels->first_face[level]) % 4 == 0;
        const int32_t parent = first ? pal_levels_face_parent(levels, leaf) : -1;
        int action = NOTHING;
        if (wants_split(state, leaf))
            action = SPLIT;
        else if (parent >= 0 && pal_adaptive_can_join(adaptive, parent) && wants_join(state, body, parent))
            action = JOIN;
        const bool now = action == SPLIT ? may_split(state, leaf) : action == NOTHING || settled(state, parent);
        state->deferred |= !now && !(action == JOIN && state->backoff[parent] == HELD);
        state->action[k] = (uint8_t)(now ? action : NOTHING);
        any |= state->action[k] != NOTHING;
    }
    return any;
}

/* ---- a switch ---- */

static bool execute_requests(refine *state, pal_body *body)
{
    pal_adaptive_surface *adaptive = state->adaptive;
    uint64_t n_split = 0, n_join = 0;
    for (int k = 0; k < adaptive->n_leaf; k++)
        if (state->action[k] == SPLIT && adaptive->face_state[adaptive->leaf[k]] == PAL_FACE_LEAF)
            n_split += (uint64_t)pal_adaptive_split(adaptive, body, adaptive->leaf[k], state->max_node);
    /* every leaf of the list is split at most once in a switch, by its own request or a neighbour's */
    for (int k = 0; k < adaptive->n_leaf && n_split > 0; k++)
        if (adaptive->face_state[adaptive->leaf[k]] == PAL_FACE_SPLIT) note_split(state, adaptive->leaf[k]);
    for (int k = 0; k < adaptive->n_leaf; k++) {
        if (state->action[k] != JOIN) continue;
        int32_t parent = pal_levels_face_parent(&adaptive->levels, adaptive->leaf[k]);
        if (!pal_adaptive_can_join(adaptive, parent) || !pal_adaptive_join(adaptive, body, parent)) continue;
        state->switched_s[parent] = state->time.clock_s;
        n_join++;
    }
    state->report.n_split += n_split, state->report.n_join += n_join;
    return n_split + n_join > 0;
}

/* one Jacobi iteration for the new nodes alone, towards the balance of the components' forces at rest; changes f */
static bool relax_once(refine *state, pal_step *step)
{
    pal_body *body = step->body;
    /* v as well: the frame of anchors is fitted to it */
    double *v = body->v, *dv = body->dv;
    body->v = body->dv = state->zero_m_s;
    bool done = pal_assemble_forces(step) == PAL_ERR_OK;
    body->v = v, body->dv = dv;
    for (int k = 0; k < body->n_active && done; k++) {
        const size_t i = (size_t)pal_body_point(body, k);
        if (state->seen[i] == state->report.n_switch || body->support[i] || !(state->bound_N_m[i] > 0)) continue;
        double move[3];
        for (size_t c = 0; c < 3; c++) move[c] = (body->f[3 * i + c] - body->load[3 * i + c]) / state->bound_N_m[i];
        done = isfinite(pal_norm3(move));
        if (done) pal_add3(body->x + 3 * i, body->x + 3 * i, move);
    }
    return done;
}

/* relaxes new nodes while springs, anchors and similar components store more energy than before the switch */
static void relax(refine *state, pal_step *step)
{
    const pal_body *body = step->body;
    const pal_refine_balance *before = &state->report.before;
    const double was = pal_refine_balance_total_J(before) - before->kinetic_J, min = RAMP_FROM * (was + state->inner_J);
    for (int k = 0; k < body->n_active; k++) state->bound_N_m[pal_body_point(body, k)] = 0;
    for (int i = 0; i < step->n_force; i++)
        if (step->force[i].effect->bounds.stiffness)
            step->force[i].effect->bounds.stiffness(step->force[i].self, body, state->bound_N_m);
    for (int round = 0; round < MAX_RELAX && pal_components_energy_J(step->force, step->n_force, body) - was > min;
         round++)
        if (!relax_once(state, step)) return;
}

/* true: free and of the changed region, unless that is the whole body */
static bool in_region(const refine *state, const pal_body *body, bool whole, int i)
{
    if (body->support[i]) return false;
    if (whole || state->seen[i] != state->report.n_switch) return true;
    return fabs(body->mass_kg[i] - state->mass_was[i]) > PAL_ROUNDING * state->mass_was[i];
}

/* restores the energy of springs or anchors by their ramp; returns it, J */
static double keep_elastic(const refine *state, double was_J, double now_J, double other_J, double *ramp,
                           double *left_s)
{
    const pal_refine_balance *before = &state->report.before;
    const double was = *ramp, min = RAMP_FROM * (state->inner_J + before->spring_J + before->shape_J);
    if (state->ramp_s > 0 && fabs(now_J - was_J) > min) {
        /* negligible beside the other's energy: as it is */
        if (was_J > 1e-9 * other_J && now_J > 1e-9 * other_J)
            *ramp = fmin(fmax(was * was_J / now_J, 1 / (PAL_CHANGE_MAX * PAL_CHANGE_MAX)), PAL_CHANGE_MAX);
        *left_s = state->ramp_s;
    }
    return now_J * *ramp / was;
}

/* momenta about its centre, and energies, of the gathered nodes */
typedef struct region {
    int n;
    pal_rigid_motion motion;
    double momentum[3], moment[3], rigid_J, inner_J;
} region;

static double rigid_J(const pal_rigid_motion *motion, const double momentum[3], const double moment[3])
{
    return 0.5 * (pal_dot3(momentum, motion->linear) + pal_dot3(moment, motion->angular));
}

/* gathers the region's nodes, with velocities relative to their rigid motion; false: there are none */
static bool find_region(const refine *state, const pal_body *body, bool whole, region *r)
{
    const gathered *g = &state->gathered;
    *r = (region){.n = 0};
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        if (!in_region(state, body, whole, i)) continue;
        g->node[r->n] = i;
        g->mass_kg[r->n] = body->mass_kg[i];
        pal_copy3(g->x + 3 * (size_t)r->n, body->x + 3 * (size_t)i);
        pal_copy3(g->v_m_s + 3 * (size_t)r->n++, body->v + 3 * (size_t)i);
    }
    pal_rigid_motion_of(r->n, g->mass_kg, g->x, g->v_m_s, r->momentum, r->moment, &r->motion);
    r->rigid_J = rigid_J(&r->motion, r->momentum, r->moment);
    for (int k = 0; k < r->n; k++) {
        double rigid[3], *v = g->v_m_s + 3 * (size_t)k;
        pal_rigid_motion_at(&r->motion, g->x + 3 * (size_t)k, rigid);
        pal_sub3(v, v, rigid);
        r->inner_J += 0.5 * g->mass_kg[k] * pal_dot3(v, v);
    }
    return r->n > 0;
}

/* Restores both momenta of the free nodes, and the kinetic energy less `gained`, J, by the velocities of the changed
 * region or of the whole body. false: the region is too small and nothing was changed */
static bool keep_motion(const refine *state, pal_body *body, double gained_J, bool whole)
{
    const pal_refine_balance *before = &state->report.before, *raw = &state->report.raw;
    const gathered *g = &state->gathered;
    region r;
    pal_rigid_motion to;
    double momentum[3], moment[3], turn[3];
    if (!find_region(state, body, whole, &r)) return whole;
    pal_sub3(momentum, before->momentum_kg_m_s, raw->momentum_kg_m_s);
    pal_sub3(moment, before->angular_momentum_kg_m2_s, raw->angular_momentum_kg_m2_s);
    pal_cross3(turn, r.motion.centre_m, momentum);
    pal_sub3(moment, moment, turn);
    pal_add3(moment, moment, r.moment);
    pal_add3(momentum, momentum, r.momentum);
    pal_rigid_motion_find(r.n, g->mass_kg, g->x, momentum, moment, &to);
    double wanted_J =
        before->kinetic_J - gained_J - (raw->kinetic_J - r.rigid_J - r.inner_J) - rigid_J(&to, momentum, moment);
    /* nothing to scale where the region moves rigidly */
    double scale = r.inner_J > 1e-12 * raw->kinetic_J ? sqrt(fmax(wanted_J, 0) / r.inner_J) : 1;
    bool enough = scale >= 1 / PAL_CHANGE_MAX && scale <= PAL_CHANGE_MAX && to.n_axis == 3;
    if (!enough && !whole) return false;
    scale = fmin(fmax(scale, 1 / PAL_CHANGE_MAX), PAL_CHANGE_MAX);
    for (int k = 0; k < r.n; k++) {
        double *v = body->v + 3 * (size_t)g->node[k];
        pal_rigid_motion_at(&to, g->x + 3 * (size_t)k, v);
        pal_axpy3(v, scale, g->v_m_s + 3 * (size_t)k);
    }
    return true;
}

/* executes all requests of one evaluation, conserving energy and momentum */
static void change(refine *state, pal_step *step)
{
    pal_body *body = step->body;
    pal_refine_history *report = &state->report;
    pal_refine_balance before;
    pal_refine_balance_compute(&before, step);
    /* the guard handles a non-finite state */
    if (!isfinite(pal_refine_balance_total_J(&before))) return;
    region whole;
    (void)find_region(state, body, true, &whole);
    state->inner_J = whole.inner_J;
    report->n_switch++;
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        state->mass_was[i] = body->mass_kg[i];
        state->seen[i] = report->n_switch;
    }
    if (!execute_requests(state, body)) {
        report->n_switch--;
        return;
    }
    pal_adaptive_update(state->adaptive, body);
    report->time_s = state->time.clock_s;
    report->before = before;
    if (state->ramp_s > 0) relax(state, step);
    pal_refine_balance_compute(&report->raw, step);
    const pal_refine_balance *raw = &report->raw;
    const double spring_J = keep_elastic(state, before.spring_J, raw->spring_J, raw->shape_J,
                                         &state->adaptive->spring_ramp, &state->time.spring_s);
    const double shape_J = keep_elastic(state, before.shape_J, raw->shape_J, raw->spring_J,
                                        &state->adaptive->shape_ramp, &state->time.shape_s);
    const double gained_J = spring_J - before.spring_J + shape_J - before.shape_J;
    if (!keep_motion(state, body, gained_J, false)) keep_motion(state, body, gained_J, true);
    pal_refine_balance_compute(&report->after, step);
}

/* sums of squared loads, up to what rounding and a body at rest change */
static bool is_same(double load2, double before)
{
    return fabs(load2 - before) <= 1e-6 * load2;
}

/* true: an evaluation would see the same state as the last one */
static bool is_still(refine *state, const pal_body *body, double dt_s, double *load2)
{
    double max2 = 0;
    *load2 = 0;
    for (int k = 0; k < body->n_active; k++) {
        const size_t i = 3 * (size_t)pal_body_point(body, k);
        double v2 = pal_dot3(body->v + i, body->v + i);
        max2 = v2 > max2 ? v2 : max2;
        *load2 += pal_dot3(body->load + i, body->load + i);
    }
    state->time.moved_m += dt_s * sqrt(max2);
    return state->seen_revision == body->display.revision + 1 && state->time.moved_m < STILL_EDGES * state->edge_m &&
           is_same(*load2, state->time.seen_load2);
}

static bool evaluates(const refine *state)
{
    return state->limits.force_N > 0 || state->limits.speed_m_s > 0 || state->limits.curvature_1_m > 0;
}

static pal_err run(void *self, pal_step *step)
{
    refine *state = self;
    pal_adaptive_surface *adaptive = state->adaptive;
    state->time.clock_s += step->dt_s;
    state->time.wait_s -= step->dt_s;
    adaptive->spring_ramp = 1 + (adaptive->spring_ramp - 1) * pal_blend_release(&state->time.spring_s, step->dt_s);
    adaptive->shape_ramp = 1 + (adaptive->shape_ramp - 1) * pal_blend_release(&state->time.shape_s, step->dt_s);
    double load2;
    const bool same = is_still(state, step->body, step->dt_s, &load2);
    if (state->time.wait_s > 1e-9 * state->every_s) return PAL_ERR_OK;
    state->time.wait_s = fmax(state->time.wait_s + state->every_s, 0);
    if (!evaluates(state)) return PAL_ERR_OK;
    if (same && state->time.clock_s - state->time.seen_s < state->dwell_s) return PAL_ERR_OK;
    state->seen_revision = step->body->display.revision + 1, state->time.seen_s = state->time.clock_s;
    state->time.seen_load2 = load2, state->time.moved_m = 0;
    if (!is_same(load2, state->time.steady_load2)) {
        state->time.steady_s = state->time.clock_s, state->time.steady_load2 = load2;
        let_go(state);
    }
    pal_refine_mark_nodes(&state->measure, adaptive, step->body, &state->limits);
    const uint64_t n_switch = state->report.n_switch;
    if (find_requests(state, step->body)) change(state, step);
    state->seen_twice = same && state->report.n_switch == n_switch;
    return PAL_ERR_OK;
}

/* a body that fell asleep before its faces may be joined would stay refined */
static double settled_s(const void *self)
{
    const refine *state = self;
    const bool blended = state->time.spring_s == 0 && state->time.shape_s == 0;
    return !evaluates(state) || (state->seen_twice && !state->deferred && blended) ? 0 : INFINITY;
}

/* the body was reset, but may have another level than at load */
static void reset(void *self, const pal_body *body)
{
    (void)body;
    refine *state = self;
    pal_adaptive_set_level(state->adaptive, state->body, state->adaptive->options.start_level);
    pal_adaptive_update(state->adaptive, state->body);
    clear(state);
}

/* continues times and factors of the same surface in another world; with another number of levels they start again */
static void transfer(void *self, const pal_body *body, const void *before, const pal_component_transfer *by)
{
    refine *state = self;
    const refine *was = before;
    const pal_levels *levels = &state->adaptive->levels;
    if (by->place || levels->n_level != was->adaptive->levels.n_level) return;
    const size_t n_face = (size_t)levels->first_face[levels->n_level];
    memcpy(state->switched_s, was->switched_s, n_face * sizeof *state->switched_s);
    memcpy(state->backoff, was->backoff, n_face * sizeof *state->backoff);
    state->time = was->time;
    state->holds = was->holds;
    state->seen_revision = was->seen_revision == by->from->display.revision + 1 ? body->display.revision + 1 : 0;
    memcpy(state->measure.frame.quat, was->measure.frame.quat, sizeof state->measure.frame.quat);
}

const pal_refine_history *pal_refine_report(const void *self)
{
    return &((const refine *)self)->report;
}

const pal_effect pal_effect_refine = {PAL_EFFECT("refine", ADAPT), .material = material, .reset = reset,
                                      .transfer = transfer, .sleep.settled_s = settled_s};
