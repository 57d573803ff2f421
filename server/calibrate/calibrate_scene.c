/* Writes calibrated constants to the scene for serve. */
#include "server/calibrate/calibrate_run.h"

#include "server/base/vec3.h"
#include "server/scene/scene_import.h"
#include "server/sim/world/world.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_SUBSTEP = 1000000, N_TOOL = 3 };

const char *pal_calibrate_method(const pal_calibrate_run *run)
{
    return run->annealing ? "annealing" : "adjoint";
}

const char *pal_calibrate_key(const pal_calibrate_run *run, int k, bool brief)
{
    static const char *const name[PAL_SPRING_KINDS][2] = {
        {"k_distance_J", "k_d"}, {"k_area_J", "k_a"}, {"k_volume_J", "k_v"}};
    return name[run->info.kind[k]][brief];
}

double pal_calibrate_mean(const pal_calibrate_run *run, const pal_calibration_value *value, bool fit)
{
    double sum = 0;
    int n = 0;
    for (int k = 0; k < run->set.n; k++) {
        if (run->set.list[k].fit != fit) continue;
        if (!(value->case_percent[k] < DBL_MAX)) return DBL_MAX;
        sum += value->case_percent[k];
        n++;
    }
    return n > 0 ? sum / n : NAN;
}

/* "/a/Gear 2.json" and "/a/Gear 2/scene.json" -> "gear_2": a valid name for a scene and its mesh */
static void name_of(const char *path, char out[PAL_NAME])
{
    char text[PAL_CALIBRATE_PATH];
    snprintf(text, sizeof text, "%s", path);
    char *slash = strrchr(text, '/'), *stem = slash ? slash + 1 : text;
    if (slash && !strcmp(stem, "scene.json")) {
        *slash = 0;
        char *folder = strrchr(text, '/');
        stem = folder ? folder + 1 : text;
    } else if (strrchr(stem, '.'))
        *strrchr(stem, '.') = 0;
    pal_scene_plain_name(stem, "calibrated", out);
}

/* constants at all nodes of the grid; nodes outside the body take the mean of the others */
static pal_err put_grid(const pal_calibrate_run *run, pal_loaded_scene *scene, pal_diagnostic *diag)
{
    const pal_grid *from = run->info.grid;
    const pal_grid_weights *w = run->info.weights;
    pal_spring_grid *to = &scene->scene.body[0].spring_grid;
    size_t n = (size_t)from->n[0] * (size_t)from->n[1] * (size_t)from->n[2];
    double *value = malloc(n * (size_t)run->info.n_kind * sizeof *value);
    if (!value) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the grid");
    scene->spring_grid[0] = value;
    for (int c = 0; c < 3; c++) to->n[c] = from->n[c], to->low_m[c] = from->low[c], to->high_m[c] = from->high[c];
    for (int k = 0; k < run->info.n_kind; k++, value += n) {
        const double *theta = run->theta + (size_t)k * (size_t)w->n_used;
        double mean = 0;
        for (int i = 0; i < w->n_used; i++) mean += theta[i] / w->n_used;
        for (size_t i = 0; i < n; i++) value[i] = exp(mean);
        for (int i = 0; i < w->n_used; i++) value[w->used[i]] = exp(theta[i]);
        to->k_J[run->info.kind[k]] = value;
    }
    return PAL_ERR_OK;
}

static pal_err put_model(const pal_calibrate_run *run, pal_loaded_scene *scene, pal_diagnostic *diag)
{
    pal_config_entry *model = &scene->scene.body[0].model;
    pal_entry_init(model, "bodies[0].model", "tet_springs");
    PAL_TRY(pal_entry_put_text(model, "weights", run->options.equal ? "equal" : "volume", diag));
    if (run->info.grid) PAL_TRY(put_grid(run, scene, diag));
    for (int k = 0; k < run->info.n_kind && !run->info.grid; k++)
        PAL_TRY(pal_entry_put_number(model, pal_calibrate_key(run, k, false), exp(run->theta[k]), diag));
    return run->options.without_area ? pal_entry_put_number(model, "k_area_J", 0, diag) : PAL_ERR_OK;
}

/* tools as strong as the fitted loads, so that a user can reproduce them */
static void put_tools(const pal_calibrate_run *run, pal_scene *scene)
{
    double max = 0;
    for (int k = 0; k < run->set.n; k++) {
        const double *f = run->info.force_N[k];
        double sum = 0;
        for (int i = 0; i < run->info.n_node && run->set.list[k].fit; i++) sum += pal_norm3(f + 3 * i);
        max = fmax(max, sum);
    }
    double unit = pow(10, floor(log10(max)) - 1), cap = unit * ceil(max / unit - 1e-9);
    pal_tools_default(scene, N_TOOL);
    for (int k = 0; k < N_TOOL; k++) scene->tool[k].force_cap_N = fmin(fmax(cap, 1e-3), 1000);
}

