/* `palpate plan`: the components of a scene, the entry that calls for each, their memory and their time on this
 * machine; the effects that are absent and what would call for them. The time is the median over up to 60 steps, or as
 * many as fit into two seconds, of a body at rest that is kept awake. */
#include "server/base/clock.h"
#include "server/cli/flags.h"
#include "server/cli/median.h"
#include "server/commands/commands.h"
#include "server/commands/plan_reasons.h"
#include "server/commands/preflight_report.h"
#include "server/commands/scene_input.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "server/sim/surface/adaptive_surface.h"
#include "server/sim/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS = 60, MAX_S = 2 };

typedef struct cost {
    int n_step;
    double component_ms[PAL_FRAME_COMPONENT_MAX][STEPS], step_ms[STEPS];
} cost;

static pal_err measure(pal_world *world, double step_s, cost *out)
{
    double start = pal_clock_s();
    for (int k = 0; k < STEPS && (k < 2 || pal_clock_s() - start < MAX_S); k++, out->n_step++) {
        pal_world_wake(world);
        uint64_t before = pal_clock_thread_ns(), began = pal_clock_ns();
        PAL_TRY(pal_world_step(world, step_s));
        out->step_ms[k] = 1e-6 * (double)(pal_clock_thread_ns() - before);
        /* the world times components by wall clock, which includes other processes: scale to processor time */
        double wall_ms = 1e-6 * (double)(pal_clock_ns() - began),
               share = fmin(out->step_ms[k] / fmax(wall_ms, 1e-6), 1);
        for (int c = 0; c < pal_world_component_count(world) && c < PAL_FRAME_COMPONENT_MAX; c++) {
            pal_component_info info;
            pal_world_component_info(world, c, &info);
            out->component_ms[c][k] = share * 1e-6 * (double)info.spent_ns;
        }
    }
    return PAL_ERR_OK;
}

static double component_ms(cost *c, int component)
{
    return component < PAL_FRAME_COMPONENT_MAX ? pal_median(c->component_ms[component], c->n_step) : 0;
}

/* nodes and springs that are active, and of every level */
static void add_levels(cJSON *body, const pal_adaptive_surface *adaptive)
{
    const pal_levels *levels = &adaptive->levels;
    cJSON_AddNumberToObject(body, "nodes", adaptive->n_node);
    cJSON_AddNumberToObject(body, "springs", adaptive->n_spring);
    cJSON *list = cJSON_AddArrayToObject(body, "levels");
    for (int l = 0; l < levels->n_level; l++) {
        cJSON *level = cJSON_CreateObject();
        cJSON_AddItemToArray(list, level);
        cJSON_AddNumberToObject(level, "nodes", levels->n_vertex[l]);
        cJSON_AddNumberToObject(level, "springs", pal_levels_n_edge(levels, l));
    }
}

static void add_solid(cJSON *body, const pal_body_def *def, const pal_body *b)
{
    const pal_subdivision_solid *solid = b->model.solid;
    static const char *const kind[PAL_CELL_KINDS] = {"cubic_percent", "hex_percent", "pyramid_percent"};
    cJSON_AddNumberToObject(body, "control_cells", def->cells->n_cell);
    cJSON_AddNumberToObject(body, "control_points", b->n_dof);
    cJSON_AddNumberToObject(body, "levels", solid->subdivision.n_level);
    cJSON_AddNumberToObject(body, "elements", pal_cell_elements_count(&solid->elements));
    for (int k = 0; k < PAL_CELL_KINDS; k++)
        cJSON_AddNumberToObject(body, kind[k], pal_cell_elements_percent(&solid->elements, (pal_cell_kind)k));
    cJSON_AddNumberToObject(body, "nodes", b->n_node);
    cJSON_AddNumberToObject(body, "solid_bytes", (double)solid->n_byte);
}

/* the effects that no component of this scene is of */
static void add_absent(cJSON *o, const pal_world *world)
{
    cJSON *absent = cJSON_AddArrayToObject(o, "absent");
    for (int i = 0; i < PAL_EFFECT_COUNT; i++) {
        char words[128];
        const char *name = pal_effects[i]->name;
        if (pal_plan_has(world, name)) continue;
        cJSON *entry = cJSON_CreateObject();
        cJSON_AddItemToArray(absent, entry);
        cJSON_AddStringToObject(entry, "name", name);
        cJSON_AddStringToObject(entry, "called_by", pal_effect_words(name, words));
    }
}

