/* Where an image lies on a surface: the triangles of a file with image coordinates at their corners, as they were
 * before cleaning, and what they give to the corners of a surface made from them. Thread: [load]. */
#ifndef PAL_MESH_GEOMETRY_IMAGE_MAP_H
#define PAL_MESH_GEOMETRY_IMAGE_MAP_H
#include "server/mesh/geometry/surface.h"

typedef struct pal_image_map {
    int n_tri;                        /* 0: the file has no image coordinates                                        */
    double *x;                        /* corners, in the frame of the surface, m                       [n_tri][3][3] */
    float *uv;                        /* from the lower left corner of the image, 1 at the other sides [n_tri][3][2] */
    char library[128], material[128]; /* OBJ: file of materials and the first one used; "": none */
} pal_image_map;

void pal_image_map_free(pal_image_map *map);

/* uv [n_tri][3][2] at the corners of the triangles of a surface: those of the equal triangle of the map, else of the
 * place that is nearest to a point just within the corner, so that two sides of a seam stay apart. MEMORY */
pal_err pal_image_map_corners(const pal_image_map *map, const pal_surface *surface, float *uv);
#endif
