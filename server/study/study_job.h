/* The internals of a study (study.h), shared by its files. [load] */
#ifndef PAL_STUDY_STUDY_JOB_H
#define PAL_STUDY_STUDY_JOB_H
#include "server/mesh/volume/locate.h"
#include "server/sim/world/world.h"
#include "server/study/study.h"

/* points; ticks of the scripted press, PAL_FORCE_S / PAL_STUDY_HAPTIC_S */
enum { PAL_STUDY_PROBES = 1000, PAL_STUDY_TICKS = 2000 };

/* the scripted press: where the surface is touched at rest, body frame */
typedef struct pal_study_press {
    bool is_placed; /* false: the surface has no direction there */
    double at_m[3], inward[3], radius_m, depth_m;
} pal_study_press;

/* a configuration to measure */
typedef struct pal_study_entry {
    pal_configuration configuration;
    bool calibrate; /* fit its spring constants first */
} pal_study_entry;

/* a body in a configuration, in a world of its own */
typedef struct pal_study_world {
    pal_configured_scene *set;
    pal_world *world;
    pal_body *body;
    pal_locate *locate;         /* finds the element around a point; NULL: points are on `surface` */
    const pal_surface *surface; /* displayed surface at rest, whose vertices are the nodes `node`; NULL: use `locate` */
    const int32_t *node;        /* node of each surface vertex; NULL: the same numbers */
    double prepare_s;
} pal_study_world;

/* the equilibrium of the latest configuration, reused because many configurations share it */
typedef struct pal_study_rest {
    bool known;
    pal_configuration of;
    pal_err err;
    char reason[PAL_CONFIGURATION_TEXT];
    double rms_m, max_m;
} pal_study_rest;

typedef struct pal_study_job {
    pal_scene *scene;     /* of the one body, without what the study does not need; owned */
    pal_problem *problem; /* the body and its loads in the frame of the file; owned */
    const pal_problem_case *load[PAL_STUDY_LOADS];
    int n_load, n_press;        /* n_press: loads of a scene, chosen by the study */
    int round[PAL_STUDY_LOADS]; /* how often their strength was changed */
    const pal_study_options *options;
    const char *law; /* law of the reference */
    bool adaptive;   /* adaptive_springs: points and loads are those of the coarse surface */
    pal_study *out;
    pal_diagnostic *diag;
    int n_probe;
    double *probe;                     /* body frame, m [n_probe][3]                       */
    double *static_u[PAL_STUDY_LOADS]; /* static displacement of the reference [n_probe][3] */
    double *now;                       /* scratch [n_probe][3] */
    int tip;                           /* the probe that the first load moves most */
    int n_trajectory;
    double (*trajectory)[3];     /* displacement of the tip, every PAL_STUDY_FRAME_S [n_trajectory] */
    double (*own_trajectory)[3]; /* scratch [n_trajectory] */
    double seconds;
    pal_study_press press;
    double (*force_N)[3]; /* of the reference at every tick of the press [PAL_STUDY_TICKS] */
    pal_study_rest rest;
    int reference, n_reference; /* its size, its nodes */
    double box_m[3];            /* side lengths if the body fills its box; else 0 */
    double slender;             /* factor on sizes, relative to a compact body */
} pal_study_job;

static inline bool pal_study_is(const char *a, const char *b)
{
    return !__builtin_strcmp(a, b);
}

/* study_configurations.c: lists the sweep, coarse before fine, configurations with the same equilibrium together;
 * returns the count. */
int pal_study_list(const pal_study_job *job, pal_study_entry out[PAL_STUDY_POINTS]);
/* Returns a size with nearly the same number of voxels across a slender body as across a compact one. For a body
 * that fills its box, picks a nearby size that fits its sides, because overhanging voxels are no error of the
 * elements. */
int pal_study_fit_size(const pal_study_job *job, double wanted);
int pal_study_size(const pal_study_job *job, int compact);

/* study_world.c. statics: for statics, without tools, safeguards and damping. Frees on error. */
pal_err pal_study_open(const pal_study_job *job, const pal_configuration *configuration, bool statics,
                       pal_study_world *out, pal_diagnostic *diag);
