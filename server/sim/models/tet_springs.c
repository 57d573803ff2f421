/* Model tet_springs: a tetrahedral mesh as mass points with springs that keep edge lengths, face areas and tetrahedron
 * volumes (paper B section 4.1, in the corrected form of numerics.md 1 B).
 *
 * Keys: k_distance_J, k_area_J, k_volume_J (absent: derived from E, nu and h; 0: no such row), c_distance_Js,
 * c_area_Js, c_volume_Js (damping of the constraint, default 0). Where k_area_J is 0 the derived constants of edges and
 * volumes give the same moduli without it: a row less, about half the time. The row `viscous` exists when the
 * material's damping rate is given. */
#include "server/base/vec3.h"
#include "server/sim/effect_list.h"

#include <string.h>

/* quarter of each tetrahedron's mass to its corners */
static void lump_mass(const pal_tets *tets, double density_kg_m3, double *mass_kg)
{
    for (int t = 0; t < tets->n_tet; t++) {
        const int32_t *c = tets->tet + 4 * t;
        double e[3][3], n[3];
        for (int k = 0; k < 3; k++) pal_sub3(e[k], tets->x + 3 * c[k + 1], tets->x + 3 * c[0]);
        pal_cross3(n, e[1], e[2]);
        double quarter = density_kg_m3 * pal_dot3(e[0], n) / 24;
        for (int k = 0; k < 4; k++) mass_kg[c[k]] += quarter;
    }
}

static pal_err add_spring(pal_item *item, const char *effect, const char *k_key, const char *c_key, pal_recipe *out,
                          pal_note *note)
{
    double k_J = -1, c_Js = 0;
    PAL_TRY(pal_item_number(item, k_key, 0, 1e60, &k_J, note));
    PAL_TRY(pal_item_number(item, c_key, 0, 1e60, &c_Js, note));
    if (k_J == 0) return PAL_ERR_OK;
    pal_item *row = &out->row[out->n_row++];
    double k_area_J = -1;
    pal_item_init(row, item->path, effect);
    PAL_TRY(pal_item_number(item, "k_area_J", 0, 1e60, &k_area_J, note));
    if (k_area_J == 0) PAL_TRY(pal_item_put_bool(row, "without_area", true, note));
    if (k_J > 0) PAL_TRY(pal_item_put_number(row, "k_J", k_J, note));
    if (c_Js > 0) PAL_TRY(pal_item_put_number(row, "c_Js", c_Js, note));
    return PAL_ERR_OK;
}

static pal_err build(pal_item *item, pal_build *build, pal_recipe *out)
{
    const pal_prepared *mesh = build->def->mesh;
    const pal_material *material = &build->def->material;
    pal_body *body = build->body;
    out->n_row = 0;
    PAL_TRY(add_spring(item, "edge_distance", "k_distance_J", "c_distance_Js", out, build->note));
    PAL_TRY(add_spring(item, "face_area", "k_area_J", "c_area_Js", out, build->note));
    PAL_TRY(add_spring(item, "tet_volume", "k_volume_J", "c_volume_Js", out, build->note));
    PAL_TRY(pal_item_done(item, build->note));
    if (material->damping_1_s > 0) pal_item_init(&out->row[out->n_row++], item->path, "viscous");
    pal_item_init(&out->row[out->n_row++], item->path, "verlet");

    PAL_TRY(pal_body_allocate(body, build->arena, mesh->tets.n_node));
    memcpy(body->x_rest, mesh->tets.x, 3 * sizeof(double) * (size_t)body->n_node);
    memcpy(body->x, body->x_rest, 3 * sizeof(double) * (size_t)body->n_node);
    lump_mass(&mesh->tets, material->density_kg_m3, body->mass_kg);
    for (int i = 0; i < body->n_node; i++)
        if (!(body->mass_kg[i] > 0))
            return pal_note_set(build->note, PAL_ERR_REFUSED, "body \"%s\": node %d has mass %g kg", body->name, i,
                                body->mass_kg[i]);
    body->tets = &mesh->tets;
    body->surface = &mesh->surface;
    body->skin = mesh->skin.n_vertex > 0 ? &mesh->skin : NULL;
    body->h_m = mesh->tets.h_m;
    return pal_slots_make(body->x_rest, body->n_node, body->h_m, build->arena, &body->slots);
}

const pal_model pal_model_tet_springs = {.name = "tet_springs", .build = build};
