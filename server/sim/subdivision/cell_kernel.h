/* Elements of a subdivision solid that follow their own frames (paper A section 3.2-3.4): forces, energy, tangent,
 * measures, recovery.
 *
 * With Q the polar rotation of F at an element's middle, y = x - x_0 its nodes relative to one of them and X the same
 * at rest: d^ = Q' y - X,   E = 1/2 d^' K d^,   K = int B' C B dV over the rest shape, at 64 Gauss points, with
 * gradients J^-T grad N and dV = det J du dv dw (erratum A9), so that moduli are in Pa. Departure from the paper: in
 * trilinear elements and pyramids of operator polar the change of volume in K is the element's mean (B-bar). The force
 * is the exact gradient of E: with g = K d^, the change of Q with x adds a term. For a rotation w of Q (dQ = Q [w]) dE
 * = t.w with t = -sum (Q'y) x g, and (tr S I - S) w = axial(Q'dF - dF'Q), S = Q'F; so dF receives Q [z], z = (tr S I -
 * S)^-1 t, at the middle. E is invariant to rotations of the body, so forces have no resultant and no torque. Near a
 * flat or collapsed middle, where det(tr S I - S) is below 1e-3 of (tr)^3, z goes to 0 with that determinant.
 *
 * Blocks have eight elements of a kind side by side. Cubic elements store no K: sum factorisation over the 4 x 4 x 4
 * points applies it. Others have K without their node 0, which takes minus the sum. A stored K is rounded to float;
 * sums are double. Memory from the arena. Thread: make [load], else [sim]; energy and force update the start values of
 * the rotations. */
#ifndef PAL_SIM_SUBDIVISION_CELL_KERNEL_H
#define PAL_SIM_SUBDIVISION_CELL_KERNEL_H
#include "server/num/block_matrix.h"
#include "server/sim/core/body.h"
#include "server/sim/core/force_cache.h"
#include "server/sim/recovery/recovery.h"
#include "server/sim/subdivision/subdivision_solid.h"

typedef enum pal_cell_operator {
    PAL_CELL_POLAR, /* d^ = Q'y - X                                                            */
    PAL_CELL_EDGES, /* d^ = R d of paper A section 3.2.2 with errata A5 to A8 (cell_operator.c); no gradient */
} pal_cell_operator;

/* one dimension of the sum factorisation: even and odd parts (cell_simd.h) */
typedef struct pal_cell_line {
    double even[2][2], odd[2][2];   /* B at the points: half sums and differences of its columns      */
    double slope_odd[2][2], bow[2]; /* derivative at the points of a cubic from its values there      */
} pal_cell_line;

/* elements of one kind; lanes after the last element repeat it and contribute nothing */
typedef struct pal_cell_group {
    int n_node, n, n_block;
    int32_t *node;       /* [n_block][n_node][8]                                  */
    double *rest;        /* X, m                          [n_block][n_node][3][8] */
    double *frame;       /* J^-1 in the middle, 1/m               [n_block][9][8] */
    double *q;           /* rotation, w x y z                     [n_block][4][8] */
    double *rotation;    /* Q of the last linearise               [n_block][9][8] */
    double *volume;      /* m^3                                      [n_block][8] */
    double (*middle)[3]; /* grad N in the middle, d/d(u, v, w)           [n_node] */
    float *scale;        /* cubic: sqrt(dV) J^-1, row = u, v, w [n_block][64][9][8] */
    float *stiff;        /* cubic: mu, lambda, Pa             [n_block][64][2][8] */
    float *k;            /* others: blocks K_ab, b <= a, of nodes 1.., N/m
                                                  [n_block][pairs][9][8] */
    double *corner;      /* 1 / volume at rest at the 8 points where inversion is detected [n_block][8][8] */
    double *here;        /* 1: an element, 0: part of a region                        [n_block][8] */
    int32_t *home;       /* control cell of each element (pal_cell_volume)            [n_block][8] */
    double *swell;       /* int kappa grad N dV, J/m, kappa of pal_cell_volume   [n_block][n_node][3][8] */
} pal_cell_group;

/* part of the bulk modulus that acts on the mean change of volume of a control cell (cell_volume.c); n 0: none */
typedef struct pal_cell_volume {
    int n;         /* control cells */
    double *sum;   /* int kappa tr(strain) dV, J            [n] */
    double *share; /* 1 / int kappa dV, 1/J                 [n] */
    double *push;  /* sum times share: mean strain of the cell [n] */
    pal_cliques couple;
} pal_cell_volume;

/* What threads that share the elements leave for the caller, who sums up in the order of one thread; all NULL: the
 * caller's thread works alone */
typedef struct pal_cell_shares {
    const pal_body *body;           /* whose team works                                             */
    double *force[PAL_CELL_KINDS];  /* of each element at its nodes        [n_block][n_node][3][8] */
    double *swell[PAL_CELL_KINDS];  /* part of its control cell's change of volume    [n_block][8] */
    double *energy[PAL_CELL_KINDS]; /* of each half of a block, J                     [n_block][2] */
} pal_cell_shares;

