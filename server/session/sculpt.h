/* Sculpting: the control cells, paint and view of one body of a session, changed while it runs (paper A section 4.1),
 * with undo and redo. A body of model subdivision_fem only.
 *
 * Every command makes a whole scene beside the running one (pal_sculptor_prepare: slow, any thread that may take
 * memory); its world is built while the old one runs on, and takes over between two steps with pal_session_transfer and
 * pal_sculpt_transfer: points that stay keep place and velocity, new ones lie where the edit's weights put them. A
 * command that is refused changes nothing. Undo brings cells, paint and the state at that moment back to the bit.
 * Thread: one at a time. */
#ifndef PAL_SESSION_SCULPT_H
#define PAL_SESSION_SCULPT_H
#include "server/mesh/cells/cell_edits.h"
#include "server/sim/world/world.h"

enum { PAL_SCULPT_HISTORY = 64 }; /* commands that can be undone, older ones are forgotten */

typedef enum pal_sculpt_kind {
    PAL_SCULPT_CELLS,    /* an edit of control cells                          */
    PAL_SCULPT_PAINT,    /* one more stroke                                   */
    PAL_SCULPT_SET_REST, /* the shape it has now becomes its shape at rest    */
    PAL_SCULPT_CUT,      /* another cut-away plane, or none; not in the past  */
    PAL_SCULPT_UNDO,
    PAL_SCULPT_REDO,
    PAL_SCULPT_KINDS
} pal_sculpt_kind;

typedef struct pal_sculpt {
    pal_sculpt_kind kind;
    pal_cells_command cells;     /* CELLS: numbers of control cells, faces, edges, vertices */
    pal_stroke stroke;           /* PAINT; body frame at rest                               */
    const double *point_m;       /* KEEP: control points as they are now, body frame [n_point][3]; copied */
    int n_point;                 /*                                                         */
    bool cut;                    /* CUT: false: whole again                                 */
    double cut_normal[3], cut_m; /* pal_body_def                                            */
} pal_sculpt;

typedef struct pal_sculptor pal_sculptor;       /* the body as it is now, past and future */
typedef struct pal_sculpt_edit pal_sculpt_edit; /* a command that has been prepared, and the scene it leads to */

/* copies the body's cells and strokes; REFUSED: another model; MEMORY. [load] */
pal_err pal_sculptor_create(const pal_scene *scene, int body, pal_diagnostic *diag, pal_sculptor **out);
void pal_sculptor_destroy(pal_sculptor *sculptor);                 /* NULL is fine; turns live on */
const pal_cells *pal_sculptor_cells(const pal_sculptor *sculptor); /* control cells now */
int pal_sculptor_undo_count(const pal_sculptor *sculptor);         /* commands that can be undone, redone */
int pal_sculptor_redo_count(const pal_sculptor *sculptor);

/* Checks the command and makes the scene that it leads to from the one that runs now, whose other bodies' meshes it
 * borrows; the sculptor stays as it is. REFUSED with one sentence: what
 * cell_edits says, a stroke out of range, more than PAL_STROKE_MAX, nothing to undo, points that fold a cell; MEMORY */
pal_err pal_sculptor_prepare(const pal_sculptor *sculptor, const pal_scene *scene, const pal_sculpt *command,
                             pal_diagnostic *diag, pal_sculpt_edit **out);
/* to build a world or session from; lives as long as the turn */
const pal_scene *pal_sculpt_edit_scene(const pal_sculpt_edit *turn);
/* pal_session_transfer_fn with user a pal_sculpt_edit: brings `before` over into `next`, and keeps the state of before
 * for undo. Memory for it was taken by prepare */
void pal_sculpt_transfer(void *turn, pal_world *next, const pal_world *before);
/* the turn was taken: it is the sculptor's present, what it came from its past. After pal_sculpt_transfer, once */
void pal_sculptor_commit(pal_sculptor *sculptor, pal_sculpt_edit *turn);
/* frees the turn and its scene: when it was not taken, or once no world is made from it any more; NULL is fine */
void pal_sculpt_edit_free(pal_sculpt_edit *turn);

/* control edge or vertex of a control face nearest to a place at rest, body frame; -1: there is no such face */
int32_t pal_sculptor_nearest_edge(const pal_sculptor *sculptor, int32_t face, const double at_m[3]);
int32_t pal_sculptor_nearest_vertex(const pal_sculptor *sculptor, int32_t face, const double at_m[3]);
/* the cell that a boundary face belongs to; -1: there is no such face */
int32_t pal_sculptor_cell(const pal_sculptor *sculptor, int32_t face);
#endif
