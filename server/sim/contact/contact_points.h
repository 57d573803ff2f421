/* Contact points of a body's shown surface, evaluated in every sub-step, and forces on them. A step first collects the
 * points near the tools (contact_samples.h) from display.shown, the last OUTPUT; each sub-step evaluates only those.
 *
 * A skinned point p = sum w_i (x_i + R_i o_i), weights normalised to sum 1, also moves when the frames R_i turn with
 * the faces around their nodes. Forces go back by the exact transpose: w_i f on the node, and the torque w_i (R_i o_i)
 * x f on the frame as forces on the nodes of its fan. So contact does the same work on nodes as on the surface (else it
 * feeds energy into tissue and a resting tool trembles), and total force and torque are those of the contact.
 * Memory: the component's arena. Thread: [sim], pal_contact_points_make [load]. */
#ifndef PAL_SIM_CONTACT_CONTACT_POINTS_H
#define PAL_SIM_CONTACT_CONTACT_POINTS_H
#include "server/sim/contact/contact_samples.h"
#include "server/sim/contact/frame_spin.h"
#include "server/sim/core/body.h"
#include "server/sim/core/definition.h"
#include "server/sim/core/tools.h"

typedef struct pal_contact_points {
    pal_contact_samples sample; /* which points there are */

    /* this step's live part: vertices and frames near some tool */
    int n_live, n_frame;
    int32_t *live, *frame;                  /* [n_live] [n_frame]                                      */
    uint32_t *live_mark, *frame_mark, mark; /* a vertex or frame is live when its mark is `mark`       */
    uint32_t *seen;                         /* sub-step in which x was last written [n_vertex]         */
    uint8_t *sides;                         /* of the last search's box on which vertices are [n_vertex] */
    double *x, *v;                          /* of live vertices, by vertex: m, m/s [n_vertex][3] each  */

    /* slots (frames of the skin, or nodes without one) in use, and the nodes that their motion depends on */
    int n_slot, n_node;
    int32_t *slot, *node; /* in use [n_slot] [n_node] */
    uint32_t *slot_mark, *node_mark, stamp, *tool_mark;
    double *state;        /* force N and torque Nm, or velocity and spin, by slot [slots][6] */
    double *force;        /* N, by node [body n_node][3] */
    pal_frame_spin *spin; /* how a slot's frame rotates with its fan, at the present sub-step [frames of the skin] */
    pal_frame_face *face; /* of all fans */
    uint32_t *spin_mark, sub_step;
    double dt_s; /* of the sub-step before */
} pal_contact_points;

/* one point that a tool presses */
typedef struct pal_contact {
    int32_t point;
    double away[3]; /* unit, from the tool's centre to it */
    double depth_m, k_N_m;
    double normal_N; /* force along `away` alone     */
    double force[3]; /* on the point, with friction */
} pal_contact;

/* points, at most max_sample samples (spacing grows to keep to it); body must show something; MEMORY, REFUSED */
pal_err pal_contact_points_make(const pal_body *body, double spacing_m, int max_sample, pal_arena *arena,
                                pal_contact_points *out);

/* a new step: nothing is live */
void pal_contact_points_begin(pal_contact_points *points);

/* adds the points of display.shown within reach_m of the segment a..b (body frame) to the live part and writes them to
 * list [max_point], vertices in ascending or the body's active order, then samples; returns how many */
int pal_contact_points_collect(pal_contact_points *points, const pal_body *body, const double a[3], const double b[3],
                               double reach_m, int32_t *list);
/* positions and velocities of the live vertices in a sub-step of dt_s; updates the live frames of a skin. A velocity is
 * the displacement since the sub-step before over its time, of an adaptive body that of the node */
void pal_contact_points_update(pal_contact_points *points, const pal_body *body, double dt_s);
/* of a point, with from points->x its position, with points->v its velocity */
void pal_contact_points_at(const pal_contact_points *points, int point, const double *from, double out[3]);

