/* Flags of a program or of a command of palpate: a table states what is accepted, the parser refuses everything else by
 * name.
 *
 *     double young = 5000; bool grid = false; const char *law = "linear", *in[1]; int n_in = 0;
 *     const pal_flag flag[] = {
 *         {"--young-Pa", "PA", PAL_FLAG_NUMBER, &young, 1, 1e9, "stiffness of the tissue (5000)"},
 *         {"--law", "linear|neo_hookean", PAL_FLAG_WORD, &law, 0, 0, "material law (linear)"},
 *         {"--grid", NULL, PAL_FLAG_SWITCH, &grid, 0, 0, "keep the grid"},
 *     };
 *     const pal_flag_table table = {.usage = "prepare IN -o DIR", .about = "...", .example = "palpate prepare ...\n",
 *                                   PAL_FLAGS(flag), .operands = {1, 1}};
 *     int code = pal_flags_parse(&table, argc, argv, &common, in, &n_in);
 *     if (code >= 0) return code;
 *
 * `--name value` and `--name=value` are the same; `-o DIR` is a name like any other; `--` ends the flags. A flag may
 * appear anywhere, once. --json, --quiet and --help are those of every table. Thread: [load]. */
#ifndef PAL_BASE_FLAGS_H
#define PAL_BASE_FLAGS_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>

typedef enum pal_flag_kind {
    PAL_FLAG_SWITCH,   /* out: bool *                                            */
    PAL_FLAG_TEXT,     /* out: const char **                                     */
    PAL_FLAG_OPTIONAL, /* out: const char **; "" for the flag alone, as last word or before another flag */
    PAL_FLAG_WORD,     /* out: const char **; one of the words of value, "on|off" */
    PAL_FLAG_NUMBER,   /* out: double *                                          */
    PAL_FLAG_COUNT,    /* out: int *                                             */
    PAL_FLAG_VECTOR    /* out: double [3]; "X,Y,Z"                               */
} pal_flag_kind;

typedef struct pal_flag {
    const char *name;  /* "--resolution" or "-o"                                  */
    const char *value; /* placeholder for the value in the manual, or its words; NULL for a switch */
    pal_flag_kind kind;
    void *out;        /* untouched when the flag is absent: the default           */
    double low, high; /* range of a number; the refusal names it                  */
    const char *help; /* one or more lines (\n) of the manual                     */
} pal_flag;

typedef struct pal_flag_table {
    const char *program;       /* NULL: a command of palpate, whose name is argv[0] */
    const char *usage, *about; /* "prepare IN -o DIR [flags]"; paragraphs of the manual, each ends with \n */
    const char *example; /* command lines, each ends with \n, which tests/house/test_examples.sh runs; NULL: none */
    const pal_flag *flag;
    int n_flag;
    int operands[2];  /* least and most */
    const char *note; /* the manual's last paragraph, ends with \n; NULL: none */
} pal_flag_table;
#define PAL_FLAGS(array) .flag = array, .n_flag = sizeof array / sizeof array[0] /* members of the table above */

/* flags that every program has */
typedef struct pal_flag_common {
    bool json, quiet;
    char program[40]; /* for messages: "palpate prepare" */
} pal_flag_common;

/* -1: continue; else the exit code: 0 after --help, 2 after one line about wrong usage. operand: room for the most;
 * NULL when that is 0. n_operand may be NULL */
int pal_flags_parse(const pal_flag_table *table, int argc, char **argv, pal_flag_common *common, const char **operand,
                    int *n_operand);
/* one line about wrong usage on stderr; the result is the exit code 2 */
int pal_flags_wrong(const pal_flag_common *common, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* which word of "error|warn|info" is text? -1: none. [any] */
int pal_flag_word(const char *words, const char *text);
/* The next word of a list with commas, cut into out; empty words are words. False: none is left (*list NULL). [any] */
bool pal_flag_next_word(const char **list, char *out, size_t n_byte);
/* text -> the bool ("true", "1", "false", "0"), double, int or three doubles at out; a text or word is only checked,
 * and out unused. REFUSED: "where: sentence". [any] */
pal_err pal_flag_read(const pal_flag *flag, const char *text, const char *where, void *out, pal_diagnostic *diag);
#endif
