/* Rigid motions of a set of point masses: momenta, the rigid motion that has them, and fields without it. Moments of
 * inertia that are zero (nodes on a line or in a point) give no rotation about their axes. Arrays are [n][3]; masses
 * [n], kg. Thread: [any]. */
#ifndef PAL_SIM_CORE_RIGID_MOTION_H
#define PAL_SIM_CORE_RIGID_MOTION_H
#include <stdbool.h>

typedef struct pal_rigid_motion {
    double centre_m[3], linear[3], angular[3]; /* centre of mass; velocities or accelerations */
    int n_axis;                                /* principal axes with a moment of inertia: 3, less on a line */
} pal_rigid_motion;

void pal_rigid_centre(int n, const double *mass_kg, const double *x, double centre_m[3]);
/* sums of the vectors q at x and of their moments about c; masses NULL: q are forces or momenta already */
void pal_rigid_momenta(int n, const double *mass_kg, const double *x, const double *q, const double c[3],
                       double momentum[3], double moment[3]);
/* inertia^-1 moment; 0 about principal axes whose moment of inertia is at most `min` or rounding; the number of
 * others */
int pal_rigid_spin(const double inertia[9], const double moment[3], double min, double spin[3]);
/* the rigid motion with this momentum and this moment about the centre of mass */
void pal_rigid_motion_find(int n, const double *mass_kg, const double *x, const double momentum[3],
                           const double moment[3], pal_rigid_motion *out);
/* the rigid part of velocities v, and their momentum and moment about the centre of mass */
void pal_rigid_motion_of(int n, const double *mass_kg, const double *x, const double *v, double momentum[3],
                         double moment[3], pal_rigid_motion *out);
void pal_rigid_motion_at(const pal_rigid_motion *motion, const double x[3], double out[3]);
/* Removes the rigid part of q. forces: q are forces, from which the inertia of the rigid acceleration that they cause
 * is subtracted, so that net force and net moment vanish (inertia relief); else q are velocities or displacements, from
 * which the rigid motion of equal momenta is subtracted */
void pal_rigid_motion_remove(int n, const double *mass_kg, const double *x, bool forces, double *q);
#endif
