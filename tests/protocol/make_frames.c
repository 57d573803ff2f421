/* Writes an asset and one frame of every motion at 0.05 mm for the measurement of the viewer's decoder:
 * make_frames FOLDER [FINENESS]; fineness 70 gives 29,402 vertices. See bench_decoder.mjs. */
#include "protocol/frame_codec.h"
#include "tests/protocol/frame_shapes.h"

#include <stdio.h>

static bool save(const char *folder, const char *name, const void *bytes, size_t n_byte)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    if (!file) return false;
    bool good = fwrite(bytes, 1, n_byte, file) == n_byte;
    return fclose(file) == 0 && good;
}

int main(int argc, char **argv)
{
    static const char *const name[] = {"frame_rest.bin",  "frame_bump.bin",     "frame_bend.bin",  "frame_noise.bin",
                                       "frame_local.bin", "frame_teleport.bin", "frame_storm.bin", "frame_spike.bin"};
    if (argc < 2) return 2;
    shape s = shape_create(argc > 2 ? atoi(argv[2]) : 70);
    pal_frame_order *order = NULL;
    pal_frame_encoder *e = NULL;
    uint8_t *bytes = NULL, *frame = malloc(pal_frame_bound(s.n_vertex));
    float *position = malloc(3 * (size_t)s.n_vertex * sizeof *position);
    size_t n_byte;
    bool good = frame && position && !pal_frame_order_create(s.rest_m, s.n_vertex, s.triangle, s.n_triangle, &order) &&
                !pal_asset_encode(s.rest_m, NULL, NULL, order, s.triangle, s.n_triangle, &bytes, &n_byte) &&
                save(argv[1], "asset.bin", bytes, n_byte) && !pal_frame_encoder_create(s.rest_m, order, &e);
    for (int motion = 0; motion < MOTION_COUNT && good; motion++) {
        const pal_frame_input given = {.error_m = 5e-5, .position_m = position};
        pal_frame_result result;
        shape_move(&s, (shape_motion)motion, 40, position);
        good = !pal_frame_put(e, &given, frame, pal_frame_bound(s.n_vertex), &result) &&
               save(argv[1], name[motion], frame, result.n_byte);
    }
    pal_frame_encoder_destroy(e);
    pal_frame_order_destroy(order);
    shape_release(&s);
    free(bytes);
    free(frame);
    free(position);
    if (!good) fprintf(stderr, "make_frames: not written\n");
    return !good;
}
