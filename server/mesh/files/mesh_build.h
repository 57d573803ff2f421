/* Shared by the surface readers: arrays that grow with the bytes that are there, polygons as fans, and refusals that
 * name the file and the position. Private to the readers of this room. Thread: [load]. */
#ifndef PAL_MESH_FILES_MESH_BUILD_H
#define PAL_MESH_FILES_MESH_BUILD_H
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/text_scan.h"
#include "server/mesh/geometry/image_map.h"

typedef struct pal_mesh_build {
    const char *name; /* file name for messages                                          */
    const uint8_t *bytes;
    size_t n_byte;
    pal_diagnostic *diag;
    const char *format; /* for the report                                                  */
    bool binary;        /* places are byte offsets, else line numbers                      */
    double *x;          /* [n_vertex][3]                                                   */
    int32_t *tri;       /* [n_tri][3], indices not yet checked against n_vertex            */
    size_t n_vertex, n_tri;
    /* OBJ: image coordinates and those of the corners (-1: none), while takes_image */
    bool takes_image;
    double *vt;      /* [n_vt][2]                                                       */
    int32_t *tri_vt; /* [n_tri][3], indices not yet checked against n_vt                */
    size_t n_vt;
    int32_t *tri_material;                        /* number of the material of each triangle [n_tri] */
    pal_material_name library, *material;         /* file of materials, names in the order of first use [n_material] */
    int n_material, now_material;                 /* now: of the faces that come */
    int64_t max_index, max_index_at;              /* largest index of any face (-1 at first) and its place      */
    int64_t first_at;                             /* place of the first face, 0: none yet                       */
    int64_t fan_first, fan_last;                  /* the open polygon                                           */
    int32_t fan_first_vt, fan_last_vt, corner_vt; /* of the same corners, and of the one that comes */
    int fan_n, fan_n_tri;
} pal_mesh_build;

/* REFUSED with "NAME: line AT: sentence" or "NAME: byte AT: sentence" */
#define PAL_MESH_REFUSE(build, at, ...)                                                                                \
    pal_file_refuse((build)->diag, (build)->name, (build)->binary ? "byte" : "line", (at), __VA_ARGS__)

/* BUDGET, MEMORY */
pal_err pal_mesh_vertex(pal_mesh_build *build, const double p[3]);
/* the position at the scan; what names it in the message. REFUSED, BUDGET, MEMORY */
pal_err pal_mesh_position(pal_mesh_build *build, pal_text_scan *scan, const char *what);

/* a polygon: begin, its corners (indices from 0, REFUSED when negative or beyond 2^31 - 2), end. One or two corners
 * make a degenerate triangle, so that cleaning counts them. */
void pal_mesh_fan_begin(pal_mesh_build *build, int64_t at);
pal_err pal_mesh_fan_corner(pal_mesh_build *build, int64_t at, int64_t index);
pal_err pal_mesh_fan_end(pal_mesh_build *build);

/* image coordinates; what is missing is 0. BUDGET, MEMORY */
pal_err pal_mesh_image_point(pal_mesh_build *build, const double uv[2]);

/* the readers: from bytes to arrays; REFUSED, MEMORY */
pal_err pal_obj_parse(pal_mesh_build *build);
pal_err pal_stl_parse(pal_mesh_build *build);
pal_err pal_ply_parse(pal_mesh_build *build);
pal_err pal_off_parse(pal_mesh_build *build);
/* is this an STL file by its content? */
bool pal_stl_is(const uint8_t *bytes, size_t n_byte);
bool pal_off_is(const uint8_t *bytes, size_t n_byte);
bool pal_obj_is(const uint8_t *bytes, size_t n_byte);
#endif
