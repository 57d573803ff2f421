/* A pass over an input log without a world: is it ordered, and within the scene's tools and bodies? Private to
 * server/session. Thread: any. */
#ifndef PAL_SESSION_LOG_CHECK_H
#define PAL_SESSION_LOG_CHECK_H
#include "server/session/input_log.h"

typedef struct pal_log_check {
    pal_input_header header;
    size_t n_good;     /* bytes up to its end, or its first bad record */
    uint64_t n_change; /* edits and switches */
    char cut[160];     /* where and how it is cut or damaged; "": it is whole */
} pal_log_check;

/* scene NULL: of any. REFUSED: not a log, of another scene, records were lost while it was written, or disordered */
pal_err pal_log_check_run(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene,
                          pal_log_check *out, pal_diagnostic *diag);
#endif
