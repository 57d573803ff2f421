/* Model adaptive_springs: a triangle surface as mass points on springs that refine where the surface is pressed, moves
 * or bends (paper C; adaptive_surface.h has the masses, the stiffness laws and the active part).
 *
 * Keys: levels (2; 1 to 10), start_level (0, below levels), thickness_m (0.003), mass_kg (absent: density * thickness *
 * area of the coarse triangles, the density of regions at their middles), k_spring_N_m (of a spring of level 0; absent:
 * sqrt(3)/2 E thickness), c_spring_Ns_m (absent: 0.02 sqrt(k_0 m_0); 0: none), law ("membrane" | "paper"), mass
 * ("faces" | "nodes"), place ("linear" | "butterfly"), k_shape_N_m (anchor of a node of level 0; absent: 0.3 k_0; 0: no
 * such component), c_shape_Ns_m (absent: 0.6 sqrt(k'_0 m_0), a damping ratio of 0.3), frame ("body": anchors on the
 * best-fit rigid frame, "world": on the rest position as in the paper; absent: world where a node is fixed, else body),
 * refine (true; false: no such component), memory_MB (512; MiB of the body on its finest level with its components,
 * tools and display). m_0 is the mass of a node of level 0.
 *
 * Departure: the paper gives spring constants as numbers. A triangular lattice of springs k has Young's modulus 2 k /
 * sqrt(3) in its plane (per length, Poisson ratio 1/3), so that a sheet of that thickness stretches as its material. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/surface/adaptive_surface.h"

#include <string.h>

typedef struct keys {
    pal_adaptive_options adaptive;
    double thickness_m, k_spring_N_m, c_spring_Ns_m, k_shape_N_m, c_shape_Ns_m; /* below 0: not given */
    const char *frame;                                                          /* NULL: not given */
    bool refine;
} keys;

static pal_err read_keys(pal_config_entry *item, keys *out, pal_diagnostic *diag)
{
    static const char *const laws[] = {"membrane", "paper"}, *const masses[] = {"faces", "nodes"};
    static const char *const places[] = {"linear", "butterfly"}, *const frames[] = {"body", "world"};
    int paper = 0, nodes = 0, butterfly = 0, frame = 0;
    double memory_MB = 512;
    *out = (keys){.adaptive = {.n_level = 2},
                  .thickness_m = 0.003,
                  .k_spring_N_m = -1,
                  .c_spring_Ns_m = -1,
                  .k_shape_N_m = -1,
                  .c_shape_Ns_m = -1,
                  .refine = true};
    pal_adaptive_options *adaptive = &out->adaptive;
    PAL_TRY(pal_entry_read_count(item, "levels", 1, PAL_LEVELS_MAX, &adaptive->n_level, diag));
    PAL_TRY(pal_entry_read_count(item, "start_level", 0, PAL_LEVELS_MAX, &adaptive->start_level, diag));
    if (adaptive->start_level >= adaptive->n_level)
        return PAL_REFUSE(diag, "%s.start_level: %d, wanted 0 to %d as levels is %d", item->path, adaptive->start_level,
                          adaptive->n_level - 1, adaptive->n_level);
    PAL_TRY(pal_entry_read_number(item, "thickness_m", 1e-9, 1e9, &out->thickness_m, diag));
    PAL_TRY(pal_entry_read_number(item, "mass_kg", 1e-30, 1e30, &adaptive->mass_kg, diag));
    PAL_TRY(pal_entry_read_number(item, "k_spring_N_m", 1e-30, 1e60, &out->k_spring_N_m, diag));
    PAL_TRY(pal_entry_read_number(item, "c_spring_Ns_m", 0, 1e60, &out->c_spring_Ns_m, diag));
    PAL_TRY(pal_entry_read_choice(item, "law", laws, 2, &paper, diag));
    PAL_TRY(pal_entry_read_choice(item, "mass", masses, 2, &nodes, diag));
    PAL_TRY(pal_entry_read_choice(item, "place", places, 2, &butterfly, diag));
    PAL_TRY(pal_entry_read_number(item, "k_shape_N_m", 0, 1e60, &out->k_shape_N_m, diag));
    PAL_TRY(pal_entry_read_number(item, "c_shape_Ns_m", 0, 1e60, &out->c_shape_Ns_m, diag));
    PAL_TRY(pal_entry_read_choice(item, "frame", frames, 2, &frame, diag));
    PAL_TRY(pal_entry_read_bool(item, "refine", &out->refine, diag));
    PAL_TRY(pal_entry_read_number(item, "memory_MB", 1, 1e6, &memory_MB, diag));
    adaptive->law = paper ? PAL_ADAPTIVE_PAPER : PAL_ADAPTIVE_MEMBRANE;
    adaptive->mass = nodes ? PAL_MASS_BY_NODES : PAL_MASS_BY_FACES;
    adaptive->place = butterfly ? PAL_MIDPOINT_BUTTERFLY : PAL_MIDPOINT_LINEAR;
    adaptive->budget_byte = (size_t)(memory_MB * 1048576);
    out->frame = pal_entry_has(item, "frame") ? frames[frame] : NULL;
    return pal_entry_check_unused(item, diag);
}

