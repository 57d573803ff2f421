/* The binary messages of palpate.v2 (README.md). A table of fields describes each fixed part; one writer and one reader
 * walk the tables, little-endian on any host. Lengths are checked before a walk, because each follows from the kind and
 * one count. */
#include "protocol/wire.h"

#include "protocol/bytes.h"

#include <math.h>
#include <stdbool.h>

#define STAMP_MAX   ((uint64_t)1 << 53) /* JavaScript reads stamps as doubles */
#define WORLD_MAX_M 1000.0

typedef enum number { U16, U32, U64, F32, F64 } number;
static const size_t size_of[] = {[U16] = 2, [U32] = 4, [U64] = 8, [F32] = 4, [F64] = 8};

/* a number, or an array of them */
typedef struct field {
    number type;
    size_t offset, n_byte; /* n_byte 0 ends a table */
} field;
#define FIELD(type, of, member) type, offsetof(of, member), sizeof(((of *)0)->member)
#define ACK(type, member)       FIELD(type, pal_wire_ack, member)
#define POSE(type, member)      FIELD(type, pal_wire_pose, member)
#define TOOL(type, member)      FIELD(type, pal_wire_tool, member)
#define MODEL(type, member)     FIELD(type, pal_wire_haptic, member)
#define PATCH(type, member)     FIELD(type, pal_wire_contact_patch, member)

static const field ack_fields[] = {{ACK(U32, cycle)}, {ACK(U32, decode_us)}, {0}};
static const field pose_fields[] = {{POSE(U32, seq)},          {POSE(U32, flags)},          {POSE(U64, stamp_us)},
                                    {POSE(F64, position_m)},   {POSE(F64, quaternion)},     {POSE(F32, velocity_m_s)},
                                    {POSE(F32, omega_rad_s)},  {POSE(F32, force_N)},        {POSE(F32, torque_N_m)},
                                    {POSE(F32, grip)},         {POSE(U32, buttons)},        {POSE(U32, model_seq)},
                                    {POSE(U32, model_age_us)}, {POSE(U64, model_stamp_us)}, {0}};
static const field tool_fields[] = {{TOOL(U16, holder)},
                                    {TOOL(U16, flags)},
                                    {TOOL(U32, colour)},
                                    {TOOL(F32, radius_m)},
                                    {TOOL(F32, position_m)},
                                    {TOOL(F32, quaternion)},
                                    {TOOL(F32, force_N)},
                                    {TOOL(U32, echo_seq)},
                                    {TOOL(U32, hold_us)},
                                    {TOOL(U64, echo_stamp_us)},
                                    {0}};
static const field haptic_fields[] = {
    {MODEL(U32, seq)},           {MODEL(U32, flags)},         {MODEL(U64, stamp_us)},
    {MODEL(U64, echo_stamp_us)}, {MODEL(U32, echo_seq)},      {MODEL(U32, hold_us)},
    {MODEL(U32, frame_us)},      {MODEL(U32, n_patch)},       {MODEL(F64, origin_m)},
    {MODEL(F32, f_ref_N)},       {MODEL(F32, torque_ref_Nm)}, {MODEL(U32, has_grasp)},
    {MODEL(F32, grasp_x0_m)},    {MODEL(F32, grasp_f0_N)},    {MODEL(F32, grasp_k_N_m)},
    {MODEL(F32, grasp_b_N_s_m)}, {MODEL(F32, grasp_arm_m)},   {0}};
static const field patch_fields[] = {{PATCH(U16, id)},
                                     {PATCH(U16, group)},
                                     {PATCH(F32, p_m)},
                                     {PATCH(F32, n)},
                                     {PATCH(F32, v_m_s)},
                                     {PATCH(F32, k1_N_m)},
                                     {PATCH(F32, k2_N_m2)},
                                     {PATCH(F32, b_N_s_m)},
                                     {PATCH(F32, kt_N_m)},
                                     {PATCH(F32, mu_s)},
                                     {PATCH(F32, mu_d)},
                                     {PATCH(F32, radius_m)},
                                     {0}};

uint8_t *pal_wire_put_head(uint8_t *at, uint8_t kind, uint8_t flags, uint16_t index)
{
    pal_put_u32(at, PAL_WIRE_MAGIC);
    at[4] = kind;
    at[5] = flags;
    pal_put_u16(at + 6, index);
    return at + PAL_WIRE_HEAD_BYTES;
}

