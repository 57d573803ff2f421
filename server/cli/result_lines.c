/* Result lines: JSON in one file a shard, the results in memory by index. */
#include "server/cli/result_lines.h"

#include "server/base/hash.h"
#include "server/base/json_members.h"
#include "server/mesh/files/file_bytes.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PATH = 1400, COMMAND = 32, JSON_MAX_BYTE = 1 << 20 };
static const char format[] = "palpate-results-1";

struct pal_result_lines {
    char command[COMMAND], input[17];
    int n, shard, n_shard; /* shard 0: merged */
    cJSON **line;          /* parsed lines by index of their result [n] */
    FILE *file;            /* of the shard; NULL: merged */
    char path[PATH];       /* of that file; the folder: merged */
};

pal_err pal_shard_read(const char *text, int *shard, int *n_shard, pal_diagnostic *diag)
{
    char *slash, *end;
    long i = strtol(text, &slash, 10), n = 0;
    bool good = text[0] >= '0' && text[0] <= '9' && slash[0] == '/' && slash[1] >= '0' && slash[1] <= '9';
    if (good) n = strtol(slash + 1, &end, 10), good = !*end;
    if (!good) return PAL_REFUSE(diag, "--shard: \"%.40s\" is not I/N, as 1/4", text);
    if (n < 1 || n > PAL_SHARDS_MAX)
        return PAL_REFUSE(diag, "--shard: %.40s: the number of shards is outside 1 .. %d", text, PAL_SHARDS_MAX);
    if (i < 1 || i > n) return PAL_REFUSE(diag, "--shard: %.40s: shards are numbered from 1 to %ld", text, n);
    *shard = (int)i, *n_shard = (int)n;
    return PAL_ERR_OK;
}

pal_err pal_shard_flags_check(pal_shard_flags *flags, pal_diagnostic *diag)
{
    if (flags->merge && (flags->shard || flags->folder))
        return PAL_REFUSE(diag, "--merge: does not go with --shard and --results");
    if (!flags->shard != !flags->folder) return PAL_REFUSE(diag, "--shard and --results: go together");
    return flags->shard ? pal_shard_read(flags->shard, &flags->index, &flags->n, diag) : PAL_ERR_OK;
}

uint64_t pal_result_input_file(uint64_t hash, const char *path)
{
    struct stat state;
    uint8_t *bytes;
    size_t n_byte;
    hash = pal_hash_bytes(hash, path, strlen(path) + 1);
    if (stat(path, &state) || !S_ISREG(state.st_mode)) return hash;
    if (pal_file_read(path, (size_t)1 << 30, &bytes, &n_byte, NULL)) return hash;
    hash = pal_hash_bytes(hash, bytes, n_byte);
    free(bytes);
    return hash;
}

/* of the files that the texts of an item and of what it holds name, beside a file */
static uint64_t hash_named(uint64_t hash, const cJSON *item, const char *beside, int n_folder)
{
    char path[PATH];
    struct stat state;
    const char *text = cJSON_GetStringValue(item);
    if (text && text[0] && snprintf(path, PATH, "%.*s%s", text[0] == '/' ? 0 : n_folder, beside, text) < PATH &&
        !stat(path, &state) && S_ISREG(state.st_mode))
        hash = pal_result_input_file(hash, path);
    /* a parser of JSON has bounded the depth */
    for (const cJSON *child = item ? item->child : NULL; child; child = child->next)
        hash = hash_named(hash, child, beside, n_folder);
    return hash;
}

uint64_t pal_result_input_tree(uint64_t hash, const char *path)
{
    char file[PATH];
    struct stat state;
    uint8_t *bytes;
    size_t n_byte;
    const bool folder = !stat(path, &state) && S_ISDIR(state.st_mode);
    if (snprintf(file, PATH, folder ? "%s/scene.json" : "%s", path) >= PATH) return hash;
    hash = pal_result_input_file(hash, file);
    if (stat(file, &state) || !S_ISREG(state.st_mode) || state.st_size > JSON_MAX_BYTE) return hash;
    if (pal_file_read(file, JSON_MAX_BYTE, &bytes, &n_byte, NULL)) return hash;
    cJSON *root = cJSON_ParseWithLength((const char *)bytes, n_byte);
    const char *slash = strrchr(file, '/');
    hash = hash_named(hash, root, file, slash ? (int)(slash - file) + 1 : 0);
    cJSON_Delete(root);
    free(bytes);
    return hash;
}

static pal_err no_io(const char *path, const char *what, pal_diagnostic *diag)
{
    return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s: %s", path, what, strerror(errno));
}

static pal_err make(const pal_result_list *list, pal_result_lines **out, pal_diagnostic *diag)
{
    pal_result_lines *r = *out = calloc(1, sizeof *r);
    if (r) r->line = calloc((size_t)list->n + 1, sizeof *r->line);
    if (!r || !r->line) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d results", list->n);
    snprintf(r->command, sizeof r->command, "%s", list->command);
    snprintf(r->input, sizeof r->input, "%016" PRIx64, list->input);
    r->n = list->n;
    return PAL_ERR_OK;
}

