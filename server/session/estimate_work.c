/* The parts of the error of one body. This file: its own scene and the steps ahead (time and algebraic parts). */
#include "server/session/estimate_work.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_AHEAD = 12 };
static const double ahead_s = 0.1, ahead_ms = 400, tight = 1e-9;

struct pal_estimate_work {
    const _Atomic bool *stop;
    pal_scene *scene; /* the body alone, without tools and what is shown */
    pal_estimate_state state;
    pal_world *live;        /* as it runs                                                     */
    pal_world *exact;       /* the same with a solver that leaves next to nothing; NULL: it solves nothing */
    int order;              /* of the solver in time */
    double *first, *second; /* [n_dof][3] */
};

static bool stopped(const pal_estimate_work *w)
{
    return w->stop && atomic_load_explicit(w->stop, memory_order_acquire);
}

/* ---- own scene ---- */

/* a moving support stands where it is: its nodes are held, and put in place with the state */
static void hold_led(pal_body_def *def, const pal_item *item)
{
    pal_support *to = &def->support[def->n_support];
    pal_item read = *item;
    double low[3], high[3];
    if (def->n_support == PAL_SUPPORT_MAX) return;
    *to = (pal_support){.lowest = true, .fraction = 0.05};
    if (pal_item_has(item, "low_m") && !pal_item_numbers(&read, "low_m", 3, low, NULL) &&
        !pal_item_numbers(&read, "high_m", 3, high, NULL)) {
        to->lowest = false;
        pal_copy3(to->low_m, low);
        pal_copy3(to->high_m, high);
    } else {
        (void)pal_item_number(&read, "lowest", 0, 1, &to->fraction, NULL);
    }
    def->n_support++;
}

/* what bears on the body but for contact, which the state's loads stand for */
static void keep_forces(pal_body_def *def)
{
    static const char *const kept[] = {"gravity", "viscous", "penalty", "inflate"};
    int n = 0;
    for (int i = 0; i < def->n_effect; i++) {
        bool keep = false;
        if (!strcmp(def->effect[i].name, "moving_support")) hold_led(def, &def->effect[i]);
        for (int k = 0; k < 4; k++) keep = keep || !strcmp(def->effect[i].name, kept[k]);
        if (keep) def->effect[n++] = def->effect[i];
    }
    def->n_effect = n;
}

static pal_err make_scene(pal_estimate_work *w, const pal_scene *scene, int body, pal_note *note)
{
    if (body < 0 || body >= scene->n_body)
        return pal_note_set(note, PAL_ERR_REFUSED, "body %d does not exist: the scene has %d", body, scene->n_body);
    w->scene = malloc(sizeof *w->scene);
    if (!w->scene) return PAL_ERR_MEMORY;
    *w->scene = *scene;
    w->scene->n_body = 1;
    w->scene->n_tool = 0;
    pal_body_def *def = &w->scene->body[0];
    if (body > 0) *def = scene->body[body];
    def->output.name[0] = 0;
    keep_forces(def);
    return PAL_ERR_OK;
}

/* ---- worlds ---- */

static const pal_row *solver_of(const pal_world *world)
{
    for (int i = 0; i < pal_world_rows(world); i++)
        if (pal_world_effect(world, i)->effect->stage == PAL_STAGE_SOLVE) return pal_world_effect(world, i);
    return NULL;
}

static void put_number(pal_item *item, const char *key, double number)
{
    for (int i = 0; i < item->n_value; i++)
        if (!strcmp(item->value[i].key, key)) {
            item->value[i].number[0] = number;
            return;
        }
    (void)pal_item_put_number(item, key, number, NULL);
}

