/* Inertia relief: the loads of a body without supports are balanced by the inertia of the rigid acceleration that they
 * cause, and the rigid part is removed from displacements. Positions are those about which internal forces have no
 * moment. Thread: [sim]. */
#ifndef PAL_SIM_IMPLICIT_INERTIA_RELIEF_H
#define PAL_SIM_IMPLICIT_INERTIA_RELIEF_H
#include "server/sim/core/body.h"

typedef struct pal_inertia_relief {
    double centre_m[3], mass_kg, inverse[9]; /* of the moment of inertia */
    const double *x;                         /* positions [n_node][3]    */
} pal_inertia_relief;

/* false: the body's moment of inertia is singular (its nodes stand on a line) */
bool pal_inertia_relief_make(const pal_body *body, const double *x, pal_inertia_relief *out);
/* force -= M (a + alpha x (x - centre)) with a, alpha such that no net force and no net moment is left */
void pal_inertia_relief_balance(const pal_inertia_relief *relief, const pal_body *body, double *force);
/* move -= the rigid motion nearest to it, weighted by mass */
void pal_inertia_relief_remove_rigid(const pal_inertia_relief *relief, const pal_body *body, double *move);
#endif
