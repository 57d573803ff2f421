/* One run of `palpate calibrate`: what was asked, what was found, and the parts of the command that say it, draw it and
 * write it (command_calibrate.c and calibrate_*.c). Thread: [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_RUN_H
#define PAL_CALIBRATE_CALIBRATE_RUN_H
#include "server/calibrate/calibrate_cases.h"
#include "server/calibrate/settle.h"
#include "server/cli/report.h"
#include "server/scene/scene_file.h"

enum { PAL_CALIBRATE_PATH = 1200, PAL_CALIBRATE_FILES = 4 };

typedef struct pal_calibrate_run {
    pal_flag_common common;
    /* asked */
    pal_calibrate_input input;
    pal_calibrate_options options;
    pal_fit_options fit;
    bool annealing;
    const char *scene, *trajectory, *picture, *vtk; /* paths; all but the first may be NULL */
    /* found */
    pal_calibrate_cases set;
    pal_calibration *calibration;
    pal_calibration_info info;
    pal_calibration_workspace *workspace;    /* at the constants found              */
    double *theta;                           /* [n_parameter]                       */
    pal_calibration_value start, hand, last; /* of all cases at the default start, at constants set by hand, found */
    pal_fit_result result;
    double *error, *best; /* of every evaluation, per cent, DBL_MAX: none [n_trail] */
    int n_trail, max_trail;
    bool settled; /* live is known */
    pal_settle_report live;
    double damping_1_s; /* as it was written */
    int n_substep;      /* that a step of the scene takes at rest */
    double settle_s, total_s;
    char file[PAL_CALIBRATE_FILES][PAL_CALIBRATE_PATH];
    int n_file;
} pal_calibrate_run;

const char *pal_calibrate_method(const pal_calibrate_run *run); /* "adjoint", "annealing" */
/* "k_distance_J" ... of kind index k of info.kind, "k_d" for a short name */
const char *pal_calibrate_key(const pal_calibrate_run *run, int k, bool brief);
/* mean over the fitted (or the other) cases; NaN: there is none; DBL_MAX: one has no rest */
double pal_calibrate_mean(const pal_calibrate_run *run, const pal_calibration_value *value, bool fit);

/* ---- calibrate_scene.c ---- */

/* the scene that serve runs, with everything but damping and accuracy as they will be; borrows mesh and supports of the
 * calibration; pal_scene_free; sets n_substep. MEMORY, REFUSED */
pal_err pal_calibrate_scene(pal_calibrate_run *run, pal_loaded_scene **out, pal_diagnostic *diag);
/* "0.5 % RMS of finite elements (twist), 3.5 % (push, not fitted)" */
void pal_calibrate_accuracy(const pal_calibrate_run *run, char *out, size_t n_byte);

/* ---- calibrate_draw.c ---- */

/* error of every evaluation and the best so far (paper B Fig 8) */
pal_err pal_calibrate_draw_trajectory(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag);
/* the first fitted case at rest, as the truth, at the start and as it was fitted, coloured by the distance to the truth
 * (Fig 7, 10); with a grid its constants beside the material (Fig 13, 14) */
pal_err pal_calibrate_draw_body(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag);
/* tetrahedra with constants at nodes, and of every case the truth's and the springs' displacements */
pal_err pal_calibrate_write_vtk(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag);

/* ---- calibrate_report.c ---- */

void pal_calibrate_print(const pal_calibrate_run *run);
cJSON *pal_calibrate_json(const pal_calibrate_run *run);
#endif
