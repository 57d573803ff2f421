/* Untangling of springs: what a lattice runs on where its tetrahedra are turned over (numerics.md part 3).
 *
 * Springs of lengths, areas and volumes have rests that are none of the body: mirrored, folded, crumpled. Where a
 * tetrahedron's volume falls below 0.01 of that at rest, or rises above 30 of it, its nodes are taken out: every spring
 * that ends at one of them is off, and the edges among these keep vectors in place of lengths,
 *
 *     E = s min_G 1/2 sum_ij k_ij |(x_i - x_j) - G (X_i - X_j)|^2,   k_ij = k q_ij / l0^2,
 *
 * with the constants that they have, so that no sub-step is shorter for it, and one rotation G for what hangs together
 * (a patch). This is what solids of cells untangle by (cell_recovery.h, which says why): for a given G it is convex,
 * its only rest is X turned by G, and forces are the exact gradient, without net force or torque. A patch of more than
 * half of the free nodes takes the rotation of what is held, where that has one: then it has no torque of its own
 * choice, as supports have none either.
 *
 * What moves against the rotation that fits its velocities best is damped, f = -tau s k_ij (v_i - v_j - w x (x_i -
 * x_j)): by the normal equations of w this takes no momentum and no angular momentum, and lattice waves are gone where
 * drag alone would take seconds; tau is a quarter of the time that edges give the explicit step.
 *
 * s <= 1 of a patch is such that patches begin with no more energy than the springs had. A patch becomes springs again
 * when all its tetrahedra are between 0.2 and 20 of their volume, the springs would store little (a strain of 0.2 or so
 * in mean), and the body's motion and springs then have no more energy than when patches first were; or after 2 s in
 * which the patch stood still, where that adds next to nothing. A patch that nothing presses and that does not come
 * loose takes in the nodes beside it every half second. What another patch does leaves its times and its s as they are.
 * While anything presses or pulls the body nothing is taken out, since patches are softer than springs: a tool goes on
 * to feel springs. A body with a row gravity or with another solver than verlet and rk4 has no patches at all.
 *
 * These look where they take the bounds of stiffness anew, which is where a node may have moved a fifth of an element,
 * and in every step while there are patches (effect.h, untangle): one pass over volumes, 8 lanes at a time. Rows and
 * their loops are the same as without, constants of what is off are 0. Springs without a row of volumes are not looked
 * at: turned over is as good a rest to them as any. Memory: the body's arena. Thread: make [load], else [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_RECOVERY_H
#define PAL_SIM_SPRINGS_SPRING_RECOVERY_H
#include "server/sim/core/effect.h"
#include "server/sim/springs/spring_set.h"

/* what is beyond shares the last one's rotation */
enum { PAL_SPRING_REGIONS_MAX = 64 };

typedef struct pal_spring_region {
    bool fixed;     /* G is that of what is held                                                         */
    double turn[9]; /* G of the last look, force or energy                                               */
    double spin_1_s[3];
    double sum[9]; /* sum_ij k (x_i - x_j)(X_i - X_j)', which G fits best                               */
    double scale;  /* s                                                               */
    double patch_J, spring_J, size_J; /* at the last look: its energy, that of its springs, sum of k q   */
    double kinetic_J;                 /* then, of its nodes                                              */
    int n;                            /* nodes                                                           */
    double grow_s, loose_s;           /* since it could grow; for which nothing in it was bad and it stood still */
    bool stays;                       /* its nodes are those that it had before the last change */
    bool bad, pressed; /* a tetrahedron is too much turned over to leave; a load acts on a node          */
} pal_spring_region;

typedef struct pal_spring_recovery {
    int n_node;
    int32_t *patch, *root; /* of each node, -1: it is in none; of nodes that hang together [n_node] */
    double *room;          /* for sums at nodes                                             [n_node] */
    pal_spring_region of[PAL_SPRING_REGIONS_MAX];
    int n_patch;
    double damp_s;  /* tau                                                                           */
    double first_J; /* of motion and springs when there first were patches: what may be again   */
    double k_J;     /* of the edges then                                                        */
    double seen_s;  /* world time of the last look                                              */
    bool stale;     /* rows may have others switched off than nodes say                         */
} pal_spring_recovery;

/* MEMORY */
pal_err pal_spring_recovery_make(int n_node, pal_arena *arena, pal_spring_recovery **out);
/* no patches; rows are told at the next look */
void pal_spring_recovery_reset(pal_spring_recovery *t);
/* goes on where that of the same body in another world is: as many nodes, and the same ones */
void pal_spring_recovery_transfer(pal_spring_recovery *t, const pal_spring_recovery *from);
/* looks at the tetrahedra and chooses what springs are off from now on, step->time_s being the time at which the body
 * is as it is. Counted in body->rescue. Returns what the hook `untangle` does. No heap */
unsigned pal_spring_recovery_update(pal_spring_recovery *t, pal_step *step);
/* the hook `untangle` of the three rows of springs (self: a pal_spring_set): the first of the body's looks for all */
unsigned pal_spring_recover(void *self, pal_step *step);
/* forces of the patches to body->f; row: the body's edges. Timed in body->rescue */
void pal_spring_recovery_force(pal_spring_recovery *t, const pal_spring_set *row, pal_body *body);
/* energy of the patches, J */
double pal_spring_recovery_energy(pal_spring_recovery *t, const pal_spring_set *row, const pal_body *body);
#endif
