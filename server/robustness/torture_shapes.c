/* Insults to the shape of bodies, to their stiffness and to the step; loads. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/robustness/torture_parts.h"

#include <math.h>
#include <string.h>

typedef enum shape { FLAT, POINT, MIRRORED, SHUFFLED, STRETCHED, BLOWN_UP } shape;

static const double back_s = 10, blown_s = 25, springs_s = 4;

/* one free point from where it is */
static void insult_point(pal_rig *rig, shape how, const double low[3], const double high[3], int flat, double x[3])
{
    for (int c = 0; c < 3; c++) {
        double middle = 0.5 * (low[c] + high[c]);
        if (how == FLAT && c == flat) x[c] = middle;
        if (how == POINT) x[c] = low[c] + 0.3 * (high[c] - low[c]);
        if (how == MIRRORED && c == flat) x[c] = low[c] + high[c] - x[c];
        if (how == SHUFFLED) x[c] = low[c] + (high[c] - low[c]) * pal_rig_random(rig);
        if (how == STRETCHED) x[c] = middle + 8 * (x[c] - middle);
        if (how == BLOWN_UP) x[c] = middle + 100 * (x[c] - middle);
    }
}

/* the axis along which the body is thinnest */
static int thinnest(const double low[3], const double high[3])
{
    int axis = 0;
    for (int c = 1; c < 3; c++)
        if (high[c] - low[c] < high[axis] - low[axis]) axis = c;
    return axis;
}

static void spoil(pal_rig *rig, int b, shape how)
{
    pal_body *body = pal_world_body(rig->world, b);
    double low[3], high[3];
    for (int c = 0; c < 3; c++) low[c] = INFINITY, high[c] = -INFINITY;
    for (int k = 0; k < body->n_active; k++)
        for (int c = 0; c < 3; c++) {
            double at = body->x[3 * (size_t)pal_body_point(body, k) + (size_t)c];
            low[c] = fmin(low[c], at), high[c] = fmax(high[c], at);
        }
    int flat = thinnest(low, high);
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        if (!body->fixed[i]) insult_point(rig, how, low, high, flat, body->x + 3 * (size_t)i);
    }
}

/* tetrahedra turned over; of bodies that have some and whose points are their nodes */
static int turned_over(const pal_rig *rig)
{
    int n = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        for (int t = 0; body->tets && !body->interpolation && t < body->tets->n_tet; t++) {
            const int32_t *c = body->tets->tet + 4 * (size_t)t;
            double e[3][3], g[3];
            for (int k = 0; k < 3; k++) pal_sub3(e[k], body->x + 3 * (size_t)c[k + 1], body->x + 3 * (size_t)c[0]);
            pal_cross3(g, e[1], e[2]);
            n += !(pal_dot3(e[0], g) > 0);
        }
    }
    return n;
}

static double extent(const pal_rig *rig)
{
    double most = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        double low[3], high[3];
        pal_rig_box(rig, b, low, high);
        most = fmax(most, pal_dist3(low, high) / pal_world_body(rig->world, b)->length_scale_m);
    }
    return most;
}

static bool guarded(const pal_rig *rig, int b)
{
    for (int i = 0; i < pal_world_component_count(rig->world); i++) {
        pal_component_info info;
        pal_world_component_info(rig->world, i, &info);
        if (info.body == pal_world_body(rig->world, b)->name && !strcmp(info.name, "finite_guard")) return true;
    }
    return false;
}

