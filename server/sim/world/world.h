/* The world: bodies and plan, one step function. No threads, no heap in a step, no files. Deterministic: the same
 * scene, poses and commands at the same ticks give the same hash on any machine with IEEE doubles.
 *
 * Scene frame: metres, origin at the first body's mesh origin; the others are offset by the difference of their
 * meshes' origin_m. Poses and frames use it. */
#ifndef PAL_SIM_WORLD_WORLD_H
#define PAL_SIM_WORLD_WORLD_H
#include "server/sim/core/brush.h"
#include "server/sim/core/effect.h"
#include "server/sim/world/frame.h"

typedef struct pal_world pal_world;

/* one row of the plan, for people and the panel */
typedef struct pal_component_info {
    const char *name, *body, *stage;
    size_t n_byte;
    uint64_t spent_ns;  /* last step */
    uint64_t n_run;     /* times it was run since load */
    const char *reason; /* what in the scene calls for it: "bodies[0].effects[2]"; lives as long as the world */
    bool fixed;         /* pal_world_switch_component would refuse to switch it off now */
} pal_component_info;

/* shown surface of a part; pointers borrow from the world and its scene and do not change while revision is the same */
typedef struct pal_shown {
    const char *name;
    int n_vertex, n_tri;
    const float *rest_m; /* scene frame             [n_vertex][3] */
    const int32_t *tri;  /* counter-clockwise, as at load; of a body that adapts the table of places, 0 0 0 in empty
                          * ones (pal_frame_part.slot brings its changes)  [n_tri][3] */
    uint64_t revision;
    const int32_t *face; /* control face of each triangle, -1: none (body.shown_face); NULL: no solid [n_tri] */
    bool is_adaptive;    /* triangles change while it runs */
    /* how vertices hang together where they are more than `tri` shows: vertex i >= n_coarse is the midpoint of the
     * smaller vertices parent[2 (i - n_coarse)], parent[.. + 1]; NULL: it is no such body */
    int n_coarse;
    const int32_t *parent;
    int n_coarse_tri;
    const int32_t *coarse_tri; /* triangles of the vertices below n_coarse [n_coarse_tri][3] */
} pal_shown;

pal_err pal_world_create(const pal_scene *scene, pal_diagnostic *diag,
                         pal_world **out); /* [load] borrows scene's meshes, copies the rest */
void pal_world_destroy(pal_world *world);  /* [load] */

/* the pose a tool shall have at the end of the next step; NULL: let go. REFUSED (state untouched) for a number that is
 * not finite, a position farther than 100 body sizes, a tool that does not exist. [sim] */
pal_err pal_world_pose(pal_world *world, int tool, const pal_pose *pose);
/* moves on by dt_s, split into sub-steps. REFUSED: dt_s is not a positive number; BUDGET: more sub-steps than
 * scene->max_substep even at rest, a body that refines being on its finest level (both: nothing moved); FROZEN when a
 * body diverged in this step and was frozen (body.why), or what a row gave that failed and froze its body: the other
 * bodies have moved on all the same. Where deformation alone asks for more than the budget, the step goes on
 * with heavier nodes (pal_body.n_mass_scaled). [sim]
 */
pal_err pal_world_step(pal_world *world, double dt_s);
/* every body back to rest, tools let go, time 0. [sim] */
void pal_world_reset(pal_world *world);
/* one body back to rest, as it was at load, and unfrozen; its lasting loads and brushes end, tools let it go. The other
 * bodies, tools and time go on as if nothing had been. REFUSED: no such body. [sim] */
pal_err pal_world_reset_body(pal_world *world, int body);
/* live material edit; sub-steps are chosen again; BUDGET or REFUSED leave all as it was. [sim] */
pal_err pal_world_material(pal_world *world, int body, const pal_material *material, pal_diagnostic *diag);
/* a lasting load on a node, N, body axes; replaces the node's earlier one, gone after reset. The first load on a body
 * takes memory. Of a body that adapts a node out of use is no such node, and the load of one that goes out of use waits
 * until it is in use again. A node bears pal_body_node_load_cap_N of it, and of a body that is held still less and less
 * from 2 S off its rest place on, a hundredth of that from 4 S (rescue.n_capped). REFUSED: not finite, no such node;
 * MEMORY. [load] */
pal_err pal_world_load(pal_world *world, int body, int node, const double force_N[3]);

/* A field of a body in colour (row field_output, 10 times a simulated second): wanted, the row is put into the running
 * plan with memory of its own and its values are there at once; not wanted, row and memory are gone again. What the
 * scene asks for itself stays either way. Poses, motion and hash know nothing of it. REFUSED: no such body, or its
 * model does not give the field (one sentence); MEMORY. Between steps; takes and frees heap memory. [sim] */
pal_err pal_world_field(pal_world *world, int body, pal_field field, bool wanted, pal_diagnostic *diag);
bool pal_world_has_field(const pal_world *world, int body, pal_field field); /* would it be refused? */

/* What the hand of a tool does to a body (brush.h): begins, changes, or with kind NONE or NULL ends the brush of slot
 * 0..PAL_TOOL_MAX-1. The first brush of a body puts the row `brush` into the running plan. Letting a tool go ends the
 * brushes of its slot, a reset ends all at once. REFUSED (one sentence): no such body or slot, a body without brushes,
 * a bad number, nothing within reach; MEMORY; both change nothing. Between steps; takes heap memory. [sim] */
