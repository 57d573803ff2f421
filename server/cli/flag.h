/* One flag of a command or one key of the configuration: its name, the kind and range of its value. Thread: [any]. */
#ifndef PAL_CLI_FLAG_H
#define PAL_CLI_FLAG_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>

typedef enum pal_flag_kind {
    PAL_FLAG_SWITCH, /* out: bool *                                            */
    PAL_FLAG_TEXT,   /* out: const char **                                     */
    PAL_FLAG_WORD,   /* out: const char **; one of the words of value, "on|off" */
    PAL_FLAG_NUMBER, /* out: double *                                          */
    PAL_FLAG_COUNT   /* out: int *                                             */
} pal_flag_kind;

typedef struct pal_flag {
    const char *name;  /* "--resolution" or "-o"                                  */
    const char *value; /* placeholder for the value in the manual, or its words; NULL for a switch */
    pal_flag_kind kind;
    void *out;        /* untouched when the flag is absent: the default           */
    double low, high; /* range of a number; the refusal names it                  */
    const char *help; /* one or more lines (\n) of the manual                     */
} pal_flag;

/* which word of "error|warn|info" is text? -1: none */
int pal_flag_word(const char *words, const char *text);
/* The next word of a list with commas, cut into out; empty words are words. False: none is left (*list NULL). */
bool pal_flag_next_word(const char **list, char *out, size_t n_byte);
/* text -> the bool ("true", "1", "false", "0"), double or int at out; a text or word is only checked, and out unused.
 * REFUSED: "where: sentence" */
pal_err pal_flag_read(const pal_flag *flag, const char *text, const char *where, void *out, pal_diagnostic *diag);
#endif
