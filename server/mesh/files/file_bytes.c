/* Whole files in and out; names and places in messages. */
#include "server/mesh/files/file_bytes.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

static pal_err read_open(int fd, const char *path, size_t limit, uint8_t **bytes, size_t *n_byte, pal_diagnostic *diag)
{
    struct stat info;
    if (fstat(fd, &info)) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    if (!S_ISREG(info.st_mode)) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: not a file", path);
    if ((uint64_t)info.st_size > limit)
        return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "%s: %lld bytes, at most %zu are read", path,
                                  (long long)info.st_size, limit);
    size_t n = 0, size = (size_t)info.st_size;
    uint8_t *all = malloc(size + 1);
    if (!all) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for %zu bytes", path, size);
    while (n < size) {
        ssize_t got = read(fd, all + n, size - n);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) {
            free(all);
            return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
        }
        if (got == 0) break;
        n += (size_t)got;
    }
    *bytes = all;
    *n_byte = n;
    return PAL_ERR_OK;
}

pal_err pal_file_read(const char *path, size_t limit, uint8_t **bytes, size_t *n_byte, pal_diagnostic *diag)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    pal_err err = read_open(fd, path, limit, bytes, n_byte, diag);
    close(fd);
    return err;
}

pal_err pal_file_begin(pal_file_out *out, const char *path, pal_diagnostic *diag)
{
    size_t n = strlen(path);
    if (n >= sizeof out->path) return pal_diagnostic_set(diag, PAL_ERR_IO, "%.100s...: the path is too long", path);
    struct stat info; /* the new file replaces the name: a device or a pipe of that name would be lost */
    if (!stat(path, &info) && !S_ISREG(info.st_mode))
        return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: not a file", path);
    memcpy(out->path, path, n + 1);
    snprintf(out->temporary, sizeof out->temporary, "%s.XXXXXX", out->path);
    int fd = mkstemp(out->temporary);
    if (fd < 0) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    /* mkstemp creates a file for its owner alone; set the permissions of a new file */
    mode_t mask = umask(0);
    umask(mask);
    fchmod(fd, 0666 & ~mask);
    out->file = fdopen(fd, "wb");
    if (out->file) return PAL_ERR_OK;
    close(fd);
    unlink(out->temporary);
    return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a stream", path);
}

pal_err pal_file_end(pal_file_out *out, pal_diagnostic *diag)
{
    bool bad = ferror(out->file) != 0;
    bad |= fclose(out->file) != 0;
    out->file = NULL;
    if (!bad && !rename(out->temporary, out->path)) return PAL_ERR_OK;
    pal_err err = pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", out->path, strerror(errno));
    unlink(out->temporary);
    return err;
}

pal_err pal_file_write(const char *path, const void *bytes, size_t n_byte, pal_diagnostic *diag)
{
    pal_file_out out;
    PAL_TRY(pal_file_begin(&out, path, diag));
    if (n_byte) fwrite(bytes, 1, n_byte, out.file);
    return pal_file_end(&out, diag);
}

void pal_file_put_line(FILE *file, const double *value, int n)
{
    for (int k = 0; k < n; k++) {
        char text[40];
        snprintf(text, sizeof text, "%.17g%c", value[k], k + 1 < n ? ' ' : '\n');
        for (char *c = text; *c; c++)
            if (*c == ',') *c = '.';
        fputs(text, file);
    }
}

bool pal_file_ends_with(const char *name, const char *tail)
{
    size_t n = strlen(name), m = strlen(tail);
    return n >= m && strcasecmp(name + n - m, tail) == 0;
}

void pal_file_printable_name(char out[128], const char *name)
{
    size_t n = strlen(name), from = n > 120 ? n - 117 : 0;
    snprintf(out, 128, "%s%s", from ? "..." : "", name + from);
    for (char *c = out; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7F) *c = '?';
}

pal_err pal_file_refuse(pal_diagnostic *diag, const char *name, const char *unit, int64_t at, const char *format, ...)
{
    char sentence[320];
    va_list list;
    va_start(list, format);
    vsnprintf(sentence, sizeof sentence, format, list);
    va_end(list);
    return PAL_REFUSE(diag, "%s: %s %lld: %s", name, unit, (long long)at, sentence);
}
