/* The parts of the error of one body: its own scene, the steps ahead (time and algebraic parts), the rests (the other
 * parts). */
#include "server/session/estimate_family.h"
#include "server/session/estimate_price.h"
#include "server/session/estimate_shown.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/zz.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_AHEAD = 12, TIMED = 7 };
static const double ahead_s = 0.1, ahead_ms = 400, tight = 1e-9;
/* a body moved by less of its size has no error but rounding */
static const double unmoved = 1e-9;
static const double usual_tolerance = 1e-2; /* of implicit solvers */
/* of displacements at nodes: 1.2 to 2.1 is observed (numerics.md). Taken for anything from 1 to 2 the first is off by a
 * factor of 0.55 to 1.64; the order that three meshes tell was farther off, as the coarsest is four times as coarse as
 * a live one. Where changes still grow from mesh to mesh (few voxels across, most of them cut) there is no order yet:
 * the first left 0.2 of the truth there, the second half of it to twice as much */
static const double usual_order = 1.5, early_order = 1;
/* voxels with less than that are cut; of the volume in them (tests/accuracy/test_effectivity.c, the gear) */
static const double whole_fill = 0.98, much_cut = 0.1, few_across = 2.5;
/* hexahedra with all points and tetrahedra of four nodes lock above */
static const double locks_above = 0.47;

struct pal_estimate_work {
    const _Atomic bool *stop;
    pal_scene *scene; /* the body alone, without tools and what is shown */
    pal_scene *exact_scene;
    pal_estimate_state state;
    pal_world *live;        /* as it runs                                                     */
    pal_world *exact;       /* the same with a solver that leaves next to nothing; NULL: it solves nothing */
    double *first, *second; /* [n_dof][3] */
    /* springs: voxels that finite elements may stand on; n_hex 0: those of the scene's mesh */
    pal_prepared voxels;
    bool springs, locks;
    bool cut, thin;                         /* many voxels are cut; there are two across, or one */
    bool skinned;                           /* what is shown hangs on nodes */
    pal_rest fine, coarse, coarsest, model; /* world NULL: there is none */
    pal_estimate_shown shown;               /* n 0: nothing is, or nodes are */
    pal_foresight foresight;
    pal_estimate_family family; /* of cut voxels */
    bool priced;                /* what more nodes cost has been measured, or cannot be */
    double awake_ms;            /* of a step of a body that was never seen awake; 0: not measured yet */
    char note[160];
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
    w->skinned = !strcmp(def->output.name, "skin_out");
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
    pal_foresight *f = &w->foresight;
    f->implicit = implicit;
    f->solver_order = !strcmp(solver, "implicit_euler") ? 1 : !strcmp(solver, "rk4") ? 4 : 2;
    f->work[0] = f->work[1] = f->decade = NAN;
    f->n_node = pal_world_body(w->live, 0)->n_node, f->rest_substeps = pal_world_substeps(w->live);
    f->order = usual_order;
    f->tolerance = f->setting.tolerance > 0 ? f->setting.tolerance : usual_tolerance;
    if (!implicit && !cg) return PAL_ERR_OK;
    w->exact_scene = malloc(sizeof *w->exact_scene);
    if (!w->exact_scene) return PAL_ERR_MEMORY;
    *w->exact_scene = *w->scene;
    pal_item *item = &w->exact_scene->body[0].solver;
    if (!item->name[0]) pal_item_init(item, "solver", solver);
    put_number(item, "tolerance", tight);
    if (implicit) put_number(item, "iterations", 400);
    PAL_TRY(pal_world_create(w->exact_scene, note, &w->exact));
    pal_world_body(w->exact, 0)->load_cap_N = INFINITY;
    return PAL_ERR_OK;
}

/* ---- bodies at rest ---- */

static void say(pal_estimate_work *w, const char *text)
{
    size_t n = strlen(w->note);
    snprintf(w->note + n, sizeof w->note - n, "%s%s", n > 0 ? "; " : "", text);
}

static const char *model_text(const pal_body_def *def, const char *key, const char *otherwise)
{
    for (int i = 0; i < def->model.n_value; i++)
        if (!strcmp(def->model.value[i].key, key)) return def->model.value[i].text;
    return otherwise;
}

