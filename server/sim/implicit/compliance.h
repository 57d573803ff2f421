/* The static answer of a body to a load at its present shape: conjugate gradients on the true stiffness, whose product
 * with a direction is a central difference of the components' forces. (The tangents of solvers leave out what makes
 * them indefinite, a quarter to a half of the answer on a beam bent by half its length.) The preconditioner is the
 * factor of the stiffness at rest, warped by the present rotations (warp.h). A call starts from the answer to a similar
 * load and makes at most three iterations, each one back-substitution and two evaluations of forces. Near rest that is
 * the answer; on a strongly bent body it converges within a few calls, which a contact that lasts some steps makes
 * anyway. Made only where a CONTACT component asks for it. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_COMPLIANCE_H
#define PAL_SIM_IMPLICIT_COMPLIANCE_H
#include "server/num/conjugate_gradient.h"
#include "server/sim/implicit/warp.h"

/* forces whose answers are remembered: a patch or an axis of a grasp each */
enum { PAL_COMPLIANCE_CACHE = 4 };
typedef struct pal_compliance_entry {
    double *force, *move; /* of points, N, m             [n_dof][3] */
    double size2;         /* of force; 0: nothing known              */
    uint64_t used;        /* number of the call that used it last    */
} pal_compliance_entry;

typedef struct pal_compliance_solver {
    pal_compliance door; /* what the body publishes */
    pal_warp warp;
    pal_system *system;
    pal_conjugate_gradient cg;
    double *x, *f, *low; /* kept while forces are asked: of points, of nodes, of points */
    double *move;        /* of points, where nodes are carried by them     [n_dof][3] */
    pal_compliance_entry known[PAL_COMPLIANCE_CACHE];
    uint64_t n_call;
} pal_compliance_solver;

/* the rows are linearised at rest; blocks: work space of K's pattern. Nothing is published when nobody wants it, or
 * when the supports do not hold the body. MEMORY. [load] */
pal_err pal_compliance_solver_make(pal_system *system, const pal_node_rotations *turns, pal_block_matrix *blocks,
                                   pal_arena *arena, pal_compliance_solver *out);
/* factor of the components' present linearisation at rest, after a material edit */
pal_err pal_compliance_solver_factor(pal_compliance_solver *answer, pal_system *system, pal_block_matrix *blocks);
void pal_compliance_solver_reset(pal_compliance_solver *answer); /* the body is back at rest */
void pal_compliance_solver_destroy(pal_compliance_solver *answer);
#endif
