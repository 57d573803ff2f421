/* The record of a transfer, for the files of this room only. */
#ifndef PAL_SIM_TRANSFER_TRANSFER_CORE_H
#define PAL_SIM_TRANSFER_TRANSFER_CORE_H
#include "server/sim/world/world.h"

typedef struct pal_transfer pal_transfer;

struct pal_transfer {
    int body;
    bool adaptive;            /* both adapt: rows are made when the new state is known    */
    bool same_control_points; /* both are solids of the same control cells                */
    pal_interpolation in;     /* nodes of the new body by those of the old one            */
    pal_interpolation back;   /* nodes of the old body by those of the new one            */
    pal_interpolation spread; /* how forces on old nodes go to new ones; none: as back   */
    int n_from, n_to;         /* nodes                                                    */
    int n_dof;                /* points of the new body                                   */
    double *x, *v;            /* new points                                 [n_dof][3]    */
    double *place, *rate;     /* new nodes                                  [n_to][3]     */
    double *pull;             /* what shall pull on them, N                 [n_to][3]     */
    double *bound;            /* of stiffness; work                         [n_to]        */
    double *work[5];          /* of least squares                           [n_dof][3]    */
    double *old;              /* work                                       [n_from][3]   */
    double *load;             /* loads of the old body's last step, N       [n_from][3]   */
    double *moving;           /* what accelerates its nodes, with these, N  [n_from][3]   */
    /* while the old world goes on */
    bool has_rehearsed;
    double *fix;              /* what smoothing added to places by interpolation, NULL: none yet [n_dof][3] */
    pal_body snapshot;        /* the old body as it was looked at; what changes of it is in snapshot_room */
    double *snapshot_room;    /* NULL: it never was */
    double snapshot_energy_J; /* its elastic energy then */
};

/* Forces. Rows of t->spread, made once: forces at old nodes -> at new ones, no net force is lost, by masses */
void pal_transfer_make_force_map(pal_transfer *t, const pal_body *from, const pal_body *to);
const pal_interpolation *pal_transfer_force_map(const pal_transfer *t); /* those; without memory for them t->back */
/* lasting loads, in memory of the new body's arena where it has none; without memory they are gone */
void pal_transfer_loads(const pal_transfer *t, const pal_body *from, pal_world *next);
/* t->pull: what shall pull on the new nodes for them to be as fast in a moment as the old ones would be, by f and g of
 * before as it stands, whose g goes, and t->moving. Takes t->old, t->rate, t->bound */
void pal_transfer_forces(pal_transfer *t, const pal_body *from, const pal_body *to);
/* t->place: nodes of the new body by those of the old one as they stand */
void pal_transfer_place_nodes(pal_transfer *t, const pal_body *from, const pal_body *to);
/* farthest that a node of before within the new elements is from where it was; of adaptive surfaces a vertex of both
 */
double pal_transfer_body_move(const pal_transfer *t, const pal_body *from, const pal_body *to);
/* do shown vertices of body b of the same number mean the same place in both worlds? */
bool pal_transfer_same_shown(const pal_world *next, const pal_world *before, int b);
struct pal_transfer_report;
/* the new body is shown where the old one was, and how far it is to be released from there; body_move_m is known */
void pal_transfer_display(pal_transfer *t, pal_world *next, const pal_world *before, struct pal_transfer_report *out);
#endif
