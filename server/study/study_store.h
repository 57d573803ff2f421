/* A study stored in a file. An interrupted run continues from it; serve, plan and the command itself pick a
 * configuration from it without measuring.
 *
 *   {"format": "palpate-study-1",
 *    "name": "liver", "machine": "...", "reference": "...", "reference_m": 1e-5, "max_m": .., "max_force_N": ..,
 *    "reference_force_N": .., "length_scale_m": .., "step_s": ..,
 *    "subject": {"body": "liver", "index": 0, "shape": "16 hex digits",
 *    "loads": "three presses and a pull, 0.5 s", "digest": "16 hex digits", "methods": "fem"},
 *    "command": "palpate study liver/scene.json",
 *    "n_total": 48, "complete": true,
 *    "points": [{"model": "fem", "element": .., "law": .., "solver": .., "size": 16, "step_s": .., "tolerance": ..,
 *    "k_distance_J": .., "k_area_J": .., "k_volume_J": .., "ms": .., "error_m": .., "front": true, "err": "OK",
 *    "reason": "", "nodes": .., "substeps": .., "ms_p95": .., "static_rms_m": .., "static_max_m": ..,
 *    "trajectory_rms_m": .., "trajectory_max_m": .., "force_rms_0_N": .., "force_rms_50_N": .., "force_rms_200_N": ..,
 *    "force_rms_50_30Hz_N": .., "force_max_0_N": .., "force_max_50_N": .., "force_max_200_N": ..,
 *    "force_max_50_30Hz_N": .., "prepare_s": .., "elements": .., "read_ms": ..,
 *    "predicted_ms": .., "predicted_m": ..}]}
 *
 * "complete" means that every configuration of these methods is present. force_rms_50_30Hz_N: at 30 models a
 * second and 50 ms of round trip; the others at 60. Every key except elements, read_ms and those of forces is required.
 * Numbers have enough digits to restore the same bits. null stands for a value that is not a number. The study of a
 * scene file NAME.json is NAME_study.json, that of scene.json is study.json. A table (.csv), a plot
 * (.svg) and a page (.html) of the same name may stand beside it. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_STORE_H
#define PAL_STUDY_STUDY_STORE_H
#include "server/base/hash.h"
#include "server/study/study.h"

#include <cjson/cJSON.h>

#include <stdint.h>

enum { PAL_STUDY_PATH = 1200, PAL_STUDY_SHAPE = 17, PAL_STUDY_COMMAND = 512, PAL_STUDY_METHODS = 8 };

typedef struct pal_study_file {
    pal_study study;
    char body[PAL_NAME]; /* name of the body, and its index in the scene */
    int index;
    char shape[PAL_STUDY_SHAPE];     /* pal_study_shape of that body */
    char loads[200];                 /* description of the loads, compared as text */
    char digest[PAL_STUDY_SHAPE];    /* of the loads' numbers and of samples that replace the reference; may be "" */
    char methods[200];               /* words of --methods, comma-separated; "": all that apply */
    char command[PAL_STUDY_COMMAND]; /* as typed */
    int n_total;                     /* number of configurations of the complete study */
    bool whole;
} pal_study_file;

/* Hash of the properties of a body that a study depends on: shape, material, regions, strokes, supports and
 * damping; not model, solver, mesh and step. 16 hexadecimal digits; not cryptographic. */
const char *pal_study_shape(const pal_body_def *body, char out[PAL_STUDY_SHAPE]);
/* Hash of numbers, or of their absence (NULL), continued from `hash` (hash.h). */
uint64_t pal_study_digest_numbers(uint64_t hash, const double *value, size_t n);
/* Hash of one load, continued likewise. */
uint64_t pal_study_digest_load(uint64_t hash, const pal_problem_load *load);
/* Path of the study files without ending: "liver/scene.json", "liver" or "liver.stl" -> "liver/study",
 * "liver_study". If folder is not NULL: "study" in it. REFUSED: too long. */
pal_err pal_study_stem(const char *word, const char *folder, char out[PAL_STUDY_PATH], pal_diagnostic *diag);

/* *out: heap, free(). Errors: REFUSED (names file, entry and number); IO, MEMORY. */
pal_err pal_study_file_read(const char *path, pal_study_file **out, pal_diagnostic *diag);
/* The same from memory; name appears in messages only. */
pal_err pal_study_file_parse(const char *name, const char *json, size_t n_byte, pal_study_file **out,
                             pal_diagnostic *diag);
/* Writes the whole file or none. Errors: IO, MEMORY, REFUSED: longer than the reader accepts. */
pal_err pal_study_file_write(const pal_study_file *file, const char *path, pal_diagnostic *diag);
/* The same as a tree, which the caller deletes; NULL: out of memory. */
cJSON *pal_study_file_tree(const pal_study_file *file);
/* One row per point by ascending ms, unmeasured points last. Errors: IO, MEMORY. */
pal_err pal_study_file_csv(const pal_study_file *file, const char *path, pal_diagnostic *diag);

/* Indices of the points by ascending ms, unmeasured (NaN) last; out [n_point]. */
void pal_study_order(const pal_study *study, int *out);
/* The measured points by ascending ms, with step_s set; out [PAL_STUDY_POINTS]. Returns the count. */
int pal_study_configurations(const pal_study *study, pal_measured_configuration *out);
#endif
