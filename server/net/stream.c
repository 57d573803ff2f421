/* Streams (protocol/README.md, "Cycles and credit"). The network thread encodes (0.4 ms per part and cycle). */
#include "server/net/stream.h"

#include "protocol/asset.h"
#include "protocol/interior_codec.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/base/vec3.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"
#include "server/session/control_cells.h"
#include "server/session/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double tier_factor[PAL_STREAM_TIER_COUNT] = PAL_TIER_FACTORS;

static pal_err refuse(pal_diagnostic *diag, int refusal, const char *part, const char *what)
{
    return pal_diagnostic_set(diag, refusal == PAL_REFUSAL_MEMORY ? PAL_ERR_MEMORY : PAL_ERR_REFUSED, "part %s: %s: %s",
                              part, what, pal_refusal_text(refusal));
}

static void drop_fields(pal_stream_part *part)
{
    for (int k = 0; k < PAL_FIELD_COUNT; k++) {
        pal_packet_drop(part->field[k].packet);
        pal_packet_drop(part->interior[k].packet);
    }
    pal_packet_drop(part->interior_asset);
}

/* makes a file of a part, which is named after its content; path: PAL_WIRE_NAME_BYTES */
static pal_err make_file(const void *bytes, size_t n_byte, char *path, pal_packet **out)
{
    char hash[PAL_ASSET_HASH_CHARS];
    *out = pal_packet_create(bytes, n_byte, false);
    pal_asset_hash(bytes, n_byte, hash);
    snprintf(path, PAL_WIRE_NAME_BYTES, "/asset/%s", hash);
    return *out ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* Positions are sent as displacements, so that the order of nodes is any: their own. A tetrahedron a b c d is written
 * as two of its faces, a b c and c b d */
static int encode_interior(const pal_shown *shown, uint8_t **bytes, size_t *n_byte)
{
    const uint32_t n = (uint32_t)shown->n_node, n_tet = (uint32_t)shown->n_tet;
    pal_frame_order *order = pal_frame_order_allocate(n, 1);
    float *rest_m = malloc(3 * sizeof *rest_m * n);
    uint32_t *face = malloc(6 * sizeof *face * n_tet);
    int refusal = order && rest_m && face ? 0 : PAL_REFUSAL_MEMORY;
    for (uint32_t i = 0; i < n && !refusal; i++) {
        order->vertex_of[i] = i;
        for (uint32_t c = 0; c < 3; c++)
            rest_m[3 * i + c] = (float)(shown->node_rest_m[3 * i + c] + shown->offset_m[c]);
    }
    for (uint32_t t = 0; t < n_tet && !refusal; t++) {
        static const int corner[6] = {0, 1, 2, 2, 1, 3};
        for (uint32_t c = 0; c < 6; c++) face[6 * t + c] = (uint32_t)shown->tet[4 * t + (uint32_t)corner[c]];
    }
    if (!refusal) {
        order->level_begin[0] = 0, order->level_begin[1] = n;
        refusal = pal_asset_encode(rest_m, NULL, NULL, order, face, 2 * n_tet, bytes, n_byte);
    }
    free(rest_m);
    free(face);
    pal_frame_order_destroy(order);
    return refusal;
}

static pal_err open_interior(pal_stream_part *part, const pal_shown *shown, pal_diagnostic *diag)
{
    uint8_t *bytes = NULL;
    size_t n_byte = 0;
    if (shown->n_tet == 0 || shown->n_tet > PAL_INTERIOR_TETS) return PAL_ERR_OK;
    const int refusal = encode_interior(shown, &bytes, &n_byte);
    if (refusal)
        return pal_diagnostic_set(diag, refusal == PAL_REFUSAL_MEMORY ? PAL_ERR_MEMORY : PAL_ERR_REFUSED,
                                  "part %s: no asset of its interior: %s", shown->name, pal_refusal_text(refusal));
    part->n_node = (uint32_t)shown->n_node;
    const pal_err err = make_file(bytes, n_byte, part->info.interior, &part->interior_asset);
    free(bytes);
    return err;
}

/* what a click on a sculptable part means */
static pal_err open_control_cells(pal_stream *s, int index, const pal_shown *shown)
{
    pal_stream_part *part = &s->part[index];
    double origin_m[3];
    part->info.is_sculptable = shown->face != NULL;
    if (!shown->face) return PAL_ERR_OK;
    pal_sub3(origin_m, s->scene->body[index].mesh->surface.origin_m, s->scene->body[0].mesh->surface.origin_m);
    char *text = pal_control_cells_text(s->scene->body[index].cells, origin_m, shown);
    pal_err err = text ? make_file(text, strlen(text), part->info.control_cells, &part->control_cells) : PAL_ERR_MEMORY;
    free(text);
    return err;
}

static pal_err name_images(pal_stream_part *part, const pal_body_def *def)
{
    for (int k = 0; k < def->n_image; k++) {
        PAL_TRY(make_file(def->image[k].bytes, def->image[k].n_byte, part->info.image[k], &part->image[k]));
        part->info.n_image++;
    }
    return PAL_ERR_OK;
}

/* builds the asset and encoders of one part */
static pal_err open_part(pal_stream *s, int index, const pal_shown *shown, pal_diagnostic *diag)
{
    pal_stream_part *part = &s->part[index];
    pal_frame_order *order = NULL;
    uint8_t *bytes = NULL;
    size_t n_byte = 0;
    pal_err err = PAL_ERR_OK;
    const uint32_t *tri = (const uint32_t *)shown->tri; /* indices are nonnegative */

    int refusal =
        shown->parent
            ? pal_frame_order_hierarchy(shown->rest_m, (uint32_t)shown->n_vertex, (uint32_t)shown->n_coarse,
                                        (const uint32_t *)shown->parent, (const uint32_t *)shown->coarse_tri,
                                        (uint32_t)shown->n_coarse_tri, &order)
            : pal_frame_order_create(shown->rest_m, (uint32_t)shown->n_vertex, tri, (uint32_t)shown->n_tri, &order);
    if (refusal) return refuse(diag, refusal, shown->name, "no vertex order");
    refusal =
        pal_asset_encode(shown->rest_m, shown->look, shown->uv, order, tri, (uint32_t)shown->n_tri, &bytes, &n_byte);
    if (refusal) err = refuse(diag, refusal, shown->name, "no asset");
    for (int t = 0; !err && t < PAL_STREAM_TIER_COUNT; t++) {
        refusal = pal_frame_encoder_create(shown->rest_m, order, &s->encoder[index][t]);
        if (refusal) err = refuse(diag, refusal, shown->name, "no encoder");
    }
    if (!err) err = make_file(bytes, n_byte, part->info.asset, &part->asset);
    if (!err) err = open_control_cells(s, index, shown);
    if (!err) {
        if (shown->look) err = name_images(part, &s->scene->body[index]);
        pal_plain_text(part->info.name, sizeof part->info.name, shown->name);
        part->info.epoch = 1;
        part->info.n_vertex = (uint32_t)shown->n_vertex;
        part->info.n_triangle = (uint32_t)shown->n_tri;
        part->info.is_adaptive = shown->is_adaptive;
        if (!err) err = open_interior(part, shown, diag);
        pal_plain_text(part->info.appearance, sizeof part->info.appearance, s->scene->body[index].appearance);
        pal_plain_text(part->info.colour, sizeof part->info.colour, s->scene->body[index].colour);
        if (!err && shown->is_adaptive)
            err = pal_triangle_slots_make(index, shown->name, part->info.epoch, shown->tri, part->info.n_triangle,
                                          part->info.n_vertex, diag, &part->slots);
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++)
            if (pal_session_has_field(s->session, index, (pal_field)k))
                pal_plain_text(part->info.field[part->info.n_field++], PAL_WIRE_FIELD_BYTES,
                               pal_field_name((pal_field)k));
    }
    free(bytes);
    pal_frame_order_destroy(order);
    return err;
}

