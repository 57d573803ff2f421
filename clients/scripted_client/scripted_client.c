#include "clients/scripted_client/scripted_client.h"
#include "protocol/field_codec.h"
#include "server/base/clock.h"
#include "server/base/heap.h"
#include "server/base/log.h"
#include "server/base/vec3.h"

#include <stdarg.h>
#include <stdio.h>

/* a client that cannot keep up is served with larger steps, at most this many times the stated error */
#define COARSEST 10.0

typedef struct client_part {
    pal_stored_asset *asset; /* of the current epoch, perhaps not ready */
    uint32_t epoch, seq, n_vertex;
    bool seen, subscribed;  /* subscribed: to a field */
    float *now_m, *first_m; /* [n_vertex][3]; first: of the first frame   */
    bool is_adaptive;
    pal_triangle_table table; /* its triangles                         */
    char name[PAL_WIRE_NAME_BYTES];
    uint8_t *kept; /* newest frame that came before its asset   */
    size_t n_kept;
} client_part;

struct pal_scripted_client {
    pal_asset_store *store;
    pal_scripted_client_options options;
    pal_link *link;
    pal_link_timer *timer;
    pal_script script;
    bool script_made, has_place, ended, stalled;
    double place_m[3], e1[3], e2[3];
    double box_low[3], box_high[3], error_m[PAL_WIRE_PART_MAX];
    uint32_t n_part, cycle, frame_cycle, echo_seq, pose_seq;
    bool cycle_seen;
    int delta_part;                /* part whose TOPOLOGY_DELTA came last and whose frame has not; -1: none */
    uint64_t sim_us, first_sim_us; /* time of the session */
    uint64_t start_ns, hello_ns, first_cycle_ns, stall_ns, last_cycle_ns, first_field_ns;
    double decode_s;
    client_part part[PAL_WIRE_PART_MAX];
    uint16_t id;
    /* the order under way */
    int order;
    bool asked, answered, reshaped, refused; /* reshaped: another topology came since it was given */
    uint64_t asked_ns, answered_ns;
    double gap_ms, given_s, answered_s, moved_m; /* as in pal_order_result */
    pal_wire_answer answer;
    char text[PAL_WIRE_TEXT_BYTES];
    pal_scripted_client_result result;
};

static const struct {
    const char *name, *text;
} fault_table[] = {
#define X(code, sentence) {#code, sentence},
    PAL_FAULT_TABLE(X)
#undef X
};

const char *pal_fault_name(pal_fault fault)
{
    return fault_table[fault].name;
}

const char *const pal_client_seen_name[PAL_CLIENT_SEEN_COUNT] = {
#define X(name, amount) #name,
    PAL_CLIENT_SEEN_TABLE(X)
#undef X
};

void pal_client_seen(const pal_scripted_client_result *r, double seen[PAL_CLIENT_SEEN_COUNT])
{
#define X(name, amount) seen[PAL_CLIENT_SEEN_##name] = amount;
    PAL_CLIENT_SEEN_TABLE(X)
#undef X
}

static void __attribute__((format(printf, 3, 4)))
client_fault(pal_scripted_client *t, pal_fault fault, const char *format, ...)
{
    if (t->result.fault[fault]++ || t->result.first_fault[0]) return;
    char detail[160];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(detail, sizeof detail, format, arguments);
    va_end(arguments);
    snprintf(t->result.first_fault, sizeof t->result.first_fault, "%s: %s", fault_table[fault].text, detail);
}

/* touched place: the vertex furthest along up, for several trainees around it */
static void client_place(pal_scripted_client *t)
{
    const pal_asset *asset = t->part[0].asset->asset;
    double top[3], near[3];
    const double *up = t->options.up;
    if (!pal_asset_extreme_vertex(asset, up, top)) return;
    pal_copy3(near, top);
    const double turn = 2.399963 * t->options.index, size = pal_dist3(t->box_low, t->box_high);
    const double reach = t->options.index ? 0.06 * size : 0;
    pal_axpy3(near, reach * cos(turn), t->e1);
    pal_axpy3(near, reach * sin(turn), t->e2);
    if (!pal_asset_extreme_vertex_near(asset, up, near, 0.03 * size, t->place_m)) pal_copy3(t->place_m, top);
    t->has_place = true;
}

