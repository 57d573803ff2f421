/* The sweep: body and loads, reference, then one point after the other. */
#include "server/study/study.h"

#include "server/base/heap.h"
#include "server/base/machine.h"
#include "server/base/vec3.h"
#include "server/solve/load_case.h"
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdio.h>

enum { SCENE_VOXELS = 16, FINEST_SCENE = 64, COARSE = 10, SOFTER = 3 };

static void free_job(pal_study_job *job)
{
    for (int k = 0; k < PAL_STUDY_LOADS; k++) free(job->static_u[k]);
    PAL_FREE(job->probe, job->now, job->trajectory, job->own_trajectory, job->force_N, job->scene, job->problem);
}

bool pal_study_continues(const pal_study_job *job)
{
    return !job->options->may_continue || job->options->may_continue(job->options->user);
}

static pal_err allocate(pal_study_job *job, int n_probe)
{
    pal_err err = PAL_ERR_OK;
    job->n_probe = n_probe;
    PAL_ARRAY(&err, job->probe, 3 * n_probe);
    PAL_ARRAY(&err, job->now, 3 * n_probe);
    for (int k = 0; k < PAL_STUDY_LOADS; k++) PAL_ZEROED(&err, job->static_u[k], 3 * n_probe);
    job->seconds = job->options->seconds > 0 ? job->options->seconds : PAL_STUDY_SECONDS;
    job->n_trajectory = (int)fmax(1, floor(job->seconds / PAL_STUDY_FRAME_S + 1e-9));
    PAL_ZEROED(&err, job->trajectory, job->n_trajectory);
    PAL_ZEROED(&err, job->own_trajectory, job->n_trajectory);
    PAL_ZEROED(&err, job->force_N, PAL_STUDY_TICKS);
    return err ? pal_diagnostic_set(job->diag, err, "no memory for a study") : PAL_ERR_OK;
}

/* evenly picked vertices of the displayed surface, or the points of the samples */
static pal_err choose_probes(pal_study_job *job)
{
    const pal_samples *samples = job->options->samples;
    pal_study_world w;
    const pal_configuration s = job->adaptive ? (pal_configuration){.model = "adaptive_springs"}
                                              : (pal_configuration){.model = "fem", .size = COARSE};
    PAL_TRY(pal_study_open(job, &s, true, &w, job->diag));
    const pal_surface *surface = &w.set->scene.body[0].mesh->surface;
    int n = surface->n_vertex, max = samples ? samples->n : n < PAL_STUDY_PROBES ? n : PAL_STUDY_PROBES;
    double low[3], high[3];
    pal_surface_box(surface, low, high);
    job->out->length_scale_m = pal_dist3(low, high);
    pal_err err = allocate(job, max);
    for (int i = 0; i < max && !err; i++) {
        if (samples)
            pal_sub3(job->probe + 3 * i, samples->x + 3 * i, surface->origin_m);
        else
            pal_copy3(job->probe + 3 * i, surface->x + 3 * (size_t)((int64_t)i * n / max));
    }
    pal_study_close(&w);
    return err;
}

/* the point if it was measured before */
static const pal_study_point *known(const pal_study *before, const pal_study_entry *entry)
{
    for (int i = 0; before && i < before->n_point; i++) {
        const pal_study_point *p = &before->point[i];
        bool fitted = p->measured.configuration.k_distance_J > 0 || !strncmp(p->reason, "calibration:", 12);
        pal_configuration bare = p->measured.configuration;
        bare.k_distance_J = bare.k_area_J = bare.k_volume_J = 0;
        if (fitted == entry->calibrate && pal_configuration_equal(&bare, &entry->configuration)) return p;
    }
    return NULL;
}