static bool nearly_incompressible(const pal_body_def *def)
{
    bool found = def->material.poisson > locks_above;
    for (int k = 0; k < def->n_region; k++) {
        const pal_region *r = &def->region[k];
        found = found || r->poisson > locks_above;
        for (int i = 0; r->kind == PAL_REGION_GRID && r->grid_poisson && i < r->n[0] * r->n[1] * r->n[2]; i++)
            found = found || r->grid_poisson[i] > locks_above;
    }
    return found;
}

/* the hexahedra that a body of springs does not have; nothing where it is of no voxels */
static void find_voxels(pal_estimate_work *w)
{
    pal_body_def *def = &w->scene->body[0];
    w->voxels = *def->mesh;
    memset(&w->voxels.hexes, 0, sizeof w->voxels.hexes);
    if (def->mesh->hexes.n_hex == 0 && !pal_hexes_find(&def->mesh->tets, &w->voxels.hexes, NULL))
        def->mesh = &w->voxels;
}

/* share of the volume in voxels that the surface cuts, whose part changes from mesh to mesh in no order */
static double cut_share(const pal_hexes *hexes)
{
    double cut = 0, all = 0;
    for (int e = 0; e < hexes->n_hex; e++) {
        all += (double)hexes->fill[e];
        if ((double)hexes->fill[e] < whole_fill) cut += (double)hexes->fill[e];
    }
    return all > 0 ? cut / all : 0;
}

static bool is_thin(const pal_tets *tets)
{
    double least = INFINITY;
    for (int c = 0; c < 3; c++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < tets->n_node; i++)
            low = fmin(low, tets->x[3 * i + c]), high = fmax(high, tets->x[3 * i + c]);
        least = fmin(least, high - low);
    }
    return least < few_across * tets->h_m;
}

/* a mesh or law that cannot be had leaves its part unknown */
static pal_err make_rests(pal_estimate_work *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    pal_body_def *def = &w->scene->body[0];
    const char *element = NULL, *law = NULL;
    pal_note note = {""};
    w->springs = !strcmp(def->model.name, "tet_springs");
    if (!w->springs && strcmp(def->model.name, "fem")) {
        say(w, "discretisation and model: not known of control cells");
        return PAL_ERR_OK;
    }
    if (w->springs) find_voxels(w);
    bool hexes = def->mesh->hexes.n_hex > 0;
    if (w->springs) element = hexes ? "hex8_bbar" : "tet4", law = "corotational";
    const char *is = element ? element : model_text(def, "element", hexes ? "hex8_bbar" : "tet4");
    w->locks = (!strcmp(is, "tet4") || !strcmp(is, "hex8")) && nearly_incompressible(def);
    pal_err err = pal_rest_make(w->scene, body, element, law, &note, &w->fine);
    if (err) {
        say(w, note.text);
        return err == PAL_ERR_MEMORY ? err : PAL_ERR_OK;
    }
    if (stopped(w)) return PAL_ERR_STATE;
    err = pal_rest_coarser(w->scene, body, element, law, &note, &w->coarse);
    if (err) say(w, note.text);
    if (stopped(w)) return PAL_ERR_STATE;
    w->cut = !err && cut_share(&def->mesh->hexes) > much_cut;
    w->thin = !err && hexes && is_thin(&def->mesh->tets);
    /* one that cannot be had tells nothing of the order */
    if (!err) (void)pal_rest_coarser(w->coarse.scene, body, NULL, NULL, NULL, &w->coarsest);
    if (stopped(w)) return PAL_ERR_STATE;
    if (w->skinned) PAL_TRY(pal_estimate_shown_make(&w->fine, &w->coarse, &w->coarsest, &w->shown));
    bool neo = !strcmp(model_text(def, "law", ""), "neo_hookean");
    if (!w->springs && !neo && pal_rest_make(w->scene, body, NULL, "neo_hookean", &note, &w->model)) say(w, note.text);
    return PAL_ERR_OK;
}

