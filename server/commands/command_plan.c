/* `palpate plan`: the components of a scene, the entry that calls for each, their memory and their time on this
 * machine; the effects that are absent and what would call for them. The time is the median over up to 60 steps, or as
 * many as fit into two seconds, of a body at rest that is kept awake. */
#include "server/base/clock.h"
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/preflight_report.h"
#include "server/commands/scene_input.h"
#include "server/num/median.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "server/sim/surface/adaptive_surface.h"
#include "server/sim/world/world.h"

#include <math.h>
#include <stdio.h>
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

/* The effects that a model adds are in the table; of the others the stage determines which entry adds them, so that a
 * new effect needs no line here. */

static const struct {
    const char *name, *words;
} of_model[] = {{"edge_distance", "model \"tet_springs\""},
                {"face_area", "model \"tet_springs\" with k_area_J not 0"},
                {"tet_volume", "model \"tet_springs\""},
                {"tet_elastic", "model \"fem\" with element \"tet4\" or \"tet10\""},
                {"hex_elastic", "model \"fem\" with element \"hex8_bbar\" or \"hex8\""},
                {"cell_elastic", "model \"subdivision_fem\""},
                {"edge_spring", "model \"adaptive_springs\""},
                {"shape_spring", "model \"adaptive_springs\" with k_shape_N_m not 0"},
                {"refine", "model \"adaptive_springs\" with more than one level"},
                {"viscous", "material.damping_1_s not 0"}};

/* "an entry \"gravity\" in effects"; returns text */
static const char *effect_words(const char *name, char text[128])
{
    const pal_effect *effect = pal_effect_find(name);
    for (size_t i = 0; i < sizeof of_model / sizeof of_model[0]; i++)
        if (!strcmp(of_model[i].name, name)) return of_model[i].words;
    if (effect && effect->stage == PAL_STAGE_SOLVE)
        snprintf(text, 128, "solver \"%s\"", name);
    else if (effect && effect->stage == PAL_STAGE_OUTPUT && strcmp(name, "field_output") != 0)
        snprintf(text, 128, "output \"%s\"", name);
    else
        snprintf(text, 128, "an entry \"%s\" in effects", name);
    return text;
}

/* has any body of the world a component of the effect? */
static bool has_component(const pal_world *world, const char *name)
{
    pal_component_info component;
    for (int r = 0; r < pal_world_component_count(world); r++) {
        pal_world_component_info(world, r, &component);
        if (!strcmp(component.name, name)) return true;
    }
    return false;
}

/* how the body's solver is preconditioned; NULL: not at all */
static cJSON *preconditioner_json(const pal_world *world, int body)
{
    pal_solve_report report;
    if (!pal_world_solve_report(world, body, &report) || !report.preconditioner) return NULL;
    return PAL_JSON({"kind", JSON_TEXT(report.preconditioner)}, {"reason", JSON_TEXT(report.preconditioner_reason)});
}

static cJSON *body_json(const pal_body_def *def, const pal_body *b)
{
    const pal_adaptive_surface *adaptive = b->model.adaptive;
    const pal_subdivision_solid *solid = b->model.solid;
    int n_tri = solid ? b->display.surface->n_tri : def->mesh->surface.n_tri;
    cJSON *body = PAL_JSON({"name", JSON_TEXT(def->name)}, {"triangles", JSON_NUMBER(n_tri)});
    if (adaptive) {
        /* nodes and springs that are active, and of every level */
        cJSON *list = cJSON_CreateArray();
        for (int l = 0; l < adaptive->levels.n_level; l++)
            cJSON_AddItemToArray(list, PAL_JSON({"nodes", JSON_NUMBER(adaptive->levels.n_vertex[l])},
                                                {"springs", JSON_NUMBER(pal_levels_n_edge(&adaptive->levels, l))}));
        return PAL_JSON_ADD(body, {"nodes", JSON_NUMBER(adaptive->n_node)},
                            {"springs", JSON_NUMBER(adaptive->n_spring)}, {"levels", list});
    }
    if (!solid)
        return PAL_JSON_ADD(body, {"tets", JSON_NUMBER(def->mesh->tets.n_tet)},
                            {"nodes", JSON_NUMBER(def->mesh->tets.n_node)});
    const pal_cell_elements *e = &solid->elements;
    return PAL_JSON_ADD(body, {"control_cells", JSON_NUMBER(def->cells->n_cell)},
                        {"control_points", JSON_NUMBER(b->n_dof)}, {"levels", JSON_NUMBER(solid->subdivision.n_level)},
                        {"elements", JSON_NUMBER(pal_cell_elements_count(e))},
                        {"cubic_percent", JSON_NUMBER(pal_cell_elements_percent(e, PAL_CELL_CUBIC))},
                        {"hex_percent", JSON_NUMBER(pal_cell_elements_percent(e, PAL_CELL_HEX))},
                        {"pyramid_percent", JSON_NUMBER(pal_cell_elements_percent(e, PAL_CELL_PYRAMID))},
                        {"nodes", JSON_NUMBER(b->n_node)}, {"solid_bytes", JSON_NUMBER(solid->n_byte)});
}

