/* Elements of a subdivided solid that follow their own frames (A 3.2-3.4): forces, energy, tangent and measures.
 *
 * With Q the polar rotation of F at an element's middle, y = x - x_0 its nodes from one of them, X the same at rest:
 *     d^ = Q' y - X,   E = 1/2 d^' K d^,   K = int B' C B dV over the rest shape, by 64 Gauss points,
 * with gradients J^-T grad N and dV = det J du dv dw (erratum A9), so that moduli are in Pa. Departure: of trilinear
 * elements and pyramids under operator polar the change of volume in K is the element's mean (B-bar). The force is the
 * whole gradient of E: with g = K d^, the turning of Q with x adds a term. For a turn w of Q (dQ = Q [w]) dE = t.w with
 * t = -sum (Q'y) x g, and (tr S I - S) w = axial(Q'dF - dF'Q), S = Q'F; so dF bears Q [z], z = (tr S I - S)^-1 t, at
 * the middle. E does not change when the body is turned, and so the forces have no net force and no net torque.
 * Near a flat or collapsed middle, where det(tr S I - S) is below 1e-3 of (tr)^3, z fades to 0 with it.
 *
 * Eight elements of a kind stand side by side (a block). Cubic ones have no stored K: it is applied by sum
 * factorisation over the 4 x 4 x 4 points. Trilinear ones have K without their node 0, which takes minus the sum.
 * K is rounded to float where it is stored; sums are double.
 * All memory from the arena. Thread: make [load], else [sim]; energy and force move the rotations' warm start. */
#ifndef PAL_SIM_SUBDIVISION_CELL_KERNEL_H
#define PAL_SIM_SUBDIVISION_CELL_KERNEL_H
#include "server/num/block_matrix.h"
#include "server/sim/core/body.h"
#include "server/sim/core/force_cache.h"
#include "server/sim/subdivision/subdivision_solid.h"

typedef enum pal_cell_operator {
    PAL_CELL_POLAR, /* d^ = Q'y - X                                                            */
    PAL_CELL_EDGES, /* d^ = R d of A 3.2.2 with errata A5 to A8 (cell_operator.c); no gradient */
} pal_cell_operator;

/* the line of four: coefficients of even and odd parts (cell_simd.h) */
typedef struct pal_cell_line {
    double even[2][2], odd[2][2];   /* B at the points: half sums and differences of its columns      */
    double slope_odd[2][2], bow[2]; /* derivative at the points of a cubic from its values there      */
} pal_cell_line;

/* elements of one kind; lanes behind the last element repeat it and give nothing */
typedef struct pal_cell_group {
    int n_node, n, n_block;
    int32_t *node;       /* [n_block][n_node][8]                                  */
    double *rest;        /* X, m                          [n_block][n_node][3][8] */
    double *frame;       /* J^-1 in the middle, 1/m               [n_block][9][8] */
    double *q;           /* rotation, w x y z                     [n_block][4][8] */
    double *turn;        /* Q of the last linearise               [n_block][9][8] */
    double *volume;      /* m^3                                      [n_block][8] */
    double (*middle)[3]; /* grad N in the middle, d/d(u, v, w)           [n_node] */
    float *scale;        /* cubic: sqrt(dV) J^-1, row = u, v, w [n_block][64][9][8] */
    float *stiff;        /* cubic: mu, lambda, Pa             [n_block][64][2][8] */
    float *k;            /* others: blocks K_ab, b <= a, of nodes 1.., N/m
                                                  [n_block][pairs][9][8] */
    double *corner;      /* 1 / volume at rest at the 8 points that look for turned over elements [n_block][8][8] */
    double *here;        /* 1: an element, 0: part of a region (cell_recovery.h)      [n_block][8] */
    double *energy_J;    /* of each element when energy was asked for last         [n_block][8] */
    int32_t *home;       /* control cell of each element, where changes of volume have theirs [n_block][8] */
    double *swell;       /* int kappa grad N dV, J/m, kappa of what they share          [n_block][n_node][3][8] */
    int n_slow;          /* rotations of the last call that vectors did not settle */
} pal_cell_group;

/* changes of volume that control cells share (cell_volume.c); n 0: each element has its own */
typedef struct pal_cell_volume {
    int n;         /* control cells */
    double *sum;   /* int kappa tr(strain) dV, J            [n] */
    double *share; /* 1 / int kappa dV, 1/J                 [n] */
    double *push;  /* sum times share: mean strain of the cell [n] */
    pal_cliques couple;
} pal_cell_volume;

