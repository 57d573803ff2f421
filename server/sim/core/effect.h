/* Effects: one physical or service term, one file in effects/ or solvers/. A row is an effect bound to a body. The plan
 * is the ordered list of rows that a scene calls for; what a scene does not call for has no row, memory or branch.
 *
 * Order of a step: for every sub-step CONTACT rows, then SOLVE (which calls pal_assemble_forces, and that the FORCE
 * rows, as often as it likes); then once ADAPT, GUARD and OUTPUT rows. The number of sub-steps is ceil(step / limit of
 * the SOLVE rows), so that a step may be any length; what remains of the step is split again when the limit falls
 * within it. Effect files include this header and mesh or num headers, never world.h and never each other. */
#ifndef PAL_SIM_CORE_EFFECT_H
#define PAL_SIM_CORE_EFFECT_H
#include "server/num/block_matrix.h"
#include "server/sim/core/body.h"
#include "server/sim/core/config_entry.h"
#include "server/sim/core/definition.h"
#include "server/sim/core/tools.h"

typedef enum pal_stage {
    PAL_STAGE_CONTACT,
    PAL_STAGE_FORCE,
    PAL_STAGE_SOLVE,
    PAL_STAGE_ADAPT,
    PAL_STAGE_GUARD,
    PAL_STAGE_OUTPUT,
    PAL_STAGE_COUNT
} pal_stage;
const char *pal_stage_name(pal_stage stage); /* "contact" ...; never NULL [any] */

typedef struct pal_component pal_component;

/* all that a row may touch in a step; its pointers are those of this step: rows may come and go between steps */
typedef struct pal_step {
    pal_body *body;
    pal_tools *tools;
    pal_arena *scratch;   /* fixed; emptied after every sub-step       */
    pal_component *force; /* this body's FORCE rows         [n_force]   */
    int n_force;
    pal_component *contact; /* this body's CONTACT rows       [n_contact]; for their stiffness only */
    int n_contact;
    pal_component *adapt; /* this body's ADAPT rows         [n_adapt] */
    int n_adapt;
    bool drag_separate; /* set by a solver that applies the rows' drag itself: pal_assemble_forces leaves those rows out
                         */
    double dt_s;        /* length of this sub-step; of the whole step in ADAPT, GUARD, OUTPUT */
    double time_s;      /* at its end                                                         */
    int sub, n_sub;     /* this sub-step's number and how many there are; n_sub may grow in a step that deforms a lot */
    bool heavy;         /* the budget of sub-steps is used up and dt_s is beyond the limit: the solver adds mass to the
                           nodes that ask for it instead of letting them diverge                       */
} pal_step;

/* what make may use: everything that exists at load */
typedef struct pal_build {
    const pal_scene *scene;
    const pal_body_def *def;
    pal_body *body;
    pal_arena *arena;          /* the row's memory: gone when it is switched off                   */
    pal_arena *body_arena;     /* the body's memory, for what other rows use as well; NULL: arena  */
    size_t scratch_byte;       /* a row raises it to the scratch it needs in a sub-step            */
    pal_diagnostic *diag;      /* may be NULL                                                      */
    const pal_component *made; /* this body's rows made so far: all others when SOLVE is made [n_made] */
    int n_made;
} pal_build;

/* What implicit solvers ask of FORCE and CONTACT rows: stiffness K = -df/dx and damping C = -df/dv, symmetric, taken by
 * `linearise` and held until the next one. K is positive semi-definite, or is made so. [sim] unless said */