typedef struct pal_cells_elastic {
    const pal_subdivision_solid *solid;
    pal_cell_operator op;
    uint64_t sampled;            /* revision of the solid for which constants hold */
    pal_force_cache force_cache; /* made by cell_elastic for PAL_CELL_POLAR under an implicit solver */
    pal_recovery *recovery;
    int n_cell, first[PAL_CELL_KINDS]; /* elements of all kinds, and where each kind begins */
    int n_off;                         /* of these in regions                               */
    double *k_N_m;                     /* of the edges of an element in a region   [n_cell] */
    pal_cell_volume volume;
    pal_cell_line line;
    pal_cell_group group[PAL_CELL_KINDS];
    pal_cell_shares shares;
} pal_cells_elastic;

/* the part of lambda that an element keeps where its control cell has the rest */
static inline double pal_cell_own_lambda(double mu, double lambda)
{
    return lambda < mu ? lambda : mu;
}
/* Lame constants of an element's material at a Gauss point */
void pal_cell_lame(const pal_subdivision_solid *solid, pal_cell_kind kind, int element, int point, double *mu_Pa,
                   double *lambda_Pa);
static inline int pal_cell_pairs(int n_node)
{
    return (n_node - 1) * n_node / 2;
}

/* REFUSED: an element that is folded over in its middle, with its cell; MEMORY. Borrows the solid */
pal_err pal_cells_elastic_make(const pal_subdivision_solid *solid, pal_cell_operator op, pal_arena *arena,
                               pal_cells_elastic *out, pal_diagnostic *diag);
/* memory for the threads of a body's team, whatever its size will be; the same bits with any number. MEMORY */
pal_err pal_cells_elastic_share(pal_cells_elastic *c, const pal_body *body, pal_arena *arena);
/* computes the constants again when the solid's samples have changed; no heap */
void pal_cells_elastic_refresh(pal_cells_elastic *c);
void pal_cells_elastic_reset(pal_cells_elastic *c); /* rotations become the identity */

/* cell_volume.c: arrays where the solid's largest Poisson ratio asks for it, and their constants; MEMORY */
pal_err pal_cell_volume_make(pal_cells_elastic *c, pal_arena *arena);
void pal_cell_volume_refresh(pal_cells_elastic *c);

/* f [n][3] += forces at nodes d [n][3] */
void pal_cells_elastic_force(pal_cells_elastic *c, const double *d, double *f);
/* E, J; of PAL_CELL_EDGES 1/2 d^' K d^ of its own d^, of which the forces are no gradient. f: forces of PAL_CELL_POLAR
 * are added too; NULL: none */
double pal_cells_elastic_energy(pal_cells_elastic *c, const double *d, double *f);
/* evaluates Q at d; out += k sum Q K Q' p: the tangent with constant rotations (of both operators) */
void pal_cells_elastic_linearise(pal_cells_elastic *c, const double *d);
void pal_cells_elastic_multiply(const pal_cells_elastic *c, double k, const double *p, double *out);
/* rotation [n][9] += Q by the elements' stiffness at their nodes */
void pal_cells_elastic_rotate(const pal_cells_elastic *c, double *rotation);

/* d^ of one element in its own axes, as the operator of c has it [n_node][3] */
void pal_cells_elastic_displaced(pal_cells_elastic *c, const double *d, pal_cell_kind kind, int element, double *out);

/* quantities at the Gauss points of one element; small strain and stress in the element's axes */
typedef struct pal_cell_points {
    double volume_m3[PAL_CELL_GAUSS_POINTS]; /* at rest; their sum is the element's */
    double strain[PAL_CELL_GAUSS_POINTS][6]; /* xx yy zz yz zx xy, not doubled      */
    double von_mises_Pa[PAL_CELL_GAUSS_POINTS], energy_J_m3[PAL_CELL_GAUSS_POINTS];
    double det_f[PAL_CELL_GAUSS_POINTS];   /* volume now over volume at rest      */
    double stretch[PAL_CELL_GAUSS_POINTS]; /* largest principal stretch less 1 */
    double young_Pa[PAL_CELL_GAUSS_POINTS], density_kg_m3[PAL_CELL_GAUSS_POINTS];
    double rotation[9]; /* Q                                   */
} pal_cell_points;
/* the same for both operators */
void pal_cells_elastic_points(const pal_cells_elastic *c, const double *d, pal_cell_kind kind, int element,
                              pal_cell_points *out);
/* one number at a Gauss point, for display */
typedef double pal_cell_value(const pal_cell_points *points, int p);
/* sum [n] += value times volume at the nodes by their shape functions, volume_m3 [n] += volume; all elements */
void pal_cells_elastic_measure(const pal_cells_elastic *c, const double *d, pal_cell_value *value, double *sum,
                               double *volume_m3);

/* ---- recovery from inversion (cell_recovery.c) ----
 *
 * All of the above is of the elements that act; those in regions of `recovery` do not, and half blocks of nothing but
 * these are skipped. */
/* volumes at rest for the ratios; MEMORY */
void pal_cells_corners_make(pal_cells_elastic *c);
pal_err pal_cell_recovery_make(pal_cells_elastic *c, pal_arena *arena);
/* constants for changed samples */
void pal_cell_recovery_refresh(pal_cells_elastic *c);
#endif
