/* Conditions that a client must meet before it may end: "NAME=NUMBER,...", all of them. Tests wait for a condition
 * instead of a time. Thread: [load]. */
#ifndef PAL_LINK_END_CONDITION_H
#define PAL_LINK_END_CONDITION_H
#include "server/base/err.h"

#include <stdbool.h>

enum { PAL_END_CONDITION_MAX = 20 };

typedef struct pal_end_condition {
    int n;                             /* numbers that a client gives */
    bool any;                          /* there is a condition */
    double min[PAL_END_CONDITION_MAX]; /* [n] 0: no condition */
} pal_end_condition;

/* name: of the numbers that the client gives, [n]. REFUSED: names the word */
pal_err pal_end_condition_parse(pal_end_condition *until, const char *const *name, int n, const char *text,
                                pal_diagnostic *diag);
/* seen: the numbers, [n]. true: all conditions are met; false otherwise, and when there are none */
bool pal_end_condition_met(const pal_end_condition *until, const double *seen);
#endif
