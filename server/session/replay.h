/* Input log: what came into a session and at which step, and the world's hash now and then, so that a run can be
 * repeated and compared (`palpate replay`). The bytes are described in input_log.h: little-endian records behind a
 * header that knows the scene by its fingerprint. Reading is bounds-checked and a log never asks for more than a fixed
 * number of steps per record. Thread: [load]. */
#ifndef PAL_SESSION_REPLAY_H
#define PAL_SESSION_REPLAY_H
#include "server/session/session.h"

typedef struct pal_replay_report {
    uint64_t n_tick; /* steps taken                                             */
    uint64_t n_pose, n_command, n_hash, n_hash_equal;
    uint64_t first_difference; /* step of the first unequal hash, UINT64_MAX: none */
    uint64_t last_hash;        /* of the world at the end                        */
} pal_replay_report;

/* the most bytes of a log that is read: 1 GiB, about 10 h of eight busy tools */
#define PAL_REPLAY_BYTES_MAX ((size_t)1 << 30)

/* runs the log at path against a world of this scene. A hash that differs is no error: see the report. REFUSED: not a
 * log, cut, of another scene, or one that lost records while it was written; IO, MEMORY, and what pal_world_create
 * says */
pal_err pal_replay_run(const char *path, const pal_scene *scene, pal_replay_report *out, pal_diagnostic *diag);
/* the same from memory: name is used in messages; scene NULL only checks that the log is whole */
pal_err pal_replay_parse(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene,
                         pal_replay_report *out, pal_diagnostic *diag);
#endif
