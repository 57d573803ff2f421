/* `palpate solve` over several elements and resolutions: a table of errors and observed orders, and plots.
 * Thread: [load]. */
#ifndef PAL_COMMANDS_CONVERGENCE_REPORT_H
#define PAL_COMMANDS_CONVERGENCE_REPORT_H
#include "server/cli/report.h"
#include "server/solve/convergence.h"

enum { PAL_SOLVE_STUDY_ELEMENTS = 4 };

/* the values of --element and --resolution */
typedef struct pal_study_list {
    int n_element, n_resolution;
    const char *element[PAL_SOLVE_STUDY_ELEMENTS];
    int max_resolution[PAL_SOLVE_STUDY_ELEMENTS]; /* of the element */
    int resolution[PAL_CONVERGENCE_MAX];
} pal_study_list;

typedef struct pal_solve_study {
    const pal_problem *problem;
    const pal_problem_case *load_case;
    const pal_problem_reference *reference; /* NULL: none */
    const char *samples_file;               /* NULL: none */
    const pal_samples *samples;             /* NULL: none, errors are estimated by Richardson extrapolation */
    const pal_surface *surface;
    const pal_solve_options *options;
    const char *plot; /* NULL: none */
} pal_solve_study;

/* element: "hex8_bbar,tet10:8", resolution: "8,16,32"; false: diag names the fault */
bool pal_solve_study_parse(const char *element, const char *resolution, pal_study_list *out, pal_diagnostic *diag);
/* solves and prints everything, as JSON or as a table; the result is the exit code */
int pal_solve_study_run(const pal_flag_common *common, const pal_solve_study *study, const pal_study_list *list);
#endif
