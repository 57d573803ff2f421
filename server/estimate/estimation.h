/* What an estimator computes, without its thread: the parts of the error of one body in one state (estimator.h). Heap
 * memory; everything here is slow. Thread: one at a time. */
#ifndef PAL_ESTIMATE_ESTIMATION_H
#define PAL_ESTIMATE_ESTIMATION_H
#include "server/estimate/estimator.h"

#include <stdatomic.h>

/* said of a body that sleeps */
#define PAL_ESTIMATE_ASLEEP "asleep: ms are those of a step awake"
enum { PAL_ESTIMATE_STEPS = 256, PAL_ESTIMATE_COMPONENTS = 2 * PAL_ENTRIES_MAX };

/* of a step that the body was awake in. Shares are of the time of all bodies' rows; what is left of 1 is the body's own
 * forces and solver, which go with its mesh */
typedef struct pal_estimate_cost {
    float ms;     /* of all bodies */
    float once;   /* share of what is done once a step: refinement, guards, what is shown */
    float beside; /* share of what is done in each sub-step beside them: contact, other bodies */
} pal_estimate_cost;

/* a body as it is after a step; arrays are the work's, filled by pal_estimate_copy */
typedef struct pal_estimate_state {
    uint64_t tick;
    double time_s;
    int n_dof, n_node;
    double *x, *v;          /* m, m/s [n_dof][3] */
    double *load;           /* lasting and contact loads, N [n_node][3] */
    double *external_force; /* of load: what lasts, N [n_node][3] */
    double *borne;          /* loads under which it would rest at x, N [n_node][3]; the work finds them itself */
    bool asleep;
    bool touched;         /* a tool presses or pulls */
    int n_substep;        /* of the step */
    double other_limit_s; /* longest sub-step that all other bodies allow */
    pal_material material;
    /* FORCE rows of the body: names from open on, and which of them are not switched off */
    const char *row[PAL_ESTIMATE_COMPONENTS];
    bool component_enabled[PAL_ESTIMATE_COMPONENTS];
    int n_row;
    pal_estimate_cost cost[PAL_ESTIMATE_STEPS]; /* of the last steps awake, any order */
    int n_cost;
} pal_estimate_state;

typedef struct pal_estimation pal_estimation;
/* meshes and worlds for one body of a scene, which is borrowed; ends early with STATE when *stop is set (NULL: never).
 * REFUSED: no such body, or one of which nothing can be estimated (one sentence); MEMORY */
pal_err pal_estimation_open(const pal_scene *scene, int body, const _Atomic bool *stop, pal_diagnostic *diag,
                            pal_estimation **out);
void pal_estimation_close(pal_estimation *work); /* NULL is fine */
pal_estimate_state *pal_estimation_state(pal_estimation *work);
/* the state of `body` of a world made from the scene; false: that is no state to look at (not finite, frozen, another
 * number of points). Copies, no memory. [sim] */
bool pal_estimate_copy(pal_estimate_state *state, const pal_world *world, int body);
/* of the world's last step, which took step_ms. No memory. [sim] */
pal_estimate_cost pal_estimate_cost_of(const pal_world *world, int body, double step_ms);
/* the rows of a world of the same body, made from `scene`, as those of the state; recipe: rows of the model too, which
 * is the state's. What pal_world_switch_component gives. Heap memory */
pal_err pal_estimate_match_components(const pal_estimate_state *state, pal_world *world, const pal_scene *scene,
                                      bool recipe);
/* estimates the state; false: it was stopped */
bool pal_estimation_run(pal_estimation *work, pal_estimate *out);
#endif
