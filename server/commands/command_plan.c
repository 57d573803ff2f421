/* `palpate plan`: the rows of a scene, their memory, and what they cost on this machine: the median over up to 60 steps
 * at rest (kept from sleeping), or as many as fit into two seconds; which entry called for each row, and what is not
 * there, with the words that would call for it. Of a body that adapts all its levels, and what of them is active now;
 * of a subdivided solid its elements as in Table 1 of paper A. */
#include "server/base/clock.h"
#include "server/cli/median.h"
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/plan_reasons.h"
#include "server/commands/preflight_report.h"
#include "server/scene/scene_arg.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "server/sim/surface/adaptive_surface.h"
#include "server/sim/world/world.h"
#include "server/study/studied_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS = 60, MOST_S = 2 };

typedef struct cost {
    int n_step;
    double row_ms[PAL_FRAME_COMPONENT_MAX][STEPS], step_ms[STEPS];
} cost;

static pal_err measure(pal_world *world, double step_s, cost *out)
{
    double start = pal_clock_s();
    int n_row = pal_world_component_count(world);
    for (int k = 0; k < STEPS && (k < 2 || pal_clock_s() - start < MOST_S); k++, out->n_step++) {
        pal_world_wake(world);
        uint64_t before = pal_clock_thread_ns(), began = pal_clock_ns();
        PAL_TRY(pal_world_step(world, step_s));
        out->step_ms[k] = 1e-6 * (double)(pal_clock_thread_ns() - before);
        /* rows are timed by the wall's clock, which goes on while others have the processor: its share is ours */
        double wall_ms = 1e-6 * (double)(pal_clock_ns() - began), ours = fmin(out->step_ms[k] / fmax(wall_ms, 1e-6), 1);
        for (int r = 0; r < n_row && r < PAL_FRAME_COMPONENT_MAX; r++) {
            pal_component_info row;
            pal_world_component_info(world, r, &row);
            out->row_ms[r][k] = ours * 1e-6 * (double)row.spent_ns;
        }
    }
    return PAL_ERR_OK;
}

/* nodes and springs of every level, and of the present mixture */
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

/* elements of each kind, what moves them and what that takes */
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

/* the effects that this scene has no row of */
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
        cJSON_AddStringToObject(entry, "wants", pal_effect_words(name, words));
    }
}

/* the setting that was picked from the study, and what is to be known about that */
static void add_setting(cJSON *o, const pal_studied_scene *studied)
{
    char text[PAL_CONFIGURATION_TEXT];
    if (studied->warn[0]) cJSON_AddStringToObject(o, "study_warning", studied->warn);
    if (studied->picked < 0) return;
    const pal_measured_configuration *p = &studied->file->study.point[studied->picked].measured;
    cJSON *picked = cJSON_AddObjectToObject(o, "picked");
    cJSON_AddStringToObject(picked, "body", studied->scene->body[studied->body].name);
    cJSON_AddStringToObject(picked, "setting", pal_configuration_text(&p->setting, text));
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
    add_setting(o, studied);
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
    cJSON *rows = cJSON_AddArrayToObject(o, "rows");
    for (int r = 0; r < pal_world_component_count(world); r++) {
        pal_component_info row;
        cJSON *entry = cJSON_CreateObject();
        pal_world_component_info(world, r, &row);
        cJSON_AddItemToArray(rows, entry);
        cJSON_AddStringToObject(entry, "name", row.name);
        cJSON_AddStringToObject(entry, "body", row.body);
        cJSON_AddStringToObject(entry, "stage", row.stage);
        cJSON_AddNumberToObject(entry, "bytes", (double)row.n_byte);
        cJSON_AddNumberToObject(entry, "ms", r < PAL_FRAME_COMPONENT_MAX ? pal_median(c->row_ms[r], c->n_step) : 0);
        cJSON_AddStringToObject(entry, "why", row.reason);
    }
    add_absent(o, world);
    return o;
}

static void print_shell(const char *name, const pal_adaptive_surface *adaptive)
{
    const pal_levels *levels = &adaptive->levels;
    printf("%s: a surface that adapts, %d nodes and %d springs of\n", name, adaptive->n_node, adaptive->n_spring);
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
    printf("  %d control points carry %d nodes, %d shown triangles; the solid has %.1f MB\n", b->n_dof, b->n_node,
           b->surface->n_tri, 1e-6 * (double)b->model.solid->n_byte);
}

