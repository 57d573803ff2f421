/* The reference of a study: the finest affordable body, its error estimated from its last changes, and the
 * trajectory of the tip. */
#include "server/base/vec3.h"
#include "server/solve/convergence.h"
#include "server/study/study_job.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WHOLE_NODES = 30000, QUICK_NODES = 4000, QUICK_MAX = 12000, COUNTED = 12 };
/* largest step, and largest share of the scene's step: about as short as any in the sweep, and of second order */
static const double whole_step_s = 1.0 / 960, quick_step_s = 1.0 / 480, whole_share = 0.25, quick_share = 0.5,
                    reference_tolerance = 1e-4, full_share = 0.95, min_order = 1, scatter = 1.25;
/* a quick reference with a larger share of error is refined by this factor */
static const double quick_enough = 0.15, finer = 1.42;

static pal_configuration reference_setting(const pal_study_job *job, int size)
{
    bool quick = job->options->quick;
    pal_configuration s = {.size = size};
    s.step_s = fmin(quick ? quick_step_s : whole_step_s, job->scene->step_s * (quick ? quick_share : whole_share));
    bool adaptive = job->adaptive;
    snprintf(s.model, PAL_NAME, "%s", adaptive ? "adaptive_springs" : "fem");
    snprintf(s.element, PAL_NAME, "%s", adaptive ? "refined" : "hex8_bbar");
    snprintf(s.law, PAL_NAME, "%s", adaptive ? "" : job->law);
    snprintf(s.solver, PAL_NAME, "%s", adaptive ? "rk4" : "sdirk2");
    s.tolerance = adaptive ? 0 : reference_tolerance;
    return s;
}

/* longest over shortest side, a quarter of it, 1 to 3; the sides of a box-shaped body */
static void take_sides(pal_study_job *job, const pal_surface *surface)
{
    double low[3], high[3], side[3], longest = 0, shortest = INFINITY, volume = 1;
    pal_surface_box(surface, low, high);
    for (int c = 0; c < 3; c++) {
        side[c] = high[c] - low[c], volume *= side[c];
        longest = fmax(longest, side[c]), shortest = fmin(shortest, side[c]);
    }
    bool full = fabs(pal_surface_volume(surface)) > full_share * volume;
    for (int c = 0; c < 3; c++) job->box_m[c] = full ? side[c] : 0;
    job->slender = shortest > 0 ? fmin(fmax(longest / shortest / 4, 1), 3) : 1;
}

/* predicts the nodes of a size from those of a coarse one */
pal_err pal_study_reference_size(pal_study_job *job)
{
    static const int whole[] = {80, 64, 56, 48, 40, 34, 28, 24, 20, 16, 12}, quick[] = {20, 18, 16, 14, 12, 10};
    const int *size = job->options->quick ? quick : whole;
    int n = job->options->quick ? 6 : 11;
    double max = job->options->quick ? QUICK_NODES : WHOLE_NODES;
    pal_study_world w;
    if (job->adaptive) {
        job->reference = job->options->quick ? 3 : 4;
        return PAL_ERR_OK;
    }
    take_sides(job, &job->scene->body[0].mesh->surface);
    pal_configuration s = reference_setting(job, pal_study_size(job, COUNTED));
    PAL_TRY(pal_study_open(job, &s, true, &w, job->diag));
    double count = w.body->n_node;
    pal_study_close(&w);
    for (int i = 0; i < n; i++) {
        job->reference = pal_study_size(job, size[i]);
        if (count * pow((double)size[i] / COUNTED, 3) <= max) break;
    }
    return PAL_ERR_OK;
}

static double max_of(const double *u, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, pal_norm3(u + 3 * i));
    return max;
}

static double max_between(const double *a, const double *b, int n)
{
    double max = 0;
    for (int i = 0; i < n; i++) max = fmax(max, pal_dist3(a + 3 * i, b + 3 * i));
    return max;
}

/* Remaining error of one load from its equilibria at two coarser sizes: the sum of the expected further changes
 * (Richardson, of order 1 to 2). */
static pal_err estimate_load(pal_study_job *job, int load, const int size[3], double *u[2], double *out)
{
    double h[3];
    for (int k = 0; k < 2; k++) {
        int n_node;
        pal_configuration s = reference_setting(job, size[k]);
        PAL_TRY(pal_study_cached_static(job, &s, job->load[load], u[k], &n_node, job->diag));
    }
    for (int k = 0; k < 3; k++) h[k] = job->adaptive ? exp2(-size[k]) : 1.0 / size[k];
    double first = max_between(u[0], u[1], job->n_probe), last = max_between(u[1], job->still[load], job->n_probe);
    double order = pal_richardson_order(h, first, last);
    /* changes that shrink more slowly than first order are scatter of cut voxels: takes the largest, with a margin */
    *out = order >= min_order ? last / (pow(h[1] / h[2], fmin(order, 2)) - 1) : scatter * fmax(first, last);
    return PAL_ERR_OK;
}

