/* Scene files from untrusted bytes. The folder does not exist, so that no entry opens a file. */
#include "server/scene/scene_file.h"

#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag;
    /* absolute names would leave the folder */
    for (size_t k = 0; k < n_byte; k++)
        if (bytes[k] == '/') return 0;
    if (!pal_scene_parse("fuzz", (const char *)bytes, n_byte, "/nowhere", &loaded, &diag)) pal_scene_free(loaded);
    return 0;
}
