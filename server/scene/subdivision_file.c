/* Bodies of control cells, what is painted on them and how they are cut away. A saved scene has the cells about the
 * body's origin and the origin beside them, so that every number comes back with the same bits and boxes, strokes and
 * tools stay where they are, whatever has been cut off or added in between. */
#include "server/scene/subdivision_file.h"

#include "server/base/vec3.h"
#include "server/mesh/cells/cell_file.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/scene_keys.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PATH = 1600 };

/* the middle of the vertices' box */
static void middle_of(const pal_cells *cells, double out[3])
{
    double low[3], high[3];
    pal_box3_empty(low, high);
    for (int32_t i = 0; i < cells->n_vertex; i++) pal_box3_add(low, high, cells->x + 3 * (size_t)i);
    for (int c = 0; c < 3; c++) out[c] = 0.5 * (low[c] + high[c]);
}

/* the boundary's triangles as the body's mesh */
static pal_err make_mesh(const pal_cells *cells, const double origin_m[3], pal_prepared *out)
{
    pal_surface surface = {0};
    pal_err err = pal_cells_boundary(cells, &surface, NULL, NULL);
    if (!err) pal_copy3(surface.origin_m, origin_m);
    if (!err) err = pal_prepared_surface(&surface, out);
    pal_surface_free(&surface);
    return err;
}

pal_err pal_subdivision_load(const char *file, double unit_m, const double *origin_m, pal_loaded_scene *scene,
                             int index, pal_diagnostic *diag)
{
    pal_cells *cells = &scene->cells[index];
    double origin[3];
    pal_cells_fault fault;
    PAL_TRY(pal_cell_file_load(file, cells, diag));
    for (size_t i = 0; i < 3 * (size_t)cells->n_vertex && unit_m != 1; i++) cells->x[i] *= unit_m;
    if (origin_m)
        pal_copy3(origin, origin_m);
    else
        middle_of(cells, origin);
    for (int32_t i = 0; i < cells->n_vertex && !origin_m; i++)
        pal_sub3(cells->x + 3 * (size_t)i, cells->x + 3 * (size_t)i, origin);
    /* far from its origin a solid may have lost its shape to rounding */
    if (!pal_cells_shape_valid(cells, NULL, &fault))
        return PAL_REFUSE(diag, "%s: cell %d has no volume left about (%g, %g, %g) m", file, fault.cell + 1, origin[0],
                          origin[1], origin[2]);
    scene->scene.body[index].cells = cells;
    pal_err err = make_mesh(cells, origin, &scene->mesh[index]);
    return err ? pal_diagnostic_set(diag, err, "%s: no memory for its boundary", file) : PAL_ERR_OK;
}

pal_err pal_subdivision_update_surface(pal_loaded_scene *scene, int index, pal_diagnostic *diag)
{
    pal_prepared mesh = {0};
    if (make_mesh(&scene->cells[index], scene->mesh[index].surface.origin_m, &mesh))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "body \"%s\": no memory for its boundary",
                                  scene->scene.body[index].name);
    pal_prepared_free(&scene->mesh[index]);
    scene->mesh[index] = mesh;
    return PAL_ERR_OK;
}

pal_err pal_subdivision_read(const pal_json *at, pal_loaded_scene *scene, int index)
{
    static const char *const others[] = {"mesh", "surface", "resolution", "label", "triangles"};
    const pal_body_def *def = &scene->scene.body[index];
    char units[16] = "", file[PATH];
    double origin_m[3] = {0}, unit_m = 1;
    bool about = pal_json_has(at, "origin_m");
    for (size_t k = 0; k < sizeof others / sizeof others[0]; k++)
        if (pal_json_has(at, others[k])) return pal_json_refuse_key(at, others[k], "does not go with cells");
    PAL_TRY(pal_json_file_name(at, "cells", file, sizeof file));
    if (strcmp(def->model.name, "subdivision_fem") != 0)
        return pal_json_refuse_key(at, "cells", "model \"%s\" does not take control cells; \"subdivision_fem\" does",
                                   def->model.name);
    PAL_TRY(pal_json_text(at, "units", false, units, sizeof units));
    if (*units && !((unit_m = pal_mesh_unit_named(units)) > 0))
        return pal_json_refuse_key(at, "units", "is not m, cm, mm, um or in");
    PAL_TRY(pal_json_vector(at, "origin_m", origin_m));
    pal_diagnostic reason = {""};
    pal_err err = pal_subdivision_load(file, unit_m, about ? origin_m : NULL, scene, index, &reason);
    return pal_json_forward(at, "cells", err, &reason);
}