static void client_measure(pal_scripted_client *t, client_part *part)
{
    const double *low = t->box_low, *high = t->box_high;
    for (uint32_t i = 0; i < part->n_vertex; i++) {
        const float *p = part->now_m + 3 * (size_t)i, *f = part->first_m + 3 * (size_t)i;
        double moved = 0;
        for (int k = 0; k < 3; k++) {
            /* a free body may drift by a metre while its damping stops it */
            const double size = high[k] - low[k] + 1;
            if (!(p[k] > low[k] - size && p[k] < high[k] + size)) {
                client_fault(t, PAL_FAULT_PLACE, "vertex %u axis %d at %g m", i, k, (double)p[k]);
                return;
            }
            moved += (double)(p[k] - f[k]) * (double)(p[k] - f[k]);
        }
        if (moved > t->result.moved_m * t->result.moved_m) t->result.moved_m = sqrt(moved);
    }
}

/* how far a vertex of an order's body, the first part when it names none, is at most from its first place */
static double client_moved(const pal_scripted_client *t, const char *target)
{
    double moved = 0;
    uint32_t p = 0;
    while (p < t->n_part && target[0] && strcmp(t->part[p].name, target)) p++;
    const client_part *part = &t->part[p];
    for (uint32_t i = 0; p < t->n_part && part->seen && i < part->n_vertex; i++) {
        const float *a = part->now_m + 3 * (size_t)i, *b = part->first_m + 3 * (size_t)i;
        moved = fmax(moved, pal_dist3((const double[]){a[0], a[1], a[2]}, (const double[]){b[0], b[1], b[2]}));
    }
    return moved;
}

/* time of the session since the first cycle */
static double client_session_s(const pal_scripted_client *t)
{
    return (double)(t->sim_us - t->first_sim_us) * 1e-6;
}

/* what came of the order under way, once it is answered and what it changed is seen */
static void client_report(pal_scripted_client *t)
{
    if (!t->asked || !t->answered || (t->reshaped && !t->part[0].seen)) return;
    const pal_order_line *line = &t->options.orders->line[t->order++];
    const uint64_t now = pal_clock_ns();
    const pal_order_result reported = {.line = line,
                                       .answer = t->refused ? NULL : &t->answer,
                                       .text = t->text,
                                       .answer_ms = (double)(t->answered_ns - t->asked_ns) * 1e-6,
                                       .frame_ms = t->reshaped ? (double)(now - t->asked_ns) * 1e-6 : 0,
                                       .gap_ms = t->gap_ms,
                                       .given_s = t->given_s,
                                       .answered_s = t->answered_s,
                                       .moved_m = t->moved_m,
                                       .epoch = t->part[0].epoch,
                                       .n_vertex = t->part[0].n_vertex};
    t->asked = false;
    t->result.n_order++;
    if (t->refused && !line->may_fail && t->result.n_refused++ == 0)
        snprintf(t->result.refused, sizeof t->result.refused, "line %d: %.200s", line->number, t->text);
    if (t->options.reported) t->options.reported(t->options.user, &reported);
}

static void client_answered(pal_scripted_client *t, const pal_control *c)
{
    if (!t->asked || t->answered) return;
    t->refused = c->type == PAL_CONTROL_ERROR;
    if (!t->refused) t->answer = c->answer;
    snprintf(t->text, sizeof t->text, "%s", t->refused ? c->error.text : c->answer.text);
    t->answered = true;
    t->answered_ns = pal_clock_ns();
    t->answered_s = client_session_s(t);
    client_report(t);
}

