/* Which bodies of voxel hexahedra run on their five-tetrahedra split (elastic_hex.h, "Recovery"). */
#include "server/sim/elements/elastic_hex_simd.h"

/* corner determinants, h^3: a body below or above runs on its split. Above 30 the neo-Hookean energy, which grows with
 * the square, lets nothing else count, and nearly incompressible bodies take detours */
static const double least_corner = 0.05, most_corner = 30;
/* a body on its split returns to hexahedra between these */
static const double least_whole = 0.3, most_needed = 0.9, most_whole = 20;
/* inverted again within so many updates, one a Newton iteration: the return was in vain, and the next one needs corners
 * better by this */
enum { SOON = 600 };
static const double better = 0.05;

void pal_hex_recovery_reset(pal_elastic_hexes *row)
{
    row->has_inversion = false;
    row->n_whole = SOON, row->needed = row->tried = least_whole;
}

/* least and largest of the determinants of the three edges at each corner */
PAL_INLINE void range_of_corners(const hex_view *v, int l, pal_wide *low, pal_wide *high)
{
    pal_wide x[8][3], least = wide_of(INFINITY), most = wide_of(-INFINITY);
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 3; d++) x[c][d] = pal_wide_load(v->x[c][d] + l);
    for (int c = 0; c < 8; c++) {
        pal_wide a[3], b[3], e[3];
        for (int d = 0; d < 3; d++) {
            a[d] = x[c | 1][d] - x[c & 6][d];
            b[d] = x[c | 2][d] - x[c & 5][d];
            e[d] = x[c | 4][d] - x[c & 3][d];
        }
        pal_wide det = a[0] * (b[1] * e[2] - b[2] * e[1]) + a[1] * (b[2] * e[0] - b[0] * e[2]) +
                       a[2] * (b[0] * e[1] - b[1] * e[0]);
        least = pal_wide_select(det < least, det, least);
        most = pal_wide_select(det > most, det, most);
    }
    *low = least, *high = most;
}

/* over all voxels, h^3 */
static void corner_range(const pal_elastic_hexes *row, const pal_body *body, double *low, double *high)
{
    const double volume = row->edge_m * row->edge_m * row->edge_m;
    pal_wide least = wide_of(INFINITY), most = wide_of(-INFINITY);
    pal_node_order_load(body->node_order, body->d);
    for (int b = 0; b < row->n_block; b++) {
        hex_view v;
        hex_open(row, body->node_order, b, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide small, large;
            range_of_corners(&v, l, &small, &large);
            pal_wide_mask live = pal_wide_load(row->share + PAL_LANES * b + l) > 0;
            least = pal_wide_select(live & (small < least), small, least);
            most = pal_wide_select(live & (large > most), large, most);
        }
    }
    *low = INFINITY, *high = -INFINITY;
    for (int l = 0; l < PAL_WIDE; l++) *low = fmin(*low, least[l] / volume), *high = fmax(*high, most[l] / volume);
}

double pal_hex_min_corner(const pal_elastic_hexes *row, const pal_body *body)
{
    double low, high;
    corner_range(row, body, &low, &high);
    return low;
}

bool pal_hex_recover(pal_elastic_hexes *row, const pal_body *body)
{
    if (!row->split) return false;
    double low, high;
    corner_range(row, body, &low, &high);
    const bool before = row->has_inversion;
    if (before) {
        row->has_inversion = low < row->needed || high > most_whole;
        if (!row->has_inversion) row->n_whole = 0, row->tried = low;
    } else {
        row->has_inversion = low < least_corner || high > most_corner;
        if (row->n_whole < SOON) row->n_whole++;
    }
    if (row->has_inversion && !before) {
        row->needed = row->n_whole < SOON ? fmin(fmax(row->needed, row->tried) + better, most_needed) : least_whole;
        pal_elastic_tets_reset(row->split);
    }
    row->n_inversion += row->has_inversion;
    row->n_switch += row->has_inversion != before;
    return row->has_inversion != before;
}
