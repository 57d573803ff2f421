/* The nodes that a support holds (rest_region.h). */
#include "server/sim/contact/rest_region.h"

pal_err pal_rest_region_find(pal_config_entry *entry, const double *x, int n, const pal_build *build, uint8_t **held)
{
    const bool low = pal_entry_has(entry, "low_m"), high = pal_entry_has(entry, "high_m");
    pal_support_def region = {.lowest = !low && !high, .fraction = 0.05};
    if (!region.lowest && pal_entry_has(entry, "lowest"))
        return PAL_REFUSE(build->diag, "%s: either low_m and high_m or lowest", entry->path);
    if (low != high) return PAL_REFUSE(build->diag, "%s: low_m and high_m belong together", entry->path);
    PAL_TRY(pal_entry_read_numbers(entry, "low_m", 3, region.low_m, build->diag));
    PAL_TRY(pal_entry_read_numbers(entry, "high_m", 3, region.high_m, build->diag));
    PAL_TRY(pal_entry_read_number(entry, "lowest", 0, 1, &region.fraction, build->diag));
    *held = PAL_NEW(build->arena, uint8_t, n);
    if (!*held) return PAL_ERR_MEMORY;
    pal_support_mark_fixed(&region, build->scene->up, x, n, *held);
    return PAL_ERR_OK;
}
