/* Triangle meshes with colours and images as binary glTF 2.0 (Khronos Group, "glTF 2.0 Specification", ISO/IEC
 * 12113:2022). glTF is in metres with y up; vertices are written as they are, under one node that turns `up` to y.
 * Everything is borrowed. Thread: [load]. */
#ifndef PAL_MESH_FILES_GLB_FILE_H
#define PAL_MESH_FILES_GLB_FILE_H
#include "server/mesh/files/image_file.h"

typedef struct pal_glb_material {
    const char *name;
    uint8_t rgb[3];         /* sRGB; not used where there is an image */
    const pal_image *image; /* NULL: none                             */
} pal_glb_material;

/* triangles of one material */
typedef struct pal_glb_part {
    int n_tri, material; /* material: its number in the scene */
    const int32_t *tri;  /* counter-clockwise seen from outside [n_tri][3] */
} pal_glb_part;

typedef struct pal_glb_mesh {
    const char *name;
    int n_vertex, n_part;
    const float *x;      /* m                                             [n_vertex][3] */
    const float *normal; /* unit                                          [n_vertex][3] */
    const float *uv;     /* from the upper left of images; NULL: no images [n_vertex][2] */
    const pal_glb_part *part;
} pal_glb_mesh;

typedef struct pal_glb_scene {
    const char *name;
    double time_s; /* simulated; a property of the scene's extras */
    double up[3];  /* unit */
    int n_mesh, n_material;
    const pal_glb_mesh *mesh;
    const pal_glb_material *material;
} pal_glb_scene;

/* Names are UTF-8. Whole file written or none. Errors: REFUSED: a mesh without vertices or triangles; BUDGET: more than
 * the 4 GiB of the format; IO, MEMORY. */
pal_err pal_mesh_write_glb(const char *path, const pal_glb_scene *scene, pal_diagnostic *diag);
#endif
