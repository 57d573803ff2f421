/* Journal: text in the file, the results of one subject in memory. */
#include "server/calibrate/journal.h"

#include "server/base/hash.h"
#include "server/base/heap.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <sys/file.h>
#include <unistd.h>

enum { DIGITS = 16 };
static const char head[] = "palpate journal 1\n";

struct pal_journal {
    FILE *file;
    char path[512], subject[DIGITS + 2]; /* subject: digits and a blank */
    int n;
    char **record; /* "KEY = VALUE" [n] */
};

static pal_err no_io(const pal_journal *j, const char *what, pal_diagnostic *diag)
{
    return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s: %s", j->path, what, strerror(errno));
}

/* keeps the result of a sound line of n bytes */
static pal_err keep(pal_journal *j, const char *line, size_t n)
{
    if (!PAL_GROW(j->record, j->n)) return PAL_ERR_MEMORY;
    j->record[j->n] = strndup(line + DIGITS + 1, n - 2 * DIGITS - 2);
    return j->record[j->n] && ++j->n ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static void forget(pal_journal *j)
{
    while (j->n > 0) free(j->record[--j->n]);
}

/* compares with every key: a thousand comparisons take a thousandth of an evaluation */
const char *pal_journal_find(const pal_journal *j, const char *key)
{
    size_t n = strlen(key);
    for (int i = 0; i < j->n; i++)
        if (!strncmp(j->record[i], key, n) && !strncmp(j->record[i] + n, " = ", 3)) return j->record[i] + n + 3;
    return NULL;
}

int pal_journal_count(const pal_journal *j)
{
    return j->n;
}

static void check_of(const char *line, size_t n, char out[DIGITS + 1])
{
    snprintf(out, DIGITS + 1, "%016" PRIx64, pal_hash_bytes(PAL_HASH_START, line, n));
}

/* a line of n bytes without its end */
static bool is_sound(const char *line, size_t n)
{
    char check[DIGITS + 1];
    const char *equal = strstr(line, " = ");
    if (strlen(line) != n || !equal || equal < line + DIGITS || (size_t)(equal - line) + 3 + DIGITS >= n) return false;
    check_of(line, n - DIGITS, check);
    return line[DIGITS] == ' ' && line[n - DIGITS - 1] == ' ' && !strcmp(check, line + n - DIGITS);
}

/* Reads the header. True also for an empty file or an incomplete header. False: another file. */
static bool read_head(pal_journal *j)
{
    char begin[sizeof head] = "";
    rewind(j->file);
    size_t n = fread(begin, 1, sizeof head - 1, j->file);
    return !memcmp(begin, head, n) && (n == sizeof head - 1 || !ferror(j->file));
}

/* truncates the file after its last complete line, for appending */
static pal_err cut(pal_journal *j, long whole, pal_diagnostic *diag)
{
    if (fseek(j->file, 0, SEEK_SET) || ftruncate(fileno(j->file), whole)) return no_io(j, "cannot be cut", diag);
    if (fseek(j->file, 0, SEEK_END)) return no_io(j, "cannot be written", diag);
    if (whole == 0 && (fputs(head, j->file) == EOF || fflush(j->file))) return no_io(j, "cannot be written", diag);
    return PAL_ERR_OK;
}

pal_err pal_journal_begin(pal_journal *j, uint64_t subject, pal_diagnostic *diag)
{
    char *line = NULL;
    size_t room = 0;
    ssize_t n;
    long whole = 0;
    pal_err err = PAL_ERR_OK;
    forget(j);
    snprintf(j->subject, sizeof j->subject, "%016" PRIx64 " ", subject);
    rewind(j->file);
    for (int number = 1; !err && (n = getline(&line, &room, j->file)) > 0 && line[n - 1] == '\n'; number++) {
        whole += (long)n;
        line[--n] = 0;
        if (number == 1) continue; /* the header */
        if (!is_sound(line, (size_t)n))
            err = PAL_REFUSE(diag, "%s: line %d is damaged: its check does not agree", j->path, number);
        else if (!strncmp(line, j->subject, DIGITS + 1) && (err = keep(j, line, (size_t)n)))
            pal_diagnostic_set(diag, err, "%s: no memory for line %d", j->path, number);
    }
    if (!err && ferror(j->file)) err = no_io(j, "cannot be read", diag);
    free(line);
    return err ? err : cut(j, whole, diag);
}

pal_err pal_journal_put(pal_journal *j, const char *key, const char *value, pal_diagnostic *diag)
{
    if (pal_journal_find(j, key)) return PAL_ERR_OK;
    const size_t before = DIGITS + 1 + strlen(key) + 3 + strlen(value) + 1, n = before + DIGITS;
    char *line = malloc(n + 2);
    pal_err err = line ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) {
        snprintf(line, n, "%s%s = %s ", j->subject, key, value);
        check_of(line, before, line + before);
        err = keep(j, line, n);
    }
    if (err)
        pal_diagnostic_set(diag, err, "%s: no memory for a line", j->path);
    else if (fprintf(j->file, "%s\n", line) < 0 || fflush(j->file))
        err = no_io(j, "cannot be written", diag);
    free(line);
    return err;
}

pal_err pal_journal_open(const char *path, pal_journal **out, pal_diagnostic *diag)
{
    *out = NULL;
    pal_journal *j = calloc(1, sizeof *j);
    if (!j) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%.200s: no memory", path);
    snprintf(j->path, sizeof j->path, "%.400s", path);
    pal_err err = PAL_ERR_OK;
    j->file = fopen(path, "a+e");
    if (!j->file)
        err = no_io(j, "cannot be opened", diag);
    else if (flock(fileno(j->file), LOCK_EX | LOCK_NB))
        err = errno == EWOULDBLOCK
                  ? pal_diagnostic_set(diag, PAL_ERR_STATE, "%s: another process is writing there", j->path)
                  : no_io(j, "cannot be locked", diag);
    else if (!read_head(j))
        err = PAL_REFUSE(diag, "%s: is not a journal: it does not begin with \"palpate journal 1\"", j->path);
    if (err)
        pal_journal_close(j);
    else
        *out = j;
    return err;
}

void pal_journal_close(pal_journal *j)
{
    if (!j) return;
    if (j->file) fclose(j->file);
    forget(j);
    free(j->record);
    free(j);
}

char *pal_journal_text(const double *number, size_t n)
{
    char *text = NULL;
    size_t n_byte;
    FILE *to = open_memstream(&text, &n_byte);
    if (!to) return NULL;
    for (size_t i = 0; i < n; i++) fprintf(to, i ? " %a" : "%a", number[i]);
    if (fclose(to) == 0) return text;
    free(text);
    return NULL;
}

bool pal_journal_numbers(const char *text, double *out, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text) return false;
        text = end;
    }
    return true;
}
