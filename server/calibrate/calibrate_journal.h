/* Journal of a long calibration: one line per completed evaluation, so an interrupted run loses none of them. A
 * restarted run looks up each point here first and therefore repeats the same path.
 *
 *   palpate journal 1
 *   PROBLEM THETA... = ERROR CHECK
 *
 * PROBLEM: 16 hexadecimal digits that identify the calibration. THETA, ERROR: hexadecimal floating point, exact.
 * ERROR: per cent, or `none`: no stable equilibrium. CHECK: 16 digits, a checksum of the line before them. Lines of
 * several problems may follow one another. An incomplete last line, left by a process that died, is truncated.
 * Thread: [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_JOURNAL_H
#define PAL_CALIBRATE_CALIBRATE_JOURNAL_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct pal_journal pal_journal;

/* Opens or creates the file and locks it. Errors: IO; STATE: another process has it open; REFUSED (file unchanged):
 * not a journal; MEMORY. */
pal_err pal_journal_open(const char *path, pal_journal **out, pal_diagnostic *diag);
void pal_journal_close(pal_journal *journal); /* accepts NULL */
/* Reads the file and keeps the lines of one problem, replacing those of an earlier one. Errors: REFUSED (names
 * file, line and fault); IO, MEMORY. */
pal_err pal_journal_begin(pal_journal *journal, uint64_t problem, int n_parameter, pal_diagnostic *diag);
/* Looks up a point. True: it was evaluated. cost DBL_MAX: it has no equilibrium. */
bool pal_journal_find(const pal_journal *journal, const double *theta, double *cost);
/* Appends a line and writes it to the system. Does not repeat a known point. Errors: IO, MEMORY. */
pal_err pal_journal_put(pal_journal *journal, const double *theta, double cost, pal_diagnostic *diag);
int64_t pal_journal_count(const pal_journal *journal); /* points of this problem */

/* FNV-1a hash of bytes, continued from an earlier value (0: start). */
uint64_t pal_journal_hash(uint64_t before, const void *bytes, size_t n_byte);
#endif
