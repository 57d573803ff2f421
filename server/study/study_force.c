/* The error of the force felt (server/study/README.md, "How a study is computed"): one scripted press at the ticks of a
 * device, rendered from the models of a configuration's world, against the force of the reference at the same pose.
 *
 * A round trip delays poses on their way to the world and models on their way back. The world answers a delayed pose by
 * the same motion later, so one run serves every round trip: a model that would be there at t arrives at t + round
 * trip. Contact of a configuration that computes slower than real time is not delayed further: that is its ms. */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>

const pal_study_link pal_study_links[PAL_STUDY_FORCES] = {{60, 0}, {60, 0.05}, {60, 0.2}, {30, 0.05}};

/* ---- the press ---- */

void pal_study_place_press(pal_study_job *job)
{
    pal_study_press *p = &job->press;
    const pal_surface *s = &job->scene->body[0].mesh->surface;
    const double length_m = job->out->length_scale_m;
    pal_copy3(p->at_m, job->probe + 3 * job->tip);
    pal_study_inward(s, p->at_m, PAL_PRESS_HALF * length_m, p->inward);
    p->radius_m = job->scene->tool[0].radius_m > 0 ? job->scene->tool[0].radius_m : PAL_TOOL_RADIUS * length_m;
    p->depth_m = PAL_PRESS_DEPTH * length_m;
    p->is_placed = pal_norm3(p->inward) > 0;
}

/* depth of the tool's sphere below the surface at rest */
static double depth_at(const pal_study_press *p, double t)
{
    const double begin = -PAL_PRESS_GAP * p->depth_m, whole = p->depth_m - begin,
                 out_s = t - PAL_FORCE_RAMP_S - PAL_FORCE_HOLD_S;
    if (t < PAL_FORCE_RAMP_S) return begin + whole * t / PAL_FORCE_RAMP_S;
    return out_s > 0 ? p->depth_m - whole * fmin(out_s / PAL_FORCE_OUT_S, 1) : p->depth_m;
}

/* pose of the tool at t, with its velocity */
static void pose_at(const pal_study_press *p, double t, pal_pose *out)
{
    const double half = 0.5 * PAL_STUDY_HAPTIC_S;
    *out = (pal_pose){.quat = {1, 0, 0, 0}};
    pal_copy3(out->position_m, p->at_m);
    pal_axpy3(out->position_m, depth_at(p, t) - p->radius_m, p->inward);
    pal_scale3(out->velocity_m_s, (depth_at(p, t + half) - depth_at(p, t - half)) / (2 * half), p->inward);
}

/* ---- the world under it ---- */

/* sees the tool after every step, with the time at its end */
typedef void step_fn(void *user, const pal_tool *tool, double time_s);

/* In a step the tool reaches the pose that is known: that at its begin, or with `ahead` that at its end */
static pal_err run_press(pal_study_job *job, const pal_configuration *configuration, bool ahead, step_fn *step,
                         void *user, pal_diagnostic *diag)
{
    pal_study_world w;
    PAL_TRY(pal_study_open(job, configuration, false, &w, diag));
    const double step_s = w.set->scene.step_s;
    pal_err err = PAL_ERR_OK;
    /* the reference is always followed */
    if (!ahead && pal_world_substeps(w.world) * (double)w.body->n_node * PAL_FORCE_S / step_s > PAL_MAX_WORK)
        err = pal_diagnostic_set(diag, PAL_ERR_BUDGET, "press not followed");
    for (double t = 0; t < PAL_FORCE_S - 1e-9 && !err; t += step_s) {
        pal_pose pose;
        pose_at(&job->press, ahead ? t + step_s : t, &pose);
        err = !pal_study_continues(job) ? PAL_ERR_STATE : pal_world_pose(w.world, 0, &pose);
        if (!err) err = pal_world_step(w.world, step_s);
        if (!err && w.body->frozen) err = PAL_ERR_FROZEN;
        if (!err) step(user, &pal_world_tools(w.world)->tool[0], t + step_s);
    }
    pal_study_close(&w);
    return err ? pal_diagnostic_set(diag, err, "the press ended: %s", pal_err_text(err)) : PAL_ERR_OK;
}

/* ---- the reference ---- */