/* gives the next order when the session has reached its time and the one before is done */
static void client_order(pal_scripted_client *t, uint64_t now)
{
    const pal_orders *orders = t->options.orders;
    const client_part *part = &t->part[0];
    if (!orders || t->order >= orders->n_line || t->asked || !t->cycle_seen || !part->seen) return;
    if (client_session_s(t) < orders->line[t->order].t_s) return;
    pal_control c = {.type = PAL_CONTROL_COMMAND};
    if (!pal_order_fill(&orders->line[t->order], part->now_m, part->n_vertex, &c.command)) return;
    if (pal_link_send_control(t->link, &c)) return;
    t->asked = true;
    t->answered = t->reshaped = t->refused = false;
    t->asked_ns = now;
    t->gap_ms = 0;
    t->given_s = client_session_s(t);
    t->moved_m = client_moved(t, c.command.target);
}

static void client_decode(pal_scripted_client *t, uint32_t index, const uint8_t *bytes, size_t n_byte)
{
    client_part *part = &t->part[index];
    pal_frame_head head;
    const double start = pal_clock_s();
    const int refusal = pal_frame_get(part->asset->decoder, bytes, n_byte, &head, part->now_m);
    t->decode_s += pal_clock_s() - start;
    if (refusal) {
        client_fault(t, PAL_FAULT_DECODE, "part %u: %s", index, pal_refusal_text(refusal));
        return;
    }
    t->result.n_frame++;
    if (!part->seen) memcpy(part->first_m, part->now_m, (size_t)part->n_vertex * 3 * sizeof(float));
    part->seen = true;
    client_measure(t, part);
    client_report(t);
    /* q = 2 e / (1 + 1/16 + 1/64), protocol README "FRAME" */
    const double error = (double)head.q_m * (1 + 1.0 / 16 + 1.0 / 64) / 2;
    const double stated = t->error_m[index];
    if (stated > 0 && error > stated * 1.001) t->result.n_coarse++;
    if (stated > 0 && error > stated * COARSEST * 1.001)
        client_fault(t, PAL_FAULT_BOUND, "part %u: %g m, stated %g m", index, error, stated);
}

static void client_frame(pal_scripted_client *t, const uint8_t *bytes, size_t n_byte)
{
    pal_frame_head head;
    const int refusal = pal_frame_get_head(bytes, n_byte, &head);
    if (refusal) {
        client_fault(t, PAL_FAULT_DECODE, "head: %s", pal_refusal_text(refusal));
        return;
    }
    if (head.part >= t->n_part) {
        client_fault(t, PAL_FAULT_PART, "part %u of %u", head.part, t->n_part);
        return;
    }
    client_part *part = &t->part[head.part];
    if (t->delta_part >= 0 && t->delta_part != (int)head.part)
        client_fault(t, PAL_FAULT_TOPOLOGY_DELTA, "of part %d, before a frame of part %u", t->delta_part, head.part);
    t->delta_part = -1;
    if (head.cycle > t->frame_cycle) t->frame_cycle = head.cycle;
    if (head.epoch < part->epoch && !part->seen && !part->n_kept) return; /* on its way when the topology changed */
    if (part->n_kept || part->seen) {
        if (head.epoch < part->epoch)
            client_fault(t, PAL_FAULT_EPOCH, "epoch %u after %u", head.epoch, part->epoch);
        else if (head.seq <= part->seq && head.epoch == part->epoch)
            client_fault(t, PAL_FAULT_SEQ, "part %u: seq %u after %u", head.part, head.seq, part->seq);
    }
    part->seq = head.seq;
    if (head.epoch == part->epoch && part->asset && part->asset->ready) {
        client_decode(t, head.part, bytes, n_byte);
        return;
    }
    uint8_t *kept = realloc(part->kept, n_byte);
    if (!kept) return;
    memcpy(kept, bytes, n_byte);
    part->kept = kept;
    part->n_kept = n_byte;
}