static pal_err make_live(pal_estimate_work *w, pal_note *note)
{
    PAL_TRY(pal_world_create(w->scene, note, &w->live));
    pal_world_body(w->live, 0)->load_cap_N = INFINITY;
    const char *solver = solver_of(w->live)->effect->name;
    bool implicit = !strcmp(solver, "implicit_euler") || !strcmp(solver, "sdirk2"), cg = !strcmp(solver, "central_cg");
    w->order = !strcmp(solver, "implicit_euler") ? 1 : !strcmp(solver, "rk4") ? 4 : 2;
    if (!implicit && !cg) return PAL_ERR_OK;
    pal_item *item = &w->scene->body[0].solver, was = *item;
    if (!item->name[0]) pal_item_init(item, "solver", solver);
    put_number(item, "tolerance", tight);
    if (implicit) put_number(item, "iterations", 400);
    pal_err err = pal_world_create(w->scene, note, &w->exact);
    *item = was;
    if (!err) pal_world_body(w->exact, 0)->load_cap_N = INFINITY;
    return err;
}

static pal_err take_state(pal_estimate_work *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    size_t n = 3 * (size_t)body->n_dof;
    pal_estimate_state *s = &w->state;
    *s = (pal_estimate_state){.n_dof = body->n_dof, .n_node = body->n_node};
    s->x = malloc(n * sizeof(double)), s->v = malloc(n * sizeof(double));
    s->load = malloc(3 * sizeof(double) * (size_t)body->n_node);
    w->first = malloc(n * sizeof(double)), w->second = malloc(n * sizeof(double));
    return s->x && s->v && s->load && w->first && w->second ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err open_work(pal_estimate_work *w, const pal_scene *scene, int body, pal_note *note)
{
    PAL_TRY(make_scene(w, scene, body, note));
    PAL_TRY(make_live(w, note));
    if (pal_world_body(w->live, 0)->shell)
        return pal_note_set(
            note, PAL_ERR_REFUSED,
            "body \"%s\" is refined while it runs: its error is not estimated (`palpate study` measures "
            "it against its finest level)",
            w->scene->body[0].name);
    PAL_TRY(take_state(w));
    return stopped(w) ? PAL_ERR_STATE : PAL_ERR_OK;
}

pal_err pal_estimate_work_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_note *note,
                               pal_estimate_work **out)
{
    pal_estimate_work *w = calloc(1, sizeof *w);
    if (!w) return pal_note_set(note, PAL_ERR_MEMORY, "no memory for an estimator");
    w->stop = stop;
    pal_err err = open_work(w, scene, body, note);
    if (err == PAL_ERR_MEMORY) pal_note_set(note, err, "no memory for the worlds of an estimator");
    if (err)
        pal_estimate_work_close(w);
    else
        *out = w;
    return err;
}

void pal_estimate_work_close(pal_estimate_work *w)
{
    if (!w) return;
    pal_world_destroy(w->live);
    pal_world_destroy(w->exact);
    free(w->scene);
    free(w->state.x), free(w->state.v), free(w->state.load);
    free(w->first), free(w->second);
    free(w);
}

pal_estimate_state *pal_estimate_work_state(pal_estimate_work *work)
{
    return &work->state;
}

bool pal_estimate_copy(pal_estimate_state *state, const pal_world *world, int body)
{
    const pal_body *from = pal_world_look(world, body);
    size_t n_byte = 3 * sizeof(double) * (size_t)from->n_dof;
    if (from->n_dof != state->n_dof || from->n_node != state->n_node || from->frozen || !pal_body_finite(from))
        return false;
    memcpy(state->x, from->x, n_byte);
    memcpy(state->v, from->v, n_byte);
    memcpy(state->load, from->load, 3 * sizeof(double) * (size_t)from->n_node);
    state->tick = pal_world_tick(world);
    state->time_s = pal_world_time_s(world);
    state->n_substep = pal_world_substeps(world);
    pal_world_material_now(world, body, &state->material);
    return true;
}

/* ---- one estimate ---- */

