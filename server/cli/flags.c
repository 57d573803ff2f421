/* The flag parser. Configuration flags are stored first and applied last, after the file and the environment. */
#include "server/cli/flags.h"

#include "server/cli/report.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FLAGS = 64, KEY = 48, USAGE = 2 };

/* the flags of a command: its own, those of the configuration, and those that every command has */
typedef struct parse {
    const pal_flag_table *table;
    pal_flag_common *common;
    pal_flag flag[FLAGS];
    int n_flag;
    bool seen[FLAGS];
    const char *config_file, *given[PAL_CONFIG_KEYS]; /* text of a key that is a flag; NULL: not given */
    char name[PAL_CONFIG_KEYS][KEY];                  /* "--allow-remote"                               */
} parse;

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
    printf("usage: palpate %s\n\n%s\n", table->usage, table->about);
    if (table->example) printf("EXAMPLES (from the top folder of the tree, with build/release/bin in PATH)\n");
    for (const char *line = table->example; line && *line; line = strchr(line, '\n') + 1)
        printf("  %.*s\n", (int)strcspn(line, "\n"), line);
    printf("%sFLAGS\n", table->example ? "\n" : "");
    for (int k = 0; k < p->n_flag; k++) manual_line(p->flag[k].name, p->flag[k].value, p->flag[k].help);
    manual_line("--help", NULL, "this text");
    if (table->config)
        printf("\nThe file and the environment take the same keys (allow_remote, PALPATE_ALLOW_REMOTE). Flags override "
               "the\n"
               "environment, the environment overrides the file.\n");
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
    fprintf(stderr, "palpate %s: %s (see palpate %s --help)\n", common->command, text, common->command);
    return USAGE;
}

static void list_flags(parse *p)
{
    pal_flag *flag = p->flag;
    for (int k = 0; k < p->table->n_flag; k++) *flag++ = p->table->flag[k];
    for (int k = 0; p->table->config && k < PAL_CONFIG_KEYS; k++) {
        snprintf(p->name[k], KEY, "--%s", pal_config_keys[k].name);
        for (char *c = p->name[k]; *c; c++)
            if (*c == '_') *c = '-';
        *flag = pal_config_keys[k];
        flag->name = p->name[k], flag->kind = PAL_FLAG_TEXT;
        flag++->out = &p->given[k];
    }
    const char *keys = "JSON file of these keys (PALPATE_CONFIG, or none)";
    const pal_flag last[] = {
        {"--config", "FILE", PAL_FLAG_TEXT, &p->config_file, 0, 0, keys},
        {"--json", NULL, PAL_FLAG_SWITCH, &p->common->json, 0, 0, "one JSON object on stdout and nothing else"},
        {"--quiet", NULL, PAL_FLAG_SWITCH, &p->common->quiet, 0, 0, "print nothing but a refusal"}};
    for (int k = p->table->config ? 0 : 1; k < 3; k++) *flag++ = last[k];
    p->n_flag = (int)(flag - p->flag);
}

/* the flag argv[*at]; moves *at over a value that is an argument of its own */
static int take(parse *p, int argc, char **argv, int *at)
{
    char name[KEY];
    const char *word = argv[*at], *equal = strchr(word, '=');
    snprintf(name, sizeof name, "%.*s", equal ? (int)(equal - word) : (int)strlen(word), word);
    int k = 0;
    while (k < p->n_flag && strcmp(p->flag[k].name, name) != 0) k++;
    if (k == p->n_flag) return pal_flags_wrong(p->common, "unknown flag %.60s", word);
    const pal_flag *flag = &p->flag[k];
    if (!flag->value && equal) return pal_flags_wrong(p->common, "%s takes no value", name);
    if (flag->value && !equal && *at + 1 >= argc) return pal_flags_wrong(p->common, "%s needs a value", name);
    const char *text = !flag->value ? "true" : equal ? equal + 1 : argv[++*at];
    /* --json and --quiet, the last two, may be repeated */
    if (p->seen[k] && k < p->n_flag - 2) return pal_flags_wrong(p->common, "%s is given twice", name);
    p->seen[k] = true;
    pal_diagnostic diag;
    if (pal_flag_read(flag, text, name, flag->out, &diag)) return pal_flags_wrong(p->common, "%s", diag.text);
    if (flag->kind == PAL_FLAG_TEXT || flag->kind == PAL_FLAG_WORD) *(const char **)flag->out = text;
    return -1;
}

/* defaults < file < environment < flags; a bad flag is wrong usage, a bad file or variable is refused input */
static int configure(const parse *p)
{
    pal_config *config = p->table->config;
    pal_diagnostic diag = {""};
    const char *file = p->config_file ? p->config_file : getenv("PALPATE_CONFIG");
    pal_config_default(config);
    pal_err err = file && *file ? pal_config_file(config, file, &diag) : PAL_ERR_OK;
    if (!err) err = pal_config_environment(config, environ, &diag);
    if (err) return pal_report_refusal(p->common, err, &diag);
    for (int k = 0; k < PAL_CONFIG_KEYS; k++)
        if (p->given[k] && pal_config_set(config, pal_config_keys[k].name, p->given[k], p->name[k], &diag))
            return pal_flags_wrong(p->common, "%s", diag.text);
    return -1;
}

int pal_flags_parse(const pal_flag_table *table, int argc, char **argv, pal_flag_common *common, const char **operand,
                    int *n_operand)
{
    parse p = {.table = table, .common = common};
    int n = 0;
    bool only_operands = false;
    *common = (pal_flag_common){.command = argv[0]};
    list_flags(&p);
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
            if (n == table->max_operand) return pal_flags_wrong(p.common, "\"%.60s\" is one operand too many", word);
            operand[n++] = word;
        }
    }
    if (n < table->min_operand)
        return pal_flags_wrong(p.common, "%s", n ? "an operand is missing" : "no operand is given");
    if (n_operand) *n_operand = n;
    return table->config ? configure(&p) : -1;
}
