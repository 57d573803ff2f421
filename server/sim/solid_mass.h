/* The mass matrix of a subdivided solid on its control points, M~ = A' M A with M = int mu G' G dV from the samples (A
 * 3.2.1), and the damping matrix D~ from gamma in the same pattern. One number per pair of points, the same for x, y
 * and z. Memory from the arena. Thread: [load] to make, [sim]. */
#ifndef PAL_SIM_SOLID_MASS_H
#define PAL_SIM_SOLID_MASS_H
#include "server/base/arena.h"
#include "server/sim/solid.h"

typedef struct pal_solid_mass {
    int n_point, n_entry;
    int32_t *start, *point;  /* [n_point+1], [n_entry], ascending in a row; symmetric, every row has its diagonal */
    double *mass_kg;         /* [n_entry], symmetric to the bit */
    double *damping_kg_s;    /* [n_entry]; NULL: gamma is 0 everywhere, or damping_1_s is not NaN */
    double damping_1_s;      /* gamma / mu where it is the same everywhere: D~ is that times M~; else NaN */
    double damping_most_1_s; /* the largest gamma / mu of all samples */
    /* work of pal_solid_mass_fill: points of an element, at most n_most; where they stand among them, else -1; their
     * shape functions at the Gauss points; room for damping_kg_s */
    int n_most;
    int32_t *of_element; /* [n_most]      */
    int32_t *local;      /* [n_point]     */
    double *shape;       /* [n_most][64]  */
    double *room_kg_s;   /* [n_entry]     */
} pal_solid_mass;

/* pattern and values; MEMORY */
pal_err pal_solid_mass_make(const pal_solid *solid, pal_arena *arena, pal_solid_mass *out);
/* values anew from the solid's samples, in place: after painting. No heap */
void pal_solid_mass_fill(const pal_solid *solid, pal_solid_mass *mass);
/* out = M~ p, p and out [n_point][3], apart */
void pal_solid_mass_multiply(const pal_solid_mass *mass, const double *p, double *out);
/* lumped: int mu N_i dV of points (row sums of M~) [n_point] and of nodes [solid->rows.n_row]; either may be NULL.
 * Those of control points may be small or below 0 where pyramids are; of nodes they are above 0 but for virtual ones */
void pal_solid_mass_lump(const pal_solid *solid, double *point_kg, double *node_kg);
#endif
