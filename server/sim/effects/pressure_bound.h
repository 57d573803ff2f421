/* Bound of the stiffness of a pressure on a triangle. At constant p the edge (i, j) between corners k and l couples its
 * ends by p |x_k - x_l| / 6, at most the distances from both to its middle. */
#ifndef PAL_SIM_EFFECTS_PRESSURE_BOUND_H
#define PAL_SIM_EFFECTS_PRESSURE_BOUND_H
#include "server/base/vec3.h"

#include <stdint.h>

/* bound_N_m of the nodes of a triangle += its part for p / 6, Pa, positions x */
static inline void pal_pressure_bound(const double *x, const int32_t node[3], double sixth_Pa, double *bound_N_m)
{
    for (int c = 0; c < 3; c++) {
        const int32_t a = node[(c + 1) % 3], b = node[(c + 2) % 3];
        double middle[3];
        pal_add3(middle, x + 3 * a, x + 3 * b);
        pal_scale3(middle, 0.5, middle);
        const double bound = sixth_Pa * pal_dist3(x + 3 * node[c], middle);
        bound_N_m[a] += bound, bound_N_m[b] += bound;
    }
}
#endif
