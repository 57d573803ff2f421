/* The local contact model a bridge renders between two messages of the server: tangent plane patches of the zero-force
 * surface, in the tool centre's configuration space (clients/haptic_bridge/README.md, "One tick").
 *
 * Per convex group: d_i = n_i . (p_i + v_i min(age, 50 ms) - x); contact when all d_i > 0; the patch with the least d
 * acts (0.1 mm hysteresis):
 *   F = max(0, k1 d + k2 d^2 - b' n . (v - v_i)) n (1 - smoothstep(r, 1.5 r, tangential distance)),
 *   b' = max(b, min(b_max, floor k)).
 * Where the tangent k1 + 2 k2 d would pass the device's clamp, F goes on with the clamp's slope.
 * Not here: friction, the bilateral grip and the energy gate; they belong to the energy tank.
 * Thread: [servo]; no heap, no locks. */
#ifndef PAL_HAPTIC_BRIDGE_LOCAL_CONTACT_H
#define PAL_HAPTIC_BRIDGE_LOCAL_CONTACT_H
#include "protocol/wire.h"

#include <stdbool.h>

typedef struct pal_local_contact_limits {
    double stiffness_max_N_m; /* of the device, seen from the world                     */
    double damping_max_Ns_m;
    double damping_floor_s; /* b >= floor k: 2.5e-3, 5e-3 when the hand looks off      */
} pal_local_contact_limits;

/* which patch of each group acted last tick; all zero at first */
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
    bool clamped;      /* a stiffness was cut to the device's                          */
    bool finite;
} pal_local_contact_result;

void pal_local_contact_force(const pal_wire_haptic *model, double age_s, const double x_m[3], const double v_m_s[3],
                             const pal_local_contact_limits *limits, pal_local_contact_state *memory,
                             pal_local_contact_result *out);
#endif