/* the effects that no component of this scene is of */
static cJSON *absent_json(const pal_world *world)
{
    char words[128];
    cJSON *absent = cJSON_CreateArray();
    for (int i = 0; i < PAL_EFFECT_COUNT; i++) {
        const char *name = pal_effects[i]->name;
        if (!has_component(world, name))
            cJSON_AddItemToArray(
                absent, PAL_JSON({"name", JSON_TEXT(name)}, {"called_by", JSON_TEXT(effect_words(name, words))}));
    }
    return absent;
}

/* the configuration that was picked from the study; NULL: none */
static cJSON *picked_json(const pal_studied_scene *studied)
{
    char text[PAL_CONFIGURATION_TEXT];
    if (studied->picked < 0) return NULL;
    const pal_measured_configuration *p = &studied->file->study.point[studied->picked].measured;
    return PAL_JSON({"body", JSON_TEXT(studied->scene->body[studied->body].name)},
                    {"configuration", JSON_TEXT(pal_configuration_text(&p->configuration, text))},
                    {"ms", JSON_NUMBER(p->ms)}, {"error_m", JSON_NUMBER(p->error_m)});
}

static cJSON *as_json(const pal_studied_scene *studied, pal_world *world, cost *c)
{
    const pal_scene *scene = studied->scene;
    double step_ms = pal_median(c->step_ms, c->n_step);
    cJSON *bodies = cJSON_CreateArray(), *components = cJSON_CreateArray();
    for (int b = 0; b < scene->n_body; b++)
        cJSON_AddItemToArray(bodies, PAL_JSON_ADD(body_json(&scene->body[b], pal_world_body(world, b)),
                                                  {"preconditioner", preconditioner_json(world, b)}));
    for (int k = 0; k < pal_world_component_count(world); k++) {
        pal_component_info info;
        pal_world_component_info(world, k, &info);
        cJSON_AddItemToArray(components,
                             PAL_JSON({"name", JSON_TEXT(info.name)}, {"body", JSON_TEXT(info.body)},
                                      {"stage", JSON_TEXT(info.stage)}, {"bytes", JSON_NUMBER(info.n_byte)},
                                      {"ms", JSON_NUMBER(component_ms(c, k))}, {"reason", JSON_TEXT(info.reason)}));
    }
    return PAL_JSON({"ok", JSON_BOOL(true)}, {"name", JSON_TEXT(scene->name)},
                    {"study_warning", studied->warn[0] ? JSON_TEXT(studied->warn) : NULL},
                    {"picked", picked_json(studied)}, {"step_s", JSON_NUMBER(scene->step_s)},
                    {"substeps", JSON_NUMBER(pal_world_substeps(world))},
                    {"limit_s", JSON_NUMBER(pal_world_limit_s(world))}, {"steps_measured", JSON_NUMBER(c->n_step)},
                    {"step_ms", JSON_NUMBER(step_ms)}, {"load", JSON_NUMBER(1e-3 * step_ms / scene->step_s)},
                    {"world_bytes", JSON_NUMBER(pal_world_bytes(world))}, {"bodies", bodies},
                    {"components", components}, {"absent", absent_json(world)});
}

