/* Refuses what would lose a result or an input. */
#include "server/commands/calibrate_targets.h"

#include "server/scene/json_reader.h"
#include "server/scene/scene_file.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* grid: three numbers of 20 characters each fit into the 1 MiB of a scene file */
enum { MAX_GRID = 16000 };

static const char *const target_flag[PAL_CALIBRATE_FILES] = {"-o", "--trajectory", "--picture", "--vtk"};

/* do two paths name one file, whether it exists or not? */
static bool is_same_file(const char *a, const char *b)
{
    char real[2][PATH_MAX], folder[PATH_MAX];
    const char *path[2] = {a, b}, *name[2];
    for (int k = 0; k < 2; k++) {
        const char *slash = strrchr(path[k], '/');
        name[k] = slash ? slash + 1 : path[k];
        if (!pal_json_folder(path[k], folder, sizeof folder) || !realpath(folder, real[k])) return false;
    }
    return !strcmp(real[0], real[1]) && !strcmp(name[0], name[1]);
}

/* can a file of this name be written? Its folder is made. Refused before the search, not after it */
static pal_err check_target(const char *flag, const char *path, pal_diagnostic *diag)
{
    char folder[PAL_CALIBRATE_PATH];
    struct stat facts;
    if (!path) return PAL_ERR_OK;
    const char *slash = strrchr(path, '/');
    if (!pal_json_folder(path, folder, sizeof folder) || !path[0] || (slash && !slash[1]))
        return PAL_REFUSE(diag, "%s: \"%.80s\" is not the name of a file", flag, path);
    PAL_TRY(pal_scene_make_folder(folder, diag));
    if (access(folder, W_OK | X_OK))
        return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %.200s: cannot be written: %s", flag, path, strerror(errno));
    if (!stat(path, &facts) && S_ISDIR(facts.st_mode))
        return PAL_REFUSE(diag, "%s: %.200s is a folder, wanted a file in it", flag, path);
    if (!stat(path, &facts) && !S_ISREG(facts.st_mode))
        return PAL_REFUSE(diag, "%s: %.200s exists and is not a file", flag, path);
    return PAL_ERR_OK;
}

/* refuses an output that is also an input */
static pal_err check_source(const char *flag, const char *path, const char *source, const char *what,
                            pal_diagnostic *diag)
{
    char own[PATH_MAX], other[PATH_MAX];
    if (path && source && realpath(path, own) && realpath(source, other) && !strcmp(own, other))
        return PAL_REFUSE(diag, "%s: %.200s is the %s itself", flag, path, what);
    return PAL_ERR_OK;
}

pal_err pal_calibrate_targets_check(const pal_calibrate_run *run, pal_diagnostic *diag)
{
    char folder_scene[PATH_MAX];
    const int *grid = run->options.grid;
    snprintf(folder_scene, sizeof folder_scene, "%s/scene.json", run->input.problem);
    if ((int64_t)grid[0] * grid[1] * grid[2] > MAX_GRID)
        return PAL_REFUSE(diag, "--grid: %d x %d x %d nodes, more than the %d that a scene file holds", grid[0],
                          grid[1], grid[2], MAX_GRID);
    const char *const *path = run->path;
    for (int a = 0; a < PAL_CALIBRATE_FILES; a++) {
        PAL_TRY(check_target(target_flag[a], path[a], diag));
        PAL_TRY(check_source(target_flag[a], path[a], run->input.problem, "problem", diag));
        PAL_TRY(check_source(target_flag[a], path[a], run->input.truth, "truth", diag));
        PAL_TRY(check_source(target_flag[a], path[a], run->from, "recording", diag));
        PAL_TRY(check_source(target_flag[a], path[a], folder_scene, "scene that was recorded", diag));
        for (int b = 0; b < a && path[a]; b++)
            if (path[b] && is_same_file(path[a], path[b]))
                return PAL_REFUSE(diag, "%s: %.200s is the file of %s as well", target_flag[a], path[a],
                                  target_flag[b]);
    }
    return PAL_ERR_OK;
}

pal_err pal_calibrate_targets_check_named(const pal_calibrate_run *run, pal_diagnostic *diag)
{
    const pal_problem *p = run->set.problem;
    for (int a = 0; a < PAL_CALIBRATE_FILES; a++) {
        PAL_TRY(check_source(target_flag[a], run->path[a], p->surface, "problem's surface", diag));
        for (int k = 0; k < p->n_reference; k++)
            PAL_TRY(check_source(target_flag[a], run->path[a], p->reference[k].file, "problem's reference", diag));
    }
    return PAL_ERR_OK;
}
