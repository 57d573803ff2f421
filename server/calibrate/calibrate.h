/* Calibration: constants of springs (model tet_springs) that make a lattice come to rest where finite elements, or
 * measured displacements, say the body does (paper B section 3).
 *
 * What is fitted are theta = ln k_J of edges, faces and tetrahedra: one number each (3.2), or one at each node of a
 * grid laid over the body, with trilinear values between them (3.5); a spring takes the mean over its corners. For a
 * load L, e_L = sqrt(mean |u - u_truth|^2) over the points of the truth, in per cent of its largest displacement; the
 * error E is the mean over the loads that are fitted. (The paper averages metres; per cent let a load that moves little
 * count as much as one that moves a lot.)
 *
 * A calibration is made once (voxels, springs, truths) and then read only; every thread evaluates in a workspace of its
 * own. What an evaluation gives depends on theta alone, never on the workspace's past, unless it is asked to go on from
 * its last answer. Heap. */
#ifndef PAL_CALIBRATE_CALIBRATE_H
#define PAL_CALIBRATE_CALIBRATE_H
#include "server/calibrate/equilibrium.h"
#include "server/num/trilinear.h"
#include "server/solve/load_case.h"
#include "server/solve/sample_points.h"

enum { PAL_CALIBRATE_CASES = 8, PAL_CALIBRATE_PARAMETERS = 1 << 16 };

/* a load case with its truth */
typedef struct pal_calibrate_case {
    const pal_problem_case *load_case; /* borrowed                                                       */
    const pal_samples *samples;        /* displacements at points, borrowed; NULL: by finite elements    */
    const char *truth_name;            /* of the samples, for people: "twist_nh"; NULL: finite elements  */
    bool fit;                          /* false: only reported (verify)                                  */
    bool linear;                       /* truth and springs linearised at rest                            */
} pal_calibrate_case;

typedef struct pal_calibrate_options {
    pal_case_voxel_options voxel; /* of the springs: 20 voxels, fill, align                                    */
    int split;                    /* finite elements of the truth: every voxel as split^3; 2                   */
    bool equal;        /* every spring of a kind has the same k_J (paper); false: weighted by V l^2 (spring_law.h) */
    bool without_area; /* edges and volumes only                                                    */
    int grid[3];       /* nodes; 0 0 0: homogeneous                                                 */
    double decades;    /* bounds: theta within this many decades of the start; 3                    */
    double min_volume_ratio; /* volume constants are at least this share of the start; 0: within the decades alone */
    double smooth;           /* weight of differences of theta along the grid's edges: 0.1 (objective below) */
    double pull;             /* weight of the distance from the start's ratios of constants, on a grid: 0.1 */
    bool (*progress)(const char *what, double fraction, void *user); /* while truths are solved; may be NULL */
    void *user;
} pal_calibrate_options;
void pal_calibrate_default(pal_calibrate_options *options);

typedef struct pal_calibration pal_calibration;
/* Springs, truths and start. REFUSED names the entry: no case to fit, no load or one that is zero, no support, a load
 * that stands on held nodes, a truth that moves nothing, a grid with more parameters than PAL_CALIBRATE_PARAMETERS;
 * NUMERIC: finite elements find no truth; STATE: progress said stop; MEMORY. Borrows problem, cases and surface */
pal_err pal_calibration_create(const pal_problem *problem, const pal_surface *surface, const pal_calibrate_case *cases,
                               int n_case, const pal_calibrate_options *options, pal_calibration **out,
                               pal_diagnostic *diag);
void pal_calibration_destroy(pal_calibration *calibration); /* NULL is fine */

/* what was made */
typedef struct pal_calibration_info {
    int n_parameter, n_kind, n_used; /* parameters = n_kind * n_used, kind by kind                             */
    int kind[PAL_SPRING_KINDS];      /* pal_spring_kind of each                                                */
    int n_node, n_free, n_spring, n_tet;
    double edge_m, mean_young_Pa;      /* start: volume's mean of ln E                                            */
    double max_m[PAL_CALIBRATE_CASES]; /* largest displacement of each truth                                    */
    int n_point[PAL_CALIBRATE_CASES];
    double truth_s, prepare_s;
    bool clamped;                    /* a Poisson ratio above 0.4999 was taken as 0.4999                        */
    const pal_prepared *mesh;        /* voxels as tetrahedra, with the surface's skin; the calibration's own    */
    const pal_grid *grid;            /* body frame; NULL: homogeneous                                           */
    const pal_grid_weights *weights; /* grid -> nodes; NULL: homogeneous                                        */
    const double *start;             /* theta of the default constants, from E and nu [n_parameter]             */
    const double *low, *high;        /* bounds                                        [n_parameter]             */
} pal_calibration_info;
void pal_calibration_info_of(const pal_calibration *calibration, pal_calibration_info *out);
/* theta of equal constants as a hand would set them first: 0.2, 0.4, 1 E h^3 on every spring (paper B section 3.4).
 * They are divided by the mean weight of their kind where springs are weighted */
