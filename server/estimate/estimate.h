/* An error estimate of one body, and the state it is computed from. This is the core of the room: it depends on
 * none of its other files. */
#ifndef PAL_ESTIMATE_ESTIMATE_H
#define PAL_ESTIMATE_ESTIMATE_H
#include "server/sim/core/configuration.h"
#include "server/sim/world/world.h"

#include <stdatomic.h>

enum { PAL_ESTIMATE_NEIGHBOURS = 6 };

/* stop: set by another thread; NULL: never */
static inline bool pal_estimate_stopped(const _Atomic bool *stop)
{
    return stop && atomic_load_explicit(stop, memory_order_acquire);
}

typedef struct pal_estimate {
    uint64_t tick; /* tick of the observed state; 0: none yet */
    double time_s;
    double age_s; /* awake time since that state, when the estimate is read; 0 while the body still sleeps */
    bool asleep;  /* the body slept at that tick; with age_s 0 it still does */
    double max_m; /* largest displacement at that tick, m */
    /* Largest displacement errors, m. NaN: unknown for this body; diag gives the reason. */
    double error_m; /* sum of all parts; NaN: a dominant part is unknown */
    double discretisation_m, algebraic_m, time_m, model_m;
    /* error of the force that tools exert at their present depth, per cent of it: how much the loads change on the
     * meshes and with the law that the parts above come from. NaN: nothing presses, or a mesh does not bear it */
    double force_percent;
    double energy_error_percent; /* energy norm of the error over that of the solution, percent */
    bool locking;                /* nearly incompressible material in elements that lock: the estimate is too small */
    /* median time of a live step over the last second awake; of a body never awake: of separate trial steps */
    double ms;
    double estimate_ms; /* processor time of this estimate */
    /* next lower and next higher value of each parameter, with predicted time and error */
    int n_neighbour;
    pal_measured_configuration neighbour[PAL_ESTIMATE_NEIGHBOURS];
    /* Predicted node count of each neighbour (within 25 %, pal_configuration_estimate_nodes; the present count if
     * the mesh does not change), and sub-steps of one of its steps at rest [n_neighbour]. */
    int neighbour_nodes[PAL_ESTIMATE_NEIGHBOURS], neighbour_substeps[PAL_ESTIMATE_NEIGHBOURS];
    char diag[160];
} pal_estimate;

/* every number that may be unknown is NaN, all others are 0 */
pal_estimate pal_estimate_unknown(void);
/* diagnostic of a sleeping body */
#define PAL_ESTIMATE_ASLEEP "asleep: ms are those of a step awake"
enum { PAL_ESTIMATE_STEPS = 256, PAL_ESTIMATE_COMPONENTS = 2 * PAL_ENTRIES_MAX };

/* Time of one step in which the body was awake. Shares are fractions of the time of the components of all bodies.
 * The remainder is the body's own forces and solver, which scale with its mesh. */
typedef struct pal_estimate_cost {
    float ms;     /* of all bodies */
    float once;   /* share of work done once a step: refinement, safeguards, display */
    float beside; /* share of other work in each sub-step: contact, other bodies */
} pal_estimate_cost;

/* A body after a step. The estimation owns the arrays; pal_estimate_copy fills them. */
typedef struct pal_estimate_state {
    uint64_t tick;
    double time_s;
    int n_dof, n_node;
    double *x, *v;          /* m, m/s [n_dof][3] */
    double *load;           /* sustained and contact loads, N [n_node][3] */
    double *external_force; /* the sustained part of load, N [n_node][3] */
    double *borne;          /* loads under which x is an equilibrium, N [n_node][3]; computed by the estimation */
    bool asleep;
    bool touched;         /* a tool presses or pulls the body */
    int n_substep;        /* sub-steps of the step */
    double other_limit_s; /* longest sub-step that all other bodies allow */
    pal_material material;
    /* FORCE components of the body: their names, valid from open on, and which are enabled */
    const char *component[PAL_ESTIMATE_COMPONENTS];
    bool component_enabled[PAL_ESTIMATE_COMPONENTS];
    int n_component;
    pal_estimate_cost cost[PAL_ESTIMATE_STEPS]; /* of the latest awake steps, in any order */
    int n_cost;
} pal_estimate_state;

/* Copies the state of `body`. The world must be made from the scene. False: the state is not usable (not finite,
 * frozen, another number of points). Takes no memory. [sim] */
bool pal_estimate_copy(pal_estimate_state *state, const pal_world *world, int body);
/* Cost of the last step of the world, which took step_ms. Takes no memory. [sim] */
pal_estimate_cost pal_estimate_cost_of(const pal_world *world, int body, double step_ms);
/* Enables and disables the components of a world of the same body, made from `scene`, as in the state. recipe:
 * includes the components of the model, which must be that of the state. Errors as pal_world_switch_component.
 * Allocates heap memory. */
pal_err pal_estimate_match_components(const pal_estimate_state *state, pal_world *world, const pal_scene *scene,
                                      bool recipe);
/* The same, and its material; unfreezes the body. */
pal_err pal_estimate_match(const pal_estimate_state *state, pal_world *world, const pal_scene *scene, bool recipe);
#endif
