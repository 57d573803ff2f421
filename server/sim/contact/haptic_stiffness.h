/* The stiffness that a haptic bridge renders, by the static compliance W (pal_body.compliance):
 *     contact        k = s' (1/k_c + J W J')^-1 s,  contacts J of stiffness k_c that move by s for each metre of tool
 *     across it      k_t = 2 / (a + b),             a = 1/k_c + t' W t of two directions t, where there is friction
 *     near contact   k = 1 / (1/k_c + n' W n),      an even pressure on the points that the tool would lie on
 *     grasp          K = (1/k_g + W_g)^-1,          3 x 3, W_g of the weighted mean of the nodes
 * W is the static compliance, because an implicit step is stiffer than tissue by its mass over dt^2. An answer costs as
 * much as some steps, so answers are kept, one for each direction of contact, until tool or force have changed.
 *
 * Until W is known the slope of force over displacement by least squares (pal_stiffness_fit),
 *     k = (cov(x, f) + p^2 k_start) / (var(x) + p^2),   p = L/10,  L = SHALLOW_RADII of a tool,
 * with means over the path of the tool, on which samples farther back than L count less and less. A tool at rest keeps
 * its stiffness, and the estimate does not depend on the number of steps. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_HAPTIC_STIFFNESS_H
#define PAL_SIM_CONTACT_HAPTIC_STIFFNESS_H
#include "server/sim/contact/contact_group.h"
#include "server/sim/contact/contact_spring.h"

typedef struct pal_stiffness_fit {
    double x[3], f[3], xx, xf; /* weighted means         */
    double last_m[3];          /* of the newest sample   */
    double k_N_m, k_start_N_m; /* estimate, start value  */
} pal_stiffness_fit;

void pal_stiffness_fit_start(pal_stiffness_fit *fit, double k_start_N_m);
/* a displacement of the tool and the force on tissue there (of one direction: the others 0) */
void pal_stiffness_fit_add(pal_stiffness_fit *fit, const double x_m[3], const double f_N[3], double radius_m);
/* within the range that devices render */
double pal_haptic_stiffness_clamp(double k_N_m);

typedef struct pal_haptic_stiffness_entry {
    bool used, contact;
    double normal[3], at_m[3], force_N, gap_m, k_N_m;
    double time_s;      /* when it was found */
    int n_across;       /* directions across for which give_m_N was found again since then */
    double give_m_N[2]; /* of contact and tissue across */
    double sideways;    /* of pal_contact_group */
} pal_haptic_stiffness_entry;
typedef struct pal_haptic_stiffness {
    pal_haptic_stiffness_entry entry[PAL_CONTACT_PATCH_MAX];
    int next;        /* entry to be replaced next */
    double time_s;   /* of the world */
    double follow_s; /* from one answer to the next */
} pal_haptic_stiffness;

/* sets group->k_N_m to what is known for it (0: nothing); true: it should be found again, as the tool has moved by more
 * than min_m or the force has changed by FORCE_SHARE, and follow_s has passed */
bool pal_haptic_stiffness_find(const pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               double min_m);
/* the largest known stiffness of a contact, at least k_N_m */
double pal_haptic_stiffness_max(const pal_haptic_stiffness *known, double k_N_m);
/* Finds that of a contact from those of the rows first + i, i < n, that bear force and belong to the group. Taken off
 * is what springs do not show: with r the tool's motion relative to tissue across `away`, a contact of force f turns
 * and loses f r / distance of its part along the normal */
void pal_haptic_stiffness_contact(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                                  const pal_compliance *compliance, pal_contact_springs *springs, int first,
                                  const pal_contact *contact, int n, double radius_m, pal_arena *scratch);
/* Finds the give of a contact across its normal, of which friction shares out its force as the normal force is, with
 * springs of k_N_m; one direction a call, 2 / (a + b) of both is the stiffness. False: both are known for the normal
 * stiffness that is kept */
bool pal_haptic_stiffness_across(pal_haptic_stiffness *known, const pal_contact_group *group,
                                 const pal_contact_points *points, const pal_body *body,
                                 const pal_compliance *compliance, const pal_contact *contact, int n, double k_N_m,
                                 pal_arena *scratch);
/* finds that of a group without contact: points near, weights (sum 1), contact stiffness k_N_m of them all */
void pal_haptic_stiffness_near(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               const pal_contact_points *points, const pal_body *body, const pal_compliance *compliance,
                               const int32_t *point, const double *weight, int n, double k_N_m, pal_arena *scratch);

/* W_g: columns are found one at a time; those not known yet are taken isotropic */
typedef struct pal_grasp_compliance {
    double column_m_N[3][3];
    int n_known, next; /* columns */
    double at_m[3];    /* of the tool when the first one was found */
    double since_s;    /* time since the last one was found */
} pal_grasp_compliance;

/* the next column, unless all are known and the tool has moved by less than min_m or they are found more often than in
 * follow_s; weight [n] has the sum 1; step_s: time since the last call */
void pal_grasp_compliance_update(pal_grasp_compliance *w, const pal_body *body, const pal_compliance *compliance,
                                 const int32_t *node, const double *weight, int n, const double at_m[3], double min_m,
                                 double follow_s, double step_s, pal_arena *scratch);
/* K of tissue in series with a spring k, as xx xy xz yy yz zz; false: W_g is not known, or is no compliance */
bool pal_grasp_compliance_series(const pal_grasp_compliance *w, double k_N_m, double K[6]);
/* rise of the force for each metre that the spring's end leads the tissue; k_guess_N_m until all of W_g is known */
double pal_grasp_compliance_along(const pal_grasp_compliance *w, double k_N_m, double k_guess_N_m,
                                  const double direction[3]);

/* bytes of scratch that these need in a sub-step */
size_t pal_haptic_stiffness_scratch(const pal_body *body);
#endif
