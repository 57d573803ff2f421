/* Model tet_springs: a tetrahedral mesh as mass points with springs that keep edge lengths, face areas and tetrahedron
 * volumes (paper B section 4.1, corrected: README of sim).
 *
 * Keys: k_distance_J, k_area_J, k_volume_J (absent: derived from E, nu and h; 0: no such component), c_distance_Js,
 * c_area_Js, c_volume_Js (damping of the constraint, 0), weights ("equal": every spring of a kind has its constant,
 * "volume": in proportion to its volume and size, spring_law.h; absent: equal where constants are given, volume where
 * they are derived), fill (true: where the surface cuts voxels of known filled shares, weights by volume and masses
 * count the part inside), recover (true: recovery from inversion, spring_lattice.h; with solver verlet or rk4).
 *
 * Derived constants and masses follow the regions of the body, given ones hold for all of them. Constants that vary
 * over the body are on its spring_grid (paper B section 3.5) in place of their keys; with a grid there are area springs
 * only when it, or the key, gives their constant. With k_area_J 0 the derived constants of edges and volumes give the
 * same moduli without area springs, in about half the time. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/tuning.h"
#include "server/sim/springs/spring_lattice.h"

#include <string.h>

/* the corner of a tetrahedron that no other of the five of its voxel has; -1: none, it is the middle one */
static int own_corner(const int32_t five[20], int t)
{
    for (int k = 0; k < 4; k++) {
        int n = 0;
        for (int i = 0; i < 20; i++) n += five[i] == five[4 * t + k];
        if (n == 1) return k;
    }
    return -1;
}

/* own corners of the tetrahedra of voxels; a mesh that is not of voxels has none */
static pal_err find_own_corners(const pal_prepared *mesh, pal_build *build)
{
    const pal_tets *tets = &mesh->tets;
    if (mesh->hexes.n_hex == 0 || tets->n_tet != 5 * mesh->hexes.n_hex) return PAL_ERR_OK;
    int8_t *own = PAL_NEW(build->arena, int8_t, tets->n_tet);
    if (!own) return PAL_ERR_MEMORY;
    for (int t = 0; t < tets->n_tet; t++) own[t] = (int8_t)own_corner(tets->tet + 20 * (t / 5), t % 5);
    build->body->own_corner = own;
    return PAL_ERR_OK;
}

/* A quarter of each tetrahedron's mass, of the material at its centre, to each corner. In voxels a node is a corner of
 * 32 tetrahedra or of 8, with five times the mass and half of the stiffness for it, so the four tetrahedra at a voxel's
 * corners give more to the node that they have for themselves. Mass goes between two sets of four corners with the same
 * centre and moments of inertia, which slow motions do not feel */
static void lump_mass(const pal_body_def *def, const pal_tets *tets, const pal_body *body, double *mass_kg)
{
    for (int t = 0; t < tets->n_tet; t++) {
        const int32_t *c = tets->tet + 4 * t;
        const double *x = tets->x, *o = x + 3 * c[0];
        double e[3], n[3], centre[3] = {0};
        pal_material at;
        for (int k = 0; k < 4; k++) pal_axpy3(centre, 0.25, x + 3 * c[k]);
        pal_material_at(def, centre, &at);
        pal_sub3(e, x + 3 * c[1], o);
        pal_normal3(n, o, x + 3 * c[2], x + 3 * c[3]);
        double mass = at.density_kg_m3 * pal_dot3(e, n) / 6 * (body->fill ? (double)body->fill[t] : 1);
        const int own = body->own_corner ? body->own_corner[t] : -1;
        for (int k = 0; k < 4; k++) mass_kg[c[k]] += mass * pal_body_tet_share(own, k);
    }
}

static const char *const effect_name[3] = {"edge_distance", "face_area", "tet_volume"},
                         *const k_key[3] = {"k_distance_J", "k_area_J", "k_volume_J"},
                         *const c_key[3] = {"c_distance_Js", "c_area_Js", "c_volume_Js"};

static pal_err is_without_area(pal_config_entry *item, const pal_spring_grid *grid, bool *out, pal_diagnostic *diag)
{
    bool on_grid = grid->k_J[PAL_SPRING_DISTANCE] || grid->k_J[PAL_SPRING_AREA] || grid->k_J[PAL_SPRING_VOLUME];
    double k_J = on_grid ? 0 : -1;
    PAL_TRY(pal_entry_read_number(item, k_key[PAL_SPRING_AREA], 0, 1e60, &k_J, diag));
    *out = k_J == 0 && !grid->k_J[PAL_SPRING_AREA];
    return PAL_ERR_OK;
}

