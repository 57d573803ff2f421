/* Measures bodies of other sizes beside a running one (estimate_hierarchy.h). */
#include "server/estimate/estimate_hierarchy.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/mesh/volume/locate.h"
#include "server/num/shape_functions.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_NODES = 16000, PROBES = 600, MIN_SIZE = 4, MAX_SIZE = 400, MAX_FINER = 4 };
/* MAX_FINER: finest size over this one. reported_apart: smallest ratio to the finest size at which an error can be
 * measured. order: order of the error of closer meshes; it is averaged with what half and this size show
 * (far_order). */
static const double reported_apart = 1.35, order = 2, far_order = 1.75, min_ratio = 0.02, max_times = 20;
/* observed factors of uncertainty: with a finest mesh of observed_finer times the voxels; without a hierarchy */
static const double observed = 2, observed_finer = 2, without = 3;
/* smallest cosine of two loads for which a measurement is reused; wait before the next one, in multiples of its
 * duration */
static const double same_loads = 0.8, waits = 20;
static atomic_flag busy = ATOMIC_FLAG_INIT; /* one hierarchy is measured at a time, over all sessions */

typedef struct sized {
    pal_rest_solution rest;
    int size;
    double *u; /* displacement at the probes [n][3] */
} sized;

typedef struct family {
    const pal_scene *scene;
    const pal_body *body;
    const pal_configuration *setting;
    const pal_estimate_state *state;
    const _Atomic bool *stop;
    const pal_surface *surface;
    bool fits;
    int stride, n_probe; /* every stride-th vertex of the surface is a probe */
    int n_mesh;          /* solved so far */
} family;

/* ---- sizes ---- */

static double nodes_of(const family *f, int size)
{
    pal_configuration s = *f->setting;
    s.size = size;
    return pal_configuration_estimate_nodes(f->scene, 0, &s);
}

/* the finest size available; 0: none fine enough */
static int finest_size(const family *f)
{
    int s = f->setting->size, r = MAX_FINER * s;
    while (r >= reported_apart * s && nodes_of(f, r) > MAX_NODES) r -= f->fits ? s : 1;
    return r >= reported_apart * s && r <= MAX_SIZE && nodes_of(f, r) > 0 ? r : 0;
}

/* ---- equilibria ---- */

static bool probe(const family *f, sized *m)
{
    const pal_body *own = pal_world_view_body(m->rest.world, 0);
    const pal_prepared *mesh = m->rest.scene->body[0].mesh;
    pal_locate *locate = NULL;
    m->u = calloc(3 * (size_t)f->n_probe, sizeof *m->u);
    if (!m->u || pal_locate_create(&mesh->tets, own->n_corner == PAL_HEX_CORNERS ? &mesh->hexes : NULL, &locate))
        return false;
    for (int i = 0; i < f->n_probe; i++) {
        double local[4], shape[PAL_TET10_CORNERS];
        int e = pal_locate_point(locate, f->surface->x + 3 * (size_t)(i * f->stride), local, NULL);
        const int32_t *node = own->element + (size_t)own->n_corner * (size_t)e;
        pal_element_shape_functions(own, local, shape);
        for (int k = 0; k < own->n_corner; k++) {
            pal_axpy3(m->u + 3 * i, shape[k], own->d + 3 * (size_t)node[k]);
            pal_axpy3(m->u + 3 * i, -shape[k], own->node_rest + 3 * (size_t)node[k]);
        }
    }
    pal_locate_destroy(locate);
    return true;
}

static bool stopped(const family *f)
{
    return f->stop && atomic_load_explicit(f->stop, memory_order_acquire);
}

/* size 0: merged voxels; the configuration's size: the body's own mesh */
static bool solve(family *f, int size, sized *m)
{
    if (stopped(f)) return false;
    f->n_mesh++;
    pal_err err = size == 0 ? pal_rest_solution_coarser(f->scene, f->body, NULL, "linear", NULL, &m->rest)
                  : size == f->setting->size
                      ? pal_rest_solution_make(f->scene, f->body, NULL, "linear", NULL, &m->rest)
                      : pal_rest_solution_sized(f->scene, f->body, f->setting, size, "linear", &m->rest);
    m->size = size;
    return !err && pal_rest_solution_find(&m->rest, f->state, f->body, NULL, f->stop) && probe(f, m);
}