/* the configuration that was picked from the study */
static void add_configuration(cJSON *o, const pal_studied_scene *studied)
{
    char text[PAL_CONFIGURATION_TEXT];
    if (studied->warn[0]) cJSON_AddStringToObject(o, "study_warning", studied->warn);
    if (studied->picked < 0) return;
    const pal_measured_configuration *p = &studied->file->study.point[studied->picked].measured;
    cJSON *picked = cJSON_AddObjectToObject(o, "picked");
    cJSON_AddStringToObject(picked, "body", studied->scene->body[studied->body].name);
    cJSON_AddStringToObject(picked, "configuration", pal_configuration_text(&p->setting, text));
    cJSON_AddNumberToObject(picked, "ms", p->ms);
    cJSON_AddNumberToObject(picked, "error_m", p->error_m);
}

static cJSON *as_json(const pal_studied_scene *studied, pal_world *world, cost *c)
{
    const pal_scene *scene = studied->scene;
    cJSON *o = cJSON_CreateObject();
    double step_ms = pal_median(c->step_ms, c->n_step);
    cJSON_AddBoolToObject(o, "ok", true);
    cJSON_AddStringToObject(o, "name", scene->name);
    add_configuration(o, studied);
    cJSON_AddNumberToObject(o, "step_s", scene->step_s);
    cJSON_AddNumberToObject(o, "substeps", pal_world_substeps(world));
    cJSON_AddNumberToObject(o, "limit_s", pal_world_limit_s(world));
    cJSON_AddNumberToObject(o, "steps_measured", c->n_step);
    cJSON_AddNumberToObject(o, "step_ms", step_ms);
    cJSON_AddNumberToObject(o, "load", 1e-3 * step_ms / scene->step_s);
    cJSON_AddNumberToObject(o, "world_bytes", (double)pal_world_bytes(world));
    cJSON *bodies = cJSON_AddArrayToObject(o, "bodies");
    for (int b = 0; b < scene->n_body; b++) {
        cJSON *body = cJSON_CreateObject();
        cJSON_AddItemToArray(bodies, body);
        cJSON_AddStringToObject(body, "name", scene->body[b].name);
        const pal_body *moving = pal_world_body(world, b);
        if (moving->model.adaptive) {
            add_levels(body, moving->model.adaptive);
        } else if (moving->model.solid) {
            add_solid(body, &scene->body[b], moving);
        } else {
            cJSON_AddNumberToObject(body, "tets", scene->body[b].mesh->tets.n_tet);
            cJSON_AddNumberToObject(body, "nodes", scene->body[b].mesh->tets.n_node);
        }
        cJSON_AddNumberToObject(body, "triangles",
                                moving->model.solid ? moving->surface->n_tri : scene->body[b].mesh->surface.n_tri);
    }
    cJSON *list = cJSON_AddArrayToObject(o, "components");
    for (int k = 0; k < pal_world_component_count(world); k++) {
        pal_component_info info;
        cJSON *entry = cJSON_CreateObject();
        pal_world_component_info(world, k, &info);
        cJSON_AddItemToArray(list, entry);
        cJSON_AddStringToObject(entry, "name", info.name);
        cJSON_AddStringToObject(entry, "body", info.body);
        cJSON_AddStringToObject(entry, "stage", info.stage);
        cJSON_AddNumberToObject(entry, "bytes", (double)info.n_byte);
        cJSON_AddNumberToObject(entry, "ms", component_ms(c, k));
        cJSON_AddStringToObject(entry, "reason", info.reason);
    }
    add_absent(o, world);
    return o;
}

static void print_shell(const char *name, const pal_adaptive_surface *adaptive)
{
    const pal_levels *levels = &adaptive->levels;
    printf("%s: an adaptive surface, %d nodes and %d springs active of\n", name, adaptive->n_node, adaptive->n_spring);
    for (int l = 0; l < levels->n_level; l++)
        printf("  level %d: %d nodes, %d springs\n", l, levels->n_vertex[l], pal_levels_n_edge(levels, l));
}

static void print_solid(const pal_body_def *def, const pal_body *b)
{
    const pal_cell_elements *e = &b->model.solid->elements;
    printf("%s: %d control cells (#CC), after %d level%s %d elements (#FE): %.0f %% cubic, %.0f %% hexahedra, %.0f %% "
           "pyramids\n",
           def->name, def->cells->n_cell, b->model.solid->subdivision.n_level,
           b->model.solid->subdivision.n_level == 1 ? "" : "s", pal_cell_elements_count(e),
           pal_cell_elements_percent(e, PAL_CELL_CUBIC), pal_cell_elements_percent(e, PAL_CELL_HEX),
           pal_cell_elements_percent(e, PAL_CELL_PYRAMID));
    printf("  %d control points carry %d nodes, %d surface triangles; the solid takes %.1f MB\n", b->n_dof, b->n_node,
           b->surface->n_tri, 1e-6 * (double)b->model.solid->n_byte);
}