static void widen_box(pal_stream *s, const pal_shown *shown)
{
    for (int i = 0; i < 3 * shown->n_vertex; i++) {
        double x = shown->rest_m[i];
        s->box_min_m[i % 3] = fmin(s->box_min_m[i % 3], x);
        s->box_max_m[i % 3] = fmax(s->box_max_m[i % 3], x);
    }
}

static pal_err open_parts(pal_stream *s, double error_m, pal_diagnostic *diag)
{
    uint32_t max = 0;
    double side = 0;
    for (int c = 0; c < 3; c++) s->box_min_m[c] = HUGE_VAL, s->box_max_m[c] = -HUGE_VAL;
    for (int p = 0; p < s->n_part; p++) {
        const pal_shown *shown = &pal_session_view_outline(s->session)->part[p];
        if (shown->n_vertex < 1 || (uint32_t)shown->n_vertex > PAL_WIRE_VERTEX_MAX)
            return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "part %s: %d shown vertices, 1 to %u can be streamed",
                                      shown->name, shown->n_vertex, PAL_WIRE_VERTEX_MAX);
        PAL_TRY(open_part(s, p, shown, diag));
        widen_box(s, shown);
        if (s->part[p].info.n_vertex > max) max = s->part[p].info.n_vertex;
    }
    for (int c = 0; c < 3; c++) side = fmax(side, s->box_max_m[c] - s->box_min_m[c]);
    s->error_m = side > 0 ? fmin(PAL_POSITION_ERROR_M, side / PAL_POSITIONS_IN_LENGTH) : PAL_POSITION_ERROR_M;
    if (error_m > 0) s->error_m = error_m;
    for (int p = 0; p < s->n_part; p++) s->part[p].info.error_m = s->error_m;
    s->cap = pal_frame_bound(max);
    if (s->cap < PAL_WIRE_TOOLS_MAX) s->cap = PAL_WIRE_TOOLS_MAX;
    s->buffer = malloc(s->cap);
    return s->buffer ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_stream_open(pal_session *session, double error_m, pal_diagnostic *diag, pal_stream **out)
{
    const pal_scene *scene = pal_session_scene(session);
    int n_part = pal_session_view_outline(session)->n_part;
    if (n_part < 1 || n_part > PAL_BODY_MAX)
        return PAL_REFUSE(diag, "session %s shows %d parts, 1 to %d can be streamed", scene->name, n_part,
                          PAL_BODY_MAX);
    pal_stream *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    s->session = session, s->scene = scene, s->n_part = n_part;
    pal_err err = open_parts(s, error_m, diag);
    if (err) return pal_stream_close(s), err;
    *out = s;
    return PAL_ERR_OK;
}

