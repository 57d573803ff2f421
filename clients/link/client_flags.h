/* Flags of the client programs: a table says what there is, the rest is refused by name.
 * `--name value` and `--name=value` are the same; a switch takes no value; an option with `bare` may stand alone and
 * then means that text. Every program has --help; exit codes are 0 ok, 1 refused or failed, 2 usage. Thread: [load]. */
#ifndef PAL_LINK_CLIENT_FLAGS_H
#define PAL_LINK_CLIENT_FLAGS_H
#include <stdbool.h>

typedef enum pal_client_flag_kind { PAL_CLIENT_SWITCH, PAL_CLIENT_TEXT, PAL_CLIENT_NUMBER } pal_client_flag_kind;

typedef struct pal_client_flag {
    const char *name;  /* "--rate"                                       */
    const char *value; /* word for the value in the manual, NULL: switch */
    pal_client_flag_kind kind;
    void *out;        /* bool *, const char ** or double *; untouched when absent */
    double low, high; /* range of a number                              */
    const char *bare; /* text meant by the flag alone (as last word or before another flag), or NULL */
    const char *help; /* one line, or several                           */
} pal_client_flag;

typedef struct pal_client_table {
    const char *program, *usage, *about;
    const pal_client_flag *flag;
    int n_flag;
    int min_operand, max_operand;
} pal_client_table;

/* -1: go on; else the exit code (0 after --help, 2 after one line on stderr). operand: max_operand places */
int pal_client_flags_parse(const pal_client_table *table, int argc, char **argv, const char **operand, int *n_operand);
/* three numbers "x,y,z"; false: not that */
bool pal_client_parse_vector(const char *text, double out[3]);
#endif
