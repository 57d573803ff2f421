/* Stiffness that a tool feels where the solver knows the static compliance W of the body (pal_body.compliance): for
 * each direction of contact the tangent stiffness of all contacts in series with the tissue, for a grasp the 3 x 3
 * matrix K = (C + 1/k)^-1 of the patch. Elsewhere: stiffness_fit.h. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_HAPTIC_STIFFNESS_H
#define PAL_SIM_CONTACT_HAPTIC_STIFFNESS_H
#include "server/sim/contact/contact_implicit.h"

/* tangent stiffness in a direction, found when it is asked for and has changed */
typedef struct pal_haptic_stiffness_entry {
    bool used, contact;
    double normal[3], at_m[3], force_N, gap_m, k_N_m;
    int step; /* when it was found */
} pal_haptic_stiffness_entry;
typedef struct pal_haptic_stiffness {
    pal_haptic_stiffness_entry entry[PAL_CONTACT_PATCH_MAX];
    int turn, step; /* entry to be replaced next; steps of the world */
} pal_haptic_stiffness;

/* what is known for a blob: sets blob->k_N_m (0: nothing); returns whether it should be found again: the tool moved by
 * more than `min_m` or the force by 2 % since, and two steps have passed (an answer costs as much as some steps) */
bool pal_haptic_stiffness_find(const pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group,
                               const double at_m[3], double min_m);
/* Finds it again. Ties do not know that the direction of a contact turns when tissue slips round the sphere: with r the
 * tool's motion relative to tissue across `away`, a contact of force f loses f r / distance of its part along the
 * normal, which is taken off. Rows are those of the press's contacts that bear force and belong to the blob, or, for a
 * blob without contact, points near with weights (sum 1) and the contact stiffness k_N_m behind them */
void pal_haptic_stiffness_contact(pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group,
                                  const double at_m[3], pal_contact_implicit *press,
                                  pal_contact_springs *contact_springs, const pal_contact_points *touch,
                                  const pal_body *body, const pal_contact *contact, double radius_m,
                                  pal_arena *scratch);
void pal_haptic_stiffness_near(pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group,
                               const double at_m[3], const pal_contact_points *touch, const pal_body *body,
                               const int32_t *point, const double *weight, int n, double k_N_m, pal_arena *scratch);
/* scratch that these need in a sub-step */
size_t pal_haptic_stiffness_scratch(const pal_body *body);

/* ---- grasps ---- */

/* compliance C of a grasped patch, m/N, found a column at a time */
typedef struct pal_grasp_compliance {
    double column[3][3], at_m[3]; /* where the tool was when the first was found                  */
    int n, next;                  /* columns known; the one to be found next. Zeroed: none, first */
} pal_grasp_compliance;

/* finds the next column for a tool at at_m [3] that holds n nodes by weights (sum 1); nothing while all are known and
 * the tool is at rest, or where the body has no compliance. scratch: 6 doubles a node */
void pal_grasp_compliance_find(pal_grasp_compliance *compliance, const pal_body *body, const int32_t *node,
                               const double *weight, int n, const double at_m[3], pal_arena *scratch);
/* K = (C + 1/k)^-1 as xx xy xz yy yz zz: tissue behind a spring k; columns that are not known are taken isotropic.
 * False: none is known, or C is no compliance */
bool pal_grasp_compliance_series(const pal_grasp_compliance *compliance, double k_N_m, double K[6]);
/* how much the force rises for each metre that the spring's end leads the tissue along direction (any length); unless
 * all of C is known k_guess_N_m */
double pal_grasp_compliance_along(const pal_grasp_compliance *compliance, double k_N_m, double k_guess_N_m,
                                  const double direction[3]);
#endif
