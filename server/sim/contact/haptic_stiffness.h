/* The stiffness that a haptic bridge renders, where the solver knows the static compliance W (pal_body.compliance):
 *     contact        k = s' (1/k_c + J W J')^-1 s,  contacts J of stiffness k_c that move by s for each metre of the
 * tool near contact   k = 1 / (1/k_c + n' W n),      an even pressure on the points that the tool would lie on grasp K
 * = (1/k_g + W_g)^-1,          3 x 3, W_g of the weighted mean of the nodes W is the static compliance and not that of
 * an implicit step, which is stiffer than tissue by its mass over dt^2. Where there is none: stiffness_fit.h. An answer
 * costs as much as some steps, so answers are kept, one for each direction of contact, until tool or force have
 * changed. Scratch as pal_haptic_stiffness_scratch. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_HAPTIC_STIFFNESS_H
#define PAL_SIM_CONTACT_HAPTIC_STIFFNESS_H
#include "server/sim/contact/contact_group.h"
#include "server/sim/contact/contact_spring.h"

typedef struct pal_haptic_stiffness_entry {
    bool used, contact;
    double normal[3], at_m[3], force_N, gap_m, k_N_m;
    int step; /* when it was found */
} pal_haptic_stiffness_entry;
typedef struct pal_haptic_stiffness {
    pal_haptic_stiffness_entry entry[PAL_CONTACT_PATCH_MAX];
    int turn, step; /* entry to be replaced next; steps of the world */
} pal_haptic_stiffness;

/* sets group->k_N_m to what is known for it (0: nothing); true: it should be found again, as the tool has moved by more
 * than min_m or the force has changed by 2 %, and at least three steps have passed */
bool pal_haptic_stiffness_find(const pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               double min_m);
/* the largest known stiffness of a contact, at least k_N_m */
double pal_haptic_stiffness_max(const pal_haptic_stiffness *known, double k_N_m);
/* Finds that of a contact from those of the rows first + i, i < n, that bear force and belong to the group. Springs do
 * not know that the direction of a contact turns when tissue slips round the sphere: with r the tool's motion relative
 * to tissue across `away`, a contact of force f loses f r / distance of its part along the normal, which is taken off
 */
void pal_haptic_stiffness_contact(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                                  pal_contact_springs *springs, int first, const pal_contact_points *points,
                                  const pal_body *body, const pal_contact *contact, int n, double radius_m,
                                  pal_arena *scratch);
/* finds that of a group without contact: points near, weights (sum 1), contact stiffness k_N_m of them all */
void pal_haptic_stiffness_near(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               const pal_contact_points *points, const pal_body *body, const int32_t *point,
                               const double *weight, int n, double k_N_m, pal_arena *scratch);

/* W_g: columns are found one at a time; those not known yet are taken isotropic */
typedef struct pal_grasp_compliance {
    double column_m_N[3][3];
    int n_known, next; /* columns */
    double at_m[3];    /* of the tool when the first one was found */
} pal_grasp_compliance;

/* the next column, unless all are known and the tool rests; nodes and weights (sum 1) of the grasp [n] */
void pal_grasp_compliance_update(pal_grasp_compliance *w, const pal_body *body, const int32_t *node,
                                 const double *weight, int n, const double at_m[3], pal_arena *scratch);
/* K of tissue in series with a spring k, as xx xy xz yy yz zz; false: W_g is not known, or is no compliance */
bool pal_grasp_compliance_series(const pal_grasp_compliance *w, double k_N_m, double K[6]);
/* what the force rises by for each metre that the spring's end leads the tissue along a direction; k_guess_N_m until
 * all of W_g is known */
double pal_grasp_compliance_along(const pal_grasp_compliance *w, double k_N_m, double k_guess_N_m,
                                  const double direction[3]);

/* bytes of scratch that these need in a sub-step */
size_t pal_haptic_stiffness_scratch(const pal_body *body);
#endif
