/* A session: one world with its simulation thread, pacing and members.
 *
 * Pacing: steps are due at absolute times, one per step_s of the scene. When a step is too slow, simulated time slows
 * down: the next step is due at once, and missed steps are dropped, never queued. The frame reports the slowdown and
 * n_late, the number of steps that began a tenth of a step or more after their due time. Input does not accumulate:
 * the newest pose of a tool wins, and at most 64 commands are taken before a step. Only a pose at which a tool began or
 * ceased to grasp, or left, waits for a step of its own: what it grasps is where its button was pressed, however slow
 * the steps are, and a release between two steps is one. Of more than PAL_EDGES of them (signal_edges.h) the last
 * remain; a turn while paused takes them as a step does; a lease that expires drops them. While paused, a command or a
 * pose publishes a frame, in which tools follow their holders. A tool without a pose for lease_s is released; its force
 * ramps out over PAL_BLEND_S (server/sim/core/blend.h). While nothing moves (all bodies sleep, it is paused, or the
 * recording that it plays has ended) and nobody looks, holds a tool or gives a command, the thread rests for
 * PAL_REST_NS at a time; steps of that time are taken together, with one frame. Who comes ends such a rest at once.
 *
 * Threads exchange data through triple buffers (poses, frames), a command queue and the wake callback. A lock guards
 * only the diagnostic of pal_session_last_diagnostic, the materials, the place in a recording that plays, and a rest.
 * Between open and close the session neither allocates nor touches files, except when a subscription to a field or an
 * estimate begins or ends, or a brush begins or has faded: its component, and the field's part of the frames, are then
 * created or freed between two steps. Fields and estimates are not input: the input log does not record them and they
 * change no hash. Brushes are input. */
#ifndef PAL_SESSION_SESSION_H
#define PAL_SESSION_SESSION_H
#include "server/base/clock.h"
#include "server/estimate/estimator.h"
#include "server/sim/core/effect.h"
#include "server/sim/world/world.h"

typedef struct pal_session pal_session;

typedef enum pal_command_kind {
    PAL_COMMAND_PAUSE,
    PAL_COMMAND_RESUME,
    PAL_COMMAND_STEP,     /* one step while paused, else ignored */
    PAL_COMMAND_RESET,    /* the commands up to here name no body */
    PAL_COMMAND_MATERIAL, /* body, material        */
    PAL_COMMAND_FIELD, /* body, field, wanted: adds or removes a subscriber; the component exists while there is one */
    PAL_COMMAND_BRUSH, /* body, slot, brush: applies a brush with tool `slot` (world.h). It ends with the tool's release
                          or lease, a reset, and a transfer unless its function transfers brushes */
    PAL_COMMAND_ESTIMATE,   /* body, wanted: adds or removes a subscriber to the body's estimate; the estimator
                               (estimator.h), with its own thread and worlds, exists while there is one */
    PAL_COMMAND_RESET_BODY, /* body: that body alone back to rest and unfrozen (pal_world_reset_body) */
    PAL_COMMAND_COMPONENT,  /* body, component, wanted: disables or enables a component of the plan (world.h); recorded,
                               kept  by a transfer; pal_session_last_diagnostic gives the reason of a refusal */
    PAL_COMMAND_SPEED,      /* speed, PAL_SPEED_MIN to PAL_SPEED_MAX, of a recording that is played */
    PAL_COMMAND_COUNT
} pal_command_kind;

#define PAL_SPEED_MIN 0.1
#define PAL_SPEED_MAX 10.0

typedef struct pal_command {
    pal_command_kind kind;
    int body;
    pal_material material;
    pal_field field;
    bool wanted;
    int slot;
    pal_brush brush;
    char component[PAL_NAME];
    double speed;
    bool in_time; /* MATERIAL, COMPONENT: refused when it needs more sub-steps than before, and a step would be longer
                     than its time by what sub-steps take now */
} pal_command;

