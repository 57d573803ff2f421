/* The core that implicit_euler and sdirk2 share: one stage finds velocities V with
 *     M (V - v*) = tau (f(x* + tau V) - c M V),
 * f being the forces of all rows and contact, c the drag rate. Newton's method on it: with the forces linearised about
 * a state xl that the body has, V solves A V = b, A = (1 + tau c) M + tau^2 K + tau C, by conjugate gradients with the
 * warped factor of A at rest (warp.h).
 *
 * The first iteration starts from the state at the stage's begin, not from an extrapolated one: with rotations taken
 * there the corotational energy (but for its volume term) is bounded from above by the quadratic that is solved, so
 * that a single iteration (newton 1, the default) seldom gains energy. Where it does, up to 7 more follow until energy
 * is no more than at the sub-step's begin. A body that gains in spite of them again and again (half a second in all
 * without half a second of peace) goes round in a circle, as crushed elements on borrowed rotations do: from then on it
 * goes back and stands still in each such sub-step, so that its energy cannot rise. Conjugate gradients begin with the
 * velocities of before. With newton > 1, and in those 7, a line search on the incremental potential follows each
 * iteration.
 *
 * Contact gave its loads at the sub-step's begin; its stiffness and damping act on what has moved since, and `settle`
 * then brings the forces on tools to the end of the sub-step. Held nodes move with body->v (0 unless a row leads them).
 * A free body's momentum is kept to rounding whatever the tolerance: the mean of what the iterations leave over is
 * taken out. No node moves more than 0.2 S in an iteration (numerics.md part 3).
 *
 * Of a body whose nodes are carried by control points (embed) the unknowns are the points' velocities. Its factor is
 * that of the matrix at rest as found by interpolated_system.h; after an edit of its material that is found anew over
 * some steps, while refresh and refresh_iterations do nothing. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_IMPLICIT_SOLVER_H
#define PAL_SIM_IMPLICIT_IMPLICIT_SOLVER_H
#include "server/num/conjugate_gradient.h"
#include "server/sim/implicit/compliance.h"
#include "server/sim/implicit/warp.h"

/* keys of both solvers */
typedef struct pal_implicit_options {
    double tolerance;       /* 1e-2: residual of the stage's equations over |M v* + tau f|, Euclidean      */
    int iterations, newton; /* 60: most conjugate gradients per Newton iteration; 1: Newton iterations     */
    double substep_s;       /* 0: the scene's step                                                         */
    int refresh_iterations; /* 12: more in one solve begin a new factor ...                                */
    bool refresh;           /* ... true                                                                    */
    bool warp;              /* true: the factor turns with the body (false shows what that is worth)        */
    bool watch;             /* true: energy is watched (false shows what that costs)                        */
} pal_implicit_options;

typedef struct pal_implicit {
    pal_implicit_options wish;
    pal_system system;
    pal_block_matrix blocks; /* pattern of K; values are work space */
    pal_node_rotations turns;
    pal_warp warp;
    pal_compliance_solver answer; /* static compliance; answer.door.solve NULL: none wanted or none there is */
    pal_conjugate_gradient cg;
    double *x0, *v0; /* at the sub-step's begin                  [n_dof][3] */
    double *xs, *vs; /* x*, v* of the stage, filled by the solver [n_dof][3] */
    double *start;   /* V that would leave the body where it was linearised [n_dof][3] */
    double *work, *moved;
    double *node_displacement_m;    /* the way of nodes for `settle`; moved without embed  [n_node][3] */
    double tau_rest_s;              /* tau of the factor at rest           */
    double density;                 /* of the material, kg/m^3             */
    double reference;               /* of the tolerance, N s               */
    double start_energy_J;          /* at the sub-step's begin             */
    bool guarded;                   /* energy is watched: see above        */
    bool sound;                     /* its last look found that x and v are finite */
    bool energy_rose;               /* ... and was not kept in this sub-step ... */
    double energy_rise_s, steady_s; /* ... nor in sub-steps of so much time (0 after half a second without); since */
    int max_cg;                     /* in one solve of this sub-step       */
    uint64_t sampled;               /* material revision of the body at the factor (dofs.h) */
    bool probing;                   /* an embedded body's matrices are being found anew */
    pal_solve_report report;
} pal_implicit;

/* reads the keys; substep_s 0 becomes the scene's step. [load] */
pal_err pal_implicit_read(pal_config_entry *item, const pal_build *build, pal_implicit_options *out);
/* share: tau over the sub-step. REFUSED: no positive definite matrix at rest; MEMORY. [load] */
pal_err pal_implicit_make(const pal_implicit_options *wish, pal_build *build, double share, pal_implicit **out);
void pal_implicit_destroy(void *self);

/* false: nothing to solve (all held: led nodes have moved) or the state is no number (body->frozen is set) */
bool pal_implicit_begin(pal_implicit *core, pal_step *step);
/* body->x: where to linearise first, body->v: first guess of V and velocities of held nodes; both hold the result.
 * Loads may change afterwards: solve again after setting x and the guess again */
pal_err pal_implicit_stage(pal_implicit *core, pal_step *step, double tau_s);
/* after a stage, the last of the sub-step or not: true when contact has changed its loads, so that the sub-step must be
 * solved again */
bool pal_implicit_settle(pal_implicit *core, pal_step *step, bool last);
/* checks the result (not finite: back to the begin, frozen) and keeps the factor fresh */
void pal_implicit_end(pal_implicit *core, pal_step *step);

/* hooks of pal_effect that both have in common */
double pal_implicit_limit(void *self, pal_step *step);
pal_err pal_implicit_material(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag);
void pal_implicit_reset(void *self, const pal_body *body);
void pal_implicit_report(const void *self, pal_solve_report *out);
#endif
