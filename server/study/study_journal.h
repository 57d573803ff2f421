/* The answers of a study's reference (study.h: recall, remember) in a file beside it, STEM.reference, one record
 * after the other as they are found: a run that was ended anywhere, also while it wrote, goes on behind the last whole
 * record. Binary, of this machine: "palpate reference 1\n", a sum of what it is of (8 bytes), then records of key (8),
 * error (4), nodes (4), length n (8), sentence (120), n doubles and a sum of all that (8). A file of something else is
 * begun anew. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_JOURNAL_H
#define PAL_STUDY_STUDY_JOURNAL_H
#include "server/study/study.h"

typedef struct pal_study_journal pal_study_journal;

/* reads what is there of the same body, loads and machine (`of`), cuts off a record that is not whole and stands ready
 * for more; again: begins anew. IO: names path; MEMORY */
pal_err pal_study_journal_open(const char *path, uint64_t of, bool again, pal_study_journal **out,
                               pal_diagnostic *diag);
void pal_study_journal_close(pal_study_journal *journal); /* NULL is fine */
/* false: none of that key and length */
bool pal_study_journal_find(const pal_study_journal *journal, uint64_t key, pal_study_answer *answer, double *value,
                            int n);
/* into memory and to the file; IO, MEMORY: from then on nothing is added any more */
pal_err pal_study_journal_add(pal_study_journal *journal, uint64_t key, const pal_study_answer *answer,
                              const double *value, int n);
/* records there are, and of them those that the file held when it was opened */
int pal_study_journal_count(const pal_study_journal *journal, int *n_before);
#endif
