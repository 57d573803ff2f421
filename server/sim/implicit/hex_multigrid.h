/* Multigrid preconditioner of a body of voxel hexahedra: A = mass M + stiff K without contact. K is the stiffness at
 * rest, turned by the elements' rotations: the corotational tangent, and near the neo-Hookean one. The finest level has
 * no matrix: it multiplies in single precision with the present rotations, and smooths in place (num/multigrid.h has
 * the smoother and the coarser levels). The coarser levels are those of the state at the last update or refresh, warped
 * to the present one (warp.h): z = W P A1^-1 P' W' r. The number of iterations of conjugate gradients does not grow
 * with the number of nodes: 10 or 11 to 1e-6 (tests/sim/implicit/test_preconditioner.c). Strong contrasts of stiffness
 * have a factor of their own (stiff_nodes.h).
 *
 * An update makes again what has a part of an element whose material has been edited since the last one
 * (pal_elastic_hexes.edited): diagonal entries at its nodes, the coarse cell that contains it and what is above that
 * one (num/multigrid.h); the factor of the stiff nodes only where one of them is a node of it. The largest
 * eigenvalues and the coarsest level's factor, a third of the time of all (palpate bench edit), are always found in
 * full. The bits are those of levels made as a whole. All elements count as edited where the coefficients of M and K
 * are others, masses have changed, and where the body or the levels in use are not at rest.
 *
 * Memory: the caller's arena, and the heap for the coarser levels, in make and in the first refresh; the factors of
 * the coarsest level and of stiff nodes use it in every update. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_HEX_MULTIGRID_H
#define PAL_SIM_IMPLICIT_HEX_MULTIGRID_H
#include "server/base/spare_thread.h"
#include "server/num/multigrid.h"
#include "server/sim/elements/elastic_hex_single.h"
#include "server/sim/implicit/stiff_nodes.h"

/* what all preconditioners of a body have in common, of which one solves at a time */
typedef struct pal_hex_levels {
    const pal_body *body;
    const pal_elastic_hexes *cubes;
    pal_grid_hierarchy grid; /* n_level 0: the body is too small */
    pal_elastic_hexes_single single;
    int n_group, n_slot;      /* groups of 8 slots with nodes */
    int32_t *group;           /* first slot [n_group] */
    float *x, *b, *d, *r, *q; /* answer, right side, direction, residual, product [3][n_slot] */
    float *part;              /* of residuals at nodes, x y z 0 [n_node][4] */
    /* what an update makes again: the first level's cells with an edited element [n_cell], nodes of such [n_node] */
    uint8_t *changed_cell, *changed_node;
} pal_hex_levels;

/* what the levels hold of one A */
typedef struct pal_hex_values {
    double mass, stiff;      /* factors of M and K in A */
    bool rest;               /* of the body at rest, and whole */
    uint32_t n_edit;         /* of the material, when they were made */
    float lambda;            /* no eigenvalue of D^-1 A is larger */
    float *weight, *inverse; /* mass M; 1 / D, 0 at fixed nodes and empty slots [n_slot] */
    pal_multigrid *coarse;   /* of the next values: NULL before the first refresh */
    pal_stiff_nodes stiff_nodes;
} pal_hex_values;

typedef struct pal_hex_multigrid {
    pal_hex_levels *levels;
    pal_hex_values now, next; /* in use; in the making on the spare thread */
    pal_spare_thread spare_thread;
    pal_err outcome; /* of the spare thread */
    float *turned;   /* rotations at the refresh, as in `single`; NULL: the law is linear, or there is no refresh */
} pal_hex_multigrid;

/* MEMORY. [load] */
pal_err pal_hex_levels_make(const pal_body *body, const pal_elastic_hexes *cubes, pal_arena *arena,
                            pal_hex_levels *out);
/* refreshed: it may be. MEMORY. [load] */
pal_err pal_hex_multigrid_make(pal_hex_levels *levels, bool refreshed, pal_arena *arena, pal_hex_multigrid *out);
void pal_hex_multigrid_destroy(pal_hex_multigrid *mg);
/* takes material and rotations of the last linearise, where they are others than at the last update. NUMERIC: not
 * positive definite; MEMORY. No solve may follow an error */
pal_err pal_hex_multigrid_update(pal_hex_multigrid *mg, double mass, double stiff);
/* starts levels of the rotations of the last linearise on a spare thread. MEMORY */
pal_err pal_hex_multigrid_refresh(pal_hex_multigrid *mg, double mass, double stiff);
/* waits for them and puts them into use. NUMERIC, MEMORY: the ones before stay */
pal_err pal_hex_multigrid_adopt(pal_hex_multigrid *mg);
double pal_hex_multigrid_flops(const pal_hex_multigrid *mg); /* operations of a refresh, equal on all machines */
/* takes the rotations of the last linearise, finest level; returns by how many radians elements have turned, as RMS */
double pal_hex_multigrid_rotate(pal_hex_multigrid *mg);
/* largest of diagonal of A over mass_kg, at the last update */
double pal_hex_multigrid_stiffest(const pal_hex_multigrid *mg);
/* z ~ A^-1 r [n_dof][3], z may be r; warp: since the last update */
void pal_hex_multigrid_solve(pal_hex_multigrid *mg, pal_cycle cycle, const pal_warp *warp, const double *r, double *z);
#endif
