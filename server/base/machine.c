/* The processor's name from the kernel's list, else the kind of machine. */
#include "server/base/machine.h"

#include "server/base/clock.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>
#include <unistd.h>

enum { NAME = 96, LINE = 512, LANES = 16, READS = 3, MAX_READS = 400 };
static const double min_byte = 1 << 16, max_byte = 32 << 20, read_for_ms = 2;

/* printable characters, runs of blanks as one */
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

double pal_machine_read_ms(double n_byte)
{
    size_t n = (size_t)(fmin(fmax(n_byte, min_byte), max_byte) / sizeof(float)) / LANES * LANES;
    float *value = malloc(n * sizeof *value), sum[LANES] = {0};
    double min = INFINITY, all = 0;
    if (!value) return 0;
    for (size_t i = 0; i < n; i++) value[i] = (float)(i & 7);
    for (int k = 0; k < READS || (k < MAX_READS && all < read_for_ms); k++) {
        uint64_t began = pal_clock_thread_ns();
        for (size_t i = 0; i < n; i += LANES)
            for (int l = 0; l < LANES; l++) sum[l] += value[i + (size_t)l];
        double ms = 1e-6 * (double)(pal_clock_thread_ns() - began);
        all += ms;
        /* the first pass fills the caches */
        if (k > 0) min = fmin(min, ms);
    }
    free(value);
    /* the sums are used, so that the compiler keeps the loop */
    return sum[1] > 0 ? min / ((double)n * sizeof(float)) * n_byte : 0;
}

double pal_machine_resident_bytes(int process)
{
    char name[64], line[LINE];
    double kb = 0;
    snprintf(name, sizeof name, "/proc/%d/status", process);
    FILE *file = fopen(name, "re");
    while (file && fgets(line, sizeof line, file))
        if (!strncmp(line, "VmRSS:", 6)) kb = atof(line + 6);
    if (file) fclose(file);
    return 1024 * kb;
}