static void client_latency(pal_scripted_client *t, const pal_wire_tool *own, uint64_t now_ns)
{
    const double force = sqrt((double)own->force_N[0] * own->force_N[0] + (double)own->force_N[1] * own->force_N[1] +
                              (double)own->force_N[2] * own->force_N[2]);
    if (force > t->result.force_N) t->result.force_N = force;
    if (own->echo_seq == 0 || own->echo_seq == t->echo_seq || own->echo_seq > t->pose_seq) return;
    t->echo_seq = own->echo_seq;
    pal_samples_add(&t->result.latency_ms, ((double)now_ns / 1e3 - (double)own->echo_stamp_us) / 1e3);
}

/* cycles that come right after a stall: the pose they show was sent before reading began again */
static void client_after_stall(pal_scripted_client *t, const pal_wire_tool *own, uint64_t now_ns)
{
    if (!t->result.stall_done || !own || own->echo_seq == 0) return;
    if ((double)(now_ns / 1000) - (double)own->echo_stamp_us > t->options.stall_s * 5e5 &&
        now_ns - t->stall_ns < 2000000000)
        t->result.n_old_after_stall++;
}

static void client_tools(pal_scripted_client *t, const uint8_t *bytes, size_t n_byte)
{
    pal_wire_tools tools;
    const uint64_t now = pal_clock_ns();
    const int refusal = pal_wire_get_tools(bytes, n_byte, &tools);
    if (refusal) {
        client_fault(t, PAL_FAULT_MALFORMED, "TOOLS: %s", pal_refusal_text(refusal));
        return;
    }
    /* a cycle may come again, with the frames of another accuracy */
    if (t->cycle_seen && tools.cycle < t->cycle)
        client_fault(t, PAL_FAULT_CYCLE, "cycle %u after %u", tools.cycle, t->cycle);
    /* a frame may have waited for credit, so its cycle may lie before the one that it came in, never behind */
    if (t->frame_cycle > tools.cycle)
        client_fault(t, PAL_FAULT_CYCLE, "frame of cycle %u before cycle %u", t->frame_cycle, tools.cycle);
    if (t->delta_part >= 0)
        client_fault(t, PAL_FAULT_TOPOLOGY_DELTA, "of part %d, before the end of its cycle", t->delta_part);
    t->delta_part = -1;
    t->frame_cycle = 0;
    t->cycle = tools.cycle;
    t->sim_us = tools.sim_time_us;
    const double gap_ms = t->cycle_seen ? (double)(now - t->last_cycle_ns) * 1e-6 : 0;
    t->gap_ms = fmax(t->gap_ms, gap_ms);
    if (t->cycle_seen)
        pal_samples_add(&t->result.gap_ms, gap_ms);
    else
        t->first_cycle_ns = now, t->first_sim_us = tools.sim_time_us;
    t->last_cycle_ns = now;
    t->cycle_seen = true;
    t->result.n_cycle++;
    t->result.n_cycle_after_stall += t->result.stall_done;
    t->result.n_cycle_since_topology += t->part[0].seen;
    const int tool = t->result.tool;
    const bool own = tool >= 0 && (uint32_t)tool < tools.n_tool && tools.tool[tool].holder == t->id;
    if (own) client_latency(t, &tools.tool[tool], now);
    client_after_stall(t, own ? &tools.tool[tool] : NULL, now);
    pal_samples_add(&t->result.decode_ms, t->decode_s * 1e3);
    const pal_wire_ack ack = {tools.cycle, (uint32_t)(t->decode_s * 1e6)};
    t->decode_s = 0;
    pal_link_send_ack(t->link, &ack);
}

