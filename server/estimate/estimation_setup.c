/* Creates what an estimation works with: its own scene, live and nearly exact worlds, meshes for the equilibria. */
#include "server/estimate/estimation.h"

#include "server/estimate/tuning.h"
#include "server/sim/core/effect_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- own scene ---- */

/* A moving support counts as stationary: its nodes are fixed and positioned with the state. */
static void fix_moving_support(pal_body_def *def, const pal_config_entry *item)
{
    if (def->n_support == PAL_SUPPORT_MAX) return;
    if (pal_support_of_effect(item, &def->support[def->n_support])) def->n_support++;
}

/* Keeps all force components except contact, which the loads of the state represent. */
static void keep_forces(pal_body_def *def)
{
    int n = 0;
    for (int i = 0; i < def->n_effect; i++) {
        const pal_effect *effect = pal_effect_find(def->effect[i].name);
        if (!strcmp(def->effect[i].name, "moving_support")) fix_moving_support(def, &def->effect[i]);
        if (effect && effect->stage == PAL_STAGE_FORCE) def->effect[n++] = def->effect[i];
    }
    def->n_effect = n;
}

static pal_err make_scene(pal_estimation *w, const pal_scene *scene, int body, pal_diagnostic *diag)
{
    if (body < 0 || body >= scene->n_body)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "body %d does not exist: the scene has %d", body,
                                  scene->n_body);
    w->scene = malloc(sizeof *w->scene);
    if (!w->scene) return PAL_ERR_MEMORY;
    *w->scene = *scene;
    w->scene->n_body = 1;
    w->scene->n_tool = 0;
    pal_body_def *def = &w->scene->body[0];
    if (body > 0) *def = scene->body[body];
    w->skinned = !strcmp(def->output.name, "skin_output");
    def->output.name[0] = 0;
    keep_forces(def);
    return PAL_ERR_OK;
}

/* ---- worlds ---- */

static const pal_component *solver_of(const pal_world *world)
{
    for (int i = 0; i < pal_world_component_count(world); i++)
        if (pal_world_component(world, i)->effect->stage == PAL_STAGE_SOLVE) return pal_world_component(world, i);
    return NULL;
}

static void put_number(pal_config_entry *item, const char *key, double number)
{
    for (int i = 0; i < item->n_value; i++)
        if (!strcmp(item->value[i].key, key)) {
            item->value[i].number[0] = number;
            return;
        }
    (void)pal_entry_put_number(item, key, number, NULL);
}

static pal_err make_live(pal_estimation *w, pal_diagnostic *diag)
{
    PAL_TRY(pal_world_create(w->scene, diag, &w->live));
    pal_world_body(w->live, 0)->load_cap_N = INFINITY;
    const char *solver = solver_of(w->live)->effect->name;
    bool implicit = !strcmp(solver, "implicit_euler") || !strcmp(solver, "sdirk2"), cg = !strcmp(solver, "central_cg");
    pal_prediction *f = &w->prediction;
    f->implicit = implicit;
    f->solver_order = !strcmp(solver, "implicit_euler") ? 1 : !strcmp(solver, "rk4") ? 4 : 2;
    f->work[0] = f->work[1] = f->decade = NAN;
    f->n_node = pal_world_body(w->live, 0)->n_node, f->rest_substeps = pal_world_substeps(w->live);
    f->order = PAL_USUAL_ORDER;
    f->tolerance = f->configuration.tolerance > 0 ? f->configuration.tolerance : PAL_TOLERANCE_LIVE;
    if (!implicit && !cg) return PAL_ERR_OK;
    w->exact_scene = malloc(sizeof *w->exact_scene);
    if (!w->exact_scene) return PAL_ERR_MEMORY;
    *w->exact_scene = *w->scene;
    pal_config_entry *item = &w->exact_scene->body[0].solver;
    if (!item->name[0]) pal_entry_init(item, "solver", solver);
    put_number(item, "tolerance", PAL_TOLERANCE_EXACT);
    if (implicit) put_number(item, "iterations", 400);
    PAL_TRY(pal_world_create(w->exact_scene, diag, &w->exact));
    pal_world_body(w->exact, 0)->load_cap_N = INFINITY;
    return PAL_ERR_OK;
}

