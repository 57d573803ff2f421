/* Each struct has one list of its members, X(of the wire, of LCM) for numbers and Y for arrays, which both directions
 * expand. */
#include "clients/link/lcm_convert.h"
#include "clients/link/lcm_link.h"

#include <string.h>

#define POSE_MEMBERS(X, Y)                                                                                             \
    X(tool, tool)                                                                                                      \
    X(seq, seq)                                                                                                        \
    X(flags, flags)                                                                                                    \
    X(stamp_us, utime)                                                                                                 \
    X(grip, grip)                                                                                                      \
    X(buttons, buttons)                                                                                                \
    X(model_seq, model_seq)                                                                                            \
    X(model_age_us, model_age_us)                                                                                      \
    X(model_stamp_us, model_utime)                                                                                     \
    Y(position_m, pos)                                                                                                 \
    Y(quaternion, quat)                                                                                                \
    Y(velocity_m_s, vel)                                                                                               \
    Y(omega_rad_s, omega)                                                                                              \
    Y(force_N, force)                                                                                                  \
    Y(torque_N_m, torque)
#define PATCH_MEMBERS(X, Y)                                                                                            \
    X(id, id)                                                                                                          \
    X(group, group)                                                                                                    \
    X(k1_N_m, k1)                                                                                                      \
    X(k2_N_m2, k2)                                                                                                     \
    X(b_N_s_m, b)                                                                                                      \
    X(kt_N_m, kt)                                                                                                      \
    X(mu_s, mu_s)                                                                                                      \
    X(mu_d, mu_d)                                                                                                      \
    X(radius_m, radius)                                                                                                \
    Y(p_m, p)                                                                                                          \
    Y(n, n)                                                                                                            \
    Y(v_m_s, v)
#define MODEL_MEMBERS(X, Y)                                                                                            \
    X(tool, tool)                                                                                                      \
    X(seq, seq)                                                                                                        \
    X(flags, flags)                                                                                                    \
    X(stamp_us, utime)                                                                                                 \
    X(echo_stamp_us, echo_utime)                                                                                       \
    X(echo_seq, echo_seq)                                                                                              \
    X(hold_us, hold_us)                                                                                                \
    X(frame_us, frame_us)                                                                                              \
    X(n_patch, n_patch)                                                                                                \
    X(has_grasp, has_grasp)                                                                                            \
    X(grasp_b_N_s_m, grasp_b)                                                                                          \
    Y(origin_m, origin)                                                                                                \
    Y(torque_ref_Nm, torque_ref)                                                                                       \
    Y(grasp_arm_m, grasp_arm)                                                                                          \
    Y(f_ref_N, f_ref)                                                                                                  \
    Y(grasp_x0_m, grasp_x0)                                                                                            \
    Y(grasp_f0_N, grasp_f0)                                                                                            \
    Y(grasp_k_N_m, grasp_k)

/* between `wire` and `lcm`, pointers to the two structs */
#define TO_WIRE(w, l)       wire->w = (__typeof__(wire->w))lcm->l;
#define TO_LCM(w, l)        lcm->l = (__typeof__(lcm->l))wire->w;
#define SAME_SHAPE(w, l)    _Static_assert(sizeof wire->w == sizeof lcm->l, "arrays of one shape");
#define ARRAY_TO_WIRE(w, l) SAME_SHAPE(w, l) memcpy(wire->w, lcm->l, sizeof wire->w);
#define ARRAY_TO_LCM(w, l)  SAME_SHAPE(w, l) memcpy(lcm->l, wire->w, sizeof wire->w);

enum { LCM_FLAGS = 255 }; /* of a pose; AWAY is of the websocket alone */