typedef struct pal_cell_region {
    bool fixed;                          /* G is that of what is held */
    double scale;                        /* s */
    double turn[9];                      /* G of the last look, force or energy */
    double sum[9];                       /* sum_ij k (x_i - x_j)(X_i - X_j)', which G fits best */
    double region_J, element_J, shear_J; /* at the last look: its energy, that of its elements, mu V */
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
    int32_t *region, *before;                  /* of each element, -1: it is none                   [n_cell] */
    int32_t *root;                             /* of nodes that regions join                        [n_node] */
    pal_cell_region *of, *old;                 /*                                                   [n_cell] */
    int n_region, n_recovering;                /* regions, elements in them                                  */
    double first_J;     /* of the body's motion and of this row when there first were regions: what may be again */
    double stiffened_J; /* at the last look: of those regions whose s has grown                                    */
    bool still;  /* the body's motion has next to no energy                                                     */
    bool off;    /* for one linearisation at rest: elements are all there                                       */
    bool weighs; /* while a look asks for energies: those of elements in regions too                            */
    uint64_t n_inversion, n_change; /* looks that found regions, changes of what is in them; not yet told      */
} pal_cell_recovery;

typedef struct pal_cells_elastic {
    const pal_subdivision_solid *solid;
    pal_cell_operator op;
    uint64_t sampled;     /* of the solid, what the constants were made for */
    pal_force_cache kept; /* made by the row, of PAL_CELL_POLAR under an implicit solver */
    pal_cell_recovery recovery;
    pal_cell_volume volume;
    pal_cell_line line;
    pal_cell_group group[PAL_CELL_KINDS];
} pal_cells_elastic;

/* lambda of an element's own where its control cell has the rest */
static inline double pal_cell_own_lambda(double mu, double lambda)
{
    return lambda < mu ? lambda : mu;
}
static inline int pal_cell_pairs(int n_node)
{
    return (n_node - 1) * n_node / 2;
}

/* REFUSED: an element that is folded over in its middle, with its cell; MEMORY. The solid is borrowed */
pal_err pal_cells_elastic_make(const pal_subdivision_solid *solid, pal_cell_operator op, pal_arena *arena,
                               pal_cells_elastic *out, pal_diagnostic *diag);
/* constants anew where the solid has other samples than they were made for; no heap */
void pal_cells_elastic_refresh(pal_cells_elastic *c);
void pal_cells_elastic_reset(pal_cells_elastic *c); /* rotations are none again */

/* cell_volume.c: arrays where the solid's largest Poisson ratio asks for it, and their constants; MEMORY */
pal_err pal_cell_volume_make(pal_cells_elastic *c, pal_arena *arena);
void pal_cell_volume_refresh(pal_cells_elastic *c);

/* f [n][3] += forces at nodes d [n][3] */
void pal_cells_elastic_force(pal_cells_elastic *c, const double *d, double *f);
/* E, J; of PAL_CELL_EDGES 1/2 d^' K d^ of its own d^, of which the forces are no gradient. f: forces of PAL_CELL_POLAR
 * are added too; NULL: none */
double pal_cells_elastic_energy(pal_cells_elastic *c, const double *d, double *f);
/* takes Q at d, then out += k sum Q K Q' p: the tangent with rotations held (of both operators) */
void pal_cells_elastic_linearise(pal_cells_elastic *c, const double *d);
void pal_cells_elastic_multiply(const pal_cells_elastic *c, double k, const double *p, double *out);
/* least and largest volume of every element over that at rest, at the 2 x 2 x 2 Gauss points of its cell, to
 * tangle.ratio; of cubic elements those of the trilinear cell between their own corners' control points */
void pal_cells_corners_make(pal_cells_elastic *c);
void pal_cells_elastic_ratios(pal_cells_elastic *c, const double *d);
/* turn [n][9] += Q by the elements' stiffness, mu V, at their nodes */
void pal_cells_elastic_rotate(const pal_cells_elastic *c, double *turn);

/* forces and energy of PAL_CELL_EDGES (cell_operator.c) */
void pal_cells_edges_force(pal_cells_elastic *c, const double *d, double *f);
double pal_cells_edges_energy(pal_cells_elastic *c, const double *d);
/* d^ of one element in its own axes, as the operator of c has it [n_node][3]: for tests and views */
void pal_cells_elastic_displaced(pal_cells_elastic *c, const double *d, pal_cell_kind kind, int element, double *out);