/* ---- equilibria ---- */

const char *pal_estimate_model_text(const pal_body_def *def, const char *key, const char *otherwise)
{
    for (int i = 0; i < def->model.n_value; i++)
        if (!strcmp(def->model.value[i].key, key)) return def->model.value[i].text;
    return otherwise;
}

static bool nearly_incompressible(const pal_body_def *def)
{
    bool found = def->material.poisson > PAL_LOCKS_ABOVE;
    for (int k = 0; k < def->n_region; k++) {
        const pal_region *r = &def->region[k];
        found = found || r->poisson > PAL_LOCKS_ABOVE;
        for (int i = 0; r->kind == PAL_REGION_GRID && r->grid_poisson && i < r->n[0] * r->n[1] * r->n[2]; i++)
            found = found || r->grid_poisson[i] > PAL_LOCKS_ABOVE;
    }
    return found;
}

/* Finds the hexahedra that a body of springs lacks; none if it has no voxels. */
static void find_voxels(pal_estimation *w)
{
    pal_body_def *def = &w->scene->body[0];
    w->voxels = *def->mesh;
    memset(&w->voxels.hexes, 0, sizeof w->voxels.hexes);
    if (def->mesh->hexes.n_hex == 0 && !pal_hexes_find(&def->mesh->tets, &w->voxels.hexes, NULL))
        def->mesh = &w->voxels;
}

/* Share of the volume in cut voxels, whose error changes from mesh to mesh without a definite order. */
static double cut_share(const pal_hexes *hexes)
{
    double cut = 0, all = 0;
    for (int e = 0; e < hexes->n_hex; e++) {
        all += (double)hexes->fill[e];
        if ((double)hexes->fill[e] < PAL_WHOLE_FILL) cut += (double)hexes->fill[e];
    }
    return all > 0 ? cut / all : 0;
}

static bool is_thin(const pal_tets *tets)
{
    double min = INFINITY;
    for (int c = 0; c < 3; c++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < tets->n_node; i++)
            low = fmin(low, tets->x[3 * i + c]), high = fmax(high, tets->x[3 * i + c]);
        min = fmin(min, high - low);
    }
    return min < PAL_FEW_ACROSS * tets->edge_m;
}

/* a mesh or law that is not available leaves its part of the error unknown */
static pal_err make_rests(pal_estimation *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    pal_body_def *def = &w->scene->body[0];
    const char *element = NULL, *law = NULL;
    pal_diagnostic diag = {""};
    w->springs = !strcmp(def->model.name, "tet_springs");
    if (!w->springs && strcmp(def->model.name, "fem")) {
        pal_estimate_remark(w->diag, "discretisation and model: not known of control cells");
        return PAL_ERR_OK;
    }
    if (w->springs) find_voxels(w);
    bool hexes = def->mesh->hexes.n_hex > 0;
    if (w->springs) element = hexes ? "hex8_bbar" : "tet4", law = "corotational";
    const char *is = element ? element : pal_estimate_model_text(def, "element", hexes ? "hex8_bbar" : "tet4");
    w->locks = (!strcmp(is, "tet4") || !strcmp(is, "hex8")) && nearly_incompressible(def);
    pal_err err = pal_rest_solution_make(w->scene, body, element, law, &diag, &w->fine);
    if (err) {
        pal_estimate_remark(w->diag, diag.text);
        return err == PAL_ERR_MEMORY ? err : PAL_ERR_OK;
    }
    if (pal_estimate_stopped(w)) return PAL_ERR_STATE;
    err = pal_rest_solution_coarser(w->scene, body, element, law, &diag, &w->coarse);
    if (err) pal_estimate_remark(w->diag, diag.text);
    if (pal_estimate_stopped(w)) return PAL_ERR_STATE;
    w->cut = !err && cut_share(&def->mesh->hexes) > PAL_MUCH_CUT;
    w->thin = !err && hexes && is_thin(&def->mesh->tets);
    /* without it the order is not tested */
    if (!err) (void)pal_rest_solution_coarser(w->coarse.scene, body, NULL, NULL, NULL, &w->coarsest);
    if (pal_estimate_stopped(w)) return PAL_ERR_STATE;
    if (w->skinned) PAL_TRY(pal_display_error_make(&w->fine, &w->coarse, &w->coarsest, &w->shown));
    bool neo = !strcmp(pal_estimate_model_text(def, "law", ""), "neo_hookean");
    if (!w->springs && !neo && pal_rest_solution_make(w->scene, body, NULL, "neo_hookean", &diag, &w->model))
        pal_estimate_remark(w->diag, diag.text);
    return PAL_ERR_OK;
}

