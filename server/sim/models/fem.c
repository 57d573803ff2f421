/* Model fem: linear or quadratic tetrahedra, or one hexahedron per voxel, on the nodes of a prepared mesh.
 *
 * Keys: element ("hex8_bbar" | "hex8" | "tet4" | "tet10"; hex8_bbar where the prepared mesh has hexahedra, else tet4),
 * law ("corotational" | "linear" | "neo_hookean"), fill (true: a voxel that the surface cuts has mass and stiffness by
 * its share inside, at least PAL_FILL_MIN), moment_fitting, twist (hexahedra: as hex_elastic's).
 *
 * Components: hex_elastic or tet_elastic with the same keys, viscous where the material has damping, solver
 * implicit_euler. Under static_newton a neo_hookean body has no recovery, because the edges of a region are another
 * material: a corner inverted at a clamped edge is part of the discrete rest state. Masses are lumped: equal shares to
 * the corners, with moment_fitting by the shape functions at their Gauss points; tet10 by Hinton, Rock and
 * Zienkiewicz (1976), 1/36 of an element to a corner and 4/27 to a middle node, which are all positive. tet10 has its
 * middle nodes behind the mesh's own, whose numbers (skin, supports) stay true.
 */
#include "server/base/vec3.h"
#include "server/num/shape_functions.h"
#include "server/sim/core/effect_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct fem_choice {
    const char *element, *law; /* law NULL: the row's default */
    bool fill, moment_fitting, hex;
    double twist; /* NaN: the row's default */
    int n_corner;
} fem_choice;

