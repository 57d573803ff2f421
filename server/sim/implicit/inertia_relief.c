/* Inertia relief. */
#include "server/sim/implicit/inertia_relief.h"

#include "server/base/vec3.h"

#include <string.h>

static bool invert(const double m[9], double to[9])
{
    double size = m[0] + m[4] + m[8], det;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            const double *a = m + 3 * ((r + 1) % 3), *b = m + 3 * ((r + 2) % 3);
            int i = (c + 1) % 3, j = (c + 2) % 3;
            to[3 * c + r] = a[i] * b[j] - a[j] * b[i];
        }
    det = m[0] * to[0] + m[1] * to[3] + m[2] * to[6];
    if (!(det > 1e-12 * size * size * size)) return false;
    for (int i = 0; i < 9; i++) to[i] /= det;
    return true;
}

bool pal_inertia_relief_make(const pal_body *body, const double *x, pal_inertia_relief *out)
{
    double inertia[9] = {0};
    memset(out, 0, sizeof *out);
    out->x = x;
    for (int i = 0; i < body->n_node; i++) {
        out->mass_kg += body->mass_kg[i];
        pal_axpy3(out->centre_m, body->mass_kg[i], x + 3 * i);
    }
    pal_scale3(out->centre_m, 1 / out->mass_kg, out->centre_m);
    for (int i = 0; i < body->n_node; i++) {
        double p[3];
        pal_sub3(p, x + 3 * i, out->centre_m);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                inertia[3 * r + c] += body->mass_kg[i] * ((r == c ? pal_dot3(p, p) : 0) - p[r] * p[c]);
    }
    return invert(inertia, out->inverse);
}

/* the sum of a field and its moment, each value times mass where weighted */
static void sum_up(const pal_inertia_relief *relief, const pal_body *body, bool weighted, const double *field,
                   double sum[3], double spin[3])
{
    double moment[3] = {0, 0, 0};
    pal_set3(sum, 0, 0, 0);
    for (int i = 0; i < body->n_node; i++) {
        double p[3], turn[3], m = weighted ? body->mass_kg[i] : 1;
        pal_sub3(p, relief->x + 3 * i, relief->centre_m);
        pal_cross3(turn, p, field + 3 * i);
        pal_axpy3(sum, m, field + 3 * i);
        pal_axpy3(moment, m, turn);
    }
    pal_mul33(spin, relief->inverse, moment);
    pal_scale3(sum, 1 / relief->mass_kg, sum);
}

static void take_out(const pal_inertia_relief *relief, const pal_body *body, bool weighted, const double mean[3],
                     const double spin[3], double *field)
{
    for (int i = 0; i < body->n_node; i++) {
        double p[3], turn[3], m = weighted ? body->mass_kg[i] : 1;
        pal_sub3(p, relief->x + 3 * i, relief->centre_m);
        pal_cross3(turn, spin, p);
        pal_add3(turn, turn, mean);
        pal_axpy3(field + 3 * i, -m, turn);
    }
}

void pal_inertia_relief_balance(const pal_inertia_relief *relief, const pal_body *body, double *force)
{
    double mean[3], spin[3];
    sum_up(relief, body, false, force, mean, spin);
    take_out(relief, body, true, mean, spin, force);
}

void pal_inertia_relief_remove_rigid(const pal_inertia_relief *relief, const pal_body *body, double *move)
{
    double mean[3], spin[3];
    sum_up(relief, body, true, move, mean, spin);
    take_out(relief, body, false, mean, spin, move);
}
