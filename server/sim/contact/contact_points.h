/* Contact points of a body's shown surface, evaluated in every sub-step, and forces on them.
 *
 * A step first collects the points near the tools (contact_samples.h) from body->shown, the last OUTPUT; each sub-step
 * then evaluates only those from the nodes. A force on a point goes to the nodes by its skin weights, normalised to sum
 * 1 in double precision, so that the nodes bear exactly the force that the tool gives.
 *
 * A skinned point p = sum w_i (x_i + R_i o_i) also moves when the frames R_i turn, and they turn with the faces around
 * their nodes. Forces go back by the exact transpose: w_i f on the node, and the torque w_i (R_i o_i) x f on the frame
 * as forces on the nodes of its fan. So contact does the same work on nodes as on the surface (without this it feeds
 * energy into tissue and a resting tool trembles), and total force and torque are those of the contact.
 * Memory: the world's arena. Thread: [sim], pal_contact_points_make [load]. */
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
    double *x, *v;                          /* of live vertices, by vertex: m, m/s [n_vertex][3] each  */

    /* forces of one tool at a time, on slots (frames of the skin, or nodes without one), then on nodes */
    int n_slot, n_node;
    int32_t *slot, *node; /* in use [n_slot] [n_node] */
    uint32_t *slot_mark, *node_mark, turn;
    double *slot_force, *slot_torque; /* N, Nm, by slot [slots][3] each  */
    double *force;                    /* N, by node     [body n_node][3] */
    /* how a slot's frame turns with its fan, at the present sub-step; by slot */
    pal_frame_spin *turning; /* [frames of the skin] */
    uint32_t *spin_mark, sub_step, *tool_mark;
    double dt_s; /* of the sub-step before */
} pal_contact_points;

/* one point that a tool presses */
typedef struct pal_contact {
    int32_t point;
    double x[3], away[3]; /* its place; unit, from the tool's centre to it */
    double depth_m, k_N_m;
    double force[3]; /* on the point */
} pal_contact;

/* points, at most max_sample samples (spacing grows to keep to it); body must show something; MEMORY, REFUSED */
pal_err pal_contact_points_make(const pal_body *body, double spacing_m, int max_sample, pal_arena *arena,
                                pal_contact_points *out);

/* a new step: nothing is live */
void pal_contact_points_begin(pal_contact_points *points);
/* the body jumped (reset): velocities start anew */
void pal_contact_points_reset(pal_contact_points *points);
/* adds the points of body->shown within reach_m of the segment a..b (body frame) to the live part and writes them to
 * list [max_point], vertices in ascending or the body's active order, then samples; returns how many; *nearest_m is
 * the least distance found (reach_m when none) */
int pal_contact_points_collect(pal_contact_points *points, const pal_body *body, const double a[3], const double b[3],
                               double reach_m, int32_t *list, double *nearest_m);
/* positions and velocities of the live vertices at the body's current state, in a sub-step of dt_s; frames of a skin
 * are brought up to date where live. A velocity is the way since the sub-step before over its time, which for a
 * symplectic step is exactly that of the nodes, turning of frames included; of a body that adapts it is the nodes' own
 * (tool_push says why). */
void pal_contact_points_update(pal_contact_points *points, const pal_body *body, double dt_s);
void pal_contact_points_position(const pal_contact_points *points, int point, double x[3]);
void pal_contact_points_velocity(const pal_contact_points *points, int point, double v[3]);

/* the fixed contact point nearest to p (all are looked at), its place and the unit normal of the shown surface there;
 * false: no such normal */
bool pal_contact_points_nearest(const pal_contact_points *points, const pal_body *body, const double p[3],
                                double place[3], double normal[3]);

/* Explicit stability in a sub-step: the largest eigenvalue of M^-1 sum k J' J over the contacts, J being a point's
 * motion along `away` with the free nodes, 1/s^2. Two power iterations from a uniform push, which is nearly the vector
 * looked for, since all points are pushed the same way */
double pal_contact_points_max_eigenvalue(pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                                         int n);
/* where points carry the nodes: bound [n_node] += row sums of the stiffness k of a point; returns k over its effective
 * mass, 1/s^2 */
double pal_contact_points_bound(const pal_contact_points *points, const pal_body *body, int point, double k_N_m,
                                double *bound_N_m);
/* true when two lists of contacts press on some common slot */
bool pal_contact_points_overlap(pal_contact_points *points, const pal_body *body, const pal_contact *a, int n_a,
                                const pal_contact *b, int n_b);

/* forces of one tool: begin, push every point, gather them on nodes, then apply scale times all of it to body->load */
void pal_contact_points_force_begin(pal_contact_points *points);
void pal_contact_points_add_force(pal_contact_points *points, const pal_body *body, int point, const double force_N[3]);
/* returns the largest force on a node, N */
double pal_contact_points_assemble(pal_contact_points *points, const pal_body *body);
void pal_contact_points_apply(const pal_contact_points *points, pal_body *body, double scale);

/* For rows of an implicit solver (contact_spring.h): the slots that bear a point, at most PAL_CONTACT_POINT_SLOTS of
 * them, some maybe twice: the point's motion is sum weight v_slot + spin_slot x arm; returns how many */
enum { PAL_CONTACT_POINT_SLOTS = 3 * PAL_SKIN_NEIGHBOURS };
int pal_contact_points_slots(const pal_contact_points *points, const pal_body *body, int point, int32_t *slot,
                             double *weight, double (*arm)[3]);
int pal_contact_points_slot_node(const pal_body *body, int slot);
/* how the slot's frame turns at the state of the last pal_contact_points_update; body has a skin */
const pal_frame_spin *pal_contact_points_frame_spin(pal_contact_points *points, const pal_body *body, int slot);

/* Young's modulus, Pa, at shown vertices where regions or strokes make it another than the body's, else 0 [n_vertex];
 * NULL: it is that nowhere. MEMORY. [load] */
pal_err pal_contact_points_young(const pal_contact_points *points, const pal_body *body, const pal_body_def *def,
                                 pal_arena *arena, float **out);

/* nodes that bear shown vertex `vertex` and their weights, sum 1: node [5], weight [5]; returns how many */
int pal_contact_points_nodes(const pal_body *body, int vertex, int32_t *node, double *weight);
#endif
