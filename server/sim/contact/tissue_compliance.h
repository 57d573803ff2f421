/* Static compliance of tissue whose solver has no factor (explicit solvers): the displacement u by a load, K u = f, at
 * the present shape, by conjugate gradients on the true stiffness. A product with K is a central difference of the
 * components' forces. The preconditioner is the diagonal of their row sums, or 1 where they give none.
 *
 * An iteration costs two evaluations of forces, some of the sub-steps' own, so few are made in a step
 * (PAL_ITERATIONS_1_S), and the answer to a load continues in the next one: residual and direction stay, the residual
 * is found again as the body moves, and beta is Polak and Ribiere's, which does not need K to be quite the same. An
 * answer counts once its residual is small; until then, and without supports, there is none. At rest an answer costs
 * nothing, as it is not asked for again (haptic_stiffness.h). Memory: the component's arena. Thread: [sim],
 * pal_tissue_compliance_make [load]. */
#ifndef PAL_SIM_CONTACT_TISSUE_COMPLIANCE_H
#define PAL_SIM_CONTACT_TISSUE_COMPLIANCE_H
#include "server/sim/core/effect.h"

/* loads whose answers are kept: of two patches, along and across */
enum { PAL_TISSUE_ANSWERS = 8 };

typedef struct pal_tissue_answer {
    double *force, *move;     /* N, m                                       [n_dof][3] */
    double *left, *direction; /* residual, N; last direction                [n_dof][3] */
    double *before;           /* preconditioned residual of the iteration before [n_dof][3] */
    double size2, fall2;      /* squared norm of force, 0: empty; residual . before */
    uint64_t used;            /* index of the last call that used it */
} pal_tissue_answer;

typedef struct pal_tissue_compliance {
    pal_compliance hook; /* what haptic_stiffness.h asks */
    pal_step *step;      /* the present one, borrowed */
    double credit;       /* iterations that may be made now */
    uint64_t n_call, revision;
    bool known;                /* inverse holds for the topology `revision` */
    double *x, *low, *product; /* [n_dof][3] */
    double *inverse;           /* of the diagonal, m/N [n_dof] */
    double *bound;             /* N/m [n_node] */
    pal_tissue_answer answer[PAL_TISSUE_ANSWERS];
} pal_tissue_compliance;

/* MEMORY */
pal_err pal_tissue_compliance_make(const pal_body *body, pal_arena *arena, pal_tissue_compliance *out);
/* in the last sub-step, before answers are asked for */
void pal_tissue_compliance_begin(pal_tissue_compliance *tissue, pal_step *step);
/* forgets all answers: the body is back at rest */
void pal_tissue_compliance_reset(pal_tissue_compliance *tissue);
#endif
