/* The files that a run of `palpate calibrate` writes, checked before the search rather than after it. Thread: [load].
 */
#ifndef PAL_COMMANDS_CALIBRATE_TARGETS_H
#define PAL_COMMANDS_CALIBRATE_TARGETS_H
#include "server/calibrate/calibrate_run.h"

/* Makes their folders. Errors (name the flag): REFUSED: not the name of a file, a file that is also read, two that are
 * one, a grid that no scene file holds; IO. */
pal_err pal_calibrate_targets_check(const pal_calibrate_run *run, pal_diagnostic *diag);
/* The same for the files that the problem names, once it was read. */
pal_err pal_calibrate_targets_check_named(const pal_calibrate_run *run, pal_diagnostic *diag);
#endif
