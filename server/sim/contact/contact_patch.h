/* Haptic contact patches of one tool on one body, so that a haptic bridge renders contact at its own rate between
 * frames: for each group of contacts (contact_group.h) a plane of zero force in the space of the tool's centre, at
 * (F / k1) n from it, and the tangent stiffness k1 = dF/dd of the tissue under it (haptic_stiffness.h). k2 is 0. The
 * deformed surface is not sent, as it has no force at any depth. A patch near the tool has F = 0, so that the first
 * touch needs no round trip. Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_CONTACT_PATCH_H
#define PAL_SIM_CONTACT_CONTACT_PATCH_H
#include "server/sim/contact/haptic_stiffness.h"

typedef struct pal_contact_patch_options {
    double step_s; /* since the last update */
    double radius_m;
    double k_start_N_m; /* k1 before the first contact: that of a flat punch, 2 E a / (1 - nu^2)       */
    double b_s;         /* damping over stiffness, s                                                    */
    double friction;    /* coefficient, static and dynamic alike                                        */
    double sideways;    /* tangential over normal stiffness until it is known: of a flat punch, 2 (1 - nu) / (2 - nu) */
} pal_contact_patch_options;

typedef struct pal_contact_patch_track {
    bool used, contact;
    int16_t id;
    double normal[3], depth_m; /* as measured; depth below 0 is a gap */
    pal_stiffness_fit fit;     /* its start value is later what the last contact taught */
    double k_N_m;              /* as published: follows the estimate as tool and time go on; 0: not yet */
} pal_contact_patch_track;

typedef struct pal_contact_patches {
    pal_contact_patch_track track[PAL_CONTACT_PATCH_MAX];
    int16_t next_id, id_base;
    bool known; /* last_m holds the tool's position of the step before */
    double last_m[3];
} pal_contact_patches;

/* empty; new ids are above id_base, so that several bodies give different ids */
void pal_contact_patches_reset(pal_contact_patches *patches, int id_base);
/* once a step: matches groups [n] with the patches of the step before and appends the result to tool->patch */
void pal_contact_patches_update(pal_contact_patches *patches, const pal_contact_patch_options *options,
                                const pal_contact_group *group, int n, pal_tool *tool);
#endif