static void shaped(pal_rig *rig, shape how)
{
    bool springs = true;
    for (int b = 0; b < rig->scene->n_body; b++) {
        spoil(rig, b, how);
        /* what untangles and has a guard is judged as all others when it is beyond the guard's reach */
        const bool untangles = pal_world_body(rig->world, b)->recovery != NULL,
                   far = how == BLOWN_UP && guarded(rig, b);
        rig->may_stay[b] = pal_rig_springs(rig, b) && !(untangles && far);
        rig->may_stop[b] = rig->may_stay[b] || far;
        springs = springs && rig->may_stay[b] && !untangles;
    }
    double before = extent(rig);
    pal_rig_moved(rig);
    /* springs that do not untangle need not come back: long enough to see that they are bounded */
    pal_rig_relax(rig, springs ? springs_s : how == BLOWN_UP ? blown_s : back_s);
    int n = turned_over(rig);
    double after = extent(rig);
    if (!rig->out->finite || rig->out->frozen) return;
    if (!(after <= 1.5 * fmax(before, 1))) pal_rig_fail(rig, "grew to %.2g S", after);
    if (rig->out->back_s < INFINITY)
        pal_rig_say(rig, "back after %.2g s", rig->out->back_s);
    else
        pal_rig_say(rig, "%.2g %% S away after %.1f s, %d elements turned over", 100 * rig->out->left_S,
                    rig->out->simulated_s, n);
}

void pal_insult_flat(pal_rig *rig)
{
    shaped(rig, FLAT);
}
void pal_insult_point(pal_rig *rig)
{
    shaped(rig, POINT);
}
void pal_insult_mirrored(pal_rig *rig)
{
    shaped(rig, MIRRORED);
}
void pal_insult_shuffled(pal_rig *rig)
{
    shaped(rig, SHUFFLED);
}
void pal_insult_stretched(pal_rig *rig)
{
    shaped(rig, STRETCHED);
}
void pal_insult_blown_up(pal_rig *rig)
{
    shaped(rig, BLOWN_UP);
}

/* a NaN in the first body: it alone stops, and comes back alone */
void pal_insult_poisoned(pal_rig *rig)
{
    pal_torture_result *out = rig->out;
    pal_body *body = pal_world_body(rig->world, 0);
    int at = pal_body_point(body, body->n_active / 2);
    body->x[3 * (size_t)at] = NAN;
    out->energy = NAN;
    (void)pal_world_step(rig->world, rig->scene->step_s);
    if (!body->frozen) pal_rig_fail(rig, "the body was not stopped");
    if (body->frozen) pal_rig_say(rig, "%s stopped: %s", body->name, body->reason);
    if (body->frozen && !body->reason[0]) pal_rig_fail(rig, "no reason is given");
    for (int b = 1; b < rig->scene->n_body; b++) {
        const pal_body *other = pal_world_body(rig->world, b);
        if (other->frozen || !pal_body_finite(other)) pal_rig_fail(rig, "%s was stopped with it", other->name);
    }
    if (rig->twin) pal_world_reset(rig->twin), pal_world_reset(rig->world); /* led alike again */
    if (pal_world_reset_body(rig->world, 0) || body->frozen || !pal_body_finite(body)) {
        pal_rig_fail(rig, "a reset did not bring it back");
        return;
    }
    pal_rig_relax(rig, back_s);
    if (out->back_s < INFINITY) pal_rig_say(rig, "at rest %.2g s after its reset", out->back_s);
}

/* ---- loads ---- */

/* the same load on the far node of every body, off the supports; 0: none */
static void load_all(pal_rig *rig, double force_N, bool of_cap)
{
    for (int b = 0; b < rig->scene->n_body; b++) {
        const double size = of_cap ? force_N * pal_rig_cap_N(rig, b) : force_N, *up = rig->scene->up;
        const double force[3] = {size * up[0], size * up[1], size * up[2]};
        rig->err = pal_world_load(rig->world, b, pal_rig_far_node(rig, b), force);
    }
    pal_rig_rebase(rig);
}

/* of one that adapts the node may go out of use meanwhile: all loads are taken away where they are */
static void unload_all(pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++) {
        pal_body *body = pal_world_body(rig->world, b);
        if (body->external_force) memset(body->external_force, 0, 3 * sizeof(double) * (size_t)body->n_node);
    }
    pal_world_wake(rig->world);
    pal_rig_rebase(rig);
}

void pal_insult_meganewton(pal_rig *rig)
{
    load_all(rig, 1e6, false);
    bool good = pal_rig_run(rig, 1);
    double away = pal_rig_left(rig);
    unload_all(rig);
    if (good) pal_rig_relax(rig, back_s);
    pal_rig_say(rig, "pulled %.2g S away in RMS", away);
    if (isfinite(rig->out->back_s)) pal_rig_say(rig, "back after %.2g s", rig->out->back_s);
    if (isinf(rig->out->back_s)) pal_rig_say(rig, "not back");
}

