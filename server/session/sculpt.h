/* Sculpting: live editing of the control cells, paint and view of one body (paper A section 4.1), with undo and redo.
 * Only for bodies of model subdivision_fem.
 *
 * Every command produces a complete new scene (pal_sculptor_prepare: slow, allocates). Its world is built while the
 * old one runs, and replaces it between two steps through pal_session_transfer_begin and pal_sculpt_transfer. Existing
 * points keep position and velocity; the weights of the edit place new ones. A refused command changes nothing. Undo
 * restores cells, paint and the mechanical state bit for bit. Thread: one at a time. */
#ifndef PAL_SESSION_SCULPT_H
#define PAL_SESSION_SCULPT_H
#include "server/mesh/cells/cell_edits.h"
#include "server/sim/world/world.h"

enum { PAL_SCULPT_HISTORY = 64 }; /* undo depth; older commands are discarded */

typedef enum pal_sculpt_kind {
    PAL_SCULPT_CELLS,    /* an edit of control cells */
    PAL_SCULPT_PAINT,    /* one more stroke */
    PAL_SCULPT_SET_REST, /* the current shape becomes the rest shape */
    PAL_SCULPT_CUT,      /* sets or removes the cut-away plane; not undoable */
    PAL_SCULPT_UNDO,
    PAL_SCULPT_REDO,
    PAL_SCULPT_KINDS
} pal_sculpt_kind;

typedef struct pal_sculpt {
    pal_sculpt_kind kind;
    pal_cells_command cells; /* CELLS: indices of control cells, faces, edges, vertices */
    pal_stroke stroke;       /* PAINT; body frame at rest */
    const double *point_m;   /* SET_REST: current control points, body frame [n_point][3]; copied */
    int n_point;
    bool cut;                    /* CUT; false: removes the plane */
    double cut_normal[3], cut_m; /* as in pal_body_def */
} pal_sculpt;

typedef struct pal_sculptor pal_sculptor;       /* the current body with its undo and redo history */
typedef struct pal_sculpt_edit pal_sculpt_edit; /* a prepared command and the scene that it produces */

/* copies the body's cells and strokes; REFUSED: another model; MEMORY. [load] */
pal_err pal_sculptor_create(const pal_scene *scene, int body, pal_diagnostic *diag, pal_sculptor **out);
void pal_sculptor_destroy(pal_sculptor *sculptor);                 /* NULL is fine; prepared edits stay valid */
const pal_cells *pal_sculptor_cells(const pal_sculptor *sculptor); /* current control cells */
int pal_sculptor_undo_count(const pal_sculptor *sculptor);         /* commands that can be undone */
int pal_sculptor_redo_count(const pal_sculptor *sculptor);

/* Checks the command and builds the resulting scene from the running one. Borrows the meshes of its other bodies. The
 * sculptor does not change. REFUSED: errors of cell_edits.h, a stroke out of range, more than PAL_STROKE_MAX strokes,
 * nothing to undo, points that fold a cell; MEMORY. */
pal_err pal_sculptor_prepare(const pal_sculptor *sculptor, const pal_scene *scene, const pal_sculpt *command,
                             pal_diagnostic *diag, pal_sculpt_edit **out);
/* for building a world or session; lives as long as the edit */
const pal_scene *pal_sculpt_edit_scene(const pal_sculpt_edit *edit);
/* pal_session_transfer_fn; user: a pal_sculpt_edit. Transfers the state of `before` to `next` and stores the state of
 * before for undo, in memory that prepare has allocated. */
void pal_sculpt_transfer(void *edit, pal_world *next, const pal_world *before);
/* makes the edit the sculptor's current state and the previous one its undo entry; once, after pal_sculpt_transfer */
void pal_sculptor_commit(pal_sculptor *sculptor, pal_sculpt_edit *edit);
/* frees an edit and its scene: one that was not committed, or one whose scene no world uses any more; NULL is fine */
void pal_sculpt_edit_free(pal_sculpt_edit *edit);

/* sets a boundary face, the control cell that owns it, and its edge and its vertex nearest to a rest position, body
 * frame; -1: no such face */
void pal_sculpt_find(const pal_cells *cells, int32_t face, const double at_m[3], pal_cells_command *out);
#endif
