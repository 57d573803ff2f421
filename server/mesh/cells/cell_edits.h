/* Sculpting edits of control cells (A 4.1, Fig. 7; McDonnell, Qin, Wlodarczyk 2001): delete, extrude, merge, bridge,
 * divide, sharpen, move. An edit never changes what it is given: it makes a new complex, or refuses. Keeping the old
 * complex is how it is undone.
 *
 * Positions are rest positions, m. A deformed state is carried over by the edit's rows: velocities by the rows alone,
 * positions by pal_cells_edit_positions.
 *
 * Numbers after an edit: old vertices and cells keep theirs, new ones come after them; where some go, those after move
 * up. Edges and faces are numbered anew. Sharpness stays with what had it, halves and parts of a divided edge or face
 * have that of the whole, all that is new is smooth.
 * Whether a new part runs into a far part of the solid is not looked at. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_EDITS_H
#define PAL_MESH_CELLS_CELL_EDITS_H
#include "server/mesh/cells/cells.h"
#include "server/num/interpolation.h"

#define PAL_EXTRUDE_SCALE_MAX 1000.0
enum { PAL_DIVIDE_CORNERS_MAX = 1024, PAL_DIVIDE_RINGS_MAX = 1000, PAL_DIVIDE_CELLS_MAX = 512 };

/* name of each kind and the numbers it reads */
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

/* an edit as plain numbers: what a file, a log or a message keeps; numbers its kind does not read are not looked at */
typedef struct pal_cells_command {
    pal_cells_command_kind kind;
    int32_t cell, face, other_face, edge, vertex, rings;
    double distance_m, scale;
    float sharp;
    double to_m[3];
} pal_cells_command;

typedef struct pal_cells_edit {
    pal_cells cells;
    pal_interpolation rows; /* where each new vertex comes from: itself, the base it was extruded from, the mean of what
                             * was merged or divided                       [cells.n_vertex rows of the old vertices] */
    double *offset;         /* new rest position less rows times the old ones, m                 [cells.n_vertex][3] */
    int32_t *cell_from;     /* old cell that each cell is, is part of or grew from                    [cells.n_cell] */
    int32_t face;           /* to go on with: the outer face of an extrusion, the joined one of a merge; else -1 */
    int32_t rotated_face;   /* old face with which an extrusion's offsets turn; -1: they do not turn             */
} pal_cells_edit;

/* All edits. REFUSED with one sentence that names the kind and the number: an item out of range, a number that is NaN
 * or out of range, a result that is no complex (pal_cells_make), a face without area, a cell without volume, or folded:
 * a cell that was, or is, one whose faces can all be seen from its centroid must stay, or be, one. MEMORY. Then *from
 * is as it was and *out zero. */

/* Takes a cell away. Refused for the last one. Pieces that hang in an edge or vertex, or not at all, may remain. */
pal_err pal_cells_delete(const pal_cells *from, int32_t cell, pal_cells_edit *out, pal_diagnostic *diag);
/* A new cell on a boundary face, as far out along the face's vector area; its outer face is the face scaled about its
 * corners' mean. distance_m above 0, scale above 0 up to PAL_EXTRUDE_SCALE_MAX. */
pal_err pal_cells_extrude(const pal_cells *from, int32_t face, double distance_m, double scale, pal_cells_edit *out,
                          pal_diagnostic *diag);
/* Makes two boundary faces one inner face, corners at the means of pairs. The faces have equally many corners, none in
 * common, and no edge between; corners are paired as the loops run, so that squared distances sum least. */
pal_err pal_cells_merge(const pal_cells *from, int32_t face, int32_t other_face, pal_cells_edit *out,
                        pal_diagnostic *diag);
/* The same pairs, but nothing moves and a new cell, a prism, goes between; it fills a hollow that it fits. */
pal_err pal_cells_bridge(const pal_cells *from, int32_t face, int32_t other_face, pal_cells_edit *out,
                         pal_diagnostic *diag);
/* Cuts each of n cells as a level of subdivision would, into one for each of its corners, where it lies: nothing moves.
 * The first part keeps the cell's number. Neighbours are not cut, their faces and edges are: they become polyhedra of
 * more corners. What is in the middle of an edge or face already because a neighbour was divided is used, so that the
 * order does not matter but for numbers, and dividing all cells is a level of subdivision. Keeps the volume where faces
 * are flat. Subdivided, cells that have a vertex in the middle of a bent edge may become turned elements (least det J
 * below 0): a solid is to be asked for that before it is taken. Refused for a cell of more than
 * PAL_DIVIDE_CORNERS_MAX corners, the same cell twice, more than PAL_DIVIDE_CELLS_MAX cells (each takes time linear
 * in the size of all). */
pal_err pal_cells_divide(const pal_cells *from, int32_t n, const int32_t *cell, pal_cells_edit *out,
                         pal_diagnostic *diag);
/* the same for a cell and those round it that it has a vertex in common with, and again, rings times */
pal_err pal_cells_divide_near(const pal_cells *from, int32_t cell, int32_t rings, pal_cells_edit *out,
                              pal_diagnostic *diag);
/* Sets a sharpness (kind PAL_CELLS_SHARPEN_*), 0 to PAL_SHARPNESS_MAX; nothing else changes. */
pal_err pal_cells_sharpen(const pal_cells *from, pal_cells_command_kind kind, int32_t item, float sharp,
                          pal_cells_edit *out, pal_diagnostic *diag);
/* Sets the rest positions x [n][3] of vertices [n], each at most once. To take a deformed shape as the rest shape,
 * carry x by the rows alone. */
pal_err pal_cells_move(const pal_cells *from, int32_t n, const int32_t *vertex, const double *x, pal_cells_edit *out,
                       pal_diagnostic *diag);

/* one of the above; a kind that is none is REFUSED */
pal_err pal_cells_apply(const pal_cells *from, const pal_cells_command *command, pal_cells_edit *out,
                        pal_diagnostic *diag);
/* name of a kind; NULL: none. And back: PAL_CELLS_COMMAND_KINDS: no such name */
const char *pal_cells_command_name(pal_cells_command_kind kind);
pal_cells_command_kind pal_cells_command_find(const char *name);

/* Positions of the new vertices, to [cells.n_vertex][3], from those of the old ones, x [n of from][3], apart: rows x +
 * offset, offsets of an extrusion turned as its face is turned against its rest. */
void pal_cells_edit_positions(const pal_cells_edit *edit, const pal_cells *from, const double *x, double *to);
/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_cells_edit_free(pal_cells_edit *edit);
#endif
