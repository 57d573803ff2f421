/* What `palpate study` is asked to study: a scene's body, or a load case of a problem. Thread: [load]. */
#ifndef PAL_STUDY_STUDY_INPUT_H
#define PAL_STUDY_STUDY_INPUT_H
#include "server/scene/scene_file.h"
#include "server/study/study_store.h"

typedef struct pal_study_input {
    const pal_scene *scene; /* of the loaded file, or what the problem's body would be served as */
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
    const char *word;      /* scene_arg.h, or a PROBLEM.json                                       */
    const char *load_case; /* of a problem, or one of its references; NULL: the first load case    */
    const char *body;      /* by name; NULL: the first                                             */
    const char *samples;   /* CSV; NULL: none, or that of the reference which load_case names      */
    bool keeps_case;       /* load_case is that of the study which is there: a scene does not look at it */
    double seconds;        /* of the dynamic run                                                   */
    bool quick;
    const pal_surface_scene *options; /* for surfaces and cells */
} pal_study_request;

/* reads it; REFUSED: a case of a scene, a body of a problem, names that are not there, one sentence; errors of the
 * readers. Closed by pal_study_input_close, also after an error */
pal_err pal_study_input_open(const pal_study_request *request, pal_study_input *out, pal_diagnostic *diag);
void pal_study_input_close(pal_study_input *input);
#define PAL_STUDY_SECONDS 0.5 /* of the dynamic run, where none are given */
/* what of pal_study_input_describe's loads can be asked for again: seconds (0: not said), quick, load case ("": none)
 */
void pal_study_loads_read(const char *loads, double *seconds, bool *quick, char load_case[PAL_NAME]);
/* says in file of what body and loads the study is: name, body, index, shape, loads, digest */
void pal_study_input_describe(const pal_study_input *input, const pal_study_request *request, pal_study_file *file);
#endif
