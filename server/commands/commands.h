/* The commands of `palpate COMMAND`, one file each. argv[0] is the command's own name, so that argv[1..argc-1] are its
 * flags and operands. The result is the exit code: 0 ok, 1 refused input, 2 usage, 3 internal.
 * Rules of every command (flags.h and report.h keep them): --json writes one JSON object to stdout and nothing else
 * goes there; --quiet writes nothing but a refusal; --help writes the manual to stdout; a refusal is exactly one line
 * on stderr; progress goes to stderr only when that is a terminal and neither --quiet nor --json is given.
 * Thread: [load]. */
#ifndef PAL_COMMANDS_COMMANDS_H
#define PAL_COMMANDS_COMMANDS_H
#include <stdbool.h>

typedef struct pal_command_entry {
    const char *name, *about; /* "prepare", one line for `palpate --help` */
    int (*run)(int argc, char **argv);
} pal_command_entry;

int command_serve(int argc, char **argv);
int command_prepare(int argc, char **argv);
int command_cells(int argc, char **argv);
int command_plan(int argc, char **argv);
int command_replay(int argc, char **argv);
int command_solve(int argc, char **argv);
int command_calibrate(int argc, char **argv);
int command_study(int argc, char **argv);
int command_robustness(int argc, char **argv);

#endif