/* position of the fixed contact point nearest to p and the unit normal of the shown surface there; false: no normal */
bool pal_contact_points_nearest(const pal_contact_points *points, const pal_body *body, const double p[3], double at[3],
                                double normal[3]);

/* The largest eigenvalue of D^-1 sum k J' J over the contacts, J being a point's motion along `away` with the free
 * nodes and D a diagonal matrix, 0 where it takes no part: of the body's masses, kg, for explicit stability in 1/s^2,
 * or of row sums, N/m [n_node]. Two power iterations from a uniform push, which is close to its eigenvector */
double pal_contact_points_max_eigenvalue(pal_contact_points *points, const pal_body *body, const double *diagonal,
                                         const pal_contact *contact, int n);
/* Row sums of that matrix without M, |J_i| k sum |J_j| over the nodes j, which bound it from above: begin_slots, add
 * every contact's with its stiffness, then to bound [n_node] */
void pal_contact_points_add_bound(pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                                  double k_N_m);
void pal_contact_points_assemble_bound(const pal_contact_points *points, const pal_body *body, double *bound_N_m);
/* interpolated nodes: bound [n_node] += row sums of a point's stiffness k; returns k over its effective mass, 1/s^2 */
double pal_contact_points_bound(const pal_contact_points *points, const pal_body *body, int point, double k_N_m,
                                double *bound_N_m);
/* true when two lists of contacts press on some common slot */
bool pal_contact_points_overlap(pal_contact_points *points, const pal_body *body, const pal_contact *a, int n_a,
                                const pal_contact *b, int n_b);

/* The slots that bear a point, some maybe twice: the point's motion is sum weight v_slot + spin_slot x arm */
enum { PAL_CONTACT_POINT_SLOTS = 3 * PAL_SKIN_NEIGHBOURS };
typedef struct pal_contact_slot {
    int32_t slot;
    double weight, arm[3]; /* arm: m */
} pal_contact_slot;
/* out [PAL_CONTACT_POINT_SLOTS]; returns how many */
int pal_contact_points_slots(const pal_contact_points *points, const pal_body *body, int point, pal_contact_slot *out);
int pal_contact_points_slot_node(const pal_body *body, int slot);

/* Slots in use: none; one more (its state and the force on its nodes are 0 then); state = velocity and spin when the
 * nodes move with u [n_node][3]; out [n_node][3] += forces and torques in state */
void pal_contact_points_begin_slots(pal_contact_points *points);
void pal_contact_points_use_slot(pal_contact_points *points, const pal_body *body, int slot);
void pal_contact_points_to_slots(pal_contact_points *points, const pal_body *body, const double *u);
void pal_contact_points_from_slots(const pal_contact_points *points, const pal_body *body, double *out);

/* forces of one tool: begin_slots, add every point's, assemble them on nodes */
void pal_contact_points_add_force(pal_contact_points *points, const pal_body *body, int point, const double force_N[3]);
/* both return the largest force on a node, N */
double pal_contact_points_assemble(pal_contact_points *points, const pal_body *body);
double pal_contact_points_max_force_N(const pal_contact_points *points);

/* Young's modulus, Pa, where it differs from the body's, else 0 [n_vertex]; NULL: nowhere. MEMORY. [load] */
pal_err pal_contact_points_young(const pal_contact_points *points, const pal_body *body, const pal_body_def *def,
                                 pal_arena *arena, float **out);

/* What caps leave of a force on a tool: the largest s in [0, 1] for which s force_N, beside what the tool feels
 * already, keeps to its cap at its ramp, and s max_node_N, the largest force on a node, to body->load_cap_N */
double pal_tool_force_share(const pal_body *body, const pal_tool *tool, const double force_N[3], double max_node_N);

/* nodes that bear shown vertex `vertex` and their weights, sum 1: node [5], weight [5]; returns how many */
int pal_contact_points_nodes(const pal_body *body, int vertex, int32_t *node, double *weight);
#endif
