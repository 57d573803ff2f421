#include "server/session/control_cells.h"

#include <cjson/cJSON.h>

static bool add_number(cJSON *list, double value)
{
    return cJSON_AddItemToArray(list, cJSON_CreateNumber(value));
}

/* number, cell, vertices and edges of a boundary face; edge k runs from vertex k to the next */
static bool add_face(cJSON *list, const pal_cells *c, int32_t face)
{
    int32_t first, n = pal_cells_face_loop(c, face, &first);
    cJSON *item = cJSON_CreateObject();
    if (!cJSON_AddItemToArray(list, item)) return false;
    bool good = cJSON_AddNumberToObject(item, "face", face) &&
                cJSON_AddNumberToObject(item, "cell", c->face_use[c->face[face].use[0]].cell);
    cJSON *vertices = cJSON_AddArrayToObject(item, "vertices"), *edges = cJSON_AddArrayToObject(item, "edges");
    for (int32_t use = first; good && use < first + n; use++)
        good = add_number(vertices, c->edge_use[use].vertex) && add_number(edges, c->edge_use[use].edge);
    return good;
}

/* pairs of a control face (-1: none) and how many triangles in a row belong to it */
static bool add_runs(cJSON *list, const pal_shown *shown)
{
    for (int t = 0, n; t < shown->n_tri; t += n) {
        for (n = 1; t + n < shown->n_tri && shown->face[t + n] == shown->face[t]; n++) continue;
        if (!add_number(list, shown->face[t]) || !add_number(list, n)) return false;
    }
    return true;
}

char *pal_control_cells_text(const pal_cells *cells, const double origin_m[3], const pal_shown *shown)
{
    cJSON *root = cJSON_CreateObject();
    cJSON *x = cJSON_AddArrayToObject(root, "vertices_m"), *faces = cJSON_AddArrayToObject(root, "faces"),
          *runs = cJSON_AddArrayToObject(root, "triangles");
    bool good = true;
    for (int32_t i = 0; good && i < 3 * cells->n_vertex; i++) good = add_number(x, cells->x[i] + origin_m[i % 3]);
    for (int32_t f = 0; good && f < cells->n_face; f++)
        if (pal_cells_face_boundary(cells, f)) good = add_face(faces, cells, f);
    char *text = good && add_runs(runs, shown) ? cJSON_PrintUnformatted(root) : NULL;
    cJSON_Delete(root);
    return text;
}
