/* Surfaces from files: OBJ, STL, PLY, OFF, recognised by content first, by name second. The bytes are untrusted: every
 * refusal is one sentence with the file's name and the line or byte, and memory is bounded by a small multiple of the
 * file's size. Thread: [load]. */
#ifndef PAL_MESH_FILES_MESH_FILE_H
#define PAL_MESH_FILES_MESH_FILE_H
#include "server/mesh/geometry/image_map.h"
#include "server/mesh/geometry/tets.h"

/* Default weld, of the diagonal: joins the copies of a vertex that a file writes with each of its triangles. Numbers of
 * six digits end at 1e-5 of themselves, so copies in the last digit of coordinates of half a diagonal are sqrt(3) 5e-6
 * apart; single precision leaves 1e-7. Edges of ten times as much stay (tests/mesh/files/test_mesh_file.c) */
#define PAL_MESH_WELD 1e-5

/* NULL stands for {0, PAL_MESH_WELD} */
typedef struct pal_mesh_file_options {
    double unit_m;        /* metres per file unit; 0: guess with pal_mesh_unit_guess */
    double weld;          /* relative tolerance of pal_surface_clean; < 0: do not clean at all */
    pal_image_map *image; /* becomes where images lie on the surface, pal_image_map_free; NULL: not asked */
} pal_mesh_file_options;

/* Reads path, cleans it, scales it to metres; each reader's file says what it takes. Triangles that cleaning leaves
 * unconnected although their corners nearly meet are refused, with the gap between them. unit_name out ("m", "mm",
 * "scaled", or "given" for options' own) and unit_m out may be NULL. IO, REFUSED, MEMORY. */
pal_err pal_mesh_file_read(const char *path, const pal_mesh_file_options *options, pal_surface *out,
                           pal_surface_report *report, double *unit_m, const char **unit_name, pal_diagnostic *diag);
/* the same from memory: name is used in messages only */
pal_err pal_mesh_file_parse(const char *name, const uint8_t *bytes, size_t n_byte, const pal_mesh_file_options *options,
                            pal_surface *out, pal_surface_report *report, double *unit_m, const char **unit_name,
                            pal_diagnostic *diag);

/* unit of a body whose box diagonal is given in file units, from the sizes organs have (5 mm to 1 m):
 * diagonal 3 to 3000: mm; 0.003 to 3: m (the overlap at 3 goes to mm); otherwise the file's unit is taken so that the
 * body is 0.2 m across ("scaled") */
double pal_mesh_unit_guess(double diagonal, const char **name);
/* "m" | "cm" | "mm" | "um" | "in" -> metres, 0: unknown word */
double pal_mesh_unit_named(const char *word);

/* Positions with the origin, in metres, by the end of the path: .ply (binary little-endian, float32, int32 lists), .obj
 * (text, all digits of a double) or .stl (binary, float32); whole file written or none; REFUSED (another ending), IO */
pal_err pal_mesh_file_write(const char *path, const pal_surface *surface, pal_diagnostic *diag);

/* TetGen files STEM.node, STEM.ele, STEM.face: 1-based, positions in m with origin added, boundary marker 1 on surface
 * nodes and faces; IO */
pal_err pal_mesh_file_write_tetgen(const char *stem, const pal_tets *tets, pal_diagnostic *diag);
#endif
