/* The springs of a body together, as recovery from inversion (recovery/recovery.h) sees them: as elements.
 *
 * An element is a tetrahedron with its volume spring and an equal part of each of its edge and area springs, 1/n of one
 * that n tetrahedra share. So the energy of springs is a sum over elements, every tetrahedron that enters a region
 * takes exactly its part of it, and what it leaves is the gradient of an energy. A rule of all or
 * nothing would take springs from tetrahedra outside. The constant of a
 * region's edges is, of an element, the mean of its parts of k_ij = k q_ij/l0^2 weighted by l0^2: a region has the sum
 * of k_ij l0^2 that its elements give up, so it bears a pull as their edges do and asks for no shorter sub-step, but
 * for its damping (pal_recovery_damp).
 *
 * The ratio of volume is that of the volume spring; a tetrahedron without one (a sliver) is never inverted by itself.
 * The component of the volume springs runs recovery; a body without it or without edge springs has none, since inverted
 * tetrahedra are a rest of its springs like any other. Memory: the body's arena, and what a set adds its component's.
 * Thread: make, join, leave [load], else [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_LATTICE_H
#define PAL_SIM_SPRINGS_SPRING_LATTICE_H
#include "server/sim/recovery/recovery.h"
#include "server/sim/springs/spring_set.h"

typedef struct pal_spring_lattice {
    const pal_tets *tets;  /* borrowed from the body                                */
    pal_spring_set *of[3]; /* by kind; NULL: no component of this kind at present   */
    pal_recovery *recovery;
} pal_spring_lattice;

/* makes body->model.springs with a recovery, for a body of tetrahedra; MEMORY */
pal_err pal_spring_lattice_make(pal_body *body, pal_arena *arena);
/* A set enters the lattice of its body, the last thing that its component does in make; nothing without a lattice.
 * MEMORY: it has not entered */
pal_err pal_spring_lattice_join(pal_spring_set *set, const pal_build *build);
/* the set's component is removed: regions end, and all other springs act */
void pal_spring_lattice_leave(pal_spring_set *set);
#endif