void pal_stream_close(pal_stream *stream)
{
    if (!stream) return;
    for (int p = 0; p < stream->n_part; p++) {
        pal_packet_drop(stream->part[p].asset);
        for (int k = 0; k < PAL_IMAGES_MAX; k++) pal_packet_drop(stream->part[p].image[k]);
        pal_packet_drop(stream->part[p].control_cells);
        pal_triangle_slots_free(stream->part[p].slots);
        drop_fields(&stream->part[p]);
        for (int t = 0; t < PAL_STREAM_TIER_COUNT; t++) {
            pal_packet_drop(stream->part[p].frame[t]);
            pal_frame_encoder_destroy(stream->encoder[p][t]);
        }
    }
    for (int t = 0; t < PAL_TOOL_MAX; t++) pal_packet_drop(stream->haptic[t]);
    pal_packet_drop(stream->tools);
    free(stream->buffer);
    free(stream);
}

void pal_stream_transfer(pal_stream *stream, const pal_stream *before)
{
    stream->cycle = before->cycle, stream->cycle_ns = before->cycle_ns;
    stream->step_ms = before->step_ms, stream->step_rate_hz = before->step_rate_hz;
    memcpy(stream->n_step, before->n_step, sizeof stream->n_step);
    stream->step_sum_s = before->step_sum_s, stream->counted_tick = before->counted_tick;
    memcpy(stream->component_ms, before->component_ms, sizeof stream->component_ms);
    stream->count = before->count;
    memcpy(stream->haptic_seq, before->haptic_seq, sizeof stream->haptic_seq);
    stream->field_seq = before->field_seq;
    stream->rate_tick = before->rate_tick, stream->rate_ns = before->rate_ns;
    for (int p = 0; p < stream->n_part && p < before->n_part; p++) {
        pal_stream_part *part = &stream->part[p];
        part->info.epoch = before->part[p].info.epoch + 1;
        if (part->slots) part->slots->epoch = part->info.epoch;
        stream->seq[p] = before->seq[p];
    }
}

