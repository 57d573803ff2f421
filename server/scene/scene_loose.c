#include "server/scene/scene_import.h"
#include "server/scene/subdivision_file.h"

#include <stdlib.h>
#include <string.h>

pal_err pal_scene_drop_loose(pal_loaded_scene *loaded, int index, bool largest_only, pal_diagnostic *diag)
{
    const pal_body_def *def = &loaded->scene.body[index];
    pal_prepared *mesh = &loaded->mesh[index];
    pal_cells *cells = &loaded->cells[index];
    pal_loose_components *parts = &loaded->loose[index];
    pal_diagnostic reason = {""};
    *parts = (pal_loose_components){0};
    /* anchors of the surface hold every piece of it */
    if (!strcmp(def->model.name, "adaptive_springs")) return PAL_ERR_OK;
    const int n = def->cells ? cells->n_vertex : mesh->tets.n_node;
    uint8_t *fixed = calloc((size_t)n + 1, sizeof *fixed);
    if (!fixed)
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "body \"%s\": no memory to find what is held", def->name);
    pal_body_def_mark_fixed(def, loaded->scene.up, def->cells ? cells->x : mesh->tets.x, n, fixed);
    pal_err err = def->cells ? pal_loose_cells_drop(def->name, fixed, largest_only, cells, parts, &reason)
                             : pal_loose_components_drop(def->name, fixed, largest_only, mesh, parts, &reason);
    free(fixed);
    if (err == PAL_ERR_REFUSED)
        pal_diagnostic_set(diag, err, "%s, or keep only the largest one (--largest, \"largest\": true in a scene)",
                           reason.text);
    else if (err)
        pal_diagnostic_set(diag, err, "%s", reason.text);
    if (!err && def->cells && parts->n_dropped > 0) err = pal_subdivision_update_surface(loaded, index, diag);
    return err;
}