/* stiff constants may need more sub-steps than the default limit */
static pal_err allow_substeps(pal_scene *scene, int *n_substep, pal_diagnostic *diag)
{
    pal_world *world = NULL;
    pal_err err = pal_world_create(scene, diag, &world);
    while (err == PAL_ERR_BUDGET && scene->max_substep < MAX_SUBSTEP) {
        scene->max_substep = 2 * scene->max_substep < MAX_SUBSTEP ? 2 * scene->max_substep : MAX_SUBSTEP;
        err = pal_world_create(scene, diag, &world);
    }
    if (!err) *n_substep = pal_world_substeps(world);
    pal_world_destroy(world);
    return err;
}

static pal_err fill(pal_calibrate_run *run, pal_loaded_scene *loaded, pal_diagnostic *diag)
{
    pal_scene *scene = &loaded->scene;
    pal_body_def *body = &scene->body[0];
    char name[PAL_NAME], source[sizeof scene->source], list[160] = "";
    size_t n = 0;
    pal_scene_default(scene);
    name_of(run->path[PAL_CALIBRATE_SCENE], name);
    scene->n_body = 1;
    pal_body_default(body, name, run->info.mesh);
    /* for information, contact and mass */
    body->material.young_Pa = run->info.mean_young_Pa, body->material.poisson = run->info.mean_poisson;
    body->material.density_kg_m3 = run->info.mean_density_kg_m3;
    body->n_support = run->info.n_support;
    memcpy(body->support, run->info.support, (size_t)body->n_support * sizeof *body->support);
    /* the default effects without gravity */
    memmove(body->effect, body->effect + 1, (size_t)--body->n_effect * sizeof *body->effect);
    for (int k = 0; k < run->set.n; k++)
        if (run->set.list[k].fit && n < sizeof list)
            n += (size_t)snprintf(list + n, sizeof list - n, "%s%s", n ? ", " : "", run->set.id[k]);
    snprintf(source, sizeof source, "springs calibrated on %s (%s)", list, pal_calibrate_method(run));
    put_tools(run, scene);
    PAL_TRY(pal_scene_rename(loaded, name, run->set.problem->name, source, diag));
    PAL_TRY(put_model(run, loaded, diag));
    return allow_substeps(scene, &run->n_substep, diag);
}

pal_err pal_calibrate_scene(pal_calibrate_run *run, pal_loaded_scene **out, pal_diagnostic *diag)
{
    pal_loaded_scene *loaded = calloc(1, sizeof *loaded);
    if (!loaded) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a scene");
    pal_err err = fill(run, loaded, diag);
    if (err)
        pal_scene_free(loaded);
    else
        *out = loaded;
    return pal_diagnostic_prefix(diag, err, run->path[PAL_CALIBRATE_SCENE]);
}

/* Appends "0.52 % RMS of finite elements (twist)". False: no room. */
static bool add_accuracy(const pal_calibrate_run *run, int index, char *out, size_t n_byte)
{
    size_t at = strlen(out);
    char of[PAL_NAME + 32];
    const pal_calibrate_case *c = &run->set.list[index];
    double e = run->last.case_percent[index];
    snprintf(of, sizeof of, " RMS of %s", c->truth_name ? c->truth_name : "finite elements");
    bool first = at == 0, named = c->truth_name != NULL;
    int n = e < DBL_MAX ? snprintf(out + at, n_byte - at, "%s%.2g %%%s (%s%s)", first ? "" : ", ", e,
                                   first || named ? of : "", run->set.id[index], c->fit ? "" : ", not fitted")
                        : snprintf(out + at, n_byte - at, "%sno rest (%s)", first ? "" : ", ", run->set.id[index]);
    return n >= 0 && at + (size_t)n < n_byte;
}

void pal_calibrate_accuracy(const pal_calibrate_run *run, char *out, size_t n_byte)
{
    bool room = true;
    int n_fit = 0;
    out[0] = 0;
    /* fitted ones first */
    for (int turn = 0; turn < 2; turn++)
        for (int k = 0; k < run->set.n; k++)
            if (run->set.list[k].fit == (turn == 0)) room = room && add_accuracy(run, k, out, n_byte);
    if (room) return;
    for (int k = 0; k < run->set.n; k++) n_fit += run->set.list[k].fit;
    double fit = pal_calibrate_mean(run, &run->last, true), other = pal_calibrate_mean(run, &run->last, false);
    int n = snprintf(out, n_byte, "%.2g %% RMS (mean of %d cases)", fit, n_fit);
    if (other < DBL_MAX && n > 0 && (size_t)n < n_byte)
        snprintf(out + n, n_byte - (size_t)n, ", %.2g %% (%d not fitted)", other, run->set.n - n_fit);
}
