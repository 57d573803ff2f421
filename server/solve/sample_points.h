/* Sample points with displacements, and the error measure over them. CSV: the header line "x,y,z,ux,uy,uz", then
 * one row of six numbers per point, m. Blanks around a number and blank lines are allowed. [load] */
#ifndef PAL_SOLVE_SAMPLE_POINTS_H
#define PAL_SOLVE_SAMPLE_POINTS_H
#include "server/base/err.h"

#include <stdint.h>

typedef struct pal_samples {
    int n;
    double *x, *u; /* heap [n][3] each, m */
} pal_samples;

/* At most 256 MiB. Errors: REFUSED (names file, line and column): another header, a missing or extra column, not a
 * number, no rows; IO, BUDGET, MEMORY. */
pal_err pal_samples_read(const char *path, pal_samples *out, pal_diagnostic *diag);
/* The same from memory; name appears in messages only. */
pal_err pal_samples_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_samples *out,
                          pal_diagnostic *diag);
/* Writes enough digits to restore each number exactly; the whole file or none. Errors: IO, MEMORY. */
pal_err pal_samples_write(const pal_samples *samples, const char *path, pal_diagnostic *diag);
void pal_samples_free(pal_samples *samples); /* accepts a zeroed struct */
/* sqrt(mean |u - ref|^2) / max |ref| and max |u - ref| / max |ref|, in per cent; u [n][3]. Infinite if the
 * reference is zero everywhere and u is not. */
void pal_samples_error(const pal_samples *reference, const double *u, double *rms_percent, double *max_percent);
#endif