double pal_stream_tier_error_m(const pal_stream *stream, int tier)
{
    return stream->error_m * tier_factor[tier];
}

double pal_stream_rate_hz(const pal_stream *stream)
{
    return fmin(1 / stream->scene->step_s, PAL_STREAM_RATE_HZ);
}

static uint64_t time_us(double time_s)
{
    return time_s > 0 ? (uint64_t)(time_s * 1e6) : 0;
}

/* Encodes one part at one tier. A frame identical to the last is discarded, so the older message stays the newest,
 * unless other vertices are displayed now or `again` is set. */
static void encode_part(pal_stream *s, int p, int tier, bool again)
{
    pal_stream_part *part = &s->part[p];
    const pal_frame_part *from = &s->frame->part[p];
    pal_frame_input given = {.part = (uint16_t)p,
                             .epoch = part->info.epoch,
                             .seq = s->seq[p] + 1,
                             .cycle = s->cycle,
                             .sim_time_us = time_us(s->frame->time_s),
                             .error_m = pal_stream_tier_error_m(s, tier),
                             .position_m = from->position_m,
                             .hidden = part->slots ? part->slots->hidden : NULL};
    uint32_t change = part->slots ? part->slots->change : 0;
    pal_frame_result result;
    if (from->n_vertex != (int)part->info.n_vertex) return;
    /* no observer; or, below, no new output: the body sleeps */
    if (!s->frame->watched) return;
    bool same = part->frame_output[tier] == from->n_output && part->frame_change[tier] == change;
    if (part->frame[tier] && same && !again) return;
    uint64_t begin = pal_clock_ns();
    int refusal = pal_frame_put(s->encoder[p][tier], &given, s->buffer, s->cap, &result);
    s->count.n_encode++;
    s->count.encode_ns += pal_clock_ns() - begin;
    if (refusal) {
        if (s->count.n_refused_frame++ == 0)
            pal_log(PAL_LOG_ERROR, "frame", "part %s is not streamed: %s", part->info.name, pal_refusal_text(refusal));
        return;
    }
    part->frame_output[tier] = from->n_output;
    if (!result.changed && part->frame[tier] && part->frame_change[tier] == change && !again) return;
    pal_packet *packet = pal_packet_create(s->buffer, result.n_byte, false);
    if (!packet) return;
    pal_packet_replace(&part->frame[tier], packet);
    part->frame_cycle[tier] = s->cycle;
    part->frame_change[tier] = change;
    part->frame_seq[tier] = ++s->seq[p];
    s->count.n_frame_byte += result.n_byte;
}

static void copy_f3(float to[3], const double from[3])
{
    for (int i = 0; i < 3; i++) to[i] = isfinite(from[i]) ? (float)from[i] : 0;
}

static void copy_quat(float to[4], const double from[4])
{
    double n = 0;
    for (int i = 0; i < 4; i++) n += from[i] * from[i];
    bool good = fabs(n - 1) <= 1e-3;
    for (int i = 0; i < 4; i++) to[i] = good ? (float)from[i] : i == 0;
}

/* echoes only a pose of the current holder, not of an earlier one */
static bool echoes(const pal_frame_tool *f, const pal_stream_tool *t)
{
    return f->present && t->holder && f->pose_ns >= t->taken_ns && f->pose_ns;
}

static uint32_t hold_us(const pal_frame_tool *f, uint64_t now_ns)
{
    uint64_t us = now_ns > f->pose_ns ? (now_ns - f->pose_ns) / 1000 : 0;
    return us > UINT32_MAX ? UINT32_MAX : (uint32_t)us;
}

