/* System of a body whose nodes are interpolated from control points. The unknowns are displacements of the control
 * points, components work on nodes, and with the interpolation matrix A (num/interpolation.h) the operator is
 *     mass M~ + stiff A' K A .
 * A product interpolates a displacement to the nodes, multiplies there and restricts the result (system.h).
 *
 * A factor needs the matrix itself. It is found at rest by probing: control points without a common neighbour are
 * displaced together by one unit along one axis, and the result is separated into columns. Components need only
 * multiply of a tangent. There are few control points (60 to 400), so probing takes 0.1 to 0.5 s at load;
 * after an edit it takes a few columns per step. Memory: the component's arena. Thread: make [load], then [sim]. */
#ifndef PAL_SIM_IMPLICIT_INTERPOLATED_SYSTEM_H
#define PAL_SIM_IMPLICIT_INTERPOLATED_SYSTEM_H
#include "server/sim/core/effect.h"

typedef struct pal_interpolated_system {
    double *p, *q;         /* a displacement and its product, at nodes [n_node][3] */
    double *rotation;      /* the components' rotations, at nodes [n_node][9] */
    pal_block_matrix rest; /* A' K A of the components at rest */
    int n_group;           /* groups displaced together: point[start[g]] .. point[start[g + 1] - 1] */
    int32_t *start;        /* [n_group + 1]                                                      */
    int32_t *point;        /* free points only                                                   */
    double *unit;          /* a displacement of control points [n_dof][3] */
    double *product;       /*                                                        [n_dof][3] */
    int next, n_move;      /* probes done, of how many; equal: rest is complete */
} pal_interpolated_system;

/* Makes work space, pattern and groups for the FORCE components [n_force]. Two control points are coupled where a
 * component couples nodes of both; for components that do not report couplings, where an element (dofs.clique) has
 * both, or else everywhere. BUDGET: probes times nodes exceed 2e7, about ten seconds' work; MEMORY. [load] */
pal_err pal_interpolated_system_make(const pal_body *body, const pal_component *force, int n_force, pal_arena *arena,
                                     pal_diagnostic *diag, pal_interpolated_system **out);
/* n_group, start and point from the pattern `rest`: points of a group have no common neighbour, so that one move finds
 * their columns. Also for bodies whose nodes are dofs. MEMORY. [load] */
pal_err pal_interpolated_system_group(pal_interpolated_system *e, const pal_body *body, pal_arena *arena);
/* marks the matrix out of date: the components have another material */
static inline void pal_interpolated_system_invalidate(pal_interpolated_system *interpolated)
{
    interpolated->next = 0;
}
/* to [n_dof][9] += the restriction of the values at nodes, from [n_node][9] */
void pal_interpolated_system_restrict9(const pal_interpolation *A, const double *from, double *to);
#endif