static void print_body(const pal_body_def *def, const pal_body *b)
{
    const pal_adaptive_surface *adaptive = b->model.adaptive;
    const pal_subdivision_solid *solid = b->model.solid;
    if (adaptive) {
        const pal_levels *levels = &adaptive->levels;
        printf("%s: an adaptive surface, %d nodes and %d springs active of\n", def->name, adaptive->n_node,
               adaptive->n_spring);
        for (int l = 0; l < levels->n_level; l++)
            printf("  level %d: %d nodes, %d springs\n", l, levels->n_vertex[l], pal_levels_n_edge(levels, l));
    } else if (solid) {
        const pal_cell_elements *e = &solid->elements;
        int n_level = solid->subdivision.n_level;
        printf("%s: %d control cells (#CC), after %d level%s %d elements (#FE): %.0f %% cubic, %.0f %% hexahedra, %.0f "
               "%% pyramids\n",
               def->name, def->cells->n_cell, n_level, n_level == 1 ? "" : "s", pal_cell_elements_count(e),
               pal_cell_elements_percent(e, PAL_CELL_CUBIC), pal_cell_elements_percent(e, PAL_CELL_HEX),
               pal_cell_elements_percent(e, PAL_CELL_PYRAMID));
        printf("  %d control points carry %d nodes, %d surface triangles; the solid takes %.1f MB\n", b->n_dof,
               b->n_node, b->display.surface->n_tri, 1e-6 * (double)solid->n_byte);
    } else {
        printf("%s: %d tetrahedra, %d nodes, %d surface triangles\n", def->name, def->mesh->tets.n_tet,
               def->mesh->tets.n_node, def->mesh->surface.n_tri);
    }
}

static void print_preconditioner(const pal_world *world, int body)
{
    pal_solve_report report;
    if (!pal_world_solve_report(world, body, &report) || !report.preconditioner) return;
    printf("  preconditioner: %s, %s\n", report.preconditioner,
           report.preconditioner_reason[0] ? report.preconditioner_reason : "as the scene asks");
}

static void print(const pal_studied_scene *studied, pal_world *world, cost *c)
{
    const pal_scene *scene = studied->scene;
    if (studied->summary[0]) printf("%s\n", studied->summary);
    if (studied->warn[0]) printf("%s\n", studied->warn);
    for (int b = 0; b < scene->n_body; b++) {
        print_body(&scene->body[b], pal_world_body(world, b));
        print_preconditioner(world, b);
    }
    printf("\n%-9s %-16s %-16s %10s %10s  %s\n", "stage", "component", "body", "kB", "ms a step", "called for by");
    for (int k = 0; k < pal_world_component_count(world); k++) {
        pal_component_info info;
        pal_world_component_info(world, k, &info);
        printf("%-9s %-16s %-16s %10.1f %10.4f  %s\n", info.stage, info.name, info.body, 1e-3 * (double)info.n_byte,
               component_ms(c, k), info.reason);
    }
    char words[128];
    printf("\n%-52s %s\n", "absent: no component, no memory, no time", "called for by");
    for (int i = 0; i < PAL_EFFECT_COUNT; i++)
        if (!has_component(world, pal_effects[i]->name))
            printf("  %-50s %s\n", pal_effects[i]->name, effect_words(pal_effects[i]->name, words));
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
        .operands = {1, 1}};
    pal_flag_common common;
    const char *word[1];
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    pal_scene_input input = {0};
    pal_world *world = NULL;
    pal_diagnostic diag = {""};
    static cost measured;
    pal_err err = pal_scene_input_open(word[0], &input, &diag);
    const pal_scene *scene = input.studied.scene;
    pal_preflight preflight = {0};
    if (!err) {
        err = pal_world_create(scene, &diag, &world);
        if (!err) err = pal_preflight_run(scene, &preflight, &diag);
        pal_diagnostic_prefix(&diag, err, word[0]);
    }
    pal_report_progress("measure", 0, &common);
    if (!err) err = measure(world, scene->step_s, &measured);
    code = pal_report_end(&common, err, &diag,
                          err || !common.json ? NULL
                                              : PAL_JSON_ADD(as_json(&input.studied, world, &measured),
                                                             {"preflight", pal_preflight_json(&preflight)}));
    if (!err && !common.json && !common.quiet) {
        print(&input.studied, world, &measured);
        pal_preflight_print(&preflight, pal_median(measured.step_ms, measured.n_step));
    }
    pal_world_destroy(world);
    pal_scene_input_close(&input);
    return code;
}
