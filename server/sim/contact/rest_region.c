/* The nodes that a support holds (rest_region.h). */
#include "server/sim/contact/rest_region.h"

#include "server/base/vec3.h"

pal_err pal_rest_region_read(pal_config_entry *entry, const double *x, int n, const double up[3], pal_rest_region *out,
                             pal_diagnostic *diag)
{
    double lowest = 0.05, low = INFINITY, high = -INFINITY;
    *out = (pal_rest_region){.box = pal_entry_has(entry, "low_m") || pal_entry_has(entry, "high_m")};
    if (out->box && pal_entry_has(entry, "lowest"))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: either low_m and high_m or lowest", entry->path);
    if (out->box && !(pal_entry_has(entry, "low_m") && pal_entry_has(entry, "high_m")))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: low_m and high_m belong together", entry->path);
    PAL_TRY(pal_entry_read_numbers(entry, "low_m", 3, out->low_m, diag));
    PAL_TRY(pal_entry_read_numbers(entry, "high_m", 3, out->high_m, diag));
    PAL_TRY(pal_entry_read_number(entry, "lowest", 0, 1, &lowest, diag));
    pal_copy3(out->up, up);
    for (int i = 0; i < n; i++) {
        double z = pal_dot3(x + 3 * (size_t)i, up);
        low = fmin(low, z), high = fmax(high, z);
    }
    /* slightly higher, so that rounding does not separate nodes of one height */
    out->top_m = low + (lowest + 1e-9) * (high - low);
    return PAL_ERR_OK;
}

bool pal_rest_region_has(const pal_rest_region *region, const double x[3])
{
    if (!region->box) return pal_dot3(x, region->up) <= region->top_m;
    for (int c = 0; c < 3; c++)
        if (!(x[c] >= region->low_m[c] && x[c] <= region->high_m[c])) return false;
    return true;
}
