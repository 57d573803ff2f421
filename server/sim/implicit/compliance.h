/* The body's static answer to a load where it is now: conjugate gradients on the true stiffness, taken along each
 * direction as a central difference of the rows' forces (the tangents of the solvers leave out what makes them
 * indefinite, a quarter to a half of the answer on a beam bent by half its length), preconditioned by the factor of the
 * stiffness at rest warped by the present rotations (warp.h). A call begins with what was found for a force like its
 * own and makes at most three iterations, each one back-substitution and two evaluations of forces: near rest that is
 * the answer, and on a strongly bent body it is the answer after a few calls, which is what a contact that is felt for
 * a few steps asks anyway. Made only where a CONTACT row wants it. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_COMPLIANCE_H
#define PAL_SIM_COMPLIANCE_H
#include "server/num/conjugate.h"
#include "server/sim/implicit/warp.h"

/* forces whose answers are remembered: a patch or an axis of a grip each */
enum { PAL_ANSWERS = 4 };
typedef struct pal_known_answer {
    double *force, *move; /* of points, N, m             [n_dof][3] */
    double size2;         /* of force; 0: nothing known              */
    uint64_t used;        /* number of the call that used it last    */
} pal_known_answer;

typedef struct pal_answer {
    pal_compliance door; /* what the body publishes */
    pal_warp warp;
    pal_system *system;
    pal_conjugate cg;
    double *x, *f, *low; /* kept while forces are asked: of points, of nodes, of points */
    double *move;        /* of points, where nodes are carried by them     [n_dof][3] */
    pal_known_answer known[PAL_ANSWERS];
    uint64_t n_call;
} pal_answer;

/* the rows are linearised at rest; blocks: work space of K's pattern. Nothing is published when nobody wants it, or
 * when the supports do not hold the body. MEMORY. [load] */
pal_err pal_answer_make(pal_system *system, const pal_turns *turns, pal_blocks *blocks, pal_arena *arena,
                        pal_answer *out);
/* factor of the rows' present linearisation at rest, after a material edit */
pal_err pal_answer_factor(pal_answer *answer, pal_system *system, pal_blocks *blocks);
void pal_answer_forget(pal_answer *answer); /* the body is back at rest */
void pal_answer_destroy(pal_answer *answer);
#endif
