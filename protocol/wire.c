/* The binary messages of palpate.v2 (README.md), written and read field by field so that any host agrees.
 *
 * A cursor walks each message; the lengths are checked once, before the walk, because every kind's length follows from
 * its kind and one count. */
#include "protocol/wire.h"

#include "protocol/bytes.h"

#include <math.h>
#include <stdbool.h>

#define STAMP_MAX   ((uint64_t)1 << 53) /* JavaScript reads stamps as doubles */
#define WORLD_MAX_M 1000.0

static void put_head(uint8_t **at, uint8_t kind, uint16_t index)
{
    pal_put_u32(*at, PAL_WIRE_MAGIC);
    (*at)[4] = kind;
    (*at)[5] = 0;
    pal_put_u16(*at + 6, index);
    *at += PAL_WIRE_HEAD_BYTES;
}

static void put16(uint8_t **at, uint16_t v)
{
    pal_put_u16(*at, v);
    *at += 2;
}

static void put32(uint8_t **at, uint32_t v)
{
    pal_put_u32(*at, v);
    *at += 4;
}

static void put64(uint8_t **at, uint64_t v)
{
    pal_put_u64(*at, v);
    *at += 8;
}

static void put_floats(uint8_t **at, const float *v, int n)
{
    for (int i = 0; i < n; i++, *at += 4) pal_put_f32(*at, v[i]);
}

static void put_doubles(uint8_t **at, const double *v, int n)
{
    for (int i = 0; i < n; i++, *at += 8) pal_put_f64(*at, v[i]);
}

static uint16_t take16(const uint8_t **at)
{
    *at += 2;
    return pal_get_u16(*at - 2);
}

static uint32_t take32(const uint8_t **at)
{
    *at += 4;
    return pal_get_u32(*at - 4);
}

static uint64_t take64(const uint8_t **at)
{
    *at += 8;
    return pal_get_u64(*at - 8);
}

/* false when one is not finite */
static bool take_floats(const uint8_t **at, float *v, int n)
{
    bool finite = true;
    for (int i = 0; i < n; i++, *at += 4) {
        v[i] = pal_get_f32(*at);
        finite &= isfinite(v[i]) != 0;
    }
    return finite;
}

static bool take_doubles(const uint8_t **at, double *v, int n)
{
    bool finite = true;
    for (int i = 0; i < n; i++, *at += 8) {
        v[i] = pal_get_f64(*at);
        finite &= isfinite(v[i]) != 0;
    }
    return finite;
}

static bool known_kind(uint8_t kind)
{
    return kind == PAL_WIRE_FRAME || kind == PAL_WIRE_TOOLS || kind == PAL_WIRE_HAPTIC || kind == PAL_WIRE_FIELD ||
           kind == PAL_WIRE_TOPOLOGY_DELTA || kind == PAL_WIRE_POSE || kind == PAL_WIRE_ACK;
}

int pal_wire_get_head(const uint8_t *bytes, size_t n_byte, pal_wire_head *out)
{
    if (n_byte < PAL_WIRE_HEAD_BYTES) return PAL_REFUSAL_SHORT;
    if (pal_get_u32(bytes) != PAL_WIRE_MAGIC) return PAL_REFUSAL_MAGIC;
    if (!known_kind(bytes[4])) return PAL_REFUSAL_KIND;
    *out = (pal_wire_head){bytes[4], bytes[5], pal_get_u16(bytes + 6)};
    return 0;
}

/* head of a message of this kind that has no flags */
static int take_head(const uint8_t **at, size_t n_byte, uint8_t kind, uint16_t *index)
{
    pal_wire_head head;
    int refusal = pal_wire_get_head(*at, n_byte, &head);
    if (refusal) return refusal;
    if (head.kind != kind) return PAL_REFUSAL_KIND;
    if (head.flags) return PAL_REFUSAL_FLAGS;
    *index = head.index;
    *at += PAL_WIRE_HEAD_BYTES;
    return 0;
}

static int exact(size_t n_byte, size_t wanted)
{
    return n_byte < wanted ? PAL_REFUSAL_SHORT : n_byte > wanted ? PAL_REFUSAL_LONG : PAL_REFUSAL_NONE;
}

