/* A study for people: the table on the terminal, the drawing of error against milliseconds, and a page that needs
 * nothing else. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_PAGE_H
#define PAL_STUDY_STUDY_PAGE_H
#include "server/study/study_store.h"

#include <stdio.h>

/* "fem hex8_bbar", "tet_springs calibrated": what has a mark of its own. Returns out */
const char *pal_study_method(const pal_configuration *setting, char out[PAL_CONFIGURATION_TEXT]);
/* does a step of the scene take no longer than it lasts? false when it was not measured */
bool pal_study_is_live(const pal_study *study, const pal_study_point *point);

/* the table: by ascending ms, the front with a star, at the end what could not be measured and why */
void pal_study_print(const pal_study_file *file, FILE *to);
/* error against milliseconds, logarithmic, a mark a method, the front as a line, real time and the
 * reference's own error as guides; the text, which the caller frees. REFUSED: nothing was measured; MEMORY */
pal_err pal_study_draw(const pal_study_file *file, char **svg, size_t *n_byte, pal_diagnostic *diag);
/* STEM.csv, STEM.svg and STEM.html; without a measured point the drawing is left out and the page says so. IO, MEMORY
 */
pal_err pal_study_publish(const pal_study_file *file, const char *stem, pal_diagnostic *diag);
#endif