pal_err pal_world_brush(pal_world *world, int body, int slot, const pal_brush *brush, pal_diagnostic *diag);
/* A load on the nodes of a body, N, body axes [n_node][3], that is let go over PAL_BLEND_TRANSFER_S
 * (blend_component.h): what makes up for a change between two steps. Replaces one that still acts; reset ends it.
 * REFUSED: no such body; MEMORY. Between steps; takes heap memory. [sim] */
pal_err pal_world_blend_force(pal_world *world, int body, const double *force_N);
/* The way from where a body is shown by its nodes to where it is shown now, m, body frame [n_shown][3]: added to what
 * is shown and touched, and let go with that load over as many steps (body.display_offset_m), so that a change between
 * two steps moves no shown vertex by more than a tenth of it in a frame. Shows the body at once. REFUSED: no such body;
 * MEMORY. Between steps; takes heap memory. [sim] */
pal_err pal_world_blend_display(pal_world *world, int body, const float *display_offset_m);
/* rows of brushes and loads that have gone out are taken out of the plan. After every step of a world that shall be
 * repeatable to the bit, as sub-steps may depend on the row; frees heap memory. [sim] */
void pal_world_remove_idle(pal_world *world);

/* Switches a row off, or on again, in the running world. Off: the row is gone from the plan with its memory, as if the
 * scene had no such entry; what it did goes on from where it is (x, v and all else stay, the row's energy leaves the
 * sum: gravity off is work done). On: made anew from the scene's or the model's entry, with the material of now, in
 * its old place of the plan; springs have their rest lengths. A solver that keeps patterns of the rows (implicit ones)
 * is made anew with that, which takes as long as at load. A reset leaves switched rows as they are.
 * scene: the one that the world was made from. Nothing and OK when it is so already. REFUSED (one sentence, nothing
 * changed): no such body, no entry asks for such a row, the body's solver, what it shows, its last elastic row, a
 * support that moves; BUDGET: too stiff for the step; MEMORY. Between steps; takes and frees heap memory. [sim] */
pal_err pal_world_switch_component(pal_world *world, const pal_scene *scene, int body, const char *row, bool on,
                                   pal_diagnostic *diag);

/* Bodies that sleep (row sleep) are awake in the next step: for measuring what a step costs. [sim] */
void pal_world_wake(pal_world *world);
/* Nobody looks at the world (false) or somebody does (true, as after create): while nobody does, OUTPUT rows are run
 * only for bodies that a tool may touch in the coming step. Motion and hash know nothing of it. true brings what is
 * shown up to date at once. [sim] */
void pal_world_watch(pal_world *world, bool watched);

/* A world made from an edited scene goes on where another is: its time, tools and poses, materials as they are by now
 * (but one that the edited body is too stiff or too light for), rescue counts, and of all other bodies that have as
 * many points x, v, lasting loads and, of those that adapt, the levels. x, v [n_dof][3] are the state of body `edited`
 * in their place (v NULL: at rest; edited -1: none). Rows begin anew: what a tool held it holds no more, brushes are
 * over. Both stand still. Heap memory when a material has changed. [sim] */
void pal_world_transfer(pal_world *world, const pal_world *before, int edited, const double *x, const double *v);
/* after it, of the edited body: each lasting load goes to the node that is nearest at rest to the one that bore it;
 * their sum stays. Without memory it bears none. [sim] */
void pal_world_transfer_loads(pal_world *world, int body, const pal_world *before);

void pal_world_frame(const pal_world *world, pal_frame *out); /* [sim] copies */
uint64_t
pal_world_hash(const pal_world *world); /* [sim] of tick, x, v and levels of every body (FNV-1a over the bits) */

uint64_t pal_world_tick(const pal_world *world);                                      /* steps since create or reset */
double pal_world_time_s(const pal_world *world);                                      /* simulated since then         */
void pal_world_current_material(const pal_world *world, int body, pal_material *out); /* with live edits; copies */
int pal_world_component_count(const pal_world *world);
void pal_world_component_info(const pal_world *world, int row, pal_component_info *out);
int pal_world_part_count(const pal_world *world);
void pal_world_shown(const pal_world *world, int part, pal_shown *out);
double pal_world_limit_s(const pal_world *world);  /* largest stable sub-step at the end of the last step */
int pal_world_substeps(const pal_world *world);    /* of the last step; before it: of the scene's step at rest */
double pal_world_energy_J(const pal_world *world); /* kinetic and of every row that has one */
size_t pal_world_bytes(const pal_world *world);    /* memory of the world's arenas           */
/* for tests, tools and the lab: the bodies themselves [sim] */
int pal_world_body_count(const pal_world *world);
pal_body *pal_world_body(pal_world *world, int body);
const pal_body *pal_world_view_body(const pal_world *world, int body); /* the same to read */
/* f and g of a body where it stands, of its FORCE rows and lasting loads, without contact; what a row failed with [sim]
 */
pal_err pal_world_assemble_forces(pal_world *world, int body);
void pal_world_invalidate_limits(pal_world *world,
                                 int body); /* after its x was set from outside: limits are taken anew */
const pal_component *pal_world_component(const pal_world *world, int row); /* the row itself, in the plan's order */
const pal_tools *pal_world_tools(const pal_world *world);
/* what the solver of a body says of itself; false: it says nothing */
bool pal_world_solve_report(const pal_world *world, int body, pal_solve_report *out);
#endif
