/* Cases that disturb shapes, stiffness, the step and loads. */
#include "server/base/vec3.h"
#include "server/robustness/trial.h"

#include <string.h>

/* moves one free point to its disturbed position */
static void disturb_point(pal_trial *trial, pal_disturbance how, const double low[3], const double high[3], int flat,
                          double x[3])
{
    for (int c = 0; c < 3; c++) {
        double middle = 0.5 * (low[c] + high[c]);
        if (how == PAL_FLAT && c == flat) x[c] = middle;
        if (how == PAL_POINT) x[c] = low[c] + 0.3 * (high[c] - low[c]);
        if (how == PAL_MIRRORED && c == flat) x[c] = low[c] + high[c] - x[c];
        if (how == PAL_SHUFFLED) x[c] = low[c] + (high[c] - low[c]) * pal_trial_random(trial);
        if (how == PAL_STRETCHED) x[c] = middle + 8 * (x[c] - middle);
        if (how == PAL_BLOWN_UP) x[c] = middle + 100 * (x[c] - middle);
    }
}

static void disturb_body(pal_trial *trial, int b, pal_disturbance how)
{
    pal_body *body = pal_world_body(trial->world, b);
    double low[3], high[3];
    int flat = 0; /* axis along which the body is thinnest */
    pal_box3_empty(low, high);
    for (int k = 0; k < body->n_active; k++) pal_box3_add(low, high, body->x + 3 * (size_t)pal_body_point(body, k));
    for (int c = 1; c < 3; c++)
        if (high[c] - low[c] < high[flat] - low[flat]) flat = c;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        if (!body->support[i]) disturb_point(trial, how, low, high, flat, body->x + 3 * (size_t)i);
    }
}

void pal_robustness_shape(pal_trial *trial)
{
    const pal_disturbance how = (pal_disturbance)trial->parameter;
    bool springs = true;
    for (int b = 0; b < trial->scene->n_body; b++) {
        disturb_body(trial, b, how);
        trial->may_stay[b] =
            !strcmp(trial->scene->body[b].model.name, "tet_springs") && !pal_world_body(trial->world, b)->model.springs;
        trial->may_stop[b] = trial->may_stay[b] ||
                             (how == PAL_BLOWN_UP && pal_world_find_component(trial->world, b, "finite_guard") >= 0);
        springs = springs && trial->may_stay[b];
    }
    for (int b = 0; b < trial->scene->n_body; b++) pal_world_invalidate_limits(trial->world, b);
    pal_trial_rebase(trial);
    /* springs without recovery need not return: long enough to see that they stay bounded */
    pal_trial_return(trial, (springs ? 0.4 : how == PAL_BLOWN_UP ? 2.5 : 1) * PAL_RETURN_TIME_S);
}

/* A NaN in the first body: only that body stops, and only it is reset. */
void pal_robustness_poisoned(pal_trial *trial)
{
    pal_robustness_result *out = trial->out;
    pal_body *body = pal_world_body(trial->world, 0);
    int at = pal_body_point(body, body->n_active / 2);
    body->x[3 * (size_t)at] = NAN;
    out->energy = NAN;
    (void)pal_world_step(trial->world, trial->scene->step_s);
    if (!body->frozen) pal_trial_report(trial, PAL_CAUSE_INPUT, "the body was not stopped");
    if (body->frozen) pal_trial_report(trial, PAL_CAUSE_NONE, "%s stopped: %s", body->name, body->reason);
    if (body->frozen && !body->reason[0]) pal_trial_report(trial, PAL_CAUSE_INPUT, "no reason is given");
    for (int b = 1; b < trial->scene->n_body; b++) {
        const pal_body *other = pal_world_body(trial->world, b);
        if (other->frozen || !pal_body_finite(other))
            pal_trial_report(trial, PAL_CAUSE_INPUT, "%s was stopped with it", other->name);
    }
    if (trial->twin) pal_world_reset(trial->twin), pal_world_reset(trial->world); /* drives both alike again */
    if (pal_world_reset_body(trial->world, 0) || body->frozen || !pal_body_finite(body)) {
        pal_trial_report(trial, PAL_CAUSE_INPUT, "a reset did not bring it back");
        return;
    }
    pal_trial_return(trial, PAL_RETURN_TIME_S);
}

/* ---- loads ---- */

static void unload_all(pal_trial *trial)
{
    pal_trial_remove_loads(trial);
    pal_trial_rebase(trial);
}

static void load_upwards(pal_trial *trial, double share)
{
    pal_trial_load(trial, share, trial->scene->up);
    pal_trial_rebase(trial);
}

