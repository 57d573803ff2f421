/* The struct of a session, shared by session_thread.c, session_pace.c, session_play.c and session_transfer.c. Private
 * to them. */
#ifndef PAL_SESSION_SESSION_CORE_H
#define PAL_SESSION_SESSION_CORE_H
#include "server/base/command_queue.h"
#include "server/base/signal_edges.h"
#include "server/base/triple_buffer.h"
#include "server/estimate/estimator_set.h"
#include "server/session/input_log.h"
#include "server/session/session.h"

#include <pthread.h>
#include <stdatomic.h>

enum { N_COMMAND = 64, N_MARK = 16, SECOND_NS = 1000000000 };

typedef struct requested_pose {
    pal_pose pose;
    uint64_t arrived_ns;
    bool present;
} requested_pose;

/* the newest pose of a tool, and those at which it began or ceased to grasp, or left */
typedef struct requested_poses {
    pal_signal_edges edges;
    requested_pose pose[PAL_EDGE_SLOTS];
} requested_poses;

typedef struct session_tool {
    pal_triple_buffer triple_buffer;
    requested_poses slot[3];
    requested_poses requested; /* the network thread's own */
    /* the simulation thread's own */
    const requested_poses *offered; /* slot that it has */
    uint64_t taken;                 /* number of the last pose that it took */
    pal_pose pose;
    uint64_t arrived_ns;
    bool present, brushes; /* brushes: a brush began since the last release */
    double seen_m[3];      /* of the last pose taken, applied or not           */
    uint64_t seen_ns;      /* when that arrived; 0: the tool was away           */
    uint64_t jumped_ns;    /* when the last one arrived that no hand can reach  */
} session_tool;

/* Disabled components of the plan, by name: they stay disabled across any number of successive sessions, including
 * sessions whose method has no such component */
enum { DISABLED_MAX = 64 };
typedef struct disabled_components {
    int n;
    struct {
        char body[PAL_NAME], component[PAL_NAME];
    } at[DISABLED_MAX]; /* any beyond these are enabled again by a switch */
} disabled_components;

/* a time, the number of steps taken until then, and their processor time */
typedef struct mark {
    uint64_t ns, step, work_ns;
} mark;

struct pal_session {
    const pal_scene *scene;
    pal_session_options options; /* owns record_path; clock is not NULL */
    pal_world *world;
    double reach_m;
    double predicted_ms; /* of a step under load, when the session was opened; NaN: unknown */
    uint64_t step_ns, lease_ns;
    pal_session_outline outline;
    disabled_components off; /* inherited from earlier sessions */
    bool gives[PAL_BODY_MAX][PAL_FIELD_COUNT];
    pthread_t thread;
    bool running; /* the thread exists: for the thread that opens, transfers and closes */

    /* crossing points */
    session_tool tool[PAL_TOOL_MAX];
    pal_command_queue *command;
    pal_frame *frame[3];
    pal_triple_buffer frames;
    _Atomic bool stop;
    _Atomic bool replaced; /* another session is about to replace this one */
    _Atomic uint64_t beat_ns, n_refused;
    _Atomic int n_observer; /* observers of frames; used with only_observed */
    _Atomic bool rests;     /* the thread sleeps for several steps, unless it is called */
    _Atomic bool called;    /* there is something to look at that no step has looked at */
    pthread_mutex_t lock;
    pthread_cond_t call;
    pal_playing playing; /* guarded by lock */
    pal_diagnostic diag;
    pal_material material[PAL_BODY_MAX]; /* guarded by lock */
    pal_estimator_set estimators;        /* subscribers to estimates */

    /* the simulation thread's own */
    pal_input_log *log;
    int record_error; /* errno of a record that is complete, or was to be; 0: none */
    /* the rest of a recording that is played, the next record, and the steps taken until now */
    const uint8_t *play;
    size_t n_play, play_at;
    uint64_t play_step;
    double speed; /* of simulated time while a recording plays */
    bool paused, observed;
    int single;                    /* single steps requested while paused */
    uint64_t step;                 /* taken since open; resets do not count */
    uint64_t state_step;           /* when the record gets the next state */
    uint64_t state_work_ns;        /* processor time of the steps since the last one */
    uint64_t n_late;               /* steps that began late */
    uint64_t work_ns, all_work_ns; /* processor time of the last step, of all since open */
    double substep_ns;             /* smoothed processor time of a sub-step while no body sleeps, at first as
                                      predicted; 0: unknown */
    uint64_t transferred_ns;       /* after a transfer: when the predecessor was asked to stop */
    uint64_t stopped_ns, pause_ns; /* when the predecessor had stopped, and the longest time that neither ran; for the
                                      thread that opens and transfers */
    int n_rehearsed;
    bool prepared, recorded; /* the record has the configuration, and the change, that made this session */
    uint64_t end_ns;
    uint32_t n_subscriber[PAL_BODY_MAX][PAL_FIELD_COUNT]; /* subscribers to a field */
    mark marks[N_MARK + 2];                               /* ring buffer, oldest at first */
    int first, n_marks;
};

static inline uint64_t session_now_ns(const pal_session *s)
{
    return pal_clock_now_ns(s->options.clock);
}

/* [sim] does its next turn make a step? It is not paused, and what it plays has not ended */
bool pal_session_moves(const pal_session *session);
/* [sim] Waits for the due time; a step at least one whole step late is due now, and the missed ones are dropped.
 * Returns how many steps are due, more than one after a rest; 0: the thread is to end */
int pal_session_pace(pal_session *session, uint64_t *due);
/* [sim] the pose that the next step takes; NULL: that of the last one */
const requested_pose *pal_session_next_pose(const session_tool *tool);
/* [any] There is something to look at: ends a rest, or keeps the next one from beginning. After what is to be seen,
 * which the next step then sees: [sim] clears `called` before it looks */
void pal_session_call(pal_session *session);
/* [sim] the newest diagnostic, for any thread to read */
void pal_session_put_diagnostic(pal_session *session, const pal_diagnostic *diag);
/* [sim] Takes the records of the recording that precede its next step (session_play.c); true: one changed the world. A
 * record that the world refuses ends it */
bool pal_session_play(pal_session *session);
/* for the thread that opens, transfers and closes; INTERNAL: the thread could not be started */
pal_err pal_session_start(pal_session *session, pal_diagnostic *diag);
void pal_session_stop(pal_session *session); /* between two steps; waits for the thread */
#endif
