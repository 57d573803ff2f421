#include "server/cli/flag.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int pal_flag_word(const char *words, const char *text)
{
    size_t n = strlen(text);
    for (int k = 0; *words; k++) {
        size_t length = strcspn(words, "|");
        if (length == n && !strncmp(words, text, n)) return k;
        words += length + (words[length] == '|');
    }
    return -1;
}

bool pal_flag_next_word(const char **list, char *out, size_t n_byte)
{
    if (!*list) return false;
    size_t n = strcspn(*list, ",");
    snprintf(out, n_byte, "%.*s", (int)n, *list);
    *list = (*list)[n] ? *list + n + 1 : NULL;
    return true;
}

/* "a|b|c" -> "a, b or c" */
static void list_words(const char *words, char *out, size_t n_byte)
{
    size_t used = 0;
    out[0] = 0;
    for (const char *next; *words && used < n_byte; words = next) {
        size_t length = strcspn(words, "|");
        next = words + length + (words[length] == '|');
        const char *link = !used ? "" : *next ? ", " : " or ";
        used += (size_t)snprintf(out + used, n_byte - used, "%s%.*s", link, (int)length, words);
    }
}

static pal_err read_number(const pal_flag *flag, const char *text, const char *where, void *out, pal_diagnostic *diag)
{
    char *end;
    double number = strtod(text, &end);
    if (end == text || *end || isspace((unsigned char)*text) || !isfinite(number))
        return PAL_REFUSE(diag, "%s: \"%.60s\" is not a number", where, text);
    if (!(number >= flag->low && number <= flag->high))
        return PAL_REFUSE(diag, "%s: %.15g is outside %.10g .. %.10g", where, number, flag->low, flag->high);
    if (flag->kind == PAL_FLAG_NUMBER) {
        *(double *)out = number;
        return PAL_ERR_OK;
    }
    if (number != floor(number)) return PAL_REFUSE(diag, "%s: %.15g is not a whole number", where, number);
    *(int *)out = (int)number;
    return PAL_ERR_OK;
}

pal_err pal_flag_read(const pal_flag *flag, const char *text, const char *where, void *out, pal_diagnostic *diag)
{
    char list[200];
    bool yes = !strcmp(text, "true") || !strcmp(text, "1");
    if (flag->kind == PAL_FLAG_SWITCH) {
        if (!yes && strcmp(text, "false") != 0 && strcmp(text, "0") != 0)
            return PAL_REFUSE(diag, "%s: \"%.40s\" is not true or false", where, text);
        *(bool *)out = yes;
        return PAL_ERR_OK;
    }
    if (flag->kind == PAL_FLAG_WORD && pal_flag_word(flag->value, text) < 0) {
        list_words(flag->value, list, sizeof list);
        return PAL_REFUSE(diag, "%s: \"%.60s\" is not %s", where, text, list);
    }
    const bool number = flag->kind == PAL_FLAG_NUMBER || flag->kind == PAL_FLAG_COUNT;
    return number ? read_number(flag, text, where, out, diag) : PAL_ERR_OK;
}
