/* How far off a running body is, in parts (numerics.md part 2, "What accuracy costs, live"), while somebody looks.
 *
 * An estimator has a thread and worlds of its own. The simulation hands it a copy of its state and of the loads that it
 * bears, at most 4 times a second and only while the estimator is free; then it solves, beside the running session:
 *   borne           loads under which the body would rest where it is: what acts less what accelerates it and what drag
 *                   takes (d'Alembert), so that what swings free errs as well; at rest they are what acts
 *   discretisation  the rest under `borne` on this mesh and on its voxels merged by eights: the largest distance at
 *                   nodes that both have, over 2^1.5 - 1 (Richardson; for any true order from 1 to 2 that is off by a
 *                   factor of 0.55 to 1.64). Where that distance is no smaller than the one from there to voxels merged
 *                   once more, over 2^1 - 1, and the note says that more may be left: 0.4 to 2 times the truth was seen
 *                   where the other gave a fifth. Springs: of finite elements on their voxels.
 *                   Of finite elements where many voxels are cut, or there are two across: that distance, times what
 *                   meshes of other sizes that are made and solved beside it say is left (estimate_hierarchy.h)
 *   zz              the same in energy, by the recovery of Zienkiewicz and Zhu (sim/zz_estimator.h) on this mesh; about
 *                   twice too large for tetrahedra of ten nodes
 *   model           the largest distance between the rest by the neo-Hookean law and by the body's own; of springs:
 *                   between where they are and where finite elements (hex8_bbar, corotational) come to rest; of
 *                   springs with constants of their own, which were fitted to converged finite elements: where
 *                   Richardson carries these to, and no part of discretisation beside it
 *   time            what the steps of the next tenth of a second (12 at most) are off, the loads staying as they are:
 *                   those steps against twice as many of half the length, over 1 - 2^-order of the solver
 *   algebraic       the same steps against those of a solver that leaves next to nothing
 * Where a surface is shown that hangs on the nodes by a skin, distances of meshes and of springs are those at its
 * vertices, by the elements, and discretisation (of springs: model) has in it how far the skin hangs off its elements.
 * Others: at nodes. A tool is held where it is, whatever another mesh makes of its force: while one is felt, loads are
 * taken as many times as press as far (rest_solution.h). Of a ball that a tool presses the sum is 0.9 to 2.4 times what
 * its surface is off, under its weight alone 0.6 to 1 (net/test_switch_bound).
 * None of them is there (0) while nothing has moved by more than 1e-9 of the body's size.
 * error_m is their sum, which is above the truth where parts have opposite signs, and below it where elements lock or
 * a small part is not known. There is none where the discretisation is not known, or of springs the model.
 * tests/accuracy/test_effectivity.c has what the estimate is over the truth: 0.6 to 1.7 where nothing locks. Rows that
 * are switched off are off in its worlds as well. A moving
 * support counts as standing where it is. Of control cells (subdivision_fem) time and algebraic part alone are known
 * and so no sum, of bodies that adapt nothing.
 *
 * Nothing of it exists while nobody looks: no thread, no world, no copy. Thread: as said at each function. */
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
/* newest; false: none yet, or none since the body was frozen and reset. While it is frozen: nothing known, and why.
 * Copies. [any] */
bool pal_estimator_read(pal_estimator *estimator, pal_estimate *out);
/* how many threads of estimators there are in this process, and how many estimates they have made, for tests [any] */
int pal_estimator_threads(void);
uint64_t pal_estimator_count(void);
/* while held no estimator of this process takes another state, so that estimates grow old: for tests [any] */
void pal_estimator_pause_all(bool hold);
#endif
