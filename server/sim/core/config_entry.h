/* One entry of a scene: a name and typed keys, independent of any file format. The room scene fills it from JSON;
 * effects, solvers and models read their keys and then call pal_entry_check_unused, which refuses unknown keys. Every
 * refusal names the entry's path, the key and the number. Thread: [load]. */
#ifndef PAL_SIM_CORE_CONFIG_ENTRY_H
#define PAL_SIM_CORE_CONFIG_ENTRY_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stddef.h>

enum { PAL_ENTRY_KEYS = 32, PAL_ENTRY_NUMBERS = 16, PAL_ENTRY_TEXT = 64 };

typedef enum pal_config_value_kind {
    PAL_VALUE_NUMBER,
    PAL_VALUE_BOOL,
    PAL_VALUE_TEXT,
    PAL_VALUE_NUMBERS
} pal_config_value_kind;

typedef struct pal_config_value {
    char key[PAL_ENTRY_TEXT];
    pal_config_value_kind kind;
    bool used;
    bool flag;                        /* PAL_VALUE_BOOL               */
    char text[PAL_ENTRY_TEXT];        /* PAL_VALUE_TEXT               */
    double number[PAL_ENTRY_NUMBERS]; /* NUMBER uses [0], NUMBERS all */
    int n_number;
} pal_config_value;

typedef struct pal_config_entry {
    char path[PAL_ENTRY_TEXT]; /* its place in the scene: "effects[2]" */
    char name[PAL_ENTRY_TEXT]; /* effect, solver or model name   */
    pal_config_value value[PAL_ENTRY_KEYS];
    int n_value;
} pal_config_entry;

void pal_entry_init(pal_config_entry *item, const char *path, const char *name);
/* add a key; REFUSED when it is there already, too long, or the entry is full */
pal_err pal_entry_put_number(pal_config_entry *item, const char *key, double number, pal_diagnostic *diag);
pal_err pal_entry_put_bool(pal_config_entry *item, const char *key, bool flag, pal_diagnostic *diag);
pal_err pal_entry_put_text(pal_config_entry *item, const char *key, const char *text, pal_diagnostic *diag);
pal_err pal_entry_put_numbers(pal_config_entry *item, const char *key, const double *number, int n,
                              pal_diagnostic *diag);

const pal_config_value *pal_entry_find(const pal_config_entry *item, const char *key); /* NULL: it has no such key */
static inline bool pal_entry_has(const pal_config_entry *item, const char *key)
{
    return pal_entry_find(item, key) != NULL;
}
/* read a key into *out, which keeps its value (the default) when the key is absent; REFUSED for another kind, a number
 * that is not finite or outside [low, high], or a list of another length than n */
pal_err pal_entry_read_number(pal_config_entry *item, const char *key, double low, double high, double *out,
                              pal_diagnostic *diag);
pal_err pal_entry_read_count(pal_config_entry *item, const char *key, int low, int high, int *out,
                             pal_diagnostic *diag);
pal_err pal_entry_read_bool(pal_config_entry *item, const char *key, bool *out, pal_diagnostic *diag);
pal_err pal_entry_read_text(pal_config_entry *item, const char *key, const char **out,
                            pal_diagnostic *diag); /* borrows from item */
/* one of n words; *out keeps its index when the key is absent */
pal_err pal_entry_read_choice(pal_config_entry *item, const char *key, const char *const *word, int n, int *out,
                              pal_diagnostic *diag);
pal_err pal_entry_read_numbers(pal_config_entry *item, const char *key, int n, double *out, pal_diagnostic *diag);
/* REFUSED with the first key that nobody read */
pal_err pal_entry_check_unused(const pal_config_entry *item, pal_diagnostic *diag);
#endif