static void client_topology_delta(pal_scripted_client *t, const uint8_t *bytes, size_t n_byte)
{
    pal_topology_delta_head head;
    int refusal = pal_topology_delta_get_head(bytes, n_byte, &head);
    if (!refusal && (head.part >= t->n_part || !t->part[head.part].is_adaptive)) refusal = PAL_REFUSAL_KIND;
    if (!refusal && head.epoch < t->part[head.part].epoch) {
        t->delta_part = (int)head.part;
        return;
    }
    if (!refusal && head.epoch != t->part[head.part].epoch) refusal = PAL_REFUSAL_EPOCH;
    if (!refusal) refusal = pal_triangle_table_apply(&t->part[head.part].table, bytes, n_byte, &head);
    if (refusal) {
        client_fault(t, PAL_FAULT_TOPOLOGY_DELTA, "%s", pal_refusal_text(refusal));
        return;
    }
    if (t->delta_part >= 0) client_fault(t, PAL_FAULT_TOPOLOGY_DELTA, "of part %d, before another", t->delta_part);
    t->delta_part = (int)head.part;
    t->result.n_delta++;
    t->result.delta_bytes += n_byte;
}

static void client_field(pal_scripted_client *t, const uint8_t *bytes, size_t n_byte)
{
    pal_field_head head;
    int refusal = pal_field_get_head(bytes, n_byte, &head);
    if (!refusal && (head.part >= t->n_part || !t->part[head.part].subscribed)) refusal = PAL_REFUSAL_KIND;
    if (!refusal && t->options.field && head.field != pal_wire_field_find(t->options.field)) refusal = PAL_REFUSAL_KIND;
    if (!refusal && head.epoch < t->part[head.part].epoch) return;
    if (!refusal && head.epoch != t->part[head.part].epoch) refusal = PAL_REFUSAL_EPOCH;
    if (!refusal && head.low < 0 && head.field < PAL_WIRE_FIELD_STRAIN) refusal = PAL_REFUSAL_RANGE;
    uint8_t *level = refusal ? NULL : malloc((size_t)t->part[head.part].n_vertex + 1);
    if (level) refusal = pal_field_get(bytes, n_byte, t->part[head.part].n_vertex, &head, level);
    free(level);
    if (refusal) {
        client_fault(t, PAL_FAULT_FIELD, "%s", pal_refusal_text(refusal));
        return;
    }
    pal_scripted_client_result *r = &t->result;
    const uint64_t now = pal_clock_ns();
    if (r->n_field++ == 0) {
        t->first_field_ns = now;
        r->field_low = (double)head.low;
    }
    r->field_low = fmin(r->field_low, (double)head.low);
    r->field_high = fmax(r->field_high, (double)head.high);
    r->field_bytes += n_byte;
    r->field_s = (double)(now - t->first_field_ns) * 1e-9;
}

/* asks for the field of every part that gives it; a server of before fields is asked for nothing */
static void client_subscribe(pal_scripted_client *t, const pal_wire_part_info *info, uint32_t n_part)
{
    for (uint32_t i = 0; i < n_part && t->options.field; i++) {
        t->part[i].subscribed = false;
        for (uint32_t k = 0; k < info[i].n_field; k++)
            t->part[i].subscribed = t->part[i].subscribed || !strcmp(info[i].field[k], t->options.field);
        if (!t->part[i].subscribed) continue;
        pal_control ask = {.type = PAL_CONTROL_SUBSCRIBE_FIELD, .field_subscription = {.part = i}};
        snprintf(ask.field_subscription.field, sizeof ask.field_subscription.field, "%s", t->options.field);
        t->result.field_given = true;
        if (pal_link_send_control(t->link, &ask)) client_fault(t, PAL_FAULT_FIELD, "it cannot be asked for");
    }
}

static void client_on_message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    pal_scripted_client *t = user;
    pal_wire_haptic haptic;
    if (head->kind == PAL_WIRE_FRAME) client_frame(t, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOOLS) client_tools(t, bytes, n_byte);
    if (head->kind == PAL_WIRE_FIELD) client_field(t, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOPOLOGY_DELTA) client_topology_delta(t, bytes, n_byte);
    if (head->kind == PAL_WIRE_HAPTIC && pal_wire_get_haptic(bytes, n_byte, &haptic))
        client_fault(t, PAL_FAULT_MALFORMED, "HAPTIC");
}