static bool text_is(const cJSON *o, const char *key, const char *text)
{
    const char *value = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(o, key));
    return value && !strcmp(value, text);
}

static bool number_is(const cJSON *o, const char *key, int number)
{
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(o, key);
    return cJSON_IsNumber(value) && value->valuedouble == number;
}

static pal_err check_head(const pal_result_lines *r, const cJSON *o, const char *path, int shard, int n_shard,
                          pal_diagnostic *diag)
{
    if (!text_is(o, "format", format) || !text_is(o, "command", r->command))
        return PAL_REFUSE(diag, "%s: line 1 is not the head of results of palpate %s", path, r->command);
    if (!text_is(o, "input", r->input) || !number_is(o, "results", r->n))
        return PAL_REFUSE(diag, "%s: line 1: the results belong to other input files or flags", path);
    if (!number_is(o, "shard", shard) || !number_is(o, "of", n_shard))
        return PAL_REFUSE(diag, "%s: line 1: is not of shard %d of %d, as its name says", path, shard, n_shard);
    return PAL_ERR_OK;
}

/* takes a parsed line */
static pal_err keep(pal_result_lines *r, cJSON *o, const char *path, int number, int shard, int n_shard,
                    pal_diagnostic *diag)
{
    const cJSON *index = cJSON_GetObjectItemCaseSensitive(o, "index");
    const double value = cJSON_IsNumber(index) ? index->valuedouble : -1;
    const int k = value >= 0 && value < r->n ? (int)value : -1;
    if (k < 0 || k != value || k % n_shard != shard - 1 || r->line[k] ||
        !cJSON_GetObjectItemCaseSensitive(o, "result")) {
        cJSON_Delete(o);
        return PAL_REFUSE(diag, "%s: line %d is damaged: no result of this shard, or one that is there already", path,
                          number);
    }
    r->line[k] = o;
    return PAL_ERR_OK;
}

/* the complete lines; *whole: their bytes */
static pal_err read_lines(pal_result_lines *r, FILE *file, const char *path, int shard, int n_shard, long *whole,
                          pal_diagnostic *diag)
{
    char *line = NULL;
    size_t room = 0;
    ssize_t n;
    pal_err err = PAL_ERR_OK;
    *whole = 0;
    for (int number = 1; !err && (n = getline(&line, &room, file)) > 0 && line[n - 1] == '\n'; number++) {
        cJSON *o = cJSON_ParseWithLength(line, (size_t)n);
        if (!o)
            err = PAL_REFUSE(diag, "%s: line %d is damaged: it is not JSON", path, number);
        else if (number > 1)
            err = keep(r, o, path, number, shard, n_shard, diag);
        else
            err = check_head(r, o, path, shard, n_shard, diag), cJSON_Delete(o);
        *whole += (long)n;
    }
    if (!err && ferror(file)) err = no_io(path, "cannot be read", diag);
    free(line);
    return err;
}

/* writes a line to the disk, and takes it */
static pal_err write_line(const pal_result_lines *r, cJSON *o, pal_diagnostic *diag)
{
    if (!pal_json_write(r->file, o) || fsync(fileno(r->file))) return no_io(r->path, "cannot be written", diag);
    return PAL_ERR_OK;
}

static pal_err open_shard(pal_result_lines *r, pal_diagnostic *diag)
{
    long whole;
    r->file = fopen(r->path, "a+e");
    if (!r->file) return no_io(r->path, "cannot be opened", diag);
    if (flock(fileno(r->file), LOCK_EX | LOCK_NB))
        return errno == EWOULDBLOCK
                   ? pal_diagnostic_set(diag, PAL_ERR_STATE, "%s: another process computes this shard", r->path)
                   : no_io(r->path, "cannot be locked", diag);
    rewind(r->file);
    PAL_TRY(read_lines(r, r->file, r->path, r->shard, r->n_shard, &whole, diag));
    /* truncates the line that was being written when a process died */
    if (ftruncate(fileno(r->file), whole) || fseek(r->file, 0, SEEK_END))
        return no_io(r->path, "cannot be written", diag);
    if (whole > 0) return PAL_ERR_OK;
    return write_line(r,
                      PAL_JSON({"format", JSON_TEXT(format)}, {"command", JSON_TEXT(r->command)},
                               {"input", JSON_TEXT(r->input)}, {"results", JSON_NUMBER(r->n)},
                               {"shard", JSON_NUMBER(r->shard)}, {"of", JSON_NUMBER(r->n_shard)}),
                      diag);
}

