/* The label volume readers on any bytes, and the surface of the largest label of small volumes. */
#include "server/mesh/scan/label_volume.h"

#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_label_volume v = {0};
    pal_diagnostic diag;
    if (pal_label_volume_parse("a.nii", bytes, n_byte, &v, &diag)) return 0;
    pal_label_count list[3];
    int n = pal_label_volume_list(&v, list, 3);
    pal_surface s = {0};
    int64_t n_voxel = (int64_t)v.n[0] * v.n[1] * v.n[2];
    static const pal_label_surface_options options = {.blur_m = -1, .smooth_rounds = 2, .target_tri = 100};
    if (n > 0 && n_voxel < 20000 && !pal_label_volume_surface(&v, list[0].label, &options, &s, &diag)) {
        pal_surface_topology topology;
        if (!pal_surface_check(&s, &topology) && !(topology.closed && topology.manifold)) __builtin_trap();
        pal_surface_free(&s);
    }
    pal_label_volume_free(&v);
    return 0;
}
