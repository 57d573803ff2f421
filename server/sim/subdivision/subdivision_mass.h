/* The mass matrix of a subdivision solid on its control points, M~ = A' M A with M = int mu G' G dV from the samples
 * (paper A section 3.2.1), and the damping matrix D~ from gamma in the same pattern. One number for each pair of
 * points, the same for x, y and z. Memory from the arena. Thread: [load] to make, [sim]. */
#ifndef PAL_SIM_SUBDIVISION_SUBDIVISION_MASS_H
#define PAL_SIM_SUBDIVISION_SUBDIVISION_MASS_H
#include "server/base/arena.h"
#include "server/num/mass_operator.h"
#include "server/sim/subdivision/subdivision_solid.h"

/* pattern and values; MEMORY */
pal_err pal_subdivision_mass_make(const pal_subdivision_solid *solid, pal_arena *arena, pal_mass_operator *out);
/* computes the values again from the solid's samples, after painting. No heap */
void pal_subdivision_mass_fill(const pal_subdivision_solid *solid, pal_mass_operator *mass);
/* lumped: int mu N_i dV of points (row sums of M~) [n_point] and of nodes [solid->rows.n_row]; either may be NULL.
 * Those of control points may be small or below 0 where pyramids are; of nodes they are above 0 but for virtual ones */
void pal_subdivision_mass_lump(const pal_subdivision_solid *solid, double *point_kg, double *node_kg);
#endif
