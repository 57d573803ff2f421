/* The FORCE and CONTACT components of one body as one system of equations, which implicit solvers multiply, assemble
 * and search along. The operator is A = mass M + stiff K + damp C: K and C as the components hold them since their last
 * linearise, M the masses, lumped or between points (num/mass_operator.h, whose damping between points is part of C);
 * rows and columns of fixed dofs are left out. Vectors are of dofs, [n_dof][3]. Where nodes are interpolated from
 * control points, a motion is placed on the nodes and the result restricted. Thread: [load] to make, [sim]. */
#ifndef PAL_SIM_IMPLICIT_SYSTEM_H
#define PAL_SIM_IMPLICIT_SYSTEM_H
#include "server/sim/implicit/interpolated_system.h"

typedef struct pal_system {
    pal_body *body;
    pal_interpolated_system *interpolated_system; /* NULL: nodes are the points */
    pal_component *force; /* FORCE components of load, for their tangents and energies [n_force] */
    int n_force, n_free;
    const pal_component *contact; /* of the step under way; n_contact 0: none   */
    int n_contact;
    bool has_energy;          /* every FORCE component but drag says its energy  */
    bool has_rotation;        /* some row knows rotations                  */
    bool has_contact;         /* some row of contact has a tangent         */
    double mass, stiff, damp; /* factors of M, K, C                        */
} pal_system;

/* of the FORCE components made so far; BUDGET: see interpolated_system.h; MEMORY. [load] */
pal_err pal_system_make(const pal_build *build, pal_system *out);
/* pattern of K; MEMORY. [load] */
pal_err pal_system_pattern(const pal_system *system, pal_arena *arena, pal_block_matrix *out);

void pal_system_linearise(const pal_system *system); /* FORCE components, at body->d */
/* the rows of contact at the step's begin, where they gave their loads */
void pal_system_linearise_contact(pal_system *system, const pal_step *step);
/* turn [n_dof][9] = sum of the components' rotations */
void pal_system_rotate(const pal_system *system, double *turn);
/* out = A p; p may be other than 0 at fixed points, out is 0 there */
void pal_system_multiply(const pal_system *system, const double *p, double *out);
/* out = (mass M + damp D) p, D the damping between points */
void pal_system_multiply_inertia(const pal_system *system, double mass, double damp, const double *p, double *out);
/* p' (mass M + damp D) p */
double pal_system_inertia_norm2(const pal_system *system, double mass, double damp, const double *p);
/* out += (k K + c C) p of the FORCE components alone */
void pal_system_multiply_stiffness(const pal_system *system, double k, double c, const double *p, double *out);
/* out += (k K + c C) p of contact alone */
void pal_system_multiply_contact(const pal_system *system, double k, double c, const double *p, double *out);
/* out = -df/dx p of the internal rows at x, a central difference of their forces: the true stiffness, which may be
 * indefinite. body->x is x afterwards, body->f and g are overwritten, low is work space; 0 at fixed points */
void pal_system_true_stiffness(const pal_system *system, const double *x, double *low, const double *p, double *out);
/* A without contact, fixed points too; of an embedded body with K and C at rest (pal_system_probe), fixed points left
 * out
 */
void pal_system_assemble(const pal_system *system, pal_block_matrix *to);
/* K and C of an embedded body at rest, wherever it is now, by at most `most` multiplies; true: all there. The rows are
 * linearised at rest afterwards unless there was nothing to do. Nothing and true without embed. No heap */
bool pal_system_probe(const pal_system *system, int max);
/* linearises at rest, wherever the body is now */
void pal_system_linearise_rest(const pal_system *system);
/* d = E x; nothing without embed */
void pal_system_interpolate(const pal_system *system);
/* work of the loads on nodes along a motion p, J */
double pal_system_work(const pal_system *system, const double *p);
double pal_system_energy(const pal_system *system); /* J, of the FORCE components at body->d   */
double pal_system_drag(const pal_system *system);   /* sum of the components' rates, 1/s       */

/* parts of the body that the tangents do not couple, and what holds them */
typedef struct pal_support_report {
    int n_part, n_unsupported; /* loose: fewer than three fixed nodes off a line */
    int unsupported_node;      /* a node of the first loose part; -1: none       */
} pal_support_report;
pal_err pal_system_find_supports(const pal_system *system, pal_support_report *out); /* MEMORY. [load] */
#endif