static void print_absent(const pal_world *world)
{
    char words[128];
    printf("\n%-52s %s\n", "absent: no component, no memory, no time", "called for by");
    for (int i = 0; i < PAL_EFFECT_COUNT; i++)
        if (!pal_plan_has(world, pal_effects[i]->name))
            printf("  %-50s %s\n", pal_effects[i]->name, pal_effect_words(pal_effects[i]->name, words));
}

static void print(const pal_studied_scene *studied, pal_world *world, cost *c)
{
    const pal_scene *scene = studied->scene;
    if (studied->summary[0]) printf("%s\n", studied->summary);
    if (studied->warn[0]) printf("%s\n", studied->warn);
    for (int b = 0; b < scene->n_body; b++) {
        const pal_adaptive_surface *adaptive = pal_world_body(world, b)->model.adaptive;
        if (adaptive) {
            print_shell(scene->body[b].name, adaptive);
            continue;
        }
        if (pal_world_body(world, b)->model.solid) {
            print_solid(&scene->body[b], pal_world_body(world, b));
            continue;
        }
        printf("%s: %d tetrahedra, %d nodes, %d surface triangles\n", scene->body[b].name,
               scene->body[b].mesh->tets.n_tet, scene->body[b].mesh->tets.n_node, scene->body[b].mesh->surface.n_tri);
    }
    printf("\n%-9s %-16s %-16s %10s %10s  %s\n", "stage", "component", "body", "kB", "ms a step", "called for by");
    for (int k = 0; k < pal_world_component_count(world); k++) {
        pal_component_info info;
        pal_world_component_info(world, k, &info);
        printf("%-9s %-16s %-16s %10.1f %10.4f  %s\n", info.stage, info.name, info.body, 1e-3 * (double)info.n_byte,
               component_ms(c, k), info.reason);
    }
    print_absent(world);
    double step_ms = pal_median(c->step_ms, c->n_step), limit_s = pal_world_limit_s(world);
    printf("\na step of %.3f ms in %d sub-step%s", 1e3 * scene->step_s, pal_world_substeps(world),
           pal_world_substeps(world) == 1 ? "" : "s");
    if (isfinite(limit_s)) printf(" (stable up to %.3f ms each)", 1e3 * limit_s);
    printf(" takes %.3f ms here, %.0f %% of real time; the world has %.1f MB\n", step_ms,
           1e-1 * step_ms / scene->step_s, 1e-6 * (double)pal_world_bytes(world));
}

int command_plan(int argc, char **argv)
{
    const pal_flag_table table = {
        .usage = "plan SCENE [flags]",
        .about =
            "Lists the components that a scene calls for, in the order of a step, with the entry that calls for each, "
            "their\n"
            "memory and their time on this machine; the effects that are absent; and weak elements, nodes and limits.\n"
            "SCENE is a scene.json, its folder, control cells (.palcells), a surface or a scan.\n",
        .example = "palpate prepare --procedural -o organ\n"
                   "palpate plan organ/scene.json\n",
        .min_operand = 1,
        .max_operand = 1};
    pal_flag_common common;
    const char *word[1];
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    pal_scene_input input = {0};
    pal_world *world = NULL;
    pal_diagnostic diag = {""}, reason = {""};
    static cost measured;
    pal_err err = pal_scene_input_open(word[0], &input, &diag);
    const pal_scene *scene = input.studied.scene;
    pal_preflight preflight = {0};
    if (!err) {
        err = pal_world_create(scene, &reason, &world);
        if (!err) err = pal_preflight_run(scene, PAL_PREFLIGHT_FULL, &preflight, &reason);
        if (err) pal_diagnostic_set(&diag, err, "%s: %s", word[0], reason.text);
    }
    pal_report_progress("measure", 0, &common);
    if (!err) err = measure(world, scene->step_s, &measured);
    pal_report_progress(NULL, 0, &common);
    if (err) {
        code = pal_report_refusal(&common, err, &diag);
    } else if (common.json) {
        cJSON *plan = as_json(&input.studied, world, &measured);
        cJSON_AddItemToObject(plan, "preflight", pal_preflight_json(&preflight));
        code = pal_report_json(&common, plan);
    } else {
        code = 0;
        if (!common.quiet) print(&input.studied, world, &measured);
        if (!common.quiet) pal_preflight_print(&preflight, pal_median(measured.step_ms, measured.n_step));
    }
    pal_world_destroy(world);
    pal_scene_input_close(&input);
    return code;
}
