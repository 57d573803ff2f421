/* Components that nothing holds: one rule for tetrahedra and control cells. */
#include "server/mesh/volume/loose_components.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

typedef struct component {
    double volume_m3, moment[3]; /* moment: volume times centre, m^4 */
    bool fixed, keep;
} component;

static pal_err refuse(const char *name, const component *part, const pal_loose_components *all, int n_bad, int bad,
                      pal_diagnostic *diag)
{
    const component *p = &part[bad];
    double middle[3];
    pal_scale3(middle, 1 / p->volume_m3, p->moment);
    return PAL_REFUSE(diag,
                      "body \"%.60s\": %d of %d components ha%s no support, the largest of %.3g ml (%.3g %% of the "
                      "body) around (%.4f, %.4f, %.4f) m: hold each component by a support",
                      name, n_bad, all->n_component, n_bad == 1 ? "s" : "ve", 1e6 * p->volume_m3,
                      100 * p->volume_m3 / all->volume_m3, middle[0], middle[1], middle[2]);
}

static pal_err choose(const char *name, bool largest_only, component *part, int n, pal_loose_components *out,
                      pal_diagnostic *diag)
{
    int best = 0, bad = -1, n_bad = 0;
    bool any_fixed = false;
    *out = (pal_loose_components){.n_component = n, .largest_only = largest_only};
    for (int k = 0; k < n; k++) {
        out->volume_m3 += part[k].volume_m3;
        any_fixed |= part[k].fixed;
        if (part[k].volume_m3 > part[best].volume_m3) best = k;
    }
    for (int k = 0; k < n; k++) {
        bool small = part[k].volume_m3 < LOOSE_FRACTION * part[best].volume_m3;
        part[k].keep = largest_only ? k == best : part[k].fixed || !small;
        if (!largest_only && any_fixed && !part[k].fixed && !small) {
            n_bad++;
            if (bad < 0 || part[k].volume_m3 > part[bad].volume_m3) bad = k;
        }
        if (part[k].keep) continue;
        out->n_dropped++;
        out->dropped_m3 += part[k].volume_m3;
        out->max_dropped_m3 = fmax(out->max_dropped_m3, part[k].volume_m3);
    }
    return bad < 0 ? PAL_ERR_OK : refuse(name, part, out, n_bad, bad, diag);
}

void pal_loose_components_describe(const pal_loose_components *parts, const char *name, pal_diagnostic *out)
{
    out->text[0] = 0;
    if (parts->n_dropped == 0) return;
    pal_diagnostic_set(out, PAL_ERR_OK, "body \"%.60s\": dropped %d of %d components, %.3g ml of %.3g ml (%.2g %%)%s",
                       name, parts->n_dropped, parts->n_component, 1e6 * parts->dropped_m3, 1e6 * parts->volume_m3,
                       100 * parts->dropped_m3 / parts->volume_m3,
                       parts->largest_only ? ": only the largest is kept" : ": small and without support");
}

static void add_tet(const pal_tets *tets, const uint8_t *fixed, const int32_t *corner, component *to)
{
    double volume = pal_tet_volume(tets->x, corner);
    to->volume_m3 += volume;
    for (int c = 0; c < 4; c++) {
        pal_axpy3(to->moment, volume / 4, tets->x + 3 * (size_t)corner[c]);
        to->fixed |= fixed[corner[c]] != 0;
    }
}

/* the kept tetrahedra, in the same order; number [n_node] gets the new number of each node, -1: dropped */
static pal_err keep_tets(const pal_tets *from, const int32_t *label, const component *part, int32_t *number,
                         pal_tets *to)
{
    pal_err err = PAL_ERR_OK;
    *to = (pal_tets){.edge_m = from->edge_m};
    pal_copy3(to->origin_m, from->origin_m);
    PAL_ARRAY(&err, to->x, 3 * (size_t)from->n_node);
    PAL_ARRAY(&err, to->tet, 4 * (size_t)from->n_tet);
    if (err) return err;
    for (int i = 0; i < from->n_node; i++) number[i] = -1;
    for (size_t t = 0; t < (size_t)from->n_tet; t++)
        for (size_t c = 0; part[label[t]].keep && c < 4; c++) number[from->tet[4 * t + c]] = 0;
    for (int i = 0; i < from->n_node; i++) {
        if (number[i] < 0) continue;
        pal_copy3(to->x + 3 * (size_t)to->n_node, from->x + 3 * (size_t)i);
        number[i] = to->n_node++;
    }
    for (size_t t = 0; t < (size_t)from->n_tet; t++) {
        if (!part[label[t]].keep) continue;
        for (size_t c = 0; c < 4; c++) to->tet[4 * (size_t)to->n_tet + c] = number[from->tet[4 * t + c]];
        to->n_tet++;
    }
    return pal_tets_find_boundary(to);
}

