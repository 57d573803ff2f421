/* Checked reading of a JSON tree for scene files and what commands keep beside them: every refusal is "file:
 * entry.path: sentence". And numbers for a tree that is written. Thread: [load]. */
#ifndef PAL_SCENE_JSON_READER_H
#define PAL_SCENE_JSON_READER_H
#include "server/base/err.h"
#include "server/base/json_members.h"

#include <stdbool.h>

enum { PAL_JSON_MAX_BYTES = 1 << 20, PAL_JSON_DEPTH = 16, PAL_JSON_PATH = 96, PAL_JSON_KEYS = 64 };

/* a value of a tree and its path */
typedef struct pal_json {
    const char *file;         /* for messages */
    pal_diagnostic *diag;     /* may be NULL  */
    const char *folder;       /* of relative file names */
    const cJSON *value;       /* NULL: absent */
    char path[PAL_JSON_PATH]; /* "bodies[0].model"; "": the root */
    int index;                /* of an entry in its list */
} pal_json;

/* the folder of a file, "." for one without; false: longer than out */
bool pal_json_folder(const char *path, char *out, size_t n_byte);
/* reads a file of at most PAL_JSON_MAX_BYTES into *text (heap) and the name of its folder; REFUSED: the path is too
 * long; IO, BUDGET, MEMORY */
pal_err pal_json_read(const char *path, char *folder, size_t n_folder, char **text, size_t *n_byte,
                      pal_diagnostic *diag);
/* text -> tree, whose root is an object; size, depth, UTF-8 and text behind the root are checked before and
 * after cJSON sees it; REFUSED names the line. Sets the value of root, whose file, diag and folder are set, to *tree,
 * which the caller deletes */
pal_err pal_json_parse(pal_json *root, const char *text, size_t n_byte, cJSON **tree);

/* "file: path: sentence", REFUSED; and for a key of the object */
#define pal_json_refuse(at, ...) pal_json_refuse_key(at, "", __VA_ARGS__)
pal_err pal_json_refuse_key(const pal_json *at, const char *key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* an error of another reader, about the file that a key names; OK stays OK */
pal_err pal_json_forward(const pal_json *at, const char *key, pal_err err, const pal_diagnostic *reason);
/* the value of a key of an object, an entry of a list, and the loops over children and over entries with their paths */
pal_json pal_json_at(const pal_json *object, const char *key);
pal_json pal_json_entry(const pal_json *list, int index, const cJSON *value);
#define PAL_JSON_EACH(item, list)                                                                                      \
    for (const cJSON *item = (list)->value ? (list)->value->child : NULL; item; item = item->next)
#define PAL_JSON_ENTRIES(at, list)                                                                                     \
    for (pal_json at = pal_json_entry(list, 0, (list)->value ? (list)->value->child : NULL); at.value;                 \
         at = pal_json_entry(list, at.index + 1, at.value->next))

/* "a, b, c" of a NULL-terminated list, for the sentence about an unknown one; quote: around each */
void pal_json_list_words(const char *const *words, const char *quote, char *out, size_t n_byte);

/* is it an object with no key beside those of the NULL-terminated list, and none twice? known NULL: any key */
pal_err pal_json_object(const pal_json *at, const char *const *known);
bool pal_json_has(const pal_json *at, const char *key);
/* refuses an object without the key */
pal_err pal_json_need(const pal_json *at, const char *key);
/* a key of an object; *out keeps its value when the key is absent */
pal_err pal_json_number(const pal_json *at, const char *key, double low, double high, double *out);
pal_err pal_json_count(const pal_json *at, const char *key, int low, int high, int *out);
pal_err pal_json_bool(const pal_json *at, const char *key, bool *out);
pal_err pal_json_vector(const pal_json *at, const char *key, double out[3]);
/* two corners, the first nowhere above the second; both are required */
pal_err pal_json_box(const pal_json *at, const char *low_key, const char *high_key, double low[3], double high[3]);
/* a text without control characters of at most n_byte - 1 bytes; empty only when allowed. key "": `at` itself */
pal_err pal_json_text(const pal_json *at, const char *key, bool may_be_empty, char *out, size_t n_byte);
/* a file's name, in the folder unless it is absolute */
pal_err pal_json_file_name(const pal_json *at, const char *key, char *out, size_t n_byte);
/* a list of at most `max` entries; its value is NULL when the key is absent */
pal_err pal_json_list(const pal_json *at, const char *key, int max, pal_json *out);

/* a number, a list of n numbers, with as many digits as give the same bits when they are read again (cJSON's own may
 * differ in the last place); null when it is not finite. NULL: no memory. The caller puts it into a tree */
cJSON *pal_json_exact(double number);
cJSON *pal_json_exact_list(const double *number, int n);
#endif
