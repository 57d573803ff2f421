/* What accuracy costs: one body under the same loads in many configurations, each with its error against a converged
 * reference and its milliseconds per live step. README.md explains the loads, the reference and the measures; here are
 * the numbers that it leaves out. [load]
 *
 * Presses move the body by 2 % of its diagonal within a factor of 1.5, by a linear estimate and then by the reference's
 * own rest; a load under which the reference finds no rest is halved, up to four times. The dynamic run applies half of
 * the first load at once at rest, so that the swing goes about as far as the whole load at rest; runs of more
 * than 1.5e9 nodes times sub-steps are timed and marked as not followed. The reference runs with sdirk2 and 1/960 s
 * (quick: 1/480 s), or a quarter (a half) of the scene's step where that is shorter. Changes between its meshes that do
 * not shrink are the scatter of cut voxels, and the larger of them counts 1.25 times; a quick reference is refined, up
 * to 12,000 nodes, until its error is below 15 % of what moves most. Samples of the caller may replace it.
 *
 * Every method and size runs with the scene's own step, and beside it with a quarter and a half of it, twice it up to
 * 1/60 s, and 1/1000 s. A run repeats until its steps have taken 50 ms together (1,200 steps at most). All results but
 * the milliseconds and seconds are deterministic.
 *
 * A configuration on the front runs two robustness cases (study_robustness.c); one that fails without being stopped by
 * its guard says so in `reason` and leaves the front. Calibrated springs keep at least a tenth of the material's volume
 * stiffness; with one load only, `reason` says that they are judged by the load they were fitted to. */
#ifndef PAL_STUDY_STUDY_H
#define PAL_STUDY_STUDY_H
#include "server/sim/core/configuration.h"
#include "server/sim/core/problem.h"
#include "server/solve/sample_points.h"

#include <stdint.h>

enum { PAL_STUDY_POINTS = 256, PAL_STUDY_LOADS = 4, PAL_STUDY_TRAJECTORY = 512 };

typedef struct pal_study_point {
    pal_measured_configuration
        measured; /* error_m: the larger of static_max_m and trajectory_max_m; NaN: not measured */
    pal_err err;  /* not OK: it could not be measured, why says the reason ("needs 8,000 sub-steps") */
    char reason[PAL_CONFIGURATION_TEXT]; /* or what is to be known of a measured one: "fitted to the load it is judged
                                            by" */
    int n_node, n_substep;               /* of a step at rest; both of a surface that adapts: as they are at the end */
    double ms_p95;
    double static_rms_m, static_max_m; /* over all probes and loads; percent of the largest displacement: / max_m */
    double trajectory_rms_m, trajectory_max_m; /* of the point that the first load moves most, over time */
    double prepare_s; /* mesh and world                                                           */
    double n_element; /* finite elements; 0: it has none, or they were not kept */
    double read_ms; /* reading its solver's factor forwards and backwards, as fast as this machine reads as much as its
                       world holds: known before it runs; 0: there is none */
    double predicted_ms, predicted_m; /* by the models of cost and error fitted to the OTHER points of its method, once
                                         all are there, and to what is counted before it runs (pal_study_predict_cost);
                                         NaN: too few of them */
} pal_study_point;

typedef struct pal_study {
    char name[PAL_NAME];   /* of scene or problem                                      */
    char machine[128];     /* processor and cores, as the system names it               */
    char reference[160];   /* how the reference was made, for people                    */
    double reference_m;    /* its own estimated error                                   */
    double max_m;          /* largest displacement of the reference                     */
    double length_scale_m; /* box diagonal of the body                                  */
    double step_s;         /* of the scene, for "real time"                             */
    int n_point;
    pal_study_point point[PAL_STUDY_POINTS];
} pal_study;

/* where a body rests, or the way it goes, as part of the reference: what is kept of it beside the numbers */
typedef struct pal_study_answer {
    pal_err err; /* OK, or NUMERIC and FROZEN: there is none */
    int n_node;
    char reason[PAL_CONFIGURATION_TEXT];
} pal_study_answer;

