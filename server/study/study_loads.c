/* Presses and a pull for a scene without load cases: their positions and strengths. */
#include "server/base/vec3.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { PRESSES = 3, PULL = PRESSES, COARSE = 10, ROUNDS = 4 };

static double pull_of(const pal_study_job *job)
{
    return job->adaptive ? PAL_WALL_DEPTH : PAL_PULL_DEPTH;
}

static double diagonal(const pal_surface *s, double low[3])
{
    double high[3];
    pal_surface_box(s, low, high);
    return pal_dist3(low, high);
}

/* probes farthest from the supports and from each other */
static pal_err choose_press_points(const pal_study_job *job, const pal_study_world *w, int out[PRESSES])
{
    double *far = malloc(sizeof *far * (size_t)job->n_probe);
    if (!far) return PAL_ERR_MEMORY;
    for (int i = 0; i < job->n_probe; i++) {
        far[i] = INFINITY;
        for (int k = 0; k < w->body->n_dof; k++)
            if (w->body->support[k]) far[i] = fmin(far[i], pal_dist3(job->probe + 3 * i, w->body->x_rest + 3 * k));
    }
    for (int p = 0; p < PRESSES; p++) {
        out[p] = 0;
        for (int i = 0; i < job->n_probe; i++)
            if (far[i] > far[out[p]]) out[p] = i;
        for (int i = 0; i < job->n_probe; i++)
            far[i] = fmin(far[i], pal_dist3(job->probe + 3 * i, job->probe + 3 * out[p]));
    }
    free(far);
    return PAL_ERR_OK;
}

void pal_study_inward(const pal_surface *s, const double at[3], double half, double out[3])
{
    double sum[3] = {0, 0, 0};
    for (int t = 0; t < s->n_tri; t++) {
        const double *x[3];
        double n[3];
        bool near = false;
        for (int c = 0; c < 3; c++) x[c] = s->x + 3 * (size_t)s->tri[3 * t + c];
        for (int c = 0; c < 3; c++) near = near || pal_dist3(x[c], at) < half;
        if (!near) continue;
        pal_normal3(n, x[0], x[1], x[2]);
        pal_add3(sum, sum, n);
    }
    double size = pal_norm3(sum);
    pal_set3(out, 0, 0, 0);
    if (size > 0) pal_scale3(out, -1 / size, sum);
}

/* outward and sideways, so that it is independent of the presses */
static void turn_to_pull(double n[3])
{
    double axis[3] = {0, 0, 0}, side[3];
    int min = fabs(n[1]) < fabs(n[0]) ? 1 : 0;
    if (fabs(n[2]) < fabs(n[min])) min = 2;
    axis[min] = 1;
    pal_cross3(side, n, axis);
    pal_scale3(side, PAL_PULL_ASLANT / fmax(pal_norm3(side), 1e-30), side);
    for (int c = 0; c < 3; c++) n[c] = side[c] - n[c];
    pal_scale3(n, 1 / pal_norm3(n), n);
}

static void place_load(pal_study_job *job, int index, const pal_surface *s, const double at[3], double half)
{
    pal_problem_case *c = &job->problem->load_case[index];
    double n[3], low[3];
    pal_study_inward(s, at, 1.5 * half, n);
    /* a fold in the surface: points away from the body's centre */
    if (!(pal_norm3(n) > 0)) {
        double size = diagonal(s, low);
        for (int k = 0; k < 3; k++) n[k] = low[k] - at[k] + size / 2;
        pal_scale3(n, 1 / fmax(pal_norm3(n), 1e-30), n);
    }
    if (index == PULL) turn_to_pull(n);
    if (index == PULL)
        snprintf(c->id, sizeof c->id, "pull");
    else
        snprintf(c->id, sizeof c->id, "press %d", index + 1);
    c->n_load = 1;
    c->load[0] = (pal_problem_load){.kind = PAL_LOAD_TRACTION, .has_total = true};
    pal_copy3(c->load[0].total_N, n);
    for (int k = 0; k < 3; k++) {
        c->load[0].region.low_m[k] = at[k] - half + s->origin_m[k];
        c->load[0].region.high_m[k] = at[k] + half + s->origin_m[k];
    }
    job->load[index] = c;
}

