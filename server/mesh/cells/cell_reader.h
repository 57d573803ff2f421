/* Private to the mesh room: loops of cells as a file is read. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_READER_H
#define PAL_MESH_CELLS_CELL_READER_H
#include "server/mesh/cells/cells.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/text_scan.h"

typedef struct pal_cell_reader {
    const char *name; /* as messages show it */
    pal_text_scan scan;
    pal_diagnostic *diag;
    pal_cell_loops l;
} pal_cell_reader;

/* REFUSED with "NAME: line N: sentence" at the scan's line */
#define PAL_CELL_REFUSE(reader, ...)                                                                                   \
    pal_file_refuse((reader)->diag, (reader)->name, "line", (reader)->scan.line, __VA_ARGS__)
/* a vertex, or the next face of the cell, with its line */
void pal_cell_reader_vertex(pal_cell_reader *reader, const double x[3]);
void pal_cell_reader_face(pal_cell_reader *reader, int64_t line);
/* a sharpness, checked */
pal_err pal_cell_reader_sharp(pal_cell_reader *reader, float *out);

/* the two formats: to loops, and to text */
pal_err pal_cell_vtk_read(pal_cell_reader *reader);
void pal_cell_vtk_write(const pal_cells *cells, FILE *file);
#endif
