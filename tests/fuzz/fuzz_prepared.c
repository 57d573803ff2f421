/* Prepared meshes from any bytes. The checksum is set right first, so that the checks behind it are reached. What is
 * taken is used: the skin on its tetrahedra, the surface to make levels of, voxels to make larger ones of. */
#include "server/mesh/geometry/levels.h"
#include "server/mesh/volume/prepared.h"
#include "server/mesh/volume/voxel_coarsening.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_prepared p;
    pal_diagnostic diag;
    if (!pal_prepared_parse("bytes", bytes, n_byte, &p, &diag)) pal_prepared_free(&p);
    if (n_byte < 32) return 0;
    uint8_t *copy = malloc(n_byte);
    if (!copy) return 0;
    memcpy(copy, bytes, n_byte);
    uint64_t size = n_byte, sum;
    memcpy(copy + 16, &size, 8);
    sum = pal_prepared_checksum(copy, n_byte);
    memcpy(copy + 24, &sum, 8);
    if (!pal_prepared_parse("bytes", copy, n_byte, &p, &diag)) {
        /* what was taken must be fit for use */
        double *x = p.tets.x;
        float *out = malloc((size_t)p.skin.n_vertex * 12 + 1);
        void *frames = calloc(p.skin.n_frame ? (size_t)p.skin.n_frame : 1, 64);
        if (out && frames) {
            pal_skin_frames(&p.skin, x, NULL, frames);
            pal_skin_evaluate(&p.skin, frames, NULL, out);
        }
        free(out);
        free(frames);
        pal_levels levels;
        const pal_levels_options options = {.n_level = 2, .budget_byte = 16 << 20};
        if (!pal_levels_make(&p.surface, &options, &levels, &diag)) pal_levels_free(&levels);
        pal_prepared coarse;
        if (p.hexes.n_hex > 0 && !pal_voxels_coarsen(&p.tets, &p.hexes, (int[3]){0}, 0.1, &coarse, &diag))
            pal_prepared_free(&coarse);
        pal_prepared_free(&p);
    }
    free(copy);
    return 0;
}
