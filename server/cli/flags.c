/* The flag parser. Configuration flags are stored first and applied last, after the file and the environment. */
#include "server/cli/flags.h"

#include "server/cli/report.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FLAGS = 64, KEY = 48, USAGE = 2 };

typedef struct parse {
    const pal_flag_table *table;
    pal_flag_common *common;
    bool seen[FLAGS];
    const char *config_file;
    struct {
        const pal_config_key *setting;
        const char *text;
    } given[FLAGS];
    int n_given;
} parse;

/* ---- manual ---- */

static void manual_line(const char *name, const char *value, const char *help)
{
    char left[80];
    snprintf(left, sizeof left, "%s %s", name, value ? value : "");
    printf("  %-22s ", left);
    if (strlen(left) > 22) printf("\n%25s", "");
    for (; *help; help++) {
        putchar(*help);
        if (*help == '\n') printf("%25s", "");
    }
    putchar('\n');
}

static void flag_name(const char *key, char out[KEY])
{
    snprintf(out, KEY, "--%s", key);
    for (char *c = out; *c; c++)
        if (*c == '_') *c = '-';
}

static int manual(const pal_flag_table *table)
{
    char name[KEY];
    int n;
    printf("usage: palpate %s\n\n%s\n", table->usage, table->about);
    if (table->example) printf("EXAMPLES (from the top folder of the tree, with build/release/bin in PATH)\n");
    for (const char *line = table->example; line && *line; line = strchr(line, '\n') + 1)
        printf("  %.*s\n", (int)strcspn(line, "\n"), line);
    printf("%sFLAGS\n", table->example ? "\n" : "");
    for (int k = 0; k < table->n_flag; k++) manual_line(table->flag[k].name, table->flag[k].value, table->flag[k].help);
    if (table->config) {
        const pal_config_key *setting = pal_config_keys(&n);
        for (int k = 0; k < n; k++) {
            flag_name(setting[k].key, name);
            manual_line(name, setting[k].kind == PAL_CONFIG_KEY_BOOL ? NULL : setting[k].value, setting[k].help);
        }
        manual_line("--config", "FILE", "JSON file of these keys (PALPATE_CONFIG, or none)");
    }
    manual_line("--json", NULL, "one JSON object on stdout and nothing else");
    manual_line("--quiet", NULL, "print nothing but a refusal");
    manual_line("--help", NULL, "this text");
    if (table->config)
        printf("\nThe file and the environment take the same keys (allow_remote, PALPATE_ALLOW_REMOTE). Flags override "
               "the\n"
               "environment, the environment overrides the file.\n");
    printf("\nExit code: 0 ok, 1 input refused, 2 wrong usage, 3 internal error\n");
    return 0;
}

/* ---- parsing ---- */

int pal_flags_wrong(const pal_flag_common *common, const char *format, ...)
{
    char text[400];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < 0x20) *c = ' ';
    fprintf(stderr, "palpate %s: %s (see palpate %s --help)\n", common->command, text, common->command);
    return USAGE;
}

/* text is one of the words of value, "linear|corotational|neo_hookean" */
static int set_word(const parse *p, const pal_flag *flag, const char *text)
{
    char list[200] = "";
    size_t n = strlen(text), used = 0;
    for (const char *word = flag->value; *word;) {
        size_t length = strcspn(word, "|");
        if (length == n && !strncmp(word, text, n)) {
            *(const char **)flag->out = text;
            return -1;
        }
        const char *next = word + length + (word[length] == '|');
        const char *link = !used ? "" : *next ? ", " : " or ";
        used += (size_t)snprintf(list + used, sizeof list - used, "%s%.*s", link, (int)length, word);
        word = next;
    }
    return pal_flags_wrong(p->common, "%s: \"%.60s\" is not %s", flag->name, text, list);
}

static int set_number(const parse *p, const pal_flag *flag, const char *text)
{
    char *end;
    double number = strtod(text, &end);
    if (end == text || *end || isspace((unsigned char)*text) || !isfinite(number))
        return pal_flags_wrong(p->common, "%s: \"%.60s\" is not a number", flag->name, text);
    if (!(number >= flag->low && number <= flag->high))
        return pal_flags_wrong(p->common, "%s: %.15g is outside %.10g .. %.10g", flag->name, number, flag->low,
                               flag->high);
    if (flag->kind == PAL_FLAG_COUNT && number != floor(number))
        return pal_flags_wrong(p->common, "%s: %.15g is not a whole number", flag->name, number);
    if (flag->kind == PAL_FLAG_COUNT)
        *(int *)flag->out = (int)number;
    else
        *(double *)flag->out = number;
    return -1;
}

static int set_flag(parse *p, const pal_flag *flag, const char *text)
{
    switch (flag->kind) {
    case PAL_FLAG_SWITCH:
        *(bool *)flag->out = true;
        return -1;
    case PAL_FLAG_TEXT:
        *(const char **)flag->out = text;
        return -1;
    case PAL_FLAG_WORD:
        return set_word(p, flag, text);
    case PAL_FLAG_NUMBER:
    case PAL_FLAG_COUNT:
        break;
    }
    return set_number(p, flag, text);
}

