/* Whole files in and out. A file appears whole or not at all: it is written under a temporary name beside the path and
 * then renamed. Thread: [load]. */
#ifndef PAL_MESH_FILES_FILE_BYTES_H
#define PAL_MESH_FILES_FILE_BYTES_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

/* whole file into memory (caller frees), at most limit bytes; IO, BUDGET, MEMORY */
pal_err pal_file_read(const char *path, size_t limit, uint8_t **bytes, size_t *n_byte, pal_diagnostic *diag);
/* writes to a temporary name beside path and renames, so that a reader never sees half a file; IO */
pal_err pal_file_write(const char *path, const void *bytes, size_t n_byte, pal_diagnostic *diag);

/* a file in the making, for the writers of this room */
typedef struct pal_file_out {
    FILE *file;
    char path[4096], temporary[4104];
} pal_file_out;

pal_err pal_file_begin(pal_file_out *out, const char *path, pal_diagnostic *diag);
/* closes; with every write good the file takes its name, else the temporary one is removed; IO */
pal_err pal_file_end(pal_file_out *out, pal_diagnostic *diag);

/* writes a line of n numbers of 17 digits, which read back equal, with a decimal point whatever the locale */
void pal_file_put_line(FILE *file, const double *value, int n);
/* does the name end like this, in any case? */
bool pal_file_ends_with(const char *name, const char *tail);

/* the name as messages show it: printable, one line, its end when it is long */
void pal_file_printable_name(char out[128], const char *name);
/* REFUSED with "NAME: UNIT AT: sentence"; unit is "line" or "byte", diag may be NULL */
pal_err pal_file_refuse(pal_diagnostic *diag, const char *name, const char *unit, int64_t at, const char *format, ...)
    __attribute__((format(printf, 5, 6)));
#endif
