/* One point of a study: its cost and its error. */
#include "server/base/clock.h"
#include "server/base/machine.h"
#include "server/base/vec3.h"
#include "server/num/median.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_TIMES = 1200, WARM = 3, MIN_TIMES = 30, ROUNDS = 2 };

static bool same_rest(const pal_configuration *a, const pal_configuration *b)
{
    pal_configuration p = *a, q = *b;
    p.step_s = q.step_s = p.tolerance = q.tolerance = 0;
    p.solver[0] = q.solver[0] = 0;
    return pal_configuration_equal(&p, &q);
}

static void find_rest(pal_study_job *job, const pal_configuration *configuration, int *n_node)
{
    pal_study_rest *r = &job->rest;
    pal_diagnostic reason = {{0}};
    double sum = 0;
    *r = (pal_study_rest){.known = true, .of = *configuration};
    for (int k = 0; k < job->n_load && !r->err; k++) {
        r->err = pal_study_static(job, configuration, job->load[k], job->now, n_node, &reason);
        for (int i = 0; i < job->n_probe && !r->err; i++) {
            double off = pal_dist3(job->now + 3 * i, job->static_u[k] + 3 * i);
            sum += off * off;
            r->max_m = fmax(r->max_m, off);
        }
    }
    r->rms_m = sqrt(sum / (job->n_probe * job->n_load));
    if (r->err) snprintf(r->reason, sizeof r->reason, "%.*s", PAL_CONFIGURATION_TEXT - 1, reason.text);
}

/* one timed step; an error: it cannot continue */
static pal_err timed_step(pal_study_world *w, double *ms, int max, int *n_ms, pal_diagnostic *diag)
{
    pal_world_wake(w->world);
    uint64_t before = pal_clock_thread_ns();
    pal_err err = pal_world_step(w->world, w->set->scene.step_s);
    if (err == PAL_ERR_BUDGET) return pal_diagnostic_set(diag, err, "needs more sub-steps than the scene allows");
    if (err || w->body->frozen || !pal_body_finite(w->body))
        return pal_diagnostic_set(diag, err ? err : PAL_ERR_FROZEN, "diverged and froze");
    if (ms && *n_ms < max) ms[(*n_ms)++] = 1e-6 * (double)(pal_clock_thread_ns() - before);
    return PAL_ERR_OK;
}

/* runs further steps for timing only, until there are enough */
static pal_err only_time(pal_study_world *w, double *ms, int max, int *n_ms, pal_diagnostic *diag)
{
    double start = pal_clock_s();
    while (*n_ms < MIN_TIMES + WARM && (*n_ms <= 2 * WARM || pal_clock_s() - start < PAL_ONLY_TIMED_S))
        PAL_TRY(timed_step(w, ms, max, n_ms, diag));
    return PAL_ERR_OK;
}

/* Frames lie between steps and are interpolated linearly. trajectory NULL: timing only. */
static pal_err follow(pal_study_job *job, pal_study_world *w, double (*trajectory)[3], double *ms, int max, int *n_ms,
                      pal_diagnostic *diag)
{
    double last[3] = {0}, now[3], time = 0, step_s = w->set->scene.step_s;
    for (int frame = 0; frame < job->n_trajectory;) {
        if (!pal_study_continues(job)) return pal_diagnostic_set(diag, PAL_ERR_STATE, "stopped");
        pal_err err = timed_step(w, ms, max, n_ms, diag);
        if (err == PAL_ERR_FROZEN) return pal_diagnostic_set(diag, err, "diverged and froze after %.2f s", time);
        PAL_TRY(err);
        if (trajectory) PAL_TRY(pal_study_displacement(w, job->probe + 3 * job->tip, 1, now, diag));
        time += step_s;
        for (; frame < job->n_trajectory && (frame + 1) * PAL_STUDY_FRAME_S <= time + 1e-9; frame++) {
            double share = fmin(fmax(1 - (time - (frame + 1) * PAL_STUDY_FRAME_S) / step_s, 0), 1);
            for (int c = 0; c < 3 && trajectory; c++) trajectory[frame][c] = (1 - share) * last[c] + share * now[c];
        }
        if (trajectory) pal_copy3(last, now);
    }
    return PAL_ERR_OK;
}