pal_err pal_result_lines_open(const char *folder, const pal_result_list *list, int shard, int n_shard,
                              pal_result_lines **out, pal_diagnostic *diag)
{
    *out = NULL;
    if (mkdir(folder, 0777) && errno != EEXIST) return no_io(folder, "cannot be made", diag);
    pal_result_lines *r;
    pal_err err = make(list, &r, diag);
    if (!err) {
        r->shard = shard, r->n_shard = n_shard;
        int n = snprintf(r->path, PATH, "%s/%s-%d-of-%d.jsonl", folder, r->command, shard, n_shard);
        err = n < PATH ? open_shard(r, diag) : PAL_REFUSE(diag, "%.80s...: the path is too long", folder);
    }
    if (err)
        pal_result_lines_close(r);
    else
        *out = r;
    return err;
}

/* the number of shards that the names of the files state */
static pal_err count_shards(const pal_result_lines *r, const char *folder, int *n_shard, pal_diagnostic *diag)
{
    DIR *dir = opendir(folder);
    const struct dirent *entry;
    const size_t n = strlen(r->command);
    pal_err err = PAL_ERR_OK;
    if (!dir) return no_io(folder, "cannot be read", diag);
    *n_shard = 0;
    while (!err && (entry = readdir(dir))) {
        int shard, of, end = 0;
        if (strncmp(entry->d_name, r->command, n)) continue;
        if (sscanf(entry->d_name + n, "-%d-of-%d.jsonl%n", &shard, &of, &end) < 2 || !end ||
            entry->d_name[n + (size_t)end])
            continue;
        if (*n_shard && of != *n_shard)
            err = PAL_REFUSE(diag, "%s: holds shards of %d and of %d, which do not belong together", folder,
                             of < *n_shard ? of : *n_shard, of < *n_shard ? *n_shard : of);
        *n_shard = of;
    }
    closedir(dir);
    if (!err && (*n_shard < 1 || *n_shard > PAL_SHARDS_MAX))
        err = PAL_REFUSE(diag, "%s: holds no results of palpate %s", folder, r->command);
    return err;
}

static pal_err merge_shard(pal_result_lines *r, const char *folder, int shard, pal_diagnostic *diag)
{
    char path[PATH];
    long whole;
    if (snprintf(path, PATH, "%s/%s-%d-of-%d.jsonl", folder, r->command, shard, r->n_shard) >= PATH)
        return PAL_REFUSE(diag, "%.80s...: the path is too long", folder);
    FILE *file = fopen(path, "re");
    if (!file && errno == ENOENT)
        return PAL_REFUSE(diag, "%s: shard %d of %d is missing: run it with --shard %d/%d", folder, shard, r->n_shard,
                          shard, r->n_shard);
    if (!file) return no_io(path, "cannot be opened", diag);
    pal_err err = read_lines(r, file, path, shard, r->n_shard, &whole, diag);
    fclose(file);
    return err;
}

pal_err pal_result_lines_merge(const char *folder, const pal_result_list *list, pal_result_lines **out,
                               pal_diagnostic *diag)
{
    pal_result_lines *r;
    *out = NULL;
    pal_err err = make(list, &r, diag);
    if (!err) snprintf(r->path, PATH, "%s", folder);
    if (!err) err = count_shards(r, folder, &r->n_shard, diag);
    for (int shard = 1; !err && shard <= r->n_shard; shard++) err = merge_shard(r, folder, shard, diag);
    if (err)
        pal_result_lines_close(r);
    else
        *out = r;
    return err;
}

pal_err pal_result_lines_complete(const pal_result_lines *r, int n, pal_diagnostic *diag)
{
    for (int k = 0; k < n; k++)
        if (k >= r->n || !r->line[k])
            return PAL_REFUSE(diag, "%s: shard %d of %d is unfinished: result %d is missing; run it with --shard %d/%d",
                              r->path, k % r->n_shard + 1, r->n_shard, k, k % r->n_shard + 1, r->n_shard);
    return PAL_ERR_OK;
}

void pal_result_lines_close(pal_result_lines *r)
{
    if (!r) return;
    if (r->file) fclose(r->file);
    for (int k = 0; k < r->n && r->line; k++) cJSON_Delete(r->line[k]);
    free(r->line);
    free(r);
}

bool pal_result_lines_own(const pal_result_lines *r, int index)
{
    return r->shard == 0 || index % r->n_shard == r->shard - 1;
}

const cJSON *pal_result_lines_find(const pal_result_lines *r, int index)
{
    return cJSON_GetObjectItemCaseSensitive(r->line[index], "result");
}

double pal_result_number(const cJSON *result, const char *key)
{
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(result, key);
    return cJSON_IsNumber(value) ? value->valuedouble : NAN;
}

pal_err pal_result_lines_put(pal_result_lines *r, int index, cJSON *result, pal_diagnostic *diag)
{
    cJSON *o = result ? PAL_JSON({"index", JSON_NUMBER(index)}, {"result", result}) : NULL;
    if (!o) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for result %d", r->path, index);
    PAL_TRY(write_line(r, cJSON_Duplicate(o, true), diag));
    r->line[index] = o;
    return PAL_ERR_OK;
}
