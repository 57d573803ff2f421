/* Flags of a command: a table states what is accepted, the parser refuses everything else by name.
 *
 *     double young = 5000; bool grid = false; const char *law = "linear", *in[1]; int n_in = 0;
 *     const pal_flag flag[] = {
 *         {"--young-Pa", "PA", PAL_FLAG_NUMBER, &young, 1, 1e9, "stiffness of the tissue (5000)"},
 *         {"--law", "linear|neo_hookean", PAL_FLAG_WORD, &law, 0, 0, "material law (linear)"},
 *         {"--grid", NULL, PAL_FLAG_SWITCH, &grid, 0, 0, "keep the grid"},
 *     };
 *     const pal_flag_table table = {.usage = "prepare IN -o DIR", .about = "...", .example = "palpate prepare ...\n",
 *                                   PAL_FLAGS(flag), .min_operand = 1, .max_operand = 1};
 *     int code = pal_flags_parse(&table, argc, argv, &common, in, &n_in);
 *     if (code >= 0) return code;
 *
 * `--name value` and `--name=value` are the same; `-o DIR` is a name like any other; `--` ends the flags. A flag may
 * appear anywhere, once. Thread: [load]. */
#ifndef PAL_CLI_FLAGS_H
#define PAL_CLI_FLAGS_H
#include "server/cli/config.h"
#include "server/cli/report.h"

typedef struct pal_flag_table {
    const char *usage, *about; /* "prepare IN -o DIR [flags]"; paragraphs of the manual, each ends with \n */
    const char
        *example; /* command lines, each ends with \n; tests/house/test_examples.sh runs them in order; NULL: none */
    const pal_flag *flag;
    int n_flag;
    int min_operand, max_operand;
    /* not NULL: every key of the configuration is a flag as well (allow_remote: --allow-remote), and --config FILE;
     * on success the struct holds defaults < file < environment < flags. */
    pal_config *config;
} pal_flag_table;
#define PAL_FLAGS(array) .flag = array, .n_flag = sizeof array / sizeof array[0] /* members of the table above */

/* -1: continue; else the exit code: 0 after --help, 2 after one line about wrong usage, 1 for a refused configuration.
 * operand: room for max_operand; both may be NULL when that is 0. */
int pal_flags_parse(const pal_flag_table *table, int argc, char **argv, pal_flag_common *common, const char **operand,
                    int *n_operand);
/* one line about wrong usage on stderr; the result is the exit code 2 */
int pal_flags_wrong(const pal_flag_common *common, const char *format, ...) __attribute__((format(printf, 2, 3)));
#endif
