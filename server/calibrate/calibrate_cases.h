/* What is calibrated: a problem, its load cases or references by name, and where the truth of each comes from.
 * Thread: [load]. */
#ifndef PAL_CALIBRATE_CALIBRATE_CASES_H
#define PAL_CALIBRATE_CALIBRATE_CASES_H
#include "server/calibrate/calibrate.h"

typedef struct pal_calibrate_input {
    const char *problem;    /* PROBLEM.json                                                                     */
    const char *fit;        /* names with commas between; each is a load case or a reference                    */
    const char *verify;     /* the same, only reported; NULL: none                                              */
    const char *truth;      /* "fem": by finite elements, also where a reference is named; "reference": of a load case
                               the reference that answers it; else a CSV file for the one case that is fitted;
                               NULL: a reference's CSV, a load case by finite elements                           */
    const char *kinematics; /* "finite", "linear"; NULL: a reference's own, else finite                         */
} pal_calibrate_input;

/* owns all that its list borrows; its address stays while a calibration uses it */
typedef struct pal_calibrate_cases {
    pal_problem *problem;
    pal_surface surface;
    int n;
    char id[PAL_CALIBRATE_CASES][PAL_NAME];         /* as they were named                            */
    char truth_name[PAL_CALIBRATE_CASES][PAL_NAME]; /* "twist_nh", a CSV's name; empty: finite elements */
    pal_samples samples[PAL_CALIBRATE_CASES];
    pal_calibrate_case list[PAL_CALIBRATE_CASES];
} pal_calibrate_cases;

/* reads all files. REFUSED names the entry: an unknown name, one twice, a reference of other kinematics than asked for,
 * references of different materials, no reference that answers, supports that move, points that lie outside the body;
 * IO, MEMORY. *out is to be freed in any case */
pal_err pal_calibrate_cases_read(const pal_calibrate_input *input, pal_calibrate_cases *out, pal_diagnostic *diag);
/* the least even number of voxels on the longest axis whose lattice has more than 700 nodes, as the paper's bodies
 * have; at most 64. Errors are those of pal_case_voxels */
pal_err pal_calibrate_cases_resolution(const pal_calibrate_cases *set, const pal_case_voxel_options *voxel, int *out,
                                       pal_diagnostic *diag);
/* are the points of the truths in or near these voxels? REFUSED names the case: more than 1 % of them are farther than
 * a voxel from any (those of a body that does not fit its voxels stay within half of one) */
pal_err pal_calibrate_cases_check(const pal_calibrate_cases *set, const pal_prepared *mesh, pal_diagnostic *diag);
void pal_calibrate_cases_free(pal_calibrate_cases *set); /* a zeroed struct is fine */
#endif
