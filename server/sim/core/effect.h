/* Effects: one physical or service term, one file in effects/ or solvers/. A component is an effect bound to a body.
 * The plan is the ordered list of components that a scene calls for; what a scene does not call for has no component,
 * memory or branch.
 *
 * A step runs, in every sub-step, the CONTACT components and then SOLVE, which runs the FORCE components as often as it
 * needs (pal_assemble_forces); then, once, the ADAPT, GUARD and OUTPUT components. The number of sub-steps is
 * ceil(step / limit of the SOLVE components); when the limit falls within a step, the rest of it is divided again. */
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

/* what a component may touch in a step; pointers are valid in this step only, since components come and go between
 * steps */
typedef struct pal_step {
    pal_body *body;
    pal_tools *tools;
    pal_arena *scratch;   /* fixed size, emptied after every sub-step                                    */
    pal_component *force; /* FORCE components of the body                                    [n_force]   */
    int n_force;
    pal_component *contact; /* CONTACT components of the body, for their stiffness only        [n_contact] */
    int n_contact;
    pal_component *adapt; /* ADAPT components of the body                                    [n_adapt]   */
    int n_adapt;
    bool drag_separate; /* set by a solver that applies drag itself: pal_assemble_forces omits those components  */
    bool single;        /* set by a solver whose forces may be as exact as single precision (springs/spring_single.h) */
    bool finds_balance; /* set by a solver that goes from balance to balance, so that energy has no meaning between  */
    double dt_s;        /* length of this sub-step; of the whole step in ADAPT, GUARD, OUTPUT                     */
    double time_s;      /* at its end                                                                            */
    int sub, n_sub;     /* number of this sub-step, and how many; n_sub may grow in a step with large deformation */
    bool adds_mass; /* the budget of sub-steps is used up and dt_s is above the limit: the solver adds mass where needed
                     */
} pal_step;

/* what `make` may use: everything that exists at load */
typedef struct pal_build {
    const pal_scene *scene;
    const pal_body_def *def;
    pal_body *body;
    pal_arena *arena;          /* memory of the component, freed when it is switched off                       */
    pal_arena *body_arena;     /* memory of the body, for what several components use; NULL: arena             */
    size_t scratch_byte;       /* a component raises it to the scratch that it needs in a sub-step             */
    pal_diagnostic *diag;      /* may be NULL                                                                  */
    const pal_component *made; /* components of the body made so far: all others when SOLVE is made [n_made]   */
    int n_made;
} pal_build;

/* A spring between a tool and the weighted mean of nodes, the same along each axis: K = k w w', with a weight for each
 * of its nodes */
typedef struct pal_mean_spring {
    double k_N_m;
    int n_node;
    const int32_t *node;  /* [n_node] */
    const double *weight; /* sum 1 [n_node] */
    uint64_t revision;    /* never 0; another one with other nodes or weights */
} pal_mean_spring;

/* What implicit solvers ask of FORCE and CONTACT components: the stiffness K = -df/dx, symmetric, evaluated by
 * `linearise` and constant until the next one, positive semi-definite or made so. FORCE components have multiply; every
 * other member may be NULL. [sim] unless stated */
typedef struct pal_tangent {
    /* nodes that the component couples, for the pattern of an assembled matrix, to which assemble adds; NULL or false:
     * it is applied by multiply only, as contact is. [load], after make */
    bool (*couple)(void *self, pal_cliques *out);
    /* evaluates K at the body's current d and, for CONTACT, at the loads given in this sub-step */
    void (*linearise)(void *self, const pal_body *body);
    /* out += k K p, p and out [n_node][3] */
    void (*multiply)(void *self, const pal_body *body, double k, const double *p, double *out);
    /* to += k K, in the pattern made with couple; not called for a body with interpolation */
    void (*assemble)(void *self, double k, pal_block_matrix *to);
    /* rotation [n_node][9] += rotation of the material around each node at the last linearise, weighted by stiffness
     * (by volume, a preconditioner turned with soft material would stretch stiff material next to it). NULL: no
     * rotations
     */
    void (*rotate)(void *self, const pal_body *body, double *rotation);
    /* CONTACT, after a stage that moved the nodes by `moved` [n_node][3], m, since the loads were given (fixed and
     * prescribed nodes too). last: the stage ends the sub-step, and the forces on the tools become those it was solved
     * with; before that, only the caps are enforced. True: contact pulled where it can only push, or exceeded a cap, so
     * that its loads in body->load and its stiffness have changed: the solver solves the sub-step again from where it
     * began. A component asks for that a bounded number of times.
     * An explicit solver that takes body->load_stiffness calls it once, last, with what the forces moved the nodes that
     * have some by, dt times their change of velocity; others are undefined. body->load becomes what nodes received */
    bool (*settle)(void *self, pal_step *step, const double *moved, bool last);
    /* CONTACT: the springs of this sub-step that hold the mean of nodes, at most `max`, whose arrays last as long as
     * it; returns their number. NULL: never one */
    int (*mean_springs)(const void *self, pal_mean_spring *out, int max);
    /* voxel hexahedra that are all of the component but its recovery, for preconditioners in single precision; NULL:
     * it has other elements. [load] */
    const struct pal_elastic_hexes *(*cubes)(const void *self);
} pal_tangent;