static pal_err sweep(pal_study_job *job, const pal_study_entry *entry, int n)
{
    const pal_study_options *o = job->options;
    for (int i = 0; i < n; i++) {
        if (o->own && !o->own(i, o->user)) continue;
        char name[PAL_CONFIGURATION_TEXT];
        pal_study_point *point = &job->out->point[job->out->n_point];
        const pal_study_point *old = known(o->before, &entry[i]);
        bool go =
            !o->progress || o->progress(pal_configuration_text(&entry[i].configuration, name), (double)i / n, o->user);
        if (!go) return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped after %d of %d configurations", i, n);
        if (old)
            *point = *old;
        else
            PAL_TRY(pal_study_measure(job, &entry[i], point));
        job->out->n_point++;
        pal_study_mark_front(job->out);
        if (o->done && !o->done(job->out, n, o->user))
            return pal_diagnostic_set(job->diag, PAL_ERR_STATE, "stopped after %d of %d configurations", i + 1, n);
    }
    return PAL_ERR_OK;
}

/* Fine elements under the edge of a pressed area may have no equilibrium where the coarse estimate had one: halves
 * the load. */
static pal_err press(pal_study_job *job)
{
    PAL_TRY(pal_study_presses(job));
    pal_err err = pal_study_reference(job);
    for (int turn = 0; turn < SOFTER && (err == PAL_ERR_NUMERIC || err == PAL_ERR_FROZEN); turn++) {
        for (int k = 0; k < job->n_load; k++) {
            double *total = job->problem->load_case[k].load[0].total_N;
            pal_scale3(total, 0.5, total);
        }
        err = pal_study_reference(job);
    }
    return err;
}

static pal_err study(pal_study_job *job)
{
    pal_study_entry *entry = calloc(PAL_STUDY_POINTS, sizeof *entry);
    if (!entry) return pal_diagnostic_set(job->diag, PAL_ERR_MEMORY, "no memory for a study");
    const pal_study *before = job->options->before;
    pal_err err = pal_study_reference_size(job);
    int n = err ? 0 : pal_study_list(job, entry);
    /* a continued sweep keeps its reference: with no point left to measure it is made only if that costs nothing */
    bool whole = n > 0 && !job->options->recall;
    const bool part = job->options->own != NULL;
    for (int i = 0; i < n && whole; i++)
        whole = known(before, &entry[i]) || (part && !job->options->own(i, job->options->user));
    whole = whole && before;
    if (!err && n == 0) err = PAL_REFUSE(job->diag, "no method of those asked for fits the body");
    if (whole) {
        pal_study *to = job->out;
        memcpy(to->reference, before->reference, sizeof to->reference);
        to->reference_m = before->reference_m, to->max_m = before->max_m, to->length_scale_m = before->length_scale_m;
        to->max_force_N = before->max_force_N, to->reference_force_N = before->reference_force_N;
    }
    if (!err && !whole) err = choose_probes(job);
    if (!err && !whole) err = job->n_load == 0 ? press(job) : pal_study_reference(job);
    if (!err) err = sweep(job, entry, n);
    if (!err && !whole && !part) err = pal_study_time_repeat(job);
    /* also if no point was left to measure: the interrupted run may have stopped here */
    if (!err && !part) err = pal_study_check_robustness(job);
    pal_study_predict(job->out);
    free(entry);
    return err;
}

/* Every mesh of the study has the same supports. Calibration accepts boxes only. */
static void set_supports(pal_study_job *job)
{
    pal_body_def *body = &job->scene->body[0];
    const pal_surface *s = &body->mesh->surface;
    for (int k = 0; k < body->n_support; k++) {
        pal_support_def box;
        if (!job->adaptive && pal_configuration_support_box(job->scene, 0, k, &box)) body->support[k] = box;
        const pal_support_def *from = &body->support[k];
        pal_problem_support *to = &job->problem->support[job->problem->n_support];
        pal_add3(to->region.low_m, from->low_m, s->origin_m);
        pal_add3(to->region.high_m, from->high_m, s->origin_m);
        job->problem->n_support += !from->rim && !from->lowest;
    }
}

