/* Replay of an input log (`palpate replay`). A log records each input of a session with its step, and a hash of the
 * world at intervals, so that a run can be repeated and compared. input_log.h describes the bytes. Reading is
 * bounds-checked, and each record may request only a bounded number of steps. A log that was cut (kill -9, a power cut,
 * a full disk) or damaged is replayed up to the last good record. Thread: [load]. */
#ifndef PAL_SESSION_REPLAY_H
#define PAL_SESSION_REPLAY_H
#include "server/session/session.h"

typedef struct pal_replay_report {
    uint64_t n_tick; /* steps taken */
    uint64_t n_pose, n_command, n_hash, n_hash_equal;
    uint64_t n_change;         /* edits and switches, each with another world */
    uint64_t first_difference; /* step of the first unequal hash, UINT64_MAX: none */
    uint64_t last_hash;        /* of the world at the end */
    /* where and how the log was cut or damaged, and the rest was not used; empty: it is whole */
    char cut[160];
} pal_replay_report;

/* size limit of a log: 1 GiB, about 10 h of eight busy tools */
#define PAL_REPLAY_BYTES_MAX ((size_t)1 << 30)

/* sees the world of a replay: after every step and before the next input. fraction: of the log's bytes. false: stop */
typedef struct pal_replay_watch {
    bool (*step)(void *user, const pal_world *world, double fraction);
    void *user;
    void (*end)(void *user, const pal_world *world); /* after the last input; NULL: none */
} pal_replay_watch;

/* Runs the log at path against a world of this scene. A different hash is not an error; the report gives it. REFUSED:
 * not a log, of another scene, or records were dropped while it was written; STATE: the watch stopped it;
 * IO; MEMORY; errors of pal_world_create. watch may be NULL. */
pal_err pal_replay_run(const char *path, const pal_scene *scene, const pal_replay_watch *watch, pal_replay_report *out,
                       pal_diagnostic *diag);
/* the same from memory; name appears in diagnostics; scene NULL: only checks that the log is complete */
pal_err pal_replay_parse(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene,
                         const pal_replay_watch *watch, pal_replay_report *out, pal_diagnostic *diag);
#endif
