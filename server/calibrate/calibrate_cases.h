/* Input of a calibration: a problem, its load cases or references by name, and the source of each truth. Thread:
 * [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_CASES_H
#define PAL_CALIBRATE_CALIBRATE_CASES_H
#include "server/calibrate/calibrate.h"

typedef struct pal_calibrate_input {
    const char *problem; /* path of PROBLEM.json */
    const char *fit;     /* names separated by commas; each is a load case or a reference */
    const char *verify;  /* likewise, reported only; NULL: none */
    /* "fem": finite elements, also where a reference is named. "reference": for a load case, the reference that
     * answers it. Otherwise a CSV file for the one fitted case. NULL: the CSV of a reference, finite elements for a
     * load case. */
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
 * body; IO, MEMORY. Free *out in any case. */
pal_err pal_calibrate_cases_read(const pal_calibrate_input *input, pal_calibrate_cases *out, pal_diagnostic *diag);
/* Makes their calibration and its properties; the set must outlive it. Resolution 0: the smallest even number of voxels
 * whose lattice has more than 700 nodes, as the bodies of the paper do; at most 64. Errors: those of
 * pal_calibration_create; REFUSED (names the case) if more than 1 % of a truth's points lie farther than a voxel from
 * the voxels. Destroy *out also after an error. */
pal_err pal_calibrate_cases_make(const pal_calibrate_cases *set, const pal_calibrate_options *options,
                                 pal_calibration **out, pal_calibration_info *info, pal_diagnostic *diag);
/* Reads "5x3x5". NULL: text is that; otherwise the sentence for a user. */
const char *pal_calibrate_grid(const char *text, int grid[3]);
void pal_calibrate_cases_free(pal_calibrate_cases *set); /* accepts a zeroed struct */
#endif
