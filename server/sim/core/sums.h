/* Sums over a body's dofs, 8 at a time, so that a check of every step costs little more than reading the arrays. A
 * number that is not finite makes every sum NaN. The order of additions is the same on every machine. Thread: [sim]. */
#ifndef PAL_SIM_CORE_SUMS_H
#define PAL_SIM_CORE_SUMS_H
#include <stdbool.h>

/* sum of m v.v, twice the kinetic energy: mass kg [n], v m/s [n][3]; J */
double pal_sum_mv2(int n, const double *mass_kg, const double *v);
/* sum of f.(x - x0) over n numbers, which is NaN when one of f, x, x0 is not finite; J */
double pal_sum_work(int n, const double *f, const double *x, const double *x0);
/* to = from (NULL: only asks), n numbers; are all of them finite? */
bool pal_copy_finite(int n, const double *from, double *to);
#endif
