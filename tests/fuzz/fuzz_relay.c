/* Whatever upstream says, in any order: what a relay keeps of it, and two viewers who take it at their own pace. The
 * triangles of the relay are those of upstream after each cycle, and those of a viewer are the relay's when it has
 * taken all. Input: records of one byte what, two bytes length (little endian) and as many bytes. What, modulo 8: 0 a
 * binary message; 1 a text message; 2 hello and 3 topology of one part that adapts, by bytes: epoch, and flags (1 its
 * asset comes at once; 2 another run; 4 it does not adapt; 8 another number of triangles); 4 the asset comes; 5 a cycle
 * of the epoch, after a TOPOLOGY_DELTA of slots and corners, four bytes each; 6 and 7 a viewer takes all that there is
 * for it. */
#include "clients/relay/relay_viewers.h"
#include "protocol/frame_codec.h"
#include "server/base/log.h"
#include "tests/fixtures/manual_clock.h"
#include "tests/net/mem_transport.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

enum { VERTICES = 8, SLOTS = 12, VIEWERS = 2 };

typedef struct guest {
    pal_mem_peer *peer;
    bool begun;                    /* it has had hello */
    uint32_t epoch, tri[SLOTS][3]; /* of its part */
} guest;

static pal_relay_kept kept;
static manual_clock now;
static pal_loop *loop;
static pal_relay_viewers *viewers;
static pal_transport *down;
static guest of[VIEWERS];
/* upstream */
static uint8_t *asset, frame[512];
static size_t n_asset;
static char path[PAL_WIRE_NAME_BYTES];
static pal_frame_encoder *encoder;
static float rest_m[VERTICES][3];
static uint32_t start[SLOTS][3], table[SLOTS][3];
static uint32_t epoch, started, seq, cycle;
static uint64_t revision;
static bool at_once, honest; /* honest: nothing but what is made here has come */

static void ignore(void *user)
{
    (void)user;
}

static void bring_asset(void *user, const char *wanted)
{
    (void)user;
    if (at_once && !strcmp(wanted, path)) (void)pal_relay_take_asset(&kept, path, asset, n_asset);
}

static void make_upstream(void)
{
    char hash[PAL_ASSET_HASH_CHARS];
    pal_frame_order *order = pal_frame_order_allocate(VERTICES, 1);
    if (!order) abort();
    pal_log_set_level(PAL_LOG_ERROR);
    order->level_begin[0] = 0, order->level_begin[1] = VERTICES;
    for (uint32_t i = 0; i < VERTICES; i++) order->vertex_of[i] = i, rest_m[i][i % 3] = 0.01f * (float)i;
    for (uint32_t k = 0; k < SLOTS / 2; k++)
        for (uint32_t c = 0; c < 3; c++) start[k][c] = (k + c) % VERTICES;
    if (pal_asset_encode(rest_m[0], NULL, NULL, order, start[0], SLOTS, &asset, &n_asset)) abort();
    if (pal_frame_encoder_create(rest_m[0], order, &encoder)) abort();
    pal_asset_hash(asset, n_asset, hash);
    snprintf(path, sizeof path, "/asset/%s", hash);
    pal_frame_order_destroy(order);
}

static void report(const pal_control *message)
{
    static char text[PAL_CONTROL_OUT_MAX + 1];
    size_t n = 0;
    if (!pal_control_put(text, sizeof text, message, &n)) pal_relay_take_text(&kept, message, text, n);
}

/* a connection begins with the triangles of the asset, and so does an epoch */
static void announce(bool hello, uint8_t new_epoch, uint8_t flags)
{
    static pal_control message;
    pal_wire_part_info part = {.name = "p", .epoch = new_epoch, .n_vertex = VERTICES, .error_m = 1e-4};
    part.n_triangle = SLOTS + (flags & 8 ? 1 : 0), part.is_adaptive = !(flags & 4);
    snprintf(part.asset, sizeof part.asset, "%s", path);
    snprintf(part.field[part.n_field++], PAL_WIRE_FIELD_BYTES, "energy");
    message = (pal_control){.type = hello ? PAL_CONTROL_HELLO : PAL_CONTROL_TOPOLOGY};
    if (hello) {
        started += flags >> 1 & 1;
        message.hello = (pal_wire_hello){.version = 2,
                                         .session = "s",
                                         .step_rate_hz = 60,
                                         .frame_rate_hz = 30,
                                         .credit = 3,
                                         .up = {0, 0, 1},
                                         .n_part = 1,
                                         .part = {part},
                                         .started = started,
                                         .you_id = 1,
                                         .you_tool = PAL_WIRE_TOOL_NONE};
    } else
        message.topology = (pal_wire_topology){.n_part = 1, .part = {part}};
    at_once = flags & 1;
    /* one part of an epoch is announced in two ways, or an epoch comes again */
    honest = honest && !(flags & 12) && (hello || new_epoch >= epoch);
    if (hello || new_epoch != epoch) memcpy(table, start, sizeof table);
    if (hello) revision = 0; /* upstream may be another relay, which counts anew */
    epoch = new_epoch;
    report(&message);
}

static void pass(const uint8_t *bytes, size_t n)
{
    pal_wire_head head;
    if (!pal_wire_get_head(bytes, n, &head)) pal_relay_take_message(&kept, &head, bytes, n);
}