/* largest error over the loads */
static pal_err estimate(pal_study_job *job, double *out)
{
    int size[3] = {pal_study_fit_size(job, job->reference / 2.0), pal_study_fit_size(job, job->reference / 1.42),
                   job->reference};
    if (job->adaptive) size[0] = job->reference - 2, size[1] = job->reference - 1;
    if (size[1] >= size[2]) size[1] = size[2] - 1;
    if (size[0] >= size[1]) size[0] = size[1] - 1;
    const int nearer[3] = {pal_study_fit_size(job, job->reference / 1.5), pal_study_fit_size(job, job->reference / 1.2),
                           job->reference};
    double *u[2];
    for (int k = 0; k < 2; k++) u[k] = calloc(3 * (size_t)job->n_probe, sizeof(double));
    pal_err err = u[0] && u[1] ? PAL_ERR_OK : PAL_ERR_MEMORY;
    *out = 0;
    for (int k = 0; k < job->n_load && !err; k++) {
        double left = 0;
        err = estimate_load(job, k, size, u, &left);
        /* coarse voxels lose parts of the body or fold: uses sizes closer to the reference's */
        if ((err == PAL_ERR_REFUSED || err == PAL_ERR_NUMERIC || err == PAL_ERR_FROZEN) && !job->adaptive)
            err = estimate_load(job, k, nearer, u, &left);
        *out = fmax(*out, left);
    }
    free(u[0]), free(u[1]);
    return err;
}

static bool report_progress(const pal_study_job *job, const char *what, double fraction)
{
    return !job->options->progress || job->options->progress(what, fraction, job->options->user);
}

static pal_err given(pal_study_job *job)
{
    memcpy(job->still[0], job->options->samples->u, 3 * sizeof(double) * (size_t)job->n_probe);
    snprintf(job->out->reference, sizeof job->out->reference, "%d displacements that were given, at rest; %s, the way",
             job->n_probe, "fem hex8_bbar");
    job->out->reference_m = 0;
    return PAL_ERR_OK;
}

static pal_err made(pal_study_job *job)
{
    pal_configuration s = reference_setting(job, job->reference);
    char name[PAL_CONFIGURATION_TEXT];
    int n_node = 0;
    for (int k = 0; k < job->n_load; k++) {
        if (!report_progress(job, "reference at rest", (double)k / (job->n_load + 2)))
            return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped at the reference");
        pal_err err;
        do err = pal_study_cached_static(job, &s, job->load[k], job->still[k], &n_node, job->diag);
        while (pal_study_press_adjust(job, k, err));
        PAL_TRY(err);
    }
    job->n_reference = n_node;
    if (!report_progress(job, "reference, its own error", (double)job->n_load / (job->n_load + 2)))
        return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped at the reference");
    PAL_TRY(estimate(job, &job->out->reference_m));
    s.tolerance = 0;
    snprintf(job->out->reference, sizeof job->out->reference, "%s, %d nodes", pal_configuration_text(&s, name), n_node);
    return PAL_ERR_OK;
}

static pal_err at_rest(pal_study_job *job)
{
    PAL_TRY(job->options->samples ? given(job) : made(job));
    job->out->max_m = 0;
    for (int k = 0; k < job->n_load; k++) job->out->max_m = fmax(job->out->max_m, max_of(job->still[k], job->n_probe));
    return PAL_ERR_OK;
}

pal_err pal_study_reference(pal_study_job *job)
{
    PAL_TRY(at_rest(job));
    while (job->options->quick && !job->adaptive && !job->options->samples &&
           job->out->reference_m > quick_enough * job->out->max_m && job->n_reference * pow(finer, 3) <= QUICK_MAX) {
        job->reference = pal_study_fit_size(job, finer * job->reference);
        PAL_TRY(at_rest(job));
    }
    if (!(job->out->max_m > 0))
        return pal_diagnostic_set(job->diag, PAL_ERR_REFUSED, "the loads move nothing: there is nothing to compare");
    for (int i = 0; i < job->n_probe; i++)
        if (pal_norm3(job->still[0] + 3 * i) > pal_norm3(job->still[0] + 3 * job->tip)) job->tip = i;
    if (!report_progress(job, "reference in motion", (double)(job->n_load + 1) / (job->n_load + 2)))
        return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped at the reference");
    pal_configuration s = reference_setting(job, job->reference);
    return pal_study_cached_trajectory(job, &s, job->way, job->diag);
}
