#include "server/commands/served_scene.h"

#include "server/base/log.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

pal_err pal_served_scene_load(const pal_served_options *options, const char *word, pal_served_scene *served,
                              bool *is_surface, pal_surface_scene_report *report, pal_diagnostic *diag)
{
    memset(served, 0, sizeof *served);
    served->studied.picked = -1;
    *is_surface = false;
    if (!word) return pal_scene_procedural(&options->surface, &served->scene, report, diag);
    snprintf(served->word, sizeof served->word, "%s", word);
    return pal_scene_arg(word, &options->surface, &served->scene, is_surface, report, diag);
}

/* the configuration that the scene asks for, and those that its session may switch to */
static pal_err open_study(pal_served_scene *served, pal_diagnostic *diag)
{
    pal_studied_scene *s = &served->studied;
    s->scene = &served->scene->scene;
    if (!served->word[0]) return PAL_ERR_OK;
    PAL_TRY(pal_studied_scene_open(served->word, s->scene, s, diag));
    if (s->warn[0]) pal_log(PAL_LOG_WARN, "study", "%s", s->warn);
    if (s->summary[0]) pal_log(PAL_LOG_INFO, "study", "%s", s->summary);
    served->opened.study = (pal_session_study){.configuration = s->configuration,
                                               .n = s->n_configuration,
                                               .body = s->body,
                                               .reference_m = s->file ? s->file->study.reference_m : NAN};
    return PAL_ERR_OK;
}

/* at its beginning, paused; what goes on live from it is recorded */
static pal_err open_recording(const char *path, pal_served_scene *served, pal_session_options *session,
                              pal_diagnostic *diag)
{
    pal_recording *recording;
    PAL_TRY(pal_recording_open(path, served->studied.scene, diag, &recording));
    served->opened.recording = (pal_session_recording){recording, served->record[0] ? served->record : NULL};
    if (pal_recording_cut(recording)[0])
        pal_log(PAL_LOG_WARN, "replay", "%s is played up to its last whole record", pal_recording_cut(recording));
    pal_log(PAL_LOG_INFO, "replay", "%s: %.1f s", path, pal_recording_length_s(recording));
    session->plays = session->start_paused = true;
    return pal_recording_seek(recording, 0, false, diag, &served->resume);
}

pal_err pal_served_scene_open(const pal_served_options *options, pal_served_scene *served, pal_diagnostic *diag)
{
    pal_session_options session = {.wake = options->wake, .user = options->user, .only_observed = true};
    if (served->scene->scene.threads == 0) served->scene->scene.threads = options->threads;
    PAL_TRY(open_study(served, diag));
    const pal_scene *scene = served->studied.scene;
    PAL_TRY(pal_preflight_run(scene, &served->preflight, diag));
    if (options->record[0])
        snprintf(served->record, sizeof served->record, options->record_by_name ? "%s.%s" : "%s", options->record,
                 scene->name);
    if (options->resumes) PAL_TRY(pal_resume_open(served->record, scene, diag, &served->resume));
    if (served->resume)
        pal_log(PAL_LOG_INFO, "resume", "%s goes on where %s ends, after %.1f s", scene->name,
                pal_resume_name(served->resume), pal_resume_time_s(served->resume));
    if (options->replay) PAL_TRY(open_recording(options->replay, served, &session, diag));
    if (served->record[0] && !options->replay) session.record_path = served->record;
    session.resume = served->opened.resume = served->resume;
    return pal_session_open(served->resume ? pal_resume_scene(served->resume) : scene, &session, diag,
                            &served->opened.session);
}

void pal_served_scene_close(pal_served_scene *served)
{
    pal_resume_free(served->resume);
    pal_recording_close((pal_recording *)(uintptr_t)served->opened.recording.recording);
    pal_studied_scene_close(&served->studied);
    pal_scene_free(served->scene);
    memset(served, 0, sizeof *served);
}

/* ---- a folder of scenes ---- */

pal_err pal_scene_folder_check(const char *path, pal_diagnostic *diag)
{
    DIR *dir = opendir(path);
    if (!dir) return PAL_REFUSE(diag, "--scenes %s: %s", path, strerror(errno));
    closedir(dir);
    if (strlen(path) >= sizeof((pal_scene_folder *)0)->path) return PAL_REFUSE(diag, "--scenes: the path is too long");
    return PAL_ERR_OK;
}

static bool is_scene(const pal_scene_folder *folder, const char *name)
{
    static const char *const ends[] = {".json", ".palcells", ".obj", ".stl",    ".ply",  ".off",
                                       ".nii",  ".nii.gz",   ".inr", ".inr.gz", ".nrrd", ".mha"};
    char path[PATH_MAX];
    struct stat info;
    const size_t n = strlen(name);
    if (name[0] == '.' || n >= PAL_NAME) return false;
    for (const char *at = name; *at; at++)
        if (!isalnum((unsigned char)*at) && !strchr("._-", *at)) return false;
    bool is_file = false;
    for (size_t k = 0; k < sizeof ends / sizeof *ends; k++)
        is_file = is_file || (n > strlen(ends[k]) && !strcmp(name + n - strlen(ends[k]), ends[k]));
    snprintf(path, sizeof path, "%s/%.*s%s", folder->path, PAL_NAME, name, is_file ? "" : "/scene.json");
    return !stat(path, &info) && S_ISREG(info.st_mode); /* opening a pipe would wait */
}

static int compare(const void *a, const void *b)
{
    return strcmp(a, b);
}

static int list(void *user, char (*name)[PAL_NAME], int max)
{
    const pal_scene_folder *folder = user;
    DIR *dir = opendir(folder->path);
    int n = 0;
    if (!dir) return 0;
    for (struct dirent *entry; n < max && (entry = readdir(dir));)
        if (is_scene(folder, entry->d_name)) snprintf(name[n++], PAL_NAME, "%.*s", PAL_NAME - 1, entry->d_name);
    closedir(dir);
    qsort(name, (size_t)n, sizeof *name, compare);
    return n;
}

static pal_err open_scene(void *user, const char *scene, const char *session, pal_diagnostic *diag,
                          pal_opened_session *out)
{
    const pal_scene_folder *folder = user;
    char path[PATH_MAX];
    bool is_surface;
    pal_surface_scene_report report;
    pal_served_scene *served = calloc(1, sizeof *served);
    if (!served) return PAL_ERR_MEMORY;
    snprintf(path, sizeof path, "%s/%.*s", folder->path, PAL_NAME, scene);
    pal_err err = pal_served_scene_load(folder->options, path, served, &is_surface, &report, diag);
    if (!err) snprintf(served->scene->scene.name, PAL_NAME, "%s", session);
    if (!err) err = pal_served_scene_open(folder->options, served, diag);
    if (err) return pal_served_scene_close(served), free(served), err;
    pal_preflight_log(&served->preflight, session);
    *out = served->opened;
    out->keep = served;
    return PAL_ERR_OK;
}

static void close_scene(void *user, void *keep)
{
    (void)user;
    pal_served_scene_close(keep);
    free(keep);
}

pal_session_source pal_scene_folder_source(pal_scene_folder *folder)
{
    return (pal_session_source){.user = folder, .list = list, .open = open_scene, .close = close_scene};
}
