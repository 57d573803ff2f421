/* Goes on from a moment of a recording: from its end, after kill -9, a power cut or an orderly end (palpate serve
 * --resume), or from any moment (recording.h). The world is that of the scene as edits and switches have left it, with
 * its materials and disabled components, in the last state that the recording holds before the moment, and the input
 * after that is stepped again. Grasps that were held close again where they closed. Undo and redo of edits survive.
 * What begins anew is what other components keep between steps: brushes, friction. Thread: [any], one at a time. */
#ifndef PAL_SESSION_RESUME_H
#define PAL_SESSION_RESUME_H
#include "server/session/configuration_switch.h"
#include "server/session/input_log.h"

typedef struct pal_resume pal_resume;

/* From the end of the newest recording that a path names. scene: as it was served first, borrowed until
 * pal_resume_free. *out NULL: there is no recording. REFUSED: not a recording, or of another scene */
pal_err pal_resume_open(const char *path, const pal_scene *scene, pal_diagnostic *diag, pal_resume **out);
/* From the moment after `step` steps of a recording that was checked (log_check.h). Borrows name, bytes and scene until
 * pal_resume_free. records: the session's own record will begin here, so that its replay is equal, and no tool holds
 * anything; else it is made sooner, and tools hold what they held. Errors of pal_world_create */
pal_err pal_resume_at(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene, uint64_t step,
                      bool records, pal_diagnostic *diag, pal_resume **out);
/* after the session; what was taken stays */
void pal_resume_free(pal_resume *resume);
const pal_scene *pal_resume_scene(const pal_resume *resume); /* as it is now: of the session */
const char *pal_resume_name(const pal_resume *resume);       /* of the file */
double pal_resume_time_s(const pal_resume *resume);          /* simulated time at its moment, of its world */
void pal_resume_set_time_s(pal_resume *resume, double time_s);

/* For who continues the edits of a body: all that its scene borrows, which lives as long as the session */
void pal_resume_take_edits(pal_resume *resume, int body, pal_sculptor **sculptor, pal_sculpt_edit **edit,
                           pal_configuration_switch **change, pal_body_def **base);
/* for the session: its world, its disabled components, the scene of its record's header, the records with which its own
 * begins, and what follows in the recording after how many steps */
pal_world *pal_resume_take_world(pal_resume *resume);
int pal_resume_disabled(const pal_resume *resume, int k, const char **body, const char **component); /* number of all */
const pal_scene *pal_resume_recorded_scene(const pal_resume *resume);
void pal_resume_record(const pal_resume *resume, pal_input_log *log);
const uint8_t *pal_resume_rest(const pal_resume *resume, size_t *n_byte, uint64_t *step);
#endif
