/* Scene entries: typed keys with their path, read once each. */
#include "server/sim/core/item.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *kind_name(pal_value_kind kind)
{
    static const char *const names[] = {"a number", "true or false", "a text", "a list of numbers"};
    return names[kind];
}

void pal_item_init(pal_item *item, const char *path, const char *name)
{
    memset(item, 0, sizeof *item);
    snprintf(item->path, sizeof item->path, "%s", path);
    snprintf(item->name, sizeof item->name, "%s", name);
}

static pal_value *find(const pal_item *item, const char *key)
{
    for (int i = 0; i < item->n_value; i++)
        if (!strcmp(item->value[i].key, key)) return (pal_value *)&item->value[i];
    return NULL;
}

static pal_err put(pal_item *item, const char *key, pal_value_kind kind, pal_value **out, pal_note *note)
{
    if (!*key || strlen(key) >= PAL_ITEM_TEXT)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s: key of %zu characters, wanted 1 to %d", item->path, strlen(key),
                            PAL_ITEM_TEXT - 1);
    if (find(item, key)) return pal_note_set(note, PAL_ERR_REFUSED, "%s: key \"%s\" is there twice", item->path, key);
    if (item->n_value == PAL_ITEM_KEYS)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s: more than %d keys", item->path, PAL_ITEM_KEYS);
    pal_value *v = &item->value[item->n_value++];
    memset(v, 0, sizeof *v);
    snprintf(v->key, sizeof v->key, "%s", key);
    v->kind = kind;
    *out = v;
    return PAL_ERR_OK;
}

pal_err pal_item_put_number(pal_item *item, const char *key, double number, pal_note *note)
{
    pal_value *v;
    PAL_TRY(put(item, key, PAL_VALUE_NUMBER, &v, note));
    v->number[0] = number;
    v->n_number = 1;
    return PAL_ERR_OK;
}

pal_err pal_item_put_bool(pal_item *item, const char *key, bool flag, pal_note *note)
{
    pal_value *v;
    PAL_TRY(put(item, key, PAL_VALUE_BOOL, &v, note));
    v->flag = flag;
    return PAL_ERR_OK;
}

pal_err pal_item_put_text(pal_item *item, const char *key, const char *text, pal_note *note)
{
    if (strlen(text) >= PAL_ITEM_TEXT)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: text of %zu characters, at most %d", item->path, key,
                            strlen(text), PAL_ITEM_TEXT - 1);
    pal_value *v;
    PAL_TRY(put(item, key, PAL_VALUE_TEXT, &v, note));
    snprintf(v->text, sizeof v->text, "%s", text);
    return PAL_ERR_OK;
}

pal_err pal_item_put_numbers(pal_item *item, const char *key, const double *number, int n, pal_note *note)
{
    if (n < 0 || n > PAL_ITEM_NUMBERS)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: list of %d numbers, at most %d", item->path, key, n,
                            PAL_ITEM_NUMBERS);
    pal_value *v;
    PAL_TRY(put(item, key, PAL_VALUE_NUMBERS, &v, note));
    if (n > 0) memcpy(v->number, number, (size_t)n * sizeof *number);
    v->n_number = n;
    return PAL_ERR_OK;
}

bool pal_item_has(const pal_item *item, const char *key)
{
    return find(item, key) != NULL;
}

/* *out is NULL when the key is absent */
static pal_err take(pal_item *item, const char *key, pal_value_kind kind, pal_value **out, pal_note *note)
{
    pal_value *v = find(item, key);
    *out = v;
    if (!v) return PAL_ERR_OK;
    if (v->kind != kind)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: is %s, wanted %s", item->path, key, kind_name(v->kind),
                            kind_name(kind));
    v->used = true;
    return PAL_ERR_OK;
}

pal_err pal_item_number(pal_item *item, const char *key, double low, double high, double *out, pal_note *note)
{
    pal_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_NUMBER, &v, note));
    if (!v) return PAL_ERR_OK;
    if (!(v->number[0] >= low && v->number[0] <= high))
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: %g is outside [%g, %g]", item->path, key, v->number[0], low,
                            high);
    *out = v->number[0];
    return PAL_ERR_OK;
}

pal_err pal_item_count(pal_item *item, const char *key, int low, int high, int *out, pal_note *note)
{
    double number = *out;
    PAL_TRY(pal_item_number(item, key, low, high, &number, note));
    if (number != floor(number))
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: %g is not a whole number", item->path, key, number);
    *out = (int)number;
    return PAL_ERR_OK;
}

pal_err pal_item_bool(pal_item *item, const char *key, bool *out, pal_note *note)
{
    pal_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_BOOL, &v, note));
    if (v) *out = v->flag;
    return PAL_ERR_OK;
}

pal_err pal_item_text(pal_item *item, const char *key, const char **out, pal_note *note)
{
    pal_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_TEXT, &v, note));
    if (v) *out = v->text;
    return PAL_ERR_OK;
}

pal_err pal_item_numbers(pal_item *item, const char *key, int n, double *out, pal_note *note)
{
    pal_value *v;
    PAL_TRY(take(item, key, PAL_VALUE_NUMBERS, &v, note));
    if (!v) return PAL_ERR_OK;
    if (v->n_number != n)
        return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: %d numbers, wanted %d", item->path, key, v->n_number, n);
    for (int i = 0; i < n; i++)
        if (!isfinite(v->number[i]))
            return pal_note_set(note, PAL_ERR_REFUSED, "%s.%s: number %d is not finite", item->path, key, i + 1);
    memcpy(out, v->number, (size_t)n * sizeof *out);
    return PAL_ERR_OK;
}

pal_err pal_item_done(const pal_item *item, pal_note *note)
{
    for (int i = 0; i < item->n_value; i++)
        if (!item->value[i].used)
            return pal_note_set(note, PAL_ERR_REFUSED, "%s (%s): unknown key \"%s\"", item->path, item->name,
                                item->value[i].key);
    return PAL_ERR_OK;
}