static void put_tools(pal_stream *s, uint64_t now_ns, const pal_stream_tool tool[PAL_TOOL_MAX])
{
    pal_wire_tools w = {
        .cycle = s->cycle, .n_tool = (uint32_t)s->frame->n_tool, .sim_time_us = time_us(s->frame->time_s)};
    for (int i = 0; i < s->frame->n_tool; i++) {
        const pal_frame_tool *f = &s->frame->tool[i];
        pal_wire_tool *to = &w.tool[i];
        to->holder = (uint16_t)tool[i].holder;
        to->colour = tool[i].holder ? tool[i].colour : s->frame->plays ? PAL_RECORDED_COLOUR : 0;
        const bool held = s->frame->plays ? f->present : tool[i].holder > 0;
        to->flags = (uint16_t)((held ? PAL_WIRE_TOOL_HELD : 0) | (f->touching ? PAL_WIRE_TOOL_CONTACT : 0) |
                               (f->holding ? PAL_WIRE_TOOL_GRASPS : 0) | (f->present ? 0 : PAL_WIRE_TOOL_AWAY) |
                               (f->present && now_ns > f->pose_ns + PAL_LEASE_NS ? PAL_WIRE_TOOL_STALE : 0));
        to->radius_m = (float)f->radius_m;
        copy_f3(to->position_m, f->pose.position_m);
        copy_quat(to->quaternion, f->pose.quat);
        copy_f3(to->force_N, f->force_N);
        if (!echoes(f, &tool[i])) continue;
        to->echo_seq = f->pose.seq;
        to->echo_stamp_us = f->pose.stamp_us;
        to->hold_us = hold_us(f, now_ns);
    }
    size_t n = pal_wire_put_tools(s->buffer, s->cap, &w);
    pal_packet *packet = n ? pal_packet_create(s->buffer, n, false) : NULL;
    if (packet) pal_packet_replace(&s->tools, packet);
}

static void copy_patch(pal_wire_contact_patch *to, const pal_contact_patch *from, const double origin[3])
{
    double p[3];
    for (int i = 0; i < 3; i++) p[i] = from->point_m[i] - origin[i];
    to->id = (uint16_t)(from->id > 0 ? (from->id - 1) % UINT16_MAX + 1 : 0);
    to->group = (uint16_t)from->group;
    copy_f3(to->p_m, p);
    copy_f3(to->n, from->normal);
    copy_f3(to->v_m_s, from->velocity_m_s);
    to->k1_N_m = (float)from->k1_N_m;
    to->k2_N_m2 = (float)from->k2_N_m2;
    to->b_N_s_m = (float)from->b_Ns_m;
    to->kt_N_m = (float)from->kt_N_m;
    to->mu_s = (float)from->mu_static;
    to->mu_d = (float)from->mu_dynamic;
    to->radius_m = (float)from->radius_m;
}

