/* A study in shards: result k of the lines (result_lines.h) is a study file (study_store.h) of one point, that of
 * configuration k of the sweep. Thread: [load]. */
#ifndef PAL_COMMANDS_STUDY_LINES_H
#define PAL_COMMANDS_STUDY_LINES_H
#include "server/cli/result_lines.h"
#include "server/study/study_store.h"

/* Opens the lines of a shard, or of all shards to merge, for the body, loads and methods of `now`. *out: the points
 * that are there, in the order of the sweep, heap, free(); NULL: none. Errors: those of the lines; REFUSED: a result is
 * damaged or was measured on another processor; MEMORY. Close *lines and free *out also after an error. */
pal_err pal_study_lines_open(const pal_shard_flags *flags, const pal_study_file *now, pal_result_lines **lines,
                             pal_study_file **out, pal_diagnostic *diag);
/* Appends the last point of a study; n_total: configurations of all shards. Errors: IO, MEMORY. */
pal_err pal_study_lines_put(pal_result_lines *lines, int index, const pal_study_file *now, const pal_study *study,
                            int n_total, pal_diagnostic *diag);
#endif
