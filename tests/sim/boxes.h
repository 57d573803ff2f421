/* Boxes of voxels for tests: nx x ny x nz voxels of edge h, five tetrahedra each, as a pal_prepared whose shown surface
 * is the boundary of the tetrahedra. Nodes are numbered x fastest. box_make gives a box without skin (output
 * "surface_out"), box_free frees it. Also a scene with one body from a box, and the world of one: box_bench_make, then
 * what a test changes of the scene, box_bench_start, box_bench_close. */
#ifndef TESTS_SIM_BOXES_H
#define TESTS_SIM_BOXES_H
#include "server/sim/def.h"
#include "server/sim/world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static inline int box_node(const int n[3], int i, int j, int k)
{
    return i + (n[0] + 1) * (j + (n[1] + 1) * k);
}

/* corners of a voxel are bits x 1, y 2, z 4; two mirrored splits by parity; corners in order of positive volume */
static inline void box_split(const int n[3], int i, int j, int k, int32_t tet[5][4])
{
    static const int split[2][5][4] = {{{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}},
                                       {{1, 3, 0, 5}, {2, 0, 3, 6}, {4, 0, 6, 5}, {7, 3, 5, 6}, {0, 3, 6, 5}}};
    for (int t = 0; t < 5; t++) {
        double e[3][3];
        for (int c = 0; c < 4; c++) {
            int bit = split[(i + j + k) & 1][t][c];
            tet[t][c] = box_node(n, i + (bit & 1), j + (bit >> 1 & 1), k + (bit >> 2));
            for (int q = 0; q < 3 && c > 0; q++) e[c - 1][q] = (bit >> q & 1) - (split[(i + j + k) & 1][t][0] >> q & 1);
        }
        double volume = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) -
                        e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
                        e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
        if (volume < 0) {
            int32_t swap = tet[t][2];
            tet[t][2] = tet[t][3];
            tet[t][3] = swap;
        }
    }
}

/* shown surface: the boundary faces with their nodes renumbered in ascending order */
static inline pal_err box_surface(pal_prepared *box)
{
    const pal_tets *tets = &box->tets;
    pal_surface *s = &box->surface;
    int32_t *shown = calloc((size_t)tets->n_node, sizeof *shown);
    s->x = calloc(3 * (size_t)tets->n_node, sizeof(double));
    s->tri = calloc(3 * (size_t)tets->n_face, sizeof *s->tri);
    if (!shown || !s->x || !s->tri) {
        free(shown);
        return PAL_ERR_MEMORY;
    }
    for (int i = 0; i < tets->n_node; i++) {
        if (!tets->on_surface[i]) continue;
        memcpy(s->x + 3 * s->n_vertex, tets->x + 3 * i, 3 * sizeof(double));
        shown[i] = s->n_vertex++;
    }
    s->n_tri = tets->n_face;
    for (int i = 0; i < 3 * s->n_tri; i++) s->tri[i] = shown[tets->face[i]];
    free(shown);
    return PAL_ERR_OK;
}

static inline void box_free(pal_prepared *box)
{
    pal_tets_free(&box->tets);
    pal_surface_free(&box->surface);
    memset(box, 0, sizeof *box);
}

/* the box's lowest corner is the origin */
static inline pal_err box_make(int nx, int ny, int nz, double h_m, pal_prepared *box)
{
    const int n[3] = {nx, ny, nz};
    pal_tets *tets = &box->tets;
    memset(box, 0, sizeof *box);
    tets->n_node = (nx + 1) * (ny + 1) * (nz + 1);
    tets->x = calloc(3 * (size_t)tets->n_node, sizeof(double));
    tets->tet = calloc(20 * (size_t)nx * (size_t)ny * (size_t)nz, sizeof *tets->tet);
    tets->h_m = h_m;
    if (!tets->x || !tets->tet) return PAL_ERR_MEMORY;
    for (int k = 0; k <= nz; k++)
        for (int j = 0; j <= ny; j++)
            for (int i = 0; i <= nx; i++) {
                double *x = tets->x + 3 * box_node(n, i, j, k);
                x[0] = h_m * i, x[1] = h_m * j, x[2] = h_m * k;
            }
    for (int k = 0; k < nz; k++)
        for (int j = 0; j < ny; j++)
            for (int i = 0; i < nx; i++) {
                int32_t five[5][4];
                box_split(n, i, j, k, five);
                memcpy(tets->tet + 4 * tets->n_tet, five, sizeof five);
                tets->n_tet += 5;
            }
    PAL_TRY(pal_tets_find_boundary(tets));
    return box_surface(box);
}

/* one tetrahedron with corners at 0 and h along the axes */
static inline pal_err box_one_tet(double h_m, pal_prepared *box)
{
    pal_tets *tets = &box->tets;
    memset(box, 0, sizeof *box);
    tets->n_node = 4, tets->n_tet = 1, tets->h_m = h_m;
    tets->x = calloc(12, sizeof(double));
    tets->tet = calloc(4, sizeof *tets->tet);
    if (!tets->x || !tets->tet) return PAL_ERR_MEMORY;
    for (int c = 0; c < 3; c++) tets->x[3 * (c + 1) + c] = h_m;
    for (int c = 0; c < 4; c++) tets->tet[c] = c;
    PAL_TRY(pal_tets_find_boundary(tets));
    return box_surface(box);
}

/* a scene with one body, no tools; `held`: lowest 5 % held; effects: gravity when asked, finite_guard */
static inline pal_scene *box_scene(const pal_prepared *box, bool held, bool gravity)
{
    pal_scene *scene = calloc(1, sizeof *scene);
    if (!scene) abort();
    pal_scene_default(scene);
    scene->n_body = 1;
    pal_body_def *def = &scene->body[0];
    pal_body_default(def, "box", box);
    pal_item_init(&def->output, "output", "surface_out");
    def->n_support = held ? 1 : 0;
    def->n_effect = 0;
    if (gravity) pal_item_init(&def->effect[def->n_effect++], "effects[0]", "gravity");
    pal_item_init(&def->effect[def->n_effect++], "effects[1]", "finite_guard");
    return scene;
}

typedef struct box_bench {
    pal_prepared box;
    pal_scene *scene;
    pal_world *world;
    pal_body *body;
} box_bench;

/* the box and its scene, without finite_guard */
static inline bool box_bench_make(box_bench *b, const int n[3], double h_m, bool held, bool gravity)
{
    memset(b, 0, sizeof *b);
    if (box_make(n[0], n[1], n[2], h_m, &b->box)) return false;
    b->scene = box_scene(&b->box, held, gravity);
    b->scene->body[0].n_effect = gravity;
    return true;
}

/* false: says why */
static inline bool box_bench_start(box_bench *b)
{
    pal_note note = {""};
    if (pal_world_create(b->scene, &note, &b->world)) {
        printf("  %s\n", note.text);
        return false;
    }
    b->body = pal_world_body(b->world, 0);
    return true;
}

static inline void box_bench_close(box_bench *b)
{
    pal_world_destroy(b->world);
    free(b->scene);
    box_free(&b->box);
}
#endif
