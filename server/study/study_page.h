/* Presentation of a study: the table on the terminal, the plot of error against milliseconds, and a self-contained
 * page. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_PAGE_H
#define PAL_STUDY_STUDY_PAGE_H
#include "server/study/study_store.h"

#include <stdio.h>

/* Writes "fem hex8_bbar", "tet_springs calibrated": the methods with separate plot markers. Returns out. */
const char *pal_study_method(const pal_configuration *setting, char out[PAL_CONFIGURATION_TEXT]);
/* Does a step take no longer than the scene's step lasts? False if not measured. */
bool pal_study_is_live(const pal_study *study, const pal_study_point *point);

/* Prints the table by ascending ms, the front marked with a star. Points that were not measured follow with the
 * reason. */
void pal_study_print(const pal_study_file *file, FILE *to);
/* Plots error against milliseconds, logarithmic: one marker per method, the front as a line, real time and the
 * reference's own error as guides. The caller frees *svg. Errors: REFUSED: nothing was measured; MEMORY. */
pal_err pal_study_draw(const pal_study_file *file, char **svg, size_t *n_byte, pal_diagnostic *diag);
/* Writes STEM.csv, STEM.svg and STEM.html. Without a measured point there is no plot, and the page states it.
 * Errors: IO, MEMORY. */
pal_err pal_study_publish(const pal_study_file *file, const char *stem, pal_diagnostic *diag);
#endif
