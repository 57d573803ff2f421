/* `palpate bench NAME`. Thread: [load]. */
#ifndef PAL_BENCH_BENCH_H
#define PAL_BENCH_BENCH_H
#include <stdbool.h>

int command_bench(int argc, char **argv); /* as in commands/commands.h */

/* one file a bench; each prints a table, or with json one object; the result is the exit code */
int bench_adaptive(bool json, const char *picture); /* picture: SVG of trajectories, or NULL */
int bench_calibrate(const char *folder_or_null, bool json);
int bench_estimate(bool json);
int bench_fem(bool json);
int bench_guards(bool json);
int bench_latency(bool json);
int bench_mesh(const char *ply_path_or_null, bool json);
int bench_protocol(bool json);
int bench_sleep(bool json);
int bench_solids(bool json);
int bench_springs(bool json);
#endif
