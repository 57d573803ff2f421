/* The journal of a long calibration: every evaluation that was gathered, one line each, so that whatever ends the work
 * loses none of them. A walk that is begun again asks here first, and goes the same way for what it had.
 *
 *   palpate journal 1
 *   PROBLEM THETA... = ERROR CHECK
 *
 * PROBLEM: 16 hexadecimal digits that stand for what is calibrated; THETA, ERROR: hexadecimal floating point, exact;
 * ERROR in per cent, or `none`: no stable rest; CHECK: 16 digits over the line before them. Lines of several problems
 * may follow one another. A last line without its end was torn when a process died: it is cut off. Thread: [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_JOURNAL_H
#define PAL_CALIBRATE_CALIBRATE_JOURNAL_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct pal_journal pal_journal;

/* opens or makes the file and keeps others out. IO; STATE: another process has it open; REFUSED, the file untouched: it
 * is no journal; MEMORY */
pal_err pal_journal_open(const char *path, pal_journal **out, pal_diagnostic *diag);
void pal_journal_close(pal_journal *journal); /* NULL is fine */
/* reads the file's lines and holds those of one problem in place of an earlier one's. REFUSED names file, line and what
 * is wrong with it; IO, MEMORY */
pal_err pal_journal_begin(pal_journal *journal, uint64_t problem, int n_parameter, pal_diagnostic *diag);
/* was this very point evaluated? cost: DBL_MAX: it has no rest */
bool pal_journal_find(const pal_journal *journal, const double *theta, double *cost);
/* appends a line and hands it to the system; a point that is there already is not written again. IO, MEMORY */
pal_err pal_journal_put(pal_journal *journal, const double *theta, double cost, pal_diagnostic *diag);
int64_t pal_journal_count(const pal_journal *journal); /* points of this problem */

/* FNV-1a over bytes, begun with 0 or an earlier value */
uint64_t pal_journal_hash(uint64_t before, const void *bytes, size_t n_byte);
#endif
