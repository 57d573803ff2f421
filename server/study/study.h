/* The cost of accuracy: one body under the same loads in many configurations, each with its error against a
 * converged reference and its milliseconds per live step. README.md explains loads, reference and measures, tuning.h
 * gives their figures.
 *
 * The strength of a press comes from a linear estimate and then from the reference's own equilibrium; a load without
 * one is halved, up to four times. Every method and size runs with the scene's step, a quarter and a half of it, twice
 * it up to 1/60 s, and 1/1000 s; a run that takes too long is timed and marked as not followed. All results except
 * milliseconds and seconds are deterministic.
 *
 * A configuration on the Pareto front that fails a robustness case without being stopped by its safeguards leaves the
 * front, and `reason` reports it; so do springs that are judged by the only load they were fitted to. [load] */
#ifndef PAL_STUDY_STUDY_H
#define PAL_STUDY_STUDY_H
#include "server/sim/core/configuration.h"
#include "server/sim/core/problem.h"
#include "server/sim/core/tools.h"
#include "server/solve/sample_points.h"

#include <math.h>
#include <stdint.h>

enum { PAL_STUDY_POINTS = 256, PAL_STUDY_LOADS = 4, PAL_STUDY_FORCES = 4 };

/* How a haptic device is connected: models a second, and s from a pose to the model that answers it. The study judges
 * the force felt over each of: 60 Hz with 0, 50 and 200 ms, 30 Hz with 50 ms. */
typedef struct pal_study_link {
    double model_Hz, round_trip_s;
} pal_study_link;
extern const pal_study_link pal_study_links[PAL_STUDY_FORCES];

typedef struct pal_study_point {
    pal_measured_configuration
        measured; /* error_m: the larger of static_max_m and trajectory_max_m; NaN: not measured */
    pal_err err;  /* not OK: not measured; reason explains ("needs 8,000 sub-steps") */
    char reason[PAL_CONFIGURATION_TEXT]; /* or a remark on a measured point: "fitted to the load it is judged by" */
    int n_node, n_substep;               /* of a step at rest; for an adaptive surface both are final values */
    double ms_p95;
    /* over all probes and loads; divide by max_m for the share of the largest displacement */
    double static_rms_m, static_max_m;
    double trajectory_rms_m, trajectory_max_m; /* over time, of the point that the first load moves most */
    /* difference of the force felt over each link from that of the reference in the scripted press, rms and largest
     * over its ticks; divide by max_force_N for the share of the largest force. NaN: not measured */
    double force_rms_N[PAL_STUDY_FORCES], force_max_N[PAL_STUDY_FORCES];
    double prepare_s; /* mesh and world */
    double n_element; /* finite elements; 0: none, or not recorded */
    /* time to read its solver's factor forwards and backwards, at this machine's read rate for data of the size of
     * its world; known before it runs; 0: no factor */
    double read_ms;
    /* Predicted by the cost and error models fitted to the OTHER points of its method, from counts known before it
     * runs (pal_study_predict_cost). NaN: too few points. */
    double predicted_ms, predicted_m;
} pal_study_point;

typedef struct pal_study {
    char name[PAL_NAME]; /* of the scene or problem */
    char machine[128];   /* processor and cores, as the system names them */
    char reference[160]; /* description of how the reference was made */
    double reference_m;  /* its estimated error */
    double max_m;        /* largest displacement of the reference */
    double max_force_N;  /* largest force of the reference in the scripted press; NaN: none was made */
    double
        reference_force_N; /* rms change of that force from the reference on a mesh 1.42 times coarser; NaN: likewise */
    double length_scale_m; /* box diagonal of the body */
    double step_s;         /* of the scene, the bound for "real time" */
    int n_point;
    pal_study_point point[PAL_STUDY_POINTS];
} pal_study;

/* One reference answer: an equilibrium or a trajectory. This is what is stored of it beside its numbers. */
typedef struct pal_study_answer {
    pal_err err; /* OK; NUMERIC or FROZEN: there is none */
    int n_node;
    char reason[PAL_CONFIGURATION_TEXT];
} pal_study_answer;

/* How a device renders between models, so that a study judges the force that a hand feels. All functions are pure but
 * for `state`. */
typedef struct pal_study_renderer {
    size_t n_byte; /* of the state, zero at the start */
    /* a model arrives, as the world wrote it for the tool (patches, grasp, requested pose); period_s: usual time
     * between two */
    void (*arrive)(void *state, const pal_tool *model, double period_s);
    /* one tick: force on the hand at a position of the tool, scene frame */
    void (*tick)(void *state, double dt_s, const double x_m[3], const double v_m_s[3], double force_N[3]);
} pal_study_renderer;

