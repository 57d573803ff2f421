/* Model subdivision_fem: control cells, subdivided into cubic, hexahedral and pyramidal finite elements (paper A;
 * subdivision_solid.h has the elements and the material at their Gauss points). The solver moves the control points p;
 * nodes are at d = A p (paper A, eq. 1). Supports fix control points, which are then no unknowns (paper A section 3.3).
 * The boundary of the subdivided cells, without those behind a cut, is shown and touched. Above nu 0.3 at load, whole
 * control cells conserve a part of the volume instead of each element (cell_volume.c).
 *
 * Keys: levels (2; 0 to 8) of subdivision, rule ("maccracken_joy" | "averaging"), operator ("polar" | "edges", of
 * cell_elastic), memory_MB (512; of the solid).
 * Components: cell_elastic, viscous where the material has damping, solver central_cg. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/subdivision/subdivision_body.h"
#include "server/sim/subdivision/subdivision_mass.h"
#include "server/sim/subdivision/subdivision_solid.h"

#include <stdlib.h>
#include <string.h>

typedef struct keys {
    pal_subdivision_options subdivision;
    const char *operator; /* NULL: the component's default */
    double memory_MB;
} keys;

static pal_err read_keys(pal_config_entry *item, keys *out, pal_diagnostic *diag)
{
    static const char *const rule[] = {"maccracken_joy", "averaging"}, *const operator[] = {"polar", "edges"};
    int rule_kind = 0, operator_kind = 0;
    *out = (keys){.subdivision = {.n_level = 2}, .memory_MB = 512};
    PAL_TRY(pal_entry_read_count(item, "levels", 0, PAL_SUBDIVISION_MAX, &out->subdivision.n_level, diag));
    PAL_TRY(pal_entry_read_choice(item, "rule", rule, 2, &rule_kind, diag));
    PAL_TRY(pal_entry_read_choice(item, "operator", operator, 2, &operator_kind, diag));
    PAL_TRY(pal_entry_read_number(item, "memory_MB", 1, 1e6, &out->memory_MB, diag));
    PAL_TRY(pal_entry_check_unused(item, diag));
    if (pal_entry_has(item, "operator")) out->operator= operator[operator_kind];
    out->subdivision.rule = rule_kind ? PAL_SUBDIVISION_AVERAGING : PAL_SUBDIVISION_MACCRACKEN_JOY;
    out->subdivision.budget_byte = (size_t)(out->memory_MB * 1048576);
    return PAL_ERR_OK;
}

/* the solid with the scene's entry in its refusal */
static pal_err make_solid(const keys *k, const pal_config_entry *item, pal_build *build)
{
    pal_diagnostic reason = {{0}};
    const pal_body_def *def = build->def;
    pal_err err = pal_subdivision_solid_make(def, &k->subdivision, &build->body->model.solid, &reason);
    if (err && err != PAL_ERR_MEMORY)
        return pal_diagnostic_set(build->diag, err, "body \"%s\" %s: %s", def->name, item->path, reason.text);
    PAL_TRY(err);
    pal_subdivision_body_dofs(build->body);
    double used_MB = (double)build->body->model.solid->n_byte / 1048576;
    if (used_MB > k->memory_MB)
        return pal_diagnostic_set(build->diag, PAL_ERR_BUDGET,
                                  "body \"%s\" %s: %d elements take %.0f MB, memory_MB allows %g: take fewer levels",
                                  def->name, item->path, pal_cell_elements_count(&build->body->model.solid->elements),
                                  used_MB, k->memory_MB);
    return PAL_ERR_OK;
}

/* what is shown, as it is found: heap */
typedef struct boundary {
    pal_surface surface;
    int32_t *node, *face; /* of the cells: vertex of each vertex [n_vertex], face of each triangle [n_tri] */
} boundary;

static pal_err keep_boundary(const boundary *from, pal_build *build)
{
    const int32_t *origin = build->body->model.solid->subdivision.face_origin;
    size_t n = (size_t)from->surface.n_vertex, m = (size_t)from->surface.n_tri;
    pal_surface *surface = PAL_NEW(build->arena, pal_surface, 1);
    double *x = PAL_NEW(build->arena, double, 3 * n);
    int32_t *tri = PAL_NEW(build->arena, int32_t, 3 * m), *node = PAL_NEW(build->arena, int32_t, n),
            *face = PAL_NEW(build->arena, int32_t, m);
    uint8_t *inside = PAL_NEW(build->arena, uint8_t, m);
    if (!surface || !x || !tri || !node || !face || !inside) return PAL_ERR_MEMORY;
    memcpy(x, from->surface.x, 3 * n * sizeof *x);
    memcpy(tri, from->surface.tri, 3 * m * sizeof *tri);
    memcpy(node, from->node, n * sizeof *node);
    /* a face between two control cells cannot be grasped */
    for (size_t t = 0; t < m; t++) {
        int32_t control = origin[from->face[t]];
        face[t] = control >= 0 && pal_cells_face_boundary(build->def->cells, control) ? control : -1;
        inside[t] = face[t] < 0 || build->def->cells->face[control].inside;
        if (inside[t]) build->body->display.shown_inside = inside;
    }
    *surface = (pal_surface){.n_vertex = from->surface.n_vertex, .n_tri = from->surface.n_tri, .x = x, .tri = tri};
    memcpy(surface->origin_m, build->def->mesh->surface.origin_m, sizeof surface->origin_m);
    build->body->display.surface = surface;
    build->body->display.shown_node = node;
    build->body->display.shown_face = face;
    return PAL_ERR_OK;
}

