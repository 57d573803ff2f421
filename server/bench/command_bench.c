/* `palpate bench NAME`: dispatch. */
#include "server/bench/bench.h"
#include "server/cli/flags.h"

#include <stdio.h>
#include <string.h>

int command_bench(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*run)(bool json);
    } bench[] = {{"springs", bench_springs},   {"fem", bench_fem},           {"solids", bench_solids},
                 {"guards", bench_guards},     {"protocol", bench_protocol}, {"sleep", bench_sleep},
                 {"estimate", bench_estimate}, {"latency", bench_latency}};
    const char *picture = NULL;
    const pal_flag flag[] = {{"--picture", "FILE.svg", PAL_FLAG_TEXT, &picture, 0, 0,
                              "adaptive: plot the displacement of the pressed vertex (paper C, Figs. 10 and 12)"}};
    const pal_flag_table table = {
        .usage = "bench NAME [flags]",
        .about = "Measures this machine, medians of several runs. NAME is one of\n"
                 "  mesh [SURFACE.ply]  tetrahedra of a surface, or of a computed organ, at several resolutions\n"
                 "  springs             forces, integration and skinning against the limits of the machine\n"
                 "  adaptive            surfaces that refine where they are touched: coarse, refined, adaptive\n"
                 "  fem                 live steps and static solves of finite elements\n"
                 "  solids              subdivision solids as finite elements (paper A, Table 1)\n"
                 "  calibrate [FOLDER]  springs fitted to finite elements, by gradient and by annealing\n"
                 "                      (FOLDER: deploy/problems)\n"
                 "  guards              cost of the guards while nothing goes wrong, as a share of a step\n"
                 "  protocol            encoding and decoding of frames\n"
                 "  sleep               bodies at rest: awake, not observed, asleep\n"
                 "  estimate            predicted cost and error of other configurations against measured ones\n"
                 "  latency             from a pose put into a session to the frame that shows it\n",
        .example = "palpate bench protocol\n",
        .flag = flag,
        .n_flag = sizeof flag / sizeof flag[0],
        .min_operand = 1,
        .max_operand = 2};
    pal_flag_common common;
    const char *word[2] = {NULL, NULL};
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    bool mesh = !strcmp(word[0], "mesh"), calibrate = !strcmp(word[0], "calibrate");
    if (n == 2 && !mesh && !calibrate) return pal_flags_wrong(&common, "\"%.60s\" is one operand too many", word[1]);
    if (picture && strcmp(word[0], "adaptive") != 0) return pal_flags_wrong(&common, "--picture belongs to adaptive");
    /* a quiet bench only has to run */
    if (common.quiet && !common.json && !freopen("/dev/null", "w", stdout)) return 3;
    if (mesh) return bench_mesh(word[1], common.json);
    if (calibrate) return bench_calibrate(word[1], common.json);
    if (!strcmp(word[0], "adaptive")) return bench_adaptive(common.json, picture);
    for (size_t k = 0; k < sizeof bench / sizeof bench[0]; k++)
        if (!strcmp(word[0], bench[k].name)) return bench[k].run(common.json);
    return pal_flags_wrong(&common, "there is no bench \"%.60s\"", word[0]);
}
