/* Journal of a long computation: one line per completed result, so that an interrupted run loses none of them. A
 * restarted run looks up each result here first and therefore repeats the same path.
 *
 *   palpate journal 1
 *   SUBJECT KEY = VALUE CHECK
 *
 * SUBJECT: 16 hexadecimal digits that identify the computation. KEY, VALUE: text of the caller, KEY without " = ".
 * CHECK: 16 digits, a checksum of the line before them. Lines of several subjects may follow one another. An
 * incomplete last line, left by a process that died, is truncated. Thread: [load]. */
#ifndef PAL_CALIBRATE_JOURNAL_H
#define PAL_CALIBRATE_JOURNAL_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct pal_journal pal_journal;

/* Opens or creates the file and locks it. Errors: IO; STATE: another process has it open; REFUSED (file unchanged):
 * not a journal; MEMORY. */
pal_err pal_journal_open(const char *path, pal_journal **out, pal_diagnostic *diag);
void pal_journal_close(pal_journal *journal); /* accepts NULL */
/* Reads the file and keeps the lines of one subject, replacing those of an earlier one. Errors: REFUSED (names file
 * and line): damaged; IO, MEMORY. */
pal_err pal_journal_begin(pal_journal *journal, uint64_t subject, pal_diagnostic *diag);
/* The value of a key, borrowed until the next begin; NULL: none. */
const char *pal_journal_find(const pal_journal *journal, const char *key);
/* Appends a line and writes it to the system. Does not repeat a known key. Errors: IO, MEMORY. */
pal_err pal_journal_put(pal_journal *journal, const char *key, const char *value, pal_diagnostic *diag);
int pal_journal_count(const pal_journal *journal); /* results of this subject */

/* Numbers as hexadecimal floating point, exact, separated by blanks. The caller frees the text; NULL: no memory. */
char *pal_journal_text(const double *number, size_t n);
/* Reads n numbers. False: text begins with fewer of them. */
bool pal_journal_numbers(const char *text, double *out, size_t n);
#endif
