/* Triangular solves of panels.h in single precision. */
#define REAL    float
#define NAME(f) f##_single
#include "server/num/panels_kernel.h"