typedef struct pal_study_options {
    const char *const
        *method; /* models to sweep [n_method]; 0: all that fit; "tet_springs" is swept calibrated as well */
    int n_method;
    int body;                   /* of the scene                                                              */
    double seconds;             /* of the dynamic run; 0: 0.5                                                */
    int quick;                  /* 1: few settings and a coarser reference, for tests and CI                 */
    const pal_samples *samples; /* static reference of the first load; NULL: made here                      */
    /* points that were measured before (a run that was broken off): taken over, not measured again; NULL: none */
    const pal_study *before;
    /* [load] answers of the reference, under a sum of setting, load and points: those of the same body, loads and
     * machine that were kept are not worked out again. recall: false when there is none of that sum and of n numbers,
     * which are then untouched; both may be NULL */
    bool (*recall)(uint64_t key, pal_study_answer *answer, double *value, int n, void *user);
    void (*remember)(uint64_t key, const pal_study_answer *answer, const double *value, int n, void *user);
    /* [load] after every point: the study so far, to be kept; may be NULL. False stops with STATE */
    bool (*done)(const pal_study *study, int n_finest, void *user);
    bool (*progress)(const char *what, double fraction, void *user); /* may be NULL; false stops with STATE */
    bool (*may_continue)(
        void *user); /* asked between the steps of whatever runs; may be NULL; false stops with STATE */
    void *user;
} pal_study_options;

/* sweeps; out (large: on the heap) is whole up to where it came, also after an error. REFUSED: no such body, no method
 * fits, a load that meets nothing; STATE: stopped; MEMORY */
pal_err pal_study_scene(const pal_scene *scene, const pal_study_options *options, pal_study *out, pal_diagnostic *diag);
pal_err pal_study_problem(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                          const pal_study_options *options, pal_study *out, pal_diagnostic *diag);
/* the scene that a problem's body would be served as: material, supports, tools; *out owns its mesh
 * (pal_configured_scene_free)
 */
pal_err pal_study_problem_scene(const pal_problem *problem, const pal_surface *surface, pal_diagnostic *diag,
                                pal_configured_scene **out);

/* share of max_m that the reference's own error may be before nothing that is measured against it is worth naming */
#define PAL_STUDY_TRUST 0.3
/* is the reference worth its name? [any] */
bool pal_study_trusted(const pal_study *study);
/* marks the front anew: points that no other beats in both ms and error, where an error below the reference's own
 * counts as that; none when the reference is not to be trusted */
void pal_study_mark_front(pal_study *study);
/* the cheapest point with error_m (plus the reference's own error) at most max_error_m, or the most accurate one with
 * ms at most budget_ms (of those nearer than the reference's own error the cheapest); the one that is not asked for is
 * NaN; both: cheapest that keeps both. -1: none serves, or the reference is not to be trusted */
int pal_study_pick(const pal_study *study, double max_error_m, double budget_ms);
/* cost and error predicted for a setting between those measured, leave_out (-1: none) being no part of them: by ms = a
 * + b n^c and error = d size^-p along the sizes of settings that are the same but for them, or by what each parameter
 * of the model adds to the logarithms; false: too few points of the model, or none with such an element, law, solver,
 * step */
bool pal_study_predict_configuration(const pal_study *study, const pal_configuration *setting, int leave_out,
                                     double *ms, double *error_m);
/* Cost predicted for a setting that is made and has not run: of n_node nodes, n_element elements and n_substep
 * sub-steps in a step of its own at rest (body.h, pal_world_substeps), and what reading its factor takes
 * (pal_study_point). Known for that: what the other points of its model took, leave_out (-1: none) being no part of
 * them, with their parameters, nodes and sub-steps; of the setting its own parameters and these; no time of it. A step
 * of its own is a + n_substep (n_element + c read_ms) r (study_cost.c). Of a surface that adapts neither count is
 * looked at, as how much of it is refined is not known before it runs: the share is that of what the other levels
 * refined, sub-steps are those of its finest level. false: fewer than three points of the model, none with such an
 * element, law or solver, or none that adapts */
bool pal_study_predict_cost(const pal_study *study, const pal_configuration *setting, int n_node, double n_element,
                            int n_substep, double read_ms, int leave_out, double *ms);
#endif
