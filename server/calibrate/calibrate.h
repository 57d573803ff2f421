/* Calibration: finds spring constants (model tet_springs) for which a lattice comes to rest where finite elements,
 * or measured displacements, predict it (paper B section 3).
 *
 * The fitted parameters are theta = ln k_J of edges, faces and tetrahedra: one number each (3.2), or one at each
 * node of a grid over the body with trilinear interpolation (3.5). A spring takes the mean over its corners. For a
 * load L, e_L = sqrt(mean |u - u_truth|^2) over the points of the truth, in per cent of its largest displacement.
 * The error E is the mean of e_L over the fitted loads. (The paper averages metres. With per cent, a load that
 * causes small displacements counts as much as one that causes large ones.)
 *
 * A calibration is made once (voxels, springs, truths) and is read-only afterwards. Each thread evaluates in its
 * own workspace. The result of an evaluation depends on theta alone, not on the history of the workspace, unless
 * PAL_CALIBRATION_CONTINUE is set. Allocates heap memory. */
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
    const pal_samples *samples;        /* displacements at points, borrowed; NULL: computed by finite elements */
    const char *truth_name;            /* display name of the samples, such as "twist_nh"; NULL: finite elements */
    bool fit;                          /* false: reported only (verify) */
    bool linear;                       /* truth and springs linearised at rest */
} pal_calibrate_case;

typedef struct pal_calibrate_options {
    pal_case_voxel_options voxel; /* voxels of the springs: 20, fill, align */
    int split;                    /* finite elements of the truth: each voxel becomes split^3; default 2 */
    bool equal;        /* all springs of a kind have the same k_J (paper); false: weighted by V l^2 (spring_law.h) */
    bool without_area; /* edges and volumes only */
    int grid[3];       /* nodes per axis; 0 0 0: homogeneous */
    double decades;    /* bounds: theta stays within this many decades of the start; default 3 */
    double min_volume_ratio; /* lower bound of volume constants as a share of the start; 0: only the decades apply */
    double smooth;           /* weight of differences of theta along grid edges; default 0.1 (see objective) */
    double pull;             /* weight of the distance from the start's ratios of constants, on a grid; default 0.1 */
    /* called while truths are solved; false: stop; may be NULL */
    bool (*progress)(const char *what, double fraction, void *user);
    void *user;
} pal_calibrate_options;
void pal_calibrate_default(pal_calibrate_options *options);

typedef struct pal_calibration pal_calibration;
/* Makes springs, truths and the start. Borrows problem, cases and surface. Errors: REFUSED (names the entry): no
 * case to fit, no load or a zero load, no support, a load on fixed nodes, a truth without displacement, a grid with
 * more parameters than PAL_CALIBRATE_PARAMETERS; NUMERIC: finite elements find no truth; STATE: progress returned
 * false; MEMORY. */
pal_err pal_calibration_create(const pal_problem *problem, const pal_surface *surface, const pal_calibrate_case *cases,
                               int n_case, const pal_calibrate_options *options, pal_calibration **out,
                               pal_diagnostic *diag);
void pal_calibration_destroy(pal_calibration *calibration); /* accepts NULL */

/* properties of a calibration */
typedef struct pal_calibration_info {
    int n_parameter, n_kind, n_used; /* n_parameter = n_kind * n_used, ordered by kind */
    int kind[PAL_SPRING_KINDS];      /* pal_spring_kind of each kind index */
    int n_node, n_free, n_spring, n_tet;
    double edge_m;
    /* of the start, means over the volume: E is the geometric mean, nu at most 0.4999 */
    double mean_young_Pa, mean_poisson, mean_density_kg_m3;
    double max_m[PAL_CALIBRATE_CASES]; /* largest displacement of each truth */
    int n_point[PAL_CALIBRATE_CASES];
    double truth_s, prepare_s;
    bool clamped;                    /* a Poisson ratio above 0.4999 was replaced by 0.4999 */
    const pal_prepared *mesh;        /* voxels as tetrahedra, with the skin of the surface; owned by the calibration */
    const pal_grid *grid;            /* body frame; NULL: homogeneous                                           */
    const pal_grid_weights *weights; /* grid -> nodes; NULL: homogeneous                                        */
    const double *start;             /* theta of the default constants, from E and nu [n_parameter] */
    const double *low, *high;        /* bounds [n_parameter] */
    const double *force_N[PAL_CALIBRATE_CASES]; /* nodal forces of each case [n_node][3] */
    int n_support;
    const pal_support_def *support; /* of the problem, in the body frame [n_support] */
} pal_calibration_info;
void pal_calibration_info_of(const pal_calibration *calibration, pal_calibration_info *out);
/* theta of equal constants as a first manual choice: 0.2, 0.4, 1 E h^3 on every spring (paper B section 3.4). Where
 * springs are weighted, the constants are divided by the mean weight of their kind. */