/* hexahedron e is tetrahedra 5 e .. 5 e + 4, which are joined by faces */
static pal_err keep_hexes(const pal_hexes *from, const int32_t *label, const component *part, const int32_t *number,
                          pal_hexes *to)
{
    if (from->n_hex == 0) return PAL_ERR_OK;
    pal_err err = PAL_ERR_OK;
    to->measured = from->measured;
    PAL_ARRAY(&err, to->node, 8 * (size_t)from->n_hex);
    PAL_ARRAY(&err, to->fill, from->n_hex);
    if (from->weight) PAL_ARRAY(&err, to->weight, 8 * (size_t)from->n_hex);
    if (err) return err;
    for (size_t e = 0; e < (size_t)from->n_hex; e++) {
        if (!part[label[5 * e]].keep) continue;
        for (size_t c = 0; c < 8; c++) to->node[8 * (size_t)to->n_hex + c] = number[from->node[8 * e + c]];
        if (from->weight) memcpy(to->weight + 8 * (size_t)to->n_hex, from->weight + 8 * e, 8 * sizeof *to->weight);
        to->fill[to->n_hex++] = from->fill[e];
    }
    return PAL_ERR_OK;
}

static pal_err keep_mesh(pal_prepared *mesh, const int32_t *label, const component *part)
{
    pal_prepared kept = {0};
    const pal_surface *surface = &mesh->surface;
    int32_t *number = malloc((size_t)mesh->tets.n_node * sizeof *number);
    pal_err err = number ? keep_tets(&mesh->tets, label, part, number, &kept.tets) : PAL_ERR_MEMORY;
    if (!err) err = keep_hexes(&mesh->hexes, label, part, number, &kept.hexes);
    if (!err && mesh->skin.n_vertex > 0) err = pal_skin_bind(&kept.tets, surface->x, surface->n_vertex, &kept.skin);
    free(number);
    if (err) {
        pal_prepared_free(&kept);
        return err;
    }
    kept.surface = *surface;
    memset(&mesh->surface, 0, sizeof mesh->surface);
    pal_prepared_free(mesh);
    *mesh = kept;
    return PAL_ERR_OK;
}

pal_err pal_loose_components_drop(const char *name, const uint8_t *fixed, bool largest_only, pal_prepared *mesh,
                                  pal_loose_components *out, pal_diagnostic *diag)
{
    const pal_tets *tets = &mesh->tets;
    int n = 0;
    *out = (pal_loose_components){0};
    if (tets->n_tet == 0) return PAL_ERR_OK;
    pal_err err = PAL_ERR_OK;
    int32_t *label;
    component *part;
    PAL_ARRAY(&err, label, tets->n_tet);
    if (!err) err = pal_tets_components(tets, label, &n);
    PAL_ZEROED(&err, part, n);
    for (int t = 0; !err && t < tets->n_tet; t++) add_tet(tets, fixed, tets->tet + 4 * (size_t)t, &part[label[t]]);
    if (!err) err = choose(name, largest_only, part, n, out, diag);
    if (!err && out->n_dropped > 0) err = keep_mesh(mesh, label, part);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "body \"%.60s\": no memory to find its components", name);
    return PAL_FREED(err, label, part);
}

static pal_err keep_cells(pal_cells *cells, const int32_t *label, const component *part)
{
    pal_cell_loops loops = {0};
    pal_cells kept = {0};
    bool *keep = malloc((size_t)cells->n_cell * sizeof *keep);
    for (int32_t c = 0; keep && c < cells->n_cell; c++) keep[c] = part[label[c]].keep;
    pal_err err = keep ? pal_cells_loops(cells, keep, &loops, NULL) : PAL_ERR_MEMORY;
    if (!err) err = pal_cells_make(&loops, &kept, NULL);
    pal_cell_loops_free(&loops);
    free(keep);
    if (err) return err;
    pal_cells_free(cells);
    *cells = kept;
    return PAL_ERR_OK;
}

pal_err pal_loose_cells_drop(const char *name, const uint8_t *fixed, bool largest_only, pal_cells *cells,
                             pal_loose_components *out, pal_diagnostic *diag)
{
    int32_t *label = malloc((size_t)cells->n_cell * sizeof *label);
    int n = label ? pal_cells_label(cells, label) : 0;
    component *part = label ? calloc((size_t)n, sizeof *part) : NULL;
    pal_err err = part ? PAL_ERR_OK : PAL_ERR_MEMORY;
    *out = (pal_loose_components){0};
    for (int32_t c = 0; part && c < cells->n_cell; c++) {
        component *to = &part[label[c]];
        double volume = pal_cells_cell_volume(cells, NULL, c), middle[3];
        pal_cells_cell_centre(cells, NULL, c, middle);
        to->volume_m3 += volume;
        pal_axpy3(to->moment, volume, middle);
        for (int32_t k = cells->cell_vertex.start[c]; k < cells->cell_vertex.start[c + 1]; k++)
            to->fixed |= fixed[cells->cell_vertex.item[k]] != 0;
    }
    if (!err) err = choose(name, largest_only, part, n, out, diag);
    if (!err && out->n_dropped > 0) err = keep_cells(cells, label, part);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "body \"%.60s\": no memory to find its components", name);
    return PAL_FREED(err, label, part);
}
