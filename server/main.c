/* `palpate COMMAND ...`: finds the command and runs it. */
#include "server/bench/bench.h"
#include "server/commands/commands.h"

#include <malloc.h>
#include <stdio.h>
#include <string.h>

static const pal_command_entry command[] = {
    {"serve", "serve scenes, surfaces or label volumes as sessions, with the viewer", command_serve},
    {"relay", "show a session of a server to many viewers", command_relay},
    {"ticket", "make a ticket that lets its bearer join a server", command_ticket},
    {"prepare", "make a scene from a surface or a segmented scan", command_prepare},
    {"cells", "make the control cells of a subdivision solid", command_cells},
    {"plan", "list the components that a scene calls for, with their memory and time", command_plan},
    {"solve", "solve a load case with finite elements and compare it with a reference", command_solve},
    {"calibrate", "fit spring constants to finite elements or to measured displacements", command_calibrate},
    {"study", "measure what accuracy costs and pick the configuration to serve", command_study},
    {"robustness", "run the extreme cases that break simulations on a scene", command_robustness},
    {"replay", "run a recorded session again and compare its state hashes", command_replay},
    {"bench", "measure the speed of this machine on the parts of a simulation", command_bench},
};
enum { N_COMMAND = sizeof command / sizeof command[0], USAGE = 2 };

static void manual(FILE *to)
{
    fprintf(to, "usage: palpate COMMAND [...]\n\n");
    for (int k = 0; k < N_COMMAND; k++) fprintf(to, "  %-10s %s\n", command[k].name, command[k].about);
    fprintf(to,
            "\n`palpate COMMAND --help` describes a command, with examples. `palpate --version` prints the version.\n");
}

/* bytes: blocks from this size on have pages of their own, which go back to the system when they are freed and take no
 * memory before they are written to. Left alone, glibc raises its limit up to 32 MB as sessions come and go */
enum { OWN_PAGES = 1 << 16 };

int main(int argc, char **argv)
{
    (void)mallopt(M_MMAP_THRESHOLD, OWN_PAGES);
    if (argc < 2) {
        manual(stderr);
        return USAGE;
    }
    const char *word = argv[1];
    if (!strcmp(word, "--help") || !strcmp(word, "-h") || !strcmp(word, "help")) {
        manual(stdout);
        return 0;
    }
    if (!strcmp(word, "--version")) {
        printf("palpate %s\n", PAL_VERSION);
        return 0;
    }
    for (int k = 0; k < N_COMMAND; k++)
        if (!strcmp(word, command[k].name)) return command[k].run(argc - 1, argv + 1);
    fprintf(stderr, "palpate: there is no command \"%.60s\" (see palpate --help)\n", word);
    return USAGE;
}