/* the table of a part that adapts begins at its asset again, with every connection */
static void client_table(pal_scripted_client *t, const pal_wire_part_info *info, uint32_t i)
{
    client_part *part = &t->part[i];
    pal_triangle_table_free(&part->table);
    part->is_adaptive = info->is_adaptive;
    if (!info->is_adaptive) return;
    const pal_err err = pal_triangle_table_init(&part->table, info->n_triangle, info->n_vertex);
    if (err)
        client_fault(t, PAL_FAULT_TOPOLOGY_DELTA, "part %u of %u slots: %s", i, info->n_triangle, pal_err_text(err));
}

/* parts as hello or topology name them; buffers follow */
static void client_parts(pal_scripted_client *t, const pal_wire_part_info *info, uint32_t n_part)
{
    t->n_part = n_part;
    for (uint32_t i = 0; i < n_part; i++) {
        client_part *part = &t->part[i];
        t->error_m[i] = info[i].error_m;
        snprintf(part->name, sizeof part->name, "%s", info[i].name);
        part->asset = pal_asset_store_request(t->store, info[i].asset);
        client_table(t, &info[i], i);
        if (part->now_m && part->epoch == info[i].epoch && part->n_vertex == info[i].n_vertex) continue;
        PAL_FREE(part->now_m, part->first_m);
        part->epoch = info[i].epoch;
        part->n_vertex = info[i].n_vertex;
        part->seen = false;
        pal_frame_head kept;
        if (part->n_kept && !pal_frame_get_head(part->kept, part->n_kept, &kept) && kept.epoch < part->epoch)
            part->n_kept = 0;
        part->now_m = calloc((size_t)part->n_vertex + 1, 3 * sizeof(float));
        part->first_m = calloc((size_t)part->n_vertex + 1, 3 * sizeof(float));
        if (!part->now_m || !part->first_m) t->n_part = i;
    }
    for (uint32_t i = 0; i < t->n_part; i++)
        if (t->part[i].asset && (t->part[i].asset->ready || t->part[i].asset->failed))
            pal_scripted_client_asset_changed(t, t->part[i].asset);
}

static void client_hello(pal_scripted_client *t, const pal_wire_hello *hello)
{
    t->id = hello->you_id;
    t->result.joined = true;
    t->hello_ns = t->hello_ns ? t->hello_ns : pal_clock_ns();
    pal_copy3(t->box_low, hello->box_min_m);
    pal_copy3(t->box_high, hello->box_max_m);
    t->cycle_seen = false;
    t->asked = false; /* an order that was under way is given again */
    t->delta_part = -1;
    t->frame_cycle = 0; /* the connection of before may have ended between a frame and its cycle */
    t->decode_s = 0;
    t->result.n_cycle_since_topology = 0;
    t->echo_seq = 0;
    for (uint32_t i = 0; i < PAL_WIRE_PART_MAX; i++) {
        t->part[i].seq = 0;
        t->part[i].n_kept = 0;
        t->part[i].seen = false;
    }
    if (!t->script_made) {
        const int tool = hello->you_tool >= 0 && (uint32_t)hello->you_tool < hello->n_tool ? hello->you_tool : 0;
        const double radius = hello->n_tool > 0 ? hello->tool[tool].radius_m : 0.01;
        double depth = t->options.depth_m;
        if (!(depth > 0))
            depth = fmin(0.01, 0.08 * fabs(pal_dot3(t->box_high, t->options.up) - pal_dot3(t->box_low, t->options.up)));
        pal_diagnostic diag;
        if (pal_script_load(&t->script, t->options.script, radius, depth, &diag)) return;
        t->script_made = true;
    }
    client_parts(t, hello->part, hello->n_part);
    client_subscribe(t, hello->part, t->n_part);
}

