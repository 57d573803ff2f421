/* Images that a page shows on a surface: PNG and JPEG. Nothing is decoded here; what is checked is what would hurt or
 * disappoint a browser: the kind by its first bytes, and its size. The bytes are untrusted. Thread: [load]. */
#ifndef PAL_MESH_FILES_IMAGE_FILE_H
#define PAL_MESH_FILES_IMAGE_FILE_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* an image has at most 16 MiB, as a page loads it at its start, and 8192 pixels a side, as graphics chips take */
enum { PAL_IMAGE_MAX_BYTE = 16 << 20, PAL_IMAGE_MAX_SIDE = 8192 };

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
/* "image/png", "image/jpeg", or NULL: bytes of no such image */
const char *pal_image_type(const uint8_t *bytes, size_t n_byte);
#endif
