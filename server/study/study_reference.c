/* The reference of a study: the finest affordable body, its error estimated from its last changes, and the
 * trajectory of the tip. */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/solve/convergence.h"
#include "server/study/study_job.h"
#include "server/study/study_store.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COUNTED = 12 }; /* size at which nodes are counted */

static pal_configuration reference_configuration(const pal_study_job *job, int size)
{
    pal_configuration s = {
        .model = "fem", .element = "hex8_bbar", .solver = "sdirk2", .tolerance = PAL_REFERENCE_TOLERANCE};
    if (job->adaptive)
        s = (pal_configuration){.model = "adaptive_springs", .element = "refined", .solver = "rk4"};
    else
        snprintf(s.law, PAL_NAME, "%s", job->law);
    s.size = size;
    s.step_s =
        (job->options->quick ? 2 : 1) * fmin(PAL_REFERENCE_STEP_S, PAL_REFERENCE_STEP_SHARE * job->scene->step_s);
    return s;
}

/* includes the terminators, so that words do not run together */
static uint64_t add_word(uint64_t sum, const char *word)
{
    return pal_hash_bytes(sum, word, strlen(word) + 1);
}

/* Hash of everything that an answer depends on (kind, configuration, load, points) except the body. */
static uint64_t sum_of(const pal_study_job *job, const char *what, const pal_configuration *s,
                       const pal_problem_case *load)
{
    const double number[] = {s->size,       s->step_s,    s->tolerance, s->k_distance_J, s->k_area_J,
                             s->k_volume_J, job->seconds, job->tip,     job->n_probe};
    const pal_study_press *press = &job->press;
    bool moves = !strcmp(what, "trajectory"), pressed = !strcmp(what, "force");
    uint64_t sum = add_word(PAL_HASH_START, what);
    sum = add_word(add_word(add_word(add_word(sum, s->model), s->element), s->law), s->solver);
    sum = pal_study_digest_numbers(sum, number, 6);
    if (moves) sum = pal_study_digest_numbers(sum, number + 6, 2);
    if (pressed) sum = pal_study_digest_numbers(sum, (double[]){press->radius_m, press->depth_m}, 2);
    if (pressed) sum = pal_study_digest_numbers(pal_study_digest_numbers(sum, press->at_m, 3), press->inward, 3);
    for (int k = 0; k < load->n_load; k++) sum = pal_study_digest_load(sum, &load->load[k]);
    return pal_study_digest_numbers(pal_study_digest_numbers(sum, number + 8, 1), job->probe, 3 * (size_t)job->n_probe);
}

typedef enum answer_kind { REST, TRAJECTORY, FORCE } answer_kind;

static pal_err solve(pal_study_job *job, answer_kind kind, const pal_configuration *configuration,
                     const pal_problem_case *load, double (*value)[3], int *n_node, pal_diagnostic *diag)
{
    if (kind == REST) return pal_study_static(job, configuration, load, value[0], n_node, diag);
    if (kind == FORCE) return pal_study_press_force(job, configuration, value, diag);
    return pal_study_trajectory(job, configuration, value, NULL, 0, NULL, NULL, diag);
}

/* A static solution under `load`, the trajectory under it, or the forces of the scripted press: value [n][3] from the
 * cache, else computed and stored. */
static pal_err cached(pal_study_job *job, answer_kind kind, const pal_configuration *configuration,
                      const pal_problem_case *load, double (*value)[3], int n, int *n_node, pal_diagnostic *diag)
{
    static const char *const name[] = {"rest", "trajectory", "force"};
    const pal_study_options *o = job->options;
    uint64_t key = sum_of(job, name[kind], configuration, load);
    pal_study_answer answer = {.n_node = 0};
    pal_diagnostic reason = {{0}};
    if (!o->recall || !o->recall(key, &answer, value[0], 3 * n, o->user)) {
        answer.err = solve(job, kind, configuration, load, value, &answer.n_node, &reason);
        snprintf(answer.reason, sizeof answer.reason, "%.*s", PAL_CONFIGURATION_TEXT - 1, reason.text);
        if (answer.err) memset(value, 0, sizeof *value * (size_t)n);
        /* an answer cut short by a stop or by lack of memory is not stored */
        bool whole = !answer.err || answer.err == PAL_ERR_NUMERIC || answer.err == PAL_ERR_FROZEN;
        if (o->remember && whole) o->remember(key, &answer, value[0], 3 * n, o->user);
    }
    *n_node = answer.n_node;
    return answer.err ? pal_diagnostic_set(diag, answer.err, "%s", answer.reason) : PAL_ERR_OK;
}

