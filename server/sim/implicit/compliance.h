/* Static compliance of a body at its present shape: the displacement caused by a load, by conjugate gradients on the
 * true stiffness. The product of the stiffness with a direction is a central difference of the components' forces.
 * (The solvers' tangents omit the terms that make them indefinite; on a beam bent by half its length these are a
 * quarter to a half of the displacement.) The preconditioner is of the stiffness at rest and of the solver's kind,
 * warped by the present rotations (warp.h). A call starts from the displacement under a similar load and makes at most
 * three iterations, each one solve with the preconditioner and two evaluations of forces; it ends once the energy,
 * which is the compliance, is known well enough (PAL_COMPLIANCE_GAIN). Near rest this is accurate; on a strongly bent
 * body it converges within a few calls, which a contact of several steps makes anyway. Built only where a CONTACT
 * component asks for it. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_COMPLIANCE_H
#define PAL_SIM_IMPLICIT_COMPLIANCE_H
#include "server/num/conjugate_gradient.h"
#include "server/sim/implicit/preconditioner.h"

/* number of cached loads: one per contact patch or per axis of a grasp */
enum { PAL_COMPLIANCE_CACHE = 4 };
typedef struct pal_compliance_entry {
    /* at control points, N and m, as good as a guess has to be [n_dof][3] */
    float *force, *move;
    double size2;  /* squared norm of force; 0: empty entry */
    uint64_t used; /* index of the last call that used it */
} pal_compliance_entry;

typedef struct pal_compliance_solver {
    pal_compliance hook;               /* what the body publishes */
    pal_preconditioner preconditioner; /* of K alone */
    pal_system *system;
    pal_conjugate_gradient cg;
    double *x, *f, *low; /* saved while forces are evaluated: of points, of nodes, of points */
    double *move;        /* at control points, where nodes are interpolated from them [n_dof][3] */
    pal_compliance_entry known[PAL_COMPLIANCE_CACHE];
    uint64_t n_call;
} pal_compliance_solver;

/* The components are linearised at rest. like, cg: the solver's; vectors of cg, and work [n_dof][3] (NULL: its own),
 * are work space here, while the solver solves nothing: in CONTACT components and their settle. Nothing is published
 * when no component wants it or when the supports leave a rigid motion free. MEMORY. [load] */
pal_err pal_compliance_solver_make(const pal_preconditioner *like, const pal_conjugate_gradient *cg, double *work,
                                   pal_arena *arena, pal_compliance_solver *out);
/* takes the components' present linearisation at rest, after a material edit; later: on a spare thread */
pal_err pal_compliance_solver_update(pal_compliance_solver *solver, bool later);
void pal_compliance_solver_reset(pal_compliance_solver *solver); /* the body is back at rest */
/* sets sizes and times of a report: of the solver's preconditioner, and times of the one here as well */
void pal_compliance_solver_report(const pal_compliance_solver *solver, const pal_preconditioner *preconditioner,
                                  pal_solve_report *out);
void pal_compliance_solver_destroy(pal_compliance_solver *solver);
#endif