static pal_err begin(pal_study_job *job, const pal_scene *scene, int body)
{
    pal_study *out = job->out;
    const pal_study_options *o = job->options;
    memset(out, 0, sizeof *out);
    out->max_force_N = out->reference_force_N = NAN;
    if (body < 0 || body >= scene->n_body)
        return PAL_REFUSE(job->diag, "body %d: the scene has %d", body, scene->n_body);
    if (!(o->seconds >= 0 && o->seconds <= 60))
        return PAL_REFUSE(job->diag, "seconds: %g is outside [0, 60]", o->seconds);
    job->scene = malloc(sizeof *job->scene);
    job->problem = calloc(1, sizeof *job->problem);
    if (!job->scene || !job->problem) return pal_diagnostic_set(job->diag, PAL_ERR_MEMORY, "no memory for a study");
    *job->scene = *scene;
    job->scene->n_body = 1;
    if (body != 0) job->scene->body[0] = scene->body[body];
    pal_body_def *def = &job->scene->body[0];
    /* the scene's own grid of constants is not part of a configuration */
    def->spring_grid = (pal_spring_grid){.n = {0}};
    job->adaptive = !def->cells && def->mesh->tets.n_node < 1;
    pal_configuration now;
    pal_configuration_of(job->scene, 0, &now);
    job->law = pal_study_is(now.law, "neo_hookean") ? "neo_hookean" : "corotational";
    snprintf(out->name, sizeof out->name, "%.*s", PAL_NAME - 1, scene->name);
    pal_machine_name(out->machine);
    out->step_s = scene->step_s;
    /* one method that suits the body is enough */
    pal_err err = o->n_method > 0 ? PAL_ERR_REFUSED : PAL_ERR_OK;
    for (int i = 0; i < o->n_method && err; i++) err = pal_configuration_check_model(def, o->method[i], job->diag);
    return err;
}

pal_err pal_study_scene(const pal_scene *scene, const pal_study_options *options, pal_study *out, pal_diagnostic *diag)
{
    pal_diagnostic own = {{0}};
    pal_study_job job = {.options = options, .out = out, .diag = diag ? diag : &own};
    pal_err err = begin(&job, scene, options->body);
    if (!err) {
        const pal_material *m = &job.scene->body[0].material;
        job.problem->n_material = 1, job.problem->unit_m = 1;
        job.problem->material[0] = (pal_problem_material){.id = "body",
                                                          .region = {.all = true},
                                                          .young_Pa = m->young_Pa,
                                                          .poisson = m->poisson,
                                                          .density_kg_m3 = m->density_kg_m3};
        for (int c = 0; c < 3; c++)
            job.problem->material[0].region.low_m[c] = -1e9, job.problem->material[0].region.high_m[c] = 1e9;
        set_supports(&job);
        err = study(&job);
    }
    free_job(&job);
    return err;
}

/* the first material is the body's own, all others are regions */
static pal_err set_materials(const pal_problem *p, const double origin[3], pal_body_def *body, pal_diagnostic *diag)
{
    body->material.young_Pa = p->material[0].young_Pa, body->material.poisson = p->material[0].poisson;
    body->material.density_kg_m3 = p->material[0].density_kg_m3;
    for (int k = 1; k < p->n_material; k++) {
        const pal_problem_material *m = &p->material[k];
        pal_region *r = &body->region[body->n_region++];
        *r = (pal_region){
            .kind = PAL_REGION_BOX, .young_Pa = m->young_Pa, .poisson = m->poisson, .density_kg_m3 = m->density_kg_m3};
        pal_sub3(r->low_m, m->region.low_m, origin);
        pal_sub3(r->high_m, m->region.high_m, origin);
    }
    return pal_diagnostic_prefix(diag, pal_material_check(&body->material, diag), "materials[0]");
}