/* contact model of a held tool (protocol/README.md, "HAPTIC"); relative to the tool position, so floats suffice */
static void put_haptic(pal_stream *s, int i, uint64_t now_ns, const pal_stream_tool *tool)
{
    const pal_frame_tool *f = &s->frame->tool[i];
    bool frozen = false;
    for (int p = 0; p < s->n_part; p++) frozen |= s->frame->part[p].frozen;
    if (!f->present || !tool->holder) {
        pal_packet_replace(&s->haptic[i], NULL);
        return;
    }
    pal_wire_haptic w = {.tool = (uint16_t)i,
                         .seq = ++s->haptic_seq[i],
                         .flags =
                             (s->frame->paused ? PAL_WIRE_HAPTIC_FREEZE : 0) | (frozen ? PAL_WIRE_HAPTIC_FORCE_OFF : 0),
                         .stamp_us = now_ns / 1000,
                         .frame_us = (uint32_t)(1e6 / pal_stream_rate_hz(s)),
                         .has_grasp = f->has_grasp,
                         .grasp_b_N_s_m = (float)f->grasp_b_Ns_m};
    if (echoes(f, tool)) {
        w.echo_stamp_us = f->pose.stamp_us;
        w.echo_seq = f->pose.seq;
        w.hold_us = hold_us(f, now_ns);
    }
    double x0[3];
    for (int c = 0; c < 3; c++) {
        w.origin_m[c] = f->pose.position_m[c];
        x0[c] = f->has_grasp ? f->grasp_x0_m[c] - w.origin_m[c] : 0;
    }
    copy_f3(w.f_ref_N, f->end_force_N);
    copy_f3(w.torque_ref_Nm, f->torque_Nm);
    copy_f3(w.grasp_arm_m, f->grasp_arm_m);
    copy_f3(w.grasp_x0_m, x0);
    copy_f3(w.grasp_f0_N, f->grasp_f0_N);
    copy_f3(w.grasp_k_N_m, f->grasp_k_N_m);
    copy_f3(w.grasp_k_N_m + 3, f->grasp_k_N_m + 3);
    for (int k = 0; k < f->n_patch && k < PAL_CONTACT_PATCH_MAX; k++)
        copy_patch(&w.patch[w.n_patch++], &f->patch[k], w.origin_m);
    size_t n = pal_wire_put_haptic(s->buffer, s->cap, &w);
    pal_packet_replace(&s->haptic[i], n ? pal_packet_create(s->buffer, n, false) : NULL);
}

/* A device commands its force at the pose that it sends, and the step that used this pose gives the server's there.
 * dt_s: since the frame before */
static void compare_force(pal_stream *s, int i, const pal_stream_tool *tool, double dt_s)
{
    const pal_frame_tool *f = &s->frame->tool[i];
    const bool known = f->present && tool->holder && f->pose.commands_force;
    const double far_N = known ? pal_dist3(f->pose.force_N, f->end_force_N) : 0;
    double *mean = &s->force_error2_N2[i];
    *mean = known ? *mean + (far_N * far_N - *mean) * -expm1(-dt_s / PAL_FORCE_ERROR_S) : 0;
}

int pal_stream_devices(const pal_stream *stream, const pal_stream_tool tool[PAL_TOOL_MAX], pal_wire_device *device)
{
    int n = 0;
    for (int i = 0; stream->frame && i < stream->frame->n_tool; i++) {
        const pal_frame_tool *f = &stream->frame->tool[i];
        if (!f->present || !tool[i].holder || !(f->pose.commands_force || f->pose.opening != 0)) continue;
        device[n++] = (pal_wire_device){(uint32_t)i, sqrt(stream->force_error2_N2[i]), f->pose.opening};
    }
    return n;
}

const double pal_step_bound_s[PAL_STEP_BOUNDS] = {0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.033, 0.066, 0.13};

static void count_step(pal_stream *stream, double s)
{
    int k = 0;
    while (k < PAL_STEP_BOUNDS && s > pal_step_bound_s[k]) k++;
    stream->n_step[k]++;
    stream->step_sum_s += s;
}

