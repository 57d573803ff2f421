/* Cache of a reference's equilibria and trajectory. The key is a hash of everything they depend on except the body,
 * for which the store is responsible. */
#include "server/study/study_job.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t add_bytes(uint64_t sum, const void *bytes, size_t n_byte)
{
    const unsigned char *at = bytes;
    for (size_t i = 0; i < n_byte; i++) sum = (sum ^ at[i]) * 0x100000001b3u;
    return sum;
}

static uint64_t add_numbers(uint64_t sum, const double *value, int n)
{
    return add_bytes(sum, value, (size_t)n * sizeof *value);
}

/* includes the terminators, so that words do not run together */
static uint64_t add_word(uint64_t sum, const char *word)
{
    return add_bytes(sum, word, strlen(word) + 1);
}

static uint64_t add_load(uint64_t sum, const pal_problem_load *l)
{
    const double kind[] = {l->kind, l->region.all, l->has_normal, l->has_traction, l->has_total};
    sum = add_numbers(sum, kind, 5);
    sum = add_numbers(add_numbers(sum, l->region.low_m, 3), l->region.high_m, 3);
    sum = add_numbers(add_numbers(sum, l->normal, 3), l->traction_Pa, 3);
    sum = add_numbers(add_numbers(sum, l->total_N, 3), l->point_m, 3);
    return add_numbers(add_numbers(sum, l->force_N, 3), l->gravity_m_s2, 3);
}

/* hash of the request: kind, configuration, load and points */
static uint64_t sum_of(const pal_study_job *job, const char *what, const pal_configuration *s,
                       const pal_problem_case *load)
{
    const double number[] = {s->size,       s->step_s,    s->tolerance, s->k_distance_J, s->k_area_J,
                             s->k_volume_J, job->seconds, job->tip,     job->n_probe};
    bool way = !strcmp(what, "way");
    uint64_t sum = add_word(0xcbf29ce484222325u, what);
    sum = add_word(add_word(add_word(add_word(sum, s->model), s->element), s->law), s->solver);
    sum = add_numbers(sum, number, 6);
    if (way) sum = add_numbers(sum, number + 6, 2);
    for (int k = 0; k < load->n_load; k++) sum = add_load(sum, &load->load[k]);
    return add_numbers(add_numbers(sum, number + 8, 1), job->probe, 3 * job->n_probe);
}

static bool recall(const pal_study_job *job, uint64_t key, pal_study_answer *answer, double *value, int n)
{
    const pal_study_options *o = job->options;
    return o->recall && o->recall(key, answer, value, n, o->user);
}

/* an answer cut short by a stop or by lack of memory is not stored */
static void remember(const pal_study_job *job, uint64_t key, const pal_study_answer *answer, const double *value, int n)
{
    const pal_study_options *o = job->options;
    bool whole = !answer->err || answer->err == PAL_ERR_NUMERIC || answer->err == PAL_ERR_FROZEN;
    if (o->remember && whole) o->remember(key, answer, value, n, o->user);
}

/* returns the error of an answer with its sentence */
static pal_err summary(const pal_study_answer *answer, pal_diagnostic *diag)
{
    return answer->err ? pal_diagnostic_set(diag, answer->err, "%s", answer->reason) : PAL_ERR_OK;
}

pal_err pal_study_cached_static(pal_study_job *job, const pal_configuration *setting, const pal_problem_case *load,
                                double *u, int *n_node, pal_diagnostic *diag)
{
    uint64_t key = sum_of(job, "rest", setting, load);
    pal_study_answer answer = {.n_node = 0};
    pal_diagnostic reason = {{0}};
    int n = 3 * job->n_probe;
    if (!recall(job, key, &answer, u, n)) {
        answer.err = pal_study_static(job, setting, load, u, &answer.n_node, &reason);
        snprintf(answer.reason, sizeof answer.reason, "%.*s", PAL_CONFIGURATION_TEXT - 1, reason.text);
        if (answer.err) memset(u, 0, sizeof *u * (size_t)n);
        remember(job, key, &answer, u, n);
    }
    *n_node = answer.n_node;
    return summary(&answer, diag);
}

pal_err pal_study_cached_trajectory(pal_study_job *job, const pal_configuration *setting, double (*way)[3],
                                    pal_diagnostic *diag)
{
    uint64_t key = sum_of(job, "way", setting, job->load[0]);
    pal_study_answer answer = {.n_node = 0};
    pal_diagnostic reason = {{0}};
    int n = 3 * job->n_trajectory;
    if (!recall(job, key, &answer, way[0], n)) {
        answer.err = pal_study_trajectory(job, setting, way, NULL, 0, NULL, NULL, &reason);
        snprintf(answer.reason, sizeof answer.reason, "%.*s", PAL_CONFIGURATION_TEXT - 1, reason.text);
        if (answer.err) memset(way, 0, sizeof *way * (size_t)job->n_trajectory);
        remember(job, key, &answer, way[0], n);
    }
    return summary(&answer, diag);
}
