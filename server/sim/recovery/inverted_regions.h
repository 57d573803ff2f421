/* Regions of inverted elements: what they run on until they have recovered. A model
 * (subdivision/cell_kernel.h) detects inversion and chooses the elements of each region.
 *
 * Elements, and lattices of springs, have states of balance that are not the body's shape at rest: mirrored, folded,
 * crumpled. In a region the edges of its elements act instead, as vectors,
 *
 *     E = s min_G 1/2 sum_ij k_ij |(x_i - x_j) - G (X_i - X_j)|^2,
 *
 * one rotation G for a connected region. For a given G the energy is convex with its only balance at X turned by G; at
 * the best G its gradient is the one with G fixed (envelope theorem), without net force or torque. A region of more
 * than half of the body takes the rotation of the supports, where they have one.
 *
 * s <= 1 is such that a region begins with no more energy than its elements had. It becomes elements again when none of
 * them is still inverted, they would store little (a mean strain of about 0.2), and body and elements have no more
 * energy than when regions first appeared; or after PAL_REGION_LEAVE_S at rest. A region that does not recover takes in
 * what is beside it every PAL_REGION_GROW_S. Thread: [sim]. No memory of its own. */
#ifndef PAL_SIM_RECOVERY_INVERTED_REGIONS_H
#define PAL_SIM_RECOVERY_INVERTED_REGIONS_H
#include "server/sim/core/body.h"
#include "server/sim/recovery/tuning.h"

typedef struct pal_inverted_region {
    bool fixed;         /* G is the rotation of the supports                                      */
    double rotation[9]; /* G of the last fit                                                      */
    double spin_1_s[3]; /* best-fit spin of the velocities, for damping                           */
    double sum[9];      /* sum_ij k (x_i - x_j)(X_i - X_j)', which G fits best                    */
    double scale;       /* s                                                                      */
    /* at the last update: its energy, that of its elements, the sum of their moduli times volume, of its motion */
    double region_J, element_J, size_J, kinetic_J;
    int n;                  /* nodes or elements                                                  */
    double grow_s, loose_s; /* time since it last grew; time at rest without an inverted element  */
    bool stays;             /* the last change left it as it was                                  */
    bool bad, pressed;      /* an element is not fit to leave; a load acts on a node              */
} pal_inverted_region;

typedef struct pal_region_edge {
    int32_t end[2], region, owner; /* nodes, and whatever k is found by */
} pal_region_edge;
/* the edges in regions [n] and k of one by its owner, N/m */
typedef struct pal_region_edges {
    int n;
    const pal_region_edge *edge;
    double (*stiffness)(const void *self, int owner);
    const void *self;
    const double *rest; /* nodes at rest, m [][3] */
} pal_region_edges;

/* best-fit G at d of the n regions without a fixed one */
void pal_regions_fit(pal_inverted_region *of, int n, const pal_region_edges *edges, const double *d);
/* Energy at d with the present G, J, added to each region's region_J. f (NULL: none) += forces, with those of damping
 * f = -damp_s s k (v_i - v_j - w x (x_i - x_j)) when damp_s > 0, by velocities v (else NULL). As w fits the velocities
 * best, damping changes neither momentum nor angular momentum */
double pal_regions_energy(pal_inverted_region *of, int n, const pal_region_edges *edges, const double *d,
                          const double *v, double damp_s, double *f);
/* Takes the rotation of the supports for regions that are fixed. n_all: how many nodes or elements the body has, of
 * which a region has more than half to become fixed; 0: none becomes fixed */
void pal_regions_fix(pal_inverted_region *of, int n, const pal_body *body, int n_all);
/* sum of region_J */
double pal_regions_sum_J(const pal_inverted_region *of, int n);
/* Chooses the regions that become elements again, whose n becomes 0; true: any. spare_J: energy that returns may add in
 * all; max_share: largest element_J over size_J; little_J: what a region may add after PAL_REGION_LEAVE_S with less
 * kinetic_J than rest_J */
bool pal_regions_leave(pal_inverted_region *of, int n, double spare_J, double max_share, double little_J, double rest_J,
                       double passed_s);
/* does the region take in what is beside it now? Not while `blocked` */
bool pal_region_grows(pal_inverted_region *region, bool blocked);
#endif
