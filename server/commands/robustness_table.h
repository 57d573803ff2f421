/* The answers of `palpate robustness` over many scenes, by family and model. Thread: [load]. */
#ifndef PAL_COMMANDS_ROBUSTNESS_TABLE_H
#define PAL_COMMANDS_ROBUSTNESS_TABLE_H
#include "server/robustness/robustness.h"

#include <stdio.h>

typedef struct pal_robustness_job {
    char word[1200]; /* what was asked for: a scene's file, or FAMILY:SEED */
    char model[16];  /* "": a scene, which has its own                     */
    char name[PAL_NAME], title[128], summary[720];
    bool done;   /* it has run, err says how */
    pal_err err; /* it could not be opened or run     */
    pal_diagnostic diag;
    pal_robustness_report *report;
} pal_robustness_job;

/* it ran, and no case failed or is undecided */
static inline bool pal_robustness_job_good(const pal_robustness_job *job)
{
    return !job->err && job->report->count[PAL_VERDICT_FAILED] + job->report->count[PAL_VERDICT_UNDECIDED] == 0;
}
/* Markdown, of jobs that are done: a row for each family and model in the order of the jobs, and below it why the rest
 * is not safe or not recovered: cause, case and seeds. The family is the name up to the colon. */
void pal_robustness_table(FILE *to, const pal_robustness_job *job, int n);
#endif