bool pal_stream_update(pal_stream *stream, uint64_t now_ns, const bool used[PAL_STREAM_TIER_COUNT],
                       const pal_stream_tool tool[PAL_TOOL_MAX])
{
    const pal_frame *frame = pal_session_take_frame(stream->session);
    if (!frame) return false;
    stream->frame = frame;
    /* tools of a recording are nobody's: nobody feels their forces at another place */
    static const pal_stream_tool nobody[PAL_TOOL_MAX];
    if (frame->plays) tool = nobody;
    const double dt_s = stream->cycle > 0 && now_ns > stream->cycle_ns ? (double)(now_ns - stream->cycle_ns) * 1e-9 : 0;
    stream->cycle++;
    stream->cycle_ns = now_ns;
    for (int p = 0; p < stream->n_part; p++) {
        const pal_frame_part *part = &frame->part[p];
        if (stream->part[p].slots && part->n_slot == (int)stream->part[p].slots->n_slot)
            pal_triangle_slots_update(stream->part[p].slots, part->slot, part->revision);
        for (int t = 0; t < PAL_STREAM_TIER_COUNT; t++)
            if (used[t]) encode_part(stream, p, t, false);
    }
    put_tools(stream, now_ns, tool);
    for (int i = 0; i < frame->n_tool; i++) {
        compare_force(stream, i, &tool[i], dt_s);
        put_haptic(stream, i, now_ns, &tool[i]);
    }
    /* components have changed, so the entries have other meanings */
    if (frame->n_row != stream->n_component) memset(stream->component_ms, 0, sizeof stream->component_ms);
    stream->n_component = frame->n_row;
    for (int r = 0; r < frame->n_row; r++) {
        stream->component_ms[r] += 0.2 * (frame->component_ns[r] * 1e-6 - stream->component_ms[r]);
        /* below the clock resolution, the mean has decayed to zero */
        if (stream->component_ms[r] < 1e-6) stream->component_ms[r] = 0;
    }
    stream->step_ms += 0.2 * ((double)frame->step_ns * 1e-6 - stream->step_ms);
    /* a frame may show other tools or another state after the same step */
    if (frame->tick != stream->counted_tick) count_step(stream, 1e-9 * (double)frame->step_ns);
    stream->counted_tick = frame->tick;
    return true;
}

/* one message of the newest values; buffers are those of the call */
static pal_packet *encode_field(const pal_stream *s, int p, int k, bool inside)
{
    const pal_stream_part *part = &s->part[p];
    const pal_frame_field *from = &s->frame->part[p].field[k];
    const uint32_t n = inside ? part->n_node : part->info.n_vertex;
    const size_t cap = inside ? pal_interior_bound(n) : pal_field_bound(n);
    size_t n_byte = 0;
    uint8_t *work = malloc(cap + PAL_INTERIOR_NODE_BYTES * (size_t)n),
            *dst = work + PAL_INTERIOR_NODE_BYTES * (size_t)n;
    if (!work) return NULL;
    pal_field_head head = {(uint16_t)p, (pal_wire_field)k, part->info.epoch, time_us(from->time_s), .n_vertex = n};
    pal_interior_head interior = {(uint16_t)p, (pal_wire_field)k, part->info.epoch, time_us(from->time_s), .n_node = n};
    /* twice the error of frames: nobody sees a slice move by a tenth of a millimetre */
    interior.q_m = (float)(4 * part->info.error_m);
    const int refusal = inside ? pal_interior_put(from->node, &interior, work, dst, cap, &n_byte)
                               : pal_field_put(from->value, &head, work, dst, cap, &n_byte);
    pal_packet *packet = refusal ? NULL : pal_packet_create(dst, n_byte, false);
    free(work);
    return packet;
}

static bool make_field(pal_stream *s, int p, int k, bool inside, uint64_t now_ns)
{
    pal_stream_values *to = inside ? &s->part[p].interior[k] : &s->part[p].field[k];
    pal_packet *packet = encode_field(s, p, k, inside);
    double apart_s = 1 / PAL_STREAM_FIELD_HZ;
    if (inside && packet && (double)packet->n_byte / PAL_INTERIOR_BYTES_S > apart_s)
        apart_s = (double)packet->n_byte / PAL_INTERIOR_BYTES_S;
    /* a slightly late message does not delay the next, so the mean rate is kept and exceeded only briefly */
    uint64_t apart = (uint64_t)(1e9 * apart_s), slack = apart / 10;
    to->due_ns = now_ns > to->due_ns + slack ? now_ns + apart - slack : to->due_ns + apart;
    to->revision = s->frame->part[p].field[k].revision;
    if (!packet) return false;
    pal_packet_replace(&to->packet, packet);
    to->made = ++s->field_seq;
    s->count.n_field++;
    return true;
}

