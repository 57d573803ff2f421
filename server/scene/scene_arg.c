/* Told apart by the name: *.json and folders are scenes, *.palcells are control cells, all else is a surface or scan.
 */
#include "server/scene/scene_arg.h"

#include "server/base/log.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static pal_err load(const char *word, const pal_surface_scene *options, pal_loaded_scene **out, bool *is_surface,
                    pal_surface_scene_report *report, pal_diagnostic *diag)
{
    static const pal_surface_scene plain = {.label = -1};
    char path[1200];
    struct stat facts;
    size_t n = strlen(word);
    bool folder = stat(word, &facts) == 0 && S_ISDIR(facts.st_mode);
    bool json = n > 5 && !strcmp(word + n - 5, ".json");
    bool cells = n > 9 && !strcmp(word + n - 9, ".palcells");
    if (is_surface) *is_surface = !folder && !json && !cells;
    if (!folder && cells) return pal_scene_from_cells(word, options ? options : &plain, out, diag);
    if (!folder && !json) return pal_scene_from_surface(word, options ? options : &plain, out, report, diag);
    int size = snprintf(path, sizeof path, folder ? "%s/scene.json" : "%s", word);
    if (size < 0 || (size_t)size >= sizeof path) return PAL_REFUSE(diag, "%.80s...: the path is too long", word);
    return pal_scene_load(path, out, diag);
}

pal_err pal_scene_arg(const char *word, const pal_surface_scene *options, pal_loaded_scene **out, bool *is_surface,
                      pal_surface_scene_report *report, pal_diagnostic *diag)
{
    PAL_TRY(load(word, options, out, is_surface, report, diag));
    for (int k = 0; k < (*out)->scene.n_body; k++) {
        pal_diagnostic reported;
        pal_loose_components_describe(&(*out)->loose[k], (*out)->scene.body[k].name, &reported);
        if (reported.text[0]) pal_log(PAL_LOG_WARN, "scene", "%s: %s", word, reported.text);
    }
    return PAL_ERR_OK;
}
