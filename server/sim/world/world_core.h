/* The record of a world, for the files of sim/world and sim/transfer only. */
#ifndef PAL_SIM_WORLD_WORLD_CORE_H
#define PAL_SIM_WORLD_WORLD_CORE_H
#include "server/base/team.h"
#include "server/sim/plan/plan.h"
#include "server/sim/world/inserted_components.h"
#include "server/sim/world/shown_surface.h"

typedef struct pal_world {
    pal_arena *arena, *scratch;
    pal_team *team; /* NULL: steps take the caller's thread alone */
    pal_plan plan;
    pal_tools tools;
    pal_pose requested_pose[PAL_TOOL_MAX];
    bool has_requested_pose[PAL_TOOL_MAX];
    uint64_t pose_ns[PAL_TOOL_MAX];
    pal_material material[PAL_BODY_MAX];
    /* the lowest frequency of each body when it was last found, and the material that it had */
    double found_1_s[PAL_BODY_MAX];
    pal_material found_with[PAL_BODY_MAX];
    pal_shown part[PAL_BODY_MAX]; /* shown surfaces as at load; face and revision are those of the body */
    double step_s, time_s, limit_s, rest_limit_s;
    int max_substep, n_substep;
    bool unobserved; /* no observers: OUTPUT components run only where tools need them */
    uint64_t tick, step_ns, end_ns;
    pal_err component_err;       /* of the first component that failed in this step */
    pal_field_components fields; /* inserted at run time */
    pal_inserted brushes, blends;
} pal_world;

/* what the components of body b may access, without times */
pal_step pal_world_body_step(pal_world *world, int b);
/* smallest limit of all bodies that move, s, for sub-step `sub`; infinite when nothing limits. A body whose limit is
 * NaN is frozen */
double pal_world_find_limit(pal_world *world, int sub);
/* BUDGET: at rest, at the finest level, a step needs more sub-steps than the scene allows */
pal_err pal_world_check_budget(pal_world *world, pal_diagnostic *diag);
/* keeps lowest_1_s as that of the present material */
void pal_world_keep_lowest(pal_world *world, int b);
/* drag of the components of a body, 1/s */
double pal_world_drag_1_s(const pal_world *world, int b);
/* energy stored in the components of a body */
double pal_world_component_energy_J(const pal_world *world, int b);

/* sets load [n_node][3] to the lasting loads */
void pal_body_begin_loads(pal_body *body);
/* Scales down loads above what nodes bear (pal_body_node_load_cap_N, load_cap_N) and counts them as safeguards.
 * lasting: other loads are not added yet, and nodes far from their rest positions bear less */
void pal_body_cap_loads(pal_body *body, bool lasting);

/* lasting loads of a body [n_node][3], N, allocated at the first call; NULL: no memory */
double *pal_world_external_force(pal_world *w, int body);

/* runs the OUTPUT components of one body or of all bodies, so that the shown surface is up to date */
void pal_world_show(pal_world *world, int b);
void pal_world_show_all(pal_world *world);

/* writes ", node 512 at (1, 2, 3) mm sets it": the node that determines the limit by the components' bounds. Writes
 * nothing without bounds or where nodes are interpolated from dofs. Overwrites the force arrays */
void pal_world_describe_limit(const pal_world *world, char *text, size_t n_byte);

#endif
