/* Watches a replayed body: its touches, the stillest moment of each, and how it moves after the last force. */
#include "server/calibrate/recorded_loads.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/calibrate/tuning.h"

#include <math.h>
#include <stdio.h>

typedef enum phase { IDLE, TOUCHED, AFTER } phase;

struct pal_load_recorder {
    const pal_scene *scene;
    pal_recorded_loads out; /* load: in any order */
    pal_err err;
    bool edited; /* the material changed between touches */
    double time_s, max_N;
    uint64_t tick;
    int n_node;
    double *mass_kg, *rest; /* frame of the file [n_node][3]    */
    /* the touch */
    phase phase;
    bool begun;                              /* there was one                       */
    double *before;                          /* positions before the first one [n_node][3] */
    double *mean_N, mean_v2;                 /* means of forces [n_node][3] and of the squared speed, times weight */
    double weight, max_u, largest_u, held_u; /* of the touch, of all, in `held`: rms displacement */
    bool grasped;
    pal_recorded_load held;   /* its stillest moment so far, at all nodes */
    pal_recorded_release now; /* its forces; x as numbers of nodes, in `seen` */
    int n_force, released;    /* forces so far; steps before the last force ended */
};

pal_err pal_load_recorder_create(const pal_scene *scene, int body, pal_load_recorder **out)
{
    *out = calloc(1, sizeof **out);
    if (!*out) return PAL_ERR_MEMORY;
    (*out)->scene = scene;
    (*out)->out.body = body;
    return PAL_ERR_OK;
}

static void free_load(pal_recorded_load *load)
{
    PAL_FREE(load->x, load->force_N, load->node_x, load->u);
    *load = (pal_recorded_load){0};
}

static void free_release(pal_recorded_release *r)
{
    PAL_FREE(r->x, r->first, r->point, r->force_N, r->rms_m);
    *r = (pal_recorded_release){0};
}

void pal_recorded_loads_free(pal_recorded_loads *loads)
{
    for (int k = 0; k < loads->n; k++) free_load(&loads->load[k]);
    free_release(&loads->release);
    *loads = (pal_recorded_loads){0};
}

void pal_recorded_loads_scale(pal_recorded_loads *loads, double factor)
{
    for (int k = 0; k < loads->n; k++) {
        pal_recorded_load *load = &loads->load[k];
        for (int i = 0; i < 3 * load->n_point; i++) load->force_N[i] *= factor;
        pal_scale3(load->total_N, factor, load->total_N);
        load->size_N *= factor;
    }
}

void pal_load_recorder_destroy(pal_load_recorder *r)
{
    if (!r) return;
    pal_recorded_loads_free(&r->out);
    free_load(&r->held);
    free_release(&r->now);
    PAL_FREE(r->mass_kg, r->rest, r->before, r->mean_N, r);
}

double pal_load_recorder_max_N(const pal_load_recorder *recorder)
{
    return recorder->max_N;
}

static void allocate(pal_load_recorder *r, const pal_body *body)
{
    const double *origin = r->scene->body[r->out.body].mesh->surface.origin_m;
    int n = r->n_node = body->n_node;
    PAL_ARRAY(&r->err, r->mass_kg, n);
    PAL_ARRAY(&r->err, r->rest, 3 * n);
    PAL_ARRAY(&r->err, r->before, 3 * n);
    PAL_ARRAY(&r->err, r->mean_N, 3 * n);
    PAL_ARRAY(&r->err, r->held.force_N, 3 * n);
    PAL_ARRAY(&r->err, r->held.u, 3 * n);
    if (r->err) return;
    memcpy(r->mass_kg, body->node_mass_kg, (size_t)n * sizeof(double));
    memcpy(r->before, body->node_rest, 3 * (size_t)n * sizeof(double));
    for (int i = 0; i < n; i++) pal_add3(r->rest + 3 * i, body->node_rest + 3 * i, origin);
}

/* sum m |a|^2, or sum m |a - b|^2, over the mass */
static double mean_square(const pal_load_recorder *r, const double *a, const double *b)
{
    double sum = 0, mass = 0, d[3];
    for (int i = 0; i < r->n_node; i++) {
        pal_copy3(d, a + 3 * i);
        if (b) pal_axpy3(d, -1, b + 3 * i);
        sum += r->mass_kg[i] * pal_dot3(d, d);
        mass += r->mass_kg[i];
    }
    return mass > 0 ? sum / mass : 0;
}

