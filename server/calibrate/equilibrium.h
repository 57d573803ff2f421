/* Equilibrium of a spring lattice (model tet_springs) under dead loads, by Newton's method on its energy. The
 * adjoint method gives the derivative of any function of the displacement with respect to every spring constant,
 * for one more factorisation and one solve, whatever the number of springs.
 *
 *   W(x) = sum q k/2 C(x)^2 - f.x        grad W = 0 at the free nodes        H = sum q k (g g' + C H_C)
 *   H lambda = dJ/du                     dJ/dk = -q C g.lambda
 *
 * Linearised at rest, where every C is 0: K = sum q k g g', K u = f, dJ/dk = -q (g.u)(g.lambda).
 *
 * The lattice is shared and read-only. Each workspace belongs to one thread. Allocates heap memory. */
#ifndef PAL_CALIBRATE_EQUILIBRIUM_H
#define PAL_CALIBRATE_EQUILIBRIUM_H
#include "server/num/block_matrix.h"
#include "server/sim/springs/spring_law.h"
#include "server/sim/world/world.h"

enum { PAL_SPRING_KINDS = 3 };

/* springs of one kind, as in the live component */
typedef struct pal_springs {
    int n_item, n_corner; /* n_item 0: no such component */
    int32_t *item;        /* nodes                                 [n_item][n_corner] */
    double *w, *q;        /* 1 / rest measure (spring_constraint.h); weight [n_item] */
    int32_t *block;       /* block of each pair of corners a >= b; negative: ~block, transposed [n_item][pairs] */
} pal_springs;

typedef struct pal_lattice {
    int n_node, n_free;
    double *x_rest; /* body frame, m [n_node][3] */
    uint8_t *fixed; /* [n_node]                  */
    double edge_m;
    pal_springs kind[PAL_SPRING_KINDS]; /* by pal_spring_kind */
    pal_arena *arena;
    pal_block_matrix pattern;
} pal_lattice;

/* Copies the springs of the components edge_distance, face_area, tet_volume of a body. Errors: REFUSED: no edges,
 * no fixed node, or no free node; MEMORY. [load] */
pal_err pal_lattice_make(const pal_world *world, int body, pal_lattice *out, pal_diagnostic *diag);
void pal_lattice_free(pal_lattice *lattice); /* accepts a zeroed struct */

typedef struct pal_equilibrium_options {
    bool linear;      /* linearised at rest */
    double tolerance; /* norm of the residual relative to that of the loads; 0: 1e-9 */
} pal_equilibrium_options;

typedef struct pal_equilibrium_report {
    int n_newton, n_shift; /* shift: iterations whose Hessian was not positive definite */
    double residual;       /* relative                                                  */
    double energy_J;       /* elastic                                                   */
} pal_equilibrium_report;

typedef struct pal_equilibrium_workspace pal_equilibrium_workspace;
/* Errors: MEMORY. */
pal_err pal_equilibrium_workspace_create(const pal_lattice *lattice,
                                         pal_equilibrium_workspace **out);    /* borrows the lattice */
void pal_equilibrium_workspace_destroy(pal_equilibrium_workspace *workspace); /* accepts NULL */

/* Finds the equilibrium. k_J[kind] [n_item]: constants, before the weights q. force_N [n_node][3]. x [n_node][3]:
 * in: initial guess (linear: not read); out: the equilibrium, written on success only. Errors: NUMERIC (diag gives
 * the reason): not converged, a final Hessian that is not positive definite (no stable equilibrium), a value that
 * is not finite; MEMORY. */
pal_err pal_equilibrium(pal_equilibrium_workspace *workspace, const double *const k_J[PAL_SPRING_KINDS],
                        const double *force_N, const pal_equilibrium_options *options, double *x,
                        pal_equilibrium_report *report, pal_diagnostic *diag);
/* Call after pal_equilibrium in this workspace, with the same arguments. slope[kind] [n_item] = dJ/dk for dJ_du
 * [n_node][3] (not read at fixed nodes). Errors: NUMERIC, MEMORY. */
pal_err pal_equilibrium_adjoint(pal_equilibrium_workspace *workspace, const double *const k_J[PAL_SPRING_KINDS],
                                const double *x, const pal_equilibrium_options *options, const double *dJ_du,
                                double *const slope[PAL_SPRING_KINDS], pal_diagnostic *diag);
/* Writes -grad of the elastic energy at x [n_node][3], including fixed nodes. Returns the energy, J. */
double pal_lattice_force(const pal_lattice *lattice, const double *const k_J[PAL_SPRING_KINDS], const double *x,
                         double *force_N);
#endif
