/* The results of a bench: each value is given once, with its key in JSON and its column in the table for people.
 *
 *     bench_note(r, "one thread, medians of %d", n);
 *     bench_list(r, "cases");
 *     for (...) BENCH_ROW(r, TEXT("name", "body", -12, name), NUMBER("ms", "ms", 8, 2, ms));
 *
 * Thread: [load]. */
#ifndef PAL_BENCH_REPORT_H
#define PAL_BENCH_REPORT_H
#include "server/base/err.h"

#include <cjson/cJSON.h>
#include <stdbool.h>

typedef struct bench_report {
    const char *argument; /* the second operand or --picture; NULL: none */
    bool json, has_head;  /* has_head: the head of this list is printed  */
    cJSON *root, *list;
} bench_report;

/* a line of text, nothing in JSON */
void bench_note(bench_report *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* begins a list of rows, which is a table with a head; key NULL: values go to the whole again, as before any list */
void bench_list(bench_report *r, const char *key);

/* key NULL: not in JSON; head NULL: not in the table. width < 0: to the left. A number that is not finite is null, and
 * "-" in the table */
typedef struct bench_cell {
    const char *key, *head;
    int width, digits;
    double number;
    const char *text; /* NULL: a number */
} bench_cell;
#define NUMBER(key, head, width, digits, value) ((bench_cell){key, head, width, digits, value, NULL})
#define TEXT(key, head, width, text)            ((bench_cell){key, head, width, 0, 0, text})
#define VALUE(key, value)                       NUMBER(key, NULL, 0, 0, value)
#define BENCH_ROW(r, ...)                       bench_row(r, (const bench_cell[]){__VA_ARGS__, TEXT(NULL, NULL, 0, NULL)})
void bench_row(bench_report *r, const bench_cell *cell);
#endif