static void print_absent(const pal_world *world)
{
    char words[128];
    printf("\n%-52s %s\n", "not there: no row, no memory, no time", "would be called for by");
    for (int i = 0; i < PAL_EFFECT_COUNT; i++)
        if (!pal_plan_has(world, pal_effects[i]->name))
            printf("  %-50s %s\n", pal_effects[i]->name, pal_effect_words(pal_effects[i]->name, words));
}

static void print(const pal_studied_scene *studied, pal_world *world, cost *c)
{
    const pal_scene *scene = studied->scene;
    if (studied->said[0]) printf("%s\n", studied->said);
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
        printf("%s: %d tetrahedra, %d nodes, %d shown triangles\n", scene->body[b].name,
               scene->body[b].mesh->tets.n_tet, scene->body[b].mesh->tets.n_node, scene->body[b].mesh->surface.n_tri);
    }
    printf("\n%-9s %-16s %-16s %10s %10s  %s\n", "stage", "row", "body", "kB", "ms a step", "because of");
    for (int r = 0; r < pal_world_component_count(world); r++) {
        pal_component_info row;
        pal_world_component_info(world, r, &row);
        printf("%-9s %-16s %-16s %10.1f %10.4f  %s\n", row.stage, row.name, row.body, 1e-3 * (double)row.n_byte,
               r < PAL_FRAME_COMPONENT_MAX ? pal_median(c->row_ms[r], c->n_step) : 0, row.reason);
    }
    print_absent(world);
    double step_ms = pal_median(c->step_ms, c->n_step), limit_s = pal_world_limit_s(world);
    printf("\na step of %.3f ms in %d sub-step%s", 1e3 * scene->step_s, pal_world_substeps(world),
           pal_world_substeps(world) == 1 ? "" : "s");
    if (isfinite(limit_s)) printf(" (stable up to %.3f ms each)", 1e3 * limit_s);
    printf(" takes %.3f ms here, %.0f %% of real time; the world has %.1f MB\n", step_ms,
           1e-1 * step_ms / scene->step_s, 1e-6 * (double)pal_world_bytes(world));
}

static cJSON *with_preflight(cJSON *plan, const pal_preflight *preflight)
{
    cJSON_AddItemToObject(plan, "preflight", pal_preflight_json(preflight));
    return plan;
}

int command_plan(int argc, char **argv)
{
    const pal_flag_table table = {.usage = "plan SCENE [flags]",
                                  .about = "Shows the rows that a scene calls for, in the order of a step, with their "
                                           "memory and their measured cost here.\nSCENE is a scene.json, its folder, "
                                           "control cells (.palcells), or any surface or scan.\n",
                                  .min_operand = 1,
                                  .max_operand = 1};
    pal_flag_common common;
    const char *word[1];
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    pal_loaded_scene *loaded = NULL;
    pal_world *world = NULL;
    pal_diagnostic diag = {""}, reason = {""};
    static cost measured;
    pal_studied_scene studied = {0};
    pal_err err = pal_scene_arg(word[0], NULL, &loaded, NULL, NULL, &diag);
    if (!err) err = pal_studied_scene_open(word[0], &loaded->scene, &studied, &diag);
    if (!err && (err = pal_world_create(studied.scene, &reason, &world)))
        pal_diagnostic_set(&diag, err, "%s: %s", word[0], reason.text);
    pal_preflight preflight = {0};
    if (!err && (err = pal_preflight_run(studied.scene, PAL_PREFLIGHT_FULL, &preflight, &reason)))
        pal_diagnostic_set(&diag, err, "%s: %s", word[0], reason.text);
    pal_report_progress("measure", 0, &common);
    if (!err) err = measure(world, studied.scene->step_s, &measured);
    pal_report_progress(NULL, 0, &common);
    if (err)
        code = pal_report_refusal(&common, err, &diag);
    else if (common.json)
        code = pal_report_json(&common, with_preflight(as_json(&studied, world, &measured), &preflight));
    else
        code = 0;
    if (!err && !common.json && !common.quiet) {
        print(&studied, world, &measured);
        pal_preflight_print(&preflight, pal_median(measured.step_ms, measured.n_step));
    }
    pal_world_destroy(world);
    pal_studied_scene_close(&studied);
    pal_scene_free(loaded);
    return code;
}