static uint8_t *put_fields(uint8_t *at, const field *f, const void *from)
{
    for (; f->n_byte; f++)
        for (size_t i = 0, size = size_of[f->type]; i < f->n_byte; i += size, at += size) {
            const uint8_t *member = (const uint8_t *)from + f->offset + i;
            uint16_t u16;
            uint32_t u32;
            uint64_t u64;
            if (size == 2)
                memcpy(&u16, member, size), pal_put_u16(at, u16);
            else if (size == 4)
                memcpy(&u32, member, size), pal_put_u32(at, u32);
            else
                memcpy(&u64, member, size), pal_put_u64(at, u64);
        }
    return at;
}

/* false: a number is not finite */
static bool take_fields(const uint8_t **at, const field *f, void *to)
{
    bool finite = true;
    for (; f->n_byte; f++)
        for (size_t i = 0, size = size_of[f->type]; i < f->n_byte; i += size, *at += size) {
            uint8_t *member = (uint8_t *)to + f->offset + i;
            const uint16_t u16 = pal_get_u16(*at);
            const uint32_t u32 = size > 2 ? pal_get_u32(*at) : 0;
            const uint64_t u64 = size > 4 ? pal_get_u64(*at) : 0;
            memcpy(member, size == 2 ? (const void *)&u16 : size == 4 ? (const void *)&u32 : &u64, size);
            if (f->type == F32) finite &= isfinite(pal_get_f32(*at)) != 0;
            if (f->type == F64) finite &= isfinite(pal_get_f64(*at)) != 0;
        }
    return finite;
}

static bool known_kind(uint8_t kind)
{
    return kind == PAL_WIRE_FRAME || kind == PAL_WIRE_TOOLS || kind == PAL_WIRE_HAPTIC || kind == PAL_WIRE_FIELD ||
           kind == PAL_WIRE_TOPOLOGY_DELTA || kind == PAL_WIRE_INTERIOR || kind == PAL_WIRE_POSE ||
           kind == PAL_WIRE_ACK;
}

int pal_wire_get_head(const uint8_t *bytes, size_t n_byte, pal_wire_head *out)
{
    if (n_byte < PAL_WIRE_HEAD_BYTES) return PAL_REFUSAL_SHORT;
    if (pal_get_u32(bytes) != PAL_WIRE_MAGIC) return PAL_REFUSAL_MAGIC;
    if (!known_kind(bytes[4])) return PAL_REFUSAL_KIND;
    *out = (pal_wire_head){bytes[4], bytes[5], pal_get_u16(bytes + 6)};
    return 0;
}

int pal_wire_get_head_of(const uint8_t *bytes, size_t n_byte, uint8_t kind, uint8_t flags, pal_wire_head *out)
{
    int refusal = pal_wire_get_head(bytes, n_byte, out);
    if (!refusal && out->kind != kind) refusal = PAL_REFUSAL_KIND;
    if (!refusal && out->flags & ~flags) refusal = PAL_REFUSAL_FLAGS;
    return refusal;
}

/* head of a message of this kind that has no flags */
static int take_head(const uint8_t **at, size_t n_byte, uint8_t kind, uint16_t *index)
{
    pal_wire_head head;
    int refusal = pal_wire_get_head_of(*at, n_byte, kind, 0, &head);
    if (refusal) return refusal;
    *index = head.index;
    *at += PAL_WIRE_HEAD_BYTES;
    return 0;
}

int pal_wire_check_size(size_t n_byte, size_t wanted)
{
    return n_byte < wanted ? PAL_REFUSAL_SHORT : n_byte > wanted ? PAL_REFUSAL_LONG : PAL_REFUSAL_NONE;
}

size_t pal_wire_put_pose(uint8_t *dst, size_t cap, const pal_wire_pose *p)
{
    if (cap < PAL_WIRE_POSE_BYTES) return 0;
    put_fields(pal_wire_put_head(dst, PAL_WIRE_POSE, 0, p->tool), pose_fields, p);
    return PAL_WIRE_POSE_BYTES;
}

int pal_wire_get_pose(const uint8_t *bytes, size_t n_byte, pal_wire_pose *out)
{
    pal_wire_pose p;
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_POSE, &p.tool);
    if (!refusal) refusal = pal_wire_check_size(n_byte, PAL_WIRE_POSE_BYTES);
    if (refusal) return refusal;
    if (!take_fields(&bytes, pose_fields, &p)) return PAL_REFUSAL_NAN;
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
    put_fields(pal_wire_put_head(dst, PAL_WIRE_ACK, 0, 0), ack_fields, a);
    return PAL_WIRE_ACK_BYTES;
}

