/* Best-fit rotations: of pairs of vectors, and of the supports of a body (Kabsch; the proper factor of the singular
 * value decomposition). Thread: any. */
#ifndef PAL_SIM_CORE_BEST_ROTATION_H
#define PAL_SIM_CORE_BEST_ROTATION_H
#include "server/sim/core/body.h"

/* s += k x y' */
void pal_add_outer(double s[9], double k, const double x[3], const double y[3]);
/* The rotation G that maximises G : s, and with s = sum k x y' minimises sum k |x - G y|^2; the identity for an s that
 * is zero or not finite */
void pal_best_rotation(const double s[9], double rotation[9]);
/* s = sum of (x_i - their mean)(y_i - their mean)' over the n points whose mask is not 0 (NULL: all); returns how many
 */
int pal_sum_pairs(int n, const uint8_t *mask, const double *x, const double *y, double s[9]);
/* G of the supported dofs, from their positions at rest to the present ones; false: too few, or all on a line */
bool pal_support_rotation(const pal_body *body, double rotation[9]);
#endif