void pal_robustness_meganewton(pal_trial *trial)
{
    for (int b = 0; b < trial->scene->n_body; b++) {
        double force[3];
        pal_scale3(force, 1e6, trial->scene->up);
        trial->err = pal_world_load(trial->world, b, pal_trial_far_node(trial, b), force);
    }
    pal_trial_rebase(trial);
    bool good = pal_trial_run(trial, 1);
    pal_trial_report(trial, PAL_CAUSE_NONE, "pulled %.2g S away in RMS", pal_trial_deviation_S(trial, false));
    unload_all(trial);
    if (good) pal_trial_return(trial, PAL_RETURN_TIME_S);
}

/* ---- steps that are too long ---- */

/* in all some three seconds of steps of 1/60 s */
void pal_robustness_long_step(pal_trial *trial)
{
    const int times = trial->parameter, n = times < 100 ? 18 : 3;
    const double *up = trial->scene->up;
    for (int b = 0; b < trial->scene->n_body; b++) {
        pal_body *body = pal_world_body(trial->world, b);
        double low[3], high[3];
        pal_trial_box(trial, b, low, high);
        for (int k = 0; k < body->n_active; k++) {
            size_t i = (size_t)pal_body_point(body, k);
            if (body->support[i]) continue;
            /* an impulse that grows with the height */
            double height = 0, all = 1e-300;
            for (int c = 0; c < 3; c++) {
                height += up[c] * (body->x[3 * i + (size_t)c] + body->offset_m[c] - low[c]);
                all += fabs(up[c]) * (high[c] - low[c]);
            }
            body->v[3 * i + (fabs(up[0]) < 0.7 ? 0 : 1)] += 0.5 * body->length_scale_m * fabs(height) / all;
        }
        pal_body_update_nodes(body);
    }
    pal_trial_rebase(trial);
    uint64_t hash = pal_world_hash(trial->world);
    for (int i = 0; i < n; i++) {
        bool good = pal_trial_step(trial, times * trial->scene->step_s);
        if (trial->err == PAL_ERR_BUDGET) {
            if (hash != pal_world_hash(trial->world))
                pal_trial_report(trial, PAL_CAUSE_INPUT, "refused, but something moved");
            pal_trial_report(trial, PAL_CAUSE_NONE, "refused: more sub-steps than the budget of %d",
                             trial->scene->max_substep);
            break;
        }
        if (!good) return;
    }
    pal_trial_return(trial, PAL_RETURN_TIME_S);
}

/* ---- stiffness ---- */

void pal_robustness_stiffer(pal_trial *trial)
{
    pal_diagnostic reason = {""};
    trial->out->energy = NAN; /* changing the stiffness does work */
    load_upwards(trial, 0.3);
    bool good = pal_trial_run(trial, 0.25);
    for (int b = 0; b < trial->scene->n_body && good; b++) {
        pal_material to = trial->scene->body[b].material;
        to.young_Pa *= 1000;
        uint64_t hash = pal_world_hash(trial->world);
        pal_err err = pal_world_material(trial->world, b, &to, &reason);
        if (err && hash != pal_world_hash(trial->world))
            pal_trial_report(trial, PAL_CAUSE_INPUT, "refused, but something moved");
        if (err) pal_trial_report(trial, PAL_CAUSE_NONE, "refused (%.90s)", reason.text);
    }
    good = good && pal_trial_run(trial, 0.25);
    for (int b = 0; b < trial->scene->n_body; b++)
        if (pal_world_material(trial->world, b, &trial->scene->body[b].material, &reason))
            pal_trial_report(trial, PAL_CAUSE_INPUT, "the old material was refused (%.90s)", reason.text);
    unload_all(trial);
    if (good) pal_trial_return(trial, PAL_RETURN_TIME_S);
}

/* ---- an hour ---- */

static double drift_S(const pal_trial *trial)
{
    double max = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        for (int i = 0; i < 3 * body->n_dof; i++)
            max = fmax(max, fabs(body->x[i] - trial->start[b][i]) / body->length_scale_m);
    }
    return max;
}

/* kinetic energy of all bodies, and how many of them sleep and have implicit solvers */
typedef struct activity {
    double kinetic_J;
    int n_asleep, n_implicit;
} activity;

static activity measure_activity(const pal_trial *trial)
{
    activity sum = {0};
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        sum.kinetic_J += pal_body_kinetic_J(body);
        sum.n_asleep += body->asleep, sum.n_implicit += body->implicit;
    }
    return sum;
}

static bool is_settled(const pal_trial *trial)
{
    bool all = true;
    for (int b = 0; b < trial->scene->n_body; b++) all = all && pal_world_is_settled(trial->world, b);
    return all;
}

