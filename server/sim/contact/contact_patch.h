/* Haptic contact patches of one tool on one body (haptics.md 2.3, steps 1 to 5): a plane of zero force in the space of
 * the tool's centre and the tangent stiffness of the tissue under it, so that a haptic bridge can render contact at its
 * own rate between frames.
 *
 * Contacts are grouped by direction into blobs. Departure from 2.3: blobs span 75 degrees about their mean direction,
 * not 20: one sphere in one dent touches tissue over its whole cap, and that is one patch; two walls of a fold are two
 * patches in two groups, whose forces add. k1 = dF/dd comes from least squares with forgetting on (d, F), taken only
 * when d has moved by 0.05 mm, started at the stiffness of a flat punch, 2 E a / (1 - nu^2), and clamped. Forgetting is
 * 0.8, not 0.9, which would lag a millimetre behind where tissue stiffens. Where the solver knows the static compliance
 * (2.3 step 3 a) its answer is k1, and the start value when the next touch begins. k2 is 0.
 * Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_CONTACT_PATCH_H
#define PAL_SIM_CONTACT_CONTACT_PATCH_H
#include "server/sim/contact/stiffness_fit.h"
#include "server/sim/core/tools.h"

/* one direction of contact or near contact */
typedef struct pal_contact_group {
    double normal[3]; /* from tissue to tool, unit                        */
    double force_N;   /* normal force, 0 when only near                   */
    double gap_m;     /* way the tool has to go until it touches, >= 0; 0 in contact */
    double k_N_m;     /* tangent stiffness as the solver's compliance tells it; 0: not known */
} pal_contact_group;

typedef struct pal_contact_patch_options {
    double radius_m;
    double k_start_N_m, k_min_N_m, k_max_N_m;
    double b_s;      /* damping over stiffness, s                */
    double friction; /* coefficient, static and dynamic alike    */
} pal_contact_patch_options;

typedef struct pal_contact_patch_track {
    bool used, contact;
    int16_t id;
    double normal[3], depth_m; /* as measured; depth below 0 is a gap */
    double k_prior_N_m;        /* start value, later what the last contact taught */
    pal_stiffness_fit slope;
    pal_contact_patch shown; /* after the low-pass                   */
} pal_contact_patch_track;

typedef struct pal_contact_patches {
    pal_contact_patch_track track[PAL_CONTACT_PATCH_MAX];
    int16_t next_id, id_base;
    bool known; /* last_m holds the tool's place of the step before */
    double last_m[3];
} pal_contact_patches;

/* forgets everything; ids go on from id_base, so that several bodies give different ids */
void pal_contact_patches_reset(pal_contact_patches *patches, int id_base);
/* once a step: matches blobs [n] (at most PAL_CONTACT_PATCH_MAX) with the patches of the step before and appends the
 * result to tool->patch. The tool's place is tool->here_m. */
void pal_contact_patches_update(pal_contact_patches *patches, const pal_contact_patch_options *rules,
                                const pal_contact_group *contact_group, int n, pal_tool *tool);
#endif
