/* Rotations by singular value decomposition. */
#include "server/sim/core/best_rotation.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"

void pal_add_outer(double s[9], double k, const double x[3], const double y[3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) s[3 * i + j] += k * x[i] * y[j];
}

void pal_best_rotation(const double s[9], double rotation[9])
{
    double u[9], w[3], v[9];
    pal_svd3(s, u, w, v);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rotation[3 * i + j] = u[3 * i] * v[3 * j] + u[3 * i + 1] * v[3 * j + 1] + u[3 * i + 2] * v[3 * j + 2];
}

int pal_sum_pairs(int n, const uint8_t *mask, const double *x, const double *y, double s[9])
{
    double from[3] = {0, 0, 0}, to[3] = {0, 0, 0};
    int n_used = 0;
    for (int i = 0; i < 9; i++) s[i] = 0;
    for (int i = 0; i < n; i++) {
        if (mask && !mask[i]) continue;
        pal_add3(from, from, y + 3 * (size_t)i), pal_add3(to, to, x + 3 * (size_t)i), n_used++;
    }
    if (n_used == 0) return 0;
    pal_scale3(from, 1.0 / n_used, from), pal_scale3(to, 1.0 / n_used, to);
    for (int i = 0; i < n; i++) {
        double a[3], b[3];
        if (mask && !mask[i]) continue;
        pal_sub3(a, x + 3 * (size_t)i, to), pal_sub3(b, y + 3 * (size_t)i, from);
        pal_add_outer(s, 1, a, b);
    }
    return n_used;
}

bool pal_support_rotation(const pal_body *body, double rotation[9])
{
    double s[9], rest[9], width[3], axes[9];
    if (pal_sum_pairs(body->n_dof, body->support, body->x_rest, body->x_rest, rest) < 3) return false;
    pal_eigen3(rest, width, axes);
    if (!(width[1] > 1e-6 * body->length_scale_m * body->length_scale_m)) return false;
    pal_sum_pairs(body->n_dof, body->support, body->x, body->x_rest, s);
    pal_best_rotation(s, rotation);
    return true;
}
