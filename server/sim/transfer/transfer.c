/* Where the nodes of one body lie in the elements of another (transfer.h). */
#include "server/sim/transfer/transfer.h"

#include "server/base/vec3.h"
#include "server/mesh/cells/cell_elements.h"
#include "server/mesh/volume/locate.h"
#include "server/num/shape_functions.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/transfer/transfer_core.h"

#include <stdlib.h>
#include <string.h>

/* a body by its model alone, without rows and supports */
typedef struct bare {
    pal_arena *arena;
    pal_body body;
    double origin_m[3];
    pal_tets tets; /* a solid's elements as tetrahedra; x is the body's */
    pal_locate *locate;
} bare;

static void free_bare(bare *b)
{
    pal_locate_destroy(b->locate);
    free(b->tets.tet);
    if (b->body.dofs.destroy) b->body.dofs.destroy(&b->body);
    pal_arena_destroy(b->arena);
}

static pal_err make_bare(const pal_scene *scene, int index, pal_diagnostic *diag, bare *out)
{
    const pal_body_def *def = &scene->body[index];
    const pal_model *model = pal_model_find(def->model.name);
    if (!model) return PAL_REFUSE(diag, "body \"%s\": there is no model \"%s\"", def->name, def->model.name);
    out->arena = pal_arena_create(1 << 16, true);
    pal_component_list *list = malloc(sizeof *list);
    pal_config_entry item = def->model;
    pal_build build = {.scene = scene, .def = def, .body = &out->body, .arena = out->arena, .diag = diag};
    out->body.name = def->name;
    pal_err err = out->arena && list ? model->build(&item, &build, list) : PAL_ERR_MEMORY;
    free(list);
    pal_copy3(out->origin_m, def->mesh->tets.n_node > 0 ? def->mesh->tets.origin_m : def->mesh->surface.origin_m);
    return err;
}

/* ---- elements that hold points ---- */

/* one more tetrahedron, of positive volume; a flat one holds no point */
static void add_tet(bare *b, const int32_t *node, const int corner[4])
{
    int32_t *c = b->tets.tet + 4 * (size_t)b->tets.n_tet;
    for (int k = 0; k < 4; k++) c[k] = node[corner[k]];
    double six = 6 * pal_tet_volume(b->tets.x, c), h = b->body.edge_m;
    if (!(fabs(six) > 1e-9 * h * h * h)) return;
    if (six < 0) c[2] = node[corner[3]], c[3] = node[corner[2]];
    b->tets.n_tet++;
}

