/* Measures bodies of other sizes beside a running one (estimate_hierarchy.h). */
#include "server/estimate/estimate_hierarchy.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/estimate/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_NODES = 16000, PROBES = 600, MIN_SIZE = 4, MAX_SIZE = 400, MAX_FINER = 4 };
static atomic_flag busy = ATOMIC_FLAG_INIT; /* one hierarchy is measured at a time, over all sessions */

typedef struct sized {
    pal_rest_solution rest;
    int size;
    double *u; /* displacement at the probes [n][3] */
} sized;

typedef struct family {
    const pal_scene *scene;
    const pal_body *body;
    const pal_configuration *configuration;
    const pal_estimate_state *state;
    const _Atomic bool *stop;
    const pal_surface *surface;
    bool fits;
    int stride, n_probe; /* every stride-th vertex of the surface is a probe */
    int n_mesh;          /* solved so far */
} family;

static double nodes_of(const family *f, int size)
{
    pal_configuration s = *f->configuration;
    s.size = size;
    return pal_configuration_estimate_nodes(f->scene, 0, &s);
}

/* the finest size available; 0: none fine enough */
static int finest_size(const family *f)
{
    int s = f->configuration->size, r = MAX_FINER * s;
    while (r >= PAL_MIN_APART * s && nodes_of(f, r) > MAX_NODES) r -= f->fits ? s : 1;
    return r >= PAL_MIN_APART * s && r <= MAX_SIZE && nodes_of(f, r) > 0 ? r : 0;
}

static bool probe(const family *f, sized *m)
{
    pal_interpolation by = {.n_row = 0};
    m->u = calloc(3 * (size_t)f->n_probe, sizeof *m->u);
    if (!m->u || pal_rest_solution_interpolation(&m->rest, f->surface->x, f->n_probe, f->stride, false, &by))
        return false;
    pal_rest_solution_displacement(&m->rest, &by, m->u);
    pal_interpolation_free(&by);
    return true;
}

/* size 0: merged voxels; the configuration's size: the body's own mesh */
static bool solve(family *f, int size, sized *m)
{
    if (pal_estimate_stopped(f->stop)) return false;
    f->n_mesh++;
    pal_err err = size == 0 ? pal_rest_solution_coarser(f->scene, f->body, NULL, "linear", NULL, &m->rest)
                  : size == f->configuration->size
                      ? pal_rest_solution_make(f->scene, f->body, NULL, "linear", NULL, &m->rest)
                      : pal_rest_solution_sized(f->scene, f->body, f->configuration, size, "linear", &m->rest);
    m->size = size;
    return !err && pal_rest_solution_find(&m->rest, f->state, f->body, NULL, f->stop) && probe(f, m);
}

static void sized_free(sized *m)
{
    pal_rest_solution_free(&m->rest);
    free(m->u);
    memset(m, 0, sizeof *m);
}

/* error of the finest mesh relative to that of a mesh of `size` */
static double share_of(int size, int finest)
{
    return pow((double)size / finest, PAL_HIERARCHY_ORDER);
}

/* The distance of two meshes is the difference of errors of equal sign. Random errors (which voxels are cut, and
 * how) add in squares. Divides by the geometric mean of the two rules. */
static double left(const family *f, const sized *m, const sized *finest)
{
    const double share = share_of(m->size, finest->size);
    return pal_max_dist3(m->u, finest->u, f->n_probe) / sqrt((1 - share) * sqrt(1 + share * share));
}

/* NaN: no such mesh, or too close to the finest */
static double left_in(family *f, int size, const sized *finest)
{
    sized m = {.u = NULL};
    double error = NAN;
    if (size >= MIN_SIZE && finest->size >= PAL_MIN_APART * size && solve(f, size, &m)) error = left(f, &m, finest);
    sized_free(&m);
    return error;
}

/* either rule over their geometric mean */
static double ambiguity(double finer)
{
    const double share = pow(finer, -PAL_HIERARCHY_ORDER);
    return sqrt(sqrt(1 + share * share) / (1 - share));
}

/* change from merged voxels to this mesh */
static double change(family *f, const sized *own, bool shown)
{
    sized merged = {.u = NULL};
    double max = 0;
    const bool good = solve(f, 0, &merged);
    if (good && shown) max = pal_max_dist3(own->u, merged.u, f->n_probe);
    if (good && !shown) max = pal_rest_solution_change(&own->rest, &merged.rest);
    sized_free(&merged);
    return max;
}