/* runs until a quarter of a second moves nothing by more than 1e-8 S and no component will change anything by itself,
 * for as long as the largest time constant needs */
static bool settle_loaded(pal_trial *trial, double *ms)
{
    const double step = pal_trial_long_step_s(trial), begin = trial->out->simulated_s,
                 max_s = fmax(PAL_RETURN_TIME_S, PAL_SETTLE_TAU * fmax(trial->tau_s, step));
    int n = (int)ceil(PAL_REST_HOLD_S / step), all = 0;
    double before = pal_trial_cpu_s(), late = before + 0.5 * (trial->deadline_s - before);
    for (;;) {
        pal_trial_save(trial, trial->start);
        for (int i = 0; i < n; i++, all++)
            if (!pal_trial_step(trial, step)) return false;
        double now = pal_trial_cpu_s(), done_s = trial->out->simulated_s - begin;
        *ms = 1e3 * (now - before) / all;
        if ((drift_S(trial) <= 1e-8 && is_settled(trial)) || done_s > max_s) return true;
        trial->late = now > late;
        if (trial->late) {
            trial->out->needs_s = 2 * (now - before) * max_s / done_s;
            return false;
        }
    }
}

/* Steps while all bodies are asleep, up to ten seconds, without the monitor: the energy of thousands of springs
 * costs a hundred times such a step. False: a step was refused. */
static bool step_asleep(pal_trial *trial, double until_s)
{
    const double step = trial->scene->step_s, end = fmin(trial->out->simulated_s + 10, until_s - 2 * step);
    while (measure_activity(trial).n_asleep == trial->scene->n_body && trial->out->simulated_s < end) {
        if (pal_world_step(trial->world, step)) return false;
        pal_world_remove_idle(trial->world);
        trial->out->simulated_s += step;
    }
    return true;
}

void pal_robustness_hour(pal_trial *trial)
{
    enum { HOUR_S = 3600 };
    const double max_drift = 1e-6, max_kinetic = 1e-9, max_plan_s = 2, step = trial->scene->step_s;
    double ms = 1, drift = 0, kinetic = 0, slept_s = NAN;
    if (trial->twin) {
        pal_trial_report(trial, PAL_CAUSE_NOT_APPLICABLE, "a moving support drives it: it never rests");
        return;
    }
    load_upwards(trial, 0.1);
    if (!settle_loaded(trial, &ms)) return;
    pal_trial_save(trial, trial->start);
    pal_trial_rebase(trial);
    double room_s = trial->deadline_s - pal_trial_cpu_s(), begin = trial->out->simulated_s;
    /* implicit steps may be long: as many as two seconds of processor time allow, of at most ten seconds each */
    double n = fmax(1, 0.8e3 * fmin(max_plan_s, room_s) / ms),
           dt = measure_activity(trial).n_implicit == trial->scene->n_body ? fmin(10, fmax(step, HOUR_S / n)) : step;
    double late_s = pal_trial_cpu_s() + 0.9 * room_s;
    while (trial->out->simulated_s - begin < HOUR_S) {
        if (pal_trial_cpu_s() > late_s) break;
        if (!pal_trial_step(trial, dt) || !step_asleep(trial, begin + HOUR_S)) break;
        const activity now = measure_activity(trial);
        kinetic = fmax(kinetic, now.kinetic_J);
        drift = fmax(drift, drift_S(trial));
        if (isnan(slept_s) && now.n_asleep > 0) slept_s = trial->out->simulated_s - begin;
    }
    double monitored = trial->out->simulated_s - begin, stored = fmax(trial->scale_J, 1e-300);
    pal_trial_report(trial, PAL_CAUSE_NONE,
                     "%.0f s monitored in steps of %.3g s: drift %.2g S, kinetic %.2g of what is stored", monitored, dt,
                     drift, kinetic / stored);
    if (!isnan(slept_s)) pal_trial_report(trial, PAL_CAUSE_NONE, "asleep from %.3g s on", slept_s);
    if (monitored < HOUR_S * (1 - 1e-9))
        pal_trial_report(trial, PAL_CAUSE_SECONDS, "the time did not suffice for the hour");
    if (monitored < HOUR_S * (1 - 1e-9)) trial->out->needs_s = room_s * HOUR_S / fmax(monitored, step);
    if (!(drift <= max_drift)) pal_trial_report(trial, PAL_CAUSE_MOVES, "it drifts");
    if (!(kinetic <= max_kinetic * stored)) pal_trial_report(trial, PAL_CAUSE_MOVES, "it does not come to rest");
}
