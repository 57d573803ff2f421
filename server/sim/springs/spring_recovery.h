/* Recovery of springs from inversion: what a lattice runs on where its tetrahedra are inverted.
 *
 * Springs of lengths, areas and volumes have states of balance that are not the body's: mirrored, folded, crumpled.
 * Where the volume of a tetrahedron falls below 0.01 of that at rest, or rises above 30 of it, its nodes form a region:
 * springs that end at one of them are off, and the edges among these keep vectors in place of lengths,
 *
 *     E = s min_G 1/2 sum_ij k_ij |(x_i - x_j) - G (X_i - X_j)|^2,   k_ij = k q_ij / l0^2,
 *
 * with their own constants, so that no sub-step is shorter for it, and one rotation G for a connected region. For a
 * given G the energy is convex with its only balance at X turned by G; at the best G its gradient is the one with G
 * fixed (envelope theorem), without net force or torque. A region of more than half of the free nodes takes the
 * rotation of the supports, where they have one.
 *
 * Motion against the best-fit rotation of its velocities is damped, f = -tau s k_ij (v_i - v_j - w x (x_i - x_j)). By
 * the normal equations of w this changes neither momentum nor angular momentum, and removes waves of the lattice that
 * drag alone would leave for seconds; tau is a quarter of the time step that edges permit.
 *
 * s <= 1 is such that regions begin with no more energy than their springs had. A region becomes springs again when all
 * its tetrahedra are between 0.2 and 20 of their volume, the springs would store little (a mean strain of about 0.2),
 * and the body's motion and springs would have no more energy than when regions first appeared; or after 2 s at rest,
 * where that adds next to nothing. A region that nothing loads and that does not recover takes in the nodes beside it
 * every half second. A change of one region leaves clocks and s of the others. While a tool or a load acts, no region
 * is formed, since regions are softer than springs. A body with a component gravity, or with a solver other than verlet
 * and rk4, has no regions.
 *
 * The search is one pass over the volumes, 8 lanes at a time, whenever bounds of stiffness are computed (a node may
 * have moved by a fifth of an element), and in every step while there are regions. Springs that are off have constants
 * of 0. A body without volume springs is not searched: inverted tetrahedra are a rest of its springs like any other.
 * Memory: the body's arena. Thread: make [load], else [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_RECOVERY_H
#define PAL_SIM_SPRINGS_SPRING_RECOVERY_H
#include "server/sim/core/effect.h"
#include "server/sim/springs/spring_set.h"

/* regions beyond this number share the last one's rotation */
enum { PAL_SPRING_REGIONS_MAX = 64 };

typedef struct pal_spring_region {
    bool fixed;     /* G is the rotation of the supports                                                */
    double turn[9]; /* G of the last update, force or energy                                            */
    double spin_1_s[3];
    double sum[9]; /* sum_ij k (x_i - x_j)(X_i - X_j)', which G fits best                               */
    double scale;  /* s                                                                                 */
    double region_J, spring_J, size_J; /* at the last update: its energy, that of its springs, sum of k q   */
    double kinetic_J;                  /* then, of its nodes                                                */
    int n;                             /* nodes                                                             */
    double grow_s, loose_s;            /* time since it last grew; time at rest without a bad tetrahedron   */
    bool stays;                        /* the last change left its nodes                                    */
    bool bad, pressed;                 /* a tetrahedron is not fit to leave; a load acts on a node          */
} pal_spring_region;

typedef struct pal_spring_recovery {
    int n_node;
    int32_t *region, *root; /* of each node, -1: in none; root of its connected component  [n_node] */
    double *room;           /* for sums at nodes                                          [n_node] */
    pal_spring_region of[PAL_SPRING_REGIONS_MAX];
    int n_region;
    double damp_s;  /* tau                                                                          */
    double first_J; /* of motion and springs when regions first appeared: the bound for leaving     */
    double k_J;     /* of the edges then                                                            */
    double seen_s;  /* world time of the last update                                                */
    bool stale;     /* the springs that are off do not match `region`                               */
} pal_spring_recovery;

/* MEMORY */
pal_err pal_spring_recovery_make(int n_node, pal_arena *arena, pal_spring_recovery **out);
/* no regions; springs are switched on at the next update */
void pal_spring_recovery_reset(pal_spring_recovery *t);
/* takes over the regions of the same body, with the same nodes, in another world */
void pal_spring_recovery_transfer(pal_spring_recovery *t, const pal_spring_recovery *from);
/* The member `recover` of the three kinds of springs (effect.h; self: a pal_spring_set). The first one of a body
 * examines the tetrahedra and chooses the springs that are off from now on; step->time_s is the time of the present
 * state. Counts in body->safeguards. No heap */
unsigned pal_spring_recover(void *self, pal_step *step);
/* adds the forces of the regions to body->f; edges: the body's edge springs. Timed in body->safeguards */
void pal_spring_recovery_force(pal_spring_recovery *t, const pal_spring_set *edges, pal_body *body);
/* energy of the regions, J */
double pal_spring_recovery_energy(pal_spring_recovery *t, const pal_spring_set *edges, const pal_body *body);
#endif