int pal_wire_get_ack(const uint8_t *bytes, size_t n_byte, pal_wire_ack *out)
{
    uint16_t index;
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_ACK, &index);
    if (!refusal) refusal = pal_wire_check_size(n_byte, PAL_WIRE_ACK_BYTES);
    if (!refusal && index) refusal = PAL_REFUSAL_RANGE;
    if (!refusal) take_fields(&bytes, ack_fields, out);
    return refusal;
}

size_t pal_wire_put_tools(uint8_t *dst, size_t cap, const pal_wire_tools *t)
{
    if (t->n_tool > PAL_WIRE_TOOL_MAX || cap < PAL_WIRE_TOOLS_BYTES(t->n_tool)) return 0;
    dst = pal_wire_put_head(dst, PAL_WIRE_TOOLS, 0, (uint16_t)t->n_tool);
    pal_put_u32(dst, t->cycle);
    pal_put_u32(dst + 4, 0);
    pal_put_u64(dst + 8, t->sim_time_us);
    dst += 16;
    for (uint32_t i = 0; i < t->n_tool; i++) dst = put_fields(dst, tool_fields, &t->tool[i]);
    return PAL_WIRE_TOOLS_BYTES(t->n_tool);
}

static int take_tool(const uint8_t **at, pal_wire_tool *tool)
{
    if (!take_fields(at, tool_fields, tool)) return PAL_REFUSAL_NAN;
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
    refusal = pal_wire_check_size(n_byte, PAL_WIRE_TOOLS_BYTES(t.n_tool));
    if (refusal) return refusal;
    t.cycle = pal_get_u32(bytes);
    t.sim_time_us = pal_get_u64(bytes + 8);
    if (pal_get_u32(bytes + 4) || t.sim_time_us >= STAMP_MAX) return PAL_REFUSAL_RANGE;
    bytes += 16;
    for (uint32_t i = 0; i < t.n_tool && !refusal; i++) refusal = take_tool(&bytes, &t.tool[i]);
    if (!refusal) *out = t;
    return refusal;
}

size_t pal_wire_put_haptic(uint8_t *dst, size_t cap, const pal_wire_haptic *h)
{
    if (h->n_patch > PAL_WIRE_CONTACT_PATCH_MAX || cap < PAL_WIRE_HAPTIC_BYTES(h->n_patch)) return 0;
    dst = put_fields(pal_wire_put_head(dst, PAL_WIRE_HAPTIC, 0, h->tool), haptic_fields, h);
    for (uint32_t i = 0; i < h->n_patch; i++) dst = put_fields(dst, patch_fields, &h->patch[i]);
    return PAL_WIRE_HAPTIC_BYTES(h->n_patch);
}

/* a unit normal and no negative constant but the slope, so that what a bridge renders is passive */
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
    int refusal = take_head(&bytes, n_byte, PAL_WIRE_HAPTIC, &h.tool);
    if (refusal) return refusal;
    if (n_byte < PAL_WIRE_HAPTIC_BYTES(0)) return PAL_REFUSAL_SHORT;
    bool finite = take_fields(&bytes, haptic_fields, &h);
    if (h.n_patch > PAL_WIRE_CONTACT_PATCH_MAX) return PAL_REFUSAL_COUNT;
    refusal = pal_wire_check_size(n_byte, PAL_WIRE_HAPTIC_BYTES(h.n_patch));
    if (refusal) return refusal;
    for (uint32_t i = 0; i < h.n_patch; i++) finite &= take_fields(&bytes, patch_fields, &h.patch[i]);
    if (!finite) return PAL_REFUSAL_NAN;
    if (h.flags & ~(uint32_t)PAL_WIRE_HAPTIC_FLAGS) return PAL_REFUSAL_FLAGS;
    if (h.tool >= PAL_WIRE_TOOL_MAX || h.has_grasp > 1 || h.grasp_b_N_s_m < 0) return PAL_REFUSAL_RANGE;
    for (uint32_t i = 0; i < h.n_patch; i++)
        if (!good_patch(&h.patch[i])) return PAL_REFUSAL_RANGE;
    if (h.stamp_us >= STAMP_MAX || h.echo_stamp_us >= STAMP_MAX) return PAL_REFUSAL_RANGE;
    *out = h;
    return 0;
}