/* boundary of the cells that the cut leaves */
static pal_err find_cut(const pal_cells *cells, const pal_body_def *def, boundary *b)
{
    bool *away = malloc((size_t)cells->n_cell);
    for (int32_t c = 0; c < cells->n_cell && away; c++) {
        double middle[3];
        pal_cells_cell_centre(cells, NULL, c, middle);
        away[c] = pal_dot3(def->cut_normal, middle) > def->cut_m;
    }
    pal_err err = away ? pal_cells_boundary_of(cells, away, &b->surface, &b->node, &b->face) : PAL_ERR_MEMORY;
    free(away);
    return err;
}

static pal_err show_boundary(const pal_config_entry *item, pal_build *build)
{
    boundary b = {.node = NULL};
    const pal_cells *cells = &build->body->model.solid->subdivision.cells;
    pal_err err =
        build->def->cut ? find_cut(cells, build->def, &b) : pal_cells_boundary(cells, &b.surface, &b.node, &b.face);
    if (!err && b.surface.n_tri == 0)
        err = PAL_REFUSE(build->diag, "body \"%s\" %s: the cut leaves nothing of it", build->def->name, item->path);
    if (!err) err = keep_boundary(&b, build);
    pal_surface_free(&b.surface);
    free(b.node), free(b.face);
    return err;
}

/* masses follow once the fixed points are known (subdivision_body.h) */
static pal_err make_body(const pal_config_entry *item, pal_build *build)
{
    pal_body *body = build->body;
    const pal_subdivision_solid *solid = body->model.solid;
    PAL_TRY(pal_body_allocate_interpolated(body, build->arena, &solid->rows));
    int32_t *tet;
    PAL_TRY(pal_subdivision_interior(solid, build->arena, &body->display.n_tet, &tet));
    body->display.tet = tet;
    body->node_inverse_mass_1_kg = PAL_NEW(build->arena, double, body->n_node);
    body->mass_operator = PAL_NEW(build->arena, pal_mass_operator, 1);
    if (!body->node_inverse_mass_1_kg || !body->mass_operator) return PAL_ERR_MEMORY;
    PAL_TRY(pal_subdivision_mass_make(solid, build->arena, body->mass_operator));
    size_t n_byte = 3 * sizeof(double) * (size_t)body->n_dof;
    memcpy(body->x_rest, build->def->cells->x, n_byte);
    memcpy(body->x, body->x_rest, n_byte);
    memcpy(body->node_rest, solid->node_rest, 3 * sizeof(double) * (size_t)body->n_node);
    pal_body_update_nodes(body);
    const double volume_m3 = pal_subdivision_solid_volume_m3(solid);
    body->edge_m = cbrt(volume_m3 / solid->subdivision.cells.n_cell);
    body->dofs.spacing_m = cbrt(volume_m3 / build->def->cells->n_cell);
    return show_boundary(item, build);
}

static pal_err list(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    pal_config_entry *row = out->row;
    keys k;
    PAL_TRY(read_keys(item, &k, build->diag));
    pal_entry_init(row, item->path, "cell_elastic");
    if (k.operator) PAL_TRY(pal_entry_put_text(row, "operator", k.operator, build->diag));
    row++;
    if (build->def->material.damping_1_s != 0) pal_entry_init(row++, item->path, "viscous");
    if (!build->def->solver.name[0]) pal_entry_init(row++, item->path, "central_cg");
    out->n_row = (int)(row - out->row);
    return PAL_ERR_OK;
}

static pal_err build(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    keys k;
    PAL_TRY(read_keys(item, &k, build->diag));
    PAL_TRY(make_solid(&k, item, build));
    PAL_TRY(make_body(item, build));
    return list(item, build, out);
}

const pal_model pal_model_subdivision_fem = {.name = "subdivision_fem", .build = build, .list = list};
