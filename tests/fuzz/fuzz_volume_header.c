/* The text headers of voxel images on any bytes; the first byte chooses which one. */
#include "server/mesh/scan/volume_header.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_volume_header h;
    pal_diagnostic diag = {{0}};
    if (n_byte == 0) return 0;
    pal_err err = bytes[0] & 1 ? pal_nrrd_header("a.nrrd", bytes + 1, n_byte - 1, &h, &diag)
                               : pal_metaimage_header("a.mha", bytes + 1, n_byte - 1, &h, &diag);
    if (err && !diag.text[0]) __builtin_trap();
    if (!err && (h.offset > n_byte - 1 || h.n[0] < 1 || h.n[1] < 1 || h.n[2] < 1)) __builtin_trap();
    return 0;
}
