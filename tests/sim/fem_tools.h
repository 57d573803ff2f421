/* Worlds of finite elements with tools: the slab and ball of tool_scene.h with one hexahedron a voxel. */
#ifndef TESTS_SIM_FEM_TOOLS_H
#define TESTS_SIM_FEM_TOOLS_H
#include "server/base/arena.h"
#include "tests/sim/tool_scene.h"

typedef struct fem_scene {
    tool_scene s;
    bool own_hexes;
} fem_scene;

static inline bool fem_ready(fem_scene *f, bool own_hexes)
{
    pal_note note = {""};
    f->own_hexes = own_hexes;
    if (own_hexes && pal_hexes_find(&f->s.mesh.tets, &f->s.mesh.hexes, &note)) {
        printf("  %s\n", note.text);
        return false;
    }
    pal_item_init(&f->s.scene->body[0].model, "model", "fem");
    pal_item_init(&f->s.scene->body[0].solver, "solver", "implicit_euler");
    /* as soft tissue, with little damping: what settles settles by itself */
    f->s.scene->body[0].material.density_kg_m3 = 1000;
    f->s.scene->body[0].material.damping_1_s = 4;
    return true;
}

/* slab of nx x ny x nz voxels of h, lowest nodes held, nodes shown; ball of radius 5 cm, skinned; not yet open */
static inline bool fem_slab(fem_scene *f, int nx, int ny, int nz, double h_m, int n_tool, double radius_m, double cap_N)
{
    memset(f, 0, sizeof *f);
    return slab_scene(&f->s, nx, ny, nz, h_m, n_tool, radius_m, cap_N) && fem_ready(f, true);
}

static inline bool fem_ball(fem_scene *f, int resolution, int n_tool, double radius_m, double cap_N)
{
    memset(f, 0, sizeof *f);
    return ball_scene(&f->s, resolution, true, n_tool, radius_m, cap_N) && fem_ready(f, f->s.mesh.hexes.n_hex == 0);
}

static inline void fem_close(fem_scene *f)
{
    if (!f->s.skinned) pal_hexes_free(&f->s.mesh.hexes);
    tool_scene_close(&f->s);
}

static inline double elastic_J(const tool_scene *s)
{
    return pal_world_energy_J(s->world) - pal_body_kinetic_J(s->body);
}
/* largest kinetic over elastic energy in n steps */
static inline double tremble(tool_scene *s, int n)
{
    double worst = 0;
    for (int i = 0; i < n; i++) {
        if (!step_world(s, 1)) return INFINITY;
        worst = fmax(worst, pal_body_kinetic_J(s->body) / elastic_J(s));
    }
    return worst;
}

/* the most that energy rose in a step, and the most force */
static inline void follow(tool_scene *s, int n, double *rise_J, double *force_N)
{
    for (int i = 0; i < n; i++) {
        double before = pal_world_energy_J(s->world);
        if (pal_world_step(s->world, s->scene->step_s)) {
            *rise_J = INFINITY;
            return;
        }
        *rise_J = fmax(*rise_J, pal_world_energy_J(s->world) - before);
        *force_N = fmax(*force_N, pal_norm3(tool_of(s, 0)->force_N));
    }
}
#endif
