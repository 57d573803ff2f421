/* `palpate relay`: becomes palpate-relay, the program beside this one. A relay is a process without simulation code. */
#include "server/commands/commands.h"

#include <errno.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

int command_relay(int argc, char **argv)
{
    char own[PATH_MAX], program[PATH_MAX + 16];
    const ssize_t n = readlink("/proc/self/exe", own, sizeof own - 1);
    (void)argc;
    own[n > 0 ? n : 0] = 0;
    snprintf(program, sizeof program, "%s/palpate-relay", dirname(own));
    execv(program, argv);
    fprintf(stderr, "palpate relay: %s cannot be started: %s\n", program, strerror(errno));
    return 1;
}
