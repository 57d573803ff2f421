/* Complexes of cells made in the tests (pal_cells_free); sizes in metres. A shape that cannot be made fails the test.
 */
#ifndef TESTS_MESH_SOLIDS_H
#define TESTS_MESH_SOLIDS_H
#include "server/mesh/cell_shapes.h"
#include "server/num/random.h"
#include "tests/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* bricks of edges a, b, c */
static inline pal_cells solid_bricks(int nx, int ny, int nz, double a, double b, double c)
{
    pal_cells out = {0};
    pal_note note = {"no note"};
    const int32_t n[3] = {nx, ny, nz};
    const double size[3] = {nx * a, ny * b, nz * c};
    if (pal_cells_block(n, size, &out, &note)) CHECK_FAIL("%s", note.text);
    return out;
}

static inline pal_cells solid_block(int nx, int ny, int nz)
{
    return solid_bricks(nx, ny, nz, 1, 1, 1);
}

static inline pal_cells solid_torus(int n, int m)
{
    pal_cells out = {0};
    pal_note note = {"no note"};
    if (pal_cells_torus(n, m, 3, 1, &out, &note)) CHECK_FAIL("%s", note.text);
    return out;
}

static inline pal_cells solid_tube(int around, int wall, int along)
{
    pal_cells out = {0};
    pal_note note = {"no note"};
    const int32_t n[3] = {around, wall, along};
    if (pal_cells_tube(n, 1, 2, 2, &out, &note)) CHECK_FAIL("%s", note.text);
    return out;
}

/* moves every vertex by up to amount along each axis */
static inline void solid_jitter(pal_cells *c, double amount, uint64_t seed)
{
    for (int32_t i = 0; i < 3 * c->n_vertex; i++) c->x[i] += amount * (2 * pal_random_unit(seed, (uint64_t)i) - 1);
}

/* one cell from loops that end in -1, the last in -2; vertices must all be used */
static inline pal_cells solid_of(int n_vertex, const double *x, int n_cell, const int32_t *const *cell)
{
    pal_cells out = {0};
    pal_note note = {"no note"};
    pal_cell_loops l = {.n_vertex = n_vertex, .n_cell = n_cell};
    int32_t start[64] = {0}, loop[512] = {0}, corner[2048];
    int n_loop = 0, n = 0;
    for (int i = 0; i < n_cell; i++) {
        for (const int32_t *at = cell[i]; *at != -2; at++) {
            if (*at >= 0)
                corner[n++] = *at;
            else
                loop[++n_loop] = n;
        }
        loop[++n_loop] = n;
        start[i + 1] = n_loop;
    }
    double copy[3 * 256];
    memcpy(copy, x, (size_t)n_vertex * 3 * sizeof *copy);
    l.x = copy, l.cell = start, l.loop = loop, l.corner = corner;
    if (pal_cells_make(&l, &out, &note)) CHECK_FAIL("%s", note.text);
    return out;
}

/* a prism on n corners, one cell; n = 3 is a wedge, 4 a hexahedron */
static inline pal_cells solid_prism(int n)
{
    double x[3 * 256];
    int32_t cell[2048], *at = cell;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 2; k++) {
            double a = 6.283185307179586 * i / n, *to = x + 3 * (i + k * n);
            to[0] = cos(a), to[1] = sin(a), to[2] = k;
        }
    for (int i = n - 1; i >= 0; i--) *at++ = i;
    *at++ = -1;
    for (int i = 0; i < n; i++) *at++ = n + i;
    for (int i = 0; i < n; i++) {
        int j = (i + 1) % n;
        const int32_t side[5] = {-1, i, j, n + j, n + i};
        memcpy(at, side, sizeof side);
        at += 5;
    }
    *at = -2;
    const int32_t *list[1] = {cell};
    return solid_of(2 * n, x, 1, list);
}

/* a cube of edge 2 cut into six pyramids that meet in its middle, vertex 8: inner edges of three faces */
static inline pal_cells solid_pyramids(void)
{
    static const int32_t quad[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                       {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    double x[27] = {0};
    int32_t cell[6][32];
    const int32_t *list[6];
    for (int v = 0; v < 8; v++)
        for (int a = 0; a < 3; a++) x[3 * v + a] = v >> a & 1 ? 1 : -1;
    for (int c = 0; c < 6; c++) {
        int32_t *at = cell[c];
        for (int k = 0; k < 4; k++) *at++ = quad[c][k];
        for (int k = 0; k < 4; k++) *at++ = -1, *at++ = quad[c][(k + 1) % 4], *at++ = quad[c][k], *at++ = 8;
        *at = -2;
        list[c] = cell[c];
    }
    return solid_of(9, x, 6, list);
}

/* the same without the cells that are not kept; frees it */
static inline pal_cells solid_keep(pal_cells from, const bool *keep)
{
    pal_cells out = {0};
    pal_cell_loops l = {0};
    pal_note note = {"no note"};
    if (pal_cells_loops(&from, &l) || pal_cell_loops_keep(&l, keep, NULL) || pal_cells_make(&l, &out, &note))
        CHECK_FAIL("%s", note.text);
    pal_cell_loops_free(&l);
    pal_cells_free(&from);
    return out;
}

/* the edge between two vertices; -1: none */
static inline int32_t solid_edge(const pal_cells *c, int32_t a, int32_t b)
{
    for (int32_t k = c->vertex_edge.start[a]; k < c->vertex_edge.start[a + 1]; k++) {
        const int32_t e = c->vertex_edge.item[k], *end = c->edge[e].vertex;
        if (end[0] == b || end[1] == b) return e;
    }
    return -1;
}
#endif
