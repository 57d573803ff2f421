/* Input of a calibration: a problem with its load cases or references by name, or a recording with its touches, and the
 * source of each truth. Thread: [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_CASES_H
#define PAL_CALIBRATE_CALIBRATE_CASES_H
#include "server/calibrate/recorded_loads.h"

typedef struct pal_calibrate_input {
    const char *problem; /* path of PROBLEM.json, or of the scene that was recorded */
    /* NULL: a problem. Otherwise the body and its touches, each a load case of its id; borrowed. Supports and regions
     * that are boxes, and a lowest part, are those of the scene */
    const pal_recorded_loads *recorded;
    const pal_scene *scene; /* of the recording; borrowed while the cases are used */
    /* names separated by commas; each is a load case or a reference. NULL: all touches that verify does not name */
    const char *fit;
    const char *verify; /* likewise, reported only; NULL: none */
    /* "fem": finite elements, also where a reference is named. "reference": for a load case, the reference that
     * answers it. Otherwise a CSV file for the one fitted case. NULL: the CSV of a reference, finite elements for a
     * load case. Of touches: "fem" (NULL), or "recording": the displacement of the recorded body. */
    const char *truth;
    const char *kinematics; /* "finite", "linear"; NULL: that of a reference, otherwise finite */
} pal_calibrate_input;

/* Owns everything its list borrows. Its address must not change while a calibration uses it. */
typedef struct pal_calibrate_cases {
    pal_problem *problem;
    pal_surface surface;
    int n;
    char id[PAL_CALIBRATE_CASES][PAL_NAME];         /* names as given */
    char truth_name[PAL_CALIBRATE_CASES][PAL_NAME]; /* "twist_nh", or the name of a CSV; empty: finite elements */
    pal_samples samples[PAL_CALIBRATE_CASES];
    pal_calibrate_case list[PAL_CALIBRATE_CASES];
} pal_calibrate_cases;

/* Reads all files. Errors: REFUSED (names the entry): an unknown or repeated name, a reference of other kinematics
 * than requested, references of different materials, no reference that answers, moving supports, points outside the
 * body; of a recording a body without tetrahedra, other supports and regions, and with truth "recording" a touch in
 * which the body did not come to rest; IO, MEMORY. Free *out in any case. */
pal_err pal_calibrate_cases_read(const pal_calibrate_input *input, pal_calibrate_cases *out, pal_diagnostic *diag);
/* Makes their calibration and its properties; the set must outlive it. Resolution 0: the smallest even number of voxels
 * whose lattice has more than 700 nodes, as the bodies of the paper do; at most 64. Errors: those of
 * pal_calibration_create; REFUSED (names the case) if more than 1 % of a truth's points lie farther than a voxel from
 * the voxels. Destroy *out also after an error. */
pal_err pal_calibrate_cases_make(const pal_calibrate_cases *set, const pal_calibrate_options *options,
                                 pal_calibration **out, pal_calibration_info *info, pal_diagnostic *diag);
/* Makes the problem of the recorded body, with a load case for each touch, and its surface. *out: heap, free().
 * Borrows the forces of the touches. Errors: REFUSED (names the entry): see pal_calibrate_cases_read; MEMORY. */
pal_err pal_calibrate_recorded_problem(const pal_calibrate_input *input, pal_problem **out, pal_surface *surface,
                                       pal_diagnostic *diag);
/* Reads "5x3x5". NULL: text is that; otherwise the sentence for a user. */
const char *pal_calibrate_grid(const char *text, int grid[3]);
void pal_calibrate_cases_free(pal_calibrate_cases *set); /* accepts a zeroed struct */
#endif