/* ---- steps that are too long ---- */

static void long_steps(pal_rig *rig, double times, int n)
{
    const double *up = rig->scene->up;
    for (int b = 0; b < rig->scene->n_body; b++) {
        pal_body *body = pal_world_body(rig->world, b);
        double low[3], high[3];
        pal_rig_box(rig, b, low, high);
        for (int k = 0; k < body->n_active; k++) {
            size_t i = (size_t)pal_body_point(body, k);
            if (body->fixed[i]) continue;
            /* a blow that grows with the height */
            double height = 0, all = 1e-300;
            for (int c = 0; c < 3; c++) {
                height += up[c] * (body->x[3 * i + (size_t)c] + body->offset_m[c] - low[c]);
                all += fabs(up[c]) * (high[c] - low[c]);
            }
            body->v[3 * i + (fabs(up[0]) < 0.7 ? 0 : 1)] += 0.5 * body->length_scale_m * fabs(height) / all;
        }
        pal_body_update_nodes(body);
    }
    pal_rig_rebase(rig);
    uint64_t hash = pal_world_hash(rig->world);
    for (int i = 0; i < n; i++) {
        bool good = pal_rig_step(rig, times * rig->scene->step_s);
        if (rig->err == PAL_ERR_BUDGET) {
            if (hash != pal_world_hash(rig->world)) pal_rig_fail(rig, "refused, but something moved");
            pal_rig_say(rig, "refused: more sub-steps than the budget of %d", rig->scene->max_substep);
            break;
        }
        if (!good) return;
    }
    pal_rig_relax(rig, back_s);
    if (rig->out->back_s < INFINITY) pal_rig_say(rig, "at rest after %.2g s", rig->out->back_s);
}

void pal_insult_long_step(pal_rig *rig)
{
    long_steps(rig, 10, 18);
}

void pal_insult_longer_step(pal_rig *rig)
{
    long_steps(rig, 100, 3);
}

/* ---- stiffness ---- */

void pal_insult_stiffer(pal_rig *rig)
{
    pal_diagnostic reason = {""};
    rig->out->energy = NAN; /* changing stiffness is work */
    load_all(rig, 0.3, true);
    bool good = pal_rig_run(rig, 0.25);
    for (int b = 0; b < rig->scene->n_body && good; b++) {
        pal_material to = rig->scene->body[b].material;
        to.young_Pa *= 1000;
        uint64_t hash = pal_world_hash(rig->world);
        pal_err err = pal_world_material(rig->world, b, &to, &reason);
        if (err && hash != pal_world_hash(rig->world)) pal_rig_fail(rig, "refused, but something moved");
        if (err) pal_rig_say(rig, "refused (%.90s)", reason.text);
    }
    good = good && pal_rig_run(rig, 0.25);
    for (int b = 0; b < rig->scene->n_body; b++)
        if (pal_world_material(rig->world, b, &rig->scene->body[b].material, &reason))
            pal_rig_fail(rig, "the old material was refused (%.90s)", reason.text);
    unload_all(rig);
    if (good) pal_rig_relax(rig, back_s);
    if (rig->out->back_s < INFINITY) pal_rig_say(rig, "back after %.2g s", rig->out->back_s);
}

/* ---- an hour ---- */

static double drift_S(const pal_rig *rig)
{
    double most = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        for (int i = 0; i < 3 * body->n_dof; i++)
            most = fmax(most, fabs(body->x[i] - rig->start[b][i]) / body->length_scale_m);
    }
    return most;
}

static void take_start(pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        memcpy(rig->start[b], body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    }
}

static double kinetic_J(const pal_rig *rig)
{
    double sum = 0;
    for (int b = 0; b < rig->scene->n_body; b++) sum += pal_body_kinetic_J(pal_world_body(rig->world, b));
    return sum;
}

