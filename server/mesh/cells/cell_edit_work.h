/* Private to the mesh room: an edit in the making. Loops are added to `to`, vertices are defined through rows; finish
 * makes the complex and checks it. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_EDIT_WORK_H
#define PAL_MESH_CELLS_CELL_EDIT_WORK_H
#include "server/mesh/cells/cell_edits.h"

typedef struct pal_edit_work {
    const pal_cells *from;
    pal_diagnostic *diag;
    char what[64];                  /* "divide cell 7", for messages                               */
    pal_cell_loops to;              /* x is set by finish, from rows and offset */
    pal_interpolation_builder rows; /* of the new vertices, in order                               */
    double *offset;                 /* m                                             [n_vertex][3] */
    int32_t *cell_from;             /*                                                    [n_cell] */
    int32_t first_new;              /* cells from here on have no old shape                        */
    int32_t face_loop;              /* loop of the face to continue with; -1: none */
    int32_t rotated_face;           /* as in pal_cells_edit                                        */
} pal_edit_work;

/* an edit without memory */
pal_edit_work pal_edit_begin(const pal_cells *from, pal_diagnostic *diag, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* room for at most n_vertex vertices and n_cell cells: old cells come from themselves, sharpnesses are 0; MEMORY */
pal_err pal_edit_reserve(pal_edit_work *w, int32_t n_vertex, int32_t n_cell);
/* all old vertices, each with its row and sharpness */
void pal_edit_keep_vertices(pal_edit_work *w);
/* makes the result unless err is set, and frees the work in any case; out is zero after an error */
pal_err pal_edit_finish(pal_edit_work *w, pal_err err, pal_cells_edit *out);

/* the edits of pal_cells_command that have a file of their own; divide_near makes its result itself */
pal_err pal_edit_extrude(pal_edit_work *w, int32_t face, double distance_m, double scale);
pal_err pal_edit_merge(pal_edit_work *w, int32_t face, int32_t other_face);
pal_err pal_edit_bridge(pal_edit_work *w, int32_t face, int32_t other_face);
pal_err pal_edit_divide_near(pal_edit_work *w, int32_t cell, int32_t rings, pal_cells_edit *out);

/* REFUSED with "what: sentence" */
pal_err pal_edit_refuse(const pal_edit_work *w, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* "WHAT N, there are M" where it is out of range */
pal_err pal_edit_check_number(const pal_edit_work *w, const char *what, int32_t i, int32_t n);
/* REFUSED: a cell that folds and is new, or that did not fold before */
pal_err pal_edit_check_folds(const pal_edit_work *w, const pal_cells *to);
#endif
