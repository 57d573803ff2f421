/* Recovery of springs from inversion: what a lattice runs on where its tetrahedra are inverted
 * (recovery/inverted_regions.h).
 *
 * Where the volume of a tetrahedron falls below PAL_SPRING_INVERTED_LOW of that at rest, or rises above
 * PAL_INVERTED_HIGH of it, its nodes form a region: springs that end at one of them are off (constants of 0), and the
 * edges among these keep vectors in place of lengths, k_ij = k q_ij / l0^2 with their own constants, so that no
 * sub-step is shorter for it. Damping of the motion against the best-fit rotation, with tau = PAL_SPRING_DAMP_SHARE of
 * the time step that edges permit, removes waves of the lattice that drag alone would leave for seconds. A change of
 * one region leaves clocks and s of the others. While a tool or a load acts, no region is formed, since regions are
 * softer than springs. A body with a component gravity, or with a solver other than verlet and rk4, has no regions.
 *
 * The search is one pass over the volumes, 8 lanes at a time, whenever bounds of stiffness are computed (a node may
 * have moved by a fifth of an element), and in every step while there are regions. A body without volume springs is not
 * searched: inverted tetrahedra are a rest of its springs like any other. Memory: the body's arena. Thread: make
 * [load], else [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_RECOVERY_H
#define PAL_SIM_SPRINGS_SPRING_RECOVERY_H
#include "server/sim/core/effect.h"
#include "server/sim/recovery/inverted_regions.h"
#include "server/sim/springs/spring_set.h"

/* regions beyond this number share the last one's rotation */
enum { PAL_SPRING_REGIONS_MAX = 64 };

typedef struct pal_spring_recovery {
    int n_node;
    int32_t *region, *root; /* of each node, -1: in none; root of its connected component  [n_node] */
    double *node_sum;       /* for sums at nodes                                          [n_node] */
    pal_inverted_region of[PAL_SPRING_REGIONS_MAX];
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