static bool asleep(const pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++)
        if (pal_world_body(rig->world, b)->asleep) return true;
    return false;
}

static bool all_asleep(const pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++)
        if (!pal_world_body(rig->world, b)->asleep) return false;
    return true;
}

static bool implicit(const pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++)
        if (!pal_world_body(rig->world, b)->implicit) return false;
    return true;
}

/* until a quarter of a second moves nothing by more than 1e-8 S, or a minute */
static bool settle_loaded(pal_rig *rig, double *ms)
{
    const double step = rig->scene->step_s, begin = rig->out->simulated_s;
    int n = (int)ceil(0.25 / step), all = 0;
    double before = 1e-9 * (double)pal_clock_thread_ns(), late = before + 0.5 * (rig->deadline_s - before);
    for (;;) {
        take_start(rig);
        for (int i = 0; i < n; i++, all++)
            if (!pal_rig_step(rig, step)) return false;
        double now = 1e-9 * (double)pal_clock_thread_ns();
        *ms = 1e3 * (now - before) / all;
        if (drift_S(rig) <= 1e-8 || rig->out->simulated_s - begin > 60) return true;
        rig->late = now > late;
        if (rig->late) return false;
    }
}

/* Steps while all are asleep, up to ten seconds: looking at energies of thousands of springs that do not move costs a
 * hundred times what such a step does. false: a step was refused */
static bool doze(pal_rig *rig, double until_s)
{
    const double step = rig->scene->step_s, end = fmin(rig->out->simulated_s + 10, until_s - 2 * step);
    while (all_asleep(rig) && rig->out->simulated_s < end) {
        if (pal_world_step(rig->world, step)) return false;
        pal_world_remove_idle(rig->world);
        rig->out->simulated_s += step;
    }
    return true;
}

void pal_insult_hour(pal_rig *rig)
{
    enum { HOUR_S = 3600 };
    const double most_drift = 1e-6, most_kinetic = 1e-9, most_plan_s = 8, step = rig->scene->step_s;
    double ms = 1, drift = 0, kinetic = 0, slept_s = NAN;
    if (rig->twin) {
        pal_rig_skip(rig, "a moving support leads it: it never rests");
        return;
    }
    load_all(rig, 0.1, true);
    if (!settle_loaded(rig, &ms)) return;
    take_start(rig);
    pal_rig_rebase(rig);
    double room_s = rig->deadline_s - 1e-9 * (double)pal_clock_thread_ns(), begin = rig->out->simulated_s;
    /* implicit steps may be long: as many as there is time for, of at most ten seconds */
    double n = fmax(1, 0.8e3 * fmin(most_plan_s, room_s) / ms),
           dt = implicit(rig) ? fmin(10, fmax(step, HOUR_S / n)) : step;
    double late_s = 1e-9 * (double)pal_clock_thread_ns() + 0.9 * room_s;
    while (rig->out->simulated_s - begin < HOUR_S) {
        if (1e-9 * (double)pal_clock_thread_ns() > late_s) break;
        if (!pal_rig_step(rig, dt) || !doze(rig, begin + HOUR_S)) break;
        kinetic = fmax(kinetic, kinetic_J(rig));
        drift = fmax(drift, drift_S(rig));
        if (isnan(slept_s) && asleep(rig)) slept_s = rig->out->simulated_s - begin;
    }
    double watched = rig->out->simulated_s - begin, stored = fmax(rig->scale_J, 1e-300);
    pal_rig_say(rig, "%.0f s watched in steps of %.3g s: drift %.2g S, kinetic %.2g of what is stored", watched, dt,
                drift, kinetic / stored);
    if (!isnan(slept_s)) pal_rig_say(rig, "asleep from %.3g s on", slept_s);
    if (watched < HOUR_S * (1 - 1e-9))
        pal_rig_undecided(rig, "the time did not reach for the hour: give more --seconds");
    if (!(drift <= most_drift)) pal_rig_fail(rig, "it drifts");
    if (!(kinetic <= most_kinetic * stored)) pal_rig_fail(rig, "it does not stand still");
}
