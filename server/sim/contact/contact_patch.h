/* Haptic contact patches of one tool on one body: a plane of zero force in the space of the tool's centre and the
 * tangent stiffness of the tissue under it, so that a haptic bridge renders contact at its own rate between frames.
 *
 * Each group of contacts (contact_group.h) is a patch. k1 = dF/dd is the stiffness that the solver's compliance gives
 * (haptic_stiffness.h), elsewhere the slope of (d, F) by least squares (stiffness_fit.h), started at the stiffness of a
 * flat punch, 2 E a / (1 - nu^2), later at what the last contact taught; it is clamped. k2 is 0. The zero-force point
 * is (F / k1) n above the tool's centre; the deformed surface is never sent, as it has no force at any depth. A patch
 * near the tool has F = 0, so that the first touch needs no round trip. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_CONTACT_PATCH_H
#define PAL_SIM_CONTACT_CONTACT_PATCH_H
#include "server/sim/contact/contact_group.h"
#include "server/sim/contact/stiffness_fit.h"

typedef struct pal_contact_patch_options {
    double radius_m;
    double k_start_N_m;
    double b_s;      /* damping over stiffness, s                */
    double friction; /* coefficient, static and dynamic alike    */
} pal_contact_patch_options;

typedef struct pal_contact_patch_track {
    bool used, contact;
    int16_t id;
    double normal[3], depth_m; /* as measured; depth below 0 is a gap */
    pal_stiffness_fit fit;     /* its start value is later what the last contact taught */
    pal_contact_patch shown;   /* after the low-pass                   */
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
void pal_contact_patches_update(pal_contact_patches *patches, const pal_contact_patch_options *options,
                                const pal_contact_group *group, int n, pal_tool *tool);
#endif
