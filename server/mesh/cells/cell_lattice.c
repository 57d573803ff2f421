/* Solids from a lattice: bricks, pyramids and wedges are cut from the loops of one hexahedron. */
#include "server/mesh/cells/cell_lattice.h"

#include <stdlib.h>
#include <string.h>

enum { CELLS = 6, LOOPS = 30, CORNERS = 96 }; /* maximum of one lattice place, which has one apex at most */

/* loops of a brick with corner c at bits 0, 1, 2 for x, y, z; loop 2 a + s is its side s of axis a */
static const int32_t BRICK[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

typedef struct builder {
    const pal_cell_lattice *lattice;
    pal_cell_loops l;
    int32_t *vertex_at; /* vertex of a corner of the lattice, -1: none yet */
    int32_t n_loop, n_corner;
    int32_t place[3]; /* of the present brick */
} builder;

static int32_t new_vertex(builder *b, const double at[3])
{
    b->lattice->place(at, b->l.x + 3 * (size_t)b->l.n_vertex);
    return b->l.n_vertex++;
}

/* the vertex of corner c of the present brick, made when it is first asked for */
static int32_t corner_vertex(builder *b, int32_t c)
{
    const int32_t *n = b->lattice->n, row = n[0] + 1;
    int32_t i = b->place[0] + (c & 1), j = b->place[1] + (c >> 1 & 1), k = b->place[2] + (c >> 2);
    if (b->lattice->round) i %= n[0];
    int32_t *known = &b->vertex_at[i + row * (j + (n[1] + 1) * k)];
    if (*known < 0) *known = new_vertex(b, (const double[3]){i, j, k});
    return *known;
}

static void add_corner(builder *b, int32_t vertex)
{
    b->l.corner[b->n_corner++] = vertex;
}

static void end_loop(builder *b)
{
    b->l.loop[++b->n_loop] = b->n_corner;
}

static void end_cell(builder *b)
{
    b->l.cell[++b->l.n_cell] = b->n_loop;
}

static void add_brick(builder *b)
{
    for (int f = 0; f < 6; f++) {
        for (int k = 0; k < 4; k++) add_corner(b, corner_vertex(b, BRICK[f][k]));
        end_loop(b);
    }
    end_cell(b);
}

/* side f of the brick is the base */
static void add_pyramid(builder *b, int f, int32_t apex)
{
    for (int k = 0; k < 4; k++) add_corner(b, corner_vertex(b, BRICK[f][k]));
    end_loop(b);
    for (int k = 0; k < 4; k++) {
        add_corner(b, corner_vertex(b, BRICK[f][(k + 1) % 4]));
        add_corner(b, corner_vertex(b, BRICK[f][k]));
        add_corner(b, apex);
        end_loop(b);
    }
    end_cell(b);
}

/* Without corners gone[0] and gone[1]: sides that lose one corner become triangles; the remaining edges of the two
 * sides that lose both are opposite edges of the cut, which runs along them as those sides did. */
static void add_wedge(builder *b, const int gone[2])
{
    int32_t cut[4];
    int n_cut = 0;
    for (int f = 0; f < 6; f++) {
        int32_t left[4];
        int n = 0, first = 0;
        for (int k = 0; k < 4; k++)
            if (BRICK[f][k] == gone[0] || BRICK[f][k] == gone[1]) first = k;
        /* starts after the last removed corner; the two of an edge may stand at the end and beginning of the loop */
        for (int k = 0; k < 4; k++) {
            int32_t c = BRICK[f][(first + 1 + k) % 4];
            if (c != gone[0] && c != gone[1]) left[n++] = c;
        }
        if (n == 2) {
            cut[n_cut++] = left[0], cut[n_cut++] = left[1];
            continue;
        }
        for (int k = 0; k < n; k++) add_corner(b, corner_vertex(b, left[k]));
        end_loop(b);
    }
    for (int k = 0; k < 4; k++) add_corner(b, corner_vertex(b, cut[k]));
    end_loop(b);
    end_cell(b);
}

static pal_err add_place(builder *b, char what, pal_diagnostic *diag)
{
    static const char apex_side[] = "WESNDU"; /* side of the brick, as loops */
    double middle[3] = {b->place[0] + 0.5, b->place[1] + 0.5, b->place[2] + 0.5};
    const char *side = strchr(apex_side, what);
    if (what == '#') {
        add_brick(b);
    } else if (what == 'X') {
        int32_t apex = new_vertex(b, middle);
        for (int f = 0; f < 6; f++) add_pyramid(b, f, apex);
    } else if (side) {
        int f = (int)(side - apex_side);
        middle[f / 2] += f % 2 ? 0.5 : -0.5;
        add_pyramid(b, f ^ 1, new_vertex(b, middle));
    } else if (what >= 'a' && what <= 'l') {
        int axis = (what - 'a') / 4, bit = (what - 'a') % 4;
        int low = (bit & 1) << (axis + 1) % 3 | (bit >> 1) << (axis + 2) % 3;
        add_wedge(b, (const int[2]){low, low | 1 << axis});
    } else {
        return pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "cells: a lattice has the letter \"%c\"", what);
    }
    return PAL_ERR_OK;
}

static pal_err add_all(builder *b, pal_diagnostic *diag)
{
    const int32_t *n = b->lattice->n;
    int32_t *at = b->place;
    for (at[2] = 0; at[2] < n[2]; at[2]++)
        for (at[1] = 0; at[1] < n[1]; at[1]++) {
            const char *row = b->lattice->row[at[2] * n[1] + at[1]];
            int32_t max = (int32_t)strlen(row) - 1;
            for (at[0] = 0; at[0] < n[0]; at[0]++) {
                char what = row[at[0] < max ? at[0] : max];
                if (what != '.') PAL_TRY(add_place(b, what, diag));
            }
        }
    return PAL_ERR_OK;
}

pal_err pal_cell_lattice_make(const pal_cell_lattice *lattice, pal_cells *out, pal_diagnostic *diag)
{
    const int32_t *n = lattice->n;
    size_t n_place = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    size_t n_corner = (size_t)(n[0] + 1) * (size_t)(n[1] + 1) * (size_t)(n[2] + 1);
    builder b = {.lattice = lattice};
    b.vertex_at = malloc(n_corner * sizeof *b.vertex_at);
    b.l.x = malloc((n_corner + n_place) * 3 * sizeof *b.l.x);
    b.l.cell = malloc((CELLS * n_place + 1) * sizeof *b.l.cell);
    b.l.loop = malloc((LOOPS * n_place + 1) * sizeof *b.l.loop);
    b.l.corner = malloc(CORNERS * n_place * sizeof *b.l.corner);
    pal_err err = PAL_ERR_MEMORY;
    if (b.vertex_at && b.l.x && b.l.cell && b.l.loop && b.l.corner) {
        for (size_t i = 0; i < n_corner; i++) b.vertex_at[i] = -1;
        b.l.cell[0] = b.l.loop[0] = 0;
        err = add_all(&b, diag);
        if (!err) err = pal_cells_make(&b.l, out, diag);
    }
    free(b.vertex_at);
    pal_cell_loops_free(&b.l);
    return err;
}