static int rising(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double median_ms(pal_estimate_state *s)
{
    if (s->n_ms == 0) return NAN;
    qsort(s->ms, (size_t)s->n_ms, sizeof *s->ms, rising);
    return (double)s->ms[s->n_ms / 2];
}

/* the state into a world of the same mesh, under its loads */
static pal_err set_state(pal_world *world, const pal_estimate_state *s)
{
    pal_body *body = pal_world_body(world, 0);
    pal_material now;
    pal_world_material_now(world, 0, &now);
    if (memcmp(&now, &s->material, sizeof now)) {
        PAL_TRY(pal_world_material(world, 0, &s->material, NULL));
        body->load_cap_N = INFINITY;
    }
    for (int i = 0; i < body->n_node; i++) PAL_TRY(pal_world_load(world, 0, i, s->load + 3 * (size_t)i));
    memcpy(body->x, s->x, 3 * sizeof(double) * (size_t)body->n_dof);
    memcpy(body->v, s->v, 3 * sizeof(double) * (size_t)body->n_dof);
    for (int i = 0; i < body->n_dof; i++)
        if (body->held[i]) pal_set3(body->v + 3 * i, 0, 0, 0);
    body->frozen = false;
    pal_world_moved(world, 0);
    return PAL_ERR_OK;
}

/* n steps of dt_s from the state -> x; false: stopped or not possible */
static bool go_ahead(const pal_estimate_work *w, pal_world *world, int n, double dt_s, double *x)
{
    const pal_body *body = pal_world_body(world, 0);
    bool good = !set_state(world, &w->state);
    for (int i = 0; i < n && good; i++) good = !stopped(w) && !pal_world_step(world, dt_s);
    memcpy(x, body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    return good && pal_body_finite(body);
}

static double most_between(const double *a, const double *b, int n)
{
    double most = 0;
    for (int i = 0; i < n; i++) most = fmax(most, pal_dist3(a + 3 * (size_t)i, b + 3 * (size_t)i));
    return most;
}

/* algebraic and time parts of the steps ahead */
static void look_ahead(pal_estimate_work *w, pal_estimate *out)
{
    double step_s = w->scene->step_s, ms = isnan(out->ms) ? 1 : out->ms;
    int n_sub = w->state.n_substep > 0 ? w->state.n_substep : 1, n_dof = w->state.n_dof;
    int n = (int)fmin(fmin(MOST_AHEAD, ceil(ahead_s / step_s)), fmax(1, ahead_ms / (4 * ms)));
    pal_world *exact = w->exact ? w->exact : w->live;
    out->algebraic_m = w->exact ? NAN : 0;
    if (w->exact && !go_ahead(w, w->live, n, step_s, w->first)) return;
    if (!go_ahead(w, exact, n * n_sub, step_s / n_sub, w->second)) return;
    if (w->exact) out->algebraic_m = most_between(w->first, w->second, n_dof);
    if (!go_ahead(w, exact, 2 * n * n_sub, 0.5 * step_s / n_sub, w->first)) return;
    out->time_m = most_between(w->first, w->second, n_dof) / (1 - ldexp(1, -w->order));
}

static double largest_move(const pal_estimate_work *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    return most_between(w->state.x, body->x_rest, w->state.n_dof);
}

static double known(double part)
{
    return isnan(part) ? 0 : part;
}

static void sum_up(pal_estimate *out)
{
    bool any = !isnan(out->discretisation_m) || !isnan(out->algebraic_m) || !isnan(out->time_m) || !isnan(out->model_m);
    out->error_m =
        any ? known(out->discretisation_m) + known(out->algebraic_m) + known(out->time_m) + known(out->model_m)
            : (double)NAN;
}

bool pal_estimate_work_run(pal_estimate_work *w, pal_estimate *out)
{
    *out = (pal_estimate){.tick = w->state.tick,
                          .time_s = w->state.time_s,
                          .most_m = largest_move(w),
                          .discretisation_m = NAN,
                          .algebraic_m = NAN,
                          .time_m = NAN,
                          .model_m = NAN,
                          .zz_percent = NAN,
                          .ms = median_ms(&w->state)};
    look_ahead(w, out);
    sum_up(out);
    if (isnan(out->discretisation_m)) snprintf(out->note, sizeof out->note, "discretisation and model: not known");
    return !stopped(w);
}
