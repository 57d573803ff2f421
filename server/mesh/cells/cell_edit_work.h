/* Private to the mesh room: an edit in the making. Loops are written cell by cell, corner by corner, into space
 * reserved before; vertices are defined through rows; finish makes the complex and checks it. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_EDIT_WORK_H
#define PAL_MESH_CELLS_CELL_EDIT_WORK_H
#include "server/mesh/cells/cell_edits.h"

typedef struct pal_edit_work {
    const pal_cells *from;
    char what[64];                  /* "divide cell 7", for messages                               */
    pal_cell_loops to;              /* x is set by finish, from rows and offset */
    int32_t n_loop, n_corner;       /* written so far */
    pal_interpolation_builder rows; /* of the new vertices, in order                               */
    double *offset;                 /* m                                             [n_vertex][3] */
    int32_t *cell_from;             /*                                                    [n_cell] */
    int32_t *map;                   /* scratch                                [old n_vertex] */
    int32_t first_new;              /* cells from here on have no old shape                        */
    int32_t face_loop;              /* loop of the face to continue with; -1: none */
    int32_t rotated_face;           /* as in pal_cells_edit                                        */
} pal_edit_work;

/* an edit without memory */
pal_edit_work pal_edit_begin(const pal_cells *from, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* rows, offset and cell_from for n new vertices and cells; MEMORY */
pal_err pal_edit_reserve_rows(pal_edit_work *w, int32_t n_vertex, int32_t n_cell);
/* the same and arrays for at most these numbers of loops and corners; REFUSED when too many, MEMORY */
pal_err pal_edit_reserve(pal_edit_work *w, int64_t n_vertex, int64_t n_cell, int64_t n_loop, int64_t n_corner,
                         pal_diagnostic *diag);

void pal_edit_corner(pal_edit_work *w, int32_t vertex);
void pal_edit_end_loop(pal_edit_work *w, float sharp); /* sharpness of the face */
void pal_edit_end_cell(pal_edit_work *w, int32_t cell_from);
void pal_edit_tag(pal_edit_work *w, int32_t a, int32_t b, float sharp); /* of an edge */
/* writes all old cells, then tags of the edges, with vertices renumbered by map [n_vertex] (NULL: unchanged) */
void pal_edit_copy_old(pal_edit_work *w, const int32_t *map);

/* makes the result unless err is set, and frees the work in any case */
pal_err pal_edit_finish(pal_edit_work *w, pal_err err, pal_cells_edit *out, pal_diagnostic *diag);

/* "WHAT N, there are M" where it is out of range */
pal_err pal_edit_check_number(const pal_edit_work *w, const char *what, int32_t i, int32_t n, pal_diagnostic *diag);
/* REFUSED: a cell that folds and is new, or that did not fold before */
pal_err pal_edit_check_folds(const pal_edit_work *w, const pal_cells *to, pal_diagnostic *diag);
/* can all faces of a cell be seen from its centroid? positions x [n_vertex][3] */
bool pal_edit_star_shaped(const pal_cells *c, const double *x, int32_t cell);
#endif
