#include "server/sim/core/rigid_motion.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"

#include <stddef.h>

static double total_mass(int n, const double *mass_kg)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += mass_kg[i];
    return sum;
}

void pal_rigid_centre(int n, const double *mass_kg, const double *x, double centre_m[3])
{
    double sum = total_mass(n, mass_kg);
    pal_set3(centre_m, 0, 0, 0);
    for (int i = 0; i < n; i++) pal_axpy3(centre_m, mass_kg[i], x + 3 * i);
    if (sum > 0) pal_scale3(centre_m, 1 / sum, centre_m);
}

void pal_rigid_momenta(int n, const double *mass_kg, const double *x, const double *q, const double c[3],
                       double momentum[3], double moment[3])
{
    pal_set3(momentum, 0, 0, 0);
    pal_set3(moment, 0, 0, 0);
    for (int i = 0; i < n; i++) {
        double arm[3], about[3], m = mass_kg ? mass_kg[i] : 1;
        pal_sub3(arm, x + 3 * i, c);
        pal_cross3(about, arm, q + 3 * i);
        pal_axpy3(momentum, m, q + 3 * i);
        pal_axpy3(moment, m, about);
    }
}

int pal_rigid_spin(const double inertia[9], const double moment[3], double min, double spin[3])
{
    double w[3], axis[9];
    int n_axis = 0;
    pal_set3(spin, 0, 0, 0);
    pal_eigen3(inertia, w, axis);
    for (int k = 0; k < 3; k++) {
        if (!(w[k] > 1e-12 * w[2] && w[k] > min)) continue;
        pal_axpy3(spin, pal_dot3(axis + 3 * k, moment) / w[k], axis + 3 * k);
        n_axis++;
    }
    return n_axis;
}

void pal_rigid_motion_find(int n, const double *mass_kg, const double *x, const double momentum[3],
                           const double moment[3], pal_rigid_motion *out)
{
    double inertia[9] = {0}, sum = total_mass(n, mass_kg);
    pal_rigid_centre(n, mass_kg, x, out->centre_m);
    for (int i = 0; i < n; i++) {
        double r[3];
        pal_sub3(r, x + 3 * i, out->centre_m);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) inertia[3 * a + b] += mass_kg[i] * ((a == b) * pal_dot3(r, r) - r[a] * r[b]);
    }
    pal_scale3(out->linear, sum > 0 ? 1 / sum : 0, momentum);
    out->n_axis = pal_rigid_spin(inertia, moment, 0, out->angular);
}

void pal_rigid_motion_of(int n, const double *mass_kg, const double *x, const double *v, double momentum[3],
                         double moment[3], pal_rigid_motion *out)
{
    pal_rigid_centre(n, mass_kg, x, out->centre_m);
    pal_rigid_momenta(n, mass_kg, x, v, out->centre_m, momentum, moment);
    pal_rigid_motion_find(n, mass_kg, x, momentum, moment, out);
}

void pal_rigid_motion_at(const pal_rigid_motion *motion, const double x[3], double out[3])
{
    double arm[3];
    pal_sub3(arm, x, motion->centre_m);
    pal_cross3(out, motion->angular, arm);
    pal_add3(out, out, motion->linear);
}

void pal_rigid_motion_remove(int n, const double *mass_kg, const double *x, bool forces, double *q)
{
    double c[3], p[3], l[3], at[3];
    pal_rigid_motion motion;
    pal_rigid_centre(n, mass_kg, x, c);
    pal_rigid_momenta(n, forces ? NULL : mass_kg, x, q, c, p, l);
    pal_rigid_motion_find(n, mass_kg, x, p, l, &motion);
    for (int i = 0; i < n; i++) {
        pal_rigid_motion_at(&motion, x + 3 * i, at);
        pal_axpy3(q + 3 * i, forces ? -mass_kg[i] : -1, at);
    }
}