typedef struct pal_session_options {
    double lease_s; /* time without a pose after which a tool is released; 0: 0.25 */
    bool start_paused;
    bool hold;                /* the thread does not start; pal_session_transfer_end starts it */
    bool only_observed;       /* computes the displayed surfaces only while pal_session_observe has observers */
    bool unpaced;             /* steps as fast as possible (tests, replay); the newest frame still wins */
    void (*wake)(void *user); /* [sim] called after a frame is published; must not block; NULL: none */
    void *user;
    struct pal_resume
        *resume; /* the session goes on from a moment of a recording (resume.h), of whose scene it is; NULL: at rest */
    bool plays;  /* it plays the rest of that recording, which lives as long as the session, and takes no input of
                    members (pal_session_playing) */
    const char *record_path; /* path of the new input log (replay.h, input_log.h); NULL: none */
    const pal_clock *clock;  /* of pacing, leases, arrival times and estimates; NULL: pal_clock_monotonic */
} pal_session_options;

/* builds the world and starts the thread; borrows the scene and its meshes until close. [load] */
pal_err pal_session_open(const pal_scene *scene, const pal_session_options *options, pal_diagnostic *diag,
                         pal_session **out);
/* What replaces a session by another, for its record: an edit or a configuration (the other is NULL), and the materials
 * of the scene with which it was prepared [n_body]. Borrowed for the calls below, which take NULL too: the record ends
 */
typedef struct pal_session_change {
    int body;
    const struct pal_sculpt *edit;
    const struct pal_configuration *configuration;
    const pal_material *material;
} pal_session_change;
/* opens a session for another scene with the options of a running one, with hold set; the record goes on in it. [any],
 * while no other thread closes `before` */
pal_err pal_session_open_after(const pal_session *before, const pal_scene *scene, pal_diagnostic *diag,
                               pal_session **out);
/* Replaces the running session `before` with `next`, which was opened with hold, in two phases.
 *
 * transfer_begin stops the thread of before between two steps and transfers subscriptions, disabled components and the
 * state of the world (transfer; what it leaves out stays at rest). It takes as long as that and at most one step.
 * transfer_end transfers poses, commands and counters, and starts the thread of next; it is short. The pause between
 * the phases counts for no lease. Disabled components stay disabled.
 *
 * A tool's holder sends poses and commands to before until transfer_end, and to next from then on. before keeps its
 * last frame, its record goes on in next with the change in it, and after transfer_end it can only be closed. INTERNAL:
 * the thread could not be started; before then continues. transfer_begin: [any], while others use before as usual and
 * nobody uses next; transfer_end: [net]. */
typedef void pal_session_transfer_fn(void *user, pal_world *next, const pal_world *before);
void pal_session_transfer_begin(pal_session *next, pal_session *before, const pal_session_change *change,
                                pal_session_transfer_fn *transfer, void *user);
pal_err pal_session_transfer_end(pal_session *next, pal_session *before, pal_diagnostic *diag);
/* Shortens the transfer that follows. The thread of before stops between two steps for `snapshot`, which copies what it
 * needs from the world; before then continues while `rehearse` brings the world of next as close as it can. This
 * repeats while snapshot returns true, at most PAL_SESSION_REHEARSALS_MAX times; the first one decides whether to
 * rehearse at all. [any], but not the thread of transfer_end, while others use before as usual and nobody uses next */
enum { PAL_SESSION_REHEARSALS_MAX = 3 };
typedef bool pal_session_snapshot_fn(void *user, const pal_world *before);
typedef void pal_session_rehearse_fn(void *user, pal_world *next);
void pal_session_rehearse(pal_session *next, pal_session *before, const pal_session_change *change,
                          pal_session_snapshot_fn *snapshot, pal_session_rehearse_fn *rehearse, void *user);
/* of a session that has replaced another: longest pause of its predecessor, s, and the number of rehearsals */
double pal_session_pause_s(const pal_session *session, int *n_rehearsed);
/* The same for a session that goes on from a moment of a recording: with plays, it plays the rest, else it is live,
 * with a record at record_path (NULL: none). It keeps pace, observers and subscriptions of the other alone; the
 * functions below take no change and no transfer for it. */
pal_err pal_session_open_at(const pal_session *before, struct pal_resume *resume, bool plays, const char *record_path,
                            pal_diagnostic *diag, pal_session **out);
