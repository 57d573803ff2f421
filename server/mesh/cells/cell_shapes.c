/* Control cells of plain solids: lattices of bricks, and the torus. */
#include "server/mesh/cells/cell_shapes.h"

#include "server/base/heap.h"
#include "server/mesh/cells/cell_lattice.h"

#include <math.h>

static pal_err check_count(const char *name, int32_t n, int32_t min, pal_diagnostic *diag)
{
    if (n >= min && n <= PAL_CELL_SHAPE_MAX) return PAL_ERR_OK;
    return pal_diagnostic_set(diag, n < min ? PAL_ERR_REFUSED : PAL_ERR_BUDGET, "cells: %s is %d, must be %d to %d",
                              name, n, min, PAL_CELL_SHAPE_MAX);
}

/* above is excluded */
static pal_err check_length(const char *name, double length, double above, pal_diagnostic *diag)
{
    if (length > above && length <= 1e8) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "cells: %s is %g m, must be above %g and at most 1e8", name, length, above);
}

/* corner i of n equal steps from low to high, both ends to the bit */
static double step_at(int32_t i, int32_t n, double low, double high)
{
    return i == n ? high : low + (high - low) * i / n;
}

/* BUDGET: more cells than are made, `times` for each of three counts */
static pal_err check_cells(const int32_t n[3], int times, pal_diagnostic *diag)
{
    double n_cell = (double)times * n[0] * n[1] * n[2];
    if (n_cell <= PAL_CELL_SHAPE_MAX) return PAL_ERR_OK;
    return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "cells: a shape of %.0f cells, at most %d are made", n_cell,
                              PAL_CELL_SHAPE_MAX);
}

pal_err pal_cells_block(const int32_t n[3], const double length_scale_m[3], pal_cells *out, pal_diagnostic *diag)
{
    static const char *const count[3] = {"number of cells along x", "number of cells along y",
                                         "number of cells along z"};
    static const char *const size[3] = {"size along x", "size along y", "size along z"};
    pal_cell_lattice lattice = {.n = {n[0], n[1], n[2]}};
    for (int a = 0; a < 3; a++) {
        PAL_TRY(check_count(count[a], n[a], 1, diag));
        PAL_TRY(check_length(size[a], length_scale_m[a], 0, diag));
        lattice.low[a] = -length_scale_m[a] / 2, lattice.high[a] = length_scale_m[a] / 2;
    }
    PAL_TRY(check_cells(n, 1, diag));
    return pal_cell_lattice_make(&lattice, out, diag);
}

pal_err pal_cells_tube(const int32_t n[3], double inner_m, double outer_m, double length_m, pal_cells *out,
                       pal_diagnostic *diag)
{
    PAL_TRY(check_count("number of cells around", n[0], 3, diag));
    PAL_TRY(check_count("number of cells through the wall", n[1], 1, diag));
    PAL_TRY(check_count("number of cells along the tube", n[2], 1, diag));
    PAL_TRY(check_length("inner radius", inner_m, 0, diag));
    PAL_TRY(check_length("outer radius", outer_m, inner_m, diag));
    PAL_TRY(check_length("length", length_m, 0, diag));
    PAL_TRY(check_cells(n, 1, diag));
    const pal_cell_lattice lattice = {
        .n = {n[0], n[1], n[2]}, .round = true, .low = {0, inner_m, -length_m / 2}, .high = {0, outer_m, length_m / 2}};
    return pal_cell_lattice_make(&lattice, out, diag);
}

pal_err pal_cells_ring(int32_t n, double radius_m, double thick_m, pal_cells *out, pal_diagnostic *diag)
{
    const int32_t count[3] = {n, 1, 1};
    PAL_TRY(check_length("thickness", thick_m, 0, diag));
    PAL_TRY(check_length("radius", radius_m, thick_m / 2, diag));
    return pal_cells_tube(count, radius_m - thick_m / 2, radius_m + thick_m / 2, thick_m, out, diag);
}

/* Section of the torus: a square of (m + 1)^2 vertices, then m rings of 4 m vertices, each ring in the order of the
 * square's rim, which is ring 0. */
static int32_t outer_vertex(int32_t m, int32_t i)
{
    int32_t side = i / m, k = i % m, row = m + 1;
    return side == 0 ? k : side == 1 ? m + k * row : side == 2 ? m * row + m - k : (m - k) * row;
}

