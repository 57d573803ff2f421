/* Fits springs to the study's reference: homogeneous constants of edges and volumes, by the adjoint. With several
 * loads the last one is not fitted, so that the point is also judged by an unseen load. */
#include "server/base/vec3.h"
#include "server/calibrate/calibrate.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_EVALUATIONS = 60 };

/* the reference's equilibrium under a load, in the frame of the problem */
static pal_err take_samples(const pal_study_job *job, int load, pal_samples *out)
{
    const pal_prepared *mesh = job->scene->body[0].mesh;
    size_t n = 3 * (size_t)job->n_probe;
    *out = (pal_samples){job->n_probe, malloc(n * sizeof(double)), malloc(n * sizeof(double))};
    if (!out->x || !out->u) return PAL_ERR_MEMORY;
    for (int i = 0; i < job->n_probe; i++) pal_add3(out->x + 3 * i, job->probe + 3 * i, mesh->surface.origin_m);
    memcpy(out->u, job->static_u[load], n * sizeof(double));
    return PAL_ERR_OK;
}

static bool may_continue(void *user, const pal_fit_step *step)
{
    (void)step;
    return pal_study_continues(user);
}

static pal_err fit(pal_study_job *job, const pal_calibration *calibration, pal_configuration *configuration,
                   pal_diagnostic *diag)
{
    pal_calibration_info info;
    pal_fit_result result;
    const pal_fit_options options = {.max_evaluation = MAX_EVALUATIONS, .step = may_continue, .user = job};
    pal_calibration_info_of(calibration, &info);
    double *theta = malloc(sizeof *theta * (size_t)info.n_parameter);
    if (!theta) return PAL_ERR_MEMORY;
    memcpy(theta, info.start, sizeof *theta * (size_t)info.n_parameter);
    pal_err err = pal_fit_adjoint(calibration, &options, theta, &result, diag);
    double *const k_J[PAL_SPRING_KINDS] = {[PAL_SPRING_DISTANCE] = &configuration->k_distance_J,
                                           [PAL_SPRING_AREA] = &configuration->k_area_J,
                                           [PAL_SPRING_VOLUME] = &configuration->k_volume_J};
    for (int k = 0; k < info.n_kind && !err; k++) *k_J[info.kind[k]] = exp(theta[k]);
    free(theta);
    return err;
}

pal_err pal_study_fit(pal_study_job *job, pal_configuration *configuration, pal_diagnostic *diag)
{
    pal_samples samples[PAL_STUDY_LOADS] = {{0}};
    pal_calibrate_case cases[PAL_STUDY_LOADS];
    pal_calibrate_options options;
    pal_calibration *calibration = NULL;
    pal_err err = PAL_ERR_OK;
    pal_calibrate_default(&options);
    options.voxel.resolution = configuration->size;
    options.without_area = true, options.min_volume_ratio = PAL_MIN_VOLUME_RATIO;
    int n_fit = job->n_load > 1 ? job->n_load - 1 : 1;
    for (int k = 0; k < n_fit && !err; k++) {
        err = take_samples(job, k, &samples[k]);
        cases[k] = (pal_calibrate_case){
            .load_case = job->load[k], .samples = &samples[k], .truth_name = "reference", .fit = true};
    }
    if (job->problem->n_support == 0) err = PAL_REFUSE(diag, "its supports are no boxes of the problem's frame");
    if (!err)
        err = pal_calibration_create(job->problem, &job->scene->body[0].mesh->surface, cases, n_fit, &options,
                                     &calibration, diag);
    if (!err) err = fit(job, calibration, configuration, diag);
    pal_calibration_destroy(calibration);
    for (int k = 0; k < n_fit; k++) pal_samples_free(&samples[k]);
    return err;
}
