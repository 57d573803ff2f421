/* Journal of evaluations: text in the file, a hash table of the points of one problem in memory. */
#include "server/calibrate/calibrate_journal.h"

#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

static const char head[] = "palpate journal 1\n";

struct pal_journal {
    FILE *file;
    char path[512];
    uint64_t problem;
    size_t n_parameter, n, max;
    double *theta, *cost; /* [n][n_parameter], [n]                                   */
    int64_t *slot;        /* index of a point, -1: free; open addressing [n_slot]  */
    size_t n_slot;        /* a power of two, more than twice n                      */
};

uint64_t pal_journal_hash(uint64_t before, const void *bytes, size_t n_byte)
{
    const unsigned char *at = bytes;
    uint64_t sum = before ^ 0xcbf29ce484222325u;
    for (size_t i = 0; i < n_byte; i++) sum = (sum ^ at[i]) * 0x100000001b3u;
    return sum;
}

/* ---- the points in memory ---- */

/* the slot of a point, or the free slot for it */
static size_t slot_of(const pal_journal *j, const double *theta)
{
    size_t n_byte = j->n_parameter * sizeof *theta, mask = j->n_slot - 1;
    uint64_t sum = pal_journal_hash(0, theta, n_byte);
    size_t at = (size_t)(sum ^ sum >> 32) & mask;
    while (j->slot[at] >= 0 && memcmp(j->theta + (size_t)j->slot[at] * j->n_parameter, theta, n_byte))
        at = (at + 1) & mask;
    return at;
}

static pal_err make_room(pal_journal *j)
{
    if (j->n < j->max) return PAL_ERR_OK;
    size_t more = j->max > 0 ? 2 * j->max : 256;
    double *theta = realloc(j->theta, more * j->n_parameter * sizeof *theta);
    if (theta) j->theta = theta;
    double *cost = theta ? realloc(j->cost, more * sizeof *cost) : NULL;
    if (cost) j->cost = cost;
    int64_t *slot = cost ? malloc(4 * more * sizeof *slot) : NULL;
    if (!slot) return PAL_ERR_MEMORY;
    free(j->slot);
    j->slot = slot;
    j->n_slot = 4 * more;
    j->max = more;
    for (size_t i = 0; i < j->n_slot; i++) slot[i] = -1;
    for (size_t i = 0; i < j->n; i++) slot[slot_of(j, theta + i * j->n_parameter)] = (int64_t)i;
    return PAL_ERR_OK;
}

static pal_err remember(pal_journal *j, const double *theta, double cost)
{
    if (make_room(j)) return PAL_ERR_MEMORY;
    size_t at = slot_of(j, theta);
    if (j->slot[at] >= 0) return PAL_ERR_OK;
    memcpy(j->theta + j->n * j->n_parameter, theta, j->n_parameter * sizeof *theta);
    j->cost[j->n] = cost;
    j->slot[at] = (int64_t)j->n++;
    return PAL_ERR_OK;
}

bool pal_journal_find(const pal_journal *j, const double *theta, double *cost)
{
    if (j->n_slot == 0) return false;
    int64_t at = j->slot[slot_of(j, theta)];
    if (at >= 0) *cost = j->cost[at];
    return at >= 0;
}

int64_t pal_journal_count(const pal_journal *j)
{
    return (int64_t)j->n;
}

/* ---- the file ---- */

static pal_err no_io(const pal_journal *j, const char *what, pal_diagnostic *diag)
{
    return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s: %s", j->path, what, strerror(errno));
}

/* sixteen digits and the character after them */
static bool read_digits(const char **at, char after, uint64_t *out)
{
    *out = 0;
    for (int i = 0; i < 16; i++, ++*at) {
        const char *digits = "0123456789abcdef", *digit = **at ? strchr(digits, **at) : NULL;
        if (!digit) return false;
        *out = *out << 4 | (uint64_t)(digit - digits);
    }
    return *(*at)++ == after;
}

/* a finite number and the blank after it */
static bool read_number(const char **at, double *out)
{
    char *end;
    if (**at != '-' && **at != '0') return false;
    *out = strtod(*at, &end);
    if (end == *at || *end != ' ' || !isfinite(*out)) return false;
    *at = end + 1;
    return true;
}

/* Parses one line without its end. NULL: valid; otherwise the fault. */
static const char *take_line(pal_journal *j, const char *line, size_t n, double *theta, pal_err *err)
{
    uint64_t problem, check;
    double cost = DBL_MAX;
    const char *at = n > 17 ? line + n - 16 : line, *tail = at;
    if (strlen(line) != n || n < 36 || at[-1] != ' ' || !read_digits(&tail, 0, &check))
        return "is cut or no line of it";
    if (check != pal_journal_hash(0, line, (size_t)(at - line))) return "is damaged: its check does not agree";
    at = line;
    if (!read_digits(&at, ' ', &problem)) return "does not begin with a problem";
    if (problem != j->problem) return NULL;
    for (size_t i = 0; i < j->n_parameter; i++)
        if (!read_number(&at, &theta[i])) return "has not as many constants as the problem";
    if (strncmp(at, "= ", 2)) return "has more constants than the problem";
    at += 2;
    if (strncmp(at, "none ", 5) && (!read_number(&at, &cost) || cost < 0)) return "has no error";
    *err = remember(j, theta, cost);
    return NULL;
}

