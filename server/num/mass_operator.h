/* Consistent mass matrix on the unknowns: one number per pair of points, equal for x, y and z, and damping in the same
 * pattern (paper A section 3.2.1). The model that owns the body makes the pattern and fills the values. Memory belongs
 * to that model. Thread: [load] to make, [sim]. */
#ifndef PAL_NUM_MASS_OPERATOR_H
#define PAL_NUM_MASS_OPERATOR_H
#include <stddef.h>
#include <stdint.h>

typedef struct pal_mass_operator {
    int n_point, n_entry;
    int32_t *start, *point; /* [n_point+1], [n_entry], ascending in a row; symmetric, every row has its diagonal */
    double *mass_kg;        /* [n_entry], symmetric to the bit */
    double *damping_kg_s;   /* [n_entry]; NULL: damping is 0 everywhere, or damping_1_s is not NaN */
    double damping_1_s;     /* damping / mass where it is the same everywhere; else NaN */
    double damping_max_1_s; /* the largest damping / mass of all samples */
    /* scratch of the model that fills the values: points of an element, at most n_max; their index among them, else -1;
     * their shape functions at the Gauss points; space for damping_kg_s */
    int n_max;
    int32_t *element_point; /* [n_max]      */
    int32_t *local;         /* [n_point]     */
    double *shape;          /* [n_max][64]  */
    double *scratch_kg_s;   /* [n_entry]     */
} pal_mass_operator;

/* out = (a M + b D) p with D the damping, 0 at points where skip [n_point] is not 0 (NULL: none); p and out
 * [n_point][3] do not overlap */
void pal_mass_operator_multiply(const pal_mass_operator *mass, double a, double b, const uint8_t *skip, const double *p,
                                double *out);
/* v' M v / 2, J; v m/s [n_point][3] */
double pal_mass_operator_kinetic_J(const pal_mass_operator *mass, const double *v);
#endif
