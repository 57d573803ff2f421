/* Wavefront MTL: newmtl begins a material, map_Kd names the image of its colour; everything else is left out. */
#include "server/mesh/files/material_file.h"

#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/text_scan.h"

#include <stdio.h>
#include <string.h>

/* the rest of the line without spaces at its ends; false: it is too long, or has control characters */
static bool rest_of_line(pal_text_scan *scan, char out[128])
{
    size_t n = 0;
    out[0] = 0;
    if (!pal_text_more(scan)) return true;
    for (const uint8_t *p = scan->at; p < scan->end && *p != '\n' && *p != '\r'; p++) {
        if (n == 127 || *p < 0x20 || *p == 0x7F) return false;
        out[n++] = (char)*p;
    }
    while (n > 0 && out[n - 1] == ' ') n--;
    out[n] = 0;
    return true;
}

pal_err pal_material_image(const char *name, const uint8_t *bytes, size_t n_byte, const char *material, char image[128],
                           pal_diagnostic *diag)
{
    char shown[128], word[128];
    bool ours = !material[0];
    pal_text_scan scan = {.at = bytes, .end = bytes + n_byte, .line = 1};
    pal_file_printable_name(shown, name);
    image[0] = 0;
    do {
        if (pal_text_is(&scan, "newmtl")) {
            ours = rest_of_line(&scan, word) && (!material[0] || !strcmp(word, material));
        } else if (ours && !image[0] && pal_text_is(&scan, "map_Kd")) {
            if (!rest_of_line(&scan, image))
                return PAL_REFUSE(diag,
                                  "%s: line %lld: map_Kd: the name of a file has at most 127 printable characters",
                                  shown, (long long)scan.line);
            if (image[0] == '-')
                return PAL_REFUSE(diag, "%s: line %lld: map_Kd: options are not read, found %s", shown,
                                  (long long)scan.line, pal_text_excerpt_at(&scan).text);
            if (image[0] == '.' || strpbrk(image, "/\\:"))
                return PAL_REFUSE(diag,
                                  "%s: line %lld: map_Kd: %s is not the plain name of a file: put the image beside the "
                                  "OBJ file",
                                  shown, (long long)scan.line, pal_text_excerpt_at(&scan).text);
        }
    } while (pal_text_next_line(&scan));
    return PAL_ERR_OK;
}