/* what stands at the Gauss points of one element; strain and stress small, in the element's axes */
typedef struct pal_cell_points {
    double volume_m3[PAL_CELL_GAUSS_POINTS]; /* at rest; their sum is the element's */
    double strain[PAL_CELL_GAUSS_POINTS][6]; /* xx yy zz yz zx xy, not doubled      */
    double von_mises_Pa[PAL_CELL_GAUSS_POINTS], energy_J_m3[PAL_CELL_GAUSS_POINTS];
    double det_f[PAL_CELL_GAUSS_POINTS];   /* volume now over volume at rest      */
    double stretch[PAL_CELL_GAUSS_POINTS]; /* largest principal stretch less 1 */
    double turn[9];                        /* Q                                   */
} pal_cell_points;
/* the same for both operators */
void pal_cells_elastic_points(const pal_cells_elastic *c, const double *d, pal_cell_kind kind, int element,
                              pal_cell_points *out);
/* one number of a Gauss point: what a view shows */
typedef double pal_cell_value(const pal_cell_points *points, int p);
/* sum [n] += value times volume at the nodes by their shape functions, volume_m3 [n] += volume; all elements */
void pal_cells_elastic_measure(const pal_cells_elastic *c, const double *d, pal_cell_value *value, double *sum,
                               double *volume_m3);

/* Untangling of subdivided solids: what elements run on while they are turned over (numerics.md part 3).
 *
 * Elements with one rotation each have rests that are none of the body: folded, mirrored, crumpled. Where an element's
 * volume at one of 8 points falls below 0.05 of that at rest, or rises above 30 of it, it and its neighbours become
 * regions, which have no elements but a spring in space for each edge of their cells:
 *
 *     E = s min_G 1/2 sum_ij k |(x_i - x_j) - G (X_i - X_j)|^2,   k = 3 mu V / (n sum of |X_ij|^2 / n),
 *
 * n edges of an element of volume V: the Dirichlet energy of x - G X, one rotation G for a whole region. For a given G
 * it is convex, and at the best one its gradient is that of the sum with G held (envelope theorem), so that forces are
 * the exact gradient and have no net force and no net torque; where it is at rest, the region is X turned by G. A
 * region of more than half of the body takes the rotation of what is held, where that has one.
 *
 * s <= 1 is such that a region begins with no more energy than its elements had. It becomes elements again when none of
 * them is below 0.3 (above 20) any more, they store at most 0.1 mu V, and the body's motion and this row then have no
 * more energy than when regions first were, or after 120 looks in a row at a body that stands still (loads hold it). A
 * region that does not come loose takes in its neighbours every 30 looks, unless a lasting load or weight pulls at the
 * body: then s goes back to 1, by a quarter every 4 looks, since what hangs by a soft region is let out by 1 / s. What
 * that puts in is braked away (stiffened_J, stiffening_damper.h), or it would throw the body about and turn over more
 * of it. Half blocks of nothing but elements in regions are not run, except for their energies in a look and to
 * linearise. Memory: the world's arena. Thread: make [load], else [sim]. */
/* MEMORY */
pal_err pal_cell_recovery_make(const pal_subdivision_solid *solid, pal_arena *arena, pal_cell_recovery *out);
/* constants after the samples have changed */
void pal_cell_recovery_refresh(pal_cell_recovery *t, const pal_cells_elastic *c);
void pal_cell_recovery_reset(pal_cell_recovery *t, pal_cells_elastic *c);
/* looks at all elements; loaded: something that lasts pulls at the body. True: other elements are in regions than
 * before, or s of one is another. No heap */
bool pal_cell_recovery_update(pal_cell_recovery *t, pal_cells_elastic *c, const pal_body *body, bool loaded);

/* of all regions, at nodes d: energy, J; forces are added to f [n_node][3] where it is not NULL */
double pal_cell_recovery_force(pal_cell_recovery *t, const pal_subdivision_solid *solid, const double *d, double *f);
/* out += k s sum_ij k_ij (p_i - p_j) */
void pal_cell_recovery_multiply(const pal_cell_recovery *t, const pal_subdivision_solid *solid, double k,
                                const double *p, double *out);
#endif
