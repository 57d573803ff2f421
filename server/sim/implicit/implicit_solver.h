/* Core shared by implicit_euler and sdirk2. A stage finds velocities V with
 *     M (V - v*) = tau (f(x* + tau V) - c M V - beta K V),
 * where f is the force of all components and contact, c the drag rate and beta the key stiffness_damping_s. Newton's
 * method linearises the forces about a state, so that V solves A V = b, A = (1 + tau c) M + (tau^2 + tau beta) K + tau
 * D, by conjugate gradients with a preconditioner of A at rest that is warped
 * (preconditioner.h).
 *
 * The first iteration starts from the state at the beginning of the stage, not from an extrapolated one. With the
 * rotations of that state the quadratic that is solved bounds the corotational energy (except its volume term) from
 * above, so a single iteration (newton 1, the default) seldom gains energy. Where it does, up to 7 more iterations
 * follow, each with a line search on the incremental potential, until the energy is no more than at the beginning of
 * the sub-step. The last one ends where a search does, unless it gains less than the error of a solve.
 *
 * Contact gives its loads at the beginning of the sub-step; its stiffness acts on the motion since then,
 * and `settle` brings the forces on tools to the end of the sub-step. Where it changes which points touch, a sub-step
 * of one stage is solved again from the same linearisation, roughly (PAL_ROUGH_TOLERANCE) until nothing changes. Fixed
 * nodes move with body->v (0 unless prescribed). The momentum of a free body is conserved to rounding whatever the
 * tolerance, because the mean of the residual is removed. step_guard.h limits displacements.
 *
 * Where nodes are interpolated from control points, the unknowns are the velocities of the control points and the
 * factor is that of the matrix at rest (interpolated_system.h). After a material edit that matrix is rebuilt over
 * several steps; refresh and refresh_iterations have no effect. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_IMPLICIT_SOLVER_H
#define PAL_SIM_IMPLICIT_IMPLICIT_SOLVER_H
#include "server/sim/implicit/compliance.h"
#include "server/sim/implicit/woodbury.h"

/* keys of both solvers, with their defaults */
typedef struct pal_implicit_options {
    double tolerance;       /* 1e-2: residual of the stage's equations over |M v* + tau f|, Euclidean norm */
    int iterations, newton; /* 60: max conjugate gradient iterations per Newton iteration; 1: Newton iterations */
    double substep_s;       /* 0: no limit below the scene's step */
    double damping_s;       /* 0: beta of damping forces -beta K v, which damp a mode w at the rate beta w^2 / 2 */
    int refresh_iterations; /* 12: a solve that takes more starts a new factor, if ... */
    bool refresh;           /* ... true                                                                    */
    pal_precondition preconditioner; /* auto */
    bool warp;                       /* true: the factor rotates with the body (false for comparison) */
    bool watch;                      /* true: energy is checked (false for comparison of the cost) */
} pal_implicit_options;

typedef struct pal_implicit {
    pal_implicit_options options;
    pal_system system;
    pal_node_rotations rotations;
    pal_preconditioner preconditioner;
    pal_woodbury woodbury;            /* what it does not know of contact */
    pal_compliance_solver compliance; /* compliance.hook.solve NULL: not wanted or not available */
    pal_conjugate_gradient cg;
    double *x0, *v0; /* at the beginning of the sub-step [n_dof][3] */
    double *xs, *vs; /* x*, v* of the stage, filled by the solver; x0, v0 where it has one stage [n_dof][3] */
    double *start;   /* V that keeps the body where it was linearised [n_dof][3] */
    double *work, *moved;
    double *node_displacement_m; /* displacement of nodes for `settle`; `moved` without interpolation [n_node][3] */
    double tau_rest_s;           /* tau for which the factor at rest was made */
    double density;              /* of the material, kg/m^3             */
    double reference;            /* residual norm that the tolerance scales, N s */
    bool turns_back;             /* inverted elements move, at the beginning of the sub-step */
    double start_energy_J;       /* at the beginning of the sub-step */
    bool guarded;                /* energy is checked, see above */
    bool sound;                  /* the last check found x and v finite */
    bool settled;                /* contact is, for the last solve */
    bool energy_rose;            /* the energy rose in this sub-step */
    double rose_s;               /* what is left of PAL_PAUSE_S since the last such sub-step */
    int max_cg;                  /* max iterations in one solve of this sub-step */
    uint64_t sampled;            /* material revision of the body at the factor (dofs.h) */
    bool probing;                /* the matrices of an interpolated body are being rebuilt */
    double probes;               /* columns that may be found now */
    pal_solve_report report;
} pal_implicit;

/* Reads the keys and makes the solver. share: tau over the sub-step. REFUSED: a key, or no positive definite matrix at
 * rest; MEMORY. [load] */
pal_err pal_implicit_make(pal_config_entry *item, pal_build *build, double share, void **self);

/* false: nothing to solve (every node is fixed; prescribed nodes have moved) or the state is not finite
 * (body->frozen is set) */
bool pal_implicit_begin(pal_implicit *core, pal_step *step);
/* body->x: state of the first linearisation; body->v: first guess of V and velocities of fixed nodes; both contain
 * the result. If loads change afterwards, set x and the guess again and solve again. alone: the sub-step has no other
 * stage, so that contact may be settled within it */
pal_err pal_implicit_stage(pal_implicit *core, pal_step *step, double tau_s, bool alone);
/* after a stage, which may have settled contact; last: it is the last of the sub-step. true: contact has changed its
 * loads, so the sub-step must be solved again */
bool pal_implicit_settle(pal_implicit *core, pal_step *step, bool last);
/* checks the result (not finite: the state at the beginning is restored and the body frozen) and refreshes the
 * factor */
void pal_implicit_end(pal_implicit *core, pal_step *step);

/* members of pal_effect that both solvers share */
void pal_implicit_destroy(void *self);
double pal_implicit_limit(void *self, pal_step *step);
pal_err pal_implicit_material(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag);
void pal_implicit_reset(void *self, const pal_body *body);
void pal_implicit_report(const void *self, pal_solve_report *out);
void pal_implicit_accuracy(void *self, pal_solve_accuracy *accuracy);
#define PAL_IMPLICIT_HOOKS                                                                                             \
    .stage = PAL_STAGE_SOLVE, .implicit = true, .keeps_components = true, .destroy = pal_implicit_destroy,             \
    .bounds.limit = pal_implicit_limit, .material = pal_implicit_material, .reset = pal_implicit_reset,                \
    .inspect = {.report = pal_implicit_report, .accuracy = pal_implicit_accuracy}
#endif
