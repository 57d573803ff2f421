/* Images and files of materials on any bytes: the first byte chooses which, the rest is the file. */
#include "server/mesh/files/image_file.h"
#include "server/mesh/files/material_file.h"

#include <stdint.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_diagnostic diag;
    if (n_byte == 0) return 0;
    if (bytes[0] & 1) {
        pal_image image;
        if (pal_image_parse("a", bytes + 1, n_byte - 1, &image, &diag)) return 0;
        /* what was accepted can be served and drawn */
        if (!pal_image_type(image.bytes, image.n_byte) || image.width < 1 || image.height < 1 ||
            image.width > PAL_IMAGE_MAX_SIDE || image.height > PAL_IMAGE_MAX_SIDE)
            __builtin_trap();
        pal_image_free(&image);
    } else {
        char name[128];
        if (pal_material_image("a", bytes + 1, n_byte - 1, bytes[0] & 2 ? "skin" : "", name, &diag)) return 0;
        if (memchr(name, 0, sizeof name) == NULL || name[0] == '.' || strpbrk(name, "/\\:\n")) __builtin_trap();
    }
    return 0;
}
