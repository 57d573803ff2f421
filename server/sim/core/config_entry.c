/* Scene entries: typed keys with their path, read once each. */
#include "server/sim/core/config_entry.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *const kind_name[] = {"a number", "true or false", "a text", "a list of numbers"};

void pal_entry_init(pal_config_entry *item, const char *path, const char *name)
{
    memset(item, 0, sizeof *item);
    snprintf(item->path, sizeof item->path, "%s", path);
    snprintf(item->name, sizeof item->name, "%s", name);
}

const pal_config_value *pal_entry_find(const pal_config_entry *item, const char *key)
{
    for (int i = 0; i < item->n_value; i++)
        if (!strcmp(item->value[i].key, key)) return &item->value[i];
    return NULL;
}

static pal_err put(pal_config_entry *item, const char *key, const pal_config_value *value, pal_diagnostic *diag)
{
    if (!*key || strlen(key) >= PAL_ENTRY_TEXT)
        return PAL_REFUSE(diag, "%s: key of %zu characters, wanted 1 to %d", item->path, strlen(key),
                          PAL_ENTRY_TEXT - 1);
    if (pal_entry_has(item, key)) return PAL_REFUSE(diag, "%s: key \"%s\" is there twice", item->path, key);
    if (item->n_value == PAL_ENTRY_KEYS) return PAL_REFUSE(diag, "%s: more than %d keys", item->path, PAL_ENTRY_KEYS);
    pal_config_value *v = &item->value[item->n_value++];
    *v = *value;
    snprintf(v->key, sizeof v->key, "%s", key);
    return PAL_ERR_OK;
}

pal_err pal_entry_put_number(pal_config_entry *item, const char *key, double number, pal_diagnostic *diag)
{
    return put(item, key, &(pal_config_value){.kind = PAL_VALUE_NUMBER, .number = {number}, .n_number = 1}, diag);
}

pal_err pal_entry_put_bool(pal_config_entry *item, const char *key, bool flag, pal_diagnostic *diag)
{
    return put(item, key, &(pal_config_value){.kind = PAL_VALUE_BOOL, .flag = flag}, diag);
}

pal_err pal_entry_put_text(pal_config_entry *item, const char *key, const char *text, pal_diagnostic *diag)
{
    if (strlen(text) >= PAL_ENTRY_TEXT)
        return PAL_REFUSE(diag, "%s.%s: text of %zu characters, at most %d", item->path, key, strlen(text),
                          PAL_ENTRY_TEXT - 1);
    pal_config_value value = {.kind = PAL_VALUE_TEXT};
    memcpy(value.text, text, strlen(text));
    return put(item, key, &value, diag);
}

pal_err pal_entry_put_numbers(pal_config_entry *item, const char *key, const double *number, int n,
                              pal_diagnostic *diag)
{
    if (n < 0 || n > PAL_ENTRY_NUMBERS)
        return PAL_REFUSE(diag, "%s.%s: list of %d numbers, at most %d", item->path, key, n, PAL_ENTRY_NUMBERS);
    pal_config_value value = {.kind = PAL_VALUE_NUMBERS, .n_number = n};
    if (n > 0) memcpy(value.number, number, (size_t)n * sizeof *number);
    return put(item, key, &value, diag);
}

/* *out is NULL when the key is absent */
static pal_err take(pal_config_entry *item, const char *key, pal_config_value_kind kind, pal_config_value **out,
                    pal_diagnostic *diag)
{
    pal_config_value *v = (pal_config_value *)pal_entry_find(item, key);
    *out = v;
    if (!v) return PAL_ERR_OK;
    if (v->kind != kind)
        return PAL_REFUSE(diag, "%s.%s: is %s, wanted %s", item->path, key, kind_name[v->kind], kind_name[kind]);
    v->used = true;
    return PAL_ERR_OK;
}

pal_err pal_entry_read_number(pal_config_entry *item, const char *key, double low, double high, double *out,
                              pal_diagnostic *diag)
{
    pal_config_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_NUMBER, &v, diag));
    if (!v) return PAL_ERR_OK;
    if (!(v->number[0] >= low && v->number[0] <= high))
        return PAL_REFUSE(diag, "%s.%s: %g is outside [%g, %g]", item->path, key, v->number[0], low, high);
    *out = v->number[0];
    return PAL_ERR_OK;
}

pal_err pal_entry_read_count(pal_config_entry *item, const char *key, int low, int high, int *out, pal_diagnostic *diag)
{
    double number = *out;
    PAL_TRY(pal_entry_read_number(item, key, low, high, &number, diag));
    if (number != floor(number)) return PAL_REFUSE(diag, "%s.%s: %g is not a whole number", item->path, key, number);
    *out = (int)number;
    return PAL_ERR_OK;
}

pal_err pal_entry_read_bool(pal_config_entry *item, const char *key, bool *out, pal_diagnostic *diag)
{
    pal_config_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_BOOL, &v, diag));
    if (v) *out = v->flag;
    return PAL_ERR_OK;
}

pal_err pal_entry_read_text(pal_config_entry *item, const char *key, const char **out, pal_diagnostic *diag)
{
    pal_config_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_TEXT, &v, diag));
    if (v) *out = v->text;
    return PAL_ERR_OK;
}

pal_err pal_entry_read_choice(pal_config_entry *item, const char *key, const char *const *word, int n, int *out,
                              pal_diagnostic *diag)
{
    const char *text = word[*out];
    char list[128];
    size_t used = 0;
    PAL_TRY(pal_entry_read_text(item, key, &text, diag));
    for (int i = 0; i < n; i++) {
        if (!strcmp(text, word[i])) {
            *out = i;
            return PAL_ERR_OK;
        }
        const char *before = i == 0 ? "" : i == n - 1 ? " or " : ", ";
        if (used < sizeof list) used += (size_t)snprintf(list + used, sizeof list - used, "%s\"%s\"", before, word[i]);
    }
    return PAL_REFUSE(diag, "%s.%s: \"%s\", wanted %s", item->path, key, text, list);
}

pal_err pal_entry_read_numbers(pal_config_entry *item, const char *key, int n, double *out, pal_diagnostic *diag)
{
    pal_config_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_NUMBERS, &v, diag));
    if (!v) return PAL_ERR_OK;
    if (v->n_number != n) return PAL_REFUSE(diag, "%s.%s: %d numbers, wanted %d", item->path, key, v->n_number, n);
    for (int i = 0; i < n; i++)
        if (!isfinite(v->number[i])) return PAL_REFUSE(diag, "%s.%s: number %d is not finite", item->path, key, i + 1);
    memcpy(out, v->number, (size_t)n * sizeof *out);
    return PAL_ERR_OK;
}

pal_err pal_entry_check_unused(const pal_config_entry *item, pal_diagnostic *diag)
{
    for (int i = 0; i < item->n_value; i++)
        if (!item->value[i].used)
            return PAL_REFUSE(diag, "%s (%s): unknown key \"%s\"", item->path, item->name, item->value[i].key);
    return PAL_ERR_OK;
}
