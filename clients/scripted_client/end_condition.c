#include "clients/scripted_client/end_condition.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const until_name[PAL_END_CONDITION_COUNT] = {
#define X(name, seen) #name,
    PAL_END_CONDITION_TABLE(X)
#undef X
};

pal_err pal_end_condition_parse(pal_end_condition *until, const char *text, pal_diagnostic *diag)
{
    *until = (pal_end_condition){.any = false};
    for (const char *word = text; *word;) {
        const int length = (int)strcspn(word, ",");
        const char *equals = memchr(word, '=', (size_t)length);
        int which = 0;
        while (which < PAL_END_CONDITION_COUNT && !(equals && strlen(until_name[which]) == (size_t)(equals - word) &&
                                                    !strncmp(until_name[which], word, (size_t)(equals - word))))
            which++;
        if (which == PAL_END_CONDITION_COUNT) {
            char known[200] = "";
            for (int i = 0; i < PAL_END_CONDITION_COUNT; i++)
                snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "", until_name[i]);
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "until: \"%.*s\" is none of %s with a number", length,
                                      word, known);
        }
        char *end;
        const double min = strtod(equals + 1, &end);
        if (end != word + length || end == equals + 1 || !(min > 0) || !isfinite(min))
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "until: \"%.*s\" wants a number above 0", length, word);
        until->min[which] = min;
        until->any = true;
        word += length + (word[length] == ',');
    }
    return PAL_ERR_OK;
}

bool pal_end_condition_met(const pal_end_condition *until, const pal_scripted_client_result *r)
{
    const double seen[PAL_END_CONDITION_COUNT] = {
#define X(name, seen) seen,
        PAL_END_CONDITION_TABLE(X)
#undef X
    };
    bool all = until->any;
    for (int i = 0; i < PAL_END_CONDITION_COUNT; i++) all = all && seen[i] >= until->min[i];
    return all;
}
