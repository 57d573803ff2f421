/* Sculpting edits from any bytes: the first chooses a solid, then 8 bytes a command. What is taken must be whole, be
 * placed by its rows, and leave the old complex as it was; what is refused must leave nothing. */
#include "server/mesh/cells/cell_edits.h"
#include "server/mesh/cells/cell_shapes.h"
#include "server/mesh/cells/maccracken_joy.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_COMMANDS = 24, MAX_CELLS = 40 };

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

static pal_err start(uint8_t which, pal_cells *c)
{
    const int32_t n[3] = {1 + (which >> 3 & 1), 1 + (which >> 4 & 1), 1 + (which >> 5 & 1)}, round[3] = {5, 1, 1};
    const double size[3] = {n[0], n[1], n[2]};
    switch (which & 3) {
    case 0:
        return pal_cells_ring(3 + n[0], 1, .5, c, NULL);
    case 1:
        return pal_cells_tube(round, .5, 1, 1, c, NULL);
    case 2:
        return pal_cells_torus(6, 1, 1, .3, c, NULL);
    default:
        return pal_cells_block(n, size, c, NULL);
    }
}

/* numbers mostly near the range, sizes mostly sane, now and then neither */
static pal_cells_command command_of(const uint8_t b[8], const pal_cells *c)
{
    static const double odd[4] = {(double)NAN, (double)INFINITY, -1, 1e300};
    pal_cells_command k = {.kind = (pal_cells_command_kind)(b[0] % (PAL_CELLS_COMMAND_KINDS + 1))};
    k.cell = b[1] % (c->n_cell + 1) - (b[7] == 255);
    k.face = b[1] % (c->n_face + 1), k.other_face = b[2] % (c->n_face + 1);
    k.edge = (b[1] | b[2] << 8) % (c->n_edge + 1), k.vertex = b[1] % (c->n_vertex + 1);
    k.rings = b[2] % 3;
    k.distance_m = b[3] < 4 ? odd[b[3]] : b[3] / 100.0;
    k.scale = b[4] < 4 ? odd[b[4]] : b[4] / 128.0;
    k.sharp = b[3] < 4 ? (float)odd[b[3] % 3] : b[4] / 32.0f;
    for (int a = 0; a < 3; a++) {
        double x = k.vertex < c->n_vertex ? c->x[3 * k.vertex + a] : 0;
        k.to_m[a] = b[6] < 4 ? odd[b[6]] : x + (b[3 + a] - 128) / 256.0;
    }
    return k;
}

static void check_edit(const pal_cells_edit *e, const pal_cells *from)
{
    double *x = malloc(3 * (size_t)e->cells.n_vertex * sizeof *x);
    if (!x) return;
    if (pal_cells_check(&e->cells, NULL, NULL) == PAL_ERR_REFUSED) __builtin_trap();
    pal_cells_edit_positions(e, from, from->x, x);
    for (int32_t i = 0; i < 3 * e->cells.n_vertex; i++)
        if (!(fabs(x[i] - e->cells.x[i]) <= 1e-6)) __builtin_trap();
    for (int32_t i = 0; i < e->cells.n_cell; i++)
        if (e->cell_from[i] < 0 || e->cell_from[i] >= from->n_cell) __builtin_trap();
    if (e->face >= e->cells.n_face) __builtin_trap();
    free(x);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_cells c = {0}, same = {0};
    pal_subdivision s;
    pal_diagnostic diag;
    if (n_byte < 1 || start(bytes[0], &c)) return 0;
    for (size_t i = 0; i < MAX_COMMANDS && 1 + 8 * (i + 1) <= n_byte && c.n_cell <= MAX_CELLS; i++) {
        pal_cells_edit e;
        pal_cells_command k = command_of(bytes + 1 + 8 * i, &c);
        if (pal_cells_copy(&c, &same)) break;
        diag.text[0] = 0;
        pal_err err = pal_cells_apply(&c, &k, &e, &diag);
        if (!pal_cells_equal(&c, &same)) __builtin_trap();
        pal_cells_free(&same);
        if (err) {
            if (!diag.text[0] || e.cells.x || e.rows.start || e.offset || e.cell_from) __builtin_trap();
            continue;
        }
        check_edit(&e, &c);
        pal_cells_free(&c);
        c = e.cells;
        memset(&e.cells, 0, sizeof e.cells);
        pal_cells_edit_free(&e);
    }
    const pal_subdivision_options o = {.n_level = 1, .budget_byte = (size_t)64 << 20};
    if (!pal_subdivision_make(&c, &o, &s, NULL)) pal_subdivision_free(&s);
    pal_cells_free(&c);
    return 0;
}