/* repeats the trajectory from rest until short steps are timed as well as long ones */
static pal_err repeat(pal_study_job *job, pal_study_world *w, double *ms, int max, int *n_ms, pal_diagnostic *diag)
{
    pal_err err = PAL_ERR_OK;
    for (;;) {
        double sum = 0;
        for (int i = 0; i < *n_ms; i++) sum += ms[i];
        if (err || sum >= PAL_MIN_TIMED_MS || *n_ms >= max) return err;
        pal_world_reset(w->world);
        err = pal_study_apply_load(job, w, job->load[0], PAL_SUDDEN_LOAD, diag);
        if (!err) err = follow(job, w, NULL, ms, max, n_ms, diag);
    }
}

/* Time to read a factor's entries (float) forwards and backwards, at the read rate for all data that a step may
 * access. */
static double read_ms(const pal_world *world)
{
    pal_solve_report report;
    if (!pal_world_solve_report(world, 0, &report) || report.factor_nonzeros <= 0) return 0;
    double factor = sizeof(float) * (double)report.factor_nonzeros, all = (double)pal_world_bytes(world) + factor;
    return pal_machine_read_ms(all) * 2 * factor / all;
}

pal_err pal_study_trajectory(pal_study_job *job, const pal_configuration *configuration, double (*trajectory)[3],
                             double *ms, int max, int *n_ms, pal_study_point *facts, pal_diagnostic *diag)
{
    pal_study_world w;
    PAL_TRY(pal_study_open(job, configuration, false, &w, diag));
    int n_substep = pal_world_substeps(w.world);
    double work = (double)n_substep * w.body->n_node * job->seconds / w.set->scene.step_s;
    pal_err err = pal_study_apply_load(job, &w, job->load[0], PAL_SUDDEN_LOAD, diag);
    /* the reference is always followed */
    if (!err && facts && work > PAL_MAX_WORK) {
        err = only_time(&w, ms, max, n_ms, diag);
        if (!err)
            err = pal_diagnostic_set(diag, PAL_ERR_BUDGET, "trajectory not followed: %d sub-steps a step", n_substep);
    } else if (!err) {
        err = follow(job, &w, trajectory, ms, max, n_ms, diag);
        if (facts) facts->n_node = pal_body_nodes(w.body);
        if (!err && ms) err = only_time(&w, ms, max, n_ms, diag);
        if (!err && ms) err = repeat(job, &w, ms, max, n_ms, diag);
    }
    if (facts) {
        /* an adaptive body takes the sub-steps of the finest level it reached */
        facts->n_substep = w.body->active ? pal_world_substeps(w.world) : n_substep;
        if (facts->n_node == 0) facts->n_node = pal_body_nodes(w.body);
        facts->prepare_s = w.prepare_s;
        facts->read_ms = read_ms(w.world);
        if (pal_study_is(configuration->model, "fem")) facts->n_element = w.body->n_element;
    }
    pal_study_close(&w);
    return err;
}

static void compare_trajectories(const pal_study_job *job, pal_study_point *out)
{
    double sum = 0;
    out->trajectory_max_m = 0;
    for (int i = 0; i < job->n_trajectory; i++) {
        double off = pal_dist3(job->own_trajectory[i], job->trajectory[i]);
        sum += off * off;
        out->trajectory_max_m = fmax(out->trajectory_max_m, off);
    }
    out->trajectory_rms_m = sqrt(sum / job->n_trajectory);
}

