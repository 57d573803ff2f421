/* A session: one world with a simulation thread, pacing and members.
 *
 * Pacing: steps are due at absolute times, one per scene step_s. A step that is too slow makes simulated time slow
 * down: the next step is due at once, missed steps are dropped, never queued; the frame says by how much (slowdown) and
 * how often (n_late: a step that begins a tenth of a step or more after its time). Input never queues up: a tool's
 * newest pose wins, and at most 64 commands are taken before a step.
 * While paused a frame is published when a command or pose came in; tools are then shown where they are held.
 * A tool whose holder has sent no pose for lease_s is let go (its force ramps out in 10 steps).
 * Crossing points between threads are triple buffer (poses, frames), ring (commands) and the wake callback; a lock
 * guards only the sentence of pal_session_last_diagnostic. No heap or file call after open until close, but when
 * somebody begins or ends to look at a field or an estimate, or a brush begins or has gone out: then its row (and a
 * field's place in frames) comes and goes, between two steps. Fields and estimates are no input: they are not in the
 * input log and change no hash. Brushes are. */
#ifndef PAL_SESSION_SESSION_H
#define PAL_SESSION_SESSION_H
#include "server/estimate/estimator.h"
#include "server/sim/core/effect.h"
#include "server/sim/world/world.h"

typedef struct pal_session pal_session;

typedef enum pal_command_kind {
    PAL_COMMAND_PAUSE,
    PAL_COMMAND_RESUME,
    PAL_COMMAND_STEP, /* one step while paused, nothing else */
    PAL_COMMAND_RESET,
    PAL_COMMAND_MATERIAL, /* body, material        */
    PAL_COMMAND_FIELD,    /* body, field, wanted: one more or one less who looks; the row is there while anybody does */
    PAL_COMMAND_BRUSH,    /* body, slot, brush: what the hand of tool `slot` does (world.h); letting the tool go or its
                             lease ends it, a reset as well, and a session that follows unless its carry hands it on */
    PAL_COMMAND_ESTIMATE, /* body, wanted: one more or one less who looks at its estimate; the estimator (estimator.h),
                             a thread and worlds of its own, is there while anybody does */
    PAL_COMMAND_RESET_BODY, /* body: that one alone back to rest and unfrozen (pal_world_reset_body) */
    PAL_COMMAND_COMPONENT,  /* body, row, wanted: switches a row of the plan off and on (world.h); recorded, kept by a
                         session that follows; why not: pal_session_last_diagnostic */
    PAL_COMMAND_COUNT
} pal_command_kind;

typedef struct pal_command {
    pal_command_kind kind;
    int body;
    pal_material material;
    pal_field field;
    bool wanted;
    int slot;
    pal_brush brush;
    char row[PAL_NAME];
} pal_command;

typedef struct pal_session_options {
    double lease_s; /* 0: 0.25                                                                   */
    bool start_paused;
    bool hold;                /* the thread does not run yet: pal_session_transfer starts it                 */
    bool only_observed;       /* what is shown is computed only while pal_session_observe says that somebody looks */
    bool unpaced;             /* step as fast as possible (tests, replay); frames are still newest-wins    */
    void (*wake)(void *user); /* [sim] called after a frame is published; must not block; NULL: nobody     */
    void *user;
    const char *record_path; /* write the input log there (replay.h); NULL: do not                        */
} pal_session_options;

/* builds the world and starts the thread; borrows the scene (and its meshes) until close. [load] */
pal_err pal_session_open(const pal_scene *scene, const pal_session_options *options, pal_diagnostic *diag,
                         pal_session **out);
/* opens a session for another scene with the options of a running one, with hold and without a record. [any] while no
 * other thread closes `before` */
pal_err pal_session_open_after(const pal_session *before, const pal_scene *scene, pal_diagnostic *diag,
                               pal_session **out);
/* Lets `next`, opened with hold, go on where `before` is, in two halves. carry_over stops the thread of before between
 * two steps, hands what was looked at and switched off over, and its world's state (carry; what it does not do is at
 * rest): as slow as carry is, and at most one step. go_on hands poses, orders and counts over and starts the thread of
 * next: short. The time in between counts for no lease, and rows that were switched off stay off, for good. A tool's
 * holder goes on sending poses and orders to before until go_on, to next from then on; before keeps its last frame and
 * can only be closed after go_on; a record ends there. INTERNAL: the thread could not be started, then before has gone
 * on. carry_over: [any], while others use before as they do, and nobody uses next; go_on: [net]; follow: both, where
 * there is time */
