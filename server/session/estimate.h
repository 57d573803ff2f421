/* How far off a running body is, in parts (numerics.md part 2, "What accuracy costs, live"), while somebody looks.
 *
 * An estimator has a thread and worlds of its own. The simulation hands it a copy of its state and of the loads that it
 * bears, at most 4 times a second and only while it is wanted; then it solves, beside the running session:
 *   discretisation  the rest under those loads on this mesh and on one of twice its edge (Richardson): |u_h - u_2h| /
 *                   (2^p - 1); and in energy by the recovery of Zienkiewicz and Zhu (1987) on this mesh
 *   algebraic       what the solver's residual leaves, from its last conjugate gradients
 *   time            one step as it is against two of half of it, from the same state
 *   model           the rest by finite elements with the neo-Hookean law against that of the body's own rows
 * Nothing of it exists while nobody looks: no thread, no world, no copy. Thread: [sim] and its own. */
#ifndef PAL_SESSION_ESTIMATE_H
#define PAL_SESSION_ESTIMATE_H
#include "server/sim/setting.h"
#include "server/sim/world.h"

enum { PAL_ESTIMATE_NEIGHBOURS = 6 };

typedef struct pal_estimate {
    uint64_t tick; /* of the state that was looked at; 0: there is none yet */
    double time_s;
    double most_m; /* largest displacement then                              */
    /* largest displacement errors, m; NaN: not known for this body (note says why) */
    double error_m; /* of all parts together: their sum                       */
    double discretisation_m, algebraic_m, time_m, model_m;
    double zz_percent; /* energy norm of the error over that of the solution    */
    bool locking;      /* nearly incompressible in elements that lock: the estimate is too small (numerics.md) */
    double ms;         /* of a live step, median of the last second              */
    double own_ms;     /* processor time that this estimate took                 */
    /* next lower and higher choice on each knob, with what they are foreseen to cost and to leave */
    int n_neighbour;
    pal_priced_setting neighbour[PAL_ESTIMATE_NEIGHBOURS];
    char note[160];
} pal_estimate;

typedef struct pal_estimator pal_estimator;
/* worlds and thread for one body of a scene, which is borrowed. REFUSED: a body that cannot be estimated, one sentence;
 * MEMORY. Takes time (it makes meshes): on its own thread. [any] */
pal_err pal_estimator_open(const pal_scene *scene, int body, pal_note *note, pal_estimator **out);
void pal_estimator_close(pal_estimator *estimator); /* joins its thread; NULL is fine */
/* the state as it is now, if the estimator is free and it is time for another one; copies, never waits. [sim] */
void pal_estimator_look(pal_estimator *estimator, const pal_world *world, double step_ms);
bool pal_estimator_read(pal_estimator *estimator, pal_estimate *out); /* newest; false: none yet. [any] */
#endif