typedef struct pal_study_options {
    const char *const
        *method; /* models to sweep [n_method]; 0: all that apply; "tet_springs" is also swept calibrated */
    int n_method;
    int body;                           /* index in the scene */
    double seconds;                     /* duration of the dynamic run; 0: 0.5 */
    int quick;                          /* 1: few configurations and a coarser reference, for tests and CI */
    const pal_study_renderer *renderer; /* borrowed; NULL: forces are not judged */
    const pal_samples *samples;         /* static reference of the first load; NULL: computed here */
    /* Points of an interrupted run; reused, not measured again. NULL: none. */
    const pal_study *before;
    /* [load] Is configuration `index` of the sweep measured here, or by another process that has the same options?
     * NULL: all are. Otherwise the times are not repeated and the front not tried, which needs all points. */
    bool (*own)(int index, void *user);
    /* [load] Cache of reference answers, under a hash of configuration, load and points; answers of the same body,
     * loads and machine are not computed again. recall returns false and leaves value [n] unchanged if there is no
     * answer of that hash and length. Both may be NULL. */
    bool (*recall)(uint64_t key, pal_study_answer *answer, double *value, int n, void *user);
    void (*remember)(uint64_t key, const pal_study_answer *answer, const double *value, int n, void *user);
    /* [load] Called after every point with the study so far, to store it. May be NULL. False stops with STATE. */
    bool (*done)(const pal_study *study, int n_total, void *user);
    bool (*progress)(const char *what, double fraction, void *user); /* may be NULL; false stops with STATE */
    bool (*may_continue)(void *user); /* polled between steps; may be NULL; false stops with STATE */
    void *user;
} pal_study_options;

/* Runs the sweep. `out` (large: allocate on the heap) is valid up to the last completed point, also after an error.
 * Errors: REFUSED: no such body, no method applies, a load that meets nothing; STATE: stopped; MEMORY. */
pal_err pal_study_scene(const pal_scene *scene, const pal_study_options *options, pal_study *out, pal_diagnostic *diag);
pal_err pal_study_problem(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                          const pal_study_options *options, pal_study *out, pal_diagnostic *diag);
/* The scene as which the body of a problem is served: material, supports, tools. *out owns its mesh
 * (pal_configured_scene_free). */
pal_err pal_study_problem_scene(const pal_problem *problem, const pal_surface *surface, pal_diagnostic *diag,
                                pal_configured_scene **out);

/* Are its time and its error known? [any] */
static inline bool pal_study_measured(const pal_study_point *p)
{
    return !p->err && isfinite(p->measured.ms) && isfinite(p->measured.error_m);
}
/* Is the error of the reference small enough? [any] */
bool pal_study_trusted(const pal_study *study);
/* Marks the Pareto front again: the points that no other beats in both ms and error. An error below that of the
 * reference counts as the reference's. The front is empty if the reference is not trusted. */
void pal_study_mark_front(pal_study *study);
/* Of the points of these methods, picks the cheapest whose error_m plus the reference's own error is at most
 * max_error_m, or the most accurate one with ms at most budget_ms (among those closer than the reference's error: the
 * cheapest). NaN: no such limit. With both limits: the cheapest that meets both. -1: none qualifies, or the reference
 * is not trusted. */
int pal_study_pick(const pal_study *study, const char *methods, double max_error_m, double budget_ms);
/* Is the model among the comma-separated methods ("": all)? */
bool pal_study_method_in(const char *methods, const char *model);
/* Predicts the error of a configuration between the measured ones, without the point leave_out (-1: use all). Fits
 * error = d size^-p along the sizes of configurations that are equal otherwise, or else what each parameter of the
 * model adds to the logarithm. False: too few points of the model, or none with this element, law, solver, step. */
bool pal_study_predict_error(const pal_study *study, const pal_configuration *configuration, int leave_out,
                             double *error_m);
/* Predicts the cost of a configuration that is made but has not run, from n_node nodes, n_element elements,
 * n_substep sub-steps of one of its steps at rest (body.h, pal_world_substeps) and the read time of its factor
 * (pal_study_point). It also uses the measured times of the other points of its model, without leave_out (-1: use
 * all), with their parameters, nodes and sub-steps; no time of the configuration itself. A step is modelled as a +
 * n_substep (n_element + c read_ms) r (study_cost.c). For an adaptive surface the counts are ignored, because the
 * refined share is not known before it runs: the share of the other levels and the sub-steps of its finest level
 * are used instead. False: fewer than three points of the model, none with this element, law or solver, or none
 * that adapts. */
bool pal_study_predict_cost(const pal_study *study, const pal_configuration *configuration, int n_node,
                            double n_element, int n_substep, double read_ms, int leave_out, double *ms);
#endif
