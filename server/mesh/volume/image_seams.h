/* Image coordinates on the displayed surface of a prepared mesh. Where an image begins and ends on one edge (a seam),
 * its vertices are doubled: the copies have the same place and the same skin, and other image coordinates. Thread:
 * [load]. */
#ifndef PAL_MESH_VOLUME_IMAGE_SEAMS_H
#define PAL_MESH_VOLUME_IMAGE_SEAMS_H
#include "server/mesh/geometry/image_map.h"
#include "server/mesh/volume/prepared.h"

/* gives prepared->surface its uv; a mesh without skin is simulated on its surface, which cannot be cut: REFUSED when it
 * needs a seam. MEMORY */
pal_err pal_image_seams_make(const pal_image_map *map, pal_prepared *prepared, pal_diagnostic *diag);
#endif
