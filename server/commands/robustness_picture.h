/* The energy of every robustness case over time as small multiples in one SVG. Thread: [load]. */
#ifndef PAL_COMMANDS_ROBUSTNESS_PICTURE_H
#define PAL_COMMANDS_ROBUSTNESS_PICTURE_H
#include "server/robustness/robustness.h"

/* writes the file whole or not at all; title: the scene's. MEMORY, IO */
pal_err pal_robustness_picture(const pal_robustness_report *report, const char *title, const char *path,
                               pal_diagnostic *diag);
#endif