void pal_study_close(pal_study_world *world);
/* Nodal forces of a load [n_node][3] on the body of `world`. */
pal_err pal_study_forces(const pal_study_job *job, const pal_study_world *world, const pal_problem_case *load,
                         double *force_N, pal_diagnostic *diag);
/* Applies the same as sustained loads, times share. */
pal_err pal_study_apply_load(const pal_study_job *job, const pal_study_world *world, const pal_problem_case *load,
                             double share, pal_diagnostic *diag);
/* Displacement of the points x (body frame, at rest) [n][3]. */
pal_err pal_study_displacement(const pal_study_world *world, const double *x, int n, double *u, pal_diagnostic *diag);

/* study_rest.c: displacement of the probes [n_probe][3] in the equilibrium under a load. NUMERIC: there is none. */
pal_err pal_study_static(pal_study_job *job, const pal_configuration *configuration, const pal_problem_case *load,
                         double *u, int *n_node, pal_diagnostic *diag);

/* study_reference.c: the same for the reference, from the cache if present. */
pal_err pal_study_cached_static(pal_study_job *job, const pal_configuration *configuration,
                                const pal_problem_case *load, double *u, int *n_node, pal_diagnostic *diag);

/* study_loads.c: three presses and a pull, for a scene without load cases */
pal_err pal_study_presses(pal_study_job *job);
/* Changes the strength of a press whose reference equilibrium is far from the wanted displacement or does not exist
 * (err). False: it is adequate, is not a press, or was changed the allowed number of times. */
bool pal_study_press_adjust(pal_study_job *job, int index, pal_err err);
/* study_job.c. False: the user asked to stop now. */
bool pal_study_continues(const pal_study_job *job);
/* Fits spring constants to the reference's equilibrium and writes them to the configuration. */
pal_err pal_study_fit(pal_study_job *job, pal_configuration *configuration, pal_diagnostic *diag);

/* study_reference.c. Call reference_size first: the sweep depends on it. */
pal_err pal_study_reference_size(pal_study_job *job);
pal_err pal_study_reference(pal_study_job *job);

/* study_force.c. The press stands on the probe that the first load moves most. */
void pal_study_place_press(pal_study_job *job);
/* Force of a configuration on the tool at every tick of the press [PAL_STUDY_TICKS], without delay. */
pal_err pal_study_press_force(pal_study_job *job, const pal_configuration *configuration, double (*force_N)[3],
                              pal_diagnostic *diag);
/* Errors of the force felt; NaN where the press cannot be followed. Errors: STATE, MEMORY. */
pal_err pal_study_measure_force(pal_study_job *job, pal_study_point *out);
void pal_study_forget_forces(pal_study_point *out); /* all NaN */
/* study_loads.c: mean inward direction of the triangles with a corner within `half` of a point; 0: they cancel */
void pal_study_inward(const pal_surface *surface, const double at[3], double half, double out[3]);

/* study_run.c: measures one point, whose configuration and errors are set. Only STATE is an error. */
pal_err pal_study_measure(pal_study_job *job, const pal_study_entry *entry, pal_study_point *out);
/* Trajectory of the tip under the first load, every PAL_STUDY_FRAME_S. ms [max] receives step times unless NULL. */
pal_err pal_study_trajectory(pal_study_job *job, const pal_configuration *configuration, double (*trajectory)[3],
                             double *ms, int max, int *n_ms, pal_study_point *facts, pal_diagnostic *diag);

/* study_run.c: times every configuration again later and keeps the smallest median, because the load of the machine
 * varies. STATE: stopped. */
pal_err pal_study_time_repeat(pal_study_job *job);

/* study_robustness.c: removes configurations that fail robustness cases from the front and reports it in `reason`.
 * STATE: stopped. */
pal_err pal_study_check_robustness(pal_study_job *job);

/* study_pick.c: predicts every point from the others */
void pal_study_predict(pal_study *study);
/* Solves (F'F + hold) w = F'y by elimination. A [n][n + 1]: F'F beside F'y, is destroyed. The first unknown, a
 * constant term, is not regularised. */
void pal_study_ridge(double *A, int n, double hold, double *w);
/* Number of parameters, other than model and size, in which two configurations differ. */
int pal_study_differences(const pal_configuration *a, const pal_configuration *b);
#endif
