/* Triangular solves of panels.h in double precision. */
#define REAL    double
#define NAME(f) f##_double
#include "server/num/panels_kernel.h"
