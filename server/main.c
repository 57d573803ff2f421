/* `palpate COMMAND ...`: finds the command and runs it. Nothing else happens here: signals belong to serve, which is
 * the one command that waits. */
#include "server/bench/bench.h"
#include "server/commands/commands.h"

#include <stdio.h>
#include <string.h>

static const pal_command_entry command[] = {
    {"serve", "run scenes and let browsers and devices touch them", command_serve},
    {"prepare", "turn a surface or a segmented scan into a scene that serve can run", command_prepare},
    {"cells", "make and subdivide solids of control cells, named ones, primitives or files", command_cells},
    {"plan", "the rows a scene calls for, their memory and their measured cost here", command_plan},
    {"replay", "run a recorded input log again and compare the world's hashes", command_replay},
    {"solve", "solve a load case with finite elements and compare it with a reference", command_solve},
    {"calibrate", "fit springs to finite elements or measured displacements, and write a scene of them",
     command_calibrate},
    {"study", "what accuracy costs: settings of a body with error and milliseconds, and the one to serve",
     command_study},
    {"robustness", "disturb a scene in every way that is known to break simulations and judge the response",
     command_robustness},
    {"bench", "measure mesh preparation, springs, calibration and protocol on this machine", command_bench},
};
enum { N_COMMAND = sizeof command / sizeof command[0], USAGE = 2 };

static void manual(FILE *to)
{
    fprintf(to, "usage: palpate COMMAND [...]\n\n");
    for (int k = 0; k < N_COMMAND; k++) fprintf(to, "  %-9s %s\n", command[k].name, command[k].about);
    fprintf(to, "\n`palpate COMMAND --help` says more about one of them, `palpate --version` says which this is.\n");
}

int main(int argc, char **argv)
{
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
