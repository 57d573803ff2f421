/* One run of `palpate calibrate`: its request, its result, and the parts of the command that print, draw and write
 * it (command_calibrate.c and calibrate_*.c). Thread: [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_RUN_H
#define PAL_CALIBRATE_CALIBRATE_RUN_H
#include "server/calibrate/calibrate_cases.h"
#include "server/calibrate/release.h"
#include "server/cli/report.h"
#include "server/scene/scene_file.h"

enum { PAL_CALIBRATE_PATH = 1200 };
/* files to write */
enum { PAL_CALIBRATE_SCENE, PAL_CALIBRATE_TRAJECTORY, PAL_CALIBRATE_PICTURE, PAL_CALIBRATE_VTK, PAL_CALIBRATE_FILES };

typedef struct pal_calibrate_run {
    pal_flag_common common;
    /* request */
    pal_calibrate_input input;
    pal_calibrate_options options;
    pal_fit_options fit;
    bool annealing;
    const char *from;                      /* path of a recording; NULL: a problem */
    const char *path[PAL_CALIBRATE_FILES]; /* all but the scene's may be NULL */
    /* result */
    pal_calibrate_cases set;
    pal_calibration *calibration;
    pal_calibration_info info;
    pal_calibration_workspace *workspace; /* at the fitted constants */
    double *theta;                        /* [n_parameter]                       */
    /* of all cases at the default start, at manual constants, at the fitted ones */
    pal_calibration_value start, hand, last;
    pal_fit_result result;
    double (*trail)[2]; /* error and best so far of every evaluation, per cent; DBL_MAX: no equilibrium [n_trail] */
    int n_trail;
    double load_share; /* of a recording's forces that is fitted to */
    bool replay_equal; /* the recording's state hashes came out again  */
    bool settled;      /* live is valid */
    pal_settle_report live;
    pal_release_report release; /* n_run 0: the damping was not looked for in a release */
    double damping_1_s;         /* as written to the scene */
    int n_substep;              /* sub-steps of a step of the scene at rest */
    double settle_s, total_s;
} pal_calibrate_run;

/* ---- calibrate_scene.c ---- */

const char *pal_calibrate_method(const pal_calibrate_run *run); /* "adjoint", "annealing" */
/* "k_distance_J" ... of kind index k of info.kind; brief: "k_d" ... */
const char *pal_calibrate_key(const pal_calibrate_run *run, int k, bool brief);
/* Mean over the fitted (or the other) cases. NaN: there are none; DBL_MAX: one has no equilibrium. */
double pal_calibrate_mean(const pal_calibrate_run *run, const pal_calibration_value *value, bool fit);

/* The scene for serve, complete except for damping and accuracy. Borrows mesh and supports of the calibration; free
 * with pal_scene_free. Sets n_substep. Errors: MEMORY, REFUSED. */
pal_err pal_calibrate_scene(pal_calibrate_run *run, pal_loaded_scene **out, pal_diagnostic *diag);
/* "0.5 % RMS of finite elements (twist), 3.5 % (push, not fitted)" */
void pal_calibrate_accuracy(const pal_calibrate_run *run, char *out, size_t n_byte);

/* ---- calibrate_draw.c ---- */

/* Draws the error of every evaluation and the best so far (paper B Fig 8). */
pal_err pal_calibrate_draw_trajectory(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag);
/* Draws the first fitted case at rest: the truth, the start and the fit, coloured by the distance to the truth
 * (paper B Fig 7, 10). With a grid, also its constants beside the material (Fig 13, 14). */
pal_err pal_calibrate_draw_body(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag);
/* Writes tetrahedra with constants at nodes, and for every case the displacements of the truth and of the springs. */
pal_err pal_calibrate_write_vtk(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag);
#endif
