/* A client of palpate.v2 on the mem transport: what it has been told, and its copy of the tissue. */
#ifndef TESTS_NET_MEM_CLIENT_H
#define TESTS_NET_MEM_CLIENT_H
#include "protocol/asset.h"
#include "protocol/control.h"
#include "protocol/field_codec.h"
#include "protocol/frame_codec.h"
#include "protocol/interior_codec.h"
#include "protocol/topology_delta_codec.h"
#include "tests/check.h"
#include "tests/net/mem_transport.h"

typedef struct mem_client {
    uint32_t model_seq; /* haptic model that its poses name */
    pal_transport *transport;
    pal_mem_peer *peer;
    pal_control last[PAL_CONTROL_COUNT]; /* newest of each type */
    int n_text[PAL_CONTROL_COUNT];
    int n_frame, n_tools, n_haptic, n_field, n_interior, n_bad;
    pal_interior_head interior; /* of the last message */
    uint32_t epoch;             /* of the asset */
    int n_old;                  /* frames and fields of an older one: ignored */
    pal_frame_head frame;
    pal_wire_tools tools;
    pal_wire_haptic haptic;
    pal_field_head field;
    uint8_t *level; /* of the newest field [n_vertex] */
    int n_of_field[PAL_WIRE_FIELD_COUNT], n_of_interior[PAL_WIRE_FIELD_COUNT];
    pal_asset *asset;
    pal_frame_decoder *decoder;
    float *position_m; /* [n_vertex][3] */
    bool mute;         /* does not acknowledge */
    int n_patch;
    pal_topology_delta_head patch;
    uint32_t *tri; /* triangles as patched [n_triangle][3] */
    bool patched;  /* a patch has come and not yet its frame */
} mem_client;

static inline void mem_send(mem_client *c, const pal_control *message)
{
    char text[PAL_CONTROL_IN_MAX + 1];
    size_t n = 0;
    CHECK_INT(pal_control_put(text, sizeof text, message, &n), 0);
    pal_mem_send(c->peer, text, n, true);
}

static inline void mem_text(mem_client *c, const char *text)
{
    pal_mem_send(c->peer, text, strlen(text), true);
}

static inline void mem_connect(mem_client *c, pal_transport *transport, const char *address, const char *ticket)
{
    memset(c, 0, sizeof *c);
    c->transport = transport;
    c->peer = pal_mem_connect_from(transport, "", address, ticket);
}

/* of a client that is connected */
static inline void mem_enter(mem_client *c, const char *name, pal_wire_role role, int tool, bool patches)
{
    pal_control join = {.type = PAL_CONTROL_JOIN};
    join.join.role = role;
    join.join.tool = tool;
    join.join.topology_deltas = patches;
    snprintf(join.join.name, sizeof join.join.name, "%s", name);
    mem_send(c, &join);
}

static inline void mem_join_as(mem_client *c, pal_transport *transport, const char *name, pal_wire_role role, int tool,
                               bool patches)
{
    mem_connect(c, transport, "", "");
    mem_enter(c, name, role, tool, patches);
}

static inline void mem_join(mem_client *c, pal_transport *transport, const char *name, pal_wire_role role, int tool)
{
    mem_join_as(c, transport, name, role, tool, false);
}

static inline void mem_drop_asset(mem_client *c)
{
    pal_frame_decoder_destroy(c->decoder);
    pal_asset_destroy(c->asset);
    free(c->position_m);
    free(c->level);
    free(c->tri);
    c->decoder = NULL, c->asset = NULL, c->position_m = NULL, c->level = NULL, c->tri = NULL;
}

/* part 0 as hello or topology name it */
static inline void mem_load_asset(mem_client *c, const pal_wire_part_info *part)
{
    pal_reply reply;
    pal_mem_get(c->transport, part->asset, &reply);
    CHECK_INT(reply.status, 200);
    if (!reply.body) return;
    mem_drop_asset(c);
    c->epoch = part->epoch;
    CHECK_INT(pal_asset_decode(reply.body->bytes, reply.body->n_byte, &c->asset), 0);
    CHECK_INT(pal_frame_decoder_create(c->asset, &c->decoder), 0);
    CHECK_INT(c->asset->order->n_vertex, part->n_vertex);
    c->position_m = calloc(c->asset->order->n_vertex, 3 * sizeof(float));
    c->level = calloc(c->asset->order->n_vertex, 1);
    c->tri = calloc(c->asset->n_triangle, 3 * sizeof *c->tri);
    memcpy(c->tri, c->asset->triangle, (size_t)c->asset->n_triangle * 3 * sizeof *c->tri);
    pal_packet_drop(reply.body);
}

