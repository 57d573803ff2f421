/* The viewer's files, read from one folder and cached in memory with a content hash as ETag.
 *
 * A path is served only when every segment consists of [A-Za-z0-9@._-] and does not begin with a dot, the file lies
 * inside the folder after symbolic links are resolved, and its type is declared. "/" is "/index.html". A changed file
 * is read again. At most 16 MiB per file, 64 MiB in total. Thread: [net]. */
#ifndef PAL_NET_TRANSPORT_SITE_H
#define PAL_NET_TRANSPORT_SITE_H
#include "server/base/err.h"
#include "server/net/transport/transport.h"

typedef struct pal_site pal_site;

/* IO: not a folder, or it has no index.html; copies folder. [load] */
pal_err pal_site_open(const char *folder, pal_diagnostic *diag, pal_site **out);
void pal_site_close(pal_site *site); /* NULL is fine */
/* path: as in the request, decoded, from the first slash; false: no such file. out->body belongs to the caller */
bool pal_site_get(pal_site *site, const char *path, pal_reply *out);
#endif
