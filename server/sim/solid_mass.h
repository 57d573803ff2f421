/* The mass matrix of a subdivided solid on its control points, M~ = A' M A with M = int mu G' G dV from the samples (A
 * 3.2.1), and the damping matrix D~ from gamma in the same pattern. One number per pair of points, the same for x, y
 * and z. Memory from the arena. Thread: [load] to make, [sim]. */
#ifndef PAL_SIM_SOLID_MASS_H
#define PAL_SIM_SOLID_MASS_H
#include "server/base/arena.h"
#include "server/sim/solid.h"

typedef struct pal_solid_mass {
    int n_point, n_entry;
    int32_t *start, *point; /* [n_point+1], [n_entry], ascending in a row; symmetric, every row has its diagonal */
    double *mass_kg;        /* [n_entry] */
    double *damping_kg_s;   /* [n_entry]; NULL: gamma is 0 everywhere, or damping_1_s is not NaN */
    double damping_1_s;     /* gamma / mu where it is the same everywhere: D~ is that times M~; else NaN */
} pal_solid_mass;

/* pattern and values; MEMORY */
pal_err pal_solid_mass_make(const pal_solid *solid, pal_arena *arena, pal_solid_mass *out);
/* values anew from the solid's samples, in place: after painting */
void pal_solid_mass_fill(const pal_solid *solid, pal_solid_mass *mass);
/* out = M~ p, p and out [n_point][3], apart */
void pal_solid_mass_multiply(const pal_solid_mass *mass, const double *p, double *out);
/* lumped: int mu N_i dV of points (row sums of M~) [n_point] and of nodes [solid->rows.n_row]; either may be NULL.
 * Those of control points may be small or below 0 where pyramids are; of nodes they are above 0 but for virtual ones */
void pal_solid_mass_lump(const pal_solid *solid, double *point_kg, double *node_kg);
#endif