/* times the trajectory; keeps the result if it is the first or the fastest */
static pal_err time_trajectory(pal_study_job *job, pal_study_point *out, double (*trajectory)[3], pal_diagnostic *diag)
{
    double *ms = calloc(MAX_TIMES, sizeof *ms);
    int n_ms = 0;
    pal_study_point facts = *out;
    pal_err err =
        !ms ? PAL_ERR_MEMORY
            : pal_study_trajectory(job, &out->measured.configuration, trajectory, ms, MAX_TIMES, &n_ms, &facts, diag);
    /* the read rate also depends on other load of the machine */
    double read = trajectory ? facts.read_ms : fmin(out->read_ms, facts.read_ms);
    if (trajectory) *out = facts;
    out->read_ms = read;
    if (n_ms > 2 * WARM) {
        /* shorter steps are more steps in the same time: compares the cost per step of the scene */
        double share = job->out->step_s / out->measured.configuration.step_s;
        double median = share * pal_median(ms + WARM, n_ms - WARM);
        if (!(out->measured.ms <= median)) {
            out->measured.ms = median;
            out->ms_p95 = share * ms[WARM + (int)(0.95 * (n_ms - WARM - 1) + 0.5)];
        }
    }
    free(ms);
    return err;
}

pal_err pal_study_time_repeat(pal_study_job *job)
{
    const pal_study_options *o = job->options;
    int n = job->out->n_point, n_round = o->quick ? 1 : ROUNDS;
    for (int i = 0; i < n * n_round; i++) {
        pal_study_point *p = &job->out->point[i % n];
        bool go = !o->progress || o->progress("timed again", (double)i / (n * n_round), o->user);
        pal_diagnostic reason = {{0}};
        if (go && !(p->measured.ms > 0)) continue;
        /* it succeeded before: an error here can only be a stop */
        if (go) (void)time_trajectory(job, p, NULL, &reason);
        if (!go || !pal_study_continues(job))
            return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped while configurations were timed again");
    }
    pal_study_mark_front(job->out);
    return PAL_ERR_OK;
}

pal_err pal_study_measure(pal_study_job *job, const pal_study_entry *entry, pal_study_point *out)
{
    int n_node = 0;
    *out = (pal_study_point){.measured = {.configuration = entry->configuration, .ms = NAN, .error_m = NAN}};
    out->ms_p95 = out->static_rms_m = out->static_max_m = out->trajectory_rms_m = out->trajectory_max_m = NAN;
    out->predicted_ms = out->predicted_m = NAN;
    pal_study_forget_forces(out);
    pal_diagnostic reason = {{0}};
    if (entry->calibrate && (out->err = pal_study_fit(job, &out->measured.configuration, &reason))) {
        snprintf(out->reason, sizeof out->reason, "calibration: %.*s", PAL_CONFIGURATION_TEXT - 16, reason.text);
        if (pal_study_continues(job)) return PAL_ERR_OK;
    }
    if (entry->calibrate && job->n_load == 1)
        snprintf(out->reason, sizeof out->reason, "fitted to the load it is judged by");
    if (!job->rest.known || !same_rest(&job->rest.of, &out->measured.configuration))
        find_rest(job, &out->measured.configuration, &n_node);
    out->n_node = n_node;
    out->err = job->rest.err;
    if (out->err)
        memcpy(out->reason, job->rest.reason, sizeof out->reason);
    else
        out->static_rms_m = job->rest.rms_m, out->static_max_m = job->rest.max_m;
    if (pal_study_continues(job)) {
        pal_err err = time_trajectory(job, out, job->own_trajectory, &reason);
        if (!err) compare_trajectories(job, out);
        if (err && !out->err) {
            out->err = err;
            snprintf(out->reason, sizeof out->reason, "%.*s", PAL_CONFIGURATION_TEXT - 1, reason.text);
        }
    }
    if (!pal_study_continues(job)) return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped in a configuration");
    if (!out->err && pal_study_measure_force(job, out) == PAL_ERR_STATE)
        return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped in a configuration");
    if (!out->err) out->measured.error_m = fmax(out->static_max_m, out->trajectory_max_m);
    return PAL_ERR_OK;
}