/* values of one kind; true: new ones */
static bool update_field(pal_stream *s, int p, int k, bool inside, int n_subscriber, uint64_t now_ns, uint64_t *due_ns)
{
    pal_stream_values *to = inside ? &s->part[p].interior[k] : &s->part[p].field[k];
    const pal_frame_field *from = s->frame ? &s->frame->part[p].field[k] : NULL;
    if (n_subscriber == 0) {
        pal_packet_replace(&to->packet, NULL);
        to->made = to->revision = 0;
        return false;
    }
    if (!from || !(inside ? from->node : from->value) || !from->revision || from->revision == to->revision)
        return false;
    if (now_ns >= to->due_ns) return make_field(s, p, k, inside, now_ns);
    if (!*due_ns || to->due_ns < *due_ns) *due_ns = to->due_ns;
    return false;
}

bool pal_stream_fields(pal_stream *stream, uint64_t now_ns, const pal_stream_subscribers *of, uint64_t *due_ns)
{
    bool any = false;
    *due_ns = 0;
    for (int p = 0; p < stream->n_part; p++)
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++) {
            any = update_field(stream, p, k, false, of->n_field[p][k], now_ns, due_ns) || any;
            any = update_field(stream, p, k, true, of->n_interior[p][k], now_ns, due_ns) || any;
        }
    return any;
}

void pal_stream_begin_tier(pal_stream *stream, int tier)
{
    if (!stream->frame) return;
    for (int p = 0; p < stream->n_part; p++) encode_part(stream, p, tier, true);
}

void pal_stream_measure(pal_stream *stream, uint64_t now_ns)
{
    if (!stream->frame) return;
    uint64_t tick = stream->frame->tick;
    double past_s = (double)(now_ns - stream->rate_ns) * 1e-9;
    if (stream->rate_ns && tick >= stream->rate_tick && past_s > 0)
        stream->step_rate_hz = (double)(tick - stream->rate_tick) / past_s;
    stream->rate_tick = tick;
    stream->rate_ns = now_ns;
}

static void put_instrument(pal_wire_tool_info *out, const pal_tool_def *tool)
{
    if (tool->instrument != PAL_INSTRUMENT_BALL)
        pal_plain_text(out->instrument, sizeof out->instrument, pal_instrument_names[tool->instrument]);
    out->n_trocar = tool->has_trocar ? 3 : 0;
    memcpy(out->trocar_m, tool->trocar_m, sizeof out->trocar_m);
}

void pal_stream_hello(const pal_stream *stream, pal_wire_hello *out)
{
    const pal_scene *scene = stream->scene;
    memset(out, 0, sizeof *out);
    out->version = PAL_PROTOCOL_VERSION;
    pal_plain_text(out->session, sizeof out->session, scene->name);
    pal_plain_text(out->title, sizeof out->title, scene->title);
    pal_plain_text(out->organ, sizeof out->organ, scene->source);
    pal_plain_text(out->accuracy, sizeof out->accuracy, scene->accuracy);
    out->step_rate_hz = 1 / scene->step_s;
    out->frame_rate_hz = pal_stream_rate_hz(stream);
    double size = 0;
    for (int c = 0; c < 3; c++) {
        out->box_min_m[c] = stream->box_min_m[c];
        out->box_max_m[c] = stream->box_max_m[c];
        out->up[c] = scene->up[c];
        size += pow(stream->box_max_m[c] - stream->box_min_m[c], 2);
    }
    pal_plain_text(out->anatomical_axes, sizeof out->anatomical_axes, scene->anatomical_axes);
    out->n_part = (uint32_t)stream->n_part;
    for (int p = 0; p < stream->n_part; p++) out->part[p] = stream->part[p].info;
    out->n_tool = (uint32_t)scene->n_tool;
    for (int t = 0; t < scene->n_tool; t++) {
        pal_plain_text(out->tool[t].name, sizeof out->tool[t].name, scene->tool[t].name);
        /* the world's radius when a frame gives it, else the default of pal_tool_def */
        out->tool[t].force_cap_N = scene->tool[t].force_cap_N;
        put_instrument(&out->tool[t], &scene->tool[t]);
        out->tool[t].radius_m = stream->frame && t < stream->frame->n_tool ? stream->frame->tool[t].radius_m
                                : scene->tool[t].radius_m > 0              ? scene->tool[t].radius_m
                                                                           : 0.04 * sqrt(size);
    }
}