static void measure(family *f, bool shown, pal_estimate_hierarchy *out)
{
    sized finest = {.u = NULL}, own = {.u = NULL};
    const int size = f->configuration->size, r = finest_size(f);
    double error = 0, last = 0;
    out->known = false;
    if (r > 0 && solve(f, r, &finest)) {
        /* frees the largest allocation; only its displacements at the probes are needed */
        pal_rest_solution_free(&finest.rest);
        if (solve(f, size, &own)) error = left(f, &own, &finest), last = change(f, &own, shown);
    }
    sized_free(&own);
    if (error > 0 && last > 0) {
        const double finer = (double)r / size;
        out->times = fmin(fmax(error / last, 1 / PAL_MAX_ERROR_CHANGE), PAL_MAX_ERROR_CHANGE);
        out->uncertainty_factor = PAL_OBSERVED_FACTOR * fmax(1, ambiguity(finer) / ambiguity(PAL_OBSERVED_FINER));
        if (out->times != error / last) out->uncertainty_factor = INFINITY;
        out->half = left_in(f, size / 2, &finest) / error;
        out->twice = left_in(f, 2 * size, &finest) / error;
        double seen = out->half > 0 ? 0.5 * (PAL_FAR_ORDER + log2(out->half)) : PAL_FAR_ORDER;
        out->twice = isnan(out->twice) ? exp2(-fmin(seen, PAL_HIERARCHY_ORDER)) : fmax(out->twice, PAL_MIN_TWICE);
        out->finest = r, out->known = !pal_estimate_stopped(f->stop);
    }
    out->n_measured++;
    out->n_mesh += f->n_mesh;
    sized_free(&finest);
}

/* the loads of the state at free nodes, scaled to length 1 */
static bool take_loads(const pal_body *body, const pal_estimate_state *state, double *out)
{
    double sum = 0;
    for (int i = 0; i < 3 * state->n_node; i++) {
        out[i] = body->support[i / 3] ? 0 : state->borne[i];
        sum += out[i] * out[i];
    }
    for (int i = 0; i < 3 * state->n_node && sum > 0; i++) out[i] /= sqrt(sum);
    return sum > 0;
}

/* Does the earlier measurement apply to these loads and this material? A uniform Young's modulus cancels. */
static bool is_same(const family *f, const pal_estimate_hierarchy *of, const double *loads)
{
    const pal_material *now = &f->state->material;
    const bool regions = f->scene->body[0].n_region > 0;
    double cosine = 0;
    for (int i = 0; i < 3 * f->state->n_node && of->loads; i++) cosine += loads[i] * of->loads[i];
    return cosine > PAL_SAME_LOADS && now->poisson == of->material.poisson &&
           (!regions || now->young_Pa == of->material.young_Pa);
}

bool pal_estimate_hierarchy_refresh(const pal_scene *scene, const pal_body *body,
                                    const pal_configuration *configuration, const pal_estimate_state *state, bool shown,
                                    bool fits, const _Atomic bool *stop, pal_estimate_hierarchy *out)
{
    const pal_surface *surface = &scene->body[0].mesh->surface;
    family f = {scene, body, configuration, state, stop, surface, fits, 1 + surface->n_vertex / PROBES, 0, 0};
    double began = pal_clock_s();
    f.n_probe = surface->n_vertex / f.stride;
    if (configuration->size < MIN_SIZE || f.n_probe < 1 || scene->body[0].cells) return false;
    double *now = malloc(3 * sizeof *now * (size_t)state->n_node);
    const bool loaded = now && take_loads(body, state, now), same = loaded && is_same(&f, out, now);
    if (!loaded || same || began < out->next_s) {
        free(now);
        return out->known && same;
    }
    /* estimators of other bodies measure one after the other */
    if (atomic_flag_test_and_set_explicit(&busy, memory_order_acquire)) {
        out->next_s = began + 1;
        free(now);
        return false;
    }
    free(out->loads);
    out->loads = now;
    out->material = state->material;
    measure(&f, shown, out);
    atomic_flag_clear_explicit(&busy, memory_order_release);
    double end = pal_clock_s();
    out->next_s = end + PAL_WAIT_SHARE * (end - began);
    return out->known;
}

void pal_estimate_hierarchy_describe(const pal_estimate_hierarchy *f, bool fresh, char *text, size_t n_byte)
{
    const double uncertainty_factor = !f->known ? PAL_UNKNOWN_FACTOR
                                      : fresh   ? f->uncertainty_factor
                                                : fmax(f->uncertainty_factor, PAL_UNKNOWN_FACTOR);
    if (isfinite(uncertainty_factor))
        snprintf(text, n_byte, "many voxels are cut: good to a factor of %.2g", uncertainty_factor);
    else
        snprintf(text, n_byte, "many voxels are cut: no factor is known that it is good to");
}

void pal_estimate_hierarchy_free(pal_estimate_hierarchy *of)
{
    free(of->loads);
    of->loads = NULL;
}
