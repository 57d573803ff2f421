/* Flags of the client programs, parsed by a table; unknown flags are refused by name. `--name value` and
 * `--name=value` are equivalent. A switch takes no value. An option with `bare` may stand alone and then has that
 * value. Every program has --help; exit codes are 0 ok, 1 refused or failed, 2 usage. Thread: [load]. */
#ifndef PAL_LINK_CLIENT_FLAGS_H
#define PAL_LINK_CLIENT_FLAGS_H
#include <cjson/cJSON.h>
#include <stdbool.h>

typedef struct pal_client_flag {
    const char *name;  /* "--rate"                                       */
    const char *value; /* placeholder of the value in the help; NULL: switch */
    void *out;         /* bool * of a switch, double * where low < high, else const char **; unchanged when absent */
    double low, high;  /* range of a number; both 0 otherwise */
    const char *bare;  /* value of the flag alone (as last word or before another flag), or NULL */
    const char *help;  /* one or more lines */
} pal_client_flag;

typedef struct pal_client_table {
    const char *program, *usage, *about;
    const pal_client_flag *flag;
    int n_flag;
    int min_operand, max_operand;
} pal_client_table;

/* -1: continue; else the exit code (0 after --help, 2 after one line on stderr). operand: [max_operand], NULL where
 * that is 0 */
int pal_client_flags_parse(const pal_client_table *table, int argc, char **argv, const char **operand);
/* prints a tree as one line on stdout; takes it */
void pal_client_print_json(cJSON *taken);
/* three numbers "x,y,z"; false: malformed */
bool pal_client_parse_vector(const char *text, double out[3]);
#endif