pal_err pal_study_cached_static(pal_study_job *job, const pal_configuration *configuration,
                                const pal_problem_case *load, double *u, int *n_node, pal_diagnostic *diag)
{
    return cached(job, REST, configuration, load, (double(*)[3])u, job->n_probe, n_node, diag);
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
    bool full = fabs(pal_surface_volume(surface)) > PAL_BOX_FILL * volume;
    for (int c = 0; c < 3; c++) job->box_m[c] = full ? side[c] : 0;
    job->slender = shortest > 0 ? fmin(fmax(longest / shortest / 4, 1), 3) : 1;
}

/* predicts the nodes of a size from those of a coarse one */
pal_err pal_study_reference_size(pal_study_job *job)
{
    static const int whole[] = {80, 64, 56, 48, 40, 34, 28, 24, 20, 16, 12}, quick[] = {20, 18, 16, 14, 12, 10};
    const int *size = job->options->quick ? quick : whole;
    int n = job->options->quick ? 6 : 11;
    double max = job->options->quick ? PAL_QUICK_NODES : PAL_REFERENCE_NODES;
    pal_study_world w;
    if (job->adaptive) {
        job->reference = job->options->quick ? 3 : 4;
        return PAL_ERR_OK;
    }
    take_sides(job, &job->scene->body[0].mesh->surface);
    pal_configuration s = reference_configuration(job, pal_study_size(job, COUNTED));
    PAL_TRY(pal_study_open(job, &s, true, &w, job->diag));
    double count = w.body->n_node;
    pal_study_close(&w);
    for (int i = 0; i < n; i++) {
        job->reference = pal_study_size(job, size[i]);
        if (count * pow((double)size[i] / COUNTED, 3) <= max) break;
    }
    return PAL_ERR_OK;
}

/* Remaining error of one load from its equilibria at two coarser sizes: the sum of the expected further changes
 * (Richardson, of order 1 to 2). */
static pal_err estimate_load(pal_study_job *job, int load, const int size[3], double *u[2], double *out)
{
    double h[3];
    for (int k = 0; k < 2; k++) {
        int n_node;
        pal_configuration s = reference_configuration(job, size[k]);
        PAL_TRY(pal_study_cached_static(job, &s, job->load[load], u[k], &n_node, job->diag));
    }
    for (int k = 0; k < 3; k++) h[k] = job->adaptive ? exp2(-size[k]) : 1.0 / size[k];
    double first = pal_max_dist3(u[0], u[1], job->n_probe),
           last = pal_max_dist3(u[1], job->static_u[load], job->n_probe);
    double order = pal_richardson_order(h, first, last);
    /* changes that shrink more slowly than first order are PAL_SCATTER_MARGIN of cut voxels: takes the largest, with a
     * margin */
    *out =
        order >= PAL_MIN_ORDER ? last / (pow(h[1] / h[2], fmin(order, 2)) - 1) : PAL_SCATTER_MARGIN * fmax(first, last);
    return PAL_ERR_OK;
}