void pal_calibration_manual_start(const pal_calibration *calibration, double *theta);
/* k_J at the mesh's nodes for kind index k (of info.kind), before weights [n_node] */
void pal_calibration_constants(const pal_calibration *calibration, const double *theta, int k, double *k_J);

typedef struct pal_calibration_workspace pal_calibration_workspace;
pal_err pal_calibration_workspace_create(const pal_calibration *calibration,
                                         pal_calibration_workspace **out);    /* MEMORY */
void pal_calibration_workspace_destroy(pal_calibration_workspace *workspace); /* NULL is fine */

typedef struct pal_calibration_value {
    double error_percent;                     /* E over the fitted cases; DBL_MAX: a case has no stable rest   */
    double case_percent[PAL_CALIBRATE_CASES]; /* e_L; DBL_MAX: none, or another fitted case has none; NaN: not asked */
    double smooth, pull;                      /* the two regularisers, before their weights                    */
    double objective; /* ln (mean e_L^2) + smooth and pull with their weights: what adjoint minimises; the logarithm
                         makes a weight mean the same for 10 % and for 0.1 % of error; DBL_MAX: no value          */
    int n_newton;
} pal_calibration_value;

typedef enum pal_calibration_request {
    PAL_CALIBRATION_FIT = 1,      /* cases that are fitted                                                  */
    PAL_CALIBRATION_VERIFY = 2,   /* the others                                                             */
    PAL_CALIBRATION_CONTINUE = 4, /* begin at the seat's last rest of each case: faster; depends on its past */
} pal_calibration_request;

/* E and, unless slope is NULL, d objective / d theta [n_parameter] (0 where there is no value). No rest is no error: it
 * is DBL_MAX, never averaged. MEMORY; NUMERIC: theta is not finite */
pal_err pal_calibration_evaluate(const pal_calibration *calibration, pal_calibration_workspace *workspace,
                                 const double *theta, unsigned ask, pal_calibration_value *out, double *slope,
                                 pal_diagnostic *diag);
/* displacement [n_node][3] of a case at the seat's last rest; false: it has none */
bool pal_calibration_displacement(const pal_calibration *calibration, const pal_calibration_workspace *workspace,
                                  int index, double *u);
/* the truth at the mesh's nodes [n_node][3]; false: it is given at other points */
bool pal_calibration_truth(const pal_calibration *calibration, int index, double *u);
/* nodal forces of a case, N [n_node][3], borrowed */
const double *pal_calibration_forces(const pal_calibration *calibration, int index);
/* the problem's supports in the body frame, borrowed; *n of them */
const pal_support_def *pal_calibration_supports(const pal_calibration *calibration, int *n);

/* ---- methods: calibrate_adjoint.c, calibrate_anneal.c ---- */

/* a point that a method evaluated; for progress and trajectories (paper B Fig 8) */
typedef struct pal_fit_step {
    int64_t evaluation; /* from 0                                                                        */
    double error_percent, best_percent; /* DBL_MAX: no rest                                              */
    double seconds;      /* since the method began                                                        */
    const double *theta; /* [n_parameter]                                                                */
    bool improved;
} pal_fit_step;

typedef struct pal_fit_options {
    double budget_s;        /* 0: none; ends within an evaluation of it (annealing: within a batch)      */
    int64_t max_evaluation; /* 0: adjoint 1000, annealing 4000                                          */
    uint64_t seed;          /* annealing                                                                */
    int n_worker;           /* annealing: threads; 0: one per core                                      */
    double target_percent;  /* ends when E is at most this; 0: goes on                                  */
    /* annealing: evaluates points elsewhere in place of this process' own team (MPI ranks); NULL: own team */
    pal_err (*evaluate)(void *user, const double *theta, int n, double *error_percent);
    int n_batch; /* points that evaluate takes at once                                       */
    /* called after every evaluation, in order; false stops and keeps the best. May be NULL */
    bool (*step)(void *user, const pal_fit_step *step);
    void *user;
} pal_fit_options;

typedef struct pal_fit_result {
    pal_calibration_value value;      /* at the best, all cases                                               */
    double start_percent;             /* E at the start; DBL_MAX: no rest                                     */
    int64_t n_evaluation, n_rejected; /* rejected: no stable rest, or not finite                         */
    int64_t n_spent;                  /* annealing: those that other cores evaluated in vain included         */
    double seconds;
    const char *ended; /* "converged", "budget", "evaluations", "stopped", "enough", "stalled" */
} pal_fit_result;

/* theta [n_parameter]: in: where to begin (annealing: one of its samples), out: the best, never worse than the start.
 * NUMERIC: neither the start nor any sample comes to rest; MEMORY */
pal_err pal_fit_adjoint(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                        pal_fit_result *out, pal_diagnostic *diag);
pal_err pal_fit_anneal(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                       pal_fit_result *out, pal_diagnostic *diag);
#endif
