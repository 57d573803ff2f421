/* Springs between tools and tissue as an implicit solver takes them. One spring, a row, measures the motion of a
 * contact point (or of the mean of several) along a direction, linear in the nodes' displacement u since the sub-step
 * began: m_i = J_i u,   K = sum k_i J_i' J_i,   loads sum f_i J_i' .
 *
 * J_i is the exact derivative of the skinned point at the start of the sub-step, rotation of its frames included
 * (contact_points.h), so total force and torque are those of the contact, and K is symmetric and positive
 * semi-definite. It is applied in two halves, nodes -> velocity and spin of each slot in use -> points, at 6 products a
 * slot and point instead of 3 for each of the 20 to 60 nodes around.
 * Memory: the component's arena, for max_row rows. Thread: [sim], pal_contact_springs_make [load]. */
#ifndef PAL_SIM_CONTACT_CONTACT_SPRING_H
#define PAL_SIM_CONTACT_CONTACT_SPRING_H
#include "server/sim/contact/contact_points.h"

/* a slot's part in a row: motion += linear . v_slot + angular . spin_slot */
typedef struct pal_contact_spring_part {
    int32_t slot;
    double linear[3], angular[3];
} pal_contact_spring_part;

typedef struct pal_contact_springs {
    pal_contact_points *points; /* borrowed: slots and nodes in use */
    const pal_body *body;       /* borrowed */
    int n_row, n_part, max_row;
    int32_t *start;   /* first part of each row [max_row + 1]                     */
    double *k_N_m;    /* [max_row]                                                */
    double *motion_m; /* J u of the last pal_contact_springs_motion [max_row]     */
    pal_contact_spring_part *part;
} pal_contact_springs;

/* room for max_row rows in all, between tools and the points of a body; MEMORY */
pal_err pal_contact_springs_make(pal_contact_points *points, const pal_body *body, int max_row, pal_arena *arena,
                                 pal_contact_springs *out);
/* a new sub-step: no rows */
void pal_contact_springs_begin(pal_contact_springs *springs);
/* one point along a unit direction, at the state of the last pal_contact_points_update; its row, -1: no room */
int pal_contact_springs_add(pal_contact_springs *springs, int point, const double direction[3], double k_N_m);
/* the mean of n contacts' points, weights [n] with sum 1 */
int pal_contact_springs_add_mean(pal_contact_springs *springs, const pal_contact *contact, const double *weight, int n,
                                 const double direction[3], double k_N_m);
/* motion_m of every row for displacements u [n_node][3] */
void pal_contact_springs_motion(pal_contact_springs *springs, const double *u);
/* out += s K u; u, out [n_node][3] */
void pal_contact_springs_multiply(pal_contact_springs *springs, double s, const double *u, double *out);
/* to += s sum of force_N[i] J_(first+i)', i < n; to [n_node][3] */
void pal_contact_springs_load(pal_contact_springs *springs, double s, const double *force_N, int first, int n,
                              double *to);
/* the largest node force of such a sum, N */
double pal_contact_springs_max_force_N(pal_contact_springs *springs, const double *force_N, int first, int n);

/* Tangent stiffness that a tool feels which moves rows[i] by share[i] for each metre it goes itself, the tissue behind
 * them answering statically: share' (1/k + J W J')^-1 share,  W of `compliance`.
 * `passes` steps of conjugate gradients with k as preconditioner, one solve with the factor each. answer [n_node][3],
 * may be NULL: displacement of tissue for each metre. 0: not known. scratch: 2 [n_node][3] and 4 [n] */
double pal_contact_springs_stiffness(pal_contact_springs *springs, const pal_compliance *compliance,
                                     const int32_t *rows, const double *share, int n, int passes, double *answer,
                                     pal_arena *scratch);
#endif