static pal_configuration coarse(const pal_study_job *job)
{
    int size = (int)(PAL_COARSE_SIZE * job->reference);
    if (job->adaptive) return (pal_configuration){.model = "adaptive_springs", .size = 1, .step_s = PAL_STUDY_FRAME_S};
    return (pal_configuration){
        .model = "fem", .law = "linear", .size = size > COARSE ? size : COARSE, .step_s = PAL_STUDY_FRAME_S};
}

/* Scales the load so that its largest displacement has the wanted share, from the nearly linear response of the
 * coarse body. */
static pal_err scale_load(pal_study_job *job, int index, double length_scale_m)
{
    pal_configuration s = coarse(job);
    double *total = job->problem->load_case[index].load[0].total_N;
    const double share[2] = {job->adaptive ? PAL_TRIAL_DEPTH : PAL_PRESS_DEPTH, PAL_PRESS_DEPTH};
    /* a linear body needs one solve; the guess follows from the stiffness */
    double guess = job->scene->body[0].material.young_Pa * PAL_TRIAL_DEPTH * length_scale_m * length_scale_m *
                   (job->adaptive ? 1e-3 : 1);
    pal_scale3(total, guess, total);
    for (int round = 0; round < (job->adaptive ? 2 : 1); round++) {
        int n_node;
        PAL_TRY(pal_study_cached_static(job, &s, job->load[index], job->now, &n_node, job->diag));
        double moved = pal_max_norm3(job->now, job->n_probe);
        if (!(moved > 0) || !isfinite(moved))
            return PAL_REFUSE(job->diag, "%s of %g N moves nothing", job->load[index]->id, pal_norm3(total));
        double wanted = share[round] * length_scale_m / moved, size_N = pal_norm3(total);
        /* limited by the tool's force cap and by the deformation that the body can bear */
        double cap_N = job->scene->n_tool > 0 ? job->scene->tool[0].force_cap_N : PAL_PULL_N;
        if (index == PULL) wanted = fmin(cap_N / size_N, pull_of(job) * length_scale_m / moved);
        pal_scale3(total, wanted, total);
    }
    return PAL_ERR_OK;
}

bool pal_study_press_adjust(pal_study_job *job, int index, pal_err err)
{
    if (index >= job->n_press || job->round[index] >= ROUNDS) return false;
    double *total = job->problem->load_case[index].load[0].total_N, times = 1;
    double moved = err ? 0 : pal_max_norm3(job->static_u[index], job->n_probe);
    bool none = err == PAL_ERR_NUMERIC || err == PAL_ERR_FROZEN;
    if (none) times = 0.5;
    if (!err && moved > 0) times = PAL_PRESS_DEPTH * job->out->length_scale_m / moved;
    if (!err && index == PULL)
        times = moved > 0 ? fmin(PAL_PRESS_RANGE * pull_of(job) * job->out->length_scale_m / moved, 1) : 1;
    if (!none && times <= PAL_PRESS_RANGE && times >= (index == PULL ? 1 : 1 / PAL_PRESS_RANGE)) return false;
    job->round[index]++;
    pal_scale3(total, times, total);
    return true;
}

pal_err pal_study_presses(pal_study_job *job)
{
    pal_study_world w;
    pal_configuration s = coarse(job);
    int probe[PRESSES], n_fixed = 0;
    double low[3];
    PAL_TRY(pal_study_open(job, &s, true, &w, job->diag));
    for (int i = 0; i < w.body->n_dof; i++) n_fixed += w.body->support[i] != 0;
    pal_err err = PAL_ERR_OK;
    if (n_fixed == 0 && !job->adaptive)
        err = PAL_REFUSE(job->diag, "body \"%s\": nothing holds it, so a press has no rest", job->scene->body[0].name);
    if (!err) err = choose_press_points(job, &w, probe);
    const pal_surface *surface = &w.set->scene.body[0].mesh->surface;
    double length_scale_m = diagonal(surface, low);
    for (int k = 0; k < PRESSES && !err; k++)
        place_load(job, k, surface, job->probe + 3 * probe[k], PAL_PRESS_HALF * length_scale_m);
    /* where it moves most: at the probe farthest from the supports */
    if (!err) place_load(job, PULL, surface, job->probe + 3 * probe[0], PAL_GRASP_HALF * length_scale_m);
    pal_study_close(&w);
    job->n_load = job->n_press = job->problem->n_case = PULL + 1;
    for (int k = 0; k <= PULL && !err; k++) err = scale_load(job, k, length_scale_m);
    return err;
}
