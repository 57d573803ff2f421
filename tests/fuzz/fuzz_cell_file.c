/* Cell files from any bytes, ours and VTK. What is taken must be whole, and come back from its own text to the bit. */
#include "server/mesh/cells/cell_file.h"
#include "tests/fixtures/cell_check.h"

#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_cells c, back;
    pal_cells_topology topology;
    pal_surface surface;
    pal_diagnostic diag;
    if (pal_cell_file_parse("bytes", bytes, n_byte, &c, &diag)) return 0;
    if (cells_check(&c, NULL, &diag) == PAL_ERR_REFUSED) __builtin_trap();
    (void)pal_cells_find_topology(&c, &topology);
    if (!pal_cells_boundary(&c, &surface, NULL, NULL)) pal_surface_free(&surface);
    for (int vtk = 0; vtk < 2; vtk++) {
        uint8_t *text;
        size_t n;
        if (pal_cell_file_bytes(&c, vtk, &text, &n)) continue;
        pal_err err = pal_cell_file_parse("text", text, n, &back, &diag);
        if (err == PAL_ERR_REFUSED || (!err && !vtk && !cells_equal(&c, &back))) __builtin_trap();
        if (!err) pal_cells_free(&back);
        free(text);
    }
    pal_cells_free(&c);
    return 0;
}
