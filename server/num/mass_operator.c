#include "server/num/mass_operator.h"

#include "server/base/vec3.h"

void pal_mass_operator_multiply(const pal_mass_operator *mass, double a, double b, const uint8_t *skip, const double *p,
                                double *out)
{
    const double *damping = b != 0 ? mass->damping_kg_s : NULL;
    for (int i = 0; i < mass->n_point; i++) {
        double x = 0, y = 0, z = 0, *to = out + 3 * (size_t)i;
        for (int32_t k = mass->start[i]; k < mass->start[i + 1] && !(skip && skip[i]); k++) {
            const double w = damping ? a * mass->mass_kg[k] + b * damping[k] : a * mass->mass_kg[k];
            const double *q = p + 3 * (size_t)mass->point[k];
            x += w * q[0], y += w * q[1], z += w * q[2];
        }
        to[0] = x, to[1] = y, to[2] = z;
    }
}

double pal_mass_operator_kinetic_J(const pal_mass_operator *mass, const double *v)
{
    double sum = 0;
    for (int i = 0; i < mass->n_point; i++)
        for (int32_t k = mass->start[i]; k < mass->start[i + 1]; k++)
            sum += 0.5 * mass->mass_kg[k] * pal_dot3(v + 3 * (size_t)i, v + 3 * (size_t)mass->point[k]);
    return sum;
}
