/* A Cholesky factor of the body at a reference state, rotated with the body: z = W A0^-1 W' r, where W is the
 * rotation of each dof since that state (warped stiffness: Mueller et al. 2002; Courtecuisse et al. 2010). One
 * factor serves a body through large rotation and bending. When solves with it need too many iterations, a factor of
 * the present state is computed on a spare thread.
 *
 * Deterministic: a refreshed factor takes effect after a simulated time that follows from its operation count, never
 * from the clock. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_WARP_H
#define PAL_SIM_IMPLICIT_WARP_H
#include "server/num/cholesky.h"
#include "server/sim/implicit/system.h"

/* rotation of the material around each dof: the polar part of the components' sum, warm started */
typedef struct pal_node_rotations {
    int n_dof;
    bool any;     /* false: no component reports rotations, all are 1 */
    double *sum;  /* sum over components [n_dof][9] */
    double *quat; /* w x y z                    [n_dof][4] */
} pal_node_rotations;
pal_err pal_node_rotations_make(const pal_system *system, pal_arena *arena, pal_node_rotations *out);
void pal_node_rotations_reset(pal_node_rotations *rotations); /* sets all to 1 */
/* as of the components' last linearise */
void pal_node_rotations_update(pal_node_rotations *rotations, const pal_system *system);

typedef struct pal_warp {
    int n_dof;
    bool single;    /* the factor is in single precision */
    bool rotated;   /* false: w is 1 everywhere                                      */
    bool refreshed; /* the factor is newer than the one of pal_warp_factor */
    pal_cholesky *factor;
    const double *quat;  /* of the rotations it is warped by [n_dof][4] */
    double *base, *next; /* quat at the factor in use, at the one in progress [n_dof][4] */
    double *w;           /* rotations since the factor [n_dof][9] */
    double *work;        /*                                               [n_dof][3] */
    bool pending;        /* a factor is in progress */
    double left_s;       /* simulated time until it takes effect, or until another refresh may start; below 0: now */
    int n_factor;
    double analyse_s, factor_s;
} pal_warp;

/* analyses the pattern without fixed dofs; there is no factor yet. MEMORY. [load] */
pal_err pal_warp_make(const pal_block_matrix *pattern, const pal_body *body, const pal_node_rotations *rotations,
                      bool single, pal_arena *arena, pal_warp *out);
void pal_warp_destroy(pal_warp *warp);
/* factors a, assembled at the present rotations; a refresh in progress is dropped. NUMERIC, MEMORY: the old factor
 * stays */
pal_err pal_warp_factor(pal_warp *warp, const pal_block_matrix *a);
/* declares the factor in use to be that of the body at rest, not at the present rotations */
void pal_warp_set_rest(pal_warp *warp);
/* true: a refresh may start; false: one is in progress or was recently */
static inline bool pal_warp_ready(const pal_warp *warp)
{
    return !warp->pending && !(warp->left_s > 0);
}
/* starts a factor on a spare thread, of the present values of a, at the present rotations or at rest; false: not ready
 */
bool pal_warp_refresh(pal_warp *warp, const pal_block_matrix *a, bool at_rest);
/* once per sub-step: adopts a factor that is due, and waits for it if necessary */
void pal_warp_step(pal_warp *warp, double dt_s);
void pal_warp_rotate(pal_warp *warp, const pal_node_rotations *rotations); /* sets w from the present rotations */
void pal_warp_solve(pal_warp *warp, const double *r, double *z);           /* z = W A0^-1 W' r [n_dof][3]; z may be r */
#endif
