/* The subject of `palpate study`: a body of a scene, or a load case of a problem. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_INPUT_H
#define PAL_STUDY_STUDY_INPUT_H
#include "server/scene/scene_file.h"
#include "server/study/study_store.h"

typedef struct pal_study_input {
    const pal_scene *scene; /* of the loaded file, or the scene as which the problem's body is served */
    int body;
    pal_loaded_scene *loaded; /* NULL: a problem */
    pal_problem *problem;     /* NULL: a scene   */
    const pal_problem_case *load_case;
    pal_surface surface;
    pal_configured_scene *made;
    bool has_samples;
    pal_samples samples; /* static reference of the first load */
} pal_study_input;

typedef struct pal_study_request {
    const char *word;      /* scene_arg.h, or a PROBLEM.json */
    const char *load_case; /* of a problem, or one of its references; NULL: the first load case */
    const char *body;      /* name; NULL: the first body */
    const char *samples;   /* CSV; NULL: none, or that of the reference named by load_case */
    bool keeps_case;       /* load_case comes from the stored study: ignored for a scene */
    double seconds;        /* duration of the dynamic run */
    bool quick;
    const pal_surface_scene *options; /* for surfaces and control cells */
} pal_study_request;

/* Reads the subject. Errors: REFUSED (one sentence): a load case with a scene, a body with a problem, an unknown
 * name; errors of the readers. Close with pal_study_input_close, also after an error. */
pal_err pal_study_input_open(const pal_study_request *request, pal_study_input *out, pal_diagnostic *diag);
void pal_study_input_close(pal_study_input *input);
/* Parses the repeatable parts of the loads text of pal_study_input_describe: seconds (0: absent), quick, load case
 * ("": none). */
void pal_study_loads_read(const char *loads, double *seconds, bool *quick, char load_case[PAL_NAME]);
/* Records the body and loads of the study in `file`: name, body, index, shape, loads, digest. */
void pal_study_input_describe(const pal_study_input *input, const pal_study_request *request, pal_study_file *file);
#endif
