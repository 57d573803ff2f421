/* The names of DICOM files and series are anybody's: dcm2niix gets the folder as an absolute path, so that no name is
 * read as a flag, and names its files by numbers of series alone. */
#include "server/mesh/scan/dicom_series.h"

#include "server/mesh/files/file_bytes.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum { NAMES = 160 };
static const size_t max_file = (size_t)4 << 30;

extern char **environ;

/* the exit code, 128 + a signal, or -1: it cannot be started, for errno */
static int run(const char *const *argv)
{
    posix_spawn_file_actions_t silent;
    pid_t pid;
    int status, error = posix_spawn_file_actions_init(&silent);
    if (error) return errno = error, -1;
    (void)posix_spawn_file_actions_addopen(&silent, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    (void)posix_spawn_file_actions_addopen(&silent, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    (void)posix_spawn_file_actions_addopen(&silent, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    error = posix_spawnp(&pid, argv[0], &silent, NULL, (char *const *)argv, environ);
    (void)posix_spawn_file_actions_destroy(&silent);
    if (error) return errno = error, -1;
    while (waitpid(pid, &status, 0) < 0)
        if (errno != EINTR) return -1;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

/* flags: no sidecar of texts, no compression, no defaults of the user; %s is the number of the series */
static pal_err convert(const char *folder, const char *to, int *code, pal_diagnostic *diag)
{
    char from[PATH_MAX];
    if (!realpath(folder, from)) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", folder, strerror(errno));
    const char *const argv[] = {"dcm2niix", "-g", "i", "-b", "n", "-z", "n", "-f", "%s", "-o", to, from, NULL};
    *code = run(argv);
    if (*code >= 0) return PAL_ERR_OK;
    if (errno == ENOENT || errno == EACCES)
        return PAL_REFUSE(diag, "%s: a folder is read as DICOM by dcm2niix, which is not installed", folder);
    return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: dcm2niix cannot be started: %s", folder, strerror(errno));
}

static int is_volume(const struct dirent *entry)
{
    return pal_file_ends_with(entry->d_name, ".nii");
}

static int is_file(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

/* "FOLDER/NAME" of the only volume, or the reason why there is none */
static pal_err find_volume(const char *folder, const char *made, int code, char path[PATH_MAX], pal_diagnostic *diag)
{
    struct dirent **list;
    char names[NAMES] = "";
    const int n = scandir(made, &list, is_volume, alphasort);
    if (n < 0) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", made, strerror(errno));
    for (int k = 0; k < n; k++) {
        const size_t used = strlen(names);
        snprintf(names + used, NAMES - used, "%s%.*s", k ? ", " : "", (int)strlen(list[k]->d_name) - 4,
                 list[k]->d_name);
        snprintf(path, PATH_MAX, "%s/%s", made, list[k]->d_name);
        free(list[k]);
    }
    free(list);
    if (n > 1)
        return PAL_REFUSE(diag, "%s: holds %d volumes, of series %s: put one into a folder of its own", folder, n,
                          names);
    if (n == 0)
        return PAL_REFUSE(diag, "%s: dcm2niix finds no DICOM series in this folder (its exit code is %d)", folder,
                          code);
    return PAL_ERR_OK;
}

static void remove_all(const char *folder)
{
    struct dirent **list;
    char path[PATH_MAX];
    const int n = scandir(folder, &list, is_file, NULL);
    for (int k = 0; k < n; k++) {
        if (snprintf(path, PATH_MAX, "%s/%s", folder, list[k]->d_name) < PATH_MAX) (void)unlink(path);
        free(list[k]);
    }
    if (n >= 0) free(list);
    (void)rmdir(folder);
}

pal_err pal_dicom_series_read(const char *folder, pal_label_volume *out, pal_diagnostic *diag)
{
    char made[PATH_MAX / 2], path[PATH_MAX];
    const char *temporary = getenv("TMPDIR");
    uint8_t *bytes;
    size_t n_byte;
    int code;
    snprintf(made, sizeof made, "%.1500s/palpate-dicom-XXXXXX", temporary && *temporary ? temporary : "/tmp");
    if (!mkdtemp(made)) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", made, strerror(errno));
    pal_err err = convert(folder, made, &code, diag);
    if (!err) err = find_volume(folder, made, code, path, diag);
    if (!err) err = pal_file_read(path, max_file, &bytes, &n_byte, diag);
    remove_all(made);
    PAL_TRY(err);
    err = pal_label_volume_parse(folder, bytes, n_byte, out, diag);
    free(bytes);
    if (!err) snprintf(out->format, sizeof out->format, "dicom");
    return err;
}

pal_err pal_scan_read(const char *path, pal_label_volume *out, pal_diagnostic *diag)
{
    struct stat facts;
    return !stat(path, &facts) && S_ISDIR(facts.st_mode) ? pal_dicom_series_read(path, out, diag)
                                                         : pal_label_volume_read(path, out, diag);
}
