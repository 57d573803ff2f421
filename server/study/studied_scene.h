/* The setting that a scene asks for (accuracy.max_error_mm, budget.step_ms), picked from the study kept beside it.
 * Thread: [load]. */
#ifndef PAL_STUDY_STUDIED_SCENE_H
#define PAL_STUDY_STUDIED_SCENE_H
#include "server/study/study_store.h"

/* what is asked for; 0: not asked */
typedef struct pal_accuracy_target {
    double max_error_m, budget_ms;
} pal_accuracy_target;
/* "within 1 mm", "in at most 4 ms", "within 1 mm in at most 4 ms"; returns out */
const char *pal_accuracy_target_text(const pal_accuracy_target *target, char out[80]);
enum { PAL_STUDY_ERROR_TEXT = 320 };
/* "0.54 mm off, +- 0.42 mm of the reference, under three presses and a pull, 0.5 s, that move it by up to 18 mm" */
const char *pal_study_error_text(const pal_study_file *file, double error_m, char out[PAL_STUDY_ERROR_TEXT]);
/* "within 0.54 mm, 3 % of the largest displacement, of fem hex8_bbar": for the head of the page, with as many whole
 * parts of the reference's description as fit */
void pal_study_accuracy_text(const pal_study *study, double error_m, char *out, size_t n_byte);
/* pal_study_pick among the methods (words with commas, "": all); index of the point, -1: none serves */
int pal_study_pick_target(const pal_study *study, const char *methods, const pal_accuracy_target *target);
/* "none of the 48 settings is within 1 mm: the nearest is fem ..., 1.3 mm in 5.2 ms", or that the reference is not to
 * be trusted and what to do; for a study in which none serves */
void pal_study_describe_miss(const pal_study *study, const char *methods, const pal_accuracy_target *target, char *out,
                             size_t n_byte);

/* a scene as it runs */
typedef struct pal_studied_scene {
    const pal_scene *scene;    /* the loaded one, or `set`'s                               */
    pal_study_file *file;      /* NULL: there is no study beside it, or none of this body */
    pal_configured_scene *set; /* NULL: it runs as it is written                           */
    int picked;                /* point of the study; -1: none was asked for               */
    int body, n_configuration; /* what a session may switch to                             */
    pal_measured_configuration *setting;
    char summary[720]; /* which setting was picked and from which study; "": none                           */
    char warn[400];    /* a study that was not looked at, or that another machine made; "": nothing to say */
} pal_studied_scene;
/* word: as it was given to the command (scene_arg.h); scene: loaded from it, borrowed until close. REFUSED when a
 * setting is asked for and there is no study, one of another body, or none of its settings serves: one sentence that
 * says what to run; errors of pal_configuration_make. *out is closed by pal_studied_scene_close, also after an error */
pal_err pal_studied_scene_open(const char *word, const pal_scene *scene, pal_studied_scene *out, pal_diagnostic *diag);
void pal_studied_scene_close(pal_studied_scene *studied); /* a zeroed struct is fine */
#endif