static pal_err read_keys(pal_config_entry *item, const pal_build *build, fem_choice *to)
{
    static const char *const names[] = {"hex8_bbar", "hex8", "tet4", "tet10"};
    static const int corners[] = {8, 8, 4, 10};
    const pal_prepared *mesh = build->def->mesh;
    int kind = mesh->hexes.n_hex > 0 ? 0 : 2;
    *to = (fem_choice){.fill = true, .twist = NAN};
    PAL_TRY(pal_entry_read_choice(item, "element", names, 4, &kind, build->diag));
    PAL_TRY(pal_entry_read_text(item, "law", &to->law, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "fill", &to->fill, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "moment_fitting", &to->moment_fitting, build->diag));
    PAL_TRY(pal_entry_read_number(item, "twist", 0.01, 1, &to->twist, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    to->element = names[kind], to->n_corner = corners[kind];
    to->hex = to->n_corner == 8;
    if (to->hex && mesh->hexes.n_hex == 0)
        return PAL_REFUSE(
            build->diag,
            "body \"%s\" %s.element: \"%s\" needs a mesh of voxels and this one has no hexahedra; prepare "
            "it from its surface with `palpate prepare --model fem`, or take tet4",
            build->body->name, item->path, to->element);
    return PAL_ERR_OK;
}

static pal_err list(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    pal_config_entry *row = out->row;
    fem_choice k;
    PAL_TRY(read_keys(item, build, &k));
    pal_entry_init(row, item->path, k.hex ? "hex_elastic" : "tet_elastic");
    PAL_TRY(pal_entry_put_text(row, "element", k.element, build->diag));
    if (k.law) PAL_TRY(pal_entry_put_text(row, "law", k.law, build->diag));
    PAL_TRY(pal_entry_put_bool(row, "fill", k.fill, build->diag));
    if (k.hex && k.moment_fitting) PAL_TRY(pal_entry_put_bool(row, "moment_fitting", true, build->diag));
    if (k.hex && !isnan(k.twist)) PAL_TRY(pal_entry_put_number(row, "twist", k.twist, build->diag));
    const bool own_law = k.law && !strcmp(k.law, "neo_hookean") && !strcmp(build->def->solver.name, "static_newton");
    if (own_law) PAL_TRY(pal_entry_put_bool(row, "recover", false, build->diag));
    if (build->def->material.damping_1_s != 0) pal_entry_init(++row, item->path, "viscous");
    if (!build->def->solver.name[0]) pal_entry_init(++row, item->path, "implicit_euler");
    out->n_row = (int)(row - out->row) + 1;
    return PAL_ERR_OK;
}

/* ten-node elements; edges ascend by their first node */
static pal_err add_middles(const pal_tets *tets, const int32_t *edge, int n_edge, pal_arena *arena, int32_t **out)
{
    int32_t *element = PAL_NEW(arena, int32_t, 10 * (size_t)tets->n_tet);
    int32_t *first = calloc((size_t)tets->n_node + 1, sizeof *first);
    if (!element || !first) {
        free(first);
        return PAL_ERR_MEMORY;
    }
    for (int e = 0; e < n_edge; e++) first[edge[2 * e] + 1]++;
    for (int i = 0; i < tets->n_node; i++) first[i + 1] += first[i];
    for (int t = 0; t < tets->n_tet; t++) {
        const int32_t *corner = tets->tet + 4 * t;
        memcpy(element + 10 * t, corner, 4 * sizeof *corner);
        for (int k = 0; k < 6; k++) {
            int32_t a = corner[pal_tet10_edge[k][0]], b = corner[pal_tet10_edge[k][1]];
            int32_t low = a < b ? a : b, high = a < b ? b : a, at = first[low];
            while (edge[2 * at + 1] != high) at++;
            element[10 * t + 4 + k] = tets->n_node + at;
        }
    }
    free(first);
    *out = element;
    return PAL_ERR_OK;
}

static void place_nodes(pal_body *body, const pal_tets *tets, const int32_t *edge, int n_edge)
{
    memcpy(body->x_rest, tets->x, 3 * sizeof(double) * (size_t)tets->n_node);
    for (int e = 0; e < n_edge; e++) {
        double *x = body->x_rest + 3 * (tets->n_node + e);
        pal_add3(x, tets->x + 3 * edge[2 * e], tets->x + 3 * edge[2 * e + 1]);
        pal_scale3(x, 0.5, x);
    }
    memcpy(body->x, body->x_rest, 3 * sizeof(double) * (size_t)body->n_node);
}

static pal_err make_nodes(const pal_build *build, const fem_choice *choice)
{
    const pal_prepared *mesh = build->def->mesh;
    pal_body *body = build->body;
    int32_t *edge = NULL;
    int n_edge = 0;
    if (choice->n_corner == 10) PAL_TRY(pal_tets_edges(&mesh->tets, &edge, &n_edge));
    pal_err err = pal_body_allocate(body, build->arena, mesh->tets.n_node + n_edge);
    if (!err) place_nodes(body, &mesh->tets, edge, n_edge);
    if (!err && choice->n_corner == 10) {
        int32_t *element = NULL;
        err = add_middles(&mesh->tets, edge, n_edge, build->arena, &element);
        body->element = element;
    }
    free(edge);
    if (choice->n_corner == 4) body->element = mesh->tets.tet;
    if (choice->hex) body->element = mesh->hexes.node;
    body->n_element = choice->hex ? mesh->hexes.n_hex : mesh->tets.n_tet;
    body->n_corner = choice->n_corner;
    return err;
}

/* does hexahedron i hold tetrahedra 5 i to 5 i + 4, for all i? */
static bool five_each(const pal_tets *tets, const pal_hexes *hexes)
{
    if (hexes->n_hex == 0 || tets->n_tet != 5 * hexes->n_hex) return false;
    for (int i = 0; i < 4 * tets->n_tet; i++) {
        const int32_t *corner = hexes->node + 8 * (i / 20);
        bool found = false;
        for (int c = 0; c < 8; c++) found = found || corner[c] == tets->tet[i];
        if (!found) return false;
    }
    return true;
}

static pal_err make_fill(const pal_build *build, const fem_choice *choice)
{
    const pal_prepared *mesh = build->def->mesh;
    pal_body *body = build->body;
    if (!choice->fill || !mesh->hexes.fill || !five_each(&mesh->tets, &mesh->hexes)) return PAL_ERR_OK;
    float *fill = PAL_NEW(build->arena, float, body->n_element);
    if (!fill) return PAL_ERR_MEMORY;
    for (int e = 0; e < body->n_element; e++)
        fill[e] = fmaxf(mesh->hexes.fill[choice->hex ? e : e / 5], (float)PAL_FILL_MIN);
    body->fill = fill;
    body->moment_fitting = choice->hex && choice->moment_fitting && mesh->hexes.weight;
    return PAL_ERR_OK;
}

static pal_err lump_mass(const pal_build *build)
{
    pal_body *body = build->body;
    int n_corner = body->n_corner, n_mean = n_corner == 8 ? 8 : 4;
    for (int e = 0; e < body->n_element; e++) {
        const int32_t *node = body->element + n_corner * e;
        double centre[3] = {0, 0, 0};
        pal_material material;
        for (int c = 0; c < n_mean; c++) pal_axpy3(centre, 1.0 / n_mean, body->x_rest + 3 * node[c]);
        pal_material_at(build->def, centre, &material);
        double mass = material.density_kg_m3 * pal_body_element_volume_m3(body, node), share[PAL_MAX_CORNERS];
        pal_body_corner_shares(body, e, share);
        for (int c = 0; c < n_corner; c++) body->mass_kg[node[c]] += mass * share[c];
    }
    for (int i = 0; i < body->n_node; i++)
        if (!(body->mass_kg[i] > 0))
            return PAL_REFUSE(build->diag, "body \"%s\": node %d has mass %g kg", body->name, i, body->mass_kg[i]);
    return PAL_ERR_OK;
}

static pal_err build(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    const pal_prepared *mesh = build->def->mesh;
    pal_body *body = build->body;
    fem_choice choice;
    PAL_TRY(read_keys(item, build, &choice));
    PAL_TRY(list(item, build, out));
    PAL_TRY(make_nodes(build, &choice));
    body->tets = &mesh->tets;
    body->hexes = mesh->hexes.n_hex > 0 ? &mesh->hexes : NULL;
    if (choice.hex) body->ground = build->def->ground;
    PAL_TRY(make_fill(build, &choice));
    PAL_TRY(lump_mass(build));
    body->display.surface = &mesh->surface;
    body->display.skin = mesh->skin.n_vertex > 0 ? &mesh->skin : NULL;
    body->edge_m = mesh->tets.edge_m;
    double lattice_m = choice.n_corner == 10 ? 0.5 * body->edge_m : body->edge_m;
    return pal_node_order_make(body->x_rest, body->n_node, lattice_m, build->arena, &body->node_order);
}

const pal_model pal_model_fem = {.name = "fem", .build = build, .list = list};