/* hexahedra as five tetrahedra each, a cubic element by the corners of its cell, pyramids as two */
static pal_err cut_solid(bare *b)
{
    static const int hex[5][4] = {{0, 1, 2, 4}, {3, 1, 7, 2}, {5, 1, 4, 7}, {6, 2, 7, 4}, {1, 2, 4, 7}};
    static const int pyramid[2][4] = {{0, 1, 2, 4}, {0, 2, 3, 4}};
    const pal_cliques *clique = b->body.dofs.clique;
    size_t max =
        5 * (clique[PAL_CELL_CUBIC].n_item + clique[PAL_CELL_HEX].n_item) + 2 * clique[PAL_CELL_PYRAMID].n_item;
    b->tets = (pal_tets){.n_node = b->body.n_node, .x = b->body.node_rest, .edge_m = b->body.edge_m};
    b->tets.tet = malloc(4 * sizeof(int32_t) * (max + 1));
    if (!b->tets.tet) return PAL_ERR_MEMORY;
    for (int kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (int e = 0; e < (int)clique[kind].n_item; e++) {
            const int32_t *node = clique[kind].node + (size_t)clique[kind].n_corner * (size_t)e;
            int32_t corner[8];
            for (int c = 0; c < 8 && kind == PAL_CELL_CUBIC; c++)
                corner[c] = node[16 * (1 + (c & 1)) + 4 * (1 + (c >> 1 & 1)) + 1 + (c >> 2)];
            if (kind == PAL_CELL_CUBIC) node = corner;
            for (int k = 0; k < 5 && kind != PAL_CELL_PYRAMID; k++) add_tet(b, node, hex[k]);
            for (int k = 0; k < 2 && kind == PAL_CELL_PYRAMID; k++) add_tet(b, node, pyramid[k]);
        }
    return PAL_ERR_OK;
}

static pal_err make_locate(bare *b, pal_diagnostic *diag)
{
    const pal_body *body = &b->body;
    const pal_tets *tets = body->tets;
    if (body->interpolation) {
        PAL_TRY(cut_solid(b));
        tets = &b->tets;
    }
    pal_err err =
        tets ? pal_locate_create(tets, body->n_corner == 8 ? body->hexes : NULL, &b->locate) : PAL_ERR_REFUSED;
    if (err == PAL_ERR_REFUSED)
        return pal_diagnostic_set(diag, err, "body \"%s\": it has no elements to be switched from or to", body->name);
    return err;
}

/* ---- rows ---- */

/* local coordinates that go beyond an element by as much as it is wide at most */
static void hold_near(int n_corner, double local[4])
{
    double share = 1;
    if (n_corner == 8) {
        for (int k = 0; k < 3; k++)
            if (fabs(local[k]) * share > 3) share = 3 / fabs(local[k]);
        for (int k = 0; k < 3; k++) local[k] *= share;
        return;
    }
    for (int k = 0; k < 4; k++)
        if (0.25 + share * (local[k] - 0.25) < -1) share = 1.25 / (0.25 - local[k]);
    for (int k = 0; k < 4; k++) local[k] = 0.25 + share * (local[k] - 0.25);
}

/* adds the row of a point */
static void add_point(const bare *in, const double x[3], pal_interpolation_builder *rows)
{
    const pal_body *body = &in->body;
    double local[4], weight[PAL_MAX_CORNERS];
    int n = body->n_corner == 8 || body->n_corner == 10 ? body->n_corner : 4;
    int e = pal_locate_point(in->locate, x, local, NULL);
    hold_near(n, local);
    pal_element_shape(n, local, weight);
    const int32_t *node = n == 4 ? (body->interpolation ? in->tets.tet : body->tets->tet) : body->element;
    for (int c = 0; c < n; c++)
        if (fabs(weight[c]) > 1e-12)
            pal_interpolation_builder_add(rows, node[(size_t)n * (size_t)e + (size_t)c], weight[c]);
    pal_interpolation_builder_end_row(rows);
}

/* nodes of `of` by those of `in` */
static pal_err make_rows(const bare *of, const bare *in, pal_interpolation *out)
{
    pal_interpolation_builder rows;
    pal_interpolation_builder_begin(&rows, of->body.n_node, in->body.n_node, INT32_MAX);
    for (int i = 0; i < of->body.n_node && !rows.err; i++) {
        double x[3];
        for (int c = 0; c < 3; c++) x[c] = of->body.node_rest[3 * i + c] + of->origin_m[c] - in->origin_m[c];
        add_point(in, x, &rows);
    }
    return pal_interpolation_builder_finish(&rows, out);
}

static bool same_cells(const pal_scene *a, const pal_scene *b, int body)
{
    const pal_cells *p = a->body[body].cells, *q = b->body[body].cells;
    return p && q && p->n_vertex == q->n_vertex && p->n_cell == q->n_cell &&
           !memcmp(p->x, q->x, 3 * sizeof *p->x * (size_t)p->n_vertex);
}

/* the same coarse triangles: then all that the coarser of both has is in the finer one under the same numbers */
static bool same_surface(const pal_surface *a, const pal_surface *b)
{
    return a->n_vertex == b->n_vertex && a->n_tri == b->n_tri &&
           !memcmp(a->x, b->x, 3 * sizeof *a->x * (size_t)a->n_vertex) &&
           !memcmp(a->tri, b->tri, 3 * sizeof *a->tri * (size_t)a->n_tri);
}

static pal_err allocate(pal_transfer *t)
{
    size_t dof = 3 * (size_t)t->n_dof, to = 3 * (size_t)t->n_to, from = 3 * (size_t)t->n_from;
    t->arena = pal_arena_create(1 << 16, true);
    bool made = t->arena &&
                PAL_NEW_DOUBLES(t->arena, dof, &t->x, &t->v, &t->work[0], &t->work[1], &t->work[2], &t->work[3]) &&
                PAL_NEW_DOUBLES(t->arena, to, &t->node_x, &t->node_v, &t->force, &t->bound) &&
                PAL_NEW_DOUBLES(t->arena, from, &t->old, &t->load, &t->unbalanced);
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(const pal_scene *from, const pal_scene *to, int body, pal_diagnostic *diag, bare *a, bare *b,
                    pal_transfer *t)
{
    PAL_TRY(make_bare(from, body, diag, a));
    PAL_TRY(make_bare(to, body, diag, b));
    t->body = body;
    t->adaptive = a->body.active != NULL;
    t->same_control_points = a->body.interpolation && b->body.interpolation && same_cells(from, to, body);
    t->n_from = a->body.n_node, t->n_to = b->body.n_node, t->n_dof = b->body.n_dof;
    if (!a->body.active != !b->body.active)
        return PAL_REFUSE(diag, "body \"%s\": a surface that adapts and a full body are no one thing",
                          from->body[body].name);
    if (t->adaptive && !same_surface(&from->body[body].mesh->surface, &to->body[body].mesh->surface))
        return PAL_REFUSE(diag, "body \"%s\": another surface", from->body[body].name);
    PAL_TRY(allocate(t));
    if (t->adaptive) return PAL_ERR_OK;
    PAL_TRY(make_locate(a, diag));
    PAL_TRY(make_locate(b, diag));
    PAL_TRY(make_rows(b, a, &t->A_new));
    return make_rows(a, b, &t->A_old);
}

pal_err pal_transfer_make(const pal_scene *from, const pal_scene *to, int body, pal_diagnostic *diag,
                          pal_transfer **out)
{
    bare *two = calloc(2, sizeof *two);
    pal_transfer *t = calloc(1, sizeof *t);
    pal_err err = two && t ? make(from, to, body, diag, &two[0], &two[1], t) : PAL_ERR_MEMORY;
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "no memory to switch body \"%s\"", from->body[body].name);
    for (int k = 0; k < 2 && two; k++) free_bare(&two[k]);
    free(two);
    if (err)
        pal_transfer_free(t);
    else
        *out = t;
    return err;
}

void pal_transfer_free(pal_transfer *t)
{
    if (!t) return;
    pal_interpolation_free(&t->A_new);
    pal_interpolation_free(&t->A_old);
    pal_interpolation_free(&t->A_force);
    pal_arena_destroy(t->arena);
    free(t);
}