/* ---- forces of the touch ---- */

/* Factor of body->load that gives the forces of the step. An implicit solver leaves those with which the step began,
 * which tissue that moves with the tool reduces; the tools feel the reduced ones */
static double share_of_load(const pal_load_recorder *r, const pal_world *world)
{
    const pal_body *body = pal_world_view_body(world, r->out.body);
    const pal_tools *tools = pal_world_tools(world);
    double load[3] = {0}, from_tools[3] = {0};
    if (!body->implicit) return 1;
    for (int i = 0; i < r->n_node; i++) pal_add3(load, load, body->load + 3 * i);
    for (int t = 0; t < tools->n_tool; t++) pal_sub3(from_tools, from_tools, tools->tool[t].force_N);
    double size2 = pal_dot3(load, load);
    return size2 > 0 ? fmin(fmax(pal_dot3(from_tools, load) / size2, 0), 1) : 1;
}

static void begin_touch(pal_load_recorder *r, const pal_world *world)
{
    pal_material now;
    pal_world_current_material(world, r->out.body, &now);
    if (!(r->out.material.young_Pa > 0)) r->out.material = now;
    const pal_material *first = &r->out.material;
    r->edited |=
        now.young_Pa != first->young_Pa || now.poisson != first->poisson || now.density_kg_m3 != first->density_kg_m3;
    memset(r->mean_N, 0, 3 * (size_t)r->n_node * sizeof(double));
    r->mean_v2 = r->weight = r->max_u = r->held_u = 0;
    r->held.size_N = 0, r->held.speed_1_s = INFINITY;
    /* a body still in motion needs the forces of the touches before as well */
    if (!r->begun || sqrt(mean_square(r, pal_world_view_body(world, r->out.body)->d, r->before)) <
                         PAL_RELEASE_REST_SHARE * r->largest_u)
        r->n_force = r->now.n_step = 0;
    r->now.n = 0;
    r->begun = true;
    r->phase = TOUCHED;
}

/* the forces of this step for the release, of which the points are numbers of nodes until it is kept */
static void log_forces(pal_load_recorder *r, const pal_body *body, double share)
{
    pal_recorded_release *now = &r->now;
    if (now->n_step * r->scene->step_s > PAL_RELEASE_TOUCH_S || r->err) return;
    bool room = PAL_GROW(now->first, now->n_step);
    if (room) now->first[now->n_step++] = r->n_force;
    for (int i = 0; i < r->n_node && room; i++) {
        const double *load = body->load + 3 * i;
        if (!(pal_dot3(load, load) > 0)) continue;
        int n = r->n_force;
        /* three numbers a force: the list of numbers doubles where that of points does */
        room = PAL_GROW(now->point, n);
        double *longer = room && !(n & (n - 1)) ? realloc(now->force_N, 6 * (size_t)(n + 1) * sizeof *longer) : NULL;
        if (room && !(n & (n - 1))) room = longer != NULL;
        if (longer) now->force_N = longer;
        if (!room) break;
        now->point[n] = i;
        pal_scale3(now->force_N + 3 * (size_t)n, share, load);
        r->n_force++;
    }
    if (!room) r->err = PAL_ERR_MEMORY;
}

/* is this the stillest moment of enough displacement? */
static void find_held(pal_load_recorder *r, const pal_world *world, const pal_body *body, double share)
{
    const pal_tools *tools = pal_world_tools(world);
    double keep = exp(-r->scene->step_s / PAL_HELD_MEAN_S), size = 0;
    r->weight += (1 - keep) * (1 - r->weight);
    r->mean_v2 += (1 - keep) * (mean_square(r, body->dv, NULL) - r->mean_v2);
    for (int i = 0; i < r->n_node; i++) {
        double *mean = r->mean_N + 3 * i;
        for (int c = 0; c < 3; c++) mean[c] += (1 - keep) * (share * body->load[3 * i + c] - mean[c]);
        size += pal_norm3(mean) / r->weight;
    }
    double u = sqrt(mean_square(r, body->d, r->before)), speed = u > 0 ? sqrt(r->mean_v2 / r->weight) / u : INFINITY;
    r->max_u = fmax(r->max_u, u);
    r->largest_u = fmax(r->largest_u, u);
    if (r->held_u < PAL_HELD_SHARE * r->max_u) r->held.speed_1_s = INFINITY;
    if (u < PAL_HELD_SHARE * r->max_u || !(size > 0) || !(speed < r->held.speed_1_s)) return;
    r->held_u = u;
    r->held.time_s = r->time_s, r->held.size_N = size, r->held.speed_1_s = speed;
    pal_set3(r->held.total_N, 0, 0, 0);
    for (int i = 0; i < r->n_node; i++) {
        pal_scale3(r->held.force_N + 3 * i, 1 / r->weight, r->mean_N + 3 * i);
        pal_add3(r->held.total_N, r->held.total_N, r->held.force_N + 3 * i);
        pal_sub3(r->held.u + 3 * i, body->d + 3 * i, r->before + 3 * i);
    }
    r->grasped = false;
    for (int t = 0; t < tools->n_tool; t++) r->grasped |= tools->tool[t].holding;
}