size_t pal_wire_put_pose(uint8_t *dst, size_t cap, const pal_wire_pose *p)
{
    if (cap < PAL_WIRE_POSE_BYTES) return 0;
    put_head(&dst, PAL_WIRE_POSE, p->tool);
    put32(&dst, p->seq);
    put32(&dst, p->flags);
    put64(&dst, p->stamp_us);
    put_doubles(&dst, p->position_m, 3);
    put_doubles(&dst, p->quaternion, 4);
    put_floats(&dst, p->velocity_m_s, 3);
    put_floats(&dst, p->omega_rad_s, 3);
    put_floats(&dst, p->force_N, 3);
    put_floats(&dst, p->torque_N_m, 3);
    put_floats(&dst, &p->grip, 1);
    put32(&dst, p->buttons);
    put32(&dst, p->model_seq);
    put32(&dst, p->model_age_us);
    put64(&dst, p->model_stamp_us);
    return PAL_WIRE_POSE_BYTES;
}

int pal_wire_get_pose(const uint8_t *bytes, size_t n_byte, pal_wire_pose *out)
{
    pal_wire_pose p;
    bool finite = true;
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_POSE, &p.tool);
    if (!refusal) refusal = exact(n_byte, PAL_WIRE_POSE_BYTES);
    if (refusal) return refusal;
    p.seq = take32(&bytes);
    p.flags = take32(&bytes);
    p.stamp_us = take64(&bytes);
    finite &= take_doubles(&bytes, p.position_m, 3);
    finite &= take_doubles(&bytes, p.quaternion, 4);
    finite &= take_floats(&bytes, p.velocity_m_s, 3);
    finite &= take_floats(&bytes, p.omega_rad_s, 3);
    finite &= take_floats(&bytes, p.force_N, 3);
    finite &= take_floats(&bytes, p.torque_N_m, 3);
    finite &= take_floats(&bytes, &p.grip, 1);
    p.buttons = take32(&bytes);
    p.model_seq = take32(&bytes);
    p.model_age_us = take32(&bytes);
    p.model_stamp_us = take64(&bytes);

    if (!finite) return PAL_REFUSAL_NAN;
    if (p.flags & ~(uint32_t)PAL_WIRE_POSE_FLAGS || p.buttons & ~(uint32_t)PAL_WIRE_GRASP) return PAL_REFUSAL_FLAGS;
    double norm2 = 0;
    for (int i = 0; i < 4; i++) norm2 += p.quaternion[i] * p.quaternion[i];
    for (int i = 0; i < 3; i++)
        if (fabs(p.position_m[i]) > WORLD_MAX_M) return PAL_REFUSAL_RANGE;
    if (fabs(norm2 - 1) > 1e-3 || p.tool >= PAL_WIRE_TOOL_MAX) return PAL_REFUSAL_RANGE;
    if (p.stamp_us >= STAMP_MAX || p.model_stamp_us >= STAMP_MAX) return PAL_REFUSAL_RANGE;
    *out = p;
    return 0;
}

size_t pal_wire_put_ack(uint8_t *dst, size_t cap, const pal_wire_ack *a)
{
    if (cap < PAL_WIRE_ACK_BYTES) return 0;
    put_head(&dst, PAL_WIRE_ACK, 0);
    put32(&dst, a->cycle);
    put32(&dst, a->decode_us);
    return PAL_WIRE_ACK_BYTES;
}

int pal_wire_get_ack(const uint8_t *bytes, size_t n_byte, pal_wire_ack *out)
{
    uint16_t index;
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_ACK, &index);
    if (!refusal) refusal = exact(n_byte, PAL_WIRE_ACK_BYTES);
    if (!refusal && index) refusal = PAL_REFUSAL_RANGE;
    if (refusal) return refusal;
    out->cycle = take32(&bytes);
    out->decode_us = take32(&bytes);
    return 0;
}

