/* File of the reference answers of a study (study.h: recall, remember), STEM.reference beside it. Records are
 * appended as answers are found. After an interruption at any time, also during a write, the next run continues
 * behind the last complete record. Binary, machine dependent: "palpate reference 1\n", a hash of the subject (8
 * bytes), then records of key (8), error (4), nodes (4), length n (8), sentence (120), n doubles and a hash of the
 * record (8). A file of another subject is overwritten. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_JOURNAL_H
#define PAL_STUDY_STUDY_JOURNAL_H
#include "server/study/study.h"

typedef struct pal_study_journal pal_study_journal;

/* Reads the records of the same body, loads and machine (`of`), truncates an incomplete record and opens for
 * appending. again: starts an empty file. Errors: IO (names path), MEMORY. */
pal_err pal_study_journal_open(const char *path, uint64_t of, bool again, pal_study_journal **out,
                               pal_diagnostic *diag);
void pal_study_journal_close(pal_study_journal *journal); /* accepts NULL */
/* False: no record of that key and length. */
bool pal_study_journal_find(const pal_study_journal *journal, uint64_t key, pal_study_answer *answer, double *value,
                            int n);
/* Adds a record to memory and file. Errors: IO, MEMORY; after one, nothing more is added. */
pal_err pal_study_journal_add(pal_study_journal *journal, uint64_t key, const pal_study_answer *answer,
                              const double *value, int n);
/* Number of records; *n_before: those present when the file was opened. */
int pal_study_journal_count(const pal_study_journal *journal, int *n_before);
#endif