/* ---- after it ---- */

static void log_motion(pal_load_recorder *r, const pal_body *body)
{
    if (!r->err && !PAL_GROW(r->now.rms_m, r->now.n)) r->err = PAL_ERR_MEMORY;
    if (!r->err) r->now.rms_m[r->now.n++] = sqrt(mean_square(r, body->d, r->before));
}

/* points of the nodes that have a force in the held moment */
static void keep_load(pal_load_recorder *r)
{
    pal_recorded_load load = r->held, *to = &r->out.load[r->out.n];
    size_t n = 3 * (size_t)r->n_node;
    if (!(load.size_N > 0) || r->err) return;
    if (r->out.n == PAL_CALIBRATE_CASES) {
        to = &r->out.load[0];
        for (int k = 1; k < r->out.n; k++)
            if (r->out.load[k].size_N < to->size_N) to = &r->out.load[k];
        if (to->size_N >= load.size_N) return;
        free_load(to);
        r->out.n--;
    }
    load.n_node = r->n_node, load.n_point = 0;
    PAL_ARRAY(&r->err, load.x, n);
    PAL_ARRAY(&r->err, load.force_N, n);
    PAL_ARRAY(&r->err, load.node_x, n);
    PAL_ARRAY(&r->err, load.u, n);
    for (int i = 0; i < r->n_node && !r->err; i++) {
        if (!(pal_norm3(r->held.force_N + 3 * i) > 0)) continue;
        pal_copy3(load.x + 3 * load.n_point, r->rest + 3 * i);
        pal_copy3(load.force_N + 3 * load.n_point++, r->held.force_N + 3 * i);
    }
    if (!r->err) memcpy(load.node_x, r->rest, n * sizeof(double)), memcpy(load.u, r->held.u, n * sizeof(double));
    r->max_N = fmax(r->max_N, load.size_N);
    snprintf(load.id, sizeof load.id, "%s", r->grasped ? "pull" : "press");
    *to = load;
    r->out.n++;
}

/* the points of the forces, each once */
static void number_points(pal_load_recorder *r, pal_recorded_release *to)
{
    int32_t *number = NULL;
    PAL_ARRAY(&r->err, number, r->n_node);
    PAL_ARRAY(&r->err, to->x, 3 * r->n_node);
    for (int i = 0; i < r->n_node && !r->err; i++) number[i] = -1;
    for (int k = 0; k < r->n_force && !r->err; k++) {
        int32_t i = to->point[k];
        if (number[i] < 0) pal_copy3(to->x + 3 * to->n_x, r->rest + 3 * i), number[i] = to->n_x++;
        to->point[k] = number[i];
    }
    free(number);
}

