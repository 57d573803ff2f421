/* Applies the configuration that a scene requests (accuracy.max_error_mm, budget.step_ms), picked from the study
 * stored beside it. Thread: [load]. */
#ifndef PAL_STUDY_STUDIED_SCENE_H
#define PAL_STUDY_STUDIED_SCENE_H
#include "server/study/study_store.h"

/* the request; 0: no limit */
typedef struct pal_accuracy_target {
    double max_error_m, budget_ms;
} pal_accuracy_target;
/* Writes "within 1 mm", "in at most 4 ms", "within 1 mm in at most 4 ms"; returns out. */
const char *pal_accuracy_target_text(const pal_accuracy_target *target, char out[80]);
enum { PAL_STUDY_ERROR_TEXT = 320 };
/* Writes "0.54 mm off, +- 0.42 mm of the reference, under three presses and a pull, 0.5 s, that move it by up to 18
 * mm"; returns out. */
const char *pal_study_error_text(const pal_study_file *file, double error_m, char out[PAL_STUDY_ERROR_TEXT]);
/* Writes "within 0.54 mm, 3 % of the largest displacement, of fem hex8_bbar" for the head of the page, with as many
 * complete parts of the reference's description as fit. */
void pal_study_accuracy_text(const pal_study *study, double error_m, char *out, size_t n_byte);
/* pal_study_pick restricted to the methods (comma-separated, "": all). Returns the index of the point, -1: none
 * qualifies. */
int pal_study_pick_target(const pal_study *study, const char *methods, const pal_accuracy_target *target);
/* For a study in which no point qualifies: writes "none of the 48 configurations is within 1 mm: the nearest is fem
 * ..., 1.3 mm in 5.2 ms", or that the reference cannot be trusted and what to do. */
void pal_study_describe_miss(const pal_study *study, const char *methods, const pal_accuracy_target *target, char *out,
                             size_t n_byte);

/* a scene as it runs */
typedef struct pal_studied_scene {
    const pal_scene *scene;    /* the loaded one, or that of `set` */
    pal_study_file *file;      /* NULL: no study beside it, or none of this body */
    pal_configured_scene *set; /* NULL: runs as written */
    int picked;                /* point of the study; -1: none requested */
    int body, n_configuration; /* configurations that a session may switch to */
    pal_measured_configuration *configuration;
    char summary[720]; /* the picked configuration and its study; "": none */
    char warn[400];    /* a study that was ignored, or made on another machine; "": no warning */
} pal_studied_scene;
/* word: the command's argument (scene_arg.h). scene: loaded from it; borrowed until close. Errors: REFUSED: a
 * configuration is requested, and there is no study, it is of another body, or no configuration qualifies (diag:
 * one sentence that names the command to run); errors of pal_configuration_make. Close *out with
 * pal_studied_scene_close, also after an error. */
pal_err pal_studied_scene_open(const char *word, const pal_scene *scene, pal_studied_scene *out, pal_diagnostic *diag);
void pal_studied_scene_close(pal_studied_scene *studied); /* accepts a zeroed struct */
#endif
