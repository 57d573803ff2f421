/* A body whose nodes are interpolated from control points, as an implicit solver takes it: the unknowns are motions of
 * points, components work on nodes, and with E the interpolation
 *     A = mass M~ + E' (stiff K + damp C) E .
 * A product places a motion on the nodes, multiplies there and restricts the result (system.h).
 *
 * A factor needs the matrix itself. It is found at rest, column by column: all points without a common neighbour move
 * at once by one unit along one axis, and the result is taken apart. Components need nothing but their multiply for it.
 * There are few points (60 to 400), so this takes 0.1 to 0.5 s at load; after an edit it is done a few columns a step.
 * Memory: the world's arena. Thread: make [load], then [sim]. */
#ifndef PAL_SIM_IMPLICIT_INTERPOLATED_SYSTEM_H
#define PAL_SIM_IMPLICIT_INTERPOLATED_SYSTEM_H
#include "server/sim/core/effect.h"

typedef struct pal_interpolated_system {
    double *p, *q;         /* a motion and its answer at nodes                       [n_node][3] */
    double *turn;          /* the components' rotations at nodes                           [n_node][9] */
    pal_block_matrix rest; /* E' K E of the rows at rest                                         */
    double *damping;       /* E' C E of the rows at rest, in its pattern; NULL: no row damps     */
    int n_group;           /* points moved at once: point[start[g]] .. point[start[g + 1] - 1]   */
    int32_t *start;        /* [n_group + 1]                                                      */
    int32_t *point;        /* free points only                                                   */
    double *unit;          /* a move of points                                       [n_dof][3] */
    double *answer;        /*                                                        [n_dof][3] */
    int next, n_move;      /* moves made, of how many; equal: rest and damping are all there     */
} pal_interpolated_system;

/* work space, pattern and groups for the FORCE components [n_force]. Points are coupled where a row couples nodes of
 * both, for rows that do not say so where an element (dofs.clique) has both, or else everywhere. BUDGET: moves times
 * nodes are more than 2e7, some ten seconds' work; MEMORY. [load] */
pal_err pal_interpolated_system_make(const pal_body *body, const pal_component *force, int n_force, pal_arena *arena,
                                     pal_diagnostic *diag, pal_interpolated_system **out);
/* the numbers are out of date: rows have other material */
void pal_interpolated_system_invalidate(pal_interpolated_system *e);
/* to += rows' sum of 9 numbers at nodes [n_node][9], pulled back to points [n_dof][9] */
void pal_interpolated_system_restrict9(const pal_interpolation *rows, const double *from, double *to);
#endif