typedef struct pal_tangent {
    /* nodes that the row couples, for the pattern of an assembled matrix; false: none (the row is applied by multiply
     * only, as contact is). [load], after make */
    bool (*couple)(void *self, pal_cliques *out);
    /* takes K and C at the body's current d (and, for CONTACT rows, the loads they gave in this sub-step) */
    void (*linearise)(void *self, const pal_body *body);
    /* out += (k K + c C) p, p and out [n_node][3] */
    void (*multiply)(void *self, const pal_body *body, double k, double c, const double *p, double *out);
    /* to += k K + c C, into the pattern made with couple */
    void (*assemble)(void *self, const pal_body *body, double k, double c, pal_block_matrix *to);
    /* adds to turn [n_node][9] the rotation of the material around each node, weighted by stiffness or volume (the
     * solver takes the polar part of the sum; where something hard meets something soft, a factor turned by the soft
     * one's rotations stretches the hard one); NULL: no rotations. At the last linearise */
    void (*rotate)(void *self, const pal_body *body, double *turn);
    /* CONTACT, after a stage: it moved the nodes by `moved` [n_node][3], m, since the loads were given (held nodes too,
     * as they were led). `last`: the stage ends the sub-step; brings the forces on the tools to those it was solved
     * with. Before: only sees to the caps. True: contact pulled where it can only push, or forces went beyond a cap, so
     * the row has changed its loads in body->load and its stiffness: solve the sub-step again from where it began.
     * A row says so a bounded number of times, seldom more than three, and a solver always does, so that no sub-step
     * ends on loads that it was not solved with */
    bool (*settle)(void *self, pal_step *step, const double *moved, bool last);
} pal_tangent;

/* how a solver is getting on, for status, lab and panel */
typedef struct pal_solve_report {
    int n_newton, n_cg; /* iterations of the last step, conjugate gradients summed over its Newton iterations */
    double residual;    /* of the last Newton iteration, relative to the loads                               */
    double step_size;   /* last step of the line search, 1: full                                            */
    bool converged;     /* the tolerance was met                                                            */
    int64_t factor_nonzeros;
    int n_factor; /* factorisations since load                                                        */
    double analyse_s, assemble_s, factor_s, solve_s; /* time spent since load                                     */
} pal_solve_report;

/* stress at a quadrature point of an element, where and for what it stands: one call for each, element by element */
typedef struct pal_stress_point {
    int element, n_corner;
    const int32_t *node; /* of the element [n_corner]                                                 */
    const double *shape; /* shape functions there [n_corner]                                          */
    double stress[9];    /* symmetric, Pa, current axes, of the volume at rest (Kirchhoff)            */
    double volume_m3;    /* at rest, by its share of material; 0: of no element, there is no such call */
    double mu_Pa, lambda_Pa;
} pal_stress_point;
typedef void pal_stress_take(void *user, const pal_stress_point *point);

/* what a row says that was asked for what is turned over */
enum {
    PAL_INVERTED = 1, /* something runs on what untangles it: to be asked in the coming step, however little moved */
    PAL_INVERSION_CHANGED = 2, /* forces and stiffness are others than before */
    PAL_INVERSION_AT_REST = 4  /* besides PAL_INVERTED: the body moves with next to no energy of what untangles it */
};

/* how the body `from` of a row goes over to another one in its place */
typedef struct pal_component_transfer {
    const pal_body *from;
    const pal_interpolation *place; /* its nodes as weighted sums of the new ones; NULL: they are the same nodes */
    const float *rest_m;            /* shown vertices of the new body at rest, scene frame [n_shown][3]          */
    bool same_shown;                /* those of the same number mean the same place on both                      */
    /* += forces that the row had on nodes, by place, less those it begins with on new ones, N [n_node][3]: what is to
     * be let go (blend_component.h); NULL: nobody asks */
    double *left_N;
} pal_component_transfer;

