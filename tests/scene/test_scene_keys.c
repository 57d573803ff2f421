/* README.md of the scene room documents every key that the reader takes, and no other. */
#include "server/mesh/files/file_bytes.h"
#include "server/scene/scene_keys.h"
#include "tests/check.h"

static const char readme[] = "server/scene/README.md";

/* text of the file, zero at its end; NULL: cannot be read */
static char *read_text(void)
{
    uint8_t *bytes;
    size_t n;
    if (pal_file_read(readme, 1 << 20, &bytes, &n, NULL)) return NULL;
    char *text = malloc(n + 1);
    if (text) memcpy(text, bytes, n), text[n] = 0;
    free(bytes);
    return text;
}

static void every_key_of_the_reader_has_a_row(void)
{
    char *text = read_text();
    REQUIRE(text);
    for (int object = 0; object < PAL_KEYS_OBJECTS; object++) {
        const char *path;
        for (const char *const *key = pal_scene_keys((pal_scene_object)object, &path); *key; key++) {
            char row[128];
            snprintf(row, sizeof row, "\n| `%s%s` |", path, *key);
            if (!strstr(text, row)) CHECK_FAIL("%s has no row for %s%s", readme, path, *key);
        }
    }
    free(text);
}

static bool is_taken(const char *name)
{
    for (int object = 0; object < PAL_KEYS_OBJECTS; object++) {
        const char *path;
        for (const char *const *key = pal_scene_keys((pal_scene_object)object, &path); *key; key++) {
            const size_t n = strlen(path);
            if (!strncmp(name, path, n) && !strcmp(name + n, *key)) return true;
        }
    }
    return false;
}

static void every_row_is_a_key_of_the_reader_and_has_five_columns(void)
{
    char *text = read_text(), *save = NULL;
    REQUIRE(text);
    int n_row = 0;
    char *table = strstr(text, "| key |"), *end = strstr(text, "\n## Keys of models");
    REQUIRE(table != NULL && end != NULL);
    *end = 0;
    for (char *line = strtok_r(table, "\n", &save); line; line = strtok_r(NULL, "\n", &save)) {
        char name[96];
        int n_bar = 0;
        for (const char *c = line; *c; c++) n_bar += *c == '|';
        CHECK_INT(n_bar, 6);
        if (sscanf(line, "| `%95[^`]`", name) != 1) continue;
        n_row++;
        if (!is_taken(name)) CHECK_FAIL("the reader does not take %s", name);
    }
    CHECK_LE(70, n_row);
    free(text);
}

int main(void)
{
    RUN(every_key_of_the_reader_has_a_row);
    RUN(every_row_is_a_key_of_the_reader_and_has_five_columns);
    return check_report();
}