static void sized_free(sized *m)
{
    pal_rest_solution_free(&m->rest);
    free(m->u);
    memset(m, 0, sizeof *m);
}

static double between(const family *f, const sized *a, const sized *b)
{
    double max = 0;
    for (int i = 0; i < f->n_probe; i++) max = fmax(max, pal_dist3(a->u + 3 * i, b->u + 3 * i));
    return max;
}

/* error of the finest mesh relative to that of a mesh of `size` */
static double share_of(int size, int finest)
{
    return pow((double)size / finest, order);
}

/* The distance of two meshes is the difference of errors of equal sign. Random errors (which voxels are cut, and
 * how) add in squares. Divides by the geometric mean of the two rules. */
static double left(const family *f, const sized *m, const sized *finest)
{
    const double share = share_of(m->size, finest->size);
    return between(f, m, finest) / sqrt((1 - share) * sqrt(1 + share * share));
}

/* NaN: no such mesh, or too close to the finest */
static double left_in(family *f, int size, const sized *finest)
{
    sized m = {.u = NULL};
    double error = NAN;
    if (size >= MIN_SIZE && finest->size >= reported_apart * size && solve(f, size, &m)) error = left(f, &m, finest);
    sized_free(&m);
    return error;
}

/* either rule over their geometric mean */
static double ambiguity(double finer)
{
    const double share = pow(finer, -order);
    return sqrt(sqrt(1 + share * share) / (1 - share));
}

/* change from merged voxels to this mesh */
static double change(family *f, const sized *own, bool shown)
{
    sized merged = {.u = NULL};
    double max = 0;
    const bool good = solve(f, 0, &merged);
    if (good && shown) max = between(f, own, &merged);
    if (good && !shown)
        for (int k = 0; k < merged.rest.n_common; k++) {
            size_t i = 3 * (size_t)merged.rest.common[k];
            max = fmax(max, pal_dist3(own->rest.x + i, merged.rest.x + i));
        }
    sized_free(&merged);
    return max;
}

static void measure(family *f, bool shown, pal_estimate_hierarchy *out)
{
    sized finest = {.u = NULL}, own = {.u = NULL};
    const int size = f->setting->size, r = finest_size(f);
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
        out->times = fmin(fmax(error / last, 1 / max_times), max_times);
        out->uncertainty_factor = observed * fmax(1, ambiguity(finer) / ambiguity(observed_finer));
        if (out->times != error / last) out->uncertainty_factor = INFINITY;
        out->half = left_in(f, size / 2, &finest) / error;
        out->twice = left_in(f, 2 * size, &finest) / error;
        double seen = out->half > 0 ? 0.5 * (far_order + log2(out->half)) : far_order;
        out->twice = isnan(out->twice) ? exp2(-fmin(seen, order)) : fmax(out->twice, min_ratio);
        out->finest = r, out->known = !stopped(f);
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

static double cosine(const double *a, const double *b, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* Does the earlier measurement apply to these loads and this material? A uniform Young's modulus cancels. */
static bool is_same(const family *f, const pal_estimate_hierarchy *of, const double *loads)
{
    const pal_material *now = &f->state->material;
    const bool regions = f->scene->body[0].n_region > 0;
    return of->loads && cosine(loads, of->loads, 3 * f->state->n_node) > same_loads &&
           now->poisson == of->material.poisson && (!regions || now->young_Pa == of->material.young_Pa);
}

bool pal_estimate_hierarchy_refresh(const pal_scene *scene, const pal_body *body, const pal_configuration *setting,
                                    const pal_estimate_state *state, bool shown, bool fits, const _Atomic bool *stop,
                                    pal_estimate_hierarchy *out)
{
    const pal_surface *surface = &scene->body[0].mesh->surface;
    family f = {scene, body, setting, state, stop, surface, fits, 1 + surface->n_vertex / PROBES, 0, 0};
    double began = pal_clock_s();
    f.n_probe = surface->n_vertex / f.stride;
    if (setting->size < MIN_SIZE || f.n_probe < 1 || scene->body[0].cells) return false;
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
    out->next_s = end + waits * (end - began);
    return out->known;
}

void pal_estimate_hierarchy_describe(const pal_estimate_hierarchy *f, bool fresh, char *text, size_t n_byte)
{
    const double uncertainty_factor = !f->known ? without
                                      : fresh   ? f->uncertainty_factor
                                                : fmax(f->uncertainty_factor, without);
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
