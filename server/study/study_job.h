/* The parts of a study (study.h): what its files share. [load] */
#ifndef PAL_STUDY_STUDY_JOB_H
#define PAL_STUDY_STUDY_JOB_H
#include "server/mesh/volume/locate.h"
#include "server/sim/world/world.h"
#include "server/study/study.h"

enum { PAL_STUDY_PROBES = 1000 };

/* a setting that shall be measured */
typedef struct pal_study_entry {
    pal_configuration setting;
    bool calibrate; /* its springs' constants are fitted first */
} pal_study_entry;

/* a body in a setting, as a world of its own */
typedef struct pal_study_world {
    pal_configured_scene *set;
    pal_world *world;
    pal_body *body;
    pal_locate *locate;         /* elements around points; NULL: through `surface`           */
    const pal_surface *surface; /* shown at rest, whose vertices are nodes: `node`; NULL: through `locate` */
    const int32_t *node;        /* of the surface's vertices; NULL: the same numbers           */
    double prepare_s;
} pal_study_world;

/* the rest of the setting that was looked at last: many settings have the same */
typedef struct pal_study_rest {
    bool known;
    pal_configuration of;
    pal_err err;
    char reason[PAL_CONFIGURATION_TEXT];
    double rms_m, max_m;
} pal_study_rest;

typedef struct pal_study_job {
    pal_scene *scene;     /* of the one body, without what the study does not need; own */
    pal_problem *problem; /* the body and its loads in the frame of the file; own          */
    const pal_problem_case *load[PAL_STUDY_LOADS];
    int n_load, n_press;        /* n_press: loads of a scene, which the study has chosen itself */
    int round[PAL_STUDY_LOADS]; /* how often their strength was chosen anew              */
    const pal_study_options *options;
    const char *law; /* of the reference */
    bool adaptive;   /* adaptive_springs: points and loads are those of the coarse surface */
    pal_study *out;
    pal_diagnostic *diag;
    int n_probe;
    double *probe;                  /* body frame, m [n_probe][3]                       */
    double *still[PAL_STUDY_LOADS]; /* displacement of the reference at rest [n_probe][3] */
    double *now;                    /* work space [n_probe][3]                          */
    int tip;                        /* the probe that the first load moves most          */
    int n_trajectory;
    double (*way)[3]; /* of the tip, every PAL_STUDY_FRAME_S [n_trajectory] */
    double (*own)[3]; /* work space [n_trajectory]                          */
    double seconds;
    pal_study_rest rest;
    int reference, n_reference; /* its size, its nodes                                  */
    double box_m[3];            /* sides, where the body fills them; else 0                           */
    double slender;             /* sizes are that many times those of a compact body               */
} pal_study_job;

#define PAL_STUDY_FRAME_S (1.0 / 60)

static inline bool pal_study_is(const char *a, const char *b)
{
    return !__builtin_strcmp(a, b);
}

/* study_configurations.c: what is swept, coarse before fine, settings with the same rest together; returns how many */
int pal_study_list(const pal_study_job *job, pal_study_entry out[PAL_STUDY_POINTS]);
/* the same number of voxels across a long body as across a compact one, nearly; of a body that fills its box one near
 * that that fits its sides, since what stands out of it is no error of the elements */
int pal_study_fit_size(const pal_study_job *job, double wanted);
int pal_study_size(const pal_study_job *job, int compact);
/* sizes that are swept, ascending; returns how many */
int pal_study_sizes(const pal_study_job *job, int out[16]);

/* study_world.c. still: for statics, without tools, guards and damping. Frees on error */
pal_err pal_study_open(const pal_study_job *job, const pal_configuration *setting, bool still, pal_study_world *out,
                       pal_diagnostic *diag);
void pal_study_close(pal_study_world *world);
/* forces of a load on the nodes [n_node][3], of pal_study_world's body */
pal_err pal_study_forces(const pal_study_job *job, const pal_study_world *world, const pal_problem_case *load,
                         double *force_N, pal_diagnostic *diag);
/* the same put on the world as lasting loads, times share */
pal_err pal_study_apply_load(const pal_study_job *job, const pal_study_world *world, const pal_problem_case *load,
                             double share, pal_diagnostic *diag);
/* displacement of the points x (body frame, at rest) [n][3] */
pal_err pal_study_displacement(const pal_study_world *world, const double *x, int n, double *u, pal_diagnostic *diag);

/* study_rest.c: displacement of the probes [n_probe][3] where the body comes to rest under a load. NUMERIC: it does not
 */
pal_err pal_study_static(pal_study_job *job, const pal_configuration *setting, const pal_problem_case *load, double *u,
                         int *n_node, pal_diagnostic *diag);

/* study_cache.c: the same, and the way of the tip, as parts of the reference: taken from what was kept where it is
 * there
 */
pal_err pal_study_cached_static(pal_study_job *job, const pal_configuration *setting, const pal_problem_case *load,
                                double *u, int *n_node, pal_diagnostic *diag);
pal_err pal_study_cached_trajectory(pal_study_job *job, const pal_configuration *setting, double (*way)[3],
                                    pal_diagnostic *diag);

/* study_loads.c: three presses and a pull, for a scene that has no load cases */
pal_err pal_study_presses(pal_study_job *job);
void pal_study_press_halve(pal_study_job *job); /* half as strong */
/* a press whose rest by the reference is far from what was wanted, or which has none (err), is made another strength;
 * false: it is as it should be, is no press, or was changed often enough */
bool pal_study_press_adjust(pal_study_job *job, int index, pal_err err);
/* study_job.c: false: the user wants it ended, now */
bool pal_study_continues(const pal_study_job *job);
/* the constants of springs fitted to the reference's rest, into the setting */
pal_err pal_study_fit(pal_study_job *job, pal_configuration *setting, pal_diagnostic *diag);

/* study_reference.c; the size first, as what is swept depends on it */
pal_err pal_study_reference_size(pal_study_job *job);
pal_err pal_study_reference(pal_study_job *job);

/* study_run.c: one point, whose setting and errors are set; STATE alone is an error */
pal_err pal_study_measure(pal_study_job *job, const pal_study_entry *entry, pal_study_point *out);
/* the way of the tip under the first load, every PAL_STUDY_FRAME_S; times of the steps in ms [most] unless NULL */
pal_err pal_study_trajectory(pal_study_job *job, const pal_configuration *setting, double (*way)[3], double *ms,
                             int max, int *n_ms, pal_study_point *facts, pal_diagnostic *diag);

/* study_run.c: milliseconds of every setting once more, at other moments of the machine: the least median counts;
 * STATE: stopped */
pal_err pal_study_time_repeat(pal_study_job *job);

/* study_robustness.c: takes off the front what is not there any more after being mistreated, and says so in its `why`;
 * STATE: stopped */
pal_err pal_study_check_robustness(pal_study_job *job);

/* study_pick.c: predictions of all points from the others */
void pal_study_predict(pal_study *study);
#endif
