/* One scene entry as the simulation sees it: a name and typed keys, without any file format. The scene room fills it
 * from JSON; effects, solvers and models read their keys and then call pal_item_done, which refuses unknown keys.
 * Every refusal names the entry's path, the key and the number. Thread: [load]. */
#ifndef PAL_SIM_ITEM_H
#define PAL_SIM_ITEM_H
#include "server/base/err.h"

#include <stdbool.h>

enum { PAL_ITEM_KEYS = 32, PAL_ITEM_NUMBERS = 16, PAL_ITEM_TEXT = 64 };

typedef enum pal_value_kind { PAL_VALUE_NUMBER, PAL_VALUE_BOOL, PAL_VALUE_TEXT, PAL_VALUE_NUMBERS } pal_value_kind;

typedef struct pal_value {
    char key[PAL_ITEM_TEXT];
    pal_value_kind kind;
    bool used;
    bool flag;                       /* PAL_VALUE_BOOL               */
    char text[PAL_ITEM_TEXT];        /* PAL_VALUE_TEXT               */
    double number[PAL_ITEM_NUMBERS]; /* NUMBER uses [0], NUMBERS all */
    int n_number;
} pal_value;

typedef struct pal_item {
    char path[PAL_ITEM_TEXT]; /* where it stands: "effects[2]"  */
    char name[PAL_ITEM_TEXT]; /* effect, solver or model name   */
    pal_value value[PAL_ITEM_KEYS];
    int n_value;
} pal_item;

void pal_item_init(pal_item *item, const char *path, const char *name);
/* add a key; REFUSED when it is there already, too long, or the entry is full */
pal_err pal_item_put_number(pal_item *item, const char *key, double number, pal_note *note);
pal_err pal_item_put_bool(pal_item *item, const char *key, bool flag, pal_note *note);
pal_err pal_item_put_text(pal_item *item, const char *key, const char *text, pal_note *note);
pal_err pal_item_put_numbers(pal_item *item, const char *key, const double *number, int n, pal_note *note);

bool pal_item_has(const pal_item *item, const char *key);
/* read a key into *out, which keeps its value (the default) when the key is absent; REFUSED for another kind, a number
 * that is not finite or outside [low, high], or a list of another length than n */
pal_err pal_item_number(pal_item *item, const char *key, double low, double high, double *out, pal_note *note);
pal_err pal_item_count(pal_item *item, const char *key, int low, int high, int *out, pal_note *note);
pal_err pal_item_bool(pal_item *item, const char *key, bool *out, pal_note *note);
pal_err pal_item_text(pal_item *item, const char *key, const char **out, pal_note *note); /* borrows from item */
pal_err pal_item_numbers(pal_item *item, const char *key, int n, double *out, pal_note *note);
/* REFUSED with the first key that nobody read */
pal_err pal_item_done(const pal_item *item, pal_note *note);
#endif