static pal_err take_state(pal_estimate_work *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    size_t n = 3 * (size_t)body->n_dof;
    pal_estimate_state *s = &w->state;
    *s = (pal_estimate_state){.n_dof = body->n_dof, .n_node = body->n_node};
    s->x = malloc(n * sizeof(double)), s->v = malloc(n * sizeof(double));
    s->load = malloc(3 * sizeof(double) * (size_t)body->n_node);
    s->borne = malloc(3 * sizeof(double) * (size_t)body->n_node);
    s->outer = calloc(3 * (size_t)body->n_node, sizeof(double));
    w->first = malloc(n * sizeof(double)), w->second = malloc(n * sizeof(double));
    for (int i = 0; i < pal_world_rows(w->live); i++) {
        const pal_effect *effect = pal_world_effect(w->live, i)->effect;
        if (effect->stage != PAL_STAGE_FORCE || s->n_row == PAL_ESTIMATE_ROWS) continue;
        s->row[s->n_row] = effect->name;
        s->row_on[s->n_row++] = true;
    }
    return s->x && s->v && s->load && s->outer && s->borne && w->first && w->second ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err open_work(pal_estimate_work *w, const pal_scene *scene, int body, pal_note *note)
{
    PAL_TRY(make_scene(w, scene, body, note));
    pal_setting_of(scene, body, &w->foresight.setting);
    w->foresight.scene = w->scene, w->foresight.body = 0;
    PAL_TRY(make_live(w, note));
    if (pal_world_body(w->live, 0)->shell)
        return pal_note_set(
            note, PAL_ERR_REFUSED,
            "body \"%s\" is refined while it runs: its error is not estimated (`palpate study` measures "
            "it against its finest level)",
            w->scene->body[0].name);
    PAL_TRY(take_state(w));
    PAL_TRY(make_rests(w));
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
    pal_rest_free(&w->fine), pal_rest_free(&w->coarse), pal_rest_free(&w->coarsest);
    pal_rest_free(&w->model);
    pal_estimate_shown_free(&w->shown);
    pal_hexes_free(&w->voxels.hexes);
    free(w->scene), free(w->exact_scene);
    free(w->state.x), free(w->state.v), free(w->state.load), free(w->state.outer), free(w->state.borne);
    free(w->first), free(w->second);
    pal_estimate_family_free(&w->family);
    free(w);
}

pal_estimate_state *pal_estimate_work_state(pal_estimate_work *work)
{
    return &work->state;
}

static bool has_row(const pal_world *world, int body, const char *name)
{
    const char *of = pal_world_look(world, body)->name;
    for (int i = 0; i < pal_world_rows(world); i++) {
        pal_row_info row;
        pal_world_row(world, i, &row);
        if (row.body == of && !strcmp(row.name, name)) return true;
    }
    return false;
}

pal_err pal_estimate_rows(const pal_estimate_state *state, pal_world *world, const pal_scene *scene, bool recipe)
{
    const pal_body_def *def = &scene->body[0];
    for (int k = 0; k < state->n_row; k++) {
        bool has = has_row(world, 0, state->row[k]), may = recipe || has;
        for (int i = 0; i < def->n_effect; i++) may = may || !strcmp(def->effect[i].name, state->row[k]);
        if (has == state->row_on[k] || !may) continue;
        PAL_TRY(pal_world_switch_row(world, scene, 0, state->row[k], state->row_on[k], NULL));
        pal_world_body(world, 0)->load_cap_N = INFINITY;
    }
    return PAL_ERR_OK;
}

/* what is shown, contact and guards took in the last step */
static double fixed_ms(const pal_world *world, int body)
{
    const char *of = pal_world_look(world, body)->name;
    double sum_ns = 0;
    for (int i = 0; i < pal_world_rows(world); i++) {
        const pal_row *row = pal_world_effect(world, i);
        pal_row_info info;
        pal_world_row(world, i, &info);
        if (info.body != of) continue;
        if (row->effect->stage != PAL_STAGE_FORCE && row->effect->stage != PAL_STAGE_SOLVE)
            sum_ns += (double)row->spent_ns;
    }
    return 1e-6 * sum_ns;
}

/* some tool is felt, and this body bears something that nobody set: tools on another body are not this one's */
static bool is_touched(const pal_world *world, const pal_body *body)
{
    const pal_tools *tools = pal_world_tools(world);
    bool any = false, borne = false;
    for (int t = 0; t < tools->n_tool; t++)
        any = any || pal_dot3(tools->tool[t].mean_force_N, tools->tool[t].mean_force_N) > 0;
    for (int i = 0; i < 3 * body->n_node && any && !borne; i++)
        borne = body->load[i] != (body->outer ? body->outer[i] : 0);
    return borne;
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
    state->touched = is_touched(world, from);
    if (from->outer)
        memcpy(state->outer, from->outer, 3 * sizeof(double) * (size_t)from->n_node);
    else
        memset(state->outer, 0, 3 * sizeof(double) * (size_t)from->n_node);
    state->tick = pal_world_tick(world);
    state->time_s = pal_world_time_s(world);
    state->n_substep = pal_world_substeps(world);
    state->asleep = from->asleep;
    double fixed = from->asleep ? 0 : fixed_ms(world, body);
    if (fixed > 0) state->fixed_ms = state->fixed_ms > 0 ? fmin(state->fixed_ms, fixed) : fixed;
    pal_world_material_now(world, body, &state->material);
    for (int k = 0; k < state->n_row; k++) state->row_on[k] = has_row(world, body, state->row[k]);
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
static pal_err set_state(const pal_estimate_work *w, pal_world *world)
{
    const pal_estimate_state *s = &w->state;
    pal_body *body = pal_world_body(world, 0);
    pal_material now;
    PAL_TRY(pal_estimate_rows(s, world, world == w->exact ? w->exact_scene : w->scene, true));
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

/* n steps of dt_s from the state -> x, and what one took; false: stopped or not possible */
static bool go_ahead(const pal_estimate_work *w, pal_world *world, int n, double dt_s, double *x, double *ms)
{
    const pal_body *body = pal_world_body(world, 0);
    bool good = !set_state(w, world);
    uint64_t began = pal_clock_thread_ns();
    for (int i = 0; i < n && good; i++) good = !stopped(w) && !pal_world_step(world, dt_s);
    *ms = 1e-6 * (double)(pal_clock_thread_ns() - began) / n;
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
    double live_ms = NAN, exact_ms = NAN, half_ms;
    out->algebraic_m = w->exact ? NAN : 0;
    if (w->exact && !go_ahead(w, w->live, n, step_s, w->first, &live_ms)) return;
    if (!go_ahead(w, exact, n * n_sub, step_s / n_sub, w->second, &exact_ms)) return;
    if (w->exact) out->algebraic_m = most_between(w->first, w->second, n_dof);
    if (!go_ahead(w, exact, 2 * n * n_sub, 0.5 * step_s / n_sub, w->first, &half_ms)) return;
    if (w->exact && n_sub == 1)
        w->foresight.decade = pow(fmax(exact_ms / live_ms, 1), 1 / log10(w->foresight.tolerance / tight));
    out->time_m = most_between(w->first, w->second, n_dof) / (1 - ldexp(1, -w->foresight.solver_order));
}

/* the body's own method on the coarse mesh and on this one, under the same loads, once */
static void price_size(pal_estimate_work *w)
{
    pal_world *small = NULL;
    if (w->priced || !w->coarse.world) return;
    w->priced = true;
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return;
    *scene = *w->coarse.scene;
    scene->body[0].model = w->scene->body[0].model;
    scene->body[0].solver = w->scene->body[0].solver;
    if (!pal_world_create(scene, NULL, &small)) {
        const pal_body *loaded = pal_world_look(w->coarse.world, 0);
        pal_body *body = pal_world_body(small, 0);
        (void)pal_estimate_rows(&w->state, small, scene, true);
        body->load_cap_N = INFINITY;
        for (int i = 0; loaded->outer && i < body->n_node && body->n_node == loaded->n_node; i++)
            (void)pal_world_load(small, 0, i, loaded->outer + 3 * (size_t)i);
        pal_estimate_price(w->scene, w->live, small, &w->foresight);
    }
    pal_world_destroy(small);
    free(scene);
}

/* ---- the rests ---- */

static void tell(pal_estimate *out, const char *text)
{
    size_t n = strlen(out->note);
    snprintf(out->note + n, sizeof out->note - n, "%s%s", n > 0 ? "; " : "", text);
}

/* The loads under which the body would rest where it is now: those that act less what is left over, which accelerates
 * it and is taken by drag (d'Alembert). At rest they are those that act. Supports bear what is left over at theirs */
static bool find_borne(pal_estimate_work *w)
{
    pal_estimate_state *s = &w->state;
    pal_body *body = pal_world_body(w->live, 0);
    if (set_state(w, w->live)) return false;
    memset(body->v, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    if (pal_world_pull(w->live, 0)) return false;
    memcpy(s->borne, s->load, 3 * sizeof(double) * (size_t)s->n_node);
    for (int i = 0; i < s->n_node; i++)
        if (!body->held[i]) pal_axpy3(s->borne + 3 * (size_t)i, -1, body->f + 3 * (size_t)i);
    return true;
}

static double known(double part)
{
    return isnan(part) ? 0 : part;
}

/* the largest distance between a rest and a coarser one, at nodes of the running body that the coarser one has */
static double change(const pal_rest *rest, const pal_rest *coarser)
{
    double most = 0;
    for (int k = 0; k < coarser->n_common; k++) {
        size_t i = 3 * (size_t)coarser->common[k];
        most = fmax(most, pal_dist3(rest->x + i, coarser->x + i));
    }
    return most;
}

/* is the last change no smaller than the one before it? */
static bool changes_grow(pal_estimate_work *w, const pal_body *body, double last)
{
    if (!w->coarsest.world || !pal_rest_find(&w->coarsest, &w->state, body, NULL, w->stop)) return false;
    double first = w->shown.n > 0 ? pal_estimate_shown_change(&w->shown, PAL_SHOWN_COARSE, PAL_SHOWN_COARSEST)
                                  : change(&w->coarse, &w->coarsest);
    return first > 0 && last >= first;
}

/* how the skin hangs off its elements; how that of springs does is in how far they are from elements */
static double skin_off(pal_estimate_work *w)
{
    return w->shown.n > 0 && !w->springs ? pal_estimate_shown_off(&w->shown, w->fine.x, 0) : 0;
}

static void discretise(pal_estimate_work *w, const pal_body *body, pal_estimate *out)
{
    pal_zz zz;
    bool fresh = false;
    if (!pal_zz_estimate(w->fine.world, 0, NULL, &zz, NULL)) out->zz_percent = zz.percent;
    if (!pal_rest_find(&w->coarse, &w->state, body, NULL, w->stop)) {
        if (w->coarse.world) tell(out, "discretisation: the coarser mesh finds no rest under these loads");
        return;
    }
    double last = w->shown.n > 0 ? pal_estimate_shown_change(&w->shown, PAL_SHOWN_FINE, PAL_SHOWN_COARSE)
                                 : change(&w->fine, &w->coarse);
    if ((w->cut || w->thin) && !w->springs)
        fresh = pal_estimate_family_refresh(w->scene, body, &w->foresight.setting, &w->state, w->shown.n > 0, !w->cut,
                                            w->stop, &w->family);
    const pal_estimate_family *f = &w->family;
    w->foresight.left[0] = f->known ? known(f->half) : 0, w->foresight.left[1] = f->known ? known(f->twice) : 0;
    if (w->cut) {
        char text[80];
        pal_estimate_family_say(f, fresh, text, sizeof text);
        tell(out, text);
    }
    if (f->known) {
        w->foresight.order = usual_order;
        out->discretisation_m = last * f->times + skin_off(w);
        return;
    }
    bool early = changes_grow(w, body, last);
    w->foresight.order = early ? early_order : usual_order;
    if (early) tell(out, "discretisation: still grows from mesh to mesh, so more may be left");
    out->discretisation_m = last / (exp2(w->foresight.order) - 1) + skin_off(w);
}

/* Springs whose constants were fitted to converged finite elements stand nearer to these than to those of their own
 * voxels: how far they are from where Richardson carries the two meshes' rests. That has the mesh's part in it */
static void compare_fitted(pal_estimate_work *w, pal_estimate *out)
{
    double most = 0, more = 1 / (exp2(w->foresight.order) - 1);
    if (w->shown.n > 0) most = pal_estimate_shown_off(&w->shown, w->state.x, more);
    for (int k = 0; k < w->coarse.n_common && w->shown.n == 0; k++) {
        size_t i = 3 * (size_t)w->coarse.common[k];
        double limit[3];
        for (size_t c = 0; c < 3; c++) limit[c] = w->fine.x[i + c] + more * (w->fine.x[i + c] - w->coarse.x[i + c]);
        most = fmax(most, pal_dist3(w->state.x + i, limit));
    }
    out->model_m = most, out->discretisation_m = 0;
    tell(out, "fitted: the mesh's part is in the model's");
}

static void compare_models(pal_estimate_work *w, const pal_body *body, pal_estimate *out)
{
    int n = w->state.n_node;
    if (w->springs && w->foresight.setting.k_distance_J > 0 && out->discretisation_m > 0)
        compare_fitted(w, out);
    else if (w->springs) /* where they are is where they rest under what they bear */
        out->model_m =
            w->shown.n > 0 ? pal_estimate_shown_off(&w->shown, w->state.x, 0) : most_between(w->state.x, w->fine.x, n);
    else if (!w->model.world)
        out->model_m = !strcmp(model_text(&w->scene->body[0], "law", ""), "neo_hookean") ? 0 : (double)NAN;
    else if (pal_rest_find(&w->model, &w->state, body, w->fine.x, w->stop))
        out->model_m = most_between(w->model.x, w->fine.x, n);
}

static bool has_moved(const pal_estimate_work *w, const pal_estimate *out)
{
    return out->most_m > unmoved * pal_world_look(w->live, 0)->size_m;
}

static void find_rests(pal_estimate_work *w, pal_estimate *out)
{
    const pal_body *body = pal_world_body(w->live, 0);
    if (!w->fine.world) return;
    out->locking = w->locks;
    if (!has_moved(w, out)) {
        if (w->coarse.world) out->discretisation_m = 0;
        out->model_m = out->zz_percent = 0;
        return;
    }
    if (!find_borne(w) || !pal_rest_find(&w->fine, &w->state, body, w->state.x, w->stop)) {
        out->locking = false;
        tell(out, "no rest was found under these loads");
        return;
    }
    discretise(w, body, out);
    if (!stopped(w)) compare_models(w, body, out);
}

static double largest_move(const pal_estimate_work *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    return most_between(w->state.x, body->x_rest, w->state.n_dof);
}

/* without the large parts a sum would pass for the whole, beside those of a study that are whole */
static void sum_up(const pal_estimate_work *w, pal_estimate *out)
{
    bool whole = !isnan(out->discretisation_m) && !(w->springs && isnan(out->model_m));
    out->error_m = whole ? out->discretisation_m + known(out->algebraic_m) + known(out->time_m) + known(out->model_m)
                         : (double)NAN;
}

/* asleep a step costs next to nothing: what counts is what it takes to be awake */
static void price_sleep(pal_estimate_work *w, pal_estimate *out)
{
    if (!w->state.asleep) return;
    if (isnan(out->ms) && !w->awake_ms) (void)go_ahead(w, w->live, TIMED, w->scene->step_s, w->first, &w->awake_ms);
    if (isnan(out->ms)) out->ms = w->awake_ms;
    tell(out, "asleep: ms are those of a step awake");
}

/* the steps ahead of a body that stands where it was made leave rounding alone */
static void drop_rounding(const pal_estimate_work *w, pal_estimate *out)
{
    double least_m = unmoved * pal_world_look(w->live, 0)->size_m;
    if (has_moved(w, out)) return;
    if (out->time_m < least_m) out->time_m = 0;
    if (out->algebraic_m < least_m) out->algebraic_m = 0;
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
    memcpy(out->note, w->note, sizeof out->note);
    price_sleep(w, out);
    look_ahead(w, out);
    drop_rounding(w, out);
    if (!stopped(w)) find_rests(w, out);
    sum_up(w, out);
    if (!stopped(w)) price_size(w);
    w->foresight.n_substep = w->state.n_substep;
    w->foresight.fixed = out->ms > 0 ? fmin(w->state.fixed_ms / out->ms, 1) : 0;
    pal_estimate_foresee(&w->foresight, out);
    return !stopped(w);
}
