/* Private to the mesh room: loops of cells that grow as a file is read. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_READER_H
#define PAL_MESH_CELLS_CELL_READER_H
#include "server/mesh/cells/cells.h"
#include "server/mesh/files/text_scan.h"

#include <stdio.h>

typedef struct pal_cell_reader {
    const char *name; /* as messages show it */
    pal_text_scan scan;
    pal_diagnostic *diag;
    pal_cell_loops l; /* cell and loop hold starts only; pal_cell_reader_finish adds the ends */
    size_t n_loop, n_corner, n_sharp;
    size_t cap_x, cap_vertex_line, cap_cell, cap_loop, cap_line, cap_corner, cap_edge_tag, cap_tag_line, cap_face_tag;
} pal_cell_reader;

/* REFUSED with "NAME: line N: sentence" at the scan's line */
pal_err pal_cell_reader_refuse(const pal_cell_reader *reader, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* room for one more item of size bytes; MEMORY, BUDGET beyond 2^29 items */
pal_err pal_cell_reader_grow(const pal_cell_reader *reader, void **array, size_t n, size_t *cap, size_t size);

pal_err pal_cell_reader_vertex(pal_cell_reader *reader, const double x[3]);
pal_err pal_cell_reader_cell(pal_cell_reader *reader);
pal_err pal_cell_reader_loop(pal_cell_reader *reader, int64_t line);
pal_err pal_cell_reader_corner(pal_cell_reader *reader, int32_t vertex);

/* the two formats: to loops, and to text */
pal_err pal_cell_vtk_read(pal_cell_reader *reader);
void pal_cell_vtk_write(const pal_cells *cells, FILE *file);
/* 17 digits and a decimal point */
void pal_cell_write_number(FILE *file, double value);
#endif