size_t pal_wire_put_tools(uint8_t *dst, size_t cap, const pal_wire_tools *t)
{
    if (t->n_tool > PAL_WIRE_TOOL_MAX || cap < PAL_WIRE_TOOLS_BYTES(t->n_tool)) return 0;
    put_head(&dst, PAL_WIRE_TOOLS, (uint16_t)t->n_tool);
    put32(&dst, t->cycle);
    put32(&dst, 0);
    put64(&dst, t->sim_time_us);
    for (uint32_t i = 0; i < t->n_tool; i++) {
        const pal_wire_tool *tool = &t->tool[i];
        put16(&dst, tool->holder);
        put16(&dst, tool->flags);
        put32(&dst, tool->colour);
        put_floats(&dst, &tool->radius_m, 1);
        put_floats(&dst, tool->position_m, 3);
        put_floats(&dst, tool->quaternion, 4);
        put_floats(&dst, tool->force_N, 3);
        put32(&dst, tool->echo_seq);
        put32(&dst, tool->hold_us);
        put64(&dst, tool->echo_stamp_us);
    }
    return PAL_WIRE_TOOLS_BYTES(t->n_tool);
}

static int take_tool(const uint8_t **at, pal_wire_tool *tool)
{
    bool finite = true;
    tool->holder = take16(at);
    tool->flags = take16(at);
    tool->colour = take32(at);
    finite &= take_floats(at, &tool->radius_m, 1);
    finite &= take_floats(at, tool->position_m, 3);
    finite &= take_floats(at, tool->quaternion, 4);
    finite &= take_floats(at, tool->force_N, 3);
    tool->echo_seq = take32(at);
    tool->hold_us = take32(at);
    tool->echo_stamp_us = take64(at);
    if (!finite) return PAL_REFUSAL_NAN;
    if (tool->flags & ~PAL_WIRE_TOOL_FLAGS) return PAL_REFUSAL_FLAGS;
    if (tool->radius_m < 0 || tool->colour > 0xFFFFFF || tool->echo_stamp_us >= STAMP_MAX) return PAL_REFUSAL_RANGE;
    return 0;
}

int pal_wire_get_tools(const uint8_t *bytes, size_t n_byte, pal_wire_tools *out)
{
    pal_wire_tools t = {0};
    uint16_t n_tool;
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_TOOLS, &n_tool);
    if (refusal) return refusal;
    if (n_tool > PAL_WIRE_TOOL_MAX) return PAL_REFUSAL_COUNT;
    t.n_tool = n_tool;
    refusal = exact(n_byte, PAL_WIRE_TOOLS_BYTES(t.n_tool));
    if (refusal) return refusal;
    t.cycle = take32(&bytes);
    uint32_t zero = take32(&bytes);
    t.sim_time_us = take64(&bytes);
    if (zero || t.sim_time_us >= STAMP_MAX) return PAL_REFUSAL_RANGE;
    for (uint32_t i = 0; i < t.n_tool && !refusal; i++) refusal = take_tool(&bytes, &t.tool[i]);
    if (!refusal) *out = t;
    return refusal;
}

size_t pal_wire_put_haptic(uint8_t *dst, size_t cap, const pal_wire_haptic *h)
{
    if (h->n_patch > PAL_WIRE_CONTACT_PATCH_MAX || cap < PAL_WIRE_HAPTIC_BYTES(h->n_patch)) return 0;
    put_head(&dst, PAL_WIRE_HAPTIC, h->tool);
    put32(&dst, h->seq);
    put32(&dst, h->flags);
    put64(&dst, h->stamp_us);
    put64(&dst, h->echo_stamp_us);
    put32(&dst, h->echo_seq);
    put32(&dst, h->hold_us);
    put32(&dst, h->frame_us);
    put32(&dst, h->n_patch);
    put_doubles(&dst, h->origin_m, 3);
    put_floats(&dst, h->f_ref_N, 3);
    put32(&dst, h->has_grasp);
    put_floats(&dst, h->grasp_x0_m, 3);
    put_floats(&dst, h->grasp_f0_N, 3);
    put_floats(&dst, h->grasp_k_N_m, 6);
    put_floats(&dst, &h->grasp_b_N_s_m, 1);
    for (uint32_t i = 0; i < h->n_patch; i++) {
        const pal_wire_contact_patch *p = &h->patch[i];
        put16(&dst, p->id);
        put16(&dst, p->group);
        put_floats(&dst, p->p_m, 3);
        put_floats(&dst, p->n, 3);
        put_floats(&dst, p->v_m_s, 3);
        put_floats(&dst, (const float[]){p->k1_N_m, p->k2_N_m2, p->b_N_s_m, p->kt_N_m, p->mu_s, p->mu_d, p->radius_m},
                   7);
    }
    return PAL_WIRE_HAPTIC_BYTES(h->n_patch);
}

