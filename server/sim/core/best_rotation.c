/* Rotations by singular value decomposition. */
#include "server/sim/core/best_rotation.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"

void pal_add_outer(double s[9], double k, const double x[3], const double y[3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) s[3 * i + j] += k * x[i] * y[j];
}

void pal_best_rotation(const double s[9], double turn[9])
{
    double u[9], w[3], v[9];
    pal_svd3(s, u, w, v);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            turn[3 * i + j] = u[3 * i] * v[3 * j] + u[3 * i + 1] * v[3 * j + 1] + u[3 * i + 2] * v[3 * j + 2];
}

bool pal_support_rotation(const pal_body *body, double turn[9])
{
    double from[3] = {0, 0, 0}, to[3] = {0, 0, 0}, s[9] = {0}, rest[9] = {0}, width[3], axes[9];
    int n = 0;
    for (int i = 0; i < body->n_dof; i++) {
        if (!body->support[i]) continue;
        pal_add3(from, from, body->x_rest + 3 * (size_t)i), pal_add3(to, to, body->x + 3 * (size_t)i), n++;
    }
    if (n < 3) return false;
    pal_scale3(from, 1.0 / n, from), pal_scale3(to, 1.0 / n, to);
    for (int i = 0; i < body->n_dof; i++) {
        double x[3], y[3];
        if (!body->support[i]) continue;
        pal_sub3(x, body->x + 3 * (size_t)i, to), pal_sub3(y, body->x_rest + 3 * (size_t)i, from);
        pal_add_outer(s, 1, x, y), pal_add_outer(rest, 1, y, y);
    }
    pal_eigen3(rest, width, axes);
    if (!(width[1] > 1e-6 * body->length_scale_m * body->length_scale_m)) return false;
    pal_best_rotation(s, turn);
    return true;
}