/* a flag of the configuration, "--allow-remote" -> allow_remote; NULL: none */
static const pal_config_key *setting_named(const pal_flag_table *table, const char *name)
{
    char known[KEY];
    int n;
    const pal_config_key *setting = pal_config_keys(&n);
    for (int k = 0; table->config && k < n; k++) {
        flag_name(setting[k].key, known);
        if (!strcmp(known, name)) return &setting[k];
    }
    return NULL;
}

/* the flag argv[*at]; moves *at over a value that is an argument of its own */
static int take(parse *p, int argc, char **argv, int *at)
{
    char name[KEY];
    const char *word = argv[*at], *equal = strchr(word, '=');
    snprintf(name, sizeof name, "%.*s", equal ? (int)(equal - word) : (int)strlen(word), word);
    int found = -1;
    for (int k = 0; k < p->table->n_flag; k++)
        if (!strcmp(p->table->flag[k].name, name)) found = k;
    const pal_config_key *setting = found < 0 ? setting_named(p->table, name) : NULL;
    bool config_file = p->table->config && !strcmp(name, "--config");
    bool json = !strcmp(name, "--json"), quiet = !strcmp(name, "--quiet");
    if (found < 0 && !setting && !config_file && !json && !quiet)
        return pal_flags_wrong(p->common, "unknown flag %.60s", word);
    bool is_switch = json || quiet || (found >= 0 && p->table->flag[found].kind == PAL_FLAG_SWITCH) ||
                     (setting && setting->kind == PAL_CONFIG_KEY_BOOL);
    if (is_switch && equal) return pal_flags_wrong(p->common, "%s takes no value", name);
    if (!is_switch && !equal && *at + 1 >= argc) return pal_flags_wrong(p->common, "%s needs a value", name);
    const char *text = is_switch ? "true" : equal ? equal + 1 : argv[++*at];
    if (json) p->common->json = true;
    if (quiet) p->common->quiet = true;
    if (json || quiet) return -1;
    if (config_file ? p->config_file != NULL : found >= 0 && p->seen[found])
        return pal_flags_wrong(p->common, "%s is given twice", name);
    for (int k = 0; setting && k < p->n_given; k++)
        if (p->given[k].setting == setting) return pal_flags_wrong(p->common, "%s is given twice", name);
    if (config_file) {
        p->config_file = text;
    } else if (setting) {
        p->given[p->n_given].setting = setting;
        p->given[p->n_given++].text = text;
    } else {
        p->seen[found] = true;
        return set_flag(p, &p->table->flag[found], text);
    }
    return -1;
}

/* defaults < file < environment < flags; a bad flag is wrong usage, a bad file or variable is refused input */
static int configure(parse *p)
{
    pal_config *config = p->table->config;
    pal_diagnostic diag = {""};
    const char *file = p->config_file ? p->config_file : getenv("PALPATE_CONFIG");
    pal_config_default(config);
    pal_err err = file && *file ? pal_config_file(config, file, &diag) : PAL_ERR_OK;
    if (!err) err = pal_config_environment(config, environ, &diag);
    if (err) return pal_report_refusal(p->common, err, &diag);
    for (int k = 0; k < p->n_given; k++) {
        char name[KEY];
        flag_name(p->given[k].setting->key, name);
        if (pal_config_set(config, p->given[k].setting->key, p->given[k].text, name, &diag))
            return pal_flags_wrong(p->common, "%s", diag.text);
    }
    return -1;
}

int pal_flags_parse(const pal_flag_table *table, int argc, char **argv, pal_flag_common *common, const char **operand,
                    int *n_operand)
{
    parse p = {.table = table, .common = common};
    int n = 0;
    bool only_operands = false;
    *common = (pal_flag_common){.command = argv[0]};
    for (int k = 1; k < argc; k++)
        if (!strcmp(argv[k], "--"))
            break;
        else if (!strcmp(argv[k], "--help") || !strcmp(argv[k], "-h"))
            return manual(table);
    for (int k = 1; k < argc; k++) {
        const char *word = argv[k];
        if (!only_operands && !strcmp(word, "--")) {
            only_operands = true;
        } else if (!only_operands && word[0] == '-' && word[1]) {
            int code = take(&p, argc, argv, &k);
            if (code >= 0) return code;
        } else {
            if (n == table->max_operand) return pal_flags_wrong(p.common, "\"%.60s\" is one operand too many", word);
            operand[n++] = word;
        }
    }
    if (n < table->min_operand)
        return pal_flags_wrong(p.common, "%s", n ? "an operand is missing" : "no operand is given");
    if (n_operand) *n_operand = n;
    return table->config ? configure(&p) : -1;
}
