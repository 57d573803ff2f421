#include "clients/link/lcm_convert.h"
#include "clients/link/lcm_link.h"

#include <string.h>

#define COPY(to, from)                                                                                                 \
    do {                                                                                                               \
        _Static_assert(sizeof(to) == sizeof(from), "arrays of one shape");                                             \
        memcpy(to, from, sizeof(to));                                                                                  \
    } while (0)

pal_err pal_lcm_to_pose(const void *bytes, size_t n_byte, pal_wire_pose *out)
{
    palpate_tool_state_t s;
    if (palpate_tool_state_t_decode(bytes, 0, (int)n_byte, &s) < 0) return PAL_ERR_REFUSED;
    pal_wire_pose p = {.tool = (uint16_t)s.tool,
                       .seq = (uint32_t)s.seq,
                       .flags = (uint32_t)s.flags & 255,
                       .stamp_us = (uint64_t)s.utime,
                       .grip = s.grip,
                       .buttons = (uint32_t)s.buttons & PAL_WIRE_GRASP,
                       .model_seq = (uint32_t)s.model_seq,
                       .model_age_us = (uint32_t)s.model_age_us,
                       .model_stamp_us = (uint64_t)s.model_utime};
    COPY(p.position_m, s.pos);
    COPY(p.quaternion, s.quat);
    COPY(p.velocity_m_s, s.vel);
    COPY(p.omega_rad_s, s.omega);
    COPY(p.force_N, s.force);
    COPY(p.torque_N_m, s.torque);
    uint8_t wire[PAL_WIRE_POSE_BYTES];
    if (s.version != PAL_LCM_VERSION || s.tool < 0 || s.tool >= PAL_WIRE_TOOL_MAX || s.utime < 0 || s.model_utime < 0)
        return PAL_ERR_REFUSED;
    /* the protocol's own decoder knows what a pose may be */
    if (!pal_wire_put_pose(wire, sizeof wire, &p) || pal_wire_get_pose(wire, sizeof wire, &p)) return PAL_ERR_REFUSED;
    *out = p;
    return PAL_ERR_OK;
}

void pal_lcm_from_pose(const pal_wire_pose *p, palpate_tool_state_t *out)
{
    *out = (palpate_tool_state_t){.utime = (int64_t)p->stamp_us,
                                  .seq = (int32_t)p->seq,
                                  .version = PAL_LCM_VERSION,
                                  .tool = (int16_t)p->tool,
                                  .grip = p->grip,
                                  .buttons = (int32_t)p->buttons,
                                  .flags = (int32_t)(p->flags & 255),
                                  .model_seq = (int32_t)p->model_seq,
                                  .model_utime = (int64_t)p->model_stamp_us,
                                  .model_age_us = (int32_t)p->model_age_us};
    COPY(out->pos, p->position_m);
    COPY(out->quat, p->quaternion);
    COPY(out->vel, p->velocity_m_s);
    COPY(out->omega, p->omega_rad_s);
    COPY(out->force, p->force_N);
    COPY(out->torque, p->torque_N_m);
}

static void convert_patch(const palpate_contact_patch_t *c, pal_wire_contact_patch *w)
{
    *w = (pal_wire_contact_patch){.id = (uint16_t)c->id,
                                  .group = (uint16_t)c->group,
                                  .k1_N_m = c->k1,
                                  .k2_N_m2 = c->k2,
                                  .b_N_s_m = c->b,
                                  .kt_N_m = c->kt,
                                  .mu_s = c->mu_s,
                                  .mu_d = c->mu_d,
                                  .radius_m = c->radius};
    COPY(w->p_m, c->p);
    COPY(w->n, c->n);
    COPY(w->v_m_s, c->v);
}

