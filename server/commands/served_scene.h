/* A scene from its word on the command line, or its name in a folder, to its session, as `palpate serve` makes it at
 * its start and while it runs. Thread: [load], or any other one at a time for each. */
#ifndef PAL_COMMANDS_SERVED_SCENE_H
#define PAL_COMMANDS_SERVED_SCENE_H
#include "server/commands/preflight_report.h"
#include "server/net/hub.h"
#include "server/scene/scene_arg.h"
#include "server/session/resume.h"
#include "server/study/studied_scene.h"

#include <limits.h>

typedef struct pal_served_options {
    pal_surface_scene surface; /* how bare surfaces are prepared */
    int threads;               /* of a scene that gives none */
    const char *record;        /* path of recordings; "": none */
    bool record_by_name;       /* the path gets the session's name */
    bool resumes;
    const char *replay; /* a recording that it plays; NULL: none */
    void (*wake)(void *user);
    void *user;
} pal_served_options;

typedef struct pal_served_scene {
    pal_loaded_scene *scene;
    char word[PATH_MAX];       /* "": the computed organ */
    pal_studied_scene studied; /* in the configuration that the scene asks for */
    pal_preflight preflight;
    pal_resume *resume; /* what the session goes on with; NULL: nothing */
    char record[PATH_MAX];
    pal_opened_session opened; /* keep: unset */
} pal_served_scene;

/* word NULL: the computed organ. is_surface, report: as of pal_scene_arg */
pal_err pal_served_scene_load(const pal_served_options *options, const char *word, pal_served_scene *served,
                              bool *is_surface, pal_surface_scene_report *report, pal_diagnostic *diag);
/* its study, preflight and session, whose name is scene->scene.name */
pal_err pal_served_scene_open(const pal_served_options *options, pal_served_scene *served, pal_diagnostic *diag);
/* all but the session, which is closed before; accepts a zeroed struct, and one that failed to open */
void pal_served_scene_close(pal_served_scene *served);

/* A folder of scenes, of which sessions are opened while the server runs: files that pal_scene_arg takes, and folders
 * with a scene.json. Names with other characters than letters, digits, ".", "_" and "-" are not among them */
typedef struct pal_scene_folder {
    char path[PATH_MAX - 256];
    const pal_served_options *options;
} pal_scene_folder;
pal_err pal_scene_folder_check(const char *path, pal_diagnostic *diag);
pal_session_source pal_scene_folder_source(pal_scene_folder *folder); /* borrows it */
#endif
