/* A study kept in a file, so that a run that was broken off goes on, and so that serve, plan and the command itself can
 * pick a setting without measuring again.
 *
 * {
 *   "format": "palpate-study-1",
 *   "name": "liver", "machine": "...", "reference": "...", "reference_m": 1e-5, "max_m": .., "length_scale_m": ..,
 * "step_s":
 * .., "subject": {"body": "liver", "index": 0, "shape": "16 hex digits", "loads": "three presses and a pull, 0.5 s",
 *     "digest": "16 hex digits", "methods": "fem"},
 *   "command": "palpate study liver/scene.json",
 *   "n_finest": 48, "complete": true,                    whole: every setting of these methods is there
 *   "points": [{"model": "fem", "element": .., "law": .., "solver": .., "size": 16, "step_s": .., "tolerance": ..,
 *     "k_distance_J": .., "k_area_J": .., "k_volume_J": .., "ms": .., "error_m": .., "front": true, "err": "OK",
 *     "reason": "", "nodes": .., "substeps": .., "ms_p95": .., "static_rms_m": .., "static_max_m": ..,
 * "trajectory_rms_m":
 * .., "trajectory_max_m": .., "prepare_s": .., "elements": .., "read_ms": .., "predicted_ms": .., "predicted_m": ..}]
 * }
 * Every key but elements and read_ms is required; numbers have as many digits as give the same bits; null stands for
 * what is not a number. Beside the file NAME.json of a scene it is NAME_study.json, beside scene.json study.json; a
 * table (.csv), a drawing
 * (.svg) and a page (.html) of the same name may stand beside it. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_STORE_H
#define PAL_STUDY_STUDY_STORE_H
#include "server/study/study.h"

#include <cjson/cJSON.h>

#include <stdint.h>

enum { PAL_STUDY_PATH = 1200, PAL_STUDY_SHAPE = 17, PAL_STUDY_COMMAND = 512, PAL_STUDY_METHODS = 8 };

typedef struct pal_study_file {
    pal_study study;
    char body[PAL_NAME]; /* which body of the scene, and its place there                                 */
    int index;
    char shape[PAL_STUDY_SHAPE];     /* pal_study_shape of that body                                      */
    char loads[200];                 /* what was put on it, for people and compared as it is               */
    char digest[PAL_STUDY_SHAPE];    /* of the loads' numbers and of samples in place of the own reference; may be "" */
    char methods[200];               /* words of --methods with commas; "": all that fit                  */
    char command[PAL_STUDY_COMMAND]; /* as it was typed                                                    */
    int n_finest;                    /* settings that the study has when it is whole                       */
    bool whole;
} pal_study_file;

/* What of a body a study is of: its shape, material, regions, strokes, supports and damping, without model, solver,
 * mesh and step. 16 hexadecimal digits; not meant to withstand forgery */
const char *pal_study_shape(const pal_body_def *body, char out[PAL_STUDY_SHAPE]);
/* the 16 digits of any bytes, going on from another sum (0: from the start) */
uint64_t pal_study_digest(uint64_t before, const void *bytes, size_t n_byte);
/* "liver/scene.json", "liver" or "liver.stl" -> "liver/study", "liver_study": where the files of its study are, without
 * ending; folder not NULL: there, always "study". REFUSED: too long */
pal_err pal_study_stem(const char *word, const char *folder, char out[PAL_STUDY_PATH], pal_diagnostic *diag);

/* *out: heap, free(). REFUSED names file, entry and number; IO, MEMORY */
pal_err pal_study_file_read(const char *path, pal_study_file **out, pal_diagnostic *diag);
/* the same from memory; name is used in messages only */
pal_err pal_study_file_parse(const char *name, const char *json, size_t n_byte, pal_study_file **out,
                             pal_diagnostic *diag);
/* whole or not at all; IO, MEMORY, REFUSED: longer than what is read */
pal_err pal_study_file_write(const pal_study_file *file, const char *path, pal_diagnostic *diag);
/* the same as a tree, which the caller deletes; NULL: no memory */
cJSON *pal_study_file_tree(const pal_study_file *file);
/* one row a point, in the order of ascending ms, those not measured last; IO, MEMORY */
pal_err pal_study_file_csv(const pal_study_file *file, const char *path, pal_diagnostic *diag);

/* indices of the points by ascending ms, those not measured (NaN) last; out [n_point] */
void pal_study_order(const pal_study *study, int *out);
/* the measured points by ascending ms, their step_s given; out [PAL_STUDY_POINTS]; returns how many */
int pal_study_configurations(const pal_study *study, pal_measured_configuration *out);
/* is the method among words with commas ("": all)? */
bool pal_study_method_in(const char *methods, const char *model);
#endif
