/* Control cells of named solids: the eight sculptures of Table 1 of paper A, rebuilt with as many cells, and a kidney.
 * Each is a lattice of bricks from which cells are kept, deformed by a smooth map; some bricks are pyramids or wedges,
 * so that elements of all kinds occur. Sizes in metres, z up; fronts face -y. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_MODELS_H
#define PAL_MESH_CELLS_CELL_MODELS_H
#include "server/mesh/cells/cells.h"

enum { PAL_CELL_MODELS = 9 };

typedef struct pal_cell_model {
    const char *name, *about;
    int n_level;    /* levels of subdivision that Table 1 of paper A shows it with */
    int32_t n_cell; /* #CC of Table 1 of paper A; of ours                                                           */
    int n_element;  /* #FE of Table 1 of paper A, with erratum A14; 0: not in the table                             */
    int percent[3]; /* %BE, %LE, %PE of Table 1: cubic, linear, pyramidal; 0, 0, 0: not in the table     */
} pal_cell_model;

extern const pal_cell_model pal_cell_model_list[PAL_CELL_MODELS];

/* NULL: there is none of that name */
const pal_cell_model *pal_cell_model_find(const char *name);
/* the cells of an entry of the list; the caller frees them; MEMORY */
pal_err pal_cell_model_make(const pal_cell_model *model, pal_cells *out, pal_diagnostic *diag);
#endif
