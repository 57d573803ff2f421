/* Scene defaults and checks. */
#include "server/sim/core/definition.h"

#include "server/base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

const char *const pal_instrument_names[PAL_INSTRUMENT_COUNT + 1] = {"ball",     "probe", "grasper",
                                                                    "scissors", "hook",  "retractor"};

void pal_scene_default(pal_scene *scene)
{
    memset(scene, 0, sizeof *scene);
    snprintf(scene->name, sizeof scene->name, "organ");
    snprintf(scene->title, sizeof scene->title, "Organ");
    scene->step_s = 1.0 / 60;
    scene->up[2] = 1;
    scene->gravity_m_s2 = 9.81;
    scene->max_substep = 2000;
}

void pal_body_default(pal_body_def *body, const char *name, const pal_prepared *mesh)
{
    static const char *const effects[] = {"gravity", "tool_push", "tool_grasp", "finite_guard"};
    memset(body, 0, sizeof *body);
    snprintf(body->name, sizeof body->name, "%s", name);
    body->mesh = mesh;
    body->material = (pal_material){.young_Pa = 5000,
                                    .poisson = 0.45,
                                    .density_kg_m3 = 1000,
                                    .damping_1_s = PAL_DAMPING_DERIVED,
                                    .damping_ratio = 1};
    pal_entry_init(&body->model, "model", "tet_springs");
    pal_entry_init(&body->solver, "solver", "");
    pal_entry_init(&body->output, "output", "skin_output");
    body->n_support = 1;
    body->support[0] = (pal_support_def){.lowest = true, .fraction = 0.05};
    body->n_effect = (int)(sizeof effects / sizeof effects[0]);
    for (int i = 0; i < body->n_effect; i++) {
        char path[PAL_ENTRY_TEXT];
        snprintf(path, sizeof path, "effects[%d]", i);
        pal_entry_init(&body->effect[i], path, effects[i]);
    }
}

void pal_body_default_cells(pal_body_def *body, const char *name, const pal_prepared *mesh, const pal_cells *cells)
{
    pal_body_default(body, name, mesh);
    body->cells = cells;
    pal_entry_init(&body->model, "model", "subdivision_fem");
    pal_entry_init(&body->output, "output", "surface_output");
}

void pal_tools_default(pal_scene *scene, int n_tool)
{
    if (n_tool > PAL_TOOL_MAX) n_tool = PAL_TOOL_MAX;
    scene->n_tool = n_tool;
    for (int i = 0; i < n_tool; i++) {
        scene->tool[i] = (pal_tool_def){.radius_m = 0, .force_cap_N = 15};
        snprintf(scene->tool[i].name, sizeof scene->tool[i].name, "probe %d", i + 1);
    }
}

pal_err pal_material_check(pal_material *material, pal_diagnostic *diag)
{
    const bool derived = material->damping_1_s == PAL_DAMPING_DERIVED;
    const struct {
        const char *key;
        double value, low, high;
    } range[] = {{"young_Pa", material->young_Pa, PAL_YOUNG_MIN_PA, PAL_YOUNG_MAX_PA},
                 {"poisson", material->poisson, PAL_POISSON_MIN, PAL_POISSON_MAX},
                 {"density_kg_m3", material->density_kg_m3, PAL_DENSITY_MIN_KG_M3, PAL_DENSITY_MAX_KG_M3},
                 {"damping_1_s", derived ? 0 : material->damping_1_s, 0, PAL_NUMBER_MAX},
                 {"damping_ratio", material->damping_ratio, 0, PAL_FACTOR_MAX}};
    for (size_t i = 0; i < sizeof range / sizeof range[0]; i++)
        if (!(range[i].value >= range[i].low && range[i].value <= range[i].high))
            return PAL_REFUSE(diag, "material.%s: %g is outside [%g, %g]", range[i].key, range[i].value, range[i].low,
                              range[i].high);
    if (material->poisson > PAL_POISSON_CLAMP) {
        pal_diagnostic_set(diag, PAL_ERR_OK, "material.poisson: %g taken as %g", material->poisson, PAL_POISSON_CLAMP);
        material->poisson = PAL_POISSON_CLAMP;
    }
    return PAL_ERR_OK;
}