static void send_cycle(const uint8_t *change, size_t n)
{
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(SLOTS)], out[1024];
    bool changed[SLOTS] = {false};
    uint32_t slot[SLOTS];
    pal_topology_delta_head delta = {.epoch = epoch, .revision = ++revision};
    pal_frame_result made;
    size_t n_out = 0;
    for (; n >= 4; change += 4, n -= 4) {
        const uint32_t k = change[0] % SLOTS;
        changed[k] = true;
        for (int c = 0; c < 3; c++) table[k][c] = change[1 + c] % VERTICES;
    }
    for (uint32_t k = 0; k < SLOTS; k++)
        if (changed[k]) slot[delta.n_changed++] = k;
    if (delta.n_changed && !pal_topology_delta_put(slot, table[0], &delta, work, out, sizeof out, &n_out))
        pass(out, n_out);
    const pal_frame_input input = {
        .epoch = epoch, .seq = ++seq, .cycle = ++cycle, .error_m = 1e-4, .position_m = rest_m[0]};
    if (pal_frame_put(encoder, &input, frame, sizeof frame, &made)) abort();
    pass(frame, made.n_byte);
    pass(out, pal_wire_put_tools(out, sizeof out, &(pal_wire_tools){.cycle = cycle}));
    const pal_triangle_slots *shown = kept.triangles[0].slots;
    if (honest && shown && shown->epoch == epoch && memcmp(shown->tri, table, sizeof table)) abort();
}

static void join(guest *g)
{
    static const char text[] = "{\"type\":\"join\",\"name\":\"g\",\"role\":\"viewer\",\"topology_deltas\":true}";
    static const char see[] = "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"energy\",\"interior\":true}";
    if (g->peer) pal_mem_leave(g->peer);
    *g = (guest){.peer = pal_mem_connect(down, "")};
    pal_mem_send(g->peer, text, sizeof text - 1, true);
    pal_mem_send(g->peer, see, sizeof see - 1, true);
}

static void take_text(guest *g, const pal_packet *p)
{
    static pal_control in;
    if (pal_control_get((const char *)p->bytes, p->n_byte, true, &in)) abort();
    const pal_wire_part_info *part = in.type == PAL_CONTROL_HELLO      ? in.hello.part
                                     : in.type == PAL_CONTROL_TOPOLOGY ? in.topology.part
                                                                       : NULL;
    if (!part || (g->begun && part->epoch == g->epoch)) return;
    g->begun = true;
    g->epoch = part->epoch;
    memcpy(g->tri, start, sizeof start);
}

/* what a viewer has after a cycle is what the relay shows */
static void take_all(guest *g)
{
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(SLOTS)];
    pal_relay_view wanted;
    (void)pal_relay_next_request(&kept, 0, &wanted);
    if (!g->peer || pal_mem_code(g->peer)) join(g);
    for (const pal_packet *p; (p = pal_mem_receive(g->peer));) {
        pal_topology_delta_head delta;
        pal_wire_tools tools;
        uint8_t ack[PAL_WIRE_ACK_BYTES];
        pal_wire_head head;
        if (p->text) {
            take_text(g, p);
            continue;
        }
        if (pal_wire_get_head(p->bytes, p->n_byte, &head)) abort();
        if (head.kind == PAL_WIRE_TOPOLOGY_DELTA &&
            (pal_topology_delta_get(p->bytes, p->n_byte, SLOTS, VERTICES, work, &delta, g->tri[0]) ||
             delta.epoch != g->epoch))
            abort();
        if (head.kind != PAL_WIRE_TOOLS || pal_wire_get_tools(p->bytes, p->n_byte, &tools)) continue;
        pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = tools.cycle});
        pal_mem_send(g->peer, ack, sizeof ack, false);
        const pal_triangle_slots *shown = kept.triangles[0].slots;
        if (shown && kept.frame[0].packet && shown->epoch == g->epoch && memcmp(shown->tri, g->tri, sizeof g->tri))
            abort();
    }
}

static void record(uint8_t what, const uint8_t *bytes, size_t n)
{
    static pal_control message;
    honest = honest && what % 8 > 1;
    if (what % 8 == 0) pass(bytes, n);
    if (what % 8 == 1 && !pal_control_get((const char *)bytes, n, true, &message))
        pal_relay_take_text(&kept, &message, (const char *)bytes, n);
    if ((what % 8 == 2 || what % 8 == 3) && n >= 2) announce(what % 8 == 2, bytes[0], bytes[1]);
    if (what % 8 == 4) (void)pal_relay_take_asset(&kept, path, asset, n_asset);
    if (what % 8 == 5) send_cycle(bytes, n);
    if (what % 8 >= 6) take_all(&of[what % 8 - 6]);
    manual_clock_advance(&now, 16666667);
    pal_loop_advance(loop);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static const pal_relay_options options = {.max_viewers = VIEWERS};
    pal_listen_address nowhere = {.ip = ""};
    pal_peer_events events;
    if (!asset) make_upstream();
    manual_clock_init(&now, 1000000000u);
    pal_relay_kept_init(&kept, ignore, NULL);
    pal_relay_kept_fetch_by(&kept, bring_asset, NULL);
    if (pal_loop_create(false, 0, false, &now.clock, NULL, &loop)) abort();
    if (pal_relay_viewers_create(loop, &kept, &options, NULL, &viewers)) abort();
    pal_relay_viewers_events(viewers, &events);
    if (pal_mem_transport.open(loop, &nowhere, &events, NULL, &down)) abort();
    epoch = started = seq = cycle = 0, revision = 0, at_once = false, honest = true;
    for (size_t at = 0; at + 3 <= n_byte;) {
        const uint8_t what = bytes[at];
        size_t n = (size_t)bytes[at + 1] | (size_t)bytes[at + 2] << 8;
        at += 3;
        if (n > n_byte - at) n = n_byte - at;
        record(what, bytes + at, n);
        at += n;
    }
    pal_mem_transport.close(down);
    memset(of, 0, sizeof of);
    pal_relay_viewers_destroy(viewers);
    pal_relay_kept_free(&kept);
    pal_loop_destroy(loop);
    if (pal_packet_total()) abort();
    return 0;
}