/* Progress of a solver, for status, studies and panel. Every number has one meaning for all solvers; what does not
 * apply to a solver is 0 */
typedef struct pal_solve_report {
    int n_newton, n_cg; /* iterations of the last step, summed over its sub-steps and repeated solves */
    /* of the last solve of the last sub-step */
    double residual;                   /* relative to the loads */
    double step_size;                  /* of the line search, 1: full */
    bool converged;                    /* the tolerance was met */
    const char *preconditioner;        /* of an implicit solver: jacobi, factor, multigrid, incomplete; NULL: none */
    const char *preconditioner_reason; /* why it was chosen, with numbers; "": it was asked for */
    int64_t factor_nonzeros;
    int n_factor; /* factorisations since load */
    /* time spent since load on the simulation thread: analysis of patterns, assembly of matrices, factorisation (but
     * for factors refreshed on another thread) and linear solves of the motion */
    double analyse_s, assemble_s, factor_s, solve_s;
} pal_solve_report;

/* how accurately a solver solves its systems; values as of its keys */
typedef struct pal_solve_accuracy {
    double tolerance; /* relative, of the residual                                                       */
    int iterations;   /* of one solve, at most                                                           */
    bool refresh;     /* preconditioners are made newer beside the steps where that would save iterations */
} pal_solve_accuracy;

/* stress at a quadrature point of an element; one call for each point, element by element */
typedef struct pal_stress_point {
    int element, n_corner;
    const int32_t *node; /* of the element                                                    [n_corner] */
    const double *shape; /* shape functions at the point                                      [n_corner] */
    double stress[9];    /* Kirchhoff stress, Pa, symmetric, current axes                                */
    double volume_m3;    /* volume at rest that the point represents, by its share of material; above 0  */
    double mu_Pa, lambda_Pa;
} pal_stress_point;
typedef void pal_stress_take(void *user, const pal_stress_point *point);

/* answer of `recover`; 0: no element is inverted */
enum {
    PAL_INVERTED = 1,          /* part of the body runs on its recovery: check again in the next step */
    PAL_INVERSION_CHANGED = 2, /* forces and stiffness have changed                                   */
    PAL_INVERSION_AT_REST = 4  /* with PAL_INVERTED: the motion has next to no energy of the recovery */
};

/* how a component takes over the state of its predecessor on the body `from` */
typedef struct pal_component_transfer {
    const pal_body *from;
    const pal_interpolation
        *place;          /* nodes of `from` as weighted sums of the new ones; NULL: they are the same nodes */
    const float *rest_m; /* shown vertices of the new body at rest, scene frame                  [n_shown][3] */
    bool same_shown;     /* shown vertices of the same number are the same place on both bodies               */
    /* += forces of the predecessor on nodes, by place, less those of the new component, N: what is to be blended out;
     * NULL: not asked for [n_node][3] */
    double *left_N;
} pal_component_transfer;