static void client_on_control(void *user, const pal_control *c)
{
    pal_scripted_client *t = user;
    if (c->type == PAL_CONTROL_HELLO || c->type == PAL_CONTROL_MEMBERS) t->result.tool = pal_link_tool(t->link);
    if (c->type == PAL_CONTROL_MEMBERS) t->result.n_member = c->members.n_member;
    if (c->type == PAL_CONTROL_MOVE) pal_asset_store_move(t->store, c->move.address, c->move.session);
    if (c->type == PAL_CONTROL_HELLO) client_hello(t, &c->hello);
    if (c->type == PAL_CONTROL_TOPOLOGY) {
        t->result.n_topology++;
        t->result.n_cycle_since_topology = 0;
        t->reshaped = true;
        client_parts(t, c->topology.part, c->topology.n_part);
    }
    if (c->type == PAL_CONTROL_ERROR && !t->asked) pal_log(PAL_LOG_WARN, "server", "%s", c->error.text);
    if (c->type == PAL_CONTROL_ANSWER || c->type == PAL_CONTROL_ERROR) client_answered(t, c);
}

static void client_on_state(void *user, pal_link_state state, int code, const char *reason)
{
    pal_scripted_client *t = user;
    if (state != PAL_LINK_LOST && state != PAL_LINK_ENDED) return;
    char *text = t->result.closed;
    const int n = code ? snprintf(text, sizeof t->result.closed, "%d ", code) : 0; /* 0: nothing was closed */
    snprintf(text + n, sizeof t->result.closed - (size_t)n, "%.150s", reason);
    if (state == PAL_LINK_ENDED) {
        t->ended = true;
        client_fault(t, PAL_FAULT_CLOSED, "%d %.120s", code, reason);
    }
}

static void client_on_fault(void *user, int refusal)
{
    client_fault(user, PAL_FAULT_MALFORMED, "%s", pal_refusal_text(refusal));
}

void pal_scripted_client_asset_changed(pal_scripted_client *t, const pal_stored_asset *asset)
{
    for (uint32_t i = 0; i < t->n_part; i++) {
        client_part *part = &t->part[i];
        if (part->asset != asset) continue;
        if (asset->failed || asset->asset->order->n_vertex != part->n_vertex) {
            client_fault(t, PAL_FAULT_ASSET, "%s: %s", asset->path, asset->failed ? asset->reason : "vertex count");
            continue;
        }
        if (part->is_adaptive && pal_triangle_table_set_base(&part->table, asset->asset))
            client_fault(t, PAL_FAULT_ASSET, "%s: another table of triangles", asset->path);
        t->result.asset_bytes += asset->n_byte;
        if (i == 0 && !t->has_place) client_place(t);
        if (part->n_kept) {
            pal_frame_head head;
            if (!pal_frame_get_head(part->kept, part->n_kept, &head) && head.epoch == part->epoch)
                client_decode(t, i, part->kept, part->n_kept);
            part->n_kept = 0;
        }
    }
}

/* the stall: one second after the first cycle nothing is read for stall_s */
static void client_stall(pal_scripted_client *t, uint64_t now)
{
    if (!(t->options.stall_s > 0) || t->first_cycle_ns == 0 || t->result.stall_done) return;
    if (!t->stalled && now - t->first_cycle_ns > 1000000000) {
        t->stalled = true;
        t->stall_ns = now;
        pal_link_pause_reading(t->link, true);
    } else if (t->stalled && (double)(now - t->stall_ns) * 1e-9 > t->options.stall_s) {
        t->stalled = false;
        t->result.stall_done = true;
        t->stall_ns = now;
        pal_link_pause_reading(t->link, false);
    }
}

