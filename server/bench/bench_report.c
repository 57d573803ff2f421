#include "server/bench/bench_report.h"

#include "server/cli/report.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void bench_begin(bench_report *r, const char *bench, bool json)
{
    *r = (bench_report){.bench = bench, .json = json, .root = cJSON_CreateObject()};
    r->object = r->root;
    cJSON_AddBoolToObject(r->root, "ok", true);
    cJSON_AddStringToObject(r->root, "bench", bench);
}

/* prints the record that is complete, before the first one the head */
static void flush_record(bench_report *r)
{
    if (!r->json && r->line[0]) {
        if (!r->has_head) printf("%s\n", r->head);
        printf("%s\n", r->line);
        r->has_head = true;
    }
    r->head[0] = r->line[0] = 0;
}

void bench_note(bench_report *r, const char *format, ...)
{
    flush_record(r);
    if (r->json) return;
    va_list args;
    va_start(args, format);
    vprintf(format, args);
    va_end(args);
    printf("\n");
}

void bench_list(bench_report *r, const char *key)
{
    flush_record(r);
    r->has_head = false;
    r->object = r->root;
    r->list = key ? cJSON_AddArrayToObject(r->root, key) : NULL;
}

void bench_record(bench_report *r)
{
    flush_record(r);
    r->object = cJSON_CreateObject();
    cJSON_AddItemToArray(r->list, r->object);
}

static void add_cell(char line[], size_t n_byte, int width, const char *text)
{
    size_t used = strlen(line);
    snprintf(line + used, n_byte - used, "%s%*s", used ? " " : "", width, text);
}

void bench_text(bench_report *r, const char *key, const char *head, int width, const char *text)
{
    if (key) cJSON_AddStringToObject(r->object, key, text);
    if (!head) return;
    add_cell(r->head, sizeof r->head, width, head);
    add_cell(r->line, sizeof r->line, width, text);
}

void bench_number(bench_report *r, const char *key, const char *head, int width, int digits, double value)
{
    char text[40] = "-";
    if (key) pal_json_add_or_null(r->object, key, value);
    if (isfinite(value)) snprintf(text, sizeof text, "%.*f", digits, value);
    if (head) bench_text(r, NULL, head, width, text);
}

int bench_end(bench_report *r, pal_err err, const pal_diagnostic *diag)
{
    const pal_flag_common common = {.json = r->json, .command = "bench"};
    flush_record(r);
    if (!err) {
        int code = r->json ? pal_report_json(&common, r->root) : 0;
        if (!r->json) cJSON_Delete(r->root);
        return code;
    }
    pal_diagnostic named = {""};
    pal_diagnostic_set(&named, err, "%s: %s", r->bench, diag->text[0] ? diag->text : pal_err_text(err));
    cJSON_Delete(r->root);
    return pal_report_refusal(&common, err, &named);
}
