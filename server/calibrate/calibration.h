/* Internals of a calibration (private to calibrate*.c). */
#ifndef PAL_CALIBRATE_CALIBRATION_H
#define PAL_CALIBRATE_CALIBRATION_H
#include "server/calibrate/calibrate.h"

/* one load with its truth */
typedef struct pal_fit_case {
    double *force_N; /* [n_node][3]                                                                  */
    /* Points of the truth as weighted sums over nodes. start NULL: point i is node i. */
    int n_point;
    int32_t *start, *node;
    double *weight;
    double *u; /* truth, m [n_point][3] */
    double max_m;
    bool linear;
    double *x_start; /* equilibrium at the start's constants; rest positions if there is none [n_node][3] */
} pal_fit_case;

struct pal_calibration {
    pal_arena *arena; /* of all arrays that it owns */
    pal_calibrate_options options;
    const pal_problem *problem;
    const pal_calibrate_case *cases;
    int n_case, n_fit;
    pal_prepared mesh;
    pal_world *world;
    pal_lattice lattice;
    pal_support_def support[PAL_PROBLEM_REGIONS];
    pal_grid grid;
    pal_grid_weights weights;
    bool has_grid;
    int32_t *edge; /* pairs of used nodes that are neighbours on the grid [n_edge][2] */
    int n_edge;
    pal_calibration_info info;
    double *theta, *low, *high;            /* start and bounds [n_parameter] */
    double manual_theta[PAL_SPRING_KINDS]; /* theta of each kind index */
    pal_fit_case fit[PAL_CALIBRATE_CASES];
};

struct pal_calibration_workspace {
    pal_arena *arena; /* of its arrays */
    const pal_calibration *calibration;
    pal_equilibrium_workspace *workspace;
    double *k[PAL_SPRING_KINDS], *slope[PAL_SPRING_KINDS]; /* by pal_spring_kind [n_item] */
    double *value, *node;           /* slopes of the constants [n_used]; values at nodes [n_node] */
    double *x[PAL_CALIBRATE_CASES]; /* last equilibrium [n_node][3] */
    bool rests[PAL_CALIBRATE_CASES];
    double *dJ_du, *gradient; /* [n_node][3], [n_parameter] */
};

/* Reports an evaluation of a method to its caller. Returns why the search ends now, NULL: it goes on. */
const char *pal_fit_report(const pal_fit_options *options, const pal_fit_step *step, int64_t max_evaluation);
#endif