static void client_tick(void *user)
{
    pal_scripted_client *t = user;
    const uint64_t now = pal_clock_ns();
    client_stall(t, now);
    client_order(t, now);
    if (!t->script_made || t->script.idle || !t->has_place || t->result.tool < 0) return;
    if (!t->start_ns) t->start_ns = now;
    double offset[3];
    pal_wire_pose pose = {.tool = (uint16_t)t->result.tool, .quaternion = {1, 0, 0, 0}};
    pal_script_at(&t->script, (double)(now - t->start_ns) * 1e-9, offset, &pose.buttons);
    pal_copy3(pose.position_m, t->place_m);
    pal_axpy3(pose.position_m, offset[0], t->e1);
    pal_axpy3(pose.position_m, offset[1], t->e2);
    pal_axpy3(pose.position_m, offset[2], t->options.up);
    pose.seq = t->pose_seq + 1;
    pose.stamp_us = pal_clock_ns() / 1000;
    if (pal_link_send_pose(t->link, &pose)) return;
    t->pose_seq++;
    t->result.n_pose++;
}

pal_err pal_scripted_client_open(pal_link_loop *loop, pal_asset_store *store,
                                 const pal_scripted_client_options *options, pal_diagnostic *diag,
                                 pal_scripted_client **out)
{
    static const pal_link_events events = {
        .state = client_on_state, .control = client_on_control, .message = client_on_message, .fault = client_on_fault};
    pal_scripted_client *t = calloc(1, sizeof *t);
    if (!t) return PAL_ERR_MEMORY;
    *t = (pal_scripted_client){.store = store, .options = *options, .result.tool = PAL_WIRE_TOOL_NONE};
    /* a frame around up; the script is read once here so that a bad file is refused at the start */
    const double *up = options->up;
    const double other[3] = {fabs(up[0]) < 0.9, fabs(up[0]) >= 0.9, 0};
    pal_cross3(t->e2, up, other);
    pal_err err = pal_unit3(t->e2, t->e2, 1e-9) ? PAL_ERR_OK : PAL_REFUSE(diag, "up is zero");
    pal_cross3(t->e1, t->e2, up);
    if (!err) err = pal_script_load(&t->script, options->script, 0.01, 0.01, diag);
    const pal_link_options link = {.url = options->url,
                                   .name = options->name,
                                   .role = options->orders ? PAL_WIRE_ROLE_INSTRUCTOR : PAL_WIRE_ROLE_TRAINEE,
                                   .tool = t->script.idle ? PAL_WIRE_TOOL_NONE : options->tool,
                                   .topology_deltas = true,
                                   .read_bytes_s = options->read_bytes_s,
                                   .events = &events,
                                   .user = t};
    if (!err) err = pal_link_open(loop, &link, diag, &t->link);
    if (!err) t->timer = pal_link_add_timer(loop, (uint64_t)(1e6 / options->rate_hz), client_tick, t);
    if (!err && !t->timer) err = PAL_ERR_MEMORY;
    if (err) {
        pal_link_close(t->link);
        free(t);
        return err;
    }
    *out = t;
    return PAL_ERR_OK;
}

void pal_scripted_client_destroy(pal_scripted_client *t)
{
    if (!t) return;
    for (int i = 0; i < PAL_WIRE_PART_MAX; i++) {
        PAL_FREE(t->part[i].now_m, t->part[i].first_m, t->part[i].kept);
        pal_triangle_table_free(&t->part[i].table);
    }
    pal_samples_free(&t->result.latency_ms);
    pal_samples_free(&t->result.decode_ms);
    pal_samples_free(&t->result.gap_ms);
    free(t);
}

const pal_scripted_client_result *pal_scripted_client_get_result(pal_scripted_client *t)
{
    if (t->link && !t->ended) {
        const pal_link_counts counts = pal_link_count(t->link);
        t->result.bytes_in = counts.bytes_in;
        t->result.joins = counts.joins;
    }
    t->result.n_triangle = t->result.n_slot = 0;
    for (uint32_t i = 0; i < t->n_part; i++) {
        t->result.n_triangle += pal_triangle_table_count(&t->part[i].table);
        t->result.n_slot += t->part[i].table.n_slot;
    }
    t->result.seconds = t->hello_ns ? (double)(pal_clock_ns() - t->hello_ns) * 1e-9 : 0;
    return &t->result;
}

bool pal_scripted_client_has_ended(const pal_scripted_client *t)
{
    return t->ended;
}