/* Stops and joins the thread and completes the record: the state of now, so that who goes on from it steps nothing
 * again, then END; afterwards it is on the disk. Views of the session and its last frame stay; input is ignored.
 * [load], or [net] while no job is under way */
void pal_session_finish(pal_session *session);
void pal_session_close(pal_session *session); /* finishes first; NULL is fine. [load] */

/* What plays, where, and how true. At an edit or a switch the session waits: another one has to go on behind it,
 * because it has another scene */
typedef struct pal_playing {
    enum { PAL_PLAYS_NOTHING, PAL_PLAYS, PAL_PLAYS_CHANGE, PAL_PLAYS_END } state; /* CHANGE: it waits before it */
    uint64_t step;                                                                /* of the recording */
    double speed;                                                                 /* wanted: simulated over real time */
    uint64_t n_hash, n_hash_equal; /* hashes of the recording that were passed, and those that were equal: all of them
                                      from its beginning to the first change or seek, any after */
} pal_playing;
void pal_session_playing(pal_session *session, pal_playing *out); /* copies. [any] */

/* errno of the first write of its record that failed, after which it records nothing; 0: none. [any] */
int pal_session_record_error(const pal_session *session);
const pal_scene *pal_session_scene(const pal_session *session); /* [any] */
const pal_clock *pal_session_clock(const pal_session *session); /* [any] */
/* time of a step under load as predicted when the session was opened (server/solve/preflight.h) over the time of a
 * step; NaN: unknown, as of a static solver or a resumed session. [any] */
double pal_session_predicted_load(const pal_session *session);
/* The plan at open and the displayed parts; constant while the session lives. Frames name the current components,
 * including those of fields. [any] */
typedef struct pal_session_outline {
    int n_component, n_part;
    pal_component_info *component; /* [n_component]; spent_ns is 0: see frames */
    pal_shown part[PAL_BODY_MAX];  /* [n_part] */
} pal_session_outline;
const pal_session_outline *pal_session_view_outline(const pal_session *session);
bool pal_session_has_field(const pal_session *session, int body, pal_field field); /* can it be displayed? */

/* Newest pose of a tool; the latest wins, but for edges of its grasp (above), never waits; NULL releases the tool.
 * REFUSED: not finite, out of reach, no such tool. One thread at a time per tool. [net] */
pal_err pal_session_request_pose(pal_session *session, int tool, const pal_pose *pose);
/* Queues a command, taken between two steps. FULL: 64 are pending; REFUSED: unknown kind, body, material, field, tool
 * or brush, or an input while a recording plays. pal_session_last_diagnostic reports what only the world can refuse
 * (nothing within reach of a brush). [any] */
pal_err pal_session_command(pal_session *session, const pal_command *command);
/* newest unseen frame or NULL; valid until the next call. One reader. [net] */
const pal_frame *pal_session_take_frame(pal_session *session);
/* Adds (true) or removes an observer of frames. Counts only with the option only_observed, which begins with none:
 * displayed surfaces, skins above all, are then not computed, and frames repeat the last positions (n_output of a part
 * does not grow). The first observer gets an up-to-date frame within a step, paused, at rest or not. true: it is the
 * first, so that the newest frame until then shows an old shape. [any] */
bool pal_session_observe(pal_session *session, bool observes);
/* did the thread tick within the last second, or is it paused? for /healthz [any] */
bool pal_session_is_alive(const pal_session *session);
/* current material of a body: of the scene, or the last one accepted; copies. [any] */
void pal_session_material(pal_session *session, int body, pal_material *out);
/* newest estimate of a body's errors, of a state at most some hundreds of ms old; copies. false: no subscriber
 * (PAL_COMMAND_ESTIMATE), or none yet. Estimation restarts after a transfer. [any] */
bool pal_session_estimate(pal_session *session, int body, pal_estimate *out);
/* last diagnostic of a command (a refused material or brush); "": none; copies. [any] */
void pal_session_last_diagnostic(pal_session *session, pal_diagnostic *out);
#endif