static double surface_mass(const pal_body_def *def, double thickness_m)
{
    const pal_surface *surface = &def->mesh->surface;
    double sum = 0;
    for (int t = 0; t < surface->n_tri; t++) {
        const double *x[3];
        double n[3], middle[3];
        pal_material at;
        for (int c = 0; c < 3; c++) x[c] = surface->x + 3 * (size_t)surface->tri[3 * t + c];
        for (int c = 0; c < 3; c++) middle[c] = (x[0][c] + x[1][c] + x[2][c]) / 3;
        pal_normal3(n, x[0], x[1], x[2]);
        pal_material_at(def, middle, &at);
        sum += at.density_kg_m3 * pal_norm3(n) / 2;
    }
    return thickness_m * sum;
}

/* corners are checked here because the mass is taken before the levels are made */
static pal_err check_surface(const pal_body_def *def, const char *path, pal_diagnostic *diag)
{
    const pal_surface *surface = &def->mesh->surface;
    if (surface->n_tri < 1)
        return PAL_REFUSE(diag,
                          "body \"%s\" %s: a mesh with %d surface triangles; \"adaptive_springs\" is made of them",
                          def->name, path, surface->n_tri);
    for (int i = 0; i < 3 * surface->n_tri; i++)
        if (surface->tri[i] < 0 || surface->tri[i] >= surface->n_vertex)
            return PAL_REFUSE(diag, "body \"%s\" %s: triangle %d has corner %d of %d vertices", def->name, path, i / 3,
                              surface->tri[i], surface->n_vertex);
    return PAL_ERR_OK;
}

/* a refusal names another model where the surface cannot be split */
static pal_err make_surface(const keys *k, const char *path, pal_build *build)
{
    const pal_surface *surface = &build->def->mesh->surface;
    pal_adaptive_surface *adaptive;
    pal_diagnostic reason = {{0}};
    pal_surface_topology topology = {.manifold = true, .oriented = true};
    pal_err err = pal_adaptive_make(surface, &k->adaptive, build->body, build->arena, &reason, &adaptive);
    if (!err || err == PAL_ERR_MEMORY) return err;
    if (err == PAL_ERR_REFUSED) PAL_TRY(pal_surface_check(surface, &topology));
    bool split = topology.manifold && topology.oriented;
    return pal_diagnostic_set(build->diag, err, "body \"%s\" %s: %s%s", build->body->name, path, reason.text,
                              split ? "" : " (model tet_springs takes any surface: it fills voxels)");
}

static void put(pal_config_entry *row, const char *key, double number)
{
    if (number >= 0) pal_entry_put_number(row, key, number, NULL);
}

/* the components derive what the scene does not give, so that it follows a live material edit */
static pal_err list(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    const pal_body_def *def = build->def;
    pal_config_entry *row = out->row;
    keys k;
    PAL_TRY(read_keys(item, &k, build->diag));
    pal_entry_init(row, item->path, "edge_spring");
    put(row, "k_N_m", k.k_spring_N_m);
    put(row++, "c_Ns_m", k.c_spring_Ns_m);
    if (k.k_shape_N_m != 0) {
        pal_entry_init(row, item->path, "shape_spring");
        put(row, "k_N_m", k.k_shape_N_m);
        put(row, "c_Ns_m", k.c_shape_Ns_m);
        if (k.frame) PAL_TRY(pal_entry_put_text(row, "frame", k.frame, build->diag));
        row++;
    }
    if (def->material.damping_1_s != 0) pal_entry_init(row++, item->path, "viscous");
    if (k.refine && k.adaptive.n_level > 1) pal_entry_init(row++, item->path, "refine");
    if (!def->solver.name[0]) pal_entry_init(row++, item->path, "rk4");
    out->n_row = (int)(row - out->row);
    return PAL_ERR_OK;
}

static pal_err build(pal_config_entry *item, pal_build *build, pal_component_list *out)
{
    keys k;
    PAL_TRY(read_keys(item, &k, build->diag));
    PAL_TRY(check_surface(build->def, item->path, build->diag));
    if (k.adaptive.mass_kg == 0) k.adaptive.mass_kg = surface_mass(build->def, k.thickness_m);
    PAL_TRY(make_surface(&k, item->path, build));
    return list(item, build, out);
}

const pal_model pal_model_adaptive_springs = {.name = "adaptive_springs", .build = build, .list = list};
