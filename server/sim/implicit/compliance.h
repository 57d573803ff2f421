/* The body's static answer to a load where it is now: conjugate gradients on the true stiffness, taken along each
 * direction as a central difference of the rows' forces (the tangents of the solvers leave out what makes them
 * indefinite, a quarter to a half of the answer on a beam bent by half its length), preconditioned by the factor of the
 * stiffness at rest warped by the present rotations (warp.h). A call begins with what was found for a force like its
 * own and makes at most three iterations, each one back-substitution and two evaluations of forces: near rest that is
 * the answer, and on a strongly bent body it is the answer after a few calls, which is what a contact that is felt for
 * a few steps asks anyway. Made only where a CONTACT row wants it. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_COMPLIANCE_H
#define PAL_SIM_IMPLICIT_COMPLIANCE_H
#include "server/num/conjugate_gradient.h"
#include "server/sim/implicit/warp.h"

/* forces whose answers are remembered: a patch or an axis of a grip each */
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
/* factor of the rows' present linearisation at rest, after a material edit */
pal_err pal_compliance_solver_factor(pal_compliance_solver *answer, pal_system *system, pal_block_matrix *blocks);
void pal_compliance_solver_reset(pal_compliance_solver *answer); /* the body is back at rest */
void pal_compliance_solver_destroy(pal_compliance_solver *answer);
#endif
