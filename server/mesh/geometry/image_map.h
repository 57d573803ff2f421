/* Where images lie on a surface: the triangles of a file with image coordinates at their corners, as they were before
 * cleaning, and what they give to the corners of a surface made from them. Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_IMAGE_MAP_H
#define PAL_MESH_GEOMETRY_IMAGE_MAP_H
#include "server/mesh/geometry/surface.h"

enum { PAL_MATERIAL_MAX = 256, PAL_MATERIAL_NAME = 128 };
typedef char pal_material_name[PAL_MATERIAL_NAME];

typedef struct pal_image_map {
    int n_tri; /* 0: the file has no image coordinates */
    double *x; /* corners, in the frame of the surface, m [n_tri][3][3] */
    /* u and v from the lower left corner of the image, 1 at the other sides, and the number of the triangle's material,
     * -1: it has no image coordinates [n_tri][3][3] */
    float *at;
    pal_material_name library; /* OBJ: file of materials; "": none */
    int n_material;
    pal_material_name *material; /* used by triangles, in the order of first use; "": none named [n_material] */
} pal_image_map;

void pal_image_map_free(pal_image_map *map);

/* Sets surface->image_at: that of the equal triangle of the map, else of the place that is nearest to a point just
 * within the corner, so that two sides of a seam stay apart. Corners at a vertex whose places hardly differ have the
 * same one. image [n_material]: number of the image of each material, -1: none. MEMORY */
pal_err pal_image_map_take(const pal_image_map *map, const int *image, pal_surface *surface);
#endif
