/* Sculpting edits of control cells (paper A section 4.1, Fig. 7; McDonnell, Qin, Wlodarczyk 2001): delete, extrude,
 * merge, bridge, divide, sharpen, move. An edit never changes its input: it makes a new complex, or refuses. Undo keeps
 * the old complex.
 *
 * Positions are rest positions, m. A deformed state is transferred by the interpolation of the edit: velocities by its
 * rows alone, positions by pal_cells_edit_positions.
 *
 * Numbers after an edit: old vertices and cells keep theirs, new ones follow them; where some are removed, later ones
 * move up. Edges and faces are numbered again. Sharpness stays with its vertex, edge or face; parts of a divided edge
 * or face inherit it; all new features are smooth. So does it stay whether a face is inside (pal_cell_face.inside); new
 * faces are, and those that an edit opens. Collisions of a new part with distant parts of the solid are not
 * checked. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_EDITS_H
#define PAL_MESH_CELLS_CELL_EDITS_H
#include "server/mesh/cells/cells.h"
#include "server/num/interpolation.h"

#define PAL_EXTRUDE_SCALE_MAX 1000.0
enum { PAL_DIVIDE_CORNERS_MAX = 1024, PAL_DIVIDE_RINGS_MAX = 1000, PAL_DIVIDE_CELLS_MAX = 512 };

/* name of each kind and the numbers that it reads:
 *
 *   delete   removes a cell, but not the last one. What remains may be in pieces.
 *   extrude  adds a cell on a boundary face, along the vector area of the face; its outer face is the face scaled about
 *            the mean of its corners. distance_m above 0, scale above 0 up to PAL_EXTRUDE_SCALE_MAX.
 *   merge    joins two boundary faces to one inner face, corners at the means of pairs. The faces have equally many
 *            corners, none in common, and no edge between them; corners are paired in loop order so that the sum of
 *            squared distances is smallest.
 *   bridge   the same pairs, but nothing moves and a new cell, a prism, fills the space between
 *   divide   pal_cells_divide of the cell and those that share a vertex with it, repeated `rings` times
 *   sharpen  sets a sharpness, 0 to PAL_SHARPNESS_MAX
 *   move     sets the rest position of a vertex */
#define PAL_CELLS_COMMAND_TABLE(X)                                                                                     \
    X(DELETE, "delete")                 /* cell                      */                                                \
    X(EXTRUDE, "extrude")               /* face, distance_m, scale   */                                                \
    X(MERGE, "merge")                   /* face, other_face          */                                                \
    X(BRIDGE, "bridge")                 /* face, other_face          */                                                \
    X(DIVIDE, "divide")                 /* cell, rings               */                                                \
    X(SHARPEN_VERTEX, "sharpen_vertex") /* vertex, sharp             */                                                \
    X(SHARPEN_EDGE, "sharpen_edge")     /* edge, sharp               */                                                \
    X(SHARPEN_FACE, "sharpen_face")     /* face, sharp               */                                                \
    X(MOVE, "move")                     /* vertex, to_m              */

typedef enum pal_cells_command_kind {
#define X(kind, name) PAL_CELLS_##kind,
    PAL_CELLS_COMMAND_TABLE(X)
#undef X
        PAL_CELLS_COMMAND_KINDS
} pal_cells_command_kind;

/* an edit as plain numbers, for files, logs and messages; numbers that its kind does not read are ignored */
typedef struct pal_cells_command {
    pal_cells_command_kind kind;
    int32_t cell, face, other_face, edge, vertex, rings;
    double distance_m, scale;
    float sharp;
    double to_m[3];
} pal_cells_command;

typedef struct pal_cells_edit {
    pal_cells cells;
    /* each new vertex from the old ones: itself, its base, the mean of what was joined or cut [cells.n_vertex rows] */
    pal_interpolation rows;
    double *offset; /* new rest position minus the interpolated one, m                           [cells.n_vertex][3] */
    int32_t *cell_from;   /* old cell that each cell is, is part of or grew from                    [cells.n_cell] */
    int32_t face;         /* where to continue: the outer face of an extrusion, the joined one of a merge; else -1 */
    int32_t rotated_face; /* old face whose rotation the offsets of an extrusion follow; -1: none */
} pal_cells_edit;

/* An edit. REFUSED with one sentence that names the kind and the number: a kind or number that is out of range or NaN,
 * a result that is no complex (pal_cells_make), or a fold: a cell whose faces can all be seen from its centroid must
 * remain one, and a new cell must be one. MEMORY. After an error *from is unchanged and *out zero. */
pal_err pal_cells_apply(const pal_cells *from, const pal_cells_command *command, pal_cells_edit *out,
                        pal_diagnostic *diag);
/* Cuts each of n cells in place as a level of subdivision would, into one for each of its corners; nothing moves. The
 * first part keeps the number of the cell. Faces and edges of neighbours are cut: they become polyhedra of more
 * corners, and reuse these vertices when they are divided, so that the order affects numbers only. After subdivision,
 * cells with a vertex in the middle of a bent edge may give inverted elements (det J below 0): the caller must check
 * the solid. Refused for a cell of more than PAL_DIVIDE_CORNERS_MAX corners, the same cell twice, more than
 * PAL_DIVIDE_CELLS_MAX cells (each takes time linear in the size of all). */
pal_err pal_cells_divide(const pal_cells *from, int32_t n, const int32_t *cell, pal_cells_edit *out,
                         pal_diagnostic *diag);
/* name of a kind; NULL: none */
const char *pal_cells_command_name(pal_cells_command_kind kind);

/* Positions to [cells.n_vertex][3] from those of the old vertices, x [n of from][3], which do not overlap:
 * interpolation of x + offset, offsets of an extrusion rotated as its face is rotated against its rest shape. */
void pal_cells_edit_positions(const pal_cells_edit *edit, const pal_cells *from, const double *x, double *to);
/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_cells_edit_free(pal_cells_edit *edit);
#endif
