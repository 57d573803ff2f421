/* The contact model that a bridge renders: patches of the server's zero-force surface and the two-sided spring of a
 * grasp, in world coordinates, as a blend of the model before and the newest one.
 *
 * A share lambda in [0, 1] of the newest model is in use; planes, stiffnesses and spring are interpolated in it. A
 * patch is the same one in both when id and group agree and its convex group has the same patches; any other patch
 * comes in from stiffness 0 or goes out to it, and a group whose patches changed is replaced as a whole. A grasp is
 * interpolated in f = f0 - K (x - x0), and comes and goes likewise. Its K is symmetrised and its eigenvalues are
 * clamped to [0, limit]; along an axis without stiffness its force has no bounded energy and is left out. Thread:
 * [servo]; no heap, no locks. */
#ifndef PAL_RENDERING_LOCAL_MODEL_H
#define PAL_RENDERING_LOCAL_MODEL_H
#include "protocol/wire.h"

#include <stdbool.h>

/* patches of one model, of the one before, and of older ones that are still going out */
enum { PAL_LOCAL_PATCH_MAX = 3 * PAL_WIRE_CONTACT_PATCH_MAX };

typedef struct pal_local_patch {
    uint32_t key; /* of the convex group in use: patches of one key act together */
    uint16_t id, group;
    double p_m[3], n[3], v_m_s[3];
    double k1_N_m, k2_N_m2, b_Ns_m, kt_N_m, mu_s, mu_d, radius_m;
} pal_local_patch;

typedef struct pal_local_grasp {
    double f_N[3], at_m[3]; /* force on the tool at at_m */
    double K_N_m[6];        /* xx xy xz yy yz zz, positive semi-definite */
    double b_Ns_m;
    double arm_m[3]; /* from the tool's centre to where the force acts */
} pal_local_grasp;

typedef struct pal_local_model {
    int n_patch;
    pal_local_patch patch[PAL_LOCAL_PATCH_MAX];
    pal_local_grasp grasp; /* all zero: none */
} pal_local_model;

/* limits of the device, in the world's units */
typedef struct pal_local_limits {
    double stiffness_max_N_m;
    double damping_max_Ns_m;
    double damping_floor_s; /* b >= floor k */
    double force_max_N;     /* the force of one contact, or of the grasp, ends here */
} pal_local_limits;

/* initially zero: nothing to render */
typedef struct pal_local_blend {
    pal_local_model from, to; /* patch i of both is the same one */
    uint32_t next_key;
} pal_local_blend;

/* the model at share lambda, surfaces moved on by age_s */
void pal_local_blend_mix(const pal_local_blend *blend, double lambda, double age_s, pal_local_model *out);
/* starts a blend from the model in use (lambda, age_s) to a new one; false: a number in it is not finite, and nothing
 * has changed */
bool pal_local_blend_start(pal_local_blend *blend, double lambda, double age_s, const pal_wire_haptic *model,
                           const pal_local_limits *limits);
#endif