static bool take_patch(const uint8_t **at, pal_wire_contact_patch *p)
{
    float scalar[7];
    bool finite = true;
    p->id = take16(at);
    p->group = take16(at);
    finite &= take_floats(at, p->p_m, 3);
    finite &= take_floats(at, p->n, 3);
    finite &= take_floats(at, p->v_m_s, 3);
    finite &= take_floats(at, scalar, 7);
    p->k1_N_m = scalar[0];
    p->k2_N_m2 = scalar[1];
    p->b_N_s_m = scalar[2];
    p->kt_N_m = scalar[3];
    p->mu_s = scalar[4];
    p->mu_d = scalar[5];
    p->radius_m = scalar[6];
    return finite;
}

/* a unit normal and no negative constant but the slope: what a bridge renders unseen must at least be passive */
static bool good_patch(const pal_wire_contact_patch *p)
{
    double norm2 = 0;
    for (int i = 0; i < 3; i++) norm2 += (double)p->n[i] * (double)p->n[i];
    return fabs(norm2 - 1) <= 1e-3 && p->k1_N_m >= 0 && p->b_N_s_m >= 0 && p->kt_N_m >= 0 && p->mu_s >= 0 &&
           p->mu_d >= 0 && p->radius_m >= 0;
}

int pal_wire_get_haptic(const uint8_t *bytes, size_t n_byte, pal_wire_haptic *out)
{
    pal_wire_haptic h = {0};
    bool finite = true;
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_HAPTIC, &h.tool);
    if (refusal) return refusal;
    if (n_byte < PAL_WIRE_HAPTIC_BYTES(0)) return PAL_REFUSAL_SHORT;
    h.seq = take32(&bytes);
    h.flags = take32(&bytes);
    h.stamp_us = take64(&bytes);
    h.echo_stamp_us = take64(&bytes);
    h.echo_seq = take32(&bytes);
    h.hold_us = take32(&bytes);
    h.frame_us = take32(&bytes);
    h.n_patch = take32(&bytes);
    if (h.n_patch > PAL_WIRE_CONTACT_PATCH_MAX) return PAL_REFUSAL_COUNT;
    refusal = exact(n_byte, PAL_WIRE_HAPTIC_BYTES(h.n_patch));
    if (refusal) return refusal;
    finite &= take_doubles(&bytes, h.origin_m, 3);
    finite &= take_floats(&bytes, h.f_ref_N, 3);
    h.has_grasp = take32(&bytes);
    finite &= take_floats(&bytes, h.grasp_x0_m, 3);
    finite &= take_floats(&bytes, h.grasp_f0_N, 3);
    finite &= take_floats(&bytes, h.grasp_k_N_m, 6);
    finite &= take_floats(&bytes, &h.grasp_b_N_s_m, 1);
    for (uint32_t i = 0; i < h.n_patch; i++) finite &= take_patch(&bytes, &h.patch[i]);

    if (!finite) return PAL_REFUSAL_NAN;
    if (h.flags & ~(uint32_t)PAL_WIRE_HAPTIC_FLAGS) return PAL_REFUSAL_FLAGS;
    if (h.tool >= PAL_WIRE_TOOL_MAX || h.has_grasp > 1 || h.grasp_b_N_s_m < 0) return PAL_REFUSAL_RANGE;
    for (uint32_t i = 0; i < h.n_patch; i++)
        if (!good_patch(&h.patch[i])) return PAL_REFUSAL_RANGE;
    if (h.stamp_us >= STAMP_MAX || h.echo_stamp_us >= STAMP_MAX) return PAL_REFUSAL_RANGE;
    *out = h;
    return 0;
}
