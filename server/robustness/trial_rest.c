/* The rest state of a trial's scene, and the undisturbed run that replaces it for a driven scene. */
#include "server/base/vec3.h"
#include "server/robustness/trial.h"

#include <string.h>

double pal_trial_speed_S_s(const pal_trial *trial)
{
    double max = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        double sum = 0;
        for (int k = 0; k < body->n_active; k++) {
            const double *v = body->v + 3 * (size_t)pal_body_point(body, k);
            sum += pal_dot3(v, v);
        }
        double speed = sqrt(sum / (body->n_active > 0 ? body->n_active : 1)) / body->length_scale_m;
        if (!(speed <= max)) max = speed;
    }
    return max;
}

/* ---- rest ---- */

void pal_trial_find_times(pal_trial *trial)
{
    trial->lowest_1_s = trial->tau_s = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        if (!(body->lowest_1_s > 0)) (void)pal_world_find_lowest(trial->world, b, NULL);
        if (!(body->lowest_1_s > 0)) continue; /* nothing holds it */
        if (!(trial->lowest_1_s > 0 && trial->lowest_1_s < body->lowest_1_s)) trial->lowest_1_s = body->lowest_1_s;
        trial->tau_s = fmax(trial->tau_s, pal_body_return_s(body));
    }
}

double pal_trial_long_step_s(const pal_trial *trial)
{
    for (int b = 0; b < trial->scene->n_body; b++)
        if (!pal_world_body(trial->world, b)->implicit) return trial->scene->step_s;
    return fmin(PAL_RETURN_TIME_S, fmax(PAL_LONG_STEP_TAU * trial->tau_s, trial->scene->step_s));
}

bool pal_trial_settle(pal_trial *trial, double *took_s)
{
    const double max_s = fmax(3 * PAL_RETURN_TIME_S, PAL_SETTLE_TAU * fmax(trial->tau_s, pal_trial_long_step_s(trial))),
                 still_S_s = fmin(PAL_REST_SPEED_S_S, 0.1 * PAL_RETURN_S / fmax(trial->tau_s, 1e-9));
    double rest_time_s = 0, t = 0;
    /* what falls into its weight swings first */
    while (t < max_s && rest_time_s < PAL_REST_HOLD_S) {
        const double step = t < PAL_RETURN_TIME_S ? trial->scene->step_s : pal_trial_long_step_s(trial);
        trial->late = pal_trial_cpu_s() > trial->deadline_s;
        if (trial->late || pal_world_step(trial->world, step)) return false;
        t += step;
        rest_time_s = pal_trial_speed_S_s(trial) <= still_S_s ? rest_time_s + step : 0;
    }
    *took_s = t;
    return rest_time_s >= PAL_REST_HOLD_S;
}

void pal_trial_save(const pal_trial *trial, double **to)
{
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        memcpy(to[b], body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    }
}

/* ---- a driven scene ---- */

/* Makes one step of the undisturbed run. False: it cannot follow, so nothing can be judged any more. */
bool pal_trial_step_twin(pal_trial *trial, double dt_s)
{
    if (!trial->twin) return true;
    if (pal_world_step(trial->twin, dt_s)) return false;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->twin, b);
        if (body->frozen) return false;
        memcpy(trial->rest[b], body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    }
    trial->rest_J = pal_world_energy_J(trial->twin);
    return true;
}

/* makes both worlds again and runs both for a while */
static bool begin_twin(pal_trial *trial)
{
    pal_world *twin = NULL;
    if (pal_world_create(trial->scene, NULL, &twin)) return false;
    pal_world_destroy(trial->twin);
    trial->twin = twin;
    for (double t = 0; t < 2 * PAL_REST_HOLD_S; t += trial->scene->step_s)
        if (pal_world_step(trial->world, trial->scene->step_s) || !pal_trial_step_twin(trial, trial->scene->step_s))
            return false;
    return true;
}

/* Restores the scene at rest in a new world, because solvers keep factors of earlier states. */
bool pal_trial_back_to_rest(pal_trial *trial)
{
    double took_s;
    pal_world *fresh = NULL;
    if (pal_world_create(trial->scene, NULL, &fresh)) return false;
    pal_world_destroy(trial->world);
    trial->world = fresh;
    if (trial->twin) return begin_twin(trial);
    if (trial->settles_each) {
        if (!pal_trial_settle(trial, &took_s)) return false;
        pal_trial_save(trial, trial->rest);
        trial->rest_J = pal_world_energy_J(trial->world);
        return true;
    }
    for (int b = 0; b < trial->scene->n_body; b++) {
        pal_body *body = pal_world_body(trial->world, b);
        memcpy(body->x, trial->rest[b], 3 * sizeof(double) * (size_t)body->n_dof);
        pal_world_invalidate_limits(trial->world, b);
    }
    return true;
}
