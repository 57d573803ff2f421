/* `palpate bench NAME`: finds the bench, runs it and reports its results. */
#include "server/bench/bench.h"
#include "server/cli/report.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *name, *operand, *about; /* operand: the one it may have */
    bench_run *run;
} bench_table[] = {
    {"mesh", "[SURFACE.ply]", "tetrahedra of a surface, or of a computed organ, at several resolutions", bench_mesh},
    {"springs", "", "forces, integration and skinning against the limits of the machine", bench_springs},
    {"adaptive", "", "surfaces that refine where they are touched: coarse, refined, adaptive", bench_adaptive},
    {"fem", "", "live steps and static solves of finite elements", bench_fem},
    {"organ", "[SURFACE.ply]", "finite-element organs of growing size by each preconditioner", bench_organ},
    {"edit", "", "a live edit of the material of a part of a finite-element organ", bench_edit},
    {"solids", "", "subdivision solids as finite elements (paper A, Table 1)", bench_solids},
    {"calibrate", "[FOLDER]",
     "springs fitted to finite elements, by gradient and by annealing\n                      (FOLDER: deploy/problems)",
     bench_calibrate},
    {"guards", "", "cost of the guards while nothing goes wrong, as a share of a step", bench_guards},
    {"protocol", "", "encoding and decoding of frames", bench_protocol},
    {"sessions", "", "sessions on one core, touched and asleep: steps, slowdown, memory", bench_sessions},
    {"sleep", "", "bodies at rest: awake, not observed, asleep", bench_sleep},
    {"estimate", "[SCENE]",
     "predicted cost and error of other configurations against measured ones\n                      (SCENE: what its "
     "estimates take)",
     bench_estimate},
    {"viewers", "[SCENE]", "many viewers of one session, directly and through relays: age, cost, memory",
     bench_viewers},
    {"latency", "", "from a pose put into a session to the frame that shows it", bench_latency},
};
enum { BENCHES = sizeof bench_table / sizeof bench_table[0] };

static int run_bench(int index, const char *argument, const pal_flag_common *common)
{
    pal_table r = {.argument = argument, .silent = common->json, .root = cJSON_CreateObject()};
    pal_diagnostic diag = {""};
    cJSON_AddBoolToObject(r.root, "ok", true);
    cJSON_AddStringToObject(r.root, "bench", bench_table[index].name);
    pal_err err = pal_diagnostic_prefix(&diag, bench_table[index].run(&r, &diag), bench_table[index].name);
    return pal_report_end(common, err, &diag, r.root);
}

int command_bench(int argc, char **argv)
{
    static char about[2048];
    const char *picture = NULL, *word[2] = {NULL, NULL};
    int n = 0, k = 0,
        used = snprintf(about, sizeof about, "Measures this machine, medians of several runs. NAME is one of\n");
    for (int b = 0; b < BENCHES; b++)
        used += snprintf(about + used, sizeof about - (size_t)used, "  %-9s %-10s%s%s\n", bench_table[b].name,
                         bench_table[b].operand, strlen(bench_table[b].operand) < 10 ? "" : " ", bench_table[b].about);
    const pal_flag flag[] = {{"--picture", "FILE.svg", PAL_FLAG_TEXT, &picture, 0, 0,
                              "adaptive: plot the displacement of the pressed vertex (paper C, Figs. 10 and 12)"}};
    const pal_flag_table table = {.usage = "bench NAME [flags]",
                                  .about = about,
                                  .example = "palpate bench protocol\n",
                                  PAL_FLAGS(flag),
                                  .operands = {1, 2}};
    pal_flag_common common;
    int code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    while (k < BENCHES && strcmp(word[0], bench_table[k].name) != 0) k++;
    if (n == 2 && (k == BENCHES || !bench_table[k].operand[0]))
        return pal_flags_wrong(&common, "\"%.60s\" is one operand too many", word[1]);
    if (picture && strcmp(word[0], "adaptive") != 0) return pal_flags_wrong(&common, "--picture belongs to adaptive");
    if (k == BENCHES) return pal_flags_wrong(&common, "there is no bench \"%.60s\"", word[0]);
    /* a quiet bench only has to run */
    if (common.quiet && !common.json && !freopen("/dev/null", "w", stdout)) return 3;
    return run_bench(k, picture ? picture : word[1], &common);
}