/* Reads the header. True also for an empty file or an incomplete header. False: another file. */
static bool read_head(pal_journal *j)
{
    char begin[sizeof head] = "";
    rewind(j->file);
    size_t n = fread(begin, 1, sizeof head - 1, j->file);
    if (memcmp(begin, head, n)) return false;
    return n == sizeof head - 1 || !ferror(j->file);
}

/* Truncates the file after its last complete line, for appending. */
static pal_err cut(pal_journal *j, long whole, pal_diagnostic *diag)
{
    if (fseek(j->file, 0, SEEK_SET) || ftruncate(fileno(j->file), whole)) return no_io(j, "cannot be cut", diag);
    if (fseek(j->file, 0, SEEK_END)) return no_io(j, "cannot be written", diag);
    if (whole == 0 && (fputs(head, j->file) == EOF || fflush(j->file))) return no_io(j, "cannot be written", diag);
    return PAL_ERR_OK;
}

static pal_err read_lines(pal_journal *j, pal_diagnostic *diag)
{
    char *line = NULL;
    size_t room = 0;
    ssize_t n;
    long whole = 0;
    pal_err err = PAL_ERR_OK;
    double *theta = malloc(j->n_parameter * sizeof *theta);
    if (!theta) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", j->path);
    rewind(j->file);
    for (int64_t number = 1; !err && (n = getline(&line, &room, j->file)) > 0; number++) {
        if (line[n - 1] != '\n') break; /* incomplete line */
        line[n - 1] = 0;
        const char *wrong = number > 1 ? take_line(j, line, (size_t)n - 1, theta, &err) : NULL;
        if (wrong)
            err = pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: line %" PRId64 " %s", j->path, number, wrong);
        else if (err)
            pal_diagnostic_set(diag, err, "%s: no memory for line %" PRId64, j->path, number);
        whole += (long)n;
    }
    if (!err && ferror(j->file)) err = no_io(j, "cannot be read", diag);
    free(line);
    free(theta);
    return err ? err : cut(j, whole, diag);
}

pal_err pal_journal_begin(pal_journal *j, uint64_t problem, int n_parameter, pal_diagnostic *diag)
{
    free(j->theta);
    free(j->cost);
    free(j->slot);
    j->theta = j->cost = NULL;
    j->slot = NULL;
    j->n = j->max = j->n_slot = 0;
    j->problem = problem;
    j->n_parameter = (size_t)n_parameter;
    return read_lines(j, diag);
}

/* text of a line in a heap buffer; NULL: out of memory */
static char *write_line(const pal_journal *j, const double *theta, double cost, size_t *n_byte)
{
    char *text = NULL;
    FILE *to = open_memstream(&text, n_byte);
    if (!to) return NULL;
    fprintf(to, "%016" PRIx64 " ", j->problem);
    for (size_t i = 0; i < j->n_parameter; i++) fprintf(to, "%a ", theta[i]);
    if (cost < DBL_MAX)
        fprintf(to, "= %a ", cost);
    else
        fprintf(to, "= none ");
    if (fflush(to) == 0) fprintf(to, "%016" PRIx64 "\n", pal_journal_hash(0, text, *n_byte));
    if (fclose(to) == 0) return text;
    free(text);
    return NULL;
}

pal_err pal_journal_put(pal_journal *j, const double *theta, double cost, pal_diagnostic *diag)
{
    double known;
    size_t n_byte;
    if (pal_journal_find(j, theta, &known)) return PAL_ERR_OK;
    if (!(cost < DBL_MAX)) cost = DBL_MAX;
    char *text = write_line(j, theta, cost, &n_byte);
    if (!text || remember(j, theta, cost)) {
        free(text);
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a line", j->path);
    }
    bool written = fwrite(text, 1, n_byte, j->file) == n_byte && fflush(j->file) == 0;
    free(text);
    return written ? PAL_ERR_OK : no_io(j, "cannot be written", diag);
}

pal_err pal_journal_open(const char *path, pal_journal **out, pal_diagnostic *diag)
{
    pal_journal *j = calloc(1, sizeof *j);
    if (!j) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%.200s: no memory", path);
    snprintf(j->path, sizeof j->path, "%.400s", path);
    pal_err err = PAL_ERR_OK;
    j->file = fopen(path, "a+e");
    if (!j->file)
        err = no_io(j, "cannot be opened", diag);
    else if (flock(fileno(j->file), LOCK_EX | LOCK_NB))
        err = errno == EWOULDBLOCK
                  ? pal_diagnostic_set(diag, PAL_ERR_STATE, "%s: another calibration is writing there", j->path)
                  : no_io(j, "cannot be kept from others", diag);
    else if (!read_head(j))
        err = pal_diagnostic_set(diag, PAL_ERR_REFUSED,
                                 "%s: is not a journal: it does not begin with \"palpate journal 1\"", j->path);
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
    free(j->theta);
    free(j->cost);
    free(j->slot);
    free(j);
}