int pal_scene_find_body(const pal_scene *scene, const char *name)
{
    for (int b = 0; b < scene->n_body; b++)
        if (!strcmp(scene->body[b].name, name)) return b;
    return -1;
}

void pal_support_mark_fixed(const pal_support_def *support, const double up[3], const double *x, int n, uint8_t *fixed)
{
    double low = INFINITY, high = -INFINITY;
    if (support->rim) return;
    for (int i = 0; i < n && support->lowest; i++) {
        double z = pal_dot3(x + 3 * (size_t)i, up);
        low = fmin(low, z), high = fmax(high, z);
    }
    /* a hair above, so that rounding does not part nodes of one height */
    double top = low + (support->fraction + 1e-9) * (high - low);
    for (int i = 0; i < n; i++) {
        const double *p = x + 3 * (size_t)i;
        bool in = support->lowest ? pal_dot3(p, up) <= top : true;
        for (int c = 0; c < 3 && !support->lowest; c++)
            in = in && p[c] >= support->low_m[c] && p[c] <= support->high_m[c];
        if (in) fixed[i] = 1;
    }
}

pal_err pal_support_read(pal_config_entry *entry, pal_support_def *out, pal_diagnostic *diag)
{
    const bool low = pal_entry_has(entry, "low_m"), high = pal_entry_has(entry, "high_m");
    *out = (pal_support_def){.lowest = !low && !high, .fraction = 0.05};
    if (!out->lowest && pal_entry_has(entry, "lowest"))
        return PAL_REFUSE(diag, "%s: either low_m and high_m or lowest", entry->path);
    if (low != high) return PAL_REFUSE(diag, "%s: low_m and high_m belong together", entry->path);
    PAL_TRY(pal_entry_read_numbers(entry, "low_m", 3, out->low_m, diag));
    PAL_TRY(pal_entry_read_numbers(entry, "high_m", 3, out->high_m, diag));
    return pal_entry_read_number(entry, "lowest", 0, 1, &out->fraction, diag);
}

bool pal_support_of_effect(const pal_config_entry *effect, pal_support_def *out)
{
    pal_config_entry read = *effect;
    if (strcmp(effect->name, "moving_support") != 0 && strcmp(effect->name, "penalty") != 0) return false;
    return pal_support_read(&read, out, NULL) == PAL_ERR_OK;
}

void pal_body_def_mark_fixed(const pal_body_def *def, const double up[3], const double *x, int n, uint8_t *fixed)
{
    pal_support_def support;
    for (int k = 0; k < def->n_support; k++) pal_support_mark_fixed(&def->support[k], up, x, n, fixed);
    for (int k = 0; k < def->n_effect; k++)
        if (pal_support_of_effect(&def->effect[k], &support)) pal_support_mark_fixed(&support, up, x, n, fixed);
}

static pal_err check_support(const pal_body_def *body, int index, pal_diagnostic *diag)
{
    const pal_support_def *s = &body->support[index];
    if (s->lowest && s->rim)
        return PAL_REFUSE(diag, "body \"%s\" supports[%d]: both lowest and rim", body->name, index);
    if (s->rim && strcmp(body->model.name, "adaptive_springs") != 0)
        return PAL_REFUSE(diag,
                          "body \"%s\" supports[%d].boundary: only goes with model \"adaptive_springs\", not \"%s\"",
                          body->name, index, body->model.name);
    if (s->lowest && !(s->fraction >= 0 && s->fraction <= 1))
        return PAL_REFUSE(diag, "body \"%s\" supports[%d]: fraction %g is outside [0, 1]", body->name, index,
                          s->fraction);
    for (int c = 0; c < 3 && !s->lowest && !s->rim; c++)
        if (!(s->low_m[c] <= s->high_m[c]))
            return PAL_REFUSE(diag, "body \"%s\" supports[%d]: box from %g to %g", body->name, index, s->low_m[c],
                              s->high_m[c]);
    return PAL_ERR_OK;
}

