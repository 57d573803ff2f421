/* Finds the damping with which calibrated springs return as a recorded body did. */
#include "server/calibrate/release.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/calibrate/tuning.h"
#include "server/mesh/volume/locate.h"
#include "server/num/shape_functions.h"
#include "server/solve/load_case.h"

#include <float.h>
#include <math.h>

typedef struct job {
    const pal_scene *scene;
    const pal_recorded_release *release;
    const pal_settle_options *options;
    pal_world *world;
    pal_body *body;
    int32_t (*node)[PAL_TET_CORNERS]; /* of the tetrahedron around each point, [n_x] */
    double (*weight)[PAL_TET_CORNERS];
    double *force_N;           /* scratch [n_node][3]            */
    double *decay, *own_decay; /* recorded; scratch [release->n] */
    double work;
    int n_planned;
    pal_release_report *out;
    pal_diagnostic *diag;
} job;

static pal_err locate_points(job *j)
{
    const pal_recorded_release *r = j->release;
    const pal_tets *t = j->body->tets;
    pal_err err = PAL_ERR_OK;
    pal_locate *locate = NULL;
    PAL_ARRAY(&err, j->node, r->n_x);
    PAL_ARRAY(&err, j->weight, r->n_x);
    PAL_ARRAY(&err, j->force_N, 3 * j->body->n_node);
    PAL_ARRAY(&err, j->decay, r->n);
    PAL_ARRAY(&err, j->own_decay, r->n);
    if (!err) err = pal_locate_create(t, NULL, &locate);
    for (int i = 0; i < r->n_x && !err; i++) {
        double x[3], local[4];
        pal_sub3(x, r->x + 3 * i, t->origin_m);
        int tet = pal_locate_point(locate, x, local, NULL);
        pal_case_clamp(PAL_TET_CORNERS, local);
        memcpy(j->node[i], t->tet + PAL_TET_CORNERS * tet, sizeof j->node[i]);
        memcpy(j->weight[i], local, sizeof j->weight[i]);
    }
    pal_locate_destroy(locate);
    return err ? pal_diagnostic_set(j->diag, err, "no memory for a release") : PAL_ERR_OK;
}

/* forces of a step of the touch; beyond its last one none */
static pal_err set_forces(job *j, int step)
{
    const pal_recorded_release *r = j->release;
    const int n = j->body->n_node;
    memset(j->force_N, 0, 3 * (size_t)n * sizeof(double));
    for (int k = step < r->n_step ? r->first[step] : 0; step < r->n_step && k < r->first[step + 1]; k++)
        for (int c = 0; c < PAL_TET_CORNERS; c++)
            pal_axpy3(j->force_N + 3 * j->node[r->point[k]][c], j->weight[r->point[k]][c], r->force_N + 3 * (size_t)k);
    for (int i = 0; i < n; i++) {
        const double *has = j->body->external_force ? j->body->external_force + 3 * i : NULL, *f = j->force_N + 3 * i;
        if (has ? has[0] == f[0] && has[1] == f[1] && has[2] == f[2] : pal_norm3(f) == 0) continue;
        pal_err err = pal_world_load(j->world, 0, i, f);
        if (err) return pal_diagnostic_set(j->diag, err, "no memory for the loads of a release");
    }
    return PAL_ERR_OK;
}

/* rms displacement u [n] -> decay curve, in place */
static void find_decay(double *u, int n)
{
    double sum = 0;
    for (int k = n - 1; k >= 0; k--) u[k] = sum += u[k] * u[k];
    for (int k = 0; k < n; k++) u[k] = sum > 0 ? sqrt(u[k] / sum) : 0;
}

static double rms_of(const pal_body *b)
{
    double sum = 0, mass = 0, u[3];
    for (int i = 0; i < b->n_node; i++) {
        pal_sub3(u, b->d + 3 * i, b->node_rest + 3 * i);
        sum += b->node_mass_kg[i] * pal_dot3(u, u);
        mass += b->node_mass_kg[i];
    }
    return sqrt(sum / mass);
}