static pal_err read_stroke(const pal_json *at, pal_stroke *out)
{
    const char *const *known = pal_scene_keys(PAL_KEYS_STROKE, NULL);
    pal_diagnostic reason = {""};
    *out = (pal_stroke){.softness = 0.5, .young_factor = 1, .density_factor = 1};
    PAL_TRY(pal_json_object(at, known));
    for (int k = 0; k < 2; k++) PAL_TRY(pal_json_need(at, known[k]));
    PAL_TRY(pal_json_vector(at, "at_m", out->at_m));
    /* ranges are pal_stroke_check's: any number will do here */
    PAL_TRY(pal_json_number(at, "radius_m", -INFINITY, INFINITY, &out->radius_m));
    PAL_TRY(pal_json_number(at, "softness", -INFINITY, INFINITY, &out->softness));
    PAL_TRY(pal_json_number(at, "young_factor", -INFINITY, INFINITY, &out->young_factor));
    PAL_TRY(pal_json_number(at, "density_factor", -INFINITY, INFINITY, &out->density_factor));
    if (!pal_stroke_check(out, &reason)) return PAL_ERR_OK;
    return PAL_REFUSE(at->diag, "%s: %s.%s", at->file, at->path, reason.text);
}

pal_err pal_strokes_read(const pal_json *body, pal_loaded_scene *scene, int index)
{
    pal_body_def *def = &scene->scene.body[index];
    pal_json list;
    PAL_TRY(pal_json_list(body, "strokes", PAL_STROKE_MAX, &list));
    if (!list.value || !list.value->child) return PAL_ERR_OK;
    if (!pal_json_has(body, "cells"))
        return pal_json_refuse(&list, "model \"%s\" cannot be painted; \"subdivision_fem\" can", def->model.name);
    pal_stroke *stroke = calloc((size_t)cJSON_GetArraySize(list.value), sizeof *stroke);
    if (!stroke) return pal_diagnostic_set(body->diag, PAL_ERR_MEMORY, "%s: no memory for %s", body->file, list.path);
    scene->stroke[index] = stroke;
    def->stroke = stroke;
    PAL_JSON_ENTRIES (at, &list) PAL_TRY(read_stroke(&at, &stroke[def->n_stroke++]));
    return PAL_ERR_OK;
}

pal_err pal_cut_read(const pal_json *body, pal_body_def *def)
{
    const char *const *known = pal_scene_keys(PAL_KEYS_CUT, NULL);
    const pal_json at = pal_json_at(body, "cut");
    if (!at.value) return PAL_ERR_OK;
    if (!pal_json_has(body, "cells"))
        return pal_json_refuse(&at, "model \"%s\" cannot be cut away; \"subdivision_fem\" can", def->model.name);
    PAL_TRY(pal_json_object(&at, known));
    PAL_TRY(pal_json_need(&at, known[0]));
    PAL_TRY(pal_json_vector(&at, known[0], def->cut_normal));
    PAL_TRY(pal_json_number(&at, known[1], -1e9, 1e9, &def->cut_m));
    double length = sqrt(pal_dot3(def->cut_normal, def->cut_normal));
    if (!(length > 1e-12 && length < 1e12)) return pal_json_refuse_key(&at, known[0], "has no direction");
    /* what was saved keeps its bits */
    if (fabs(length - 1) > 1e-15) pal_scale3(def->cut_normal, 1 / length, def->cut_normal);
    def->cut = true;
    return PAL_ERR_OK;
}

void pal_subdivision_append(cJSON *object, const pal_body_def *body, const char *file)
{
    cJSON *list = body->n_stroke > 0 ? cJSON_CreateArray() : NULL, *cut = NULL;
    if (body->cut)
        cut = PAL_JSON({"normal", pal_json_exact_list(body->cut_normal, 3)}, {"offset_m", pal_json_exact(body->cut_m)});
    for (int k = 0; k < body->n_stroke; k++) {
        const pal_stroke *s = &body->stroke[k];
        cJSON_AddItemToArray(
            list, PAL_JSON({"at_m", pal_json_exact_list(s->at_m, 3)}, {"radius_m", pal_json_exact(s->radius_m)},
                           {"softness", pal_json_exact(s->softness)}, {"young_factor", pal_json_exact(s->young_factor)},
                           {"density_factor", pal_json_exact(s->density_factor)}));
    }
    PAL_JSON_ADD(object, {"cells", JSON_TEXT(file)}, {"origin_m", pal_json_exact_list(body->mesh->surface.origin_m, 3)},
                 {"cut", cut}, {"strokes", list});
}
