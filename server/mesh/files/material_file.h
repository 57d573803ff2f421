/* Files of materials beside an OBJ file (.mtl): the image of a material. The bytes are untrusted. Thread: [load]. */
#ifndef PAL_MESH_FILES_MATERIAL_FILE_H
#define PAL_MESH_FILES_MATERIAL_FILE_H
#include "server/base/err.h"

#include <stddef.h>
#include <stdint.h>

/* the image (map_Kd) of a material, or of the first one when it is "": a plain file name, "": it has none. REFUSED:
 * options before the name, or a name that leads out of the folder */
pal_err pal_material_image(const char *name, const uint8_t *bytes, size_t n_byte, const char *material, char image[128],
                           pal_diagnostic *diag);
#endif
