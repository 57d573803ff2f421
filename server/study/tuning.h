/* Tuning constants of a study: its loads, its reference, what is measured, and the fits that predict time and error.
 * Shares without a unit are of the body's diagonal unless said otherwise. Tests: tests/study/test_study.c (S),
 * test_study_scene.c (C), tests/accuracy (A), tests/house/test_study.sh (H). */
#ifndef PAL_STUDY_TUNING_H
#define PAL_STUDY_TUNING_H

/* s: steps of a display and of a haptic device; the longest step of a sweep, of statics and between the samples of a
 * trajectory; a step that every sweep has (S) */
#define PAL_STUDY_FRAME_S  (1.0 / 60)
#define PAL_STUDY_HAPTIC_S 1e-3
/* s: default duration of the dynamic run, which covers the overshoot of soft tissue (H) */
#define PAL_STUDY_SECONDS 0.5
/* solver tolerance of the base configuration, and of the reference, far below (S) */
#define PAL_STUDY_TOLERANCE     1e-2
#define PAL_REFERENCE_TOLERANCE 1e-4
/* ratio of the reference's size to the finest size of the sweep (A) */
#define PAL_REFERENCE_FINER 1.4

/* s, and share of the scene's step: largest step of the reference, as short as any in the sweep and of second order;
 * a quick study takes twice both (A) */
#define PAL_REFERENCE_STEP_S     (1.0 / 960)
#define PAL_REFERENCE_STEP_SHARE 0.25
/* nodes: limit of a reference, of a quick one, and of a refined quick one: some seconds for each load (H) */
#define PAL_REFERENCE_NODES     30000
#define PAL_QUICK_NODES         4000
#define PAL_QUICK_REFINED_NODES 12000
/* ratio of successive sizes of a reference (C) */
#define PAL_REFERENCE_RATIO 1.42
/* lowest order of convergence; below it changes are scatter of cut voxels, and the error is this times the larger (C)
 */
#define PAL_MIN_ORDER      1.0
#define PAL_SCATTER_MARGIN 1.25
/* error of the reference over the largest displacement at which it is trusted; a quick one is refined above half (H) */
#define PAL_STUDY_TRUST 0.3
/* share of its box that a box-shaped body fills (S) */
#define PAL_BOX_FILL 0.95
/* by which supports are extended, so that rounding excludes no node (S) */
#define PAL_SUPPORT_MARGIN 1e-7

/* half sides of the pressed and of the grasped area, a fingertip and a hand on an organ (C) */
#define PAL_PRESS_HALF 0.1
#define PAL_GRASP_HALF 0.06
/* largest displacement by a press; by the pull; by the pull of a wall, which folds; by the first trial load (C) */
#define PAL_PRESS_DEPTH 0.02
#define PAL_PULL_DEPTH  0.1
#define PAL_WALL_DEPTH  0.05
#define PAL_TRIAL_DEPTH 1e-3
/* sideways over outward component of the pull; N: its force if the scene has no tool (C) */
#define PAL_PULL_ASLANT 0.7
#define PAL_PULL_N      15.0
/* accepted factor between the wanted displacement and the reference's (C) */
#define PAL_PRESS_RANGE 1.5
/* size of the coarse body that scales loads over the reference's: a thin tip is too stiff in fewer voxels (C) */
#define PAL_COARSE_SIZE 0.6
/* share of the first load that acts suddenly: the overshoot reaches the displacement of the whole load (S) */
#define PAL_SUDDEN_LOAD 0.5

/* scripted press whose force is judged: s of its ramp, hold and way out; depth above the surface at its begin and end
 * over its depth; radius of a tool of default size; s: step of its reference, a tenth of the time in which contact
 * changes, twice that when quick (F, tests/study/test_force_error.c) */
#define PAL_FORCE_RAMP_S           1.0
#define PAL_FORCE_HOLD_S           0.5
#define PAL_FORCE_OUT_S            0.5
#define PAL_FORCE_S                (PAL_FORCE_RAMP_S + PAL_FORCE_HOLD_S + PAL_FORCE_OUT_S)
#define PAL_PRESS_GAP              0.2
#define PAL_TOOL_RADIUS            0.04
#define PAL_FORCE_REFERENCE_STEP_S (1.0 / 240)

/* relative residual at rest; relative change between peaks of kinetic energy that counts as rest (S) */
#define PAL_REST_TOLERANCE 1e-6
#define PAL_REST_CHANGE    1e-4
/* steps times nodes of finite elements that run to rest after Newton's method failed: a second (S) */
#define PAL_RELAX_WORK 1e6
/* ms: a trajectory repeats until its steps took this long: a median of some microseconds is unreliable (H) */
#define PAL_MIN_TIMED_MS 50.0
/* sub-steps times nodes above which a trajectory is only timed, and s of that: a minute and two seconds (H) */
#define PAL_MAX_WORK     1.5e9
#define PAL_ONLY_TIMED_S 2.0
/* s: processor time of a robustness case on a configuration (H) */
#define PAL_CASE_CPU_S 1.0
/* lower bound of fitted volume constants over the material's: inverted tetrahedra stay inverted without (H) */
#define PAL_MIN_VOLUME_RATIO 0.1

/* prediction of time: ridge weight of "no effect" of a parameter given so many configurations; weight of "no
 * residual" beside neighbours; parameters that are as distant as a factor e in nodes (S) */
#define PAL_COST_RIDGE     3e-2
#define PAL_COST_ENOUGH    30.0
#define PAL_COST_NEIGHBOUR 0.1
#define PAL_COST_PER_E     4.0
/* prediction of error: ridge weight, so that a parameter that was never varied has no effect; RMS residual of a
 * logarithm up to which a power law fits; m: smallest error that has a logarithm (S) */
#define PAL_ERROR_RIDGE 1e-4
#define PAL_LAW_RMS     0.05
#define PAL_MIN_ERROR_M 1e-12
#endif
