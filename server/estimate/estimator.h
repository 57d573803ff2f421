/* The error of a running body, in parts, while somebody looks.
 *
 * An estimator has its own thread and worlds. The simulation gives it a copy of its state and loads, at most 4 times a
 * second and only while the estimator is idle. It then solves, beside the running session:
 *   borne           the loads under which the body would rest where it is: the acting loads less inertia and drag
 *                   (d'Alembert), so that a body that swings has an error as well
 *   discretisation  the rest under `borne` on this mesh and on its voxels merged by eights: the largest distance at
 * common nodes over 2^1.5 - 1 (Richardson; for a true order between 1 and 2 that is off by a factor of 0.55 to 1.64).
 * Where a third mesh shows no convergence yet, over 2^1 - 1, and the diagnostic says that the error may be larger: 0.4
 * to 2 times the true error was observed where the other rule gave a fifth. Springs: of finite elements on their
 * voxels. With many cut voxels, or two voxels across, that distance times what a hierarchy of meshes says is left
 * (estimate_hierarchy.h) energy          the same in the energy norm, by the recovery estimator of Zienkiewicz and Zhu
 * on this mesh; about twice too large for tetrahedra of ten nodes model           the largest distance between the rest
 * by the neo-Hookean law and by the body's own; of springs, between their positions and the rest of finite elements
 * (hex8_bbar, corotational); of calibrated springs, to the Richardson limit of these, with no separate part of
 * discretisation time            the steps of the next 0.1 s (12 at most) under constant loads against twice as many of
 * half the length, over 1 - 2^-order of the solver algebraic       the same steps against a solver with a tolerance of
 * 1e-9 Where a surface is displayed through a skin, distances are those at its vertices, by the elements, and the part
 * of discretisation (of springs: model) includes how far the skin is off its elements. Else distances are at nodes. A
 * tool stays where it is, whatever force another mesh needs there: loads of a felt tool are scaled until they press as
 * far (rest_solution.h). All parts are 0 while nothing has moved by more than 1e-9 of the body's size.
 *
 * error_m is the sum of the parts: above the true error where parts have opposite signs, below it where elements lock
 * or a small part is unknown. It is unknown where the discretisation, or of springs the model, is. It is 0.6 to 1.7
 * times the true error where nothing locks (tests/accuracy/test_effectivity.c), and 0.9 to 2.4 times for a ball that a
 * tool presses (tests/net/test_switch_bound.c). Components that are off are off in the estimator's worlds as well; a
 * moving support counts as standing. Of control cells (subdivision_fem) only the parts of time and solver are known; a
 * body that adapts is refused.
 *
 * Without an observer there is no thread, no world and no copy. Thread: as said at each function. */
#ifndef PAL_ESTIMATE_ESTIMATOR_H
#define PAL_ESTIMATE_ESTIMATOR_H
#include "server/estimate/estimate.h"

typedef struct pal_estimator pal_estimator;
/* Starts the thread of one body of a scene, which is borrowed until close, and returns; meshes and worlds are made on
 * that thread. What cannot be estimated is said in the note of the first estimate. REFUSED: no such body; MEMORY;
 * INTERNAL: no thread. Short enough for [sim]. [any] */
pal_err pal_estimator_open(const pal_scene *scene, int body, pal_diagnostic *diag, pal_estimator **out);
/* asks the thread to end as soon as it can; never waits. The estimator gives no more estimates. [any] */
void pal_estimator_request_stop(pal_estimator *estimator);
bool pal_estimator_has_stopped(const pal_estimator *estimator); /* the thread has ended: close does not wait. [any] */
void pal_estimator_close(pal_estimator *estimator);             /* leaves, joins the thread; NULL is fine */
/* After every step (step_ms NaN: none was made, as while paused): notes what it took, and copies the state as it is now
 * when the estimator is free and it is time for another one; of a body that sleeps once, until it wakes. Never waits,
 * takes no memory. One thread. [sim] */
void pal_estimator_observe(pal_estimator *estimator, const pal_world *world, double step_ms);
/* newest estimate; false: none yet, or none since the body was frozen and reset. While it is frozen: nothing is known,
 * and diag gives the reason. Copies. [any] */
bool pal_estimator_read(pal_estimator *estimator, pal_estimate *out);
/* how many threads of estimators there are in this process, and how many estimates they have made, for tests [any] */
int pal_estimator_threads(void);
uint64_t pal_estimator_count(void);
/* while held no estimator of this process takes another state, so that estimates grow old: for tests [any] */
void pal_estimator_pause_all(bool hold);
#endif
