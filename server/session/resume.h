/* Goes on where a recording ends: after kill -9, a power cut, or an orderly end. The newest recording that a path names
 * gives the scene as edits and switches have left it, its materials and disabled components, the last state that it
 * holds, and the input after that, which is stepped again. Undo and redo of edits survive. What begins anew is what
 * components keep between steps: grasps, brushes, friction. Thread: [load]. */
#ifndef PAL_SESSION_RESUME_H
#define PAL_SESSION_RESUME_H
#include "server/session/configuration_switch.h"
#include "server/session/input_log.h"

typedef struct pal_resume pal_resume;

/* scene: as it was served first, borrowed until pal_resume_free. *out NULL: there is no recording. REFUSED: not a
 * recording, or of another scene */
pal_err pal_resume_open(const char *path, const pal_scene *scene, pal_diagnostic *diag, pal_resume **out);
/* after the session; what was taken stays */
void pal_resume_free(pal_resume *resume);
const pal_scene *pal_resume_scene(const pal_resume *resume); /* as it is now: of the session */
const char *pal_resume_name(const pal_resume *resume);       /* of the file */
double pal_resume_time_s(const pal_resume *resume);          /* simulated time at its end */

/* For who continues the edits of a body: all that its scene borrows, which lives as long as the session */
void pal_resume_take_edits(pal_resume *resume, int body, pal_sculptor **sculptor, pal_sculpt_edit **edit,
                           pal_configuration_switch **change, pal_body_def **base);
/* for the session: its world, the scene of its record's header, and the records with which its own begins */
pal_world *pal_resume_take_world(pal_resume *resume);
const pal_scene *pal_resume_recorded_scene(const pal_resume *resume);
void pal_resume_record(const pal_resume *resume, pal_input_log *log);
#endif
