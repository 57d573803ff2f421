/* `palpate bench NAME`: dispatch. */
#include "server/bench/bench.h"
#include "server/cli/report.h"

#include <stdio.h>
#include <string.h>

int command_bench(int argc, char **argv)
{
    const char *picture = NULL;
    const pal_flag flag[] = {{"--picture", "FILE.svg", PAL_FLAG_TEXT, &picture, 0, 0,
                              "adaptive: where the pressed vertex is over time (paper C Figs. 10 and 12)"}};
    const pal_flag_table table = {
        .usage =
            "bench mesh [SURFACE.ply] | springs | adaptive | fem | solids | guards | calibrate [FOLDER] | protocol | "
            "sleep | estimate | latency [flags]",
        .about = "Measures this machine, medians of several runs:\n"
                 "  mesh      preparation of tetrahedra at several resolutions (of a "
                 "procedural organ without SURFACE)\n"
                 "  springs   forces, integration and skinning against the machine's limits\n"
                 "  adaptive  surfaces that refine where they are touched: coarse, refined, adaptive\n"
                 "  fem       live steps and static solves of finite elements\n"
                 "  solids    subdivided solids as finite elements (paper A Table 1)\n"
                 "  calibrate springs fitted to finite elements, by gradient and by "
                 "annealing (FOLDER: deploy/problems)\n"
                 "  guards    what being on guard costs while nothing goes wrong, as a share of a step\n"
                 "  protocol  encoding and decoding of frames\n"
                 "  sleep     bodies at rest: awake, watched by nobody, asleep\n"
                 "  estimate  what is foreseen of a live setting's neighbours against what they take and leave\n"
                 "  latency   from a pose put into a session to the frame that shows it\n",
        .flag = flag,
        .n_flag = sizeof flag / sizeof flag[0],
        .min_operand = 1,
        .max_operand = 2};
    pal_flag_common common;
    const char *word[2] = {NULL, NULL};
    int n = 0, code = pal_flags_parse(&table, argc, argv, &common, word, &n);
    if (code >= 0) return code;
    bool mesh = !strcmp(word[0], "mesh"), calibrate = !strcmp(word[0], "calibrate");
    if (n == 2 && !mesh && !calibrate) {
        fprintf(stderr, "palpate bench: \"%.60s\" is one word too many (see palpate bench --help)\n", word[1]);
        return 2;
    }
    if (picture && strcmp(word[0], "adaptive") != 0) {
        fprintf(stderr, "palpate bench: --picture belongs to adaptive (see palpate bench --help)\n");
        return 2;
    }
    /* a quiet bench is one that only has to run */
    if (common.quiet && !common.json && !freopen("/dev/null", "w", stdout)) return 3;
    if (mesh) return bench_mesh(word[1], common.json);
    if (calibrate) return bench_calibrate(word[1], common.json);
    if (!strcmp(word[0], "springs")) return bench_springs(common.json);
    if (!strcmp(word[0], "adaptive")) return bench_adaptive(common.json, picture);
    if (!strcmp(word[0], "fem")) return bench_fem(common.json);
    if (!strcmp(word[0], "solids")) return bench_solids(common.json);
    if (!strcmp(word[0], "guards")) return bench_guards(common.json);
    if (!strcmp(word[0], "protocol")) return bench_protocol(common.json);
    if (!strcmp(word[0], "sleep")) return bench_sleep(common.json);
    if (!strcmp(word[0], "estimate")) return bench_estimate(common.json);
    if (!strcmp(word[0], "latency")) return bench_latency(common.json);
    fprintf(stderr, "palpate bench: there is no bench \"%.60s\" (see palpate bench --help)\n", word[0]);
    return 2;
}
