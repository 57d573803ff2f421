/* The world: bodies, plan and one step function. No threads, no heap call in a step, no files. Deterministic: the
 * same scene, poses and commands at the same ticks give the same hash on every run of a binary. Explicit solvers give
 * it with every compiler, optimization and vector width on IEEE doubles (tests/replay); solvers with a factor
 * (implicit, static, central_cg) only with the same binary, instruction set and BLAS library, whose products round
 * differently.
 *
 * Scene frame: metres, origin at the mesh origin of the first body; other bodies are offset by the difference of
 * their meshes' origin_m. Poses and frames use it. */
#ifndef PAL_SIM_WORLD_WORLD_H
#define PAL_SIM_WORLD_WORLD_H
#include "server/sim/core/brush.h"
#include "server/sim/core/effect.h"
#include "server/sim/world/frame.h"
#include "server/sim/world/shown_surface.h"

typedef struct pal_world pal_world;

/* one component of the plan, for display */
typedef struct pal_component_info {
    const char *name, *body, *stage;
    size_t n_byte;
    uint64_t spent_ns;  /* last step */
    uint64_t n_run;     /* runs since load */
    const char *reason; /* scene entry that asks for it: "bodies[0].effects[2]"; valid as long as the world */
    bool fixed;         /* pal_world_switch_component would refuse to switch it off now */
} pal_component_info;

pal_err pal_world_create(const pal_scene *scene, pal_diagnostic *diag,
                         pal_world **out); /* [load] borrows the scene's meshes, copies the rest */
void pal_world_destroy(pal_world *world);  /* [load] */

/* Requests a pose, which the tool reaches at the end of the next step; NULL: releases it. REFUSED (state unchanged):
 * not finite, farther than 100 body sizes away, no such tool. [sim] */
pal_err pal_world_pose(pal_world *world, int tool, const pal_pose *pose);
/* Every tool has been at its requested pose for long: for a world that takes the state of another. Call between steps.
 * [sim] */
void pal_world_place_tools(pal_world *world);
/* Advances by dt_s, split into sub-steps. REFUSED: dt_s is not a positive number. BUDGET: the step needs more than
 * scene->max_substep sub-steps even at rest with an adaptive body at its finest level. Both leave the world
 * unchanged. FROZEN: a body diverged in this step and was frozen (body.reason). The error of a component that failed is
 * returned and its body is frozen. In both cases the other bodies advance. If only deformation exceeds the budget,
 * the step continues with scaled masses (body.safeguards.n_mass_scaled). [sim] */
pal_err pal_world_step(pal_world *world, double dt_s);
/* Processor time of the last step, ns: what it would take on a machine without other work. Of a team it is the mean
 * over its threads, and includes spare threads while the step waited for them. [sim] */
uint64_t pal_world_step_ns(const pal_world *world);
/* resets every body to rest, releases tools, sets time to 0. [sim] */
void pal_world_reset(pal_world *world);
/* Resets one body to rest as at load and unfreezes it; its lasting loads and brushes end and tools release it. Other
 * bodies, tools and time are unaffected. REFUSED: no such body. [sim] */
pal_err pal_world_reset_body(pal_world *world, int body);
/* Edits the material at run time and chooses the sub-steps again; where the modulus falls to r of it, velocities of a
 * supported body are scaled by sqrt r. BUDGET or REFUSED: unchanged. [sim] */
pal_err pal_world_material(pal_world *world, int body, const pal_material *material, pal_diagnostic *diag);
/* Sets a lasting load on a node, N, body axes. It replaces the node's earlier load and ends at reset. The first load
 * on a body allocates memory. On an adaptive body an inactive node counts as no such node; the load of a node that
 * becomes inactive is suspended until the node is active again. A node bears at most pal_body_node_load_cap_N. On a
 * supported body the cap decreases with distance from the rest position beyond 2 S, down to a hundredth of it from 4
 * S on (safeguards.n_capped), where S is the box diagonal. REFUSED: not finite, no such node; MEMORY. [load] */
pal_err pal_world_load(pal_world *world, int body, int node, const double force_N[3]);

/* Shows or hides a field of a body in colour (component field_output, 10 times per simulated second). wanted: the
 * component is inserted into the running plan with memory of its own, and its values are available at once. Not
 * wanted: the component and its memory are removed. Fields that the scene asks for are unaffected. Poses, motion and
 * hash do not depend on it. REFUSED (one sentence): no such body, or its model does not give the field; MEMORY. Call
 * between steps; allocates and frees heap memory. [sim] */
pal_err pal_world_field(pal_world *world, int body, pal_field field, bool wanted, pal_diagnostic *diag);
bool pal_world_has_field(const pal_world *world, int body, pal_field field); /* true: pal_world_field would accept it */

/* Begins, changes or, with kind NONE or NULL, ends the brush of slot 0..PAL_TOOL_MAX-1 on a body (brush.h). The
 * first brush of a body inserts the component `brush` into the running plan. Releasing a tool ends the brushes of
 * its slot; a reset ends all. REFUSED (one sentence): no such body or slot, a body without brushes, an invalid
 * number, nothing within reach; MEMORY; both change nothing. Call between steps; allocates heap memory. [sim] */
