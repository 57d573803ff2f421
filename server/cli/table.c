#include "server/cli/table.h"

#include "server/cli/report.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void pal_table_note(pal_table *r, const char *format, ...)
{
    if (r->silent) return;
    va_list args;
    va_start(args, format);
    vprintf(format, args);
    va_end(args);
    printf("\n");
}

void pal_table_list(pal_table *r, const char *key)
{
    r->has_head = false;
    r->list = key ? cJSON_AddArrayToObject(r->root, key) : NULL;
}

static void add_cell(char line[1024], int width, const char *text)
{
    size_t used = strlen(line);
    snprintf(line + used, 1024 - used, "%s%*s", used ? " " : "", width, text);
}

void pal_table_row(pal_table *r, const pal_table_cell *cell)
{
    char head[1024] = "", line[1024] = "";
    cJSON *object = r->list ? cJSON_CreateObject() : r->root;
    if (r->list) cJSON_AddItemToArray(r->list, object);
    for (; cell->key || cell->head; cell++) {
        char number[40] = "-";
        if (isfinite(cell->number)) snprintf(number, sizeof number, "%.*f", cell->digits, cell->number);
        if (cell->key)
            cJSON_AddItemToObject(object, cell->key,
                                  cell->tree   ? cell->tree
                                  : cell->text ? JSON_TEXT(cell->text)
                                               : pal_json_or_null(cell->number));
        if (!cell->head) continue;
        add_cell(head, cell->width, cell->head);
        add_cell(line, cell->width, cell->text ? cell->text : number);
    }
    if (r->silent || !line[0]) return;
    if (!r->has_head) printf("%s\n", head);
    printf("%s\n", line);
    r->has_head = true;
}
