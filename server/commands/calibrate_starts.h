/* Independent searches of `palpate calibrate`: annealing with seeds S, S + 1, ..., of which the one with the smallest
 * error is taken, of equal ones the first. Each depends on its seed alone, so they may be divided into shards
 * (result_lines.h), a result for each search; the evaluations of one search depend on those before. Thread: [load]. */
#ifndef PAL_COMMANDS_CALIBRATE_STARTS_H
#define PAL_COMMANDS_CALIBRATE_STARTS_H
#include "server/calibrate/calibrate_run.h"
#include "server/cli/result_lines.h"

enum { PAL_CALIBRATE_STARTS_MAX = 10000 };

typedef struct pal_calibrate_starts {
    int n; /* searches */
    pal_shard_flags shard;
    /* result */
    int chosen;          /* the search that was taken, from 0; its seed is run->fit.seed + chosen */
    int n_before, n_new; /* of a shard: results that were there, and that were computed */
    char ended[16];      /* run->result.ended of a merge */
} pal_calibrate_starts;

/* Sets theta, result and trail of the run; those of a shard are of no use. Start: run->info.start. A stop that is asked
 * for ends it with the best so far; a shard keeps no search that was stopped. Errors: those of pal_fit_anneal; NUMERIC:
 * no search finds an equilibrium; STATE: a shard was stopped; those of result_lines.h. */
pal_err pal_calibrate_starts_run(pal_calibrate_starts *starts, pal_calibrate_run *run, pal_diagnostic *diag);
#endif
