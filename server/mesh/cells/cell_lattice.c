/* Solids from a lattice: bricks, pyramids and wedges are cut from the loops of one hexahedron. */
#include "server/mesh/cells/cell_lattice.h"

#include "server/base/heap.h"

#include <math.h>

typedef struct builder {
    const pal_cell_lattice *lattice;
    pal_cell_loops l;
    int32_t *vertex_at; /* vertex of a corner of the lattice, -1: none yet */
    int32_t brick[3];   /* place of the present brick */
} builder;

/* equal steps, both ends to the bit */
static void place_evenly(const pal_cell_lattice *l, const double at[3], double x[3])
{
    for (int a = 0; a < 3; a++)
        x[a] = at[a] == l->n[a] ? l->high[a] : l->low[a] + (l->high[a] - l->low[a]) * at[a] / l->n[a];
    if (!l->round) return;
    /* around, outward, along is a left-handed set of directions when around is counter-clockwise */
    double angle = -2 * M_PI * at[0] / l->n[0], r = x[1];
    x[0] = r * cos(angle), x[1] = r * sin(angle);
}

static int32_t new_vertex(builder *b, const double at[3])
{
    double x[3];
    if (b->lattice->place)
        b->lattice->place(at, x);
    else
        place_evenly(b->lattice, at, x);
    return pal_cell_loops_vertex(&b->l, x, 0);
}

/* the vertex of corner c of the present brick, made when it is first asked for */
static int32_t corner_vertex(builder *b, int32_t c)
{
    const int32_t *n = b->lattice->n, row = n[0] + 1;
    int32_t i = b->brick[0] + (c & 1), j = b->brick[1] + (c >> 1 & 1), k = b->brick[2] + (c >> 2);
    if (b->lattice->round) i %= n[0];
    int32_t *known = &b->vertex_at[i + row * (j + (n[1] + 1) * k)];
    if (*known < 0) *known = new_vertex(b, (const double[3]){i, j, k});
    return *known;
}

static void add_face(builder *b, int n, const int32_t *corner)
{
    pal_cell_loops_face(&b->l, 0);
    for (int k = 0; k < n; k++) pal_cell_loops_corners(&b->l, (const int32_t[]){corner_vertex(b, corner[k])}, 1);
}

/* side f of the brick is the base */
static void add_pyramid(builder *b, int f, int32_t apex)
{
    const int32_t *base = pal_cell_hex_loop[f];
    pal_cell_loops_cell(&b->l);
    add_face(b, 4, base);
    for (int k = 0; k < 4; k++) {
        add_face(b, 2, (const int32_t[]){base[(k + 1) % 4], base[k]});
        pal_cell_loops_corners(&b->l, &apex, 1);
    }
}

/* Without corners gone[0] and gone[1]: sides that lose one corner become triangles; the remaining edges of the two
 * sides that lose both are opposite edges of the cut, which runs along them as those sides did. */
static void add_wedge(builder *b, const int gone[2])
{
    int32_t cut[4];
    int n_cut = 0;
    pal_cell_loops_cell(&b->l);
    for (int f = 0; f < 6; f++) {
        int32_t left[4];
        int n = 0, first = 0;
        for (int k = 0; k < 4; k++)
            if (pal_cell_hex_loop[f][k] == gone[0] || pal_cell_hex_loop[f][k] == gone[1]) first = k;
        /* starts after the last removed corner; the two of an edge may stand at the end and beginning of the loop */
        for (int k = 0; k < 4; k++) {
            int32_t c = pal_cell_hex_loop[f][(first + 1 + k) % 4];
            if (c != gone[0] && c != gone[1]) left[n++] = c;
        }
        if (n == 2) {
            cut[n_cut++] = left[0], cut[n_cut++] = left[1];
            continue;
        }
        add_face(b, n, left);
    }
    add_face(b, 4, cut);
}

static pal_err add_place(builder *b, char what, pal_diagnostic *diag)
{
    static const char apex_side[] = "WESNDU"; /* side of the brick, as loops */
    double middle[3] = {b->brick[0] + 0.5, b->brick[1] + 0.5, b->brick[2] + 0.5};
    const char *side = strchr(apex_side, what);
    if (what == '#') {
        pal_cell_loops_cell(&b->l);
        for (int f = 0; f < 6; f++) add_face(b, 4, pal_cell_hex_loop[f]);
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
    const pal_cell_lattice *l = b->lattice;
    const char *row = l->rows ? l->rows : "#";
    int32_t *at = b->brick;
    for (at[2] = 0; at[2] < l->n[2]; at[2]++)
        for (at[1] = 0; at[1] < l->n[1]; at[1]++) {
            int32_t max = (int32_t)strcspn(row, "/ ") - 1;
            for (at[0] = 0; at[0] < l->n[0]; at[0]++) {
                char what = row[at[0] < max ? at[0] : max];
                if (what != '.') PAL_TRY(add_place(b, what, diag));
            }
            if (row[max + 1]) row += max + 2;
        }
    return PAL_ERR_OK;
}

pal_err pal_cell_lattice_make(const pal_cell_lattice *lattice, pal_cells *out, pal_diagnostic *diag)
{
    builder b = {.lattice = lattice};
    size_t n_corner = 1;
    for (int a = 0; a < 3; a++) n_corner *= (size_t)lattice->n[a] + 1;
    PAL_ARRAY(&b.l.err, b.vertex_at, n_corner);
    pal_err err = b.l.err;
    if (!err) {
        memset(b.vertex_at, -1, n_corner * sizeof *b.vertex_at);
        /* where all corners are used, they are numbered in rows */
        const int32_t *n = lattice->n;
        int32_t *at = b.brick;
        for (at[2] = 0; !lattice->rows && at[2] <= n[2]; at[2]++)
            for (at[1] = 0; at[1] <= n[1]; at[1]++)
                for (at[0] = 0; at[0] <= n[0] - lattice->round; at[0]++) corner_vertex(&b, 0);
        err = add_all(&b, diag);
    }
    free(b.vertex_at);
    if (!err) return pal_cell_loops_finish(&b.l, out, diag);
    pal_cell_loops_free(&b.l);
    return err;
}
