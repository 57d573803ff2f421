/* Untangling of subdivided solids: what elements run on while they are turned over (numerics.md part 3).
 *
 * Elements with one rotation each have rests that are none of the body: folded, mirrored, crumpled. Where an element's
 * volume at one of 8 points falls below 0.05 of that at rest, or rises above 30 of it, it and its neighbours become
 * patches, which have no elements but a spring in space for each edge of their cells:
 *
 *     E = s min_G 1/2 sum_ij k |(x_i - x_j) - G (X_i - X_j)|^2,   k = 3 mu V / (n sum of |X_ij|^2 / n),
 *
 * n edges of an element of volume V: the Dirichlet energy of x - G X, one rotation G for a whole patch. For a given G
 * it is convex, and at the best one its gradient is that of the sum with G held (envelope theorem), so that forces are
 * the exact gradient and have no net force and no net torque; where it is at rest, the patch is X turned by G. A patch
 * of more than half of the body takes the rotation of what is held, where that has one.
 *
 * s <= 1 is such that a patch begins with no more energy than its elements had. It becomes elements again when none of
 * them is below 0.3 (above 20) any more, they store at most 0.1 mu V, and the body's motion and this row then have no
 * more energy than when patches first were, or after 120 looks in a row at a body that stands still (loads hold it). A
 * patch that does not come loose takes in its neighbours every 30 looks, unless a lasting load or weight pulls at the
 * body: then s goes back to 1, by a quarter every 4 looks, since what hangs by a soft patch is let out by 1 / s. What
 * that puts in is braked away (stiffened_J, stiffening_damper.h), or it would throw the body about and turn over more
 * of it. Half blocks of nothing but elements in patches are not run, except for their energies in a look and to
 * linearise. Memory: the world's arena. Thread: make [load], else [sim]. */
#ifndef PAL_SIM_SUBDIVISION_CELL_RECOVERY_H
#define PAL_SIM_SUBDIVISION_CELL_RECOVERY_H
#include "server/sim/core/body.h"
#include "server/sim/subdivision/subdivision_solid.h"

struct pal_cells_elastic;

typedef struct pal_cell_region {
    bool fixed;                         /* G is that of what is held */
    double scale;                       /* s */
    double turn[9];                     /* G of the last look, force or energy */
    double sum[9];                      /* sum_ij k (x_i - x_j)(X_i - X_j)', which G fits best */
    double patch_J, element_J, shear_J; /* at the last look: its energy, that of its elements, mu V */
    int n;          /* elements                                                                     */
    int age, loose; /* looks since it grew; in a row in which nothing was turned over or moved     */
    bool bad;       /* an element is too much turned over to leave                                  */
} pal_cell_region;

typedef struct pal_cell_recovery {
    int n_cell, n_node, first[PAL_CELL_KINDS]; /* elements of all kinds, and where each kind begins          */
    double *k_N_m;                             /* of an element's edges                             [n_cell] */
    double *shear_J;                           /* mu V                                              [n_cell] */
    double *ratio[2];                          /* least and largest volume over that at rest        [n_cell] */
    double *element_J;                         /* energy as an element                              [n_cell] */
    int32_t *patch, *before;                   /* of each element, -1: it is none                   [n_cell] */
    int32_t *root;                             /* of nodes that patches join                        [n_node] */
    pal_cell_region *of, *old;                 /*                                                   [n_cell] */
    int n_patch, n_away;                       /* patches, elements in them                                  */
    double first_J;     /* of the body's motion and of this row when there first were patches: what may be again */
    double stiffened_J; /* at the last look: of those patches whose s has grown                                    */
    bool still;  /* the body's motion has next to no energy                                                     */
    bool off;    /* for one linearisation at rest: elements are all there                                       */
    bool weighs; /* while a look asks for energies: those of elements in patches too                            */
    uint64_t n_inversion, n_change; /* looks that found patches, changes of what is in them; not yet told      */
} pal_cell_recovery;

/* MEMORY */
pal_err pal_cell_recovery_make(const pal_subdivision_solid *solid, pal_arena *arena, pal_cell_recovery *out);
/* constants after the samples have changed */
void pal_cell_recovery_refresh(pal_cell_recovery *t, const struct pal_cells_elastic *c);
void pal_cell_recovery_reset(pal_cell_recovery *t, struct pal_cells_elastic *c);
/* looks at all elements; loaded: something that lasts pulls at the body. True: other elements are in patches than
 * before, or s of one is another. No heap */
bool pal_cell_recovery_update(pal_cell_recovery *t, struct pal_cells_elastic *c, const pal_body *body, bool loaded);

/* of all patches, at nodes d: energy, J; forces are added to f [n_node][3] where it is not NULL */
double pal_cell_recovery_force(pal_cell_recovery *t, const pal_subdivision_solid *solid, const double *d, double *f);
/* out += k s sum_ij k_ij (p_i - p_j) */
void pal_cell_recovery_multiply(const pal_cell_recovery *t, const pal_subdivision_solid *solid, double k,
                                const double *p, double *out);
#endif
