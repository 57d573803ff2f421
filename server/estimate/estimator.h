/* The error of a running body, in parts, while a client subscribes to it. Without a subscriber there is no thread,
 * world or copy.
 *
 * An estimator has its own thread and worlds. The simulation gives it a copy of the body's state and loads, at most
 * 4 times a second and only while the estimator is idle. The estimator then solves, beside the running session:
 *   borne           The loads under which the present shape is an equilibrium: the acting loads less inertia and drag
 *                   (d'Alembert), so that a swinging body has an estimate as well.
 *   discretisation  The equilibrium under `borne` on this mesh and on its voxels merged by eights: the largest distance
 *                   over 2^1.5 - 1 (Richardson), or 2^1 - 1 with a warning if a third mesh shows no convergence yet
 *                   (PAL_USUAL_ORDER). Springs: of finite elements on their voxels. With many cut voxels, or two voxels
 *                   across, scaled by what a mesh hierarchy measures (estimate_hierarchy.h).
 *   energy          The same in the energy norm, by the Zienkiewicz-Zhu recovery estimator on this mesh. About twice
 *                   too large for tetrahedra of ten nodes.
 *   model           The largest distance between the equilibria of the neo-Hookean law and of the body's own law.
 *                   Springs: between their positions and the equilibrium of finite elements (hex8_bbar, corotational);
 *                   calibrated: to its Richardson limit, with no separate part for discretisation.
 *   force           The loads of tools with which these equilibria are pressed as far, extrapolated like
 * discretisation. time            The steps of the next 0.1 s (at most 12) under constant loads against twice as many
 * of half the length, over 1 - 2^-order of the solver. algebraic       The same steps against a solver with tolerance
 * 1e-9. Distances are taken at the vertices of a displayed skin by element interpolation, and the discretisation part
 * (springs: model) includes the distance of the skin from its elements; without a skin they are taken at nodes. The
 * loads of a haptic tool are scaled until they press equally far (rest_solution.h). All parts are 0 until something has
 * moved by more than 1e-9 of the body's size.
 *
 * error_m is the sum of the parts, unknown if the discretisation part (springs: the model part) is. It exceeds the true
 * error where parts have opposite signs, and falls short where elements lock. It is 0.6 to 1.7 times the true error
 * where nothing locks (tests/accuracy/test_effectivity.c), 0.9 to 2.4 times for a ball pressed by a tool
 * (tests/net/test_switch_bound.c). Components that are off are also off in the estimator's worlds; a moving support
 * counts as stationary. For control cells only the time and algebraic parts are known; an adaptive body is refused. */
#ifndef PAL_ESTIMATE_ESTIMATOR_H
#define PAL_ESTIMATE_ESTIMATOR_H
#include "server/base/clock.h"
#include "server/estimate/estimate.h"

typedef struct pal_estimator pal_estimator;
/* Starts the estimator thread of one body and returns; that thread makes meshes and worlds. Borrows the scene until
 * close. `clock` times the estimates (NULL: pal_clock_monotonic). The thread wakes it after each estimate, when it is
 * ready for a state, and when it ends. The diagnostic of the first estimate reports what cannot be estimated. Errors:
 * REFUSED: no such body; MEMORY; INTERNAL: no thread. Short enough for [sim]. [any] */
pal_err pal_estimator_open(const pal_scene *scene, int body, const pal_clock *clock, pal_diagnostic *diag,
                           pal_estimator **out);
/* Asks the thread to end soon; never waits. The estimator gives no more estimates. [any] */
void pal_estimator_request_stop(pal_estimator *estimator);
/* true: the thread has ended, so close does not wait. [any] */
bool pal_estimator_has_stopped(const pal_estimator *estimator);
void pal_estimator_close(pal_estimator *estimator); /* requests a stop, joins the thread; accepts NULL */
/* Call after every step; step_ms is its time (NaN: no step was made, for example while paused). Records the time,
 * and copies the state when the estimator is idle and the next estimate is due. A sleeping body is copied once
 * until it wakes. Never waits, takes no memory. One thread. [sim] */
void pal_estimator_observe(pal_estimator *estimator, const pal_world *world, double step_ms);
/* Copies the newest estimate. False: none yet, or none since the body was frozen and reset. While the body is
 * frozen all values are unknown and diag gives the reason. [any] */
bool pal_estimator_read(pal_estimator *estimator, pal_estimate *out);
/* number of estimator threads in this process, and of estimates they have made; for tests [any] */
int pal_estimator_threads(void);
uint64_t pal_estimator_count(void);
#endif
