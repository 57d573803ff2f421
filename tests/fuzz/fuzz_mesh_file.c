/* The surface readers on any bytes: the first byte of the input chooses the name, and with it the reader of last
 * resort; the rest is the file. */
#include "server/mesh/files/mesh_file.h"

#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static const char *const name[] = {"a.obj", "a.stl", "a.ply", "a.off", "a"};
    if (n_byte == 0) return 0;
    pal_surface s = {0};
    pal_surface_report report;
    pal_surface_topology topology;
    pal_diagnostic diag;
    double unit_m;
    pal_image_map map = {0};
    const pal_mesh_file_options options = {.weld = PAL_MESH_WELD, .image = &map};
    if (pal_mesh_file_parse(name[bytes[0] % 5], bytes + 1, n_byte - 1, &options, &s, &report, &unit_m, NULL, &diag))
        return 0;
    if (map.n_tri) {
        int image[PAL_MATERIAL_MAX];
        for (int m = 0; m < PAL_MATERIAL_MAX; m++) image[m] = m % 3 - 1;
        if (map.n_material < 1 || map.n_material > PAL_MATERIAL_MAX) __builtin_trap();
        if (!pal_image_map_take(&map, image, &s))
            for (int c = 0; c < 3 * s.n_tri; c++)
                if (!(s.image_at[3 * c + 2] >= -1 && s.image_at[3 * c + 2] <= 1)) __builtin_trap();
    }
    pal_image_map_free(&map);
    /* what was accepted must be usable */
    (void)pal_surface_check(&s, &topology);
    for (int c = 0; c < 3 * s.n_tri; c++)
        if (s.tri[c] < 0 || s.tri[c] >= s.n_vertex) __builtin_trap();
    for (int c = 0; c < 3 * s.n_vertex; c++)
        if (!(s.x[c] < 1e100 && s.x[c] > -1e100)) __builtin_trap();
    pal_surface_free(&s);
    return 0;
}
