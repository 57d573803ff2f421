/* Presentation of a study: the table on the terminal, the plot of error against milliseconds, and a self-contained
 * page. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_PAGE_H
#define PAL_STUDY_STUDY_PAGE_H
#include "server/study/study_store.h"

#include <stdio.h>

/* Prints the table by ascending ms, the front marked with a star. Points that were not measured follow with the
 * reason. */
void pal_study_print(const pal_study_file *file, FILE *to);
/* Writes STEM.csv, STEM.svg (error against milliseconds, logarithmic: one marker per method, the front as a line, real
 * time and the reference's own error as guides), STEM_force.svg (the same of the force felt at 50 ms of round trip,
 * where it was judged) and STEM.html with both. Without a measured point there is no plot, and the page states it.
 * Errors: IO, MEMORY. */
pal_err pal_study_publish(const pal_study_file *file, const char *stem, pal_diagnostic *diag);
#endif