pal_err pal_lcm_to_pose(const void *bytes, size_t n_byte, pal_wire_pose *out)
{
    palpate_tool_state_t state, *lcm = &state;
    pal_wire_pose pose = {0}, *wire = &pose;
    uint8_t encoded[PAL_WIRE_POSE_BYTES];
    if (palpate_tool_state_t_decode(bytes, 0, (int)n_byte, lcm) < 0) return PAL_ERR_REFUSED;
    if (lcm->version != PAL_LCM_VERSION || lcm->tool < 0 || lcm->tool >= PAL_WIRE_TOOL_MAX || lcm->utime < 0 ||
        lcm->model_utime < 0)
        return PAL_ERR_REFUSED;
    POSE_MEMBERS(TO_WIRE, ARRAY_TO_WIRE)
    pose.flags &= LCM_FLAGS, pose.buttons &= PAL_WIRE_GRASP;
    /* the decoder of the protocol checks the ranges */
    if (!pal_wire_put_pose(encoded, sizeof encoded, wire)) return PAL_ERR_REFUSED;
    return pal_wire_get_pose(encoded, sizeof encoded, out) ? PAL_ERR_REFUSED : PAL_ERR_OK;
}

void pal_lcm_from_pose(const pal_wire_pose *wire, palpate_tool_state_t *lcm)
{
    *lcm = (palpate_tool_state_t){.version = PAL_LCM_VERSION};
    POSE_MEMBERS(TO_LCM, ARRAY_TO_LCM)
    lcm->flags &= LCM_FLAGS;
}

static void patch_to_wire(const palpate_contact_patch_t *lcm, pal_wire_contact_patch *wire)
{
    PATCH_MEMBERS(TO_WIRE, ARRAY_TO_WIRE)
}

static void patch_to_lcm(const pal_wire_contact_patch *wire,
                         palpate_contact_patch_t *lcm){PATCH_MEMBERS(TO_LCM, ARRAY_TO_LCM)}

pal_err pal_lcm_to_haptic(const void *bytes, size_t n_byte, pal_wire_haptic *out)
{
    palpate_haptic_model_t model = {0}, *lcm = &model;
    pal_wire_haptic haptic = {0}, *wire = &haptic;
    uint8_t encoded[PAL_WIRE_HAPTIC_MAX];
    if (palpate_haptic_model_t_decode(bytes, 0, (int)n_byte, lcm) < 0) return PAL_ERR_REFUSED;
    const bool good = lcm->version == PAL_LCM_VERSION && lcm->tool >= 0 && lcm->tool < PAL_WIRE_TOOL_MAX &&
                      lcm->n_patch >= 0 && lcm->n_patch <= PAL_WIRE_CONTACT_PATCH_MAX &&
                      (lcm->has_grasp == 0 || lcm->has_grasp == 1) && (lcm->flags & ~PAL_WIRE_HAPTIC_FLAGS) == 0;
    if (good) {
        MODEL_MEMBERS(TO_WIRE, ARRAY_TO_WIRE)
        for (uint32_t i = 0; i < haptic.n_patch; i++) patch_to_wire(&lcm->patch[i], &haptic.patch[i]);
    }
    palpate_haptic_model_t_decode_cleanup(lcm);
    const size_t n_encoded = good ? pal_wire_put_haptic(encoded, sizeof encoded, wire) : 0;
    if (n_encoded == 0) return PAL_ERR_REFUSED;
    return pal_wire_get_haptic(encoded, n_encoded, out) ? PAL_ERR_REFUSED : PAL_ERR_OK;
}

void pal_lcm_from_haptic(const pal_wire_haptic *wire, palpate_haptic_model_t *lcm, palpate_contact_patch_t *patch)
{
    *lcm = (palpate_haptic_model_t){.version = PAL_LCM_VERSION, .patch = patch};
    MODEL_MEMBERS(TO_LCM, ARRAY_TO_LCM)
    if (wire->n_patch > PAL_WIRE_CONTACT_PATCH_MAX) lcm->n_patch = PAL_WIRE_CONTACT_PATCH_MAX;
    for (int i = 0; i < lcm->n_patch; i++) patch_to_lcm(&wire->patch[i], &patch[i]);
}
