#include "server/base/key_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

enum { LINE = 256, ID_MAX = 255 };

pal_err pal_random_bytes(void *bytes, size_t n_byte)
{
    return getrandom(bytes, n_byte, 0) == (ssize_t)n_byte ? PAL_ERR_OK : PAL_ERR_IO;
}

/* value of a hexadecimal digit; -1: it is none */
static int digit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

static bool read_hex(const char *text, uint8_t bytes[PAL_KEY_BYTES])
{
    for (int i = 0; i < PAL_KEY_BYTES; i++) {
        const int high = digit(text[2 * i]), low = high < 0 ? -1 : digit(text[2 * i + 1]);
        if (low < 0) return false;
        bytes[i] = (uint8_t)(16 * high + low);
    }
    return text[2 * PAL_KEY_BYTES + strspn(text + 2 * PAL_KEY_BYTES, " \t\r\n")] == 0;
}

static pal_err read_line(const char *path, int line, const char *text, pal_keys *keys, pal_diagnostic *diag)
{
    int id = 0, n = 0;
    text += strspn(text, " \t\r\n");
    if (!*text || *text == '#') return PAL_ERR_OK;
    if (keys->n == PAL_KEYS_MAX) return PAL_REFUSE(diag, "%s: line %d: more than %d keys", path, line, PAL_KEYS_MAX);
    pal_key *key = &keys->key[keys->n];
    if (sscanf(text, "%3d %n", &id, &n) != 1 || id < 1 || id > ID_MAX || !n || !read_hex(text + n, key->bytes))
        return PAL_REFUSE(diag, "%s: line %d is not an id from 1 to %d and 64 hexadecimal digits", path, line, ID_MAX);
    key->id = (uint8_t)id;
    for (int k = 0; k < keys->n; k++)
        if (keys->key[k].id == id) return PAL_REFUSE(diag, "%s: line %d: key %d comes twice", path, line, id);
    keys->n++;
    return PAL_ERR_OK;
}

/* an open key file that only its owner can read; NULL: *diag says why */
static FILE *open_keys(const char *path, int flags, pal_diagnostic *diag)
{
    struct stat info;
    int fd = open(path, flags | O_CLOEXEC | O_NONBLOCK, 0600);
    FILE *file = NULL;
    if (fd < 0 || fstat(fd, &info))
        (void)PAL_REFUSE(diag, "%s cannot be opened: %s", path, strerror(errno));
    else if (!S_ISREG(info.st_mode))
        (void)PAL_REFUSE(diag, "%s is no file", path);
    else if (info.st_mode & 077)
        (void)PAL_REFUSE(diag, "%s may be read or written by others (mode %03o): chmod 600 %s", path,
                         info.st_mode & 0777, path);
    else if (info.st_uid != geteuid() && info.st_uid != 0)
        (void)PAL_REFUSE(diag, "%s belongs to another user (%u)", path, (unsigned)info.st_uid);
    else
        file = fdopen(fd, (flags & O_ACCMODE) == O_RDONLY ? "r" : "a+");
    if (!file && fd >= 0) close(fd);
    return file;
}

static pal_err read_all(FILE *file, const char *path, pal_keys *keys, pal_diagnostic *diag)
{
    char text[LINE];
    pal_err err = PAL_ERR_OK;
    keys->n = 0;
    rewind(file);
    for (int line = 1; !err && fgets(text, sizeof text, file); line++) err = read_line(path, line, text, keys, diag);
    return err;
}

pal_err pal_key_file_read(const char *path, pal_keys *keys, pal_diagnostic *diag)
{
    pal_keys read;
    FILE *file = open_keys(path, O_RDONLY, diag);
    if (!file) return PAL_ERR_REFUSED;
    pal_err err = read_all(file, path, &read, diag);
    fclose(file);
    if (!err && read.n == 0) err = PAL_REFUSE(diag, "%s holds no key: palpate ticket --new-key adds one", path);
    if (!err) *keys = read;
    return err;
}

pal_err pal_key_file_add(const char *path, int *id, pal_diagnostic *diag)
{
    pal_keys keys;
    uint8_t bytes[PAL_KEY_BYTES];
    FILE *file = open_keys(path, O_RDWR | O_CREAT | O_APPEND, diag);
    if (!file) return PAL_ERR_REFUSED;
    pal_err err = read_all(file, path, &keys, diag);
    int next = 1;
    for (int k = 0; !err && k < keys.n; k++)
        if (keys.key[k].id >= next) next = keys.key[k].id + 1;
    if (!err && (next > ID_MAX || keys.n == PAL_KEYS_MAX))
        err = PAL_REFUSE(diag, "%s: there is no room for another key: remove old ones", path);
    if (!err) err = pal_random_bytes(bytes, sizeof bytes);
    if (!err) {
        fprintf(file, "%d ", next);
        for (size_t i = 0; i < sizeof bytes; i++) fprintf(file, "%02x", bytes[i]);
        fputc('\n', file);
    }
    if (fclose(file) && !err) err = pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    if (!err) *id = next;
    return err;
}
