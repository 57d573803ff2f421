/* Beams of model fem for tests: boxes of boxes.h with their hexahedra, and a scene with one of them. The reference beam
 * is 0.2 x 0.05 x 0.05 m along x, held at x = 0, E 1e5 Pa, 1000 kg/m^3. */
#ifndef TESTS_SIM_FEM_BEAM_H
#define TESTS_SIM_FEM_BEAM_H
#include "server/sim/world.h"
#include "tests/check.h"
#include "tests/sim/boxes.h"

typedef struct fem_beam {
    pal_prepared mesh;
    pal_scene *scene;
    pal_body_def *def;
    pal_world *world;
    pal_body *body;
    double length_m, width_m;
} fem_beam;

/* nx x ny x nz voxels of edge h; held at x = 0 unless free; no gravity, no damping */
static inline void beam_make(fem_beam *b, int nx, int ny, int nz, double h_m, bool held)
{
    pal_note note = {{0}};
    memset(b, 0, sizeof *b);
    if (box_make(nx, ny, nz, h_m, &b->mesh)) abort();
    if (pal_hexes_find(&b->mesh.tets, &b->mesh.hexes, &note)) printf("  %s\n", note.text), abort();
    b->scene = box_scene(&b->mesh, held, false);
    b->def = &b->scene->body[0];
    pal_item_init(&b->def->model, "model", "fem");
    pal_item_init(&b->def->solver, "solver", "implicit_euler");
    b->def->n_effect = 0;
    b->def->material = (pal_material){.young_Pa = 1e5, .poisson = 0.45, .density_kg_m3 = 1000};
    b->def->support[0] = (pal_support){.low_m = {-1, -1e9, -1e9}, .high_m = {1e-9, 1e9, 1e9}};
    b->length_m = nx * h_m, b->width_m = ny * h_m;
}
/* the reference beam with n voxels across */
static inline void beam_reference(fem_beam *b, int n)
{
    beam_make(b, 4 * n, n, n, 0.05 / n, true);
}
static inline void beam_element(fem_beam *b, const char *element, const char *law)
{
    pal_item_put_text(&b->def->model, "element", element, NULL);
    pal_item_put_text(&b->def->model, "law", law, NULL);
}
static inline void beam_solver(fem_beam *b, const char *name)
{
    pal_item_init(&b->def->solver, "solver", name);
}
static inline void beam_key(fem_beam *b, const char *key, double number)
{
    pal_item_put_number(&b->def->solver, key, number, NULL);
}
static inline pal_err beam_open(fem_beam *b, pal_note *note)
{
    pal_err err = pal_world_create(b->scene, note, &b->world);
    if (err)
        printf("  %s\n", note->text);
    else
        b->body = pal_world_body(b->world, 0);
    return err;
}
static inline void beam_free(fem_beam *b)
{
    pal_world_destroy(b->world);
    free(b->scene);
    pal_hexes_free(&b->mesh.hexes);
    box_free(&b->mesh);
}

/* a traction along z on the end face, as the corners of its voxels bear it (middle nodes of tet10 bear none) */
static inline void beam_load_end(fem_beam *b, double traction_Pa)
{
    const pal_tets *tets = &b->mesh.tets;
    double h = tets->h_m;
    for (int i = 0; i < tets->n_node; i++) {
        const double *x = tets->x + 3 * i;
        if (fabs(x[0] - b->length_m) > 1e-6 * h) continue;
        double share = traction_Pa * h * h;
        for (int c = 1; c < 3; c++)
            if (fabs(x[c]) < 1e-6 * h || fabs(x[c] - b->width_m) < 1e-6 * h) share *= 0.5;
        pal_world_load(b->world, 0, i, (double[3]){0, 0, share});
    }
}
/* mean displacement of the nodes at the end */
static inline void beam_end(const fem_beam *b, double mean[3])
{
    int n = 0;
    mean[0] = mean[1] = mean[2] = 0;
    for (int i = 0; i < b->body->n_node; i++) {
        if (fabs(b->body->x_rest[3 * i] - b->length_m) > 1e-9) continue;
        for (int c = 0; c < 3; c++) mean[c] += b->body->x[3 * i + c] - b->body->x_rest[3 * i + c];
        n++;
    }
    for (int c = 0; c < 3; c++) mean[c] /= n;
}
#endif