/* e at a rate; DBL_MAX: the body froze or its steps were refused */
static pal_err evaluate(job *j, double rate_1_s, double *percent)
{
    const pal_recorded_release *r = j->release;
    pal_material material = j->scene->body[0].material;
    material.damping_1_s = rate_1_s;
    PAL_TRY(pal_world_material(j->world, 0, &material, j->diag));
    pal_world_reset(j->world);
    double sum = 0;
    *percent = DBL_MAX;
    for (int step = 0; step < r->n_step + r->n; step++) {
        double done = (j->out->n_run + (double)step / (r->n_step + r->n)) / j->n_planned;
        if (j->options->progress && !j->options->progress("damping of a release", fmin(done, 1), j->options->user))
            return pal_diagnostic_set(j->diag, PAL_ERR_STATE, "stopped while the damping was fitted");
        PAL_TRY(set_forces(j, step));
        if (pal_world_step(j->world, r->step_s) || j->body->frozen) return PAL_ERR_OK;
        j->work -= (double)pal_world_substeps(j->world) * j->body->tets->n_tet;
        if (step >= r->n_step) j->own_decay[step - r->n_step] = rms_of(j->body);
    }
    find_decay(j->own_decay, r->n);
    for (int k = 0; k < r->n; k++) sum += pow(j->own_decay[k] - j->decay[k], 2);
    j->out->n_run++;
    *percent = 100 * sqrt(sum / r->n);
    return PAL_ERR_OK;
}

static void keep(job *j, double log_rate, double percent)
{
    if (!(percent < j->out->percent)) return;
    j->out->percent = percent;
    j->out->damping_1_s = exp(log_rate);
}

static pal_err narrow(job *j, double low, double high)
{
    const double golden = (sqrt(5) - 1) / 2;
    double x[2] = {high - golden * (high - low), low + golden * (high - low)}, e[2];
    for (int k = 0; k < 2; k++) {
        PAL_TRY(evaluate(j, exp(x[k]), &e[k]));
        keep(j, x[k], e[k]);
    }
    while (high - low > PAL_RELEASE_WIDTH && j->work > 0) {
        int better = e[1] < e[0], other = !better;
        if (better)
            low = x[0];
        else
            high = x[1];
        x[other] = x[better], e[other] = e[better];
        x[better] = better ? low + golden * (high - low) : high - golden * (high - low);
        PAL_TRY(evaluate(j, exp(x[better]), &e[better]));
        keep(j, x[better], e[better]);
    }
    return PAL_ERR_OK;
}

static pal_err fit(job *j)
{
    const double low = log(PAL_RELEASE_LOW_1_S), width = (log(PAL_RELEASE_HIGH_1_S) - low) / (PAL_RELEASE_RATES - 1),
                 own_1_s = j->scene->body[0].material.damping_1_s;
    int best = -1, n = 0;
    double e;
    j->n_planned = PAL_RELEASE_RATES + 2 + (int)ceil(log(2 * width / PAL_RELEASE_WIDTH) / log((1 + sqrt(5)) / 2));
    if (own_1_s > 0) PAL_TRY(evaluate(j, own_1_s, &j->out->start_percent));
    for (; n < PAL_RELEASE_RATES && j->work > 0; n++) {
        double before = j->out->percent;
        PAL_TRY(evaluate(j, exp(low + n * width), &e));
        keep(j, low + n * width, e);
        if (j->out->percent < before) best = n;
    }
    if (best < 0 || n < PAL_RELEASE_RATES) return PAL_ERR_OK;
    PAL_TRY(narrow(j, low + fmax(best - 1, 0) * width, low + fmin(best + 1, PAL_RELEASE_RATES - 1) * width));
    j->out->fitted = j->out->percent < PAL_RELEASE_PERCENT;
    return PAL_ERR_OK;
}

pal_err pal_release_damping(const pal_scene *scene, const pal_recorded_release *release,
                            const pal_settle_options *options, pal_release_report *out, pal_diagnostic *diag)
{
    job j = {
        .scene = scene, .release = release, .options = options, .work = options->max_work, .out = out, .diag = diag};
    *out = (pal_release_report){
        .percent = DBL_MAX, .damping_1_s = NAN, .start_percent = NAN, .seconds = release->n * release->step_s};
    PAL_TRY(pal_settle_world(scene, PAL_RELEASE_LOW_1_S, &j.world, diag));
    j.body = pal_world_body(j.world, 0);
    j.body->load_cap_N = INFINITY;
    pal_err err = locate_points(&j);
    if (!err) memcpy(j.decay, release->rms_m, (size_t)release->n * sizeof(double));
    if (!err) find_decay(j.decay, release->n);
    if (!err) err = fit(&j);
    PAL_FREE(j.node, j.weight, j.force_N, j.decay, j.own_decay);
    pal_world_destroy(j.world);
    return err;
}
