/* The FORCE and CONTACT rows of one body as one system of equations: what the implicit solvers multiply, assemble and
 * search along. The operator is A = mass M + stiff K + damp C, with K and C as the rows' tangents hold them since their
 * last linearise and M the lumped masses; rows and columns of held nodes are left out. Thread: [load] to make, [sim].
 */
#ifndef PAL_SIM_SYSTEM_H
#define PAL_SIM_SYSTEM_H
#include "server/sim/effect.h"

typedef struct pal_system {
    pal_body *body;
    pal_row *force; /* FORCE rows of load, for their tangents and energies [n_force] */
    int n_force, n_free;
    const pal_row *contact; /* of the step under way; n_contact 0: none   */
    int n_contact;
    bool has_energy;          /* every FORCE row but drag says its energy  */
    bool has_turn;            /* some row knows rotations                  */
    bool has_contact;         /* some row of contact has a tangent         */
    double mass, stiff, damp; /* factors of M, K, C                        */
} pal_system;

/* of the FORCE rows made so far; MEMORY. [load] */
pal_err pal_system_make(const pal_build *build, pal_system *out);
/* pattern of K; MEMORY. [load] */
pal_err pal_system_pattern(const pal_system *system, pal_arena *arena, pal_blocks *out);

void pal_system_linearise(const pal_system *system); /* FORCE rows, at body->d */
/* the rows of contact at the step's begin, where they gave their loads */
void pal_system_touch(pal_system *system, const pal_step *step);
/* turn [n_node][9] = sum of the rows' rotations */
void pal_system_rotate(const pal_system *system, double *turn);
/* out = A p; p may be other than 0 at held nodes, out is 0 there; p, out [n_node][3] */
void pal_system_multiply(const pal_system *system, const double *p, double *out);
/* out += (k K + c C) p of contact alone */
void pal_system_contact(const pal_system *system, double k, double c, const double *p, double *out);
/* out = -df/dx p of the internal rows at x [n_node][3], a central difference of their forces: the true stiffness, which
 * may be indefinite. body->x is x afterwards, body->f is overwritten, low [n_node][3] is work space; 0 at held nodes */
void pal_system_curve(const pal_system *system, const double *x, double *low, const double *p, double *out);
void pal_system_assemble(const pal_system *system, pal_blocks *to); /* A without contact, held nodes too */
double pal_system_energy(const pal_system *system);                 /* J, of the FORCE rows at body->d   */
double pal_system_drag(const pal_system *system);                   /* sum of the rows' rates, 1/s       */

/* parts of the body that the tangents do not couple, and what holds them */
typedef struct pal_supports {
    int n_part, n_loose; /* loose: fewer than three held nodes off a line */
    int loose_node;      /* a node of the first loose part; -1: none       */
} pal_supports;
pal_err pal_system_supports(const pal_system *system, pal_supports *out); /* MEMORY. [load] */
#endif
