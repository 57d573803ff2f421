/* Which voxels are inside: chooses the method. */
#include "server/mesh/voxel_scan.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool pal_scan_plain(const pal_crossings *crossings, pal_bits *inside)
{
    int32_t first = 0;
    for (int row = 0; row < crossings->n_row; row++) {
        const pal_crossing *item = crossings->item + crossings->start[row];
        int64_t n = crossings->start[row + 1] - crossings->start[row];
        if (n == 0) continue;
        if (n & 1) return false;
        if (first == 0) first = item[0].sign;
        uint64_t *word = inside->word + (size_t)inside->n_word * (size_t)row;
        for (int64_t i = 0; i < n; i += 2) {
            if (item[i].sign != first || item[i + 1].sign == first) return false;
            pal_bits_set_run(word, item[i].place, item[i + 1].place);
        }
    }
    return true;
}

pal_err pal_voxels_decide(const pal_surface *surface, const pal_voxel_options *options, const pal_voxels *grid,
                          pal_bits *inside, pal_voxel_report *report, pal_note *note)
{
    pal_scan_surface scan;
    pal_crossings rows;
    (void)options;
    PAL_TRY(pal_scan_snap(surface, grid->low_m, grid->h_m, &scan));
    pal_err err = pal_scan_axis(&scan, grid->n, 0, &rows);
    if (!err) {
        if (!scan.closed || !pal_scan_plain(&rows, inside))
            err = pal_note_set(note, PAL_ERR_REFUSED, "the surface is not plain");
        strcpy(report->method, "scanline");
        report->surface_volume_m3 = fabs(pal_surface_volume(surface));
        pal_crossings_free(&rows);
    }
    pal_scan_surface_free(&scan);
    return err;
}
