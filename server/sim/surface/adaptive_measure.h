/* What is shown of the springs of an adaptive surface: stress, energy density, strain, modulus. Nodes have the means of
 * the leaves around them, weighted by area at rest; only for what is looked at.
 *
 * The stress of a leaf is that of its springs' forces (virial), sum of (f / l) d d' over its area now times the
 * thickness, of which a spring counts by the leaf's share of its stiffness. For equilateral triangles with the constant
 * k = sqrt(3)/2 E t it is that of a membrane in plane stress with Poisson's ratio 1/3. The strain is the largest
 * principal stretch less 1 of a drawn triangle. Thread: [sim]; no heap. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_MEASURE_H
#define PAL_SIM_SURFACE_ADAPTIVE_MEASURE_H
#include "server/sim/surface/adaptive_surface.h"

enum {
    PAL_ADAPTIVE_FIELDS =
        1 << PAL_FIELD_VON_MISES_PA | 1 << PAL_FIELD_ENERGY_J_M3 | 1 << PAL_FIELD_STRAIN | 1 << PAL_FIELD_YOUNG_PA
};

typedef struct pal_adaptive_springs {
    double k_N_m; /* of a spring of share 1 where E is young_Pa */
    double thickness_m, young_Pa;
    const float *edge_young; /* E of the springs, NaN: young_Pa; NULL: no regions [edges of all levels] */
} pal_adaptive_springs;

/* sum [n_node] += field times area, area_m2 [n_node] += area at rest; d [n_node][3] */
void pal_adaptive_measure(const pal_adaptive_surface *s, const pal_adaptive_springs *springs, const double *d,
                          pal_field field, double *sum, double *area_m2);
#endif
