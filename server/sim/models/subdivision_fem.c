/* Model subdivision_fem: control cells, subdivided into cubic, hexahedral and pyramidal finite elements whose nodes are
 * carried by the control points (paper A; solid.h has the elements and the material at their Gauss points).
 *
 * The solver moves the control points p; nodes stand at d = A p (A eq. 1). Supports hold control points: those inside a
 * box or of the lowest part of the control cells, and what they hold is no unknown (A 3.3). What is shown and touched
 * is the boundary of the subdivided cells; without the cells behind a cut where the body is cut.
 *
 * Keys: levels (2; 0 to 8) of subdivision, rule ("maccracken_joy" | "averaging"), operator ("polar" | "edges", of the
 * row cell_elastic), memory_MB (512; of the solid).
 * Rows: cell_elastic, viscous where the material has damping, solver central_cg. */
#include "server/sim/effect_list.h"
#include "server/sim/solid.h"
#include "server/sim/solid_mass.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct keys {
    pal_subdivision_options subdivision;
    const char *operator; /* NULL: the row's own */
    double memory_MB;
} keys;

static pal_err read_keys(pal_item *item, keys *out, pal_note *note)
{
    static const char *const rule[] = {"maccracken_joy", "averaging"}, *const operator[] = {"polar", "edges"};
    const char *asked = rule[0];
    *out = (keys){.subdivision = {.n_level = 2}, .memory_MB = 512};
    PAL_TRY(pal_item_count(item, "levels", 0, PAL_SUBDIVISION_MOST, &out->subdivision.n_level, note));
    PAL_TRY(pal_item_text(item, "rule", &asked, note));
    PAL_TRY(pal_item_text(item, "operator", &out->operator, note));
    PAL_TRY(pal_item_number(item, "memory_MB", 1, 1e6, &out->memory_MB, note));
    PAL_TRY(pal_item_done(item, note));
    if (strcmp(asked, rule[0]) != 0 && strcmp(asked, rule[1]) != 0)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.rule: \"%s\", wanted \"%s\" or \"%s\"", item->path, asked,
                            rule[0], rule[1]);
    if (out->operator&& strcmp(out->operator, operator[0]) != 0 && strcmp(out->operator, operator[1]) != 0)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.operator: \"%s\", wanted \"%s\" or \"%s\"", item->path,
                            out->operator, operator[0], operator[1]);
    out->subdivision.rule = strcmp(asked, rule[0]) ? PAL_SUBDIVISION_AVERAGING : PAL_SUBDIVISION_MACCRACKEN_JOY;
    out->subdivision.budget_byte = (size_t)(out->memory_MB * 1048576);
    return PAL_ERR_OK;
}

/* the solid with the scene's entry in its refusal */
static pal_err make_solid(const keys *k, const pal_item *item, pal_build *build)
{
    pal_note why = {{0}};
    const pal_body_def *def = build->def;
    pal_err err = pal_solid_make(def, &k->subdivision, &build->body->solid, &why);
    if (err && err != PAL_ERR_MEMORY)
        return pal_note_set(build->note, err, "body \"%s\" %s: %s", def->name, item->path, why.text);
    PAL_TRY(err);
    double used_MB = (double)build->body->solid->n_byte / 1048576;
    if (used_MB > k->memory_MB)
        return pal_note_set(build->note, PAL_ERR_BUDGET,
                            "body \"%s\" %s: %d elements take %.0f MB, memory_MB allows %g: take fewer levels",
                            def->name, item->path, pal_cell_elements_count(&build->body->solid->elements), used_MB,
                            k->memory_MB);
    return PAL_ERR_OK;
}

static pal_err keep_surface(const pal_surface *from, const int32_t *node, const double origin_m[3], pal_build *build)
{
    size_t n = (size_t)from->n_vertex, m = (size_t)from->n_tri;
    pal_surface *surface = PAL_NEW(build->arena, pal_surface, 1);
    double *x = PAL_NEW(build->arena, double, 3 * n);
    int32_t *tri = PAL_NEW(build->arena, int32_t, 3 * m), *shown_node = PAL_NEW(build->arena, int32_t, n);
    if (!surface || !x || !tri || !shown_node) return PAL_ERR_MEMORY;
    memcpy(x, from->x, 3 * n * sizeof *x);
    memcpy(tri, from->tri, 3 * m * sizeof *tri);
    memcpy(shown_node, node, n * sizeof *node);
    *surface = (pal_surface){.n_vertex = from->n_vertex, .n_tri = from->n_tri, .x = x, .tri = tri};
    memcpy(surface->origin_m, origin_m, sizeof surface->origin_m);
    build->body->surface = surface;
    build->body->shown_node = shown_node;
    return PAL_ERR_OK;
}

/* boundary of the cells: virtual nodes stand inside them and are never on it */
static pal_err show_boundary(pal_build *build)
{
    pal_surface surface = {0};
    int32_t *node = NULL;
    pal_err err = pal_cells_boundary(&build->body->solid->subdivision.cells, &surface, &node, NULL);
    if (!err) err = keep_surface(&surface, node, build->def->mesh->surface.origin_m, build);
    pal_surface_free(&surface);
    free(node);
    return err;
}

/* points as given, nodes carried by them; masses follow once what is held is known (solid_body.h) */
static pal_err make_body(pal_build *build)
{
    pal_body *body = build->body;
    const pal_solid *solid = body->solid;
    PAL_TRY(pal_body_allocate_embedded(body, build->arena, &solid->rows));
    body->node_ease_1_kg = PAL_NEW(build->arena, double, body->n_node);
    body->solid_mass = PAL_NEW(build->arena, pal_solid_mass, 1);
    if (!body->node_ease_1_kg || !body->solid_mass) return PAL_ERR_MEMORY;
    PAL_TRY(pal_solid_mass_make(solid, build->arena, body->solid_mass));
    size_t n_byte = 3 * sizeof(double) * (size_t)body->n_dof;
    memcpy(body->x_rest, build->def->cells->x, n_byte);
    memcpy(body->x, body->x_rest, n_byte);
    memcpy(body->node_rest, solid->node_rest, 3 * sizeof(double) * (size_t)body->n_node);
    pal_body_place(body);
    body->h_m = cbrt(pal_solid_volume_m3(solid) / solid->subdivision.cells.n_cell);
    return show_boundary(build);
}

static pal_err build(pal_item *item, pal_build *build, pal_recipe *out)
{
    keys k;
    out->n_row = 0;
    PAL_TRY(read_keys(item, &k, build->note));
    PAL_TRY(make_solid(&k, item, build));
    PAL_TRY(make_body(build));
    pal_item *row = out->row;
    pal_item_init(row, item->path, "cell_elastic");
    if (k.operator) PAL_TRY(pal_item_put_text(row, "operator", k.operator, build->note));
    row++;
    if (build->def->material.damping_1_s > 0) pal_item_init(row++, item->path, "viscous");
    pal_item_init(row++, item->path, "central_cg");
    out->n_row = (int)(row - out->row);
    return PAL_ERR_OK;
}

const pal_model pal_model_subdivision_fem = {.name = "subdivision_fem", .build = build};