/* largest error over the loads */
static pal_err estimate(pal_study_job *job, double *out)
{
    int size[3] = {pal_study_fit_size(job, job->reference / 2.0),
                   pal_study_fit_size(job, job->reference / PAL_REFERENCE_RATIO), job->reference};
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

/* reports progress; STATE: the user asked to stop */
static pal_err report_progress(const pal_study_job *job, const char *what, double n_done)
{
    const pal_study_options *o = job->options;
    if (!o->progress || o->progress(what, n_done / (job->n_load + 2), o->user)) return PAL_ERR_OK;
    return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped at the reference");
}

static pal_err made(pal_study_job *job)
{
    pal_configuration s = reference_configuration(job, job->reference);
    char name[PAL_CONFIGURATION_TEXT];
    int n_node = 0;
    for (int k = 0; k < job->n_load; k++) {
        PAL_TRY(report_progress(job, "reference at rest", k));
        pal_err err;
        do err = pal_study_cached_static(job, &s, job->load[k], job->static_u[k], &n_node, job->diag);
        while (pal_study_press_adjust(job, k, err));
        PAL_TRY(err);
    }
    job->n_reference = n_node;
    PAL_TRY(report_progress(job, "reference, its own error", job->n_load));
    PAL_TRY(estimate(job, &job->out->reference_m));
    s.tolerance = 0;
    snprintf(job->out->reference, sizeof job->out->reference, "%s, %d nodes", pal_configuration_text(&s, name), n_node);
    return PAL_ERR_OK;
}

static pal_err at_rest(pal_study_job *job)
{
    if (job->options->samples) {
        memcpy(job->static_u[0], job->options->samples->u, 3 * sizeof(double) * (size_t)job->n_probe);
        snprintf(job->out->reference, sizeof job->out->reference,
                 "%d displacements that were given, at rest; fem hex8_bbar, the trajectory", job->n_probe);
        job->out->reference_m = 0;
    } else {
        PAL_TRY(made(job));
    }
    job->out->max_m = 0;
    for (int k = 0; k < job->n_load; k++)
        job->out->max_m = fmax(job->out->max_m, pal_max_norm3(job->static_u[k], job->n_probe));
    return PAL_ERR_OK;
}

/* size of a reference one step coarser */
static int coarser_reference(const pal_study_job *job)
{
    if (job->adaptive) return job->reference - 1;
    int size = pal_study_fit_size(job, job->reference / PAL_REFERENCE_RATIO);
    return size < job->reference ? size : job->reference - 1;
}

static pal_err press_reference(pal_study_job *job, int size, double (*force_N)[3])
{
    pal_configuration s = reference_configuration(job, size);
    pal_diagnostic reason = {{0}};
    int n_node;
    s.step_s = fmin((job->options->quick ? 2 : 1) * PAL_FORCE_REFERENCE_STEP_S, job->scene->step_s);
    pal_err err = cached(job, FORCE, &s, job->load[0], force_N, PAL_STUDY_TICKS, &n_node, &reason);
    return err ? pal_diagnostic_set(job->diag, err, "%s", reason.text) : PAL_ERR_OK;
}

/* Force of the reference in the scripted press, and how much finer voxels still change it. One that it cannot follow
 * leaves forces unjudged */
static pal_err press(pal_study_job *job)
{
    double(*coarser_N)[3] = NULL, sum = 0;
    job->out->max_force_N = job->out->reference_force_N = NAN;
    if (!job->options->renderer || job->scene->n_tool < 1) return PAL_ERR_OK;
    pal_study_place_press(job);
    if (!job->press.is_placed) return PAL_ERR_OK;
    PAL_TRY(report_progress(job, "reference, pressed", job->n_load + 1.5));
    pal_err err = press_reference(job, job->reference, job->force_N);
    PAL_ARRAY(&err, coarser_N, PAL_STUDY_TICKS);
    if (!err) job->out->max_force_N = pal_max_norm3(job->force_N[0], PAL_STUDY_TICKS);
    if (!err) err = press_reference(job, coarser_reference(job), coarser_N);
    for (int k = 0; k < PAL_STUDY_TICKS && !err; k++) {
        double off = pal_dist3(coarser_N[k], job->force_N[k]);
        sum += off * off;
    }
    if (!err) job->out->reference_force_N = sqrt(sum / PAL_STUDY_TICKS);
    free(coarser_N);
    return err == PAL_ERR_STATE || err == PAL_ERR_MEMORY ? err : PAL_ERR_OK;
}

pal_err pal_study_reference(pal_study_job *job)
{
    PAL_TRY(at_rest(job));
    while (job->options->quick && !job->adaptive && !job->options->samples &&
           job->out->reference_m > PAL_STUDY_TRUST / 2 * job->out->max_m &&
           job->n_reference * pow(PAL_REFERENCE_RATIO, 3) <= PAL_QUICK_REFINED_NODES) {
        job->reference = pal_study_fit_size(job, PAL_REFERENCE_RATIO * job->reference);
        PAL_TRY(at_rest(job));
    }
    if (!(job->out->max_m > 0)) return PAL_REFUSE(job->diag, "the loads move nothing: there is nothing to compare");
    for (int i = 0; i < job->n_probe; i++)
        if (pal_norm3(job->static_u[0] + 3 * i) > pal_norm3(job->static_u[0] + 3 * job->tip)) job->tip = i;
    PAL_TRY(report_progress(job, "reference in motion", job->n_load + 1));
    pal_configuration s = reference_configuration(job, job->reference);
    int n_node;
    PAL_TRY(cached(job, TRAJECTORY, &s, job->load[0], job->trajectory, job->n_trajectory, &n_node, job->diag));
    return press(job);
}
