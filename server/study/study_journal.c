/* The journal of a study: records in memory have the layout of the file. */
#include "server/study/study_journal.h"

#include "server/mesh/files/file_bytes.h"
#include "server/study/study_store.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_RECORDS = 4096, MAX_NUMBERS = 1 << 24, HEAD = 28 };
static const size_t max_bytes = (size_t)1 << 30;
static const char magic[] = "palpate reference 1\n";

typedef struct record_head {
    uint64_t key;
    int32_t err, n_node;
    int64_t n;
    char reason[PAL_CONFIGURATION_TEXT];
} record_head;

struct pal_study_journal {
    FILE *file; /* NULL: nothing more is added */
    char path[PAL_STUDY_PATH + 16];
    int n, n_before;
    unsigned char *record[MAX_RECORDS]; /* header, numbers, hash */
};

static size_t size_of(int64_t n)
{
    return sizeof(record_head) + (size_t)n * sizeof(double) + sizeof(uint64_t);
}

static record_head head_of(const unsigned char *record)
{
    record_head head;
    memcpy(&head, record, sizeof head);
    return head;
}

/* bytes of the complete record that begins here; 0: none */
static size_t whole_record(const unsigned char *at, size_t left)
{
    uint64_t sum;
    if (left < size_of(0)) return 0;
    record_head head = head_of(at);
    bool sound = head.n >= 0 && head.n <= MAX_NUMBERS && head.err >= 0 && head.err < PAL_ERR_COUNT &&
                 head.n_node >= 0 && memchr(head.reason, 0, sizeof head.reason);
    size_t size = sound ? size_of(head.n) : 0;
    if (size == 0 || size > left) return 0;
    memcpy(&sum, at + size - sizeof sum, sizeof sum);
    return pal_study_digest(0, at, size - sizeof sum) == sum ? size : 0;
}

static pal_err keep(pal_study_journal *j, const unsigned char *record, size_t size)
{
    if (j->n == MAX_RECORDS || !(j->record[j->n] = malloc(size))) return PAL_ERR_MEMORY;
    memcpy(j->record[j->n++], record, size);
    return PAL_ERR_OK;
}

/* *whole: bytes of the file to keep; 0: another subject, or no file */
static pal_err take(pal_study_journal *j, uint64_t of, size_t *whole)
{
    unsigned char *bytes = NULL;
    size_t n_byte, size;
    *whole = 0;
    if (access(j->path, F_OK)) return PAL_ERR_OK;
    /* an unreadable file is overwritten like one of another subject */
    if (pal_file_read(j->path, max_bytes, &bytes, &n_byte, NULL)) return PAL_ERR_OK;
    pal_err err = PAL_ERR_OK;
    bool same =
        n_byte >= HEAD && !memcmp(bytes, magic, HEAD - sizeof of) && !memcmp(bytes + HEAD - sizeof of, &of, sizeof of);
    if (same)
        for (*whole = HEAD; !err && (size = whole_record(bytes + *whole, n_byte - *whole)) > 0; *whole += size)
            err = keep(j, bytes + *whole, size);
    free(bytes);
    j->n_before = j->n;
    return err;
}

pal_err pal_study_journal_open(const char *path, uint64_t of, bool again, pal_study_journal **out, pal_diagnostic *diag)
{
    pal_study_journal *j = calloc(1, sizeof *j);
    size_t whole = 0;
    *out = NULL;
    if (!j) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%.300s: no memory", path);
    snprintf(j->path, sizeof j->path, "%s", path);
    pal_err err = again ? PAL_ERR_OK : take(j, of, &whole);
    if (err) pal_diagnostic_set(diag, err, "%.300s: no memory for its records", path);
    if (!err) {
        j->file = fopen(path, whole ? "r+b" : "w+b");
        bool fine = j->file &&
                    (whole ? ftruncate(fileno(j->file), (off_t)whole) == 0 && fseek(j->file, (long)whole, SEEK_SET) == 0
                           : fwrite(magic, HEAD - sizeof of, 1, j->file) == 1 &&
                                 fwrite(&of, sizeof of, 1, j->file) == 1 && fflush(j->file) == 0);
        if (!fine) err = pal_diagnostic_set(diag, PAL_ERR_IO, "%.300s: %s", path, strerror(errno));
    }
    if (err)
        pal_study_journal_close(j);
    else
        *out = j;
    return err;
}

void pal_study_journal_close(pal_study_journal *j)
{
    if (!j) return;
    for (int k = 0; k < j->n; k++) free(j->record[k]);
    if (j->file) fclose(j->file);
    free(j);
}

bool pal_study_journal_find(const pal_study_journal *j, uint64_t key, pal_study_answer *answer, double *value, int n)
{
    for (int k = 0; k < j->n; k++) {
        record_head head = head_of(j->record[k]);
        if (head.key != key || head.n != n) continue;
        *answer = (pal_study_answer){.err = (pal_err)head.err, .n_node = head.n_node};
        memcpy(answer->reason, head.reason, sizeof answer->reason);
        memcpy(value, j->record[k] + sizeof head, (size_t)n * sizeof *value);
        return true;
    }
    return false;
}

pal_err pal_study_journal_add(pal_study_journal *j, uint64_t key, const pal_study_answer *answer, const double *value,
                              int n)
{
    record_head head;
    memset(&head, 0, sizeof head);
    head.key = key, head.err = answer->err, head.n_node = answer->n_node, head.n = n;
    snprintf(head.reason, sizeof head.reason, "%s", answer->reason);
    size_t size = size_of(n);
    unsigned char *record = n >= 0 && n <= MAX_NUMBERS ? malloc(size) : NULL;
    if (!record || !j->file) {
        free(record);
        return record ? PAL_ERR_IO : PAL_ERR_MEMORY;
    }
    memcpy(record, &head, sizeof head);
    memcpy(record + sizeof head, value, (size_t)n * sizeof *value);
    uint64_t sum = pal_study_digest(0, record, size - sizeof sum);
    memcpy(record + size - sizeof sum, &sum, sizeof sum);
    pal_err err = keep(j, record, size);
    if (!err && (fwrite(record, size, 1, j->file) != 1 || fflush(j->file) != 0)) err = PAL_ERR_IO;
    free(record);
    if (err) {
        fclose(j->file);
        j->file = NULL;
    }
    return err;
}

int pal_study_journal_count(const pal_study_journal *j, int *n_before)
{
    if (n_before) *n_before = j->n_before;
    return j->n;
}