static pal_err fill_scene(const pal_problem *p, const pal_surface *surface, pal_configured_scene *set,
                          pal_diagnostic *diag)
{
    pal_scene *scene = &set->scene;
    double low[3], high[3];
    pal_surface_box(surface, low, high);
    pal_scene_default(scene);
    scene->n_body = 1;
    pal_body_def *body = &scene->body[0];
    pal_body_default(body, "body", &set->mesh);
    snprintf(scene->name, sizeof scene->name, "problem");
    if (p->name[0]) snprintf(scene->title, sizeof scene->title, "%s", p->name);
    pal_entry_init(&body->model, "bodies[0].model", "fem");
    pal_entry_init(&body->solver, "bodies[0].solver", "implicit_euler");
    /* the default effects without gravity */
    memmove(body->effect, body->effect + 1, (size_t)--body->n_effect * sizeof *body->effect);
    PAL_TRY(set_materials(p, surface->origin_m, body, diag));
    body->n_support = p->n_support;
    PAL_TRY(pal_case_supports(p, &set->mesh.tets, body->support, diag));
    double slack = PAL_SUPPORT_MARGIN * pal_dist3(low, high);
    for (int k = 0; k < p->n_support; k++)
        for (int c = 0; c < 3; c++) {
            body->support[k].low_m[c] = p->support[k].region.low_m[c] - surface->origin_m[c] - slack;
            body->support[k].high_m[c] = p->support[k].region.high_m[c] - surface->origin_m[c] + slack;
        }
    pal_tools_default(scene, 3);
    for (int t = 0; t < scene->n_tool; t++) scene->tool[t].radius_m = 0.025 * pal_dist3(low, high);
    return pal_scene_check(scene, diag);
}

pal_err pal_study_problem_scene(const pal_problem *problem, const pal_surface *surface, pal_diagnostic *diag,
                                pal_configured_scene **out)
{
    *out = NULL;
    if (problem->n_support == 0) return PAL_REFUSE(diag, "supports: none, so a live body is held by nothing");
    for (int k = 0; k < problem->n_support; k++)
        if (problem->support[k].moved && pal_norm3(problem->support[k].move_m) > 0)
            return PAL_REFUSE(diag, "supports[%d]: moves, a live body's support stands still", k);
    pal_configured_scene *set = calloc(1, sizeof *set);
    if (!set) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a scene");
    pal_case_voxel_options voxel = {.resolution = SCENE_VOXELS, .fill = true, .align = true};
    pal_err err;
    /* refused: the body is thinner than such voxels */
    for (;; voxel.resolution *= 2) {
        err = pal_case_voxels(problem, surface, &voxel, &set->mesh, diag);
        if (err != PAL_ERR_REFUSED || voxel.resolution >= FINEST_SCENE) break;
    }
    if (!err) err = fill_scene(problem, surface, set, diag);
    if (err)
        pal_configured_scene_free(set);
    else
        *out = set;
    return err;
}

pal_err pal_study_problem(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                          const pal_study_options *options, pal_study *out, pal_diagnostic *diag)
{
    pal_diagnostic own = {{0}};
    pal_study_job job = {.options = options, .out = out, .diag = diag ? diag : &own};
    pal_configured_scene *set = NULL;
    memset(out, 0, sizeof *out);
    if (load_case->n_load == 0) return PAL_REFUSE(diag, "load case \"%s\": has no load", load_case->id);
    PAL_TRY(pal_study_problem_scene(problem, surface, job.diag, &set));
    pal_err err = begin(&job, &set->scene, options->body);
    if (!err) {
        *job.problem = *problem;
        job.problem->load_case[0] = *load_case, job.problem->n_case = 1;
        job.load[0] = &job.problem->load_case[0], job.n_load = 1;
        snprintf(out->name, sizeof out->name, "%.*s", PAL_NAME - 1, problem->name);
        err = study(&job);
    }
    free_job(&job);
    pal_configured_scene_free(set);
    return err;
}