static int32_t ring_vertex(int32_t m, int32_t ring, int32_t i)
{
    i %= 4 * m;
    return ring == 0 ? outer_vertex(m, i) : (m + 1) * (m + 1) + (ring - 1) * 4 * m + i;
}

/* position of a vertex of the section in units of the tube's radius: the square reaches half of it, the rings change
 * gradually into the circle */
static void section_place(int32_t m, int32_t ring, int32_t i, double out[2])
{
    static const int turn[4][4] = {{1, 0, 0, 1}, {0, -1, 1, 0}, {-1, 0, 0, -1}, {0, 1, -1, 0}};
    const int *t = turn[i / m];
    double s = 2.0 * (i % m) / m - 1, angle = 2 * M_PI * (-3.0 / 8 + (double)i / (4 * m)), w = (double)ring / m;
    double h = 0.5 * sqrt(0.5), square[2] = {h * (t[0] * s - t[1]), h * (t[2] * s - t[3])};
    out[0] = (1 - w) * square[0] + w * cos(angle);
    out[1] = (1 - w) * square[1] + w * sin(angle);
}

/* place of each vertex of a section [][2] */
static void add_section(int32_t m, double *place)
{
    double h = 0.5 * sqrt(0.5);
    for (int32_t j = 0; j <= m; j++)
        for (int32_t i = 0; i <= m; i++) {
            double *to = place + 2 * (size_t)(j * (m + 1) + i);
            to[0] = step_at(i, m, -h, h), to[1] = step_at(j, m, -h, h);
        }
    for (int32_t ring = 1; ring <= m; ring++)
        for (int32_t i = 0; i < 4 * m; i++) section_place(m, ring, i, place + 2 * (size_t)ring_vertex(m, ring, i));
}

/* corners of cell k of a section: first along the square or the rim, then up or outward */
static void section_cell(int32_t m, int32_t k, int32_t corner[4])
{
    if (k < m * m) {
        int32_t v = k / m * (m + 1) + k % m;
        corner[0] = v, corner[1] = v + 1, corner[2] = v + m + 1, corner[3] = v + m + 2;
        return;
    }
    int32_t ring = (k - m * m) / (4 * m), i = (k - m * m) % (4 * m);
    /* the rim runs counter-clockwise, so outward is on its right: from the far corner back */
    corner[0] = ring_vertex(m, ring, i + 1), corner[1] = ring_vertex(m, ring, i);
    corner[2] = ring_vertex(m, ring + 1, i + 1), corner[3] = ring_vertex(m, ring + 1, i);
}

pal_err pal_cells_torus(int32_t n, int32_t m, double radius_m, double tube_m, pal_cells *out, pal_diagnostic *diag)
{
    PAL_TRY(check_count("number of cells around", n, 3, diag));
    PAL_TRY(check_count("number of cells across the middle", m, 1, diag));
    PAL_TRY(check_length("radius of the tube", tube_m, 0, diag));
    PAL_TRY(check_length("radius", radius_m, tube_m, diag));
    const int32_t count[3] = {n, m, m};
    PAL_TRY(check_cells(count, 5, diag));
    int32_t n_place = (m + 1) * (m + 1) + 4 * m * m;
    pal_cell_loops l = {0};
    double *place;
    PAL_ARRAY(&l.err, place, 2 * (size_t)n_place);
    if (place) add_section(m, place);
    /* the section lies in the plane of the radius and z; going round clockwise is its third direction */
    for (int32_t s = 0; s < n; s++) {
        double a = -2 * M_PI * s / n;
        int32_t here = n_place * s, there = n_place * ((s + 1) % n);
        for (int32_t v = 0; v < n_place && !l.err; v++) {
            double r = radius_m + tube_m * place[2 * v], x[3] = {r * cos(a), r * sin(a), tube_m * place[2 * v + 1]};
            pal_cell_loops_vertex(&l, x, 0);
        }
        for (int32_t k = 0; k < 5 * m * m; k++) {
            int32_t corner[4], vertex[8];
            section_cell(m, k, corner);
            for (int c = 0; c < 8; c++) vertex[c] = corner[c & 3] + (c & 4 ? there : here);
            pal_cell_loops_hex(&l, vertex);
        }
    }
    free(place);
    return pal_cell_loops_finish(&l, out, diag);
}
