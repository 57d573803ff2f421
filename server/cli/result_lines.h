/* Results of a long list of independent computations, divided into shards that run in separate processes. Result k of a
 * list belongs to shard k mod N + 1 of N. A shard appends each result to its own file
 *
 *   FOLDER/COMMAND-I-of-N.jsonl
 *   {"format": "palpate-results-1", "command": "robustness", "input": "16 hex digits",
 *    "results": 12, "shard": 1, "of": 4}   (in one line)
 *   {"index": 0, "result": {...}}
 *
 * and synchronises it to the disk, so that a process that dies loses only the result it was computing. A shard started
 * again keeps the results of its file. An incomplete last line is truncated. The bytes are untrusted. Thread: [load].
 */
#ifndef PAL_CLI_RESULT_LINES_H
#define PAL_CLI_RESULT_LINES_H
#include "server/base/flags.h"

#include <cjson/cJSON.h>

#include <stdbool.h>
#include <stdint.h>

enum { PAL_SHARDS_MAX = 100000 };

typedef struct pal_result_lines pal_result_lines;

/* the computation that the results belong to */
typedef struct pal_result_list {
    const char *command; /* borrowed during open */
    uint64_t input;      /* hash of everything the results depend on */
    int n;               /* results of all shards */
} pal_result_list;

/* the flags of a command with shards */
typedef struct pal_shard_flags {
    const char *shard, *folder, *merge; /* --shard, --results, --merge; NULL: absent */
    int index, n;                       /* I and N of --shard, by the check */
} pal_shard_flags;
/* their rows in its table of flags, of a pal_shard_flags; row: what one result is */
#define PAL_SHARD_FLAGS(flags, row)                                                                                    \
    {"--shard",                                                                                                        \
     "I/N",                                                                                                            \
     PAL_FLAG_TEXT,                                                                                                    \
     &(flags).shard,                                                                                                   \
     0,                                                                                                                \
     0,                                                                                                                \
     "compute part I of N, from 1, of the results, each a " row "; started again it continues after the last stored"}, \
        {"--results", "FOLDER", PAL_FLAG_TEXT, &(flags).folder, 0, 0, "where --shard keeps them, a line each"},        \
    {                                                                                                                  \
        "--merge", "FOLDER", PAL_FLAG_TEXT, &(flags).merge, 0, 0,                                                      \
            "report the results of all shards in a folder, with the input and flags of their runs. Only measured "     \
            "times,\n"                                                                                                 \
            "and what is chosen by them, differ from a run without shards"                                             \
    }
/* Reads --shard. Errors: REFUSED: flags that do not go together, or no I/N. */
pal_err pal_shard_flags_check(pal_shard_flags *flags, pal_diagnostic *diag);
/* Reads "I/N" with 1 <= I <= N <= PAL_SHARDS_MAX. Errors: REFUSED. */
pal_err pal_shard_read(const char *text, int *shard, int *n_shard, pal_diagnostic *diag);
/* Hash of the bytes of a file, continued from `hash`; of its name alone if it cannot be read. */
uint64_t pal_result_input_file(uint64_t hash, const char *path);
/* The same of a JSON file, or of scene.json in a folder, and of every file that a text in it names, as a problem its
 * surface and a scene its meshes; relative names are looked up beside the JSON file. */
uint64_t pal_result_input_tree(uint64_t hash, const char *path);

/* Opens the file of a shard, with the results that it holds, makes folder and file, and locks the file. Errors: STATE:
 * another process computes this shard; REFUSED (names file and line): results of another input or damaged; IO, MEMORY.
 */
pal_err pal_result_lines_open(const char *folder, const pal_result_list *list, int shard, int n_shard,
                              pal_result_lines **out, pal_diagnostic *diag);
/* Reads the files of all shards in a folder. Errors: REFUSED: no files, files of different N, a missing shard (named by
 * its number), results of another input, a damaged line; IO, MEMORY. */
pal_err pal_result_lines_merge(const char *folder, const pal_result_list *list, pal_result_lines **out,
                               pal_diagnostic *diag);
/* Are the results 0 to n - 1 there? Errors: REFUSED names the shard that is unfinished. */
pal_err pal_result_lines_complete(const pal_result_lines *lines, int n, pal_diagnostic *diag);
void pal_result_lines_close(pal_result_lines *lines); /* accepts NULL */

/* Does the result belong to this shard? After a merge: always. */
bool pal_result_lines_own(const pal_result_lines *lines, int index);
/* A result, borrowed until the close; NULL: not there yet. */
const cJSON *pal_result_lines_find(const pal_result_lines *lines, int index);
/* A number of a result; NaN: none. */
double pal_result_number(const cJSON *result, const char *key);
/* Appends a result, and takes it. Not after a merge. Errors: IO, MEMORY. */
pal_err pal_result_lines_put(pal_result_lines *lines, int index, cJSON *result, pal_diagnostic *diag);
#endif
