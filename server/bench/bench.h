/* `palpate bench NAME`. Thread: [load]. */
#ifndef PAL_BENCH_BENCH_H
#define PAL_BENCH_BENCH_H
#include "server/cli/table.h"

int command_bench(int argc, char **argv); /* as in commands/commands.h */

/* one file a bench, which reports as it measures */
typedef pal_err bench_run(pal_table *r, pal_diagnostic *diag);
bench_run bench_adaptive, bench_calibrate, bench_edit, bench_estimate, bench_fem, bench_guards, bench_latency,
    bench_mesh, bench_organ, bench_protocol, bench_sessions, bench_sleep, bench_solids, bench_springs, bench_viewers;
#endif
