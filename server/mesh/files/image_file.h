/* Images that a page shows on a surface: PNG and JPEG. Nothing is decoded here; what is checked is what would hurt or
 * disappoint a browser: the kind by its first bytes, and its size. The bytes are untrusted. Thread: [load]. */
#ifndef PAL_MESH_FILES_IMAGE_FILE_H
#define PAL_MESH_FILES_IMAGE_FILE_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* an image has at most 16 MiB, as a page loads it at its start, and 8192 pixels a side, as graphics chips take; the
 * images of a body have no more than that together, and are no more than half of what a shader may read */
enum {
    PAL_IMAGE_MAX_BYTE = 16 << 20,
    PAL_IMAGE_MAX_SIDE = 8192,
    PAL_IMAGES_MAX = 8,
    PAL_IMAGES_MAX_PIXEL = PAL_IMAGE_MAX_SIDE * PAL_IMAGE_MAX_SIDE
};

typedef struct pal_image {
    uint8_t *bytes; /* the file; NULL: no image */
    size_t n_byte;
    const char *ending; /* ".png" or ".jpg" */
    int width, height;  /* pixels           */
} pal_image;

/* IO, REFUSED, MEMORY */
pal_err pal_image_read(const char *path, pal_image *out, pal_diagnostic *diag);
/* the same from memory, copied; name is used in messages only */
pal_err pal_image_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_image *out, pal_diagnostic *diag);
void pal_image_free(pal_image *image);
/* may these n images be shown on one body? REFUSED with both numbers */
pal_err pal_images_check(const pal_image *image, int n, pal_diagnostic *diag);
/* "image/png", "image/jpeg", or NULL: bytes of no such image */
const char *pal_image_type(const uint8_t *bytes, size_t n_byte);
#endif
