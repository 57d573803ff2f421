/* The stiffness K of a body at rest where its components have no tangents, by differences of forces of groups of points
 * that share no element, and a preconditioner for what is solved with K or with the body's present stiffness: an
 * incomplete factor beside the rigid motions of clusters of a few elements, additively. Thread: [load] to make, then
 * one thread at a time. */
#ifndef PAL_SIM_IMPLICIT_REST_STIFFNESS_H
#define PAL_SIM_IMPLICIT_REST_STIFFNESS_H
#include "server/num/incomplete_cholesky.h"
#include "server/num/rigid_clusters.h"
#include "server/sim/implicit/system.h"

typedef struct pal_rest_preconditioner {
    pal_incomplete_cholesky incomplete;
    pal_rigid_clusters clusters;
} pal_rest_preconditioner;

/* the stiffness at rest and its preconditioner, for all that want them while a body is loaded */
typedef struct pal_rest_values {
    pal_block_matrix blocks; /* in `work` but for the pattern; value NULL: not found */
    const pal_rest_preconditioner *preconditioner;
    pal_arena *work; /* whoever has the struct destroys it */
} pal_rest_values;

/* body at rest. BUDGET: its elements are not known or they are too many (PAL_PROBE_WORK_MAX); MEMORY */
pal_err pal_rest_stiffness_find(const pal_system *system, pal_arena *arena, pal_block_matrix *out);
/* largest of diagonal over mass: of the order of the square of the highest frequency, 1/s^2 */
double pal_rest_stiffness_scale_1_s2(const pal_body *body, const pal_block_matrix *blocks, const uint8_t *skip);
/* blocks and skip [n_dof], dofs that do not move, are borrowed; blocks are shifted by a little mass where K is
 * singular. NUMERIC: not positive definite; BUDGET, MEMORY. Destroy it also after an error */
pal_err pal_rest_preconditioner_make(const pal_body *body, pal_block_matrix *blocks, const uint8_t *skip,
                                     pal_arena *arena, pal_rest_preconditioner *out);
void pal_rest_preconditioner_solve(const pal_rest_preconditioner *p, const double *r, double *out);
void pal_rest_preconditioner_destroy(pal_rest_preconditioner *p);
#endif
