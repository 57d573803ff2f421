/* A recording for a debrief: an input log in memory that plays from any moment, for any number of sessions. A seek
 * costs the edits before the moment, without their worlds, one world, and the steps since the last state in the log: at
 * most 0.7 s of processor time by PAL_STATE_WORK_NS, and as much for each grasp that is held then. Thread: [any], also
 * several at a time. */
#ifndef PAL_SESSION_RECORDING_H
#define PAL_SESSION_RECORDING_H
#include "server/session/resume.h"

typedef struct pal_recording pal_recording;

/* what happened in it: an edit, a switch, a material, a component, a reset */
typedef struct pal_recording_mark {
    double time_s;
    char text[32]; /* "paint", "material" */
} pal_recording_mark;

/* scene: as it was served, borrowed until close. REFUSED: not a recording, or of another scene. [load] */
pal_err pal_recording_open(const char *path, const pal_scene *scene, pal_diagnostic *diag, pal_recording **out);
void pal_recording_close(pal_recording *recording); /* after what was made from it; NULL is fine */
const char *pal_recording_name(const pal_recording *recording);
const char *pal_recording_cut(const pal_recording *recording); /* where and how it is cut; "": it is whole */
/* time of its beginning is 0 s */
double pal_recording_length_s(const pal_recording *recording);
double pal_recording_time_s(const pal_recording *recording, uint64_t step);
uint64_t pal_recording_step(const pal_recording *recording, double time_s); /* the nearest one; within its length */
/* the step behind an edit or a switch at `step`, from where it goes on soonest: of the state that follows it */
uint64_t pal_recording_behind(const pal_recording *recording, uint64_t step);
int pal_recording_states(const pal_recording *recording); /* states of all bodies from which it goes on */
const pal_recording_mark *pal_recording_marks(const pal_recording *recording, int *n); /* by time */
/* for pal_session_open_at; borrows from the recording. Errors of pal_resume_at */
pal_err pal_recording_seek(const pal_recording *recording, uint64_t step, bool records, pal_diagnostic *diag,
                           pal_resume **out);
#endif
