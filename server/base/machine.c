/* The processor's name from the kernel's list, else the kind of machine. */
#include "server/base/machine.h"

#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>
#include <unistd.h>

enum { NAME = 96, LINE = 512 };

/* shown characters, runs of blanks as one */
static void take_name(const char *from, char out[NAME])
{
    size_t n = 0;
    for (; *from && n + 1 < NAME; from++) {
        char c = *from > 0x20 && *from < 0x7f ? *from : ' ';
        if (c != ' ' || (n > 0 && out[n - 1] != ' ')) out[n++] = c;
    }
    while (n > 0 && out[n - 1] == ' ') n--;
    out[n] = 0;
}

static void find_name(char out[NAME])
{
    char line[LINE];
    struct utsname facts;
    FILE *list = fopen("/proc/cpuinfo", "re");
    out[0] = 0;
    while (list && !out[0] && fgets(line, sizeof line, list)) {
        const char *colon = strchr(line, ':');
        if (colon && !strncmp(line, "model name", 10)) take_name(colon + 1, out);
    }
    if (list) fclose(list);
    if (!out[0]) take_name(uname(&facts) == 0 ? facts.machine : "unknown processor", out);
}

const char *pal_machine_name(char text[PAL_MACHINE_TEXT])
{
    char name[NAME];
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    find_name(name);
    if (n > 0)
        snprintf(text, PAL_MACHINE_TEXT, "%s, %ld core%s", name, n, n == 1 ? "" : "s");
    else
        snprintf(text, PAL_MACHINE_TEXT, "%s", name);
    return text;
}