typedef struct series {
    double (*force_N)[3]; /* [PAL_STUDY_TICKS] */
    double last_N[3], last_s;
    int n;
} series;

/* linear between steps */
static void take_force(void *user, const pal_tool *tool, double time_s)
{
    series *s = user;
    for (; s->n < PAL_STUDY_TICKS && s->n * PAL_STUDY_HAPTIC_S <= time_s + 1e-9; s->n++) {
        const double at = s->n * PAL_STUDY_HAPTIC_S, share = (at - s->last_s) / (time_s - s->last_s);
        for (int c = 0; c < 3; c++) s->force_N[s->n][c] = (1 - share) * s->last_N[c] + share * tool->force_N[c];
    }
    pal_copy3(s->last_N, tool->force_N);
    s->last_s = time_s;
}

pal_err pal_study_press_force(pal_study_job *job, const pal_configuration *configuration, double (*force_N)[3],
                              pal_diagnostic *diag)
{
    series s = {.force_N = force_N};
    memset(force_N, 0, PAL_STUDY_TICKS * sizeof *force_N);
    return run_press(job, configuration, true, take_force, &s, diag);
}

/* ---- what is rendered ---- */

typedef struct models {
    pal_tool *at; /* by model of the fastest link */
    double *time_s;
    int n;
} models;

enum { MODEL_HZ = 60, MODELS = PAL_STUDY_TICKS * MODEL_HZ / 1000 + 1 };

/* the newest state when a model is due */
static void take_model(void *user, const pal_tool *tool, double time_s)
{
    models *m = user;
    while (m->n < MODELS && (double)m->n / MODEL_HZ <= time_s + 1e-9) {
        m->time_s[m->n] = fmax(time_s, (double)m->n / MODEL_HZ);
        m->at[m->n++] = *tool;
    }
}

/* rms and largest difference of the force felt over a link from the reference's */
static void render(const pal_study_job *job, const models *m, const pal_study_link *link, void *state, double *rms_N,
                   double *max_N)
{
    const pal_study_renderer *renderer = job->options->renderer;
    const int every = (int)lround(MODEL_HZ / link->model_Hz);
    double sum = 0;
    int next = 0;
    *max_N = 0;
    memset(state, 0, renderer->n_byte);
    for (int k = 0; k < PAL_STUDY_TICKS; k++) {
        const double t = k * PAL_STUDY_HAPTIC_S;
        double hand_N[3] = {0}, off;
        pal_pose pose;
        for (; next < m->n && m->time_s[next] + link->round_trip_s <= t + 1e-9; next += every)
            renderer->arrive(state, &m->at[next], 1 / link->model_Hz);
        pose_at(&job->press, t, &pose);
        renderer->tick(state, PAL_STUDY_HAPTIC_S, pose.position_m, pose.velocity_m_s, hand_N);
        off = pal_dist3(hand_N, job->force_N[k]);
        sum += off * off;
        *max_N = fmax(*max_N, off);
    }
    *rms_N = sqrt(sum / PAL_STUDY_TICKS);
}

void pal_study_forget_forces(pal_study_point *out)
{
    for (int k = 0; k < PAL_STUDY_FORCES; k++) out->force_rms_N[k] = out->force_max_N[k] = NAN;
}

pal_err pal_study_measure_force(pal_study_job *job, pal_study_point *out)
{
    models m = {.n = 0};
    pal_err err = PAL_ERR_OK;
    pal_diagnostic reason = {{0}};
    uint8_t *state;
    pal_study_forget_forces(out);
    if (!job->options->renderer || !(job->out->max_force_N > 0)) return PAL_ERR_OK;
    PAL_ARRAY(&err, m.at, MODELS);
    PAL_ARRAY(&err, m.time_s, MODELS);
    PAL_ARRAY(&err, state, job->options->renderer->n_byte);
    if (!err) err = run_press(job, &out->measured.configuration, false, take_model, &m, &reason);
    for (int k = 0; k < PAL_STUDY_FORCES && !err; k++)
        render(job, &m, &pal_study_links[k], state, &out->force_rms_N[k], &out->force_max_N[k]);
    PAL_FREE(m.at, m.time_s, state);
    /* a press that cannot be followed leaves the rest of the point valid */
    return err == PAL_ERR_STATE || err == PAL_ERR_MEMORY ? err : PAL_ERR_OK;
}