typedef struct pal_effect {
    const char *name; /* as written in scene files */
    pal_stage stage;

    /* ---- lifecycle ---- */
    /* reads and checks the keys (pal_entry_check_unused last), allocates self from build->arena. [load] */
    pal_err (*make)(pal_config_entry *item, pal_build *build, void **self);
    void (*destroy)(void *self); /* frees what make took beside the arena (threads, factors); NULL: nothing. [load] */
    void (*reset)(void *self, const pal_body *body); /* the body is back at rest                                    */
    /* live edit: constants that the scene does not give are derived again. REFUSED: nothing has changed. NULL: none
     * are; a SOLVE component is reset */
    pal_err (*material)(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag);
    /* CONTACT, ADAPT: continues where the component `before` of the same effect on another body is. Both bodies are
     * between steps */
    void (*transfer)(void *self, const pal_body *body, const void *before, const pal_component_transfer *by);
    bool keeps_components; /* SOLVE: holds pointers to or patterns of the body's components, so it is made again when
                              they change */
    bool moves_nodes; /* SOLVE: bodies whose nodes are interpolated are refused                                    */
    bool implicit;    /* SOLVE: an implicit solver, which takes stiffness and contact by tangents; sets body->implicit
                         before other components are made       */

    /* ---- force ---- */
    /* FORCE components add to body->f, CONTACT components to body->load and to the forces on tools. [sim] */
    pal_err (*run)(void *self, pal_step *step);
    /* FORCE, optional: the same on body->active_nodes, which make has made (active_nodes.h); rk4 uses it when every
     * FORCE component has it. [sim] */
    pal_err (*compute_forces)(void *self, pal_step *step);
    double (*energy)(void *self, const pal_body *body); /* J; run = minus its gradient */
    bool internal; /* FORCE: zero at rest, no net force, no net torque, whatever the deformation */
    /* FORCE: the component is -m rate v and nothing else; the rate, 1/s, for solvers that apply it implicitly */
    double (*drag)(void *self);

    /* limits of explicit steps */
    struct {
        /* FORCE, CONTACT: += Gershgorin row sums of stiffness and of explicit damping at the current state. Without
         * `stiffness` of a FORCE component central_cg finds it by differences of forces [n_node] */
        void (*stiffness)(void *self, const pal_body *body, double *bound_N_m);
        void (*damping)(void *self, const pal_body *body, double *bound_Ns_m);
        /* CONTACT, bodies with interpolation: += row sums at nodes of the stiffness that the component asks for in the
         * coming step; central_cg makes its sub-steps short enough for it [n_node] */
        void (*wanted)(void *self, const pal_body *body, double *bound_N_m);
        /* SOLVE: largest stable sub-step at the current state, s; NaN: the state is not finite. Asked before every
         * sub-step, so it is cheap while little has moved. [sim] */
        double (*limit)(void *self, pal_step *step);
    } bounds;

    /* for implicit solvers; a body with one refuses `internal` components without a tangent */
    const pal_tangent *tangent;

    /* recovery from inversion */
    struct {
        /* FORCE: looks for inverted elements and chooses what they run on from now on; solvers call it at the begin of
         * a sub-step */
        unsigned (*recover)(void *self, pal_step *step);
        struct pal_recovery *(*state)(void *self); /* FORCE: what `recover` works on (recovery.h); NULL: nothing */
    } recovery;

    /* sleep of a body at rest */
    struct {
        /* time after which the force of the component, or of ADAPT the nodes of the body, no longer change by
         * themselves, s; INFINITY: never. NULL: they never change */
        double (*settled_s)(const void *self);
        /* CONTACT: distance from the tool's centre within which the component acts or looks, m; INFINITY while a tool
         * holds or presses the body through it; NULL: it knows no tools */
        double (*reach_m)(const void *self, const pal_tool *tool);
        /* GUARD of a sleeping body: does it wake in the step that begins? step is that of the first sub-step, tools
         * with their targets */
        bool (*wakes)(void *self, pal_step *step);
    } sleep;

    /* display, estimates, reports */
    struct {
        /* FORCE: sum [n_node] += field times volume, volume_m3 [n_node] += volume at rest */
        void (*measure)(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3);
        unsigned fields; /* what measure gives, 1 << pal_field each */
        /* FORCE: the stress of every element at the body's d, as the forces have it; no memory (zz_estimator.h). NULL:
         * not known */
        void (*stress)(void *self, const pal_body *body, pal_stress_take *take, void *user);
        void (*report)(const void *self, pal_solve_report *out); /* SOLVE */
        /* SOLVE: exchanges *accuracy with its own, but for members that it has no use for; NULL: it solves no systems.
         * Between steps. [sim] */
        void (*accuracy)(void *self, pal_solve_accuracy *accuracy);
    } inspect;
} pal_effect;

/* the members of an effect made from entries of scenes, by the functions make and run of its file */
#define PAL_EFFECT(NAME, STAGE) .name = NAME, .stage = PAL_STAGE_##STAGE, .make = make, .run = run

struct pal_component {
    const pal_effect *effect;
    void *self;
    uint64_t spent_ns;  /* in the last step. FORCE: `run` alone; linearise, multiply and energy count to SOLVE */
    size_t n_byte;      /* memory taken at load                                                       */
    uint64_t n_run;     /* runs since load                                                            */
    const char *reason; /* what in the scene calls for it; memory of the body, never NULL in a plan   */
    pal_arena *arena;   /* its own memory; NULL: somebody else's                                      */
};

/* FORCE components: all but those that drag_separate omits, by `run` or by compute_forces (active_nodes.h); those that
 * are `internal` or are not, without drag */
typedef enum pal_forces { PAL_FORCES_ALL, PAL_FORCES_PACKED, PAL_FORCES_INTERNAL, PAL_FORCES_EXTERNAL } pal_forces;
/* Runs these components. Adds to each component's spent_ns. [sim] */
pal_err pal_run_forces(pal_step *step, pal_forces which);
double pal_components_energy_J(const pal_component *component, int n, const pal_body *body); /* sum of n. [sim] */
/* does one of n still change at this time without outside action (sleep.settled_s)? [sim] */
bool pal_components_change(const pal_component *component, int n, double time_s);
/* d = A x; f = load plus the forces of all components; g = A' f. Fixed dofs have forces too: what their support bears.
 * [sim] */
pal_err pal_assemble_forces(pal_step *step);
#endif
