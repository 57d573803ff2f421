/* Polyhedral cells in files: our own text format (.palcells) and legacy VTK unstructured grids (.vtk).
 *
 * palcells is text, one item a line, '#' begins a comment, numbers count from 1:
 *
 *   palcells 1            first line
 *   v X Y Z               position, m
 *   c                     a cell begins
 *   f V V V ...           a face of it, counter-clockwise seen from outside the cell
 *   sv V S                sharpness S of a vertex,
 *   se V V S              of an edge,
 *   sf C F S              of face F of cell C; 0 smooth, below 1 semi-sharp, 1000000 for ever
 *
 * Numbers are written so that reading gives them back to the bit. VTK: cells of types 10 (tetrahedron), 12
 * (hexahedron), 13 (wedge), 14 (pyramid) and 42 (polyhedron) are read from and written to version 3.0 ASCII;
 * sharpnesses of vertices travel as point data "sharp", those of edges and faces do not fit and are left out. VTK files
 * give cells either way round: those inside out are turned over. Thread: [load]. */
#ifndef PAL_MESH_CELLS_CELL_FILE_H
#define PAL_MESH_CELLS_CELL_FILE_H
#include "server/mesh/cells/cells.h"

/* Reads by the first line of the file. The bytes are untrusted; memory stays below a fixed multiple of their number.
 * REFUSED with "NAME: line N: sentence", BUDGET (over 256 MiB), IO, MEMORY. */
pal_err pal_cell_file_load(const char *path, pal_cells *out, pal_diagnostic *diag);
/* the same from memory; name is used in messages only */
pal_err pal_cell_file_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_cells *out,
                            pal_diagnostic *diag);
/* Writes by the ending of the path, .vtk or palcells; whole file written or none; REFUSED (another ending), IO */
pal_err pal_cell_file_save(const pal_cells *cells, const char *path, pal_diagnostic *diag);
/* the bytes that save writes, VTK or palcells; the caller frees *bytes; MEMORY */
pal_err pal_cell_file_bytes(const pal_cells *cells, bool vtk, uint8_t **bytes, size_t *n_byte);
#endif
