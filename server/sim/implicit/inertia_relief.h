/* Inertia relief: the loads of a body without supports are balanced by the inertia of the rigid acceleration that
 * they cause, and the rigid part is removed from displacements. Moments are taken about positions at which internal
 * forces have no moment. Thread: [sim]. */
#ifndef PAL_SIM_IMPLICIT_INERTIA_RELIEF_H
#define PAL_SIM_IMPLICIT_INERTIA_RELIEF_H
#include "server/sim/core/body.h"

typedef struct pal_inertia_relief {
    double centre_m[3], mass_kg, inverse[9]; /* inverse: of the moment of inertia */
    const double *x;                         /* positions [n_node][3]    */
} pal_inertia_relief;

/* false: the moment of inertia is singular (all nodes lie on a line) */
bool pal_inertia_relief_make(const pal_body *body, const double *x, pal_inertia_relief *out);
/* force -= M (a + alpha x (x - centre)), with a and alpha such that net force and net moment vanish */
void pal_inertia_relief_balance(const pal_inertia_relief *relief, const pal_body *body, double *force);
/* move -= its mass-weighted least-squares rigid motion */
void pal_inertia_relief_remove_rigid(const pal_inertia_relief *relief, const pal_body *body, double *move);
#endif
