/* Loads that a hand made (paper B section 3.2): the contact forces on one body while a recorded session is replayed.
 *
 * Displacements are from where the body is before the first touch: at rest, or sunk under its weight. A touch begins
 * with the first force of a tool and ends when none has acted for PAL_TOUCH_GAP_S. Of each touch the stillest moment is
 * a load: among the steps with at least PAL_HELD_SHARE of the touch's largest displacement, the one in which the body
 * moves least for its displacement. (The largest force is often that of the impact.) Forces and motion are averaged
 * there over the last PAL_HELD_MEAN_S, because contact forces of explicit solvers vary from sub-step to sub-step. A
 * load has a force on each touched node at rest, so it can be applied to any mesh of the same organ.
 *
 * A release is the motion after a touch, as the rms displacement of the body (weighted by mass) at every step, with all
 * forces by step since the body was at rest, so that another body can be brought to the same release. The one that
 * begins with the largest displacement is kept. Thread: [load]. Allocates heap memory. */
#ifndef PAL_CALIBRATE_RECORDED_LOADS_H
#define PAL_CALIBRATE_RECORDED_LOADS_H
#include "server/calibrate/calibrate.h"
#include "server/sim/world/world.h"

/* at points of the body at rest, frame of the surface's file */
typedef struct pal_recorded_load {
    char id[PAL_NAME]; /* "press-1", "pull-2": by time, a pull is grasped                          */
    double time_s;     /* simulated, since the world was made                                      */
    double total_N[3]; /* on the body                                                              */
    double size_N;     /* sum of the sizes of all forces                                           */
    double speed_1_s;  /* rms speed over rms displacement                                          */
    int n_point, n_node;
    double *x, *force_N; /* [n_point][3]                                                             */
    double *node_x, *u;  /* nodes and their displacement, m [n_node][3]                             */
} pal_recorded_load;

typedef struct pal_recorded_release {
    double time_s, step_s; /* when the last force ended; of motion and forces                        */
    int n_x, n_step, n;
    double *x;              /* points that were loaded [n_x][3]                                   */
    int32_t *first, *point; /* forces of step k since rest: first[k] to first[k + 1] [n_step + 1] */
    double *force_N;        /* [first[n_step]][3]                                                 */
    double *rms_m;          /* every step_s from then on [n]                                      */
} pal_recorded_release;

typedef struct pal_recorded_loads {
    int body;
    pal_material material; /* of the body when it was first touched                                    */
    int n;
    pal_recorded_load load[PAL_CALIBRATE_CASES]; /* by time */
    bool has_release;
    pal_recorded_release release;
    char no_release[160]; /* why there is none; "": there is */
} pal_recorded_loads;

typedef struct pal_load_recorder pal_load_recorder;
/* watches a body of a world of this scene, which is borrowed; MEMORY */
pal_err pal_load_recorder_create(const pal_scene *scene, int body, pal_load_recorder **out);
void pal_load_recorder_destroy(pal_load_recorder *recorder); /* accepts NULL */
/* after each step of the world. A lack of memory is reported by pal_load_recorder_end */
void pal_load_recorder_step(pal_load_recorder *recorder, const pal_world *world);
/* largest size_N of the touches that have ended */
double pal_load_recorder_max_N(const pal_load_recorder *recorder);
void pal_load_recorder_stop(pal_load_recorder *recorder); /* after the last step: ends a touch */
/* The touches with the largest forces, those below PAL_TOUCH_SHARE of the largest left out. Errors: REFUSED: nothing
 * was touched, or the material was changed between touches; MEMORY. Free *out in any case. */
pal_err pal_load_recorder_end(pal_load_recorder *recorder, pal_recorded_loads *out, pal_diagnostic *diag);
/* Multiplies the forces of all loads; releases keep theirs. */
void pal_recorded_loads_scale(pal_recorded_loads *loads, double factor);
void pal_recorded_loads_free(pal_recorded_loads *loads); /* accepts a zeroed struct */
#endif
