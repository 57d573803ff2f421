/* `palpate solve` over several elements and resolutions: a table of errors and observed orders, and plots. Thread:
 * [load]. */
#ifndef PAL_COMMANDS_SOLVE_STUDY_H
#define PAL_COMMANDS_SOLVE_STUDY_H
#include "server/cli/report.h"
#include "server/solve/convergence.h"

enum { PAL_SOLVE_STUDY_ELEMENTS = 4 };

/* what the words of --element and --resolution name */
typedef struct pal_study_list {
    int n_element, n_resolution;
    const char *element[PAL_SOLVE_STUDY_ELEMENTS];
    int most[PAL_SOLVE_STUDY_ELEMENTS]; /* of its resolutions */
    int resolution[PAL_CONVERGENCE_MAX];
} pal_study_list;

typedef struct pal_solve_study {
    const pal_problem *problem;
    const pal_problem_case *load_case;
    const pal_problem_reference *reference; /* NULL: none */
    const char *samples_file;               /* NULL: none */
    const pal_samples *samples;             /* NULL: none: errors are estimated by Richardson */
    const pal_surface *surface;
    const pal_solve_options *options;
    const char *plot; /* NULL: none */
} pal_solve_study;

/* words like "hex8_bbar,tet10:8" and "8,16,32"; false: note says what is wrong with them */
bool pal_solve_study_parse(const char *element, const char *resolution, pal_study_list *out, pal_diagnostic *diag);
/* solves all of it; what is said, in JSON or as a table; the result is the exit code */
int pal_solve_study_run(const pal_flag_common *common, const pal_solve_study *study, const pal_study_list *list);
#endif