static pal_err add_spring(pal_config_entry *item, pal_spring_kind kind, const pal_spring_grid *grid,
                          pal_component_list *out, pal_diagnostic *diag)
{
    double k_J = -1, c_Js = 0;
    bool without_area = false;
    const char *weights = NULL;
    PAL_TRY(pal_entry_read_number(item, k_key[kind], 0, 1e60, &k_J, diag));
    PAL_TRY(pal_entry_read_number(item, c_key[kind], 0, 1e60, &c_Js, diag));
    PAL_TRY(pal_entry_read_text(item, "weights", &weights, diag));
    PAL_TRY(is_without_area(item, grid, &without_area, diag));
    if (grid->k_J[kind] && pal_entry_has(item, k_key[kind]))
        return PAL_REFUSE(diag, "%s.%s: stands beside a grid that gives the same", item->path, k_key[kind]);
    if (k_J == 0 || (kind == PAL_SPRING_AREA && without_area)) return PAL_ERR_OK;
    pal_config_entry *row = &out->row[out->n_row++];
    pal_entry_init(row, item->path, effect_name[kind]);
    if (without_area) PAL_TRY(pal_entry_put_bool(row, "without_area", true, diag));
    if (k_J > 0) PAL_TRY(pal_entry_put_number(row, "k_J", k_J, diag));
    if (c_Js > 0) PAL_TRY(pal_entry_put_number(row, "c_Js", c_Js, diag));
    if (weights) PAL_TRY(pal_entry_put_text(row, "weights", weights, diag));
    return PAL_ERR_OK;
}

/* the filled shares, for weights by volume alone */
static pal_err take_fill(pal_config_entry *item, pal_build *build)
{
    const pal_prepared *mesh = build->def->mesh;
    const pal_spring_grid *grid = &build->def->spring_grid;
    const char *weights = NULL;
    bool fill = true, given = false;
    PAL_TRY(pal_entry_read_bool(item, "fill", &fill, build->diag));
    PAL_TRY(pal_entry_read_text(item, "weights", &weights, build->diag));
    for (int k = 0; k < 3; k++) {
        double k_J = 0;
        PAL_TRY(pal_entry_read_number(item, k_key[k], 0, 1e60, &k_J, build->diag));
        given |= k_J > 0 || grid->k_J[k];
    }
    bool by_volume = weights ? !strcmp(weights, "volume") : !given;
    if (!fill || !by_volume || !mesh->hexes.measured || mesh->tets.n_tet != 5 * mesh->hexes.n_hex) return PAL_ERR_OK;
    float *share = PAL_NEW(build->arena, float, mesh->tets.n_tet);
    if (!share) return PAL_ERR_MEMORY;
    /* a voxel that is only touched keeps a floor, so that no node is without mass */
    for (int t = 0; t < mesh->tets.n_tet; t++) share[t] = fmaxf(mesh->hexes.fill[t / 5], (float)PAL_FILL_MIN);
    build->body->fill = share;
    return PAL_ERR_OK;
}

static pal_err list(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    out->n_row = 0;
    for (int kind = PAL_SPRING_DISTANCE; kind <= PAL_SPRING_VOLUME; kind++)
        PAL_TRY(add_spring(item, (pal_spring_kind)kind, &build->def->spring_grid, out, build->diag));
    if (build->def->material.damping_1_s != 0) pal_entry_init(&out->row[out->n_row++], item->path, "viscous");
    if (!build->def->solver.name[0]) pal_entry_init(&out->row[out->n_row++], item->path, "verlet");
    return PAL_ERR_OK;
}

static pal_err build(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    const pal_prepared *mesh = build->def->mesh;
    pal_body *body = build->body;
    PAL_TRY(pal_spring_grid_check(build->def, build->diag));
    PAL_TRY(list(item, build, out));
    PAL_TRY(take_fill(item, build));
    const char *solver = build->def->solver.name;
    const bool can = !solver[0] || !strcmp(solver, "verlet") || !strcmp(solver, "rk4");
    bool recover = can;
    PAL_TRY(pal_entry_read_bool(item, "recover", &recover, build->diag));
    if (recover && !can) return PAL_REFUSE(build->diag, "%s.recover: goes with solver verlet or rk4 only", item->path);
    PAL_TRY(pal_entry_check_unused(item, build->diag));

    PAL_TRY(pal_body_allocate(body, build->arena, mesh->tets.n_node));
    memcpy(body->x_rest, mesh->tets.x, 3 * sizeof(double) * (size_t)body->n_node);
    memcpy(body->x, body->x_rest, 3 * sizeof(double) * (size_t)body->n_node);
    PAL_TRY(find_own_corners(mesh, build));
    lump_mass(build->def, &mesh->tets, body, body->mass_kg);
    for (int i = 0; i < body->n_node; i++)
        if (!(body->mass_kg[i] > 0))
            return PAL_REFUSE(build->diag, "body \"%s\": node %d has mass %g kg", body->name, i, body->mass_kg[i]);
    body->tets = &mesh->tets;
    body->display.surface = &mesh->surface;
    body->display.skin = mesh->skin.n_vertex > 0 ? &mesh->skin : NULL;
    body->edge_m = mesh->tets.edge_m;
    if (recover) PAL_TRY(pal_spring_lattice_make(body, build->arena));
    PAL_TRY(pal_node_order_make(body->x_rest, body->n_node, body->edge_m, build->arena, &body->node_order));
    PAL_TRY(pal_node_order_make_single(body->node_order, body->edge_m, build->arena));
    const int max = body->n_node / PAL_PART_NODES, threads = build->scene->threads;
    const int n_part = threads < max ? threads : max;
    return n_part > 1 ? pal_node_order_divide(body->node_order, n_part, build->arena) : PAL_ERR_OK;
}

const pal_model pal_model_tet_springs = {.name = "tet_springs", .build = build, .list = list};