typedef void pal_session_transfer_fn(void *user, pal_world *next, const pal_world *before);
void pal_session_transfer_begin(pal_session *next, pal_session *before, pal_session_transfer_fn *carry, void *user);
pal_err pal_session_transfer_end(pal_session *next, pal_session *before, pal_diagnostic *diag);
pal_err pal_session_transfer(pal_session *next, pal_session *before, pal_session_transfer_fn *carry, void *user,
                             pal_diagnostic *diag);
/* Before the carry, so that it is short: the thread of before stops between two steps for `look`, which takes from its
 * world what it needs, and goes on while `rehearse` brings the world of next as near as it can. Over again, at most
 * PAL_SESSION_REHEARSALS_MAX times, as long as look says that it is worth it (the first says whether there is anything
 * to rehearse). [any] but go_on's, while others use before as they do, and nobody uses next */
enum { PAL_SESSION_REHEARSALS_MAX = 3 };
typedef bool pal_session_snapshot_fn(void *user, const pal_world *before);
typedef void pal_session_rehearse_fn(void *user, pal_world *next);
void pal_session_rehearse(pal_session *next, pal_session *before, pal_session_snapshot_fn *look,
                          pal_session_rehearse_fn *rehearse, void *user);
/* of one that has gone on: the longest time that its forerunner stood still for it, s, and rehearsals */
double pal_session_pause_s(const pal_session *session, int *n_rehearsed);
void pal_session_close(pal_session *session); /* stops and joins the thread; NULL is fine. [load] */

const pal_scene *pal_session_scene(const pal_session *session); /* [any] */
/* the plan at open and the shown parts: constant while the session lives (this release); frames name the rows that are
 * there now, with those of fields. [any] */
int pal_session_component_count(const pal_session *session);
void pal_session_component_info(const pal_session *session, int row,
                                pal_component_info *out); /* spent_ns is 0: see frames */
int pal_session_part_count(const pal_session *session);
void pal_session_shown(const pal_session *session, int part, pal_shown *out);
bool pal_session_has_field(const pal_session *session, int body, pal_field field); /* can it be shown? */

/* newest pose of a tool; latest wins, never waits; NULL lets go. REFUSED: not finite, out of reach, no such tool.
 * One thread at a time per tool. [net] */
pal_err pal_session_put_pose(pal_session *session, int tool, const pal_pose *pose);
/* taken between two steps. FULL when 64 are waiting; REFUSED for an unknown kind, body, material, field,
 * tool or brush. What only the world can tell (nothing within a brush's reach) is in pal_session_last_diagnostic. [any]
 */
pal_err pal_session_command(pal_session *session, const pal_command *command);
/* newest unseen frame or NULL; valid until the next call. One reader. [net] */
const pal_frame *pal_session_take_frame(pal_session *session);
/* one more (true) or one less who looks at the frames; counts only with the option only_observed, where it begins with
 * nobody: what is shown, skins above all, is then not computed, and frames bring positions as they were last (n_output
 * of a part stays). The first who comes gets a frame of the present within a step, paused or not. [any] */
void pal_session_observe(pal_session *session, bool looks);
/* did the thread tick in the last second (or is it paused)? for /healthz [any] */
bool pal_session_is_alive(const pal_session *session);
/* a body's material as the world has it: of the scene, or the last one that was not refused; copies. [any] */
void pal_session_material(pal_session *session, int body, pal_material *out);
/* newest estimate of a body's errors while somebody looks (PAL_COMMAND_ESTIMATE), of a state at most some hundreds of
 * ms old; false: nobody does, or there is none yet. A session that follows starts anew. Copies. [any] */
bool pal_session_estimate(pal_session *session, int body, pal_estimate *out);
/* last thing that went wrong in a command (a refused material or brush), "" when nothing; copies. [any] */
void pal_session_last_diagnostic(pal_session *session, pal_diagnostic *out);
#endif