pal_err pal_spring_grid_check(const pal_body_def *def, pal_diagnostic *diag)
{
    static const char *const list[3] = {"k_distance_J", "k_area_J", "k_volume_J"};
    const pal_spring_grid *g = &def->spring_grid;
    const char *name = def->name;
    double count = 1;
    if (!g->n[0] && !g->n[1] && !g->n[2] && !g->k_J[0] && !g->k_J[1] && !g->k_J[2]) return PAL_ERR_OK;
    if (strcmp(def->model.name, "tet_springs") != 0)
        return PAL_REFUSE(diag, "body \"%s\" model.grid: model \"%s\" has no springs; \"tet_springs\" takes a grid",
                          name, def->model.name);
    for (int c = 0; c < 3; c++) {
        if (g->n[c] < 1)
            return PAL_REFUSE(diag, "body \"%s\" model.grid.n[%d]: %d nodes, wanted 1 or more", name, c, g->n[c]);
        if (!isfinite(g->low_m[c]) || !isfinite(g->high_m[c]) || (g->n[c] > 1 && !(g->high_m[c] > g->low_m[c])))
            return PAL_REFUSE(diag, "body \"%s\" model.grid: low_m[%d] %g is not below high_m[%d] %g", name, c,
                              g->low_m[c], c, g->high_m[c]);
        count *= g->n[c];
    }
    if (count > PAL_SPRING_GRID_NODES_MAX)
        return PAL_REFUSE(diag, "body \"%s\" model.grid.n: %g nodes, at most %d", name, count,
                          PAL_SPRING_GRID_NODES_MAX);
    if (!g->k_J[0] && !g->k_J[1] && !g->k_J[2])
        return PAL_REFUSE(diag, "body \"%s\" model.grid: gives neither k_distance_J, k_area_J nor k_volume_J", name);
    for (int k = 0; k < 3; k++)
        for (int i = 0; g->k_J[k] && i < (int)count; i++)
            if (!(g->k_J[k][i] >= 1e-60 && g->k_J[k][i] <= 1e60))
                return PAL_REFUSE(diag, "body \"%s\" model.grid.%s[%d]: %g is outside [1e-60, 1e+60]", name, list[k], i,
                                  g->k_J[k][i]);
    return PAL_ERR_OK;
}

/* control cells and strokes: of model subdivision_fem alone */
static pal_err check_cells(const pal_body_def *body, pal_diagnostic *diag)
{
    bool solid = !strcmp(body->model.name, "subdivision_fem");
    pal_diagnostic reason = {{0}};
    if (solid && (!body->cells || body->cells->n_cell < 1))
        return PAL_REFUSE(diag, "body \"%s\" model: \"subdivision_fem\" works on control cells, and the body has none",
                          body->name);
    if (!solid && body->cells)
        return PAL_REFUSE(diag, "body \"%s\" model: \"%s\" does not take control cells; \"subdivision_fem\" does",
                          body->name, body->model.name);
    if (body->n_stroke < 0 || body->n_stroke > PAL_STROKE_MAX)
        return PAL_REFUSE(diag, "body \"%s\": %d strokes, at most %d", body->name, body->n_stroke, PAL_STROKE_MAX);
    if (!solid && body->n_stroke > 0)
        return PAL_REFUSE(diag, "body \"%s\" strokes: model \"%s\" cannot be painted; \"subdivision_fem\" can",
                          body->name, body->model.name);
    for (int i = 0; i < body->n_stroke; i++)
        if (pal_stroke_check(&body->stroke[i], &reason))
            return PAL_REFUSE(diag, "body \"%s\" strokes[%d].%s", body->name, i, reason.text);
    return PAL_ERR_OK;
}

