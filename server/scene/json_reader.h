/* Checked reading of a JSON tree for scene files and what commands keep beside them: every refusal is "file:
 * entry.path: sentence". And numbers for a tree that is written. Thread: [load]. */
#ifndef PAL_SCENE_JSON_READER_H
#define PAL_SCENE_JSON_READER_H
#include "server/base/err.h"

#include <cjson/cJSON.h>
#include <stdbool.h>

enum { PAL_JSON_MAX_BYTES = 1 << 20, PAL_JSON_DEPTH = 16, PAL_JSON_PATH = 96, PAL_JSON_KEYS = 64 };

typedef struct pal_json {
    const char *file;     /* for messages */
    pal_diagnostic *diag; /* may be NULL  */
} pal_json;

/* reads a file of at most PAL_JSON_MAX_BYTES into *text (heap) and the name of its folder; REFUSED: the path is too
 * long; IO, BUDGET, MEMORY */
pal_err pal_json_read(const char *path, char *folder, size_t n_folder, char **text, size_t *n_byte,
                      pal_diagnostic *diag);
/* text -> tree, whose root is an object; size, depth, UTF-8 and what stands behind the root are checked before and
 * after cJSON sees it; REFUSED names the line. The caller deletes *out. */
pal_err pal_json_parse(const pal_json *json, const char *text, size_t n_byte, cJSON **out);

/* "file: path: sentence", REFUSED */
pal_err pal_json_refuse(const pal_json *json, const char *path, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* path of a key in an object ("" is the root) or of an entry in a list; returns out */
const char *pal_json_key(char out[PAL_JSON_PATH], const char *path, const char *key);
const char *pal_json_entry(char out[PAL_JSON_PATH], const char *path, int index);

/* is it an object with no key beside those of the NULL-terminated list, and none twice? known NULL: any key */
pal_err pal_json_object(const pal_json *json, const cJSON *object, const char *path, const char *const *known);
/* a key of an object; *out keeps its value when the key is absent */
pal_err pal_json_number(const pal_json *json, const cJSON *object, const char *path, const char *key, double low,
                        double high, double *out);
pal_err pal_json_count(const pal_json *json, const cJSON *object, const char *path, const char *key, int low, int high,
                       int *out);
pal_err pal_json_bool(const pal_json *json, const cJSON *object, const char *path, const char *key, bool *out);
pal_err pal_json_vector(const pal_json *json, const cJSON *object, const char *path, const char *key, double out[3]);
/* a text without control characters of at most n_byte - 1 bytes; empty only when allowed */
pal_err pal_json_text(const pal_json *json, const cJSON *object, const char *path, const char *key, bool may_be_empty,
                      char *out, size_t n_byte);
/* a list of at most `most` entries, NULL when the key is absent */
pal_err pal_json_list(const pal_json *json, const cJSON *object, const char *path, const char *key, int max,
                      const cJSON **out);

/* a number, a list of n numbers, with as many digits as give the same bits when they are read again (cJSON's own may
 * differ in the last place); null when it is not finite. NULL: no memory. The caller puts it into a tree */
cJSON *pal_json_exact(double number);
cJSON *pal_json_exact_list(const double *number, int n);
#endif
