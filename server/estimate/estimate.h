/* An error estimate of one body, and the state that it is made of. The core of this room: it knows none of the other
 * files. */
#ifndef PAL_ESTIMATE_ESTIMATE_H
#define PAL_ESTIMATE_ESTIMATE_H
#include "server/sim/core/configuration.h"
#include "server/sim/world/world.h"

enum { PAL_ESTIMATE_NEIGHBOURS = 6 };

typedef struct pal_estimate {
    uint64_t tick; /* of the state that was looked at; 0: there is none yet */
    double time_s;
    double age_s; /* steps in which the body was awake since then, as it is read: 0 while it sleeps as it did   */
    bool asleep;  /* it slept then; with age_s 0 it still does                */
    double max_m; /* largest displacement then                              */
    /* largest displacement errors, m; NaN: not known for this body (diag gives the reason) */
    double error_m; /* of all parts together: their sum; NaN: a large one is not known (above) */
    double discretisation_m, algebraic_m, time_m, model_m;
    double energy_error_percent; /* energy norm of the error over that of the solution    */
    bool locking;                /* nearly incompressible in elements that lock: the estimate is too small */
    double ms;                   /* of a live step, median of the last second awake; never awake: of steps beside it */
    double estimate_ms;          /* processor time that this estimate took                 */
    /* next lower and higher choice of each parameter, with predicted time and error */
    int n_neighbour;
    pal_measured_configuration neighbour[PAL_ESTIMATE_NEIGHBOURS];
    /* nodes that each is thought to have (within 25 %, pal_configuration_estimate_nodes; as many as now where the mesh
     * stays), and sub-steps in a step of its own at rest [n_neighbour] */
    int neighbour_nodes[PAL_ESTIMATE_NEIGHBOURS], neighbour_substeps[PAL_ESTIMATE_NEIGHBOURS];
    char diag[160];
} pal_estimate;

/* diagnostic of a body that sleeps */
#define PAL_ESTIMATE_ASLEEP "asleep: ms are those of a step awake"
enum { PAL_ESTIMATE_STEPS = 256, PAL_ESTIMATE_COMPONENTS = 2 * PAL_ENTRIES_MAX };

/* of a step that the body was awake in. Shares are of the time of all bodies' rows; what is left of 1 is the body's own
 * forces and solver, which go with its mesh */
typedef struct pal_estimate_cost {
    float ms;     /* of all bodies */
    float once;   /* share of what is done once a step: refinement, guards, what is shown */
    float beside; /* share of what is done in each sub-step beside them: contact, other bodies */
} pal_estimate_cost;

/* a body as it is after a step; arrays are the work's, filled by pal_estimate_copy */
typedef struct pal_estimate_state {
    uint64_t tick;
    double time_s;
    int n_dof, n_node;
    double *x, *v;          /* m, m/s [n_dof][3] */
    double *load;           /* lasting and contact loads, N [n_node][3] */
    double *external_force; /* of load: what lasts, N [n_node][3] */
    double *borne;          /* loads under which it would rest at x, N [n_node][3]; the work finds them itself */
    bool asleep;
    bool touched;         /* a tool presses or pulls */
    int n_substep;        /* of the step */
    double other_limit_s; /* longest sub-step that all other bodies allow */
    pal_material material;
    /* FORCE rows of the body: names from open on, and which of them are not switched off */
    const char *row[PAL_ESTIMATE_COMPONENTS];
    bool component_enabled[PAL_ESTIMATE_COMPONENTS];
    int n_row;
    pal_estimate_cost cost[PAL_ESTIMATE_STEPS]; /* of the last steps awake, any order */
    int n_cost;
} pal_estimate_state;

/* the state of `body` of a world made from the scene; false: that is no state to look at (not finite, frozen, another
 * number of points). Copies, no memory. [sim] */
bool pal_estimate_copy(pal_estimate_state *state, const pal_world *world, int body);
/* of the world's last step, which took step_ms. No memory. [sim] */
pal_estimate_cost pal_estimate_cost_of(const pal_world *world, int body, double step_ms);
/* the rows of a world of the same body, made from `scene`, as those of the state; recipe: rows of the model too, which
 * is the state's. What pal_world_switch_component gives. Heap memory */
pal_err pal_estimate_match_components(const pal_estimate_state *state, pal_world *world, const pal_scene *scene,
                                      bool recipe);
#endif
