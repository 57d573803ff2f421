#include "clients/link/client_flags.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void flags_help(const pal_client_table *table)
{
    printf("usage: %s %s\n\n%s\n\n", table->program, table->usage, table->about);
    for (int i = 0; i < table->n_flag; i++) {
        char left[64];
        snprintf(left, sizeof left, "%s %s", table->flag[i].name, table->flag[i].value ? table->flag[i].value : "");
        printf("  %-26s ", left);
        for (const char *c = table->flag[i].help; *c; c++) {
            putchar(*c);
            if (*c == '\n') printf("%29s", "");
        }
        putchar('\n');
    }
    printf("  %-26s %s\n", "--help", "this text");
}

static int flags_refuse(const pal_client_table *table, const char *what, const char *reason)
{
    fprintf(stderr, "%s: %s: %s (--help lists the flags)\n", table->program, what, reason);
    return 2;
}

static const pal_client_flag *flags_find(const pal_client_table *table, const char *name, size_t n)
{
    for (int i = 0; i < table->n_flag; i++)
        if (strlen(table->flag[i].name) == n && !strncmp(table->flag[i].name, name, n)) return &table->flag[i];
    return NULL;
}

static int flags_set(const pal_client_table *table, const pal_client_flag *flag, const char *text)
{
    if (flag->low >= flag->high) {
        *(const char **)flag->out = text;
        return -1;
    }
    char *end, reason[96];
    const double value = strtod(text, &end);
    if (end == text || *end || !(value >= flag->low && value <= flag->high)) {
        snprintf(reason, sizeof reason, "wants a number of %g to %g, not \"%.40s\"", flag->low, flag->high, text);
        return flags_refuse(table, flag->name, reason);
    }
    *(double *)flag->out = value;
    return -1;
}

int pal_client_flags_parse(const pal_client_table *table, int argc, char **argv, const char **operand)
{
    int n = 0;
    for (int i = 1; i < argc; i++) {
        const char *word = argv[i];
        if (!strcmp(word, "--help")) {
            flags_help(table);
            return 0;
        }
        if (word[0] != '-' || word[1] == 0) {
            if (n == table->max_operand) return flags_refuse(table, word, "one operand too many");
            operand[n++] = word;
            continue;
        }
        const size_t n_name = strcspn(word, "=");
        const pal_client_flag *flag = flags_find(table, word, n_name);
        if (!flag) return flags_refuse(table, word, "no such flag");
        if (!flag->value) {
            if (word[n_name]) return flags_refuse(table, word, "takes no value");
            *(bool *)flag->out = true;
            continue;
        }
        const char *text = word[n_name] ? word + n_name + 1 : NULL;
        if (!text && flag->bare && (i + 1 == argc || !strncmp(argv[i + 1], "--", 2))) text = flag->bare;
        if (!text && i + 1 == argc) return flags_refuse(table, word, "wants a value");
        if (!text) text = argv[++i];
        const int code = flags_set(table, flag, text);
        if (code >= 0) return code;
    }
    if (n < table->min_operand) return flags_refuse(table, "operand missing", table->usage);
    return -1;
}

void pal_client_print_json(cJSON *taken)
{
    char *text = cJSON_PrintUnformatted(taken);
    if (text) puts(text);
    fflush(stdout);
    cJSON_free(text);
    cJSON_Delete(taken);
}

bool pal_client_parse_vector(const char *text, double out[3])
{
    for (int i = 0; i < 3; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !isfinite(out[i]) || *end != (i < 2 ? ',' : 0)) return false;
        text = end + 1;
    }
    return true;
}
