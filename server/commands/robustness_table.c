#include "server/commands/robustness_table.h"

#include "server/robustness/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int family_length(const pal_robustness_job *job)
{
    return (int)strcspn(job->word, ":");
}

static bool same_row(const pal_robustness_job *a, const pal_robustness_job *b)
{
    const int n = family_length(a);
    return a->done && b->done && n == family_length(b) && !strncmp(a->word, b->word, (size_t)n) &&
           !strcmp(a->model, b->model);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* one row, of the jobs like the first */
static void print_row(FILE *to, const pal_robustness_job *first, int n, double *time_s)
{
    int n_organ = 0, n_refused = 0, n_case = 0, n_safe = 0, n_unsafe = 0, n_good = 0, n_bad = 0, n_time = 0, n_soon = 0;
    double peak = 0;
    for (const pal_robustness_job *job = first; job < first + n; job++) {
        if (!same_row(first, job)) continue;
        n_organ++, n_refused += job->err != PAL_ERR_OK;
        for (int k = 0; !job->err && k < job->report->n; k++) {
            const pal_robustness_result *r = &job->report->result[k];
            if (r->verdict == PAL_VERDICT_SKIPPED) continue;
            n_case++, n_safe += r->safe == PAL_YES, n_unsafe += r->safe == PAL_NO;
            n_good += r->safe == PAL_YES && r->recovered == PAL_YES;
            n_bad += r->safe == PAL_NO || r->recovered == PAL_NO;
            if (r->peak_contact_N > 0) peak = fmax(peak, r->peak_contact_N / r->contact_cap_N);
            if (!isfinite(r->return_s) || r->recovered != PAL_YES) continue;
            time_s[n_time++] = r->return_s, n_soon += r->return_s <= PAL_RETURN_TIME_S;
        }
    }
    qsort(time_s, (size_t)n_time, sizeof *time_s, by_value);
    fprintf(
        to, "| %.*s | %s | %d%s | %d | %d of %d (%.1f %%) | %d of %d (%.1f %%) | %.0f %% | %.3g, %.3g | %.2g | %d |\n",
        family_length(first), first->word, first->model[0] ? first->model : "its own", n_organ,
        n_refused ? " (some refused)" : "", n_case, n_safe, n_safe + n_unsafe,
        100.0 * n_safe / fmax(1, n_safe + n_unsafe), n_good, n_good + n_bad, 100.0 * n_good / fmax(1, n_good + n_bad),
        100.0 * n_soon / fmax(1, n_time), n_time ? time_s[n_time / 2] : (double)NAN,
        n_time ? time_s[n_time - 1] : (double)NAN, peak, n_case - n_good - n_bad);
}

/* "energy: supports (2, 7), hour (3); inverted: flat (1)": causes and cases that are not safe or not recovered */
static void print_causes(FILE *to, const pal_robustness_job *first, int n)
{
    const char *name, *lead = "";
    fprintf(to, "- %.*s, %s: ", family_length(first), first->word, first->model[0] ? first->model : "its own");
    for (int cause = 0, last = -1; cause < PAL_CAUSE_SECONDS; cause++)
        for (int at = 0; (name = pal_robustness_case_name(at, NULL)); at++) {
            int found = 0;
            for (const pal_robustness_job *job = first; job < first + n; job++) {
                if (job->err || !same_row(first, job)) continue;
                for (int k = 0; k < job->report->n; k++) {
                    const pal_robustness_result *r = &job->report->result[k];
                    if (r->cause != (pal_cause)cause || strcmp(r->name, name) != 0) continue;
                    const char *colon = strchr(job->word, ':');
                    if (found++ == 0 && cause == last) fprintf(to, ", %s (", name);
                    if (found == 1 && cause != last) fprintf(to, "%s%s: %s (", lead, pal_cause_name(r->cause), name);
                    last = cause;
                    fprintf(to, "%s%s", found > 1 ? ", " : "", colon ? colon + 1 : "1");
                }
            }
            if (found > 0) fprintf(to, ")"), lead = "; ";
        }
    for (const pal_robustness_job *job = first; job < first + n; job++)
        if (job->err && same_row(first, job)) fprintf(to, "%srefused: %s", lead, job->diag.text), lead = "; ";
    fprintf(to, "%s\n", lead[0] ? "" : "nothing");
}

void pal_robustness_table(FILE *to, const pal_robustness_job *job, int n)
{
    double *time_s = malloc(((size_t)n * PAL_ROBUSTNESS_CASES_MAX + 1) * sizeof *time_s);
    if (!time_s) return;
    fprintf(
        to,
        "| family | model | organs | cases | safe | safe and recovered | of these back in 10 s | s until back: median, "
        "largest | largest force over cap | not judged |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- "
        "|\n");
    for (int part = 0; part < 2; part++) {
        if (part == 1) fprintf(to, "\nWhat is not safe or not recovered, by cause, case (seeds):\n\n");
        for (int k = 0; k < n; k++) {
            bool seen = !job[k].done;
            for (int j = 0; j < k; j++) seen = seen || same_row(&job[j], &job[k]);
            if (seen) continue;
            if (part == 0) print_row(to, &job[k], n - k, time_s);
            if (part == 1) print_causes(to, &job[k], n - k);
        }
    }
    free(time_s);
}