static pal_err take_state(pal_estimation *w)
{
    const pal_body *body = pal_world_body(w->live, 0);
    size_t n = 3 * (size_t)body->n_dof;
    pal_estimate_state *s = &w->state;
    *s = (pal_estimate_state){.n_dof = body->n_dof, .n_node = body->n_node};
    s->x = malloc(n * sizeof(double)), s->v = malloc(n * sizeof(double));
    s->load = malloc(3 * sizeof(double) * (size_t)body->n_node);
    s->borne = malloc(3 * sizeof(double) * (size_t)body->n_node);
    s->external_force = calloc(3 * (size_t)body->n_node, sizeof(double));
    w->first = malloc(n * sizeof(double)), w->second = malloc(n * sizeof(double));
    for (int i = 0; i < pal_world_component_count(w->live); i++) {
        const pal_effect *effect = pal_world_component(w->live, i)->effect;
        if (effect->stage != PAL_STAGE_FORCE || s->n_component == PAL_ESTIMATE_COMPONENTS) continue;
        s->component[s->n_component] = effect->name;
        s->component_enabled[s->n_component++] = true;
    }
    return s->x && s->v && s->load && s->external_force && s->borne && w->first && w->second ? PAL_ERR_OK
                                                                                             : PAL_ERR_MEMORY;
}

static pal_err open_work(pal_estimation *w, const pal_scene *scene, int body, pal_diagnostic *diag)
{
    PAL_TRY(make_scene(w, scene, body, diag));
    pal_configuration_of(scene, body, &w->prediction.configuration);
    w->prediction.scene = w->scene, w->prediction.body = 0;
    PAL_TRY(make_live(w, diag));
    if (pal_world_body(w->live, 0)->active)
        return pal_diagnostic_set(
            diag, PAL_ERR_REFUSED,
            "body \"%s\" is refined while it runs: its error is not estimated (`palpate study` measures "
            "it against its finest level)",
            w->scene->body[0].name);
    PAL_TRY(take_state(w));
    PAL_TRY(make_rests(w));
    return pal_estimate_stopped(w) ? PAL_ERR_STATE : PAL_ERR_OK;
}

pal_err pal_estimation_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_diagnostic *diag,
                            pal_estimation **out)
{
    pal_estimation *w = calloc(1, sizeof *w);
    if (!w) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for an estimator");
    w->stop = stop;
    pal_err err = open_work(w, scene, body, diag);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "no memory for the worlds of an estimator");
    if (err)
        pal_estimation_close(w);
    else
        *out = w;
    return err;
}

void pal_estimation_close(pal_estimation *w)
{
    if (!w) return;
    pal_world_destroy(w->live);
    pal_world_destroy(w->exact);
    pal_rest_solution_free(&w->fine), pal_rest_solution_free(&w->coarse), pal_rest_solution_free(&w->coarsest);
    pal_rest_solution_free(&w->model);
    pal_display_error_free(&w->shown);
    pal_hexes_free(&w->voxels.hexes);
    free(w->scene), free(w->exact_scene);
    free(w->state.x), free(w->state.v), free(w->state.load), free(w->state.external_force), free(w->state.borne);
    free(w->first), free(w->second);
    pal_estimate_hierarchy_free(&w->family);
    free(w);
}

pal_estimate_state *pal_estimation_state(pal_estimation *work)
{
    return &work->state;
}
