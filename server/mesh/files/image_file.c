/* PNG: signature, then IHDR with the size (RFC 2083). JPEG: segments up to the frame header, which has the size (ITU
 * T.81, B.2.2). */
#include "server/mesh/files/image_file.h"

#include "server/mesh/files/file_bytes.h"

#include <stdlib.h>
#include <string.h>

static const uint8_t png_head[16] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
static const uint8_t jpeg_head[3] = {0xFF, 0xD8, 0xFF};

const char *pal_image_type(const uint8_t *bytes, size_t n_byte)
{
    if (n_byte >= sizeof png_head && !memcmp(bytes, png_head, sizeof png_head)) return "image/png";
    if (n_byte >= sizeof jpeg_head && !memcmp(bytes, jpeg_head, sizeof jpeg_head)) return "image/jpeg";
    return NULL;
}

static uint32_t big_endian(const uint8_t *p, int n)
{
    uint32_t value = 0;
    for (int k = 0; k < n; k++) value = value << 8 | p[k];
    return value;
}

static bool png_size(const uint8_t *b, size_t n, uint32_t size[2])
{
    if (n < 33) return false;
    size[0] = big_endian(b + 16, 4), size[1] = big_endian(b + 20, 4);
    return true;
}

/* a frame header of any process, but not the tables whose markers lie among theirs */
static bool is_frame(uint8_t marker)
{
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

static bool jpeg_size(const uint8_t *b, size_t n, uint32_t size[2])
{
    for (size_t at = 2; at + 9 <= n;) {
        const uint32_t length = big_endian(b + at + 2, 2);
        if (b[at] != 0xFF) return false;
        if (b[at + 1] == 0xFF) {
            at++; /* markers may be filled up */
            continue;
        }
        if (is_frame(b[at + 1])) {
            size[1] = big_endian(b + at + 5, 2), size[0] = big_endian(b + at + 7, 2);
            return true;
        }
        if (b[at + 1] == 0xDA || length < 2) return false; /* pixels before their size */
        at += 2 + (size_t)length;
    }
    return false;
}

pal_err pal_image_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_image *out, pal_diagnostic *diag)
{
    char shown[128];
    uint32_t size[2];
    const char *type = pal_image_type(bytes, n_byte);
    pal_file_printable_name(shown, name);
    if (!type) return PAL_REFUSE(diag, "%s: byte 0: neither a PNG nor a JPEG image", shown);
    if (n_byte > PAL_IMAGE_MAX_BYTE)
        return PAL_REFUSE(diag, "%s: %zu bytes, an image has at most %d", shown, n_byte, PAL_IMAGE_MAX_BYTE);
    const bool png = !strcmp(type, "image/png");
    if (!(png ? png_size : jpeg_size)(bytes, n_byte, size))
        return PAL_REFUSE(diag, "%s: byte %zu: the file ends before the size of the image", shown, n_byte);
    for (int k = 0; k < 2; k++)
        if (size[k] < 1 || size[k] > PAL_IMAGE_MAX_SIDE)
            return PAL_REFUSE(diag, "%s: %u x %u pixels, 1 to %d a side are shown", shown, size[0], size[1],
                              PAL_IMAGE_MAX_SIDE);
    uint8_t *copy = malloc(n_byte);
    if (!copy) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for %zu bytes", shown, n_byte);
    memcpy(copy, bytes, n_byte);
    *out = (pal_image){copy, n_byte, png ? ".png" : ".jpg", (int)size[0], (int)size[1]};
    return PAL_ERR_OK;
}

pal_err pal_image_read(const char *path, pal_image *out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, PAL_IMAGE_MAX_BYTE, &bytes, &n_byte, diag));
    pal_err err = pal_image_parse(path, bytes, n_byte, out, diag);
    free(bytes);
    return err;
}

void pal_image_free(pal_image *image)
{
    free(image->bytes);
    memset(image, 0, sizeof *image);
}

pal_err pal_images_check(const pal_image *image, int n, pal_diagnostic *diag)
{
    size_t n_byte = 0, n_pixel = 0;
    if (n > PAL_IMAGES_MAX) return PAL_REFUSE(diag, "%d images, a body shows at most %d", n, PAL_IMAGES_MAX);
    for (int k = 0; k < n; k++) {
        n_byte += image[k].n_byte;
        n_pixel += (size_t)image[k].width * (size_t)image[k].height;
    }
    if (n_byte > PAL_IMAGE_MAX_BYTE)
        return PAL_REFUSE(diag, "%d images with together %zu bytes, those of a body have at most %d", n, n_byte,
                          PAL_IMAGE_MAX_BYTE);
    if (n_pixel > PAL_IMAGES_MAX_PIXEL)
        return PAL_REFUSE(diag, "%d images with together %zu pixels, those of a body have at most %d", n, n_pixel,
                          PAL_IMAGES_MAX_PIXEL);
    return PAL_ERR_OK;
}