typedef struct pal_effect {
    const char *name; /* as written in scene files */
    pal_stage stage;
    bool internal; /* FORCE: zero at rest, no net force, no net torque, whatever the deformation (tested) */
    /* reads and checks the item's keys (pal_entry_check_unused at the end), allocates self from build->arena. [load] */
    pal_err (*make)(pal_config_entry *item, pal_build *build, void **self);
    /* FORCE rows add to body->f, CONTACT rows to body->load and the tools' forces. [sim] */
    pal_err (*run)(void *self, pal_step *step);
    /* optional, FORCE: the same on body->pack, made in `make`: adds to its f (active_nodes.h). [sim] */
    pal_err (*pull)(void *self, pal_step *step);
    /* optional, NULL when there is nothing to do or say */
    double (*energy)(void *self, const pal_body *body); /* J; run = -gradient of it (tests)                          */
    /* FORCE, CONTACT: += Gershgorin row sums of the stiffness (numerics.md 1 B) and of the explicit damping at the
     * current state, [n_dof] each: bound_N_m, bound_Ns_m */
    void (*stiffness)(void *self, const pal_body *body, double *bound_N_m);
    void (*damping)(void *self, const pal_body *body, double *bound_Ns_m);
    /* CONTACT, on bodies whose points carry nodes: += the row sums at nodes, [n_node], of the stiffness that the row
     * would like to have in the coming step; central_cg makes its sub-steps short enough for it */
    void (*wanted)(void *self, const pal_body *body, double *bound_N_m);
    /* FORCE: the row is nothing but -m rate v; the rate, 1/s, for solvers that apply it implicitly (drag_separate) */
    double (*drag)(void *self);
    /* SOLVE: largest stable sub-step at the current state, s; NaN: the state is not finite. Asked before every
     * sub-step, so it is cheap while little has moved. [sim] */
    double (*limit)(void *self, pal_step *step);
    /* live edit: constants that the scene did not give are derived again. REFUSED: nothing changed */
    pal_err (*material)(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag);
    void (*reset)(void *self, const pal_body *body); /* the body is back at rest */
    /* FORCE: the row's springs, which others switch off where they are turned over (spring_recovery.h) */
    struct pal_spring_set *(*springs)(void *self);
    /* FORCE: looks for elements that are turned over and chooses what they run on from now on: PAL_INVERTED
     * and what else is true of PAL_TANGLE_*; 0: nothing is turned over. Solvers ask between sub-steps, not within */
    unsigned (*recover)(void *self, pal_step *step);
    /* CONTACT, ADAPT: this row goes on where the row `before` of the same effect on another body is (transfer.h). Both
     * bodies stand still */
    void (*hand)(void *self, const pal_body *body, const void *before, const pal_component_transfer *by);
    /* optional, for implicit solvers; a body with an implicit solver refuses `internal` rows without it */
    const pal_tangent *tangent;
    bool implicit; /* SOLVE: takes stiffness and contact implicitly; sets body->implicit before other rows are made */
    bool keeps_components; /* SOLVE: holds pointers or patterns of the body's rows, so it is made anew when they change
                            */
    /* time from which the row's force, ADAPT: the body's nodes, no longer change with time by themselves, s; INFINITY:
     * never. NULL: they never do */
    double (*settled_s)(const void *self);
    /* CONTACT: how far from the tool's centre the row acts or looks, INFINITY while some tool holds or presses the body
     * by it; NULL: it knows no tools */
    double (*reach_m)(const void *self, const pal_tool *tool);
    /* GUARD, of a body that it put to sleep (body->asleep): shall it wake in the step that begins? step as of that
     * step's first sub-step, tools with where they go in it */
    bool (*wakes)(void *self, pal_step *step);
    /* FORCE: adds to sum [n_node] the row's field times volume and to volume_m3 [n_node] the volume it stands for */
    void (*measure)(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3);
    unsigned fields; /* what measure gives, 1 << pal_field each */
    /* FORCE: the stress of every element at the body's d, as the row's forces have it; no memory. For the recovery of
     * zz_estimator.h; NULL: not known */
    void (*stress)(void *self, const pal_body *body, pal_stress_take *take, void *user);
    void (*report)(const void *self, pal_solve_report *out); /* SOLVE */
    void (*destroy)(void *self); /* what make took beside the arena (threads, factors); NULL: nothing. [load] */
} pal_effect;

struct pal_component {
    const pal_effect *effect;
    void *self;
    uint64_t spent_ns;  /* in the last step; FORCE rows inside SOLVE are counted on their own and not in SOLVE */
    size_t n_byte;      /* memory it took at load                                                              */
    uint64_t n_run;     /* times it was run since load                                                         */
    const char *reason; /* what in the scene calls for it; of the body's memory, never NULL in a plan          */
    pal_arena *arena;   /* its own memory; NULL: somebody else's                                               */
};

/* d = embed x; f = load, then every FORCE row adds (those with drag only when drag_separate is false), then g = embed'
 * f; held nodes have forces too: what the support bears. Counts each row's spent_ns. [sim] */
pal_err pal_assemble_forces(pal_step *step);
#endif
