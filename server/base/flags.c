#include "server/base/flags.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FLAGS = 64, NAME = 48, USAGE = 2 };

/* the flags of a table and those that every program has */
typedef struct parse {
    const pal_flag_table *table;
    pal_flag_common *common;
    pal_flag flag[FLAGS];
    int n_flag;
    bool seen[FLAGS];
} parse;

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

static pal_err read_vector(const char *text, const char *where, double out[3], pal_diagnostic *diag)
{
    const char *rest = text;
    for (int i = 0; i < 3; i++) {
        char *end;
        out[i] = strtod(rest, &end);
        if (end == rest || !isfinite(out[i]) || *end != (i < 2 ? ',' : 0))
            return PAL_REFUSE(diag, "%s: \"%.60s\" is not three numbers X,Y,Z", where, text);
        rest = end + 1;
    }
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
    if (flag->kind == PAL_FLAG_VECTOR) return read_vector(text, where, out, diag);
    const bool number = flag->kind == PAL_FLAG_NUMBER || flag->kind == PAL_FLAG_COUNT;
    return number ? read_number(flag, text, where, out, diag) : PAL_ERR_OK;
}

static void manual_line(const char *name, const char *value, const char *help)
{
    char left[80];
    snprintf(left, sizeof left, "%s%s%s", name, value ? " " : "", value ? value : "");
    if (strlen(left) > 22)
        printf("  %s\n%25s", left, "");
    else
        printf("  %-22s ", left);
    for (; *help; help++) {
        putchar(*help);
        if (*help == '\n') printf("%25s", "");
    }
    putchar('\n');
}

static int manual(const parse *p)
{
    const pal_flag_table *table = p->table;
    printf("usage: %s %s\n\n%s\n", table->program ? table->program : "palpate", table->usage, table->about);
    if (table->example) printf("EXAMPLES (from the top folder of the tree, with build/release/bin in PATH)\n");
    for (const char *line = table->example; line && *line; line = strchr(line, '\n') + 1)
        printf("  %.*s\n", (int)strcspn(line, "\n"), line);
    printf("%sFLAGS\n", table->example ? "\n" : "");
    for (int k = 0; k < p->n_flag; k++) manual_line(p->flag[k].name, p->flag[k].value, p->flag[k].help);
    manual_line("--help", NULL, "this text");
    if (table->note) printf("\n%s", table->note);
    printf("\nExit code: 0 ok, 1 input refused, 2 wrong usage, 3 internal error\n");
    return 0;
}

int pal_flags_wrong(const pal_flag_common *common, const char *format, ...)
{
    char text[400];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < 0x20) *c = ' ';
    fprintf(stderr, "%s: %s (see %s --help)\n", common->program, text, common->program);
    return USAGE;
}

/* the flag argv[*at]; moves *at over a value that is an argument of its own */
static int take(parse *p, int argc, char **argv, int *at)
{
    char name[NAME];
    const char *word = argv[*at], *equal = strchr(word, '=');
    snprintf(name, sizeof name, "%.*s", equal ? (int)(equal - word) : (int)strlen(word), word);
    int k = 0;
    while (k < p->n_flag && strcmp(p->flag[k].name, name) != 0) k++;
    if (k == p->n_flag) return pal_flags_wrong(p->common, "unknown flag %.60s", word);
    const pal_flag *flag = &p->flag[k];
    if (!flag->value && equal) return pal_flags_wrong(p->common, "%s takes no value", name);
    const bool last = *at + 1 >= argc;
    const bool alone = flag->kind == PAL_FLAG_OPTIONAL && !equal && (last || !strncmp(argv[*at + 1], "--", 2));
    if (flag->value && !equal && !alone && last) return pal_flags_wrong(p->common, "%s needs a value", name);
    const char *text = !flag->value ? "true" : equal ? equal + 1 : alone ? "" : argv[++*at];
    /* --json and --quiet, the last two, may be repeated */
    if (p->seen[k] && k < p->n_flag - 2) return pal_flags_wrong(p->common, "%s is given twice", name);
    p->seen[k] = true;
    pal_diagnostic diag;
    if (pal_flag_read(flag, text, name, flag->out, &diag)) return pal_flags_wrong(p->common, "%s", diag.text);
    if (flag->kind >= PAL_FLAG_TEXT && flag->kind <= PAL_FLAG_WORD) *(const char **)flag->out = text;
    return -1;
}

int pal_flags_parse(const pal_flag_table *table, int argc, char **argv, pal_flag_common *common, const char **operand,
                    int *n_operand)
{
    const pal_flag last[] = {
        {"--json", NULL, PAL_FLAG_SWITCH, &common->json, 0, 0, "one JSON object on stdout and nothing else"},
        {"--quiet", NULL, PAL_FLAG_SWITCH, &common->quiet, 0, 0, "print nothing but a refusal"}};
    parse p = {.table = table, .common = common, .n_flag = table->n_flag + 2};
    int n = 0;
    bool only_operands = false;
    *common = (pal_flag_common){.json = false};
    snprintf(common->program, sizeof common->program, table->program ? "%s" : "palpate %s",
             table->program ? table->program : argv[0]);
    for (int k = 0; k < p.n_flag; k++) p.flag[k] = k < table->n_flag ? table->flag[k] : last[k - table->n_flag];
    for (int k = 1; k < argc && strcmp(argv[k], "--") != 0; k++)
        if (!strcmp(argv[k], "--help") || !strcmp(argv[k], "-h")) return manual(&p);
    for (int k = 1; k < argc; k++) {
        const char *word = argv[k];
        if (!only_operands && !strcmp(word, "--")) {
            only_operands = true;
        } else if (!only_operands && word[0] == '-' && word[1]) {
            int code = take(&p, argc, argv, &k);
            if (code >= 0) return code;
        } else {
            if (n == table->operands[1]) return pal_flags_wrong(p.common, "\"%.60s\" is one operand too many", word);
            operand[n++] = word;
        }
    }
    if (n < table->operands[0])
        return pal_flags_wrong(p.common, "%s", n ? "an operand is missing" : "no operand is given");
    if (n_operand) *n_operand = n;
    return -1;
}
