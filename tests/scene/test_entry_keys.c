/* README.md of the scene room documents every key that a model, solver, output or effect reads, and no other: the table
 * is compared with the text of the calls that read keys. */
#include "server/mesh/files/file_bytes.h"
#include "tests/check.h"

#include <ctype.h>
#include <glob.h>

static const char readme[] = "server/scene/README.md";
static const char *const sources[] = {"server/sim/models/*.c",        "server/sim/solvers/*.c",
                                      "server/sim/effects/*.c",       "server/sim/implicit/implicit_solver.c",
                                      "server/sim/core/definition.c", "server/sim/springs/spring_law.c",
                                      "server/sim/elements/*.c"};

/* text of the file, zero at its end; NULL: cannot be read */
static char *read_text(const char *path)
{
    uint8_t *bytes;
    size_t n;
    if (pal_file_read(path, 1 << 20, &bytes, &n, NULL)) return NULL;
    char *text = malloc(n + 1);
    if (text) memcpy(text, bytes, n), text[n] = 0;
    free(bytes);
    return text;
}

/* all sources of components, one after another */
static char *read_sources(void)
{
    size_t n_all = 0;
    char *all = calloc(1, 1);
    for (size_t k = 0; k < sizeof sources / sizeof sources[0]; k++) {
        glob_t found;
        if (glob(sources[k], 0, NULL, &found)) continue;
        for (size_t i = 0; i < found.gl_pathc && all; i++) {
            char *text = read_text(found.gl_pathv[i]), *more = text ? realloc(all, n_all + strlen(text) + 1) : NULL;
            if (more) memcpy(more + n_all, text, strlen(text) + 1), n_all += strlen(text), all = more;
            free(text);
        }
        globfree(&found);
    }
    return all;
}

/* the next key that a call reads: the first text of a call of pal_entry_read_*, read_choice and the like, or an entry
 * of an array of keys; NULL: no other */
static const char *next_key(const char *at, char out[64])
{
    for (; (at = strstr(at, "read_")) != NULL; at++) {
        const char *open = at + 5, *end;
        while (isalnum((unsigned char)*open) || *open == '_') open++;
        if (strncmp(open, "(item, ", 7) != 0 && strncmp(open, "(entry, ", 8) != 0) continue;
        end = strchr(open, ';');
        const char *quote = strchr(open, '"');
        if (!end || !quote || quote > end) continue; /* the key is a variable: its callers have it */
        return sscanf(quote, "\"%63[a-zA-Z0-9_]\"", out) == 1 ? quote : NULL;
    }
    return NULL;
}

/* the rows of the table of entries, zero at its end; NULL: there is none */
static char *read_rows(char *text)
{
    char *table = text ? strstr(text, "| entry | key |") : NULL, *end = table ? strstr(table, "\n\n") : NULL;
    if (end) *end = 0;
    return end ? table : NULL;
}

static void every_key_that_is_read_has_a_row(void)
{
    char *text = read_text(readme), *rows = read_rows(text), *source = read_sources(), key[64], cell[80];
    int n = 0;
    REQUIRE(rows && source);
    for (const char *at = source; (at = next_key(at, key)) != NULL; n++) {
        snprintf(cell, sizeof cell, "| `%s` |", key);
        if (!strstr(rows, cell)) CHECK_FAIL("%s has no row for the key %s", readme, key);
    }
    CHECK_LE(80, n);
    free(text);
    free(source);
}

static void every_row_is_read_and_has_six_columns(void)
{
    char *text = read_text(readme), *rows = read_rows(text), *source = read_sources(), *save = NULL;
    int n = 0;
    REQUIRE(rows && source);
    for (char *line = strtok_r(rows, "\n", &save); line; line = strtok_r(NULL, "\n", &save)) {
        char kind[16], entry[64], key[64], literal[80];
        int n_bar = 0;
        for (const char *c = line; *c; c++) n_bar += *c == '|';
        CHECK_INT(n_bar, 7);
        if (sscanf(line, "| %15s `%63[^`]`", kind, entry) != 2) continue;
        snprintf(literal, sizeof literal, "\"%s\"", entry);
        if (!strstr(source, literal)) CHECK_FAIL("no %s is named %s", kind, entry);
        if (sscanf(line, "| %*s `%*[^`]` | `%63[^`]`", key) != 1) continue;
        n++;
        snprintf(literal, sizeof literal, "\"%s\"", key);
        if (!strstr(source, literal)) CHECK_FAIL("%s `%s` does not read %s", kind, entry, key);
    }
    CHECK_LE(100, n);
    free(text);
    free(source);
}

int main(void)
{
    RUN(every_key_that_is_read_has_a_row);
    RUN(every_row_is_read_and_has_six_columns);
    return check_report();
}