void pal_calibration_manual_start(const pal_calibration *calibration, double *theta);
/* k_J at the nodes of the mesh for kind index k (of info.kind), before weights [n_node]. */
void pal_calibration_constants(const pal_calibration *calibration, const double *theta, int k, double *k_J);

typedef struct pal_calibration_workspace pal_calibration_workspace;
pal_err pal_calibration_workspace_create(const pal_calibration *calibration,
                                         pal_calibration_workspace **out);    /* MEMORY */
void pal_calibration_workspace_destroy(pal_calibration_workspace *workspace); /* accepts NULL */

typedef struct pal_calibration_value {
    double error_percent; /* E over the fitted cases; DBL_MAX: a case has no stable equilibrium */
    /* e_L; DBL_MAX: no equilibrium, here or in another fitted case; NaN: not requested */
    double case_percent[PAL_CALIBRATE_CASES];
    double smooth, pull; /* the two regularisers, before their weights */
    /* ln (mean e_L^2) plus weighted smooth and pull, which adjoint minimises. The logarithm gives a weight the same
     * meaning at 10 % and at 0.1 % error. DBL_MAX: no value. */
    double objective;
    int n_newton;
} pal_calibration_value;

typedef enum pal_calibration_request {
    PAL_CALIBRATION_FIT = 1,    /* the fitted cases */
    PAL_CALIBRATION_VERIFY = 2, /* the other cases */
    /* start from the workspace's last equilibrium of each case: faster, but depends on its history */
    PAL_CALIBRATION_CONTINUE = 4,
} pal_calibration_request;

/* Computes E and, unless slope is NULL, d objective / d theta [n_parameter] (0 where there is no value). A missing
 * equilibrium is not an error: the value is DBL_MAX and is never averaged. Errors: MEMORY; NUMERIC: theta is not
 * finite. */
pal_err pal_calibration_evaluate(const pal_calibration *calibration, pal_calibration_workspace *workspace,
                                 const double *theta, unsigned ask, pal_calibration_value *out, double *slope,
                                 pal_diagnostic *diag);
/* Displacement [n_node][3] of a case at the workspace's last equilibrium. False: there is none. */
bool pal_calibration_displacement(const pal_calibration *calibration, const pal_calibration_workspace *workspace,
                                  int index, double *u);
/* Truth at the nodes of the mesh [n_node][3]. False: it is given at other points. */
bool pal_calibration_truth(const pal_calibration *calibration, int index, double *u);

/* ---- methods: calibrate_adjoint.c, calibrate_anneal.c ---- */

/* One evaluated point, for progress and trajectories (paper B Fig 8). */
typedef struct pal_fit_step {
    int64_t evaluation;                 /* counted from 0 */
    double error_percent, best_percent; /* DBL_MAX: no equilibrium */
    double seconds;                     /* since the start of the method */
    const double *theta; /* [n_parameter]                                                                */
    bool improved;
} pal_fit_step;

typedef struct pal_fit_options {
    double budget_s;        /* 0: unlimited; ends within one evaluation of it (annealing: one batch) */
    int64_t max_evaluation; /* 0: adjoint 1000, annealing 4000 */
    uint64_t seed;          /* annealing only */
    int n_worker;           /* annealing: threads; 0: one per core */
    double target_percent;  /* ends when E is at most this; 0: no target */
    /* Annealing: evaluates points elsewhere (MPI ranks). NULL: threads of this process. */
    pal_err (*evaluate)(void *user, const double *theta, int n, double *error_percent);
    int n_batch; /* points per call of evaluate */
    /* Called after every evaluation, in order. False stops and keeps the best point. May be NULL. */
    bool (*step)(void *user, const pal_fit_step *step);
    void *user;
} pal_fit_options;

typedef struct pal_fit_result {
    pal_calibration_value value;      /* of all cases, at the best point */
    double start_percent;             /* E at the start; DBL_MAX: no equilibrium */
    int64_t n_evaluation, n_rejected; /* rejected: no stable equilibrium, or not finite */
    int64_t n_spent;                  /* annealing: includes evaluations that other cores made in vain */
    double seconds;
    const char *ended; /* "converged", "budget", "evaluations", "stopped", "enough", "stalled" */
} pal_fit_result;

/* theta [n_parameter]: in: start point (annealing: one of its samples); out: the best point, never worse than the
 * start. Errors: NUMERIC: neither the start nor any sample has an equilibrium; MEMORY. */
pal_err pal_fit_adjoint(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                        pal_fit_result *out, pal_diagnostic *diag);
pal_err pal_fit_anneal(const pal_calibration *calibration, const pal_fit_options *options, double *theta,
                       pal_fit_result *out, pal_diagnostic *diag);
#endif
