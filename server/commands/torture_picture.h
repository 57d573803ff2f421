/* The energy of every insult over time, one small plot each, as one SVG. Thread: [load]. */
#ifndef PAL_COMMANDS_TORTURE_PICTURE_H
#define PAL_COMMANDS_TORTURE_PICTURE_H
#include "server/robustness/torture.h"

/* writes PATH whole or not at all; title: the scene's. MEMORY, IO */
pal_err pal_torture_picture(const pal_torture_report *report, const char *title, const char *path,
                            pal_diagnostic *diag);
#endif
