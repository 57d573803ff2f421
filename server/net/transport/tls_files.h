/* Certificate and key of a server. Thread: [load]. */
#ifndef PAL_NET_TRANSPORT_TLS_FILES_H
#define PAL_NET_TRANSPORT_TLS_FILES_H
#include "server/base/err.h"

/* REFUSED: a file that cannot be read or holds no certificate or key in PEM, or a key of another certificate; the
 * diagnostic names it */
pal_err pal_tls_files_check(const char *certificate, const char *key, pal_diagnostic *diag);
#endif
