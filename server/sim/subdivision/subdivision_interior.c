/* The inside of a subdivision solid as tetrahedra. */
#include "server/sim/subdivision/subdivision_solid.h"

enum { IN_HEX = 6, IN_PYRAMID = 2 };

/* corners at bits 0, 1, 2 for u, v, w: paths from corner 0 to 7 along the axes in each order, oriented */
static const int hex_corner[IN_HEX][4] = {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7},
                                          {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 6, 4, 7}};
static const int pyramid_corner[IN_PYRAMID][4] = {{0, 1, 2, 4}, {0, 2, 3, 4}};

/* node of a hexahedron's corner; of a cubic element the inner ones of 4 x 4 x 4, j = 1 + bit of u and so on */
static int place(pal_cell_kind kind, int corner)
{
    if (kind != PAL_CELL_CUBIC) return corner;
    return 16 * (1 + (corner & 1)) + 4 * (1 + (corner >> 1 & 1)) + 1 + (corner >> 2);
}

pal_err pal_subdivision_interior(const pal_subdivision_solid *solid, pal_arena *arena, int *n_tet, int32_t **tet)
{
    const pal_cell_elements *e = &solid->elements;
    const size_t n = IN_HEX * ((size_t)e->n[PAL_CELL_CUBIC] + (size_t)e->n[PAL_CELL_HEX]) +
                     IN_PYRAMID * (size_t)e->n[PAL_CELL_PYRAMID];
    int32_t *to = PAL_NEW(arena, int32_t, 4 * n);
    if (!to) return PAL_ERR_MEMORY;
    *tet = to, *n_tet = (int)n;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const bool pyramid = kind == PAL_CELL_PYRAMID;
        const int(*corner)[4] = pyramid ? pyramid_corner : hex_corner;
        for (int i = 0; i < e->n[kind]; i++) {
            const int32_t *node = pal_subdivision_solid_nodes(solid, kind, i);
            for (int k = 0; k < 4 * (pyramid ? IN_PYRAMID : IN_HEX); k++)
                *to++ = node[place(kind, corner[k / 4][k % 4])];
        }
    }
    return PAL_ERR_OK;
}
