/* A Cholesky factor of the body at a reference state, rotated with the body: z = W A0^-1 W' r, W being the rotation of
 * each dof since that state (warped stiffness: Mueller et al. 2002; Courtecuisse et al. 2010). One factor serves a body
 * however far it turns and bends; when solves with it need too many iterations, another is made of the present state on
 * a spare thread.
 *
 * Deterministic: a refreshed factor comes into use a number of steps after its begin that follows from its operation
 * count, never from the clock. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_WARP_H
#define PAL_SIM_IMPLICIT_WARP_H
#include "server/num/cholesky.h"
#include "server/sim/implicit/system.h"

/* rotations of the material around each point the solver moves: polar parts of the rows' sums, warm started */
typedef struct pal_node_rotations {
    int n_dof;
    bool any;     /* false: no row turns, all are 1        */
    double *sum;  /* of the rows                [n_dof][9] */
    double *quat; /* w x y z                    [n_dof][4] */
} pal_node_rotations;
pal_err pal_node_rotations_make(const pal_system *system, pal_arena *arena, pal_node_rotations *out);
void pal_node_rotations_reset(pal_node_rotations *turns); /* all 1 */
void pal_node_rotations_update(pal_node_rotations *turns,
                               const pal_system *system); /* at the components' last linearise */

typedef struct pal_warp {
    int n_dof;
    bool single;    /* precision of the factor                                      */
    bool turned;    /* false: w is 1 everywhere                                      */
    bool refreshed; /* the factor is not the one of pal_warp_factor any more         */
    pal_cholesky *factor;
    const double *quat;  /* of the turns it is warped by                  [n_dof][4] */
    double *base, *next; /* quat at the factor, at the one under way      [n_dof][4] */
    double *w;           /* rotations since                               [n_dof][9] */
    double *work;        /*                                               [n_dof][3] */
    int wait;            /* steps until the factor under way is taken; 0: none is     */
    int pause;           /* steps until another may begin                             */
    int n_factor;
    double analyse_s, factor_s;
} pal_warp;

/* analyses the pattern, fixed nodes left out; there is no factor yet. MEMORY. [load] */
pal_err pal_warp_make(const pal_block_matrix *pattern, const pal_body *body, const pal_node_rotations *turns,
                      bool single, pal_arena *arena, pal_warp *out);
void pal_warp_destroy(pal_warp *warp);
/* factor of a, assembled at the turns' present; a refresh under way is dropped. NUMERIC, MEMORY: the old one stays */
pal_err pal_warp_factor(pal_warp *warp, const pal_block_matrix *a);
void pal_warp_set_rest(pal_warp *warp); /* the factor in use is of the body at rest, not at the turns' present */
/* the same begun on a spare thread, of the values of a now, at the turns' present or at rest; false: one is under way
 * or was not long ago */
bool pal_warp_refresh(pal_warp *warp, const pal_block_matrix *a, bool at_rest, double step_s);
void pal_warp_step(pal_warp *warp); /* once a step: takes what is due; waits for it if it must */
void pal_warp_rotate(pal_warp *warp, const pal_node_rotations *turns); /* w from the turns' present */
void pal_warp_solve(pal_warp *warp, const double *r, double *z);       /* z = W A0^-1 W' r [n_dof][3]; z may be r */
#endif
