/* Configurations on the front must pass robustness cases: the two cheapest that springs fitted to gentle presses
 * were observed to fail. An undecided case excludes nothing. Neither does a body stopped by its safeguards: it is
 * reported and reset, whereas one that silently stays away from rest is not. */
#include "server/robustness/robustness.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <stdio.h>
#include <stdlib.h>

static bool keeps_on(const char *what, double fraction, void *user)
{
    (void)what, (void)fraction;
    return pal_study_continues(user);
}

/* the first case that it fails; NULL: none that was decided */
static const char *failed(pal_study_job *job, const pal_configuration *configuration)
{
    static const char *const name[] = {"meganewton", "flat"};
    pal_configured_scene *set = NULL;
    pal_diagnostic reason = {{0}};
    const char *found = NULL;
    pal_robustness_report *report = malloc(sizeof *report);
    if (!report || pal_configuration_make(job->scene, 0, configuration, &reason, &set)) {
        free(report);
        return NULL;
    }
    for (size_t k = 0; k < sizeof name / sizeof *name && !found; k++) {
        pal_robustness_options o;
        pal_robustness_default(&o);
        o.only = name[k], o.max_cpu_s = PAL_CASE_CPU_S, o.progress = keeps_on, o.user = job;
        if (!pal_robustness_run(&set->scene, &o, report, &reason) && report->count[PAL_VERDICT_FAILED] > 0 &&
            !report->result[0].frozen)
            found = name[k];
    }
    pal_configured_scene_free(set);
    free(report);
    return found;
}

pal_err pal_study_check_robustness(pal_study_job *job)
{
    bool checked[PAL_STUDY_POINTS] = {false};
    const pal_study_options *o = job->options;
    for (int i = 0; i < job->out->n_point;) {
        pal_study_point *p = &job->out->point[i];
        if (!p->measured.front || checked[i]) {
            i++;
            continue;
        }
        bool go = !o->progress || o->progress("robustness of the front", (double)i / job->out->n_point, o->user);
        if (!go || !pal_study_continues(job))
            return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped at the front");
        checked[i] = true;
        const char *name = failed(job, &p->measured.configuration);
        if (!name) continue;
        snprintf(p->reason, sizeof p->reason, "fails %s of palpate robustness: not named", name);
        /* points that it dominated may be on the front now, also cheaper ones */
        pal_study_mark_front(job->out);
        i = 0;
    }
    return PAL_ERR_OK;
}
