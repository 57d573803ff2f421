/* The FORCE and CONTACT components of one body as one system of equations, which implicit solvers multiply, assemble
 * and search along. The operator is mass M + (stiff + viscous) K + damp D, and stiff K of contact. K is that of the
 * components' last linearise, M the mass matrix, lumped or between control points (num/mass_operator.h, which has D,
 * the damping between them). Rows and columns of fixed dofs are omitted. Vectors are over dofs, [n_dof][3]. Where nodes
 * are interpolated from control points, a displacement is interpolated to the nodes and the result restricted. Thread:
 * [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_SYSTEM_H
#define PAL_SIM_IMPLICIT_SYSTEM_H
#include "server/sim/implicit/interpolated_system.h"

typedef struct pal_system {
    pal_body *body;
    pal_interpolated_system *interpolated_system; /* NULL: the nodes are the dofs */
    pal_component *force; /* FORCE components made at load, for their tangents and energies [n_force] */
    int n_force, n_free;
    const pal_component *contact; /* of the present step; n_contact 0: none */
    int n_contact;
    bool has_energy;                   /* every FORCE component except drag reports its energy */
    bool has_rotation;                 /* some component reports rotations */
    bool has_contact;                  /* some CONTACT component has a tangent */
    bool chooses;                      /* one of them has points that may cease to touch */
    double mass, stiff, viscous, damp; /* coefficients of M, K (viscous: of damping proportional to K), D */
    double assemble_s;                 /* time in pal_system_assemble and pal_system_probe */
} pal_system;

/* memory of a vector over dofs */
static inline size_t pal_body_bytes3(const pal_body *body)
{
    return 3 * sizeof(double) * (size_t)body->n_dof;
}
/* out [n_dof][3] = A' f of forces on nodes; without interpolation f itself */
void pal_system_restrict(const pal_body *body, const double *f, double *out);
/* r [n_dof][3] = 0 at fixed and prescribed dofs */
void pal_system_clear_supported(const pal_body *body, double *r);

/* from the FORCE components made so far; BUDGET: see interpolated_system.h; MEMORY. [load] */
pal_err pal_system_make(const pal_build *build, pal_system *out);
/* sparsity pattern of K; MEMORY. [load] */
pal_err pal_system_pattern(const pal_system *system, pal_arena *arena, pal_block_matrix *out);

void pal_system_linearise(const pal_system *system); /* linearises the FORCE components at body->d */
/* linearises the CONTACT components at the beginning of the step, where they gave their loads */
void pal_system_linearise_contact(pal_system *system, const pal_step *step);
/* rotation [n_dof][9] = sum of the components' rotations */
void pal_system_rotate(const pal_system *system, double *rotation);
/* the operator times p: out = A p; p may be nonzero at fixed dofs, where out is 0 */
void pal_system_multiply(const pal_system *system, const double *p, double *out);
/* out = (mass M + damp D) p */
void pal_system_multiply_inertia(const pal_system *system, double mass, double damp, const double *p, double *out);
/* p' (mass M + damp D) p of an interpolated body */
double pal_system_inertia_norm2(const pal_system *system, double mass, double damp, const double *p);
/* out += k K p of the FORCE components alone */
void pal_system_multiply_stiffness(const pal_system *system, double k, const double *p, double *out);
/* out += k K p of contact alone */
void pal_system_multiply_contact(const pal_system *system, double k, const double *p, double *out);
/* has_contact, chooses: rows of contact that touch nothing answer no motion, so neither p, which none of their
 * directions is across; p, q are work space [n_dof][3] */
void pal_system_find_contact(pal_system *system, double *p, double *q);
/* out = -df/dx p of the internal forces at x by central difference: the true stiffness, which may be indefinite.
 * Sets body->x to x, overwrites body->f and g; low is work space; out is 0 at fixed dofs */
void pal_system_true_stiffness(const pal_system *system, const double *x, double *low, const double *p, double *out);
/* the operator without contact, fixed dofs included; for an interpolated body with K at rest (pal_system_probe)
 * and fixed dofs omitted */
void pal_system_assemble(pal_system *system, pal_block_matrix *to);
/* finds K of an interpolated body at rest, whatever its present state, by at most `max` products; true:
 * complete. Leaves the components linearised at rest unless there was nothing to do. Without interpolation: does
 * nothing, returns true. No heap */
bool pal_system_probe(pal_system *system, int max);
/* linearises at rest, whatever the present state */
void pal_system_linearise_rest(const pal_system *system);
/* d = A x; does nothing without interpolation */
void pal_system_interpolate(const pal_system *system);
/* After a solve that began at x0: contact components adapt to the displacement since then (pal_tangent.settle), which
 * is written to moved, of dofs, and node_moved, of nodes (the same without interpolation). true: solve again */
bool pal_system_settle_contact(const pal_system *system, pal_step *step, const double *x0, double *moved,
                               double *node_moved, bool last);
/* work of the nodal loads along a displacement p, J */
double pal_system_work(const pal_system *system, const double *p);
double pal_system_energy(const pal_system *system); /* J, of the FORCE components at body->d   */

/* parts of the body that the tangents do not couple, and their supports */
typedef struct pal_support_report {
    int n_part, n_unsupported; /* unsupported: fewer than three non-collinear fixed nodes */
    int unsupported_node;      /* a node of the first unsupported part; -1: none */
} pal_support_report;
pal_err pal_system_find_supports(const pal_system *system, pal_support_report *out); /* MEMORY. [load] */
#endif
