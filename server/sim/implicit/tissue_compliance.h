/* Static compliance of a body with an explicit solver: the displacement u by a load, K u = f, at the present shape, by
 * conjugate gradients on the true stiffness. A product with K is a central difference of the components' forces. The
 * preconditioner is that of the stiffness at rest (rest_stiffness.h); while a body that adapts has not all of its
 * nodes, the row sums of its springs; for control points none, which are few.
 *
 * A product costs two evaluations of forces, so few are made in a step (PAL_PROBES_1_S), and the answer to a
 * load continues in the next one: residual and direction stay, the residual is found again as the body moves, and beta
 * is Polak and Ribiere's, which does not need K to be quite the same. A step that is too short for a residual and an
 * iteration makes both, and the steps after it make none until their share has paid for them. An answer counts once its
 * error is below PAL_SEARCH_TOLERANCE; until then there is none. One that is worse than no answer, as where K was found
 * at a fold, is forgotten. Built only where a CONTACT component asks for it, and not without supports. Thread: [load]
 * to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_TISSUE_COMPLIANCE_H
#define PAL_SIM_IMPLICIT_TISSUE_COMPLIANCE_H
#include "server/sim/implicit/rest_stiffness.h"

/* loads whose answers are kept: of a tool's patches, two along the normal and two across each, or of axes of a grasp */
enum { PAL_TISSUE_ANSWERS = 8 };

typedef struct pal_tissue_answer {
    double *force, *move;     /* N, m                                                [n_dof][3] */
    double *left, *direction; /* residual, N; last direction                         [n_dof][3] */
    double *before;           /* preconditioned residual of the iteration before     [n_dof][3] */
    double size2, fall2;      /* squared norm of force, 0: empty; residual . before             */
    uint64_t used;            /* index of the last call that used it                            */
} pal_tissue_answer;

typedef struct pal_tissue_compliance {
    pal_compliance hook; /* what the body publishes */
    pal_step step;       /* the present one         */
    double credit;       /* products that may be made now */
    bool pauses;         /* in this step nothing is computed, as steps before it made more than their share */
    bool iterated;       /* an iteration was made in this step, which the first answer always gets */
    double time_s;       /* of the step that credit is for */
    uint64_t n_call, revision;
    bool known;                    /* inverse holds for the topology `revision` */
    double *x, *low, *product, *z; /* [n_dof][3] */
    double *inverse, *bound;       /* of the diagonal, m/N [n_dof]; row sums, N/m [n_node] */
    pal_block_matrix rest;         /* pattern of the stiffness at rest */
    bool made, preconditioned;     /* there is a preconditioner; it is that of the present nodes */
    pal_rest_preconditioner preconditioner;
    pal_tissue_answer answer[PAL_TISSUE_ANSWERS];
} pal_tissue_compliance;

/* Sets build->body->compliance; build->made: all components but the solver, the body at rest. Whoever frees the body
 * calls its destroy. rest, zero before: the stiffness that it has found. MEMORY. [load] */
pal_err pal_tissue_compliance_make(const pal_build *build, pal_rest_values *rest);
#endif
