/* Cholesky factor of a symmetric positive definite matrix of moderate size, each row stored from its first entry to the
 * diagonal (Jennings 1966; George and Liu, Computer solution of large sparse positive definite systems, ch. 4), in
 * reverse Cuthill-McKee order. For matrices that are solved often and factored occasionally within a step: no heap
 * after creation, one number per pair of points, three right-hand sides at once. Memory from the arena. Thread: [load]
 * to make, then any, one per struct. */
#ifndef PAL_NUM_ENVELOPE_H
#define PAL_NUM_ENVELOPE_H
#include "server/base/arena.h"

#include <stdint.h>

typedef struct pal_envelope {
    int n;
    int32_t *order;    /* point at each position                          [n] */
    int32_t *position; /* position of each point                          [n] */
    int32_t *first;    /* first position in a row                         [n] */
    int64_t *start;    /* row i: value[start[i]] at position first[i] .. value[start[i + 1] - 1] at i  [n + 1] */
    double *value;     /* the factor's rows; their diagonal inverted   [start[n]] */
    double *work;      /* [3][n] */
} pal_envelope;

/* pattern: entries of row i at point[start[i]] .. point[start[i + 1] - 1], symmetric, with the diagonal. BUDGET: the
 * envelope has more than max_entry entries, nothing was taken; MEMORY. [load] */
pal_err pal_envelope_make(int n, const int32_t *start, const int32_t *point, int64_t max_entry, pal_arena *arena,
                          pal_envelope *out);
/* Factors the values [start[n]] in that pattern; points with skip [n] above 0 (NULL: none) are left out. NUMERIC: not
 * positive definite or not finite; there is no factor then */
pal_err pal_envelope_factor(pal_envelope *e, const int32_t *start, const int32_t *point, const double *value,
                            const uint8_t *skip);
/* x = A^-1 b, b and x [n][3] may be the same; 0 at skipped points where b is */
void pal_envelope_solve(pal_envelope *e, const double *b, double *x);
#endif