pal_err pal_lcm_to_haptic(const void *bytes, size_t n_byte, pal_wire_haptic *out)
{
    palpate_haptic_model_t m;
    memset(&m, 0, sizeof m);
    if (palpate_haptic_model_t_decode(bytes, 0, (int)n_byte, &m) < 0) return PAL_ERR_REFUSED;
    const bool good = m.version == PAL_LCM_VERSION && m.tool >= 0 && m.tool < PAL_WIRE_TOOL_MAX && m.npatch >= 0 &&
                      m.npatch <= PAL_WIRE_CONTACT_PATCH_MAX && (m.has_grasp == 0 || m.has_grasp == 1) &&
                      (m.flags & ~PAL_WIRE_HAPTIC_FLAGS) == 0;
    pal_wire_haptic h = {.tool = (uint16_t)m.tool,
                         .seq = (uint32_t)m.seq,
                         .flags = (uint32_t)m.flags,
                         .stamp_us = (uint64_t)m.utime,
                         .echo_stamp_us = (uint64_t)m.echo_utime,
                         .echo_seq = (uint32_t)m.echo_seq,
                         .hold_us = (uint32_t)m.hold_us,
                         .frame_us = (uint32_t)m.frame_us,
                         .n_patch = good ? (uint32_t)m.npatch : 0,
                         .has_grasp = (uint32_t)m.has_grasp,
                         .grasp_b_N_s_m = m.grasp_b};
    COPY(h.origin_m, m.origin);
    COPY(h.f_ref_N, m.f_ref);
    COPY(h.grasp_x0_m, m.grasp_x0);
    COPY(h.grasp_f0_N, m.grasp_f0);
    COPY(h.grasp_k_N_m, m.grasp_k);
    for (uint32_t i = 0; i < h.n_patch; i++) convert_patch(&m.patch[i], &h.patch[i]);
    palpate_haptic_model_t_decode_cleanup(&m);
    /* the protocol's own decoder has the last word on ranges */
    uint8_t wire[PAL_WIRE_HAPTIC_MAX];
    const size_t n_wire = good ? pal_wire_put_haptic(wire, sizeof wire, &h) : 0;
    if (n_wire == 0 || pal_wire_get_haptic(wire, n_wire, &h)) return PAL_ERR_REFUSED;
    *out = h;
    return PAL_ERR_OK;
}

void pal_lcm_from_haptic(const pal_wire_haptic *h, palpate_haptic_model_t *out, palpate_contact_patch_t *patch)
{
    const uint32_t n = h->n_patch < PAL_WIRE_CONTACT_PATCH_MAX ? h->n_patch : PAL_WIRE_CONTACT_PATCH_MAX;
    *out = (palpate_haptic_model_t){.utime = (int64_t)h->stamp_us,
                                    .seq = (int32_t)h->seq,
                                    .version = PAL_LCM_VERSION,
                                    .tool = (int16_t)h->tool,
                                    .echo_utime = (int64_t)h->echo_stamp_us,
                                    .echo_seq = (int32_t)h->echo_seq,
                                    .hold_us = (int32_t)h->hold_us,
                                    .frame_us = (int32_t)h->frame_us,
                                    .flags = (int32_t)h->flags,
                                    .has_grasp = (int8_t)h->has_grasp,
                                    .grasp_b = h->grasp_b_N_s_m,
                                    .npatch = (int8_t)n,
                                    .patch = patch};
    COPY(out->origin, h->origin_m);
    COPY(out->f_ref, h->f_ref_N);
    COPY(out->grasp_x0, h->grasp_x0_m);
    COPY(out->grasp_f0, h->grasp_f0_N);
    COPY(out->grasp_k, h->grasp_k_N_m);
    for (uint32_t i = 0; i < n; i++) {
        const pal_wire_contact_patch *w = &h->patch[i];
        patch[i] = (palpate_contact_patch_t){.id = (int16_t)w->id,
                                             .group = (int16_t)w->group,
                                             .k1 = w->k1_N_m,
                                             .k2 = w->k2_N_m2,
                                             .b = w->b_N_s_m,
                                             .kt = w->kt_N_m,
                                             .mu_s = w->mu_s,
                                             .mu_d = w->mu_d,
                                             .radius = w->radius_m};
        COPY(patch[i].p, w->p_m);
        COPY(patch[i].n, w->n);
        COPY(patch[i].v, w->v_m_s);
    }
}
