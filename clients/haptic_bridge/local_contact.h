/* Local contact model that the bridge renders between two messages of the server: tangent-plane patches of the
 * zero-force surface, in the configuration space of the tool centre (clients/haptic_bridge/README.md, "One tick").
 *
 * Per convex group: d_i = n_i . (p_i + v_i min(age, 50 ms) - x). The tool is in contact when all d_i > 0. The patch
 * with the smallest d acts, with 0.1 mm hysteresis:
 *   F = max(0, k1 d + k2 d^2 - b' n . (v - v_i)) n (1 - smoothstep(r, 1.5 r, tangential distance)),
 *   b' = max(b, min(b_max, floor k)).
 * Where the tangent stiffness k1 + 2 k2 d would exceed the device's limit, F continues with the limit as its slope.
 * Friction, the bilateral grasp force and the energy gate are not part of this model; the energy tank provides them.
 * Thread: [servo]; no heap, no locks. */
#ifndef PAL_HAPTIC_BRIDGE_LOCAL_CONTACT_H
#define PAL_HAPTIC_BRIDGE_LOCAL_CONTACT_H
#include "protocol/wire.h"

#include <stdbool.h>

typedef struct pal_local_contact_limits {
    double stiffness_max_N_m; /* device limit, in the world frame */
    double damping_max_Ns_m;
    double damping_floor_s; /* b >= floor k: 2.5e-3, or 5e-3 when the hand appears off the handle */
} pal_local_contact_limits;

/* acting patch of each group in the last tick; initially zero */
typedef struct pal_local_contact_state {
    int n_active;
    struct {
        uint16_t group, id;
    } active[PAL_WIRE_CONTACT_PATCH_MAX];
} pal_local_contact_state;

typedef struct pal_local_contact_result {
    double force_N[3]; /* on the hand, world frame; zero when a number was not finite */
    int n_contact;     /* groups in contact                                            */
    double depth_m;    /* largest d of an acting patch                                 */
    bool clamped;      /* a stiffness was reduced to the device limit */
    bool finite;
} pal_local_contact_result;

void pal_local_contact_force(const pal_wire_haptic *model, double age_s, const double x_m[3], const double v_m_s[3],
                             const pal_local_contact_limits *limits, pal_local_contact_state *memory,
                             pal_local_contact_result *out);
#endif
