/* Files are kept in a small table; stat decides whether to read again. */
#include "server/net/transport/site.h"

#include "protocol/asset.h"

#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MAX_FILES = 512, MAX_FILE_BYTES = 16 << 20, MAX_BYTES = 64 << 20, ETAG = 48, PATH = 512 };

typedef struct entry {
    char path[PATH], etag[ETAG];
    struct timespec changed;
    pal_packet *bytes;
} entry;

struct pal_site {
    char root[PATH_MAX];
    int n_entry;
    size_t n_byte;
    entry entry[MAX_FILES];
};

/* content type by file extension; NULL: not declared */
static const char *type_of(const char *name)
{
    static const char *const types[][2] = {{".html", "text/html; charset=utf-8"},
                                           {".css", "text/css; charset=utf-8"},
                                           {".js", "text/javascript; charset=utf-8"},
                                           {".mjs", "text/javascript; charset=utf-8"},
                                           {".json", "application/json"},
                                           {".svg", "image/svg+xml"},
                                           {".png", "image/png"},
                                           {".ico", "image/x-icon"},
                                           {".wasm", "application/wasm"},
                                           {".bin", "application/octet-stream"}};
    const char *dot = strrchr(name, '.');
    for (size_t i = 0; dot && i < sizeof types / sizeof *types; i++)
        if (!strcmp(dot, types[i][0])) return types[i][1];
    return NULL;
}

static bool good_path(const char *path)
{
    if (*path != '/') return false;
    for (const char *c = path; *c; c++) {
        bool letter = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9');
        if (!letter && !strchr("@._-/", *c)) return false;
        if (*c == '/' && (c[1] == '.' || c[1] == '/')) return false;
    }
    return true;
}

pal_err pal_site_open(const char *folder, pal_diagnostic *diag, pal_site **out)
{
    pal_site *site = calloc(1, sizeof *site);
    pal_reply index = {.body = NULL};
    if (!site) return PAL_ERR_MEMORY;
    const char *fault = !realpath(folder, site->root)      ? "cannot be opened"
                        : !pal_site_get(site, "/", &index) ? "has no index.html"
                                                           : NULL;
    pal_packet_drop(index.body);
    if (fault) {
        free(site);
        return pal_diagnostic_set(diag, PAL_ERR_IO, "the viewer's folder %s %s", folder, fault);
    }
    *out = site;
    return PAL_ERR_OK;
}

void pal_site_close(pal_site *site)
{
    for (int i = 0; site && i < site->n_entry; i++) pal_packet_drop(site->entry[i].bytes);
    free(site);
}

/* opens a file that really lies inside the root; -1: no */
static int open_inside(const pal_site *site, const char *path, struct stat *stat)
{
    char full[2 * PATH_MAX], real[PATH_MAX];
    size_t n = strlen(site->root);
    snprintf(full, sizeof full, "%s%s", site->root, path);
    if (!realpath(full, real) || strncmp(real, site->root, n) || (real[n] != '/' && n > 1)) return -1;
    int fd = open(real, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd >= 0 && (fstat(fd, stat) || !S_ISREG(stat->st_mode) || stat->st_size > MAX_FILE_BYTES)) {
        close(fd);
        return -1;
    }
    return fd;
}

static pal_packet *read_all(int fd, size_t n_byte)
{
    pal_packet *p = pal_packet_create(NULL, n_byte, false);
    size_t at = 0;
    while (p && at < n_byte) {
        ssize_t n = read(fd, p->bytes + at, n_byte - at);
        if (n <= 0) {
            pal_packet_drop(p);
            return NULL;
        }
        at += (size_t)n;
    }
    return p;
}

static bool fill(pal_site *site, entry *e, int fd, const struct stat *stat)
{
    size_t n = (size_t)stat->st_size, old = e->bytes ? e->bytes->n_byte : 0;
    if (site->n_byte - old + n > MAX_BYTES) return false;
    pal_packet *bytes = read_all(fd, n);
    if (!bytes) return false;
    site->n_byte += n - old;
    pal_packet_replace(&e->bytes, bytes);
    e->changed = stat->st_mtim;
    e->etag[0] = '"';
    pal_asset_hash(bytes->bytes, n, e->etag + 1);
    memcpy(e->etag + 33, "\"", 2);
    return true;
}

bool pal_site_get(pal_site *site, const char *path, pal_reply *out)
{
    struct stat stat;
    entry *e = NULL;
    if (!strcmp(path, "/")) path = "/index.html";
    const char *type = type_of(path);
    if (!type || strlen(path) >= PATH || !good_path(path)) return false;
    int fd = open_inside(site, path, &stat);
    if (fd < 0) return false;
    for (int i = 0; i < site->n_entry && !e; i++)
        if (!strcmp(site->entry[i].path, path)) e = &site->entry[i];
    bool known = e != NULL, good = true;
    if (!known && site->n_entry < MAX_FILES) {
        e = &site->entry[site->n_entry];
        memcpy(e->path, path, strlen(path) + 1);
    }
    if (!e)
        good = false;
    else if (!known || (off_t)e->bytes->n_byte != stat.st_size || memcmp(&e->changed, &stat.st_mtim, sizeof e->changed))
        good = fill(site, e, fd, &stat);
    close(fd);
    if (!good) return false;
    if (!known) site->n_entry++;
    *out = (pal_reply){.status = 200, .type = type, .caching = "no-cache", .body = pal_packet_hold(e->bytes)};
    memcpy(out->etag, e->etag, sizeof e->etag);
    return true;
}