pal_err pal_world_brush(pal_world *world, int body, int slot, const pal_brush *brush, pal_diagnostic *diag);
/* Sets a load on the nodes of a body, N, body axes [n_node][3], that compensates a change between two steps
 * (inserted_components.h). It replaces one that still acts; a reset ends it. REFUSED: no such body; MEMORY. Call
 * between steps; allocates heap memory. [sim] */
pal_err pal_world_blend_force(pal_world *world, int body, const double *force_N);
/* Sets the offset from where a body's nodes place its surface to where it is shown now, m, body frame [n_shown][3]. It
 * is released together with the load of pal_world_blend_force. Updates the shown surface at once. Errors as there.
 * [sim]
 */
pal_err pal_world_blend_display(pal_world *world, int body, const float *display_offset_m);
/* Removes idle components of brushes and blends from the plan. Call it after every step of a world that must be
 * bit-reproducible, because sub-steps may depend on the component; frees heap memory. [sim] */
void pal_world_remove_idle(pal_world *world);

/* Switches a component off or on in the running world. Off: the component and its memory are removed from the plan,
 * as if the scene had no such entry; x and v stay, and the component's energy leaves the sum. On: the component is made
 * again from the scene's or the model's entry with the present material, at its old position in the plan; springs keep
 * their rest lengths. A solver that stores patterns of the components (the implicit ones) is rebuilt, which takes as
 * long as at load. A reset does not change which components are off.
 * scene: the one that the world was made from. OK without effect when the component is in that state already.
 * REFUSED (one sentence, nothing changed): no such body; no entry asks for the component; it is the body's solver,
 * its output, its last elastic component or a moving support. BUDGET: too stiff for the step; MEMORY. Call between
 * steps; allocates and frees heap memory. [sim] */
pal_err pal_world_switch_component(pal_world *world, const pal_scene *scene, int body, const char *component, bool on,
                                   pal_diagnostic *diag);

/* Wakes sleeping bodies (component sleep) for the next step, to measure the cost of a step. [sim] */
void pal_world_wake(pal_world *world);
/* Tells the world whether it has observers (true after create, updates what is shown). Without, OUTPUT components run
 * only for bodies that a tool may touch in the coming step; motion and hash do not depend on it. [sim] */
void pal_world_watch(pal_world *world, bool watched);

void pal_world_frame(const pal_world *world, pal_frame *out); /* [sim] copies */
uint64_t pal_world_hash(const pal_world *world); /* [sim] FNV-1a over the bits of tick, x, v and levels of every body */

uint64_t pal_world_tick(const pal_world *world);            /* steps since create or reset */
double pal_world_time_s(const pal_world *world);            /* simulated time since then */
void pal_world_set_time_s(pal_world *world, double time_s); /* of a world that goes on from a moment of another */
void pal_world_current_material(const pal_world *world, int body, pal_material *out); /* with live edits; copies */
int pal_world_component_count(const pal_world *world);
void pal_world_component_info(const pal_world *world, int index, pal_component_info *out);
/* index of the first component of this effect on a body (-1: on any); -1: none */
int pal_world_find_component(const pal_world *world, int body, const char *name);
void pal_world_shown(const pal_world *world, int part, pal_shown *out);
double pal_world_limit_s(const pal_world *world); /* largest stable sub-step at the end of the last step */
int pal_world_substeps(const pal_world *world);   /* of the last step; before the first: of the scene's step at rest */
int pal_world_rest_substeps(const pal_world *world); /* of the scene's step at rest, with the present materials */
double pal_world_energy_J(const pal_world *world);   /* kinetic energy and that of every component that has one */
size_t pal_world_bytes(const pal_world *world);      /* memory of the world's arenas           */
/* dof of a body with the largest row sum of stiffness over mass by the bounds of its FORCE components, 1/s^2: it sets
 * the limit of explicit steps; -1: none has bounds, or nodes are not dofs. Overwrites body->g. [sim] */
int pal_world_limit_node(const pal_world *world, int body, double *omega2);
/* Finds lowest_1_s and lowest_error of a body at rest (implicit/lowest_frequency.h), which creation does where sleep or
 * a derived damping asks for it. mode: see there; NULL: not asked for. MEMORY. [load] */
pal_err pal_world_find_lowest(pal_world *world, int body, double *mode);
/* access to the bodies, for tests, tools and studies [sim] */
int pal_world_body_count(const pal_world *world);
pal_body *pal_world_body(pal_world *world, int body);
const pal_body *pal_world_view_body(const pal_world *world, int body); /* the same, read-only */
/* computes f and g of a body in its present state from its FORCE components and lasting loads, without contact;
 * returns the error of a component that fails [sim] */
pal_err pal_world_assemble_forces(pal_world *world, int body);
void pal_world_invalidate_limits(pal_world *world,
                                 int body); /* call after x was set from outside: bounds are computed again */
const pal_component *pal_world_component(const pal_world *world,
                                         int index); /* the component itself, in the plan's order */
const pal_tools *pal_world_tools(const pal_world *world);
/* would no component of the body change by itself from now on, were it at rest? */
bool pal_world_is_settled(const pal_world *world, int body);
/* report of a body's solver; false: it gives none */
bool pal_world_solve_report(const pal_world *world, int body, pal_solve_report *out);
#endif
