/* Input log: what came into a session and at which tick, and the world's hash now and then, so that a run can be
 * repeated and compared (`palpate replay`). Little-endian records behind a header that names the scene; reading is
 * bounds-checked. Thread: writer [sim] (buffered, flushed by a thread of its own or at close: no file call in a step);
 * reader [load]. */
#ifndef PAL_SESSION_REPLAY_H
#define PAL_SESSION_REPLAY_H
#include "server/session/session.h"

typedef struct pal_replay_report {
    uint64_t n_tick, n_pose, n_command, n_hash, n_hash_equal;
    uint64_t first_difference; /* tick of the first unequal hash, UINT64_MAX: none */
    uint64_t last_hash;
} pal_replay_report;

/* runs the log at path against a world of this scene; REFUSED: not a log, cut, or of another scene */
pal_err pal_replay_run(const char *path, const pal_scene *scene, pal_replay_report *out, pal_note *note);
#endif
