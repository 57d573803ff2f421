/* The commands of `palpate COMMAND`, one file each. argv[0] is the command's own name; argv[1..argc-1] are its flags
 * and operands. The result is the exit code: 0 ok, 1 refused input, 2 usage, 3 internal.
 * Every command follows these rules (base/flags.h and server/cli keep them): --json prints one JSON object on stdout
 * and nothing else; --quiet prints nothing but a refusal; --help prints the manual on stdout; a refusal is one line on
 * stderr; progress goes to stderr only when that is a terminal and without --quiet and --json. Thread: [load]. */
#ifndef PAL_COMMANDS_COMMANDS_H
#define PAL_COMMANDS_COMMANDS_H
typedef struct pal_command_entry {
    const char *name, *about; /* "prepare", one line for `palpate --help` */
    int (*run)(int argc, char **argv);
} pal_command_entry;

int command_serve(int argc, char **argv);
int command_ticket(int argc, char **argv);
int command_prepare(int argc, char **argv);
int command_cells(int argc, char **argv);
int command_plan(int argc, char **argv);
int command_replay(int argc, char **argv);
int command_solve(int argc, char **argv);
int command_calibrate(int argc, char **argv);
int command_study(int argc, char **argv);
int command_relay(int argc, char **argv);
int command_robustness(int argc, char **argv);

#endif
