#include "server/net/admission/ticket_keys.h"

#include <string.h>

_Static_assert((int)PAL_KEY_BYTES == (int)PAL_TICKET_KEY_BYTES, "keys of a file sign tickets");

pal_err pal_ticket_keys_read(const char *path, pal_ticket_keys *keys, pal_diagnostic *diag)
{
    pal_keys read;
    PAL_TRY(pal_key_file_read(path, &read, diag));
    keys->n = read.n;
    for (int k = 0; k < read.n; k++) {
        keys->key[k].id = read.key[k].id;
        memcpy(keys->key[k].bytes, read.key[k].bytes, PAL_KEY_BYTES);
    }
    return PAL_ERR_OK;
}
