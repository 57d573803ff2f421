/* Rotations that fit best: of a cloud of vectors, and of what a body is held by (Kabsch; the proper factor of the
 * singular value decomposition). Thread: any. */
#ifndef PAL_SIM_CORE_BEST_ROTATION_H
#define PAL_SIM_CORE_BEST_ROTATION_H
#include "server/sim/core/body.h"

/* s += k x y' */
void pal_add_outer(double s[9], double k, const double x[3], const double y[3]);
/* the rotation G that maximises G : s, and so sum k |x - G y|^2 least for s = sum k x y'; none for s that is zero or
 * no number */
void pal_best_rotation(const double s[9], double turn[9]);
/* G of the held points, from where they rest to where they are; false: too few, or on a line */
bool pal_support_rotation(const pal_body *body, double turn[9]);
#endif
