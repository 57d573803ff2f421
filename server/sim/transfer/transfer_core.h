/* The record of a transfer, for the files of sim/transfer only. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_CORE_H
#define PAL_SIM_TRANSFER_TRANSFER_CORE_H
#include "server/sim/world/world_core.h"

struct pal_transfer_report;

typedef struct pal_transfer {
    pal_arena *arena; /* memory of all arrays */
    int body;
    bool adaptive;             /* both are adaptive: interpolations are made when the new state is known */
    bool same_control_points;  /* both are subdivision solids of the same control cells */
    pal_interpolation A_new;   /* new nodes = A_new old nodes */
    pal_interpolation A_old;   /* old nodes = A_old new nodes */
    pal_interpolation A_force; /* forces on new nodes = A_force' forces on old ones; none: A_old */
    int n_from, n_to;          /* nodes                                                    */
    int n_dof;                 /* dofs of the new body */
    double *x, *v;             /* state of the new dofs [n_dof][3] */
    double *node_x, *node_v;   /* state of the new nodes [n_to][3] */
    double *force;             /* target forces on the new nodes, N [n_to][3] */
    double *bound;             /* bound of stiffness; work [n_to] */
    double *work[4];           /* work of least squares [n_dof][3] */
    double *old;               /* work                                       [n_from][3]   */
    double *load;              /* loads of the old body's last step, N       [n_from][3]   */
    double *unbalanced;        /* force on the nodes with these loads, N     [n_from][3] */
    /* rehearsal while the old world runs */
    bool has_rehearsed;
    double *fix;              /* correction of interpolated positions by smoothing, NULL: none yet [n_dof][3] */
    pal_body snapshot;        /* the old body at the snapshot, with arrays of its own for its state */
    double snapshot_energy_J; /* its elastic energy at the snapshot */
} pal_transfer;

/* Builds t->A_force once: distributes forces on old nodes over new nodes by mass, conserving the net force */
void pal_transfer_make_force_map(pal_transfer *t, const pal_body *from, const pal_body *to);
const pal_interpolation *pal_transfer_force_map(const pal_transfer *t); /* t->A_force; without memory for it t->A_old */
/* Sets t->force, the forces on the new nodes that give them the accelerations of the old ones, from f and g of before
 * in its present state (g is overwritten) and t->unbalanced. Overwrites t->old, t->node_v, t->bound */
void pal_transfer_forces(pal_transfer *t, const pal_body *from, const pal_body *to);
/* sets t->node_x: nodes of the new body interpolated from the present nodes of the old one */
void pal_transfer_interpolate_nodes(pal_transfer *t, const pal_body *from, const pal_body *to);
/* largest displacement of an old node within the new elements; of adaptive surfaces, of a vertex that both have */
double pal_transfer_body_move(const pal_transfer *t, const pal_body *from, const pal_body *to);
/* true: shown vertices of body b with equal numbers are the same place in both worlds */
bool pal_transfer_same_shown(const pal_world *next, const pal_world *before, int b);
/* shows the new body where the old one was, to be released from there, and reports how far; body_move_m is known */
void pal_transfer_display(pal_transfer *t, pal_world *next, const pal_world *before, struct pal_transfer_report *out);
#endif
