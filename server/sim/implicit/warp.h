/* Rotations of the material around each dof, and of vectors by them since a reference state. A preconditioner made at
 * the reference state serves a body that has turned and bent since: z = W A0^-1 W' r (warped stiffness: Mueller et al.
 * 2002; Courtecuisse et al. 2010). Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_IMPLICIT_WARP_H
#define PAL_SIM_IMPLICIT_WARP_H
#include "server/sim/implicit/system.h"

/* rotation of the material around each dof: the polar part of the components' sum, warm started */
typedef struct pal_node_rotations {
    int n_dof;
    bool any;     /* false: no component reports rotations, all are 1 */
    double *sum;  /* sum over components, in an update alone [n_dof][9] */
    double *quat; /* w x y z                    [n_dof][4] */
} pal_node_rotations;
/* work: borrowed, [n_dof][9] for updates; NULL: its own. MEMORY. [load] */
pal_err pal_node_rotations_make(const pal_system *system, double *work, pal_arena *arena, pal_node_rotations *out);
void pal_node_rotations_reset(pal_node_rotations *rotations); /* sets all to 1 */
/* as of the components' last linearise */
void pal_node_rotations_update(pal_node_rotations *rotations, const pal_system *system);

typedef struct pal_warp {
    int n_dof;
    bool rotated; /* false: w is 1 everywhere */
    float *base;  /* quat at the reference state [n_dof][4] */
    float *w;     /* rotations since; single precision is enough for a preconditioner [n_dof][9] */
} pal_warp;

/* the reference state is rest; MEMORY. [load] */
pal_err pal_warp_make(const pal_node_rotations *rotations, pal_arena *arena, pal_warp *out);
void pal_warp_rest(float *quat, int n_dof);                           /* quat [n_dof][4]: no rotation anywhere */
void pal_warp_keep(const pal_node_rotations *rotations, float *quat); /* quat [n_dof][4]: the present ones */
/* sets w from the present rotations. team: NULL, or threads that share the work; the same bits with any number */
void pal_warp_rotate(pal_warp *warp, const pal_node_rotations *rotations, pal_team *team);
/* out = W' r; z = W z [n_dof][3] */
void pal_warp_back(const pal_warp *warp, const double *r, double *out);
void pal_warp_forth(const pal_warp *warp, double *z);
#endif
