/* One request to the REST port of the Agones sidecar, which listens on this machine: HTTP/1.1, a connection for each
 * request, an answer of a known length or in chunks. Thread: any, one at a time for each answer. */
#ifndef PAL_AGONES_SIDECAR_H
#define PAL_AGONES_SIDECAR_H
#include "server/agones/tuning.h"
#include "server/base/err.h"

#include <stddef.h>

typedef struct pal_sidecar_answer {
    int status;       /* of HTTP; 0: none */
    const char *body; /* in bytes, ended by a zero */
    size_t n_body;
    char bytes[PAL_SIDECAR_BYTES + 1];
} pal_sidecar_answer;

/* body NULL: none. Returns at once when stop_fd becomes readable. IO: nobody there, no whole answer in
 * PAL_SIDECAR_ANSWER_MS, or stopped; FULL: longer than PAL_SIDECAR_BYTES. A status of failure is no error */
pal_err pal_sidecar_call(int port, int stop_fd, const char *method, const char *path, const char *body,
                         pal_sidecar_answer *out);
#endif
