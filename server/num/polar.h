/* Rotations of 3x3 matrices, row-major F[3 r + c]. Thread: any. */
#ifndef PAL_NUM_POLAR_H
#define PAL_NUM_POLAR_H

/* The rotation R that maximises R : F (the polar rotation where det F > 0), by quaternion iteration (Mueller et al.
 * 2016) from q (w x y z, unit, in and out: warm start), until a step is below 1e-10 rad or `max` steps are made. It
 * never fails on det F <= 0; at a saddle (180 degrees off) it restarts from another rotation. F = 0 or F not finite
 * leaves q unchanged. Returns the number of steps. */
int pal_polar_rotation(const double f[9], double q[4], int max);
void pal_quat_matrix(const double q[4], double r[9]);
void pal_matrix_quat(const double r[9], double q[4]);
/* F = U diag(s) V', U and V rotations, s[0] >= s[1] >= |s[2]|, s[2] < 0 where det F < 0 */
void pal_svd3(const double f[9], double u[9], double s[3], double v[9]);
/* eigenvalues (ascending) and unit eigenvectors (rows of v) of a symmetric 3x3 matrix */
void pal_eigen3(const double a[9], double w[3], double v[9]);
double pal_det3(const double f[9]);
#endif
