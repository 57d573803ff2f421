/* The results of a bench: each value is given once, with its key in JSON and its column in the table for people.
 *
 *     bench_begin(&r, "mesh", json);
 *     bench_note(&r, "one thread, medians of %d", n);
 *     bench_list(&r, "cases");
 *     for (...) { bench_record(&r); bench_text(&r, "name", "body", -12, name); bench_number(&r, "ms", "ms", 8, 2, ms);
 * } return bench_end(&r, err, &diag);
 *
 * Thread: [load]. */
#ifndef PAL_BENCH_REPORT_H
#define PAL_BENCH_REPORT_H
#include "server/base/err.h"

#include <cjson/cJSON.h>
#include <stdbool.h>

typedef struct bench_report {
    const char *bench;
    bool json;
    cJSON *root, *list, *object; /* object: where values go, a record of list or root */
    char head[1024], line[1024]; /* of the record that is being made     */
    bool has_head;               /* the head of this list is printed                  */
} bench_report;

void bench_begin(bench_report *r, const char *bench, bool json);
/* a line of text, nothing in JSON */
void bench_note(bench_report *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* begins a list of records, which is a table with a head; key NULL: values go to the whole again */
void bench_list(bench_report *r, const char *key);
void bench_record(bench_report *r);
/* a value: key NULL: not in JSON; head NULL: not in the table. width < 0: to the left. A number that is not finite is
 * null, and "-" in the table */
void bench_text(bench_report *r, const char *key, const char *head, int width, const char *text);
void bench_number(bench_report *r, const char *key, const char *head, int width, int digits, double value);
/* prints what is left, or the refusal of an error; the result is the exit code */
int bench_end(bench_report *r, pal_err err, const pal_diagnostic *diag);
#endif