static void keep_release(pal_load_recorder *r)
{
    pal_recorded_release *now = &r->now, *best = &r->out.release;
    const double step = r->scene->step_s, start = now->n > 0 ? now->rms_m[0] : 0;
    char longer[80];
    snprintf(longer, sizeof longer, "the tissue comes to rest too seldom, not within %g s", PAL_RELEASE_TOUCH_S);
    const char *why = r->phase != AFTER || now->n * step < PAL_RELEASE_MIN_S ? "the recording ends, or the next touch "
                                                                               "begins, too soon after a touch"
                      : now->n_step * step > PAL_RELEASE_TOUCH_S             ? longer
                      : start < PAL_RELEASE_SHARE * r->max_u ? "the tissue followed the hand back to rest"
                                                             : NULL;
    if (why && !r->out.has_release) snprintf(r->out.no_release, sizeof r->out.no_release, "%s", why);
    if (why || r->err || (best->n > 0 && start <= best->rms_m[0])) return;
    free_release(best);
    *best = (pal_recorded_release){.time_s = now->time_s, .step_s = step, .n = now->n};
    best->n_step = r->released;
    PAL_ARRAY(&r->err, best->first, best->n_step + 1);
    PAL_ARRAY(&r->err, best->point, r->n_force);
    PAL_ARRAY(&r->err, best->force_N, 3 * r->n_force);
    PAL_ARRAY(&r->err, best->rms_m, best->n);
    if (r->err) return;
    memcpy(best->first, now->first, (size_t)best->n_step * sizeof *best->first);
    memcpy(best->point, now->point, (size_t)r->n_force * sizeof *best->point);
    memcpy(best->force_N, now->force_N, 3 * (size_t)r->n_force * sizeof(double));
    memcpy(best->rms_m, now->rms_m, (size_t)best->n * sizeof(double));
    /* forces of the steps after it are 0 */
    best->first[best->n_step] = r->n_force;
    number_points(r, best);
    r->out.has_release = true;
    r->out.no_release[0] = 0;
}

void pal_load_recorder_stop(pal_load_recorder *r)
{
    if (r->phase == IDLE) return;
    keep_load(r);
    keep_release(r);
    r->phase = IDLE;
}

void pal_load_recorder_step(pal_load_recorder *r, const pal_world *world)
{
    const pal_body *body = pal_world_view_body(world, r->out.body);
    const double step = r->scene->step_s;
    double share = 1;
    bool loaded = false;
    if (!r->before && !r->err) allocate(r, body);
    if (r->err) return;
    r->time_s += step;
    /* a reset ends a touch without a release */
    if (pal_world_tick(world) < r->tick && r->phase == TOUCHED) pal_load_recorder_stop(r);
    if (pal_world_tick(world) < r->tick) r->phase = IDLE;
    r->tick = pal_world_tick(world);
    for (int i = 0; i < 3 * r->n_node && !loaded && !body->asleep && !body->frozen; i++) loaded = body->load[i] != 0;
    if (r->phase == AFTER && loaded && r->now.n * step >= PAL_TOUCH_GAP_S) pal_load_recorder_stop(r);
    if (r->phase == IDLE && loaded) begin_touch(r, world);
    if (loaded) share = share_of_load(r, world);
    if (r->begun) log_forces(r, body, share);
    if (loaded) {
        r->phase = TOUCHED;
        r->now.n = 0;
        find_held(r, world, body, share);
        r->released = r->now.n_step;
    } else if (r->phase != IDLE) {
        if (r->phase == TOUCHED) r->now.time_s = r->time_s;
        r->phase = AFTER;
        log_motion(r, body);
        if (r->now.n * step >= PAL_RELEASE_S) pal_load_recorder_stop(r);
    }
    if (!r->begun) memcpy(r->before, body->d, 3 * (size_t)r->n_node * sizeof(double));
}

/* ---- the end ---- */

static int by_time(const void *a, const void *b)
{
    double x = ((const pal_recorded_load *)a)->time_s, y = ((const pal_recorded_load *)b)->time_s;
    return (x > y) - (x < y);
}

pal_err pal_load_recorder_end(pal_load_recorder *r, pal_recorded_loads *out, pal_diagnostic *diag)
{
    *out = (pal_recorded_loads){0};
    pal_load_recorder_stop(r);
    if (r->err) return pal_diagnostic_set(diag, r->err, "no memory for the loads of a recording");
    if (r->out.n == 0) return PAL_REFUSE(diag, "no tool touched the body, so there is no load to fit");
    if (r->edited)
        return PAL_REFUSE(diag, "the material was edited between touches: one body has one material in all its loads");
    *out = r->out;
    r->out = (pal_recorded_loads){.body = out->body};
    qsort(out->load, (size_t)out->n, sizeof *out->load, by_time);
    int n = 0;
    for (int k = 0; k < out->n; k++) {
        if (out->load[k].size_N < PAL_TOUCH_SHARE * r->max_N) {
            free_load(&out->load[k]);
            continue;
        }
        out->load[n] = out->load[k];
        if (n != k) out->load[k] = (pal_recorded_load){0};
        char kind[PAL_NAME];
        snprintf(kind, sizeof kind, "%s", out->load[n].id);
        snprintf(out->load[n].id, PAL_NAME, "%.30s-%d", kind, n + 1);
        n++;
    }
    out->n = n;
    return PAL_ERR_OK;
}
