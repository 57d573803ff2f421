/* The prepared mesh: everything about a body that is computed once from its surface and read at every start. For a body
 * that is simulated on the surface itself (model adaptive_springs) it is the surface alone. Thread: [load]. */
#ifndef PAL_MESH_VOLUME_PREPARED_H
#define PAL_MESH_VOLUME_PREPARED_H
#include "server/mesh/volume/hexes.h"
#include "server/mesh/volume/skin.h"

typedef struct pal_prepared {
    pal_surface surface; /* the displayed surface */
    pal_tets tets;       /* the simulated mesh, same origin_m as the surface; none: n_node 0, edge_m its mean edge */
    pal_skin skin;       /* surface on tets; none: n_vertex 0                */
    pal_hexes hexes;     /* the same body as cubes; n_hex 0: it is no voxels */
} pal_prepared;

typedef struct pal_prepare_report {
    pal_voxel_report voxel;
    int64_t n_voxel;                 /* kept, border included                          */
    double volume_m3;                /* of the tetrahedra, border included             */
    double volume_error;             /* inside voxels over the surface's volume, - 1; 0 when that is not known */
    double split_s, hexes_s, skin_s; /* hexes_s: hexahedra and their fill, if it was measured */
} pal_prepare_report;

/* From a surface to voxels, tetrahedra, hexahedra and skin; copies the surface; one error names the step; the fill of
 * the hexahedra is measured when options->fill or options->min_fill asks for it, else it is 1 */
pal_err pal_prepared_make(const pal_surface *surface, const pal_voxel_options *options, pal_prepared *out,
                          pal_prepare_report *report, pal_diagnostic *diag);
/* share of the surface's volume that the filled hexahedra lack */
double pal_prepared_missing(const pal_prepared *mesh);
/* the surface alone, copied, without tetrahedra, hexahedra and skin; MEMORY */
pal_err pal_prepared_surface(const pal_surface *surface, pal_prepared *out);
void pal_prepared_free(pal_prepared *prepared);
pal_err pal_prepared_save(const pal_prepared *prepared, const char *path, pal_diagnostic *diag);
pal_err pal_prepared_load(const char *path, pal_prepared *out, pal_diagnostic *diag);
/* the same from memory (files of version 2 have no fill: it is 1, not measured; of 3 and 4 no weights): name is used in
 * messages only; every count, index and number is checked */
pal_err pal_prepared_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_prepared *out,
                           pal_diagnostic *diag);
/* the file's bytes, which the caller frees; MEMORY */
pal_err pal_prepared_bytes(const pal_prepared *prepared, uint8_t **bytes, size_t *n_byte);
/* the checksum that byte 24 must hold; 0 when there are fewer than 32 bytes */
uint64_t pal_prepared_checksum(const uint8_t *bytes, size_t n_byte);
#endif
