#include "clients/link/end_condition.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

pal_err pal_end_condition_parse(pal_end_condition *until, const char *const *name, int n, const char *text,
                                pal_diagnostic *diag)
{
    *until = (pal_end_condition){.n = n};
    for (const char *word = text; *word;) {
        const int length = (int)strcspn(word, ",");
        const char *equals = memchr(word, '=', (size_t)length);
        const size_t n_name = equals ? (size_t)(equals - word) : 0;
        int which = 0;
        while (which < n && !(equals && strlen(name[which]) == n_name && !strncmp(name[which], word, n_name))) which++;
        if (which == n) {
            char known[200] = "";
            for (int i = 0; i < n; i++)
                snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "", name[i]);
            return PAL_REFUSE(diag, "until: \"%.*s\" is none of %s with a number", length, word, known);
        }
        char *end;
        const double min = strtod(equals + 1, &end);
        if (end != word + length || end == equals + 1 || !(min > 0) || !isfinite(min))
            return PAL_REFUSE(diag, "until: \"%.*s\" wants a number above 0", length, word);
        until->min[which] = min;
        until->any = true;
        word += length + (word[length] == ',');
    }
    return PAL_ERR_OK;
}

bool pal_end_condition_met(const pal_end_condition *until, const double *seen)
{
    bool all = until->any;
    for (int i = 0; i < until->n; i++) all = all && seen[i] >= until->min[i];
    return all;
}