static inline void mem_take_text(mem_client *c, const pal_packet *p)
{
    static pal_control in;
    int refusal = pal_control_get((const char *)p->bytes, p->n_byte, true, &in);
    if (refusal) {
        c->n_bad++;
        return;
    }
    c->last[in.type] = in;
    c->n_text[in.type]++;
    if (in.type == PAL_CONTROL_HELLO) mem_load_asset(c, &in.hello.part[0]);
    if (in.type == PAL_CONTROL_TOPOLOGY && in.topology.part[0].epoch > c->epoch)
        mem_load_asset(c, &in.topology.part[0]);
}

/* the places change, and a frame of that part must be next */
static inline void mem_take_patch(mem_client *c, const pal_packet *p)
{
    c->n_patch++;
    uint32_t n = c->asset ? c->asset->n_triangle : 0;
    uint8_t *work = malloc(PAL_TOPOLOGY_DELTA_WORK_BYTES(n) + 1);
    uint64_t before = c->patch.revision;
    if (c->patched ||
        pal_topology_delta_get(p->bytes, p->n_byte, n, n ? c->asset->order->n_vertex : 0, work, &c->patch, c->tri))
        c->n_bad++;
    else if (c->patch.revision <= before || c->patch.part != 0 || c->patch.epoch != 1)
        c->n_bad++;
    c->patched = true;
    free(work);
}

static inline void mem_take_binary(mem_client *c, const pal_packet *p)
{
    pal_wire_head head;
    int refusal = pal_wire_get_head(p->bytes, p->n_byte, &head);
    if (refusal || (c->patched && head.kind != PAL_WIRE_FRAME && head.kind != PAL_WIRE_HAPTIC)) {
        c->n_bad++;
    } else if (head.kind == PAL_WIRE_TOPOLOGY_DELTA) {
        mem_take_patch(c, p);
    } else if (head.kind == PAL_WIRE_FRAME) {
        pal_frame_head frame = {0};
        c->patched = false;
        if (!pal_frame_get_head(p->bytes, p->n_byte, &frame) && frame.epoch < c->epoch) {
            c->n_old++;
            return;
        }
        c->n_frame++;
        if (frame.epoch == c->frame.epoch && frame.seq <= c->frame.seq) c->n_bad++;
        if (!c->decoder || pal_frame_get(c->decoder, p->bytes, p->n_byte, &c->frame, c->position_m)) c->n_bad++;
    } else if (head.kind == PAL_WIRE_TOOLS) {
        c->n_tools++;
        if (pal_wire_get_tools(p->bytes, p->n_byte, &c->tools)) c->n_bad++;
        if (!c->mute) {
            uint8_t ack[PAL_WIRE_ACK_BYTES];
            pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = c->tools.cycle});
            pal_mem_send(c->peer, ack, sizeof ack, false);
        }
    } else if (head.kind == PAL_WIRE_FIELD) {
        pal_field_head field;
        if (!pal_field_get_head(p->bytes, p->n_byte, &field) && field.epoch < c->epoch) {
            c->n_old++;
            return;
        }
        c->n_field++;
        if (!c->level || pal_field_get(p->bytes, p->n_byte, c->asset->order->n_vertex, &c->field, c->level)) c->n_bad++;
        c->n_of_field[c->field.field]++;
    } else if (head.kind == PAL_WIRE_INTERIOR) {
        c->n_interior++;
        if (pal_interior_get_head(p->bytes, p->n_byte, &c->interior)) c->n_bad++;
        c->n_of_interior[c->interior.field]++;
    } else {
        c->n_haptic++;
        if (pal_wire_get_haptic(p->bytes, p->n_byte, &c->haptic)) c->n_bad++;
    }
}

/* takes at most n messages; the result is how many there were */
static inline int mem_pull(mem_client *c, int n)
{
    int taken = 0;
    for (const pal_packet *p; taken < n && (p = pal_mem_receive(c->peer)); taken++)
        if (p->text)
            mem_take_text(c, p);
        else
            mem_take_binary(c, p);
    return taken;
}

static inline void mem_pose_with(mem_client *c, int tool, uint32_t seq, const double position_m[3], uint32_t buttons)
{
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    pal_wire_pose pose = {.tool = (uint16_t)tool,
                          .seq = seq,
                          .stamp_us = 1000 + seq,
                          .quaternion = {1, 0, 0, 0},
                          .buttons = buttons,
                          .model_seq = c->model_seq};
    for (int i = 0; i < 3; i++) pose.position_m[i] = position_m[i];
    CHECK_INT(pal_wire_put_pose(bytes, sizeof bytes, &pose), PAL_WIRE_POSE_BYTES);
    pal_mem_send(c->peer, bytes, sizeof bytes, false);
}

static inline void mem_pose(mem_client *c, int tool, uint32_t seq, const double position_m[3])
{
    mem_pose_with(c, tool, seq, position_m, 0);
}

static inline void mem_end(mem_client *c)
{
    if (c->peer) pal_mem_leave(c->peer);
    mem_drop_asset(c);
    memset(c, 0, sizeof *c);
}
#endif