static pal_err check_body(const pal_scene *scene, int index, pal_diagnostic *diag)
{
    const pal_body_def *body = &scene->body[index];
    if (!body->name[0]) return PAL_REFUSE(diag, "bodies[%d]: no name", index);
    for (int i = 0; i < index; i++)
        if (!strcmp(scene->body[i].name, body->name))
            return PAL_REFUSE(diag, "bodies[%d]: the name \"%s\" is there twice", index, body->name);
    bool adaptive = !strcmp(body->model.name, "adaptive_springs");
    if (!body->mesh || (body->mesh->tets.n_node < 1 && body->mesh->surface.n_tri < 1))
        return PAL_REFUSE(diag, "body \"%s\": no mesh", body->name);
    if (adaptive && body->mesh->surface.n_tri < 1)
        return PAL_REFUSE(diag, "body \"%s\" model: \"adaptive_springs\" works on the surface, and the mesh has none",
                          body->name);
    PAL_TRY(check_cells(body, diag));
    if (!adaptive && !body->cells && body->mesh->tets.n_node < 1)
        return PAL_REFUSE(diag,
                          "body \"%s\" model: \"%s\" works on tetrahedra, and the mesh is a surface alone (made for "
                          "\"adaptive_springs\")",
                          body->name, body->model.name);
    if (body->n_support < 0 || body->n_support > PAL_SUPPORT_MAX || body->n_effect < 0 ||
        body->n_effect > PAL_ENTRIES_MAX)
        return PAL_REFUSE(diag, "body \"%s\": %d supports, %d effects, at most %d and %d", body->name, body->n_support,
                          body->n_effect, PAL_SUPPORT_MAX, PAL_ENTRIES_MAX);
    if (body->n_region < 0 || body->n_region > PAL_REGION_MAX)
        return PAL_REFUSE(diag, "body \"%s\": %d regions, at most %d", body->name, body->n_region, PAL_REGION_MAX);
    for (int i = 0; i < body->n_support; i++) PAL_TRY(check_support(body, i, diag));
    for (int i = 0; i < body->n_region; i++) PAL_TRY(pal_region_check(body, i, diag));
    PAL_TRY(pal_spring_grid_check(body, diag));
    pal_material material = body->material;
    pal_diagnostic reason = {{0}};
    if (pal_material_check(&material, &reason)) return PAL_REFUSE(diag, "body \"%s\" %s", body->name, reason.text);
    return PAL_ERR_OK;
}

pal_err pal_scene_check(const pal_scene *scene, pal_diagnostic *diag)
{
    if (!(scene->step_s >= PAL_STEP_MIN_S && scene->step_s <= PAL_STEP_MAX_S))
        return PAL_REFUSE(diag, "step_s: %g is outside [1e-4, 0.1]", scene->step_s);
    double up2 = scene->up[0] * scene->up[0] + scene->up[1] * scene->up[1] + scene->up[2] * scene->up[2];
    if (!(fabs(up2 - 1) < 1e-3)) return PAL_REFUSE(diag, "up: length %g, wanted a unit vector", sqrt(up2));
    const char *fault = pal_anatomical_axes_fault(scene->anatomical_axes);
    if (fault) return PAL_REFUSE(diag, "anatomical_axes: %s %s", scene->anatomical_axes, fault);
    if (!(fabs(scene->gravity_m_s2) <= 1e4))
        return PAL_REFUSE(diag, "gravity_m_s2: %g is outside [-1e4, 1e4]", scene->gravity_m_s2);
    if (scene->max_substep < 1 || scene->max_substep > 1000000)
        return PAL_REFUSE(diag, "max_substep: %d is outside [1, 1000000]", scene->max_substep);
    if (scene->n_body < 1 || scene->n_body > PAL_BODY_MAX)
        return PAL_REFUSE(diag, "bodies: %d, wanted 1 to %d", scene->n_body, PAL_BODY_MAX);
    if (scene->n_tool < 0 || scene->n_tool > PAL_TOOL_MAX)
        return PAL_REFUSE(diag, "tools: %d, wanted 0 to %d", scene->n_tool, PAL_TOOL_MAX);
    for (int i = 0; i < scene->n_body; i++) PAL_TRY(check_body(scene, i, diag));
    for (int i = 0; i < scene->n_tool; i++) {
        const pal_tool_def *tool = &scene->tool[i];
        if (!(tool->radius_m >= 0 && tool->radius_m <= PAL_NUMBER_MAX))
            return PAL_REFUSE(diag, "tools[%d].radius_m: %g is not a radius", i, tool->radius_m);
        if (!(tool->force_cap_N > 0 && tool->force_cap_N <= 1e9))
            return PAL_REFUSE(diag, "tools[%d].force_cap_N: %g is outside (0, 1e9]", i, tool->force_cap_N);
    }
    return PAL_ERR_OK;
}
