/* Key file: one key a line, "ID HEX", with ID from 1 to 255 and 64 hexadecimal digits; "#" begins a comment. Nobody but
 * its owner may read or write it. The last key signs; what any key in the file has signed is accepted. To replace a
 * key, add one, and remove the old one when nothing that it has signed is wanted any more. */
#ifndef PAL_BASE_KEY_FILE_H
#define PAL_BASE_KEY_FILE_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum { PAL_KEYS_MAX = 16, PAL_KEY_BYTES = 32 };

typedef struct pal_key {
    uint8_t id;
    uint8_t bytes[PAL_KEY_BYTES];
} pal_key;

typedef struct pal_keys {
    int n;
    pal_key key[PAL_KEYS_MAX];
} pal_keys;

/* REFUSED names file, line and reason; also a file that others may read. Thread: any */
pal_err pal_key_file_read(const char *path, pal_keys *keys, pal_diagnostic *diag);
/* appends a random key to the file, which is made when it is not there; *id: its id. REFUSED, IO. Thread: any */
pal_err pal_key_file_add(const char *path, int *id, pal_diagnostic *diag);
/* fills bytes from the system's random generator; IO. Thread: any */
pal_err pal_random_bytes(void *bytes, size_t n_byte);
#endif
