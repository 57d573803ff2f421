/* Ties: springs between tools and tissue as an implicit solver takes them. One tie measures the motion of a contact
 * point (or of the mean of several) along a direction, linear in the nodes' displacement since the sub-step began:
 *     m_i = J_i u,   K = sum k_i J_i' J_i,   loads sum f_i J_i' .
 *
 * J_i is the exact derivative of the skinned point at the start of the sub-step, turning of its frames included
 * (sim/touch.h, sim/turn.h), so loads, stiffness and the motion that settles a force belong together: total force and
 * torque are those of the contact and K is symmetric and positive semi-definite whatever is left out. It is applied in
 * two halves, nodes -> velocity and spin of each slot in use -> points, which costs 6 products a slot and point instead
 * of 3 for each of the 20 to 60 nodes around.
 *
 * Fixed room: most_row ties; a slot beyond `most_slot` or a frame beyond most_face faces is left out (the tie is
 * refused, the frame does not turn). Memory: the world's arena. Thread: [sim], pal_ties_make [load]. */
#ifndef PAL_SIM_CONTACT_TANGENT_H
#define PAL_SIM_CONTACT_TANGENT_H
#include "server/sim/contact/touch.h"

/* a slot's part in a tie: motion += linear . v_slot + angular . spin_slot */
typedef struct pal_tie_part {
    int32_t slot; /* index into pal_ties.frame */
    double linear[3], angular[3];
} pal_tie_part;

/* a slot in use: its node, and how it spins when the nodes around it move */
typedef struct pal_tie_frame {
    int32_t slot, node, end, first_face, n_face; /* end -1: it does not turn */
    double tilt[9], twist[3], Z[3];              /* spin = tilt sum(a' x b + a x b') + twist (Z . e') */
} pal_tie_frame;

typedef struct pal_tie_face {
    int32_t a, b;
    double to_a[3], to_b[3]; /* from the frame's node */
} pal_tie_face;

typedef struct pal_ties {
    int n_row, n_part, n_frame, n_face, n_node;
    int most_row, most_part, most_frame, most_face;
    int32_t *start;   /* first part of each row [most_row + 1]             */
    double *k_N_m;    /* [most_row]                                        */
    double *motion_m; /* J u of the last pal_ties_motion [most_row]        */
    pal_tie_part *part;
    pal_tie_frame *frame;
    pal_tie_face *face;
    double *state; /* v and spin, or force and torque, of frames in use [most_frame][6] */
    int32_t *local;
    uint32_t *local_mark, *node_mark, turn; /* by slot, by node                                       */
    int32_t *node;                          /* nodes that any row touches [body n_node]               */
    double *force;                          /* scratch of pal_ties_largest, by node [body n_node][3]  */
} pal_ties;

/* room for most_row ties in all; MEMORY */
pal_err pal_ties_make(const pal_body *body, int most_row, pal_arena *arena, pal_ties *out);
/* a new sub-step: no ties */
void pal_ties_begin(pal_ties *ties);
/* one point along a unit direction, at the state of the last pal_touch_update; its row, -1: no room */
int pal_ties_add(pal_ties *ties, pal_touch *touch, const pal_body *body, int point, const double direction[3],
                 double k_N_m);
/* the mean of n contacts' points, weights [n] with sum 1 */
int pal_ties_add_mean(pal_ties *ties, pal_touch *touch, const pal_body *body, const pal_contact *contact,
                      const double *weight, int n, const double direction[3], double k_N_m);
/* motion_m of every row for displacements u [n_node][3] */
void pal_ties_motion(pal_ties *ties, const double *u);
/* out += s K u; u, out [n_node][3] */
void pal_ties_multiply(pal_ties *ties, double s, const double *u, double *out);
/* to += s sum of force_N[i] J_(first+i)', i < n; to [n_node][3] */
void pal_ties_load(pal_ties *ties, double s, const double *force_N, int first, int n, double *to);
/* the largest node force of such a sum, N */
double pal_ties_largest(pal_ties *ties, const double *force_N, int first, int n);

/* Tangent stiffness that a tool feels which moves rows[i] by share[i] for each metre it goes itself, the tissue behind
 * them answering statically: 1^T-form  share' (1/k + J W J')^-1 share,  W = body->compliance (haptics.md 2.3 step 3 a).
 * `passes` steps of conjugate gradients with k as preconditioner, one back-substitution each; every pass comes closer
 * from below (the first is the answer of an even pressure, 8 % low under a round contact). scratch: 2 [n_node][3] and 4
 * [n]. answer [n_node][3], may be NULL: how tissue moves for each metre. 0: not known */
double pal_ties_stiffness(pal_ties *ties, const pal_body *body, const int32_t *rows, const double *share, int n,
                          int passes, double *answer, pal_arena *scratch);
#endif
