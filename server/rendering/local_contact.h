/* Force and stored energy of a local contact model at a pose (clients/haptic_bridge/README.md, "One tick").
 *
 * Per convex group, in the configuration space of the tool's centre: d_i = n_i . (p_i - x). The tool is in contact when
 * all d_i > 0. The patch with the smallest d acts, with 0.1 mm hysteresis:
 *   normal    N = min(k1 d + k2 d^2, force_max), F_n = max(0, N - b' n . (v - v_i)) n,  b' = max(b, min(b_max, floor
 * k)) friction  F_t = -kt e - b_t v_t, e the tangential part of x - anchor. Beyond mu_s N the anchor slides, so that kt
 * |e| = mu_d N and F_t has no damping; it sticks again below 1 mm/s. The anchor moves with the surface. both      times
 * 1 - smoothstep(r, 1.5 r, tangential distance from p_i) Where the tangent k1 + 2 k2 d passes the device's limit, N
 * continues with the limit as its slope; N never falls with depth. A grasp gives f0 - K (x - x0) - b v in all
 * directions, its elastic part at most force_max. torque    sum of -r n x (F_n + F_t), the tool a sphere of the
 * patch's radius r, and of a grasp its arm x its force energy    integrals of the elastic parts: of N over d, kt |e|^2
 * / 2, and f K^-1 f / 2 of the grasp's f Thread: [servo]; no heap, no locks. */
#ifndef PAL_RENDERING_LOCAL_CONTACT_H
#define PAL_RENDERING_LOCAL_CONTACT_H
#include "server/rendering/local_model.h"

/* what contact remembers of each group: initially zero */
typedef struct pal_local_contact_state {
    int n_group;
    struct {
        uint32_t key; /* pal_local_patch.key */
        uint16_t group, id;
        bool slides;
        double anchor_m[3];
        double arm_m[3]; /* from the tool's centre to the contact */
    } group[PAL_LOCAL_PATCH_MAX];
} pal_local_contact_state;

typedef struct pal_local_contact_result {
    double force_N[3], torque_N_m[3];       /* on the hand, world; torque about the tool's centre */
    int n_contact;                          /* groups in contact */
    double proxy_m[PAL_LOCAL_PATCH_MAX][3]; /* tool's centre on the surface of each, for display */
    double depth_m;                         /* largest d of an acting patch */
    bool clamped;                           /* a stiffness was reduced to the device limit */
    bool saturated;                         /* a force ended at force_max */
} pal_local_contact_result;

/* the stored energy in J, >= 0. It reads the memory and changes nothing */
double pal_local_contact_energy(const pal_local_model *model, const double x_m[3], const pal_local_limits *limits,
                                const pal_local_contact_state *memory);
/* The force. Moves the memory on by dt_s: acting patches, anchors that slide and move with the surface; with memory
 * NULL there is no friction. force and torque may not be finite where a number of the model is very large */
void pal_local_contact_force(const pal_local_model *model, const double x_m[3], const double v_m_s[3], double dt_s,
                             const pal_local_limits *limits, pal_local_contact_state *memory,
                             pal_local_contact_result *out);
/* a turn of the handle by a small rotation (axis times angle, world) moves the contacts of a sphere over the surface */
void pal_local_contact_turn(pal_local_contact_state *memory, const double turn_rad[3]);
#endif
