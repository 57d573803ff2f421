/* Results in rows: each value is given once, with its key in JSON and its column in the table for people.
 *
 *     pal_table_note(r, "one thread, medians of %d", n);
 *     pal_table_list(r, "cases");
 *     for (...) TABLE_ROW(r, TEXT("name", "body", -12, name), NUMBER("ms", "ms", 8, 2, ms));
 *
 * Thread: [load]. */
#ifndef PAL_CLI_TABLE_H
#define PAL_CLI_TABLE_H
#include "server/base/err.h"

#include <cjson/cJSON.h>
#include <stdbool.h>

typedef struct pal_table {
    const char *argument;  /* of a bench: the second operand or --picture; NULL: none */
    bool silent, has_head; /* silent: no table; has_head: the head of this list is printed */
    cJSON *root, *list;
} pal_table;

/* a line of text, nothing in JSON */
void pal_table_note(pal_table *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* begins a list of rows, which is a table with a head; key NULL: values go to the whole again, as before any list */
void pal_table_list(pal_table *r, const char *key);

/* key NULL: not in JSON; head NULL: not in the table. width < 0: to the left. A number that is not finite is null, and
 * "-" in the table */
typedef struct pal_table_cell {
    const char *key, *head;
    int width, digits;
    double number;
    const char *text; /* NULL: a number */
    cJSON *tree;      /* taken; in JSON instead of these; NULL: none */
} pal_table_cell;
#define NUMBER(key, head, width, digits, value) ((pal_table_cell){key, head, width, digits, value, NULL, NULL})
#define TEXT(key, head, width, text)            ((pal_table_cell){key, head, width, 0, 0, text, NULL})
#define TREE(key, tree)                         ((pal_table_cell){key, NULL, 0, 0, 0, NULL, tree})
#define VALUE(key, value)                       NUMBER(key, NULL, 0, 0, value)
#define TABLE_ROW(r, ...)                       pal_table_row(r, (const pal_table_cell[]){__VA_ARGS__, TEXT(NULL, NULL, 0, NULL)})
void pal_table_row(pal_table *r, const pal_table_cell *cell);
#endif
