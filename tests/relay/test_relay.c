/* A relay between a hub and its viewers, all in this process: the relay's client of the hub hands every message on as
 * it came, as the link does, and viewers on the relay's own transport decode it. */
#include "clients/relay/relay_viewers.h"
#include "clients/relay/tuning.h"
#include "server/net/admission/ticket_keys.h"
#include "tests/net/adaptive_scene.h"
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

#include <time.h>
#include <unistd.h>

static small_scene organ;
static pal_relay_kept kept;
static pal_loop *loop;
static pal_relay_viewers *viewers;
static pal_transport *down;
static pal_mem_peer *up;
static bool asset_late; /* upstream's assets do not come yet */

/* the clock of the relay moves between any two looks at it, as a real one does */
static uint64_t moving_now(void *user)
{
    static uint64_t looks;
    (void)user;
    return manual_clock_now(&served_clock) + ++looks;
}
static const pal_clock moving_clock = {.now_ns = moving_now};

static void no_news(void *user)
{
    (void)user;
}

static void fetch(void *user, const char *path)
{
    pal_reply reply;
    (void)user;
    if (asset_late) return;
    pal_mem_get(transport, path, &reply);
    CHECK_INT(reply.status, 200);
    CHECK_INT(pal_relay_take_asset(&kept, path, reply.body->bytes, reply.body->n_byte), PAL_ERR_OK);
    pal_packet_drop(reply.body);
}

static void connect_up(void)
{
    static const char join[] =
        "{\"type\":\"join\",\"name\":\"relay\",\"role\":\"viewer\",\"tool\":null,\"topology_deltas\":true}";
    up = pal_mem_connect(transport, "");
    pal_relay_forget_requests(&kept);
    pal_mem_send(up, join, strlen(join), true);
}

/* what viewers want to see, asked for as relay_upstream.c does */
static void ask(void)
{
    pal_relay_view wanted;
    char text[PAL_CONTROL_IN_MAX + 1];
    size_t n = 0;
    for (uint32_t part; (part = pal_relay_next_request(&kept, 0, &wanted)) < PAL_WIRE_PART_MAX;) {
        pal_control request = {.type = PAL_CONTROL_SUBSCRIBE_FIELD};
        request.field_subscription.part = part;
        request.field_subscription.interior = wanted.interior;
        request.field_subscription.energy = wanted.energy;
        pal_wire_field_put_set(wanted.fields, request.field_subscription.field);
        CHECK_INT(pal_control_put(text, sizeof text, &request, &n), 0);
        pal_mem_send(up, text, n, true);
    }
}

/* all that upstream has for the relay */
static void pass(void)
{
    static pal_control message;
    ask();
    for (const pal_packet *p; (p = pal_mem_receive(up));) {
        pal_wire_head head;
        if (p->text) {
            CHECK_INT(pal_control_get((const char *)p->bytes, p->n_byte, true, &message), 0);
            pal_relay_take_text(&kept, &message, (const char *)p->bytes, p->n_byte);
            continue;
        }
        CHECK_INT(pal_wire_get_head(p->bytes, p->n_byte, &head), 0);
        pal_relay_take_message(&kept, &head, p->bytes, p->n_byte);
        if (head.kind != PAL_WIRE_TOOLS) continue;
        pal_wire_tools tools;
        uint8_t ack[PAL_WIRE_ACK_BYTES];
        CHECK_INT(pal_wire_get_tools(p->bytes, p->n_byte, &tools), 0);
        pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = tools.cycle});
        pal_mem_send(up, ack, sizeof ack, false);
    }
    pal_loop_advance(loop);
}

static void begin_with(const pal_scene *scene, bool paused, pal_relay_options options)
{
    pal_peer_events events;
    pal_listen_address nowhere = {.ip = ""};
    pal_diagnostic diag = {""};
    served_begin(scene, (pal_session_options){.start_paused = paused}, (pal_server_options){.max_viewers = 8});
    pal_relay_kept_init(&kept, no_news, NULL);
    pal_relay_kept_fetch_by(&kept, fetch, NULL);
    CHECK_INT(pal_loop_create(false, 0, false, &moving_clock, &diag, &loop), PAL_ERR_OK);
    CHECK_INT(pal_relay_viewers_create(loop, &kept, &options, &diag, &viewers), PAL_ERR_OK);
    pal_relay_viewers_events(viewers, &events);
    CHECK_INT(pal_mem_transport.open(loop, &nowhere, &events, &diag, &down), PAL_ERR_OK);
    connect_up();
    pass();
}

static void begin(bool paused, pal_relay_options options)
{
    begin_with(&organ.scene, paused, options);
}

static void end_relay(void)
{
    pal_mem_leave(up);
    pal_mem_transport.close(down);
    pal_relay_viewers_destroy(viewers);
    pal_relay_kept_free(&kept);
    pal_loop_destroy(loop);
    end();
}

static void turn(uint64_t ns, mem_client *direct, mem_client *a, mem_client *b)
{
    served_turn(ns, direct, NULL);
    pass();
    if (a) mem_pull(a, 1000);
    if (b) mem_pull(b, 1000);
}

static void same_shape(const mem_client *a, const mem_client *b)
{
    CHECK_INT(a->frame.seq, b->frame.seq);
    CHECK_INT(a->tools.cycle, b->tools.cycle);
    CHECK_INT(memcmp(a->position_m, b->position_m, a->asset->order->n_vertex * 3 * sizeof(float)), 0);
}

/* two viewers see to the bit what a client of the server sees, while a trainee presses */
static void viewers_see_what_the_server_sends(void)
{
    mem_client direct, a, b;
    begin(false, (pal_relay_options){.max_viewers = 4});
    mem_join(&direct, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    mem_pull(&direct, 1000);
    mem_join(&a, down, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&b, down, "Bo", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    const double top_m[3] = {0, 0, 0.04};
    for (uint32_t i = 1; i <= 60; i++) {
        mem_pose(&direct, 0, i, top_m);
        turn(FRAME_NS, &direct, &a, &b);
    }
    CHECK(direct.n_frame > 5);
    CHECK_INT(a.n_bad + b.n_bad + direct.n_bad, 0);
    CHECK_INT(a.n_text[PAL_CONTROL_HELLO], 1);
    CHECK(a.n_text[PAL_CONTROL_STATUS] > 1 && a.n_text[PAL_CONTROL_MEMBERS] > 0);
    CHECK_TEXT(a.last[PAL_CONTROL_HELLO].hello.session, "small");
    CHECK(direct.last[PAL_CONTROL_HELLO].hello.estimates && !direct.last[PAL_CONTROL_HELLO].hello.relay);
    CHECK(!a.last[PAL_CONTROL_HELLO].hello.estimates && a.last[PAL_CONTROL_HELLO].hello.relay);
    CHECK_INT(a.last[PAL_CONTROL_HELLO].hello.you_role, PAL_WIRE_ROLE_VIEWER);
    CHECK_INT(a.tools.n_tool, direct.tools.n_tool);
    CHECK_INT(a.tools.tool[0].flags & PAL_WIRE_TOOL_HELD, PAL_WIRE_TOOL_HELD);
    same_shape(&a, &direct), same_shape(&b, &direct);
    /* the server has a member and one viewer, however many there are behind it */
    CHECK_INT(direct.last[PAL_CONTROL_STATUS].status.n_member, 1);
    CHECK_INT(direct.last[PAL_CONTROL_STATUS].status.n_viewer, 1);
    CHECK_INT(pal_relay_viewers_count(viewers)->n_viewer, 2);
    mem_end(&a), mem_end(&b), mem_end(&direct);
    end_relay();
}

/* nothing moves, so nothing comes from upstream: the newest frame is there all the same */
static void a_newcomer_gets_a_key_frame_of_a_part_at_rest(void)
{
    mem_client direct, late;
    begin(true, (pal_relay_options){.max_viewers = 4});
    mem_join(&direct, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 10; i++) turn(FRAME_NS, &direct, NULL, NULL);
    mem_join(&late, down, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_pull(&late, 1000); /* without a turn of the server */
    CHECK_INT(late.n_text[PAL_CONTROL_HELLO], 1);
    CHECK_INT(late.n_frame, 1);
    CHECK_INT(late.n_tools, 1);
    CHECK_INT(late.n_bad, 0);
    CHECK_INT(memcmp(late.position_m, direct.position_m, late.asset->order->n_vertex * 3 * sizeof(float)), 0);
    mem_end(&late), mem_end(&direct);
    end_relay();
}

/* one that acknowledges nothing gets its credit and no more; the other sees every cycle */
static void a_slow_viewer_costs_the_others_nothing(void)
{
    mem_client fast, deaf, direct;
    begin(false, (pal_relay_options){.max_viewers = 4});
    mem_join(&direct, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    mem_join(&fast, down, "fast", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&deaf, down, "deaf", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    deaf.mute = true;
    for (int i = 0; i < 300; i++) turn(FRAME_NS, &direct, &fast, &deaf);
    CHECK_LE(deaf.n_tools, PAL_CREDIT_MAX);
    CHECK_LE(direct.n_tools - fast.n_tools, 2);
    CHECK_INT(fast.tools.cycle, direct.tools.cycle);
    const size_t held = pal_packet_total();
    for (int i = 0; i < 240; i++) turn(FRAME_NS, &direct, &fast, &deaf);
    CHECK_LE((double)pal_packet_total(), 2.0 * (double)held); /* nothing waits for it */
    CHECK(deaf.n_text[PAL_CONTROL_STATUS] > 20);              /* control goes on */
    for (int i = 0; i < 240 && !pal_mem_code(deaf.peer); i++) turn(FRAME_NS, &direct, &fast, &deaf);
    CHECK_INT(pal_mem_code(deaf.peer), PAL_WIRE_CLOSE_STALLED);
    CHECK_INT(pal_mem_code(fast.peer), 0);
    mem_end(&fast), mem_end(&deaf), mem_end(&direct);
    end_relay();
}

/* one that takes nothing, so that it has nothing to acknowledge, may not hold old messages for ever */
static void a_viewer_that_reads_nothing_is_closed(void)
{
    mem_client reads, deaf;
    begin(false, (pal_relay_options){.max_viewers = 4});
    mem_join(&reads, down, "reads", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&deaf, down, "deaf", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 600; i++) turn(FRAME_NS, NULL, &reads, NULL); /* 10 s */
    CHECK_INT(pal_mem_code(deaf.peer), 0);
    for (int i = 0; i < 60; i++) turn(FRAME_NS, NULL, &reads, NULL);
    CHECK_INT(pal_mem_code(deaf.peer), PAL_WIRE_CLOSE_STALLED);
    CHECK_INT(pal_mem_code(reads.peer), 0);
    mem_end(&reads), mem_end(&deaf);
    end_relay();
}

/* one address of another machine neither takes all places nor turns away those of others who are about to join */
static void one_address_keeps_no_others_out(void)
{
    static mem_client crowd[60], silent[PAL_RELAY_UNJOINED_OF_ADDRESS + 1];
    mem_client other;
    int joined = 0;
    begin(true, (pal_relay_options){.max_viewers = 200});
    for (int i = 0; i < 60; i++) {
        mem_connect(&crowd[i], down, "192.0.2.1", "");
        mem_enter(&crowd[i], "crowd", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, false);
        const bool in = pal_mem_code(crowd[i].peer) == 0;
        joined += in;
        if (!in) mem_end(&crowd[i]);
    }
    CHECK_INT(joined, 200 / PAL_RELAY_ADDRESSES);
    mem_connect(&other, down, "192.0.2.2", "");
    for (int i = 0; i <= PAL_RELAY_UNJOINED_OF_ADDRESS; i++) mem_connect(&silent[i], down, "192.0.2.1", "");
    CHECK_INT(pal_mem_code(silent[0].peer), PAL_WIRE_CLOSE_FULL);
    CHECK_INT(pal_mem_code(silent[1].peer), 0);
    mem_enter(&other, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, false);
    CHECK_INT(pal_mem_code(other.peer), 0);
    for (int i = 0; i < 60; i++)
        if (crowd[i].peer) mem_end(&crowd[i]);
    for (int i = 0; i <= PAL_RELAY_UNJOINED_OF_ADDRESS; i++) mem_end(&silent[i]);
    mem_end(&other);
    end_relay();
}

static void nothing_that_a_viewer_says_goes_up(void)
{
    static const struct {
        const char *text, *code;
    } message[] = {{"{\"type\":\"command\",\"verb\":\"pause\"}", "role"},
                   {"{\"type\":\"take_tool\",\"tool\":0}", "role"},
                   {"{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"von_mises\"}", "field"},
                   {"{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement rainbow\"}", "field"},
                   {"{\"type\":\"subscribe_field\",\"part\":1,\"field\":\"none\"}", "part"},
                   {"{\"type\":\"join\",\"name\":\"again\",\"role\":\"viewer\",\"tool\":-1}", "joined"}};
    mem_client direct, v;
    const double at_m[3] = {0, 0, 0};
    begin(false, (pal_relay_options){.max_viewers = 4});
    mem_join(&direct, transport, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    mem_join(&v, down, "Mallory", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_ANY);
    turn(FRAME_NS, &direct, &v, NULL);
    CHECK_INT(v.last[PAL_CONTROL_HELLO].hello.you_role, PAL_WIRE_ROLE_VIEWER);
    CHECK_TEXT(v.last[PAL_CONTROL_ERROR].error.code, "role");
    for (size_t i = 0; i < sizeof message / sizeof *message; i++) {
        mem_text(&v, message[i].text);
        mem_pull(&v, 1000);
        CHECK_INT(v.n_text[PAL_CONTROL_ERROR], (int)i + 2);
        CHECK_TEXT(v.last[PAL_CONTROL_ERROR].error.code, message[i].code);
    }
    mem_pose(&v, 0, 1, at_m), mem_pose(&v, 0, 2, at_m);
    mem_pull(&v, 1000);
    CHECK_INT(v.n_text[PAL_CONTROL_ERROR], (int)(sizeof message / sizeof *message) + 2);
    mem_text(&v, "{\"type\":\"ping\",\"stamp_ms\":7}");
    mem_pull(&v, 1000);
    CHECK(v.last[PAL_CONTROL_PONG].stamp_ms == 7);
    turn(1000000000u, &direct, &v, NULL);
    turn(1, &direct, &v, NULL);
    CHECK(!direct.last[PAL_CONTROL_STATUS].status.paused);
    CHECK_INT(direct.n_text[PAL_CONTROL_ORDERS], 0);
    CHECK_INT(direct.tools.tool[0].flags & PAL_WIRE_TOOL_HELD, 0);
    /* malformed, and too many */
    mem_text(&v, "{\"type\":");
    CHECK_INT(pal_mem_code(v.peer), PAL_WIRE_CLOSE_PROTOCOL);
    mem_client flood;
    mem_join(&flood, down, "flood", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    int n = 1;
    for (; n < 100 && !pal_mem_code(flood.peer); n++) {
        mem_text(&flood, "{\"type\":\"release_tool\"}");
        mem_pull(&flood, 1000);
    }
    CHECK_INT(pal_mem_code(flood.peer), PAL_WIRE_CLOSE_RATE);
    CHECK_INT(n, PAL_RELAY_CONTROL_AT_ONCE + 1);
    mem_end(&v), mem_end(&flood), mem_end(&direct);
    end_relay();
}

static void same_triangles(const mem_client *a, const mem_client *b)
{
    same_shape(a, b);
    CHECK_INT(memcmp(a->tri, b->tri, 3 * sizeof *a->tri * a->asset->n_triangle), 0);
}

/* Triangles change all the time. A viewer that keeps up has those of a client of the server with each cycle; one that
 * skips cycles, one that comes later and one that takes no changes at all stand at the relay with it. The line up
 * breaks and upstream begins at the asset again: those who stayed go on from what they have. */
static void parts_that_adapt_are_shown_right(void)
{
    static adaptive_scene storm;
    static mem_client direct, fast, slow, late, plain; /* too large for the stack */
    if (!adaptive_scene_make(&storm, ADAPTIVE_STORM)) CHECK_FAIL("no scene");
    begin_with(&storm.scene, false, (pal_relay_options){.max_viewers = 4});
    mem_join_as(&direct, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE, true);
    mem_join_as(&fast, down, "fast", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, true);
    mem_join_as(&slow, down, "slow", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, true);
    mem_join(&plain, down, "plain", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 60; i++) {
        turn(FRAME_NS, &direct, &fast, i % 7 == 6 ? &slow : &plain);
        if (direct.n_frame > 0) same_triangles(&fast, &direct);
    }
    CHECK(fast.n_patch > 15);
    mem_join_as(&late, down, "late", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, true);
    mem_pull(&late, 1000), mem_pull(&slow, 1000), mem_pull(&plain, 1000);
    same_triangles(&late, &direct), same_triangles(&slow, &direct);
    CHECK_INT(late.n_patch, 1);
    CHECK(slow.n_patch > 1 && slow.n_patch < fast.n_patch);
    same_shape(&plain, &direct);
    CHECK_INT(plain.n_patch, 0);
    CHECK_INT(memcmp(plain.tri, plain.asset->triangle, 3 * sizeof *plain.tri * plain.asset->n_triangle), 0);

    pal_mem_leave(up);
    pal_relay_lost(&kept);
    connect_up();
    for (int i = 0; i < 30; i++) {
        turn(FRAME_NS, &direct, &fast, &late);
        if (i > 1) same_triangles(&fast, &direct), same_triangles(&late, &direct);
    }
    CHECK_INT(fast.n_text[PAL_CONTROL_HELLO], 1);
    CHECK_INT(direct.n_bad + fast.n_bad + slow.n_bad + late.n_bad + plain.n_bad, 0);
    CHECK_INT(fast.n_text[PAL_CONTROL_ERROR], 0);
    mem_end(&fast), mem_end(&slow), mem_end(&late), mem_end(&plain), mem_end(&direct);
    end_relay();
    adaptive_scene_free(&storm);
}

static void same_values(const mem_client *a, const mem_client *b)
{
    CHECK(a->field.field == b->field.field && a->field.sim_time_us == b->field.sim_time_us);
    CHECK(a->field.low == b->field.low && a->field.high == b->field.high);
    CHECK_INT(memcmp(a->level, b->level, a->field.n_vertex), 0);
}

/* Each sees the field of its choice, to the bit as a client of the server does; upstream is asked for each kind once,
 * and for none when nobody looks. */
static void viewers_see_the_fields_that_they_ask_for(void)
{
    static mem_client direct, a, b, c; /* too large for the stack */
    const double top_m[3] = {0, 0, 0.04};
    begin(false, (pal_relay_options){.max_viewers = 4});
    mem_join(&direct, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    mem_join(&a, down, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&b, down, "Bo", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&c, down, "Cy", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 5; i++) turn(FRAME_NS, &direct, &a, &b);
    mem_text(&direct, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    mem_text(&a, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    mem_text(&b, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"energy\",\"interior\":true,\"energy\":true}");
    for (uint32_t i = 1; i <= 120; i++) {
        mem_pose(&direct, 0, i, top_m);
        turn(FRAME_NS, &direct, &a, &b);
        mem_pull(&c, 1000);
        if (a.n_field > 0 && a.field.sim_time_us == direct.field.sim_time_us) same_values(&a, &direct);
    }
    CHECK(a.n_field > 10 && b.n_field > 10 && b.n_interior > 3 && direct.field.high > 0);
    CHECK_LE(abs(a.n_field - direct.n_field), 2);
    CHECK_INT(a.n_of_field[PAL_WIRE_FIELD_DISPLACEMENT_M], a.n_field);
    CHECK_INT(b.n_of_field[PAL_WIRE_FIELD_ENERGY_J_M3], b.n_field);
    CHECK_INT(b.n_of_interior[PAL_WIRE_FIELD_ENERGY_J_M3], b.n_interior);
    CHECK_INT(a.n_interior + c.n_field + c.n_interior, 0);
    CHECK_INT(b.last[PAL_CONTROL_STATUS].status.n_energy, 1);
    CHECK_INT(kept.values[0].asked.fields, 1u << PAL_WIRE_FIELD_DISPLACEMENT_M | 1u << PAL_WIRE_FIELD_ENERGY_J_M3);

    /* what is kept is shown at once to who asks for the same */
    mem_text(&c, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement energy\"}");
    mem_pull(&c, 1000);
    CHECK_INT(c.n_of_field[PAL_WIRE_FIELD_DISPLACEMENT_M], 1);
    CHECK_INT(c.n_of_field[PAL_WIRE_FIELD_ENERGY_J_M3], 1);

    /* the line breaks: upstream is asked again */
    pal_mem_leave(up);
    pal_relay_lost(&kept);
    connect_up();
    const int n_before = a.n_field;
    for (int i = 0; i < 30; i++) turn(FRAME_NS, &direct, &a, &b);
    CHECK(a.n_field > n_before + 1);

    /* nobody looks any more, in words or by leaving: nothing is kept, and upstream computes what its own clients see */
    mem_text(&a, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"none\"}");
    mem_end(&b), mem_end(&c);
    mem_text(&direct, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"none\"}");
    for (int i = 0; i < 60; i++) turn(FRAME_NS, &direct, &a, NULL);
    CHECK_INT(kept.values[0].asked.fields + kept.values[0].asked.interior + kept.values[0].asked.energy, 0);
    CHECK(!kept.values[0].field[PAL_WIRE_FIELD_DISPLACEMENT_M].packet);
    CHECK(!kept.values[0].interior[PAL_WIRE_FIELD_ENERGY_J_M3].packet);
    CHECK_INT(direct.last[PAL_CONTROL_STATUS].status.n_component_name, 0); /* no field_output in the plan */
    CHECK_INT(a.n_bad + direct.n_bad, 0);
    mem_end(&a), mem_end(&direct);
    end_relay();
}

static pal_ticket_key ticket_key;

/* a viewer of a new ticket, of this machine; the result is the code with which it was closed, 0: it has joined */
static int enter_with(mem_client *c, pal_ticket ticket, const char *forged)
{
    static uint64_t nonce;
    char text[PAL_TICKET_TEXT];
    ticket.nonce = ++nonce;
    CHECK(pal_ticket_put(&ticket, &ticket_key, text));
    if (forged) text[PAL_TICKET_TEXT - 4] = text[PAL_TICKET_TEXT - 4] == *forged ? 'z' : *forged;
    mem_connect(c, down, "", text);
    if (!pal_mem_code(c->peer)) mem_enter(c, "guest", ticket.role, PAL_WIRE_TOOL_NONE, false);
    if (!pal_mem_code(c->peer)) mem_pull(c, 1000);
    return pal_mem_code(c->peer);
}

/* with keys a relay looks at tickets as a server does, and whatever role one is for, its bearer watches */
static void tickets_are_checked_with_the_keys(void)
{
    static char path[] = "/tmp/palpate_relay_keys_XXXXXX";
    mem_client none, other, guest[2];
    pal_ticket_keys keys;
    pal_diagnostic diag = {""};
    int id = 0, fd = mkstemp(path);
    if (fd < 0 || close(fd) || unlink(path) || pal_key_file_add(path, &id, &diag) ||
        pal_ticket_keys_read(path, &keys, &diag))
        CHECK_FAIL("no keys: %s", diag.text);
    ticket_key = keys.key[0];
    begin(true, (pal_relay_options){.max_viewers = 8, .keys = path});
    mem_join(&none, down, "none", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(none.peer), 0); /* watching needs no ticket */

    CHECK_INT(enter_with(&other, (pal_ticket){.role = PAL_WIRE_ROLE_VIEWER}, "A"), PAL_WIRE_CLOSE_POLICY);
    CHECK_TEXT(pal_mem_reason(other.peer), "this ticket is not one of this server");
    mem_end(&other);
    const pal_ticket old = {.role = PAL_WIRE_ROLE_VIEWER, .expires_s = (uint32_t)time(NULL) - 10};
    CHECK_INT(enter_with(&other, old, NULL), PAL_WIRE_CLOSE_POLICY);
    mem_end(&other);
    const pal_ticket elsewhere = {.role = PAL_WIRE_ROLE_VIEWER, .session = pal_ticket_session("liver")};
    CHECK_INT(enter_with(&other, elsewhere, NULL), PAL_WIRE_CLOSE_POLICY);
    mem_end(&other);

    const pal_ticket here = {.role = PAL_WIRE_ROLE_INSTRUCTOR, .session = pal_ticket_session("small")};
    CHECK_INT(enter_with(&other, here, NULL), 0);
    CHECK_INT(other.last[PAL_CONTROL_HELLO].hello.you_role, PAL_WIRE_ROLE_VIEWER);
    CHECK_TEXT(other.last[PAL_CONTROL_ERROR].error.code, "role");
    /* a ticket for one admits one, until it leaves for good */
    pal_ticket once = {.role = PAL_WIRE_ROLE_VIEWER, .uses = 1, .nonce = 77};
    char text[PAL_TICKET_TEXT];
    CHECK(pal_ticket_put(&once, &ticket_key, text));
    for (int i = 0; i < 2; i++) {
        mem_connect(&guest[i], down, "", text);
        mem_enter(&guest[i], "guest", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, false);
        CHECK_INT(pal_mem_code(guest[i].peer), i ? PAL_WIRE_CLOSE_FULL : 0);
    }
    mem_end(&none), mem_end(&other), mem_end(&guest[0]), mem_end(&guest[1]);
    end_relay();
    unlink(path);
}

/* places, joining in time, and what is not there yet */
static void places_are_limited_and_nobody_comes_before_the_session(void)
{
    static mem_client silent[PAL_RELAY_UNJOINED + 1];
    mem_client a[3];
    asset_late = true;
    begin(true, (pal_relay_options){.max_viewers = 2, .relays = "http://192.0.2.7:8092/"});
    mem_connect(&a[0], down, "", "");
    CHECK_INT(pal_mem_code(a[0].peer), PAL_WIRE_CLOSE_GOING_AWAY); /* its assets are not here */
    mem_end(&a[0]);
    asset_late = false;
    pal_relay_want_missing(&kept);
    for (int i = 0; i < 3; i++) mem_join(&a[i], down, "v", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 3; i++) CHECK_INT(pal_mem_code(a[i].peer), i < 2 ? 0 : PAL_WIRE_CLOSE_ELSEWHERE);
    mem_end(&a[2]);
    for (int i = 0; i <= PAL_RELAY_UNJOINED; i++) {
        char address[24];
        snprintf(address, sizeof address, "192.0.2.%d", i);
        mem_connect(&silent[i], down, address, "");
        if (i == 0) turn(FRAME_NS, NULL, &a[0], &a[1]);
    }
    CHECK_INT(pal_mem_code(silent[0].peer), PAL_WIRE_CLOSE_FULL);
    for (int i = 1; i <= PAL_RELAY_UNJOINED; i++) CHECK_INT(pal_mem_code(silent[i].peer), 0);
    for (int i = 0; i < 330; i++) turn(FRAME_NS, NULL, &a[0], &a[1]); /* 5.5 s */
    CHECK_INT(pal_mem_code(silent[1].peer), PAL_WIRE_CLOSE_POLICY);
    CHECK_INT(pal_mem_code(a[0].peer) + pal_mem_code(a[1].peer), 0);
    mem_end(&a[0]), mem_end(&a[1]);
    for (int i = 0; i <= PAL_RELAY_UNJOINED; i++) mem_end(&silent[i]);
    end_relay();
}

/* the line to the server breaks: viewers stay and go on with the same run, and leave with another */
static void viewers_outlive_a_lost_line_but_not_the_run(void)
{
    mem_client direct, v;
    begin(false, (pal_relay_options){.max_viewers = 2});
    mem_join(&direct, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    mem_join(&v, down, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 30; i++) turn(FRAME_NS, &direct, &v, NULL);
    pal_mem_leave(up);
    pal_relay_lost(&kept);
    for (int i = 0; i < 30; i++) {
        served_turn(FRAME_NS, &direct, NULL);
        pal_loop_advance(loop);
        mem_pull(&v, 1000);
    }
    CHECK_INT(pal_mem_code(v.peer), 0);
    connect_up();
    for (int i = 0; i < 30; i++) turn(FRAME_NS, &direct, &v, NULL);
    CHECK_INT(pal_mem_code(v.peer), 0);
    CHECK_INT(v.n_bad, 0);
    CHECK_INT(v.n_text[PAL_CONTROL_HELLO], 1);
    same_shape(&v, &direct);
    /* a server that began at another time */
    static pal_control other;
    static char text[PAL_CONTROL_OUT_MAX + 1];
    size_t n = 0;
    other = (pal_control){.type = PAL_CONTROL_HELLO, .hello = v.last[PAL_CONTROL_HELLO].hello};
    other.hello.started++;
    CHECK_INT(pal_control_put(text, sizeof text, &other, &n), 0);
    pal_relay_take_text(&kept, &other, text, n);
    served_turn(400000000u, &direct, NULL);
    pal_loop_advance(loop);
    CHECK_INT(pal_mem_code(v.peer), PAL_WIRE_CLOSE_GOING_AWAY);
    CHECK_TEXT(pal_mem_reason(v.peer), "the session begins anew");
    mem_end(&v), mem_end(&direct);
    end_relay();
}

static void path_of(const char *folder, const uint8_t *bytes, size_t n_byte, char path[PAL_WIRE_NAME_BYTES])
{
    char hash[PAL_ASSET_HASH_CHARS];
    pal_asset_hash(bytes, n_byte, hash);
    snprintf(path, PAL_WIRE_NAME_BYTES, "%s%s", folder, hash);
}

/* upstream says that part 0 has another asset, and perhaps an interior */
static void announce(uint32_t epoch, const char *asset, const char *interior)
{
    static pal_control message;
    static char text[PAL_CONTROL_OUT_MAX + 1];
    size_t n = 0;
    message = (pal_control){.type = PAL_CONTROL_TOPOLOGY};
    message.topology.n_part = 1;
    message.topology.part[0] = (pal_wire_part_info){.name = "organ", .epoch = epoch, .n_vertex = 4, .error_m = 1e-4};
    snprintf(message.topology.part[0].asset, PAL_WIRE_NAME_BYTES, "%s", asset);
    snprintf(message.topology.part[0].interior, PAL_WIRE_NAME_BYTES, "%s", interior);
    CHECK_INT(pal_control_put(text, sizeof text, &message, &n), 0);
    pal_relay_take_text(&kept, &message, text, n);
}

static size_t kept_assets(void)
{
    size_t n = 0;
    for (const pal_relay_asset *a = kept.asset; a; a = a->next) n++;
    return n;
}

static void what_upstream_offers_and_nothing_names_is_refused(void)
{
    static const uint8_t bytes[] = {1, 2, 3}, others[] = {4, 5, 6};
    char path[PAL_WIRE_NAME_BYTES], other[PAL_WIRE_NAME_BYTES], elsewhere[PAL_WIRE_NAME_BYTES];
    path_of("/asset/", bytes, sizeof bytes, path);
    path_of("/asset/", others, sizeof others, other);
    path_of("/sessions/", bytes, sizeof bytes, elsewhere);
    begin(true, (pal_relay_options){.max_viewers = 2});
    CHECK_INT(pal_relay_take_asset(&kept, path, bytes, sizeof bytes), PAL_ERR_REFUSED); /* nothing names it */
    asset_late = true;
    announce(2, path, elsewhere);
    CHECK_INT(pal_relay_take_asset(&kept, path, others, sizeof others), PAL_ERR_REFUSED); /* another hash */
    CHECK_INT(pal_relay_take_asset(&kept, elsewhere, bytes, sizeof bytes), PAL_ERR_REFUSED);
    CHECK_INT(pal_relay_take_asset(&kept, path, bytes, sizeof bytes), PAL_ERR_OK);
    CHECK_INT(pal_relay_take_asset(&kept, path, bytes, sizeof bytes), PAL_ERR_OK); /* twice is once */
    /* as much as a session may have is kept already */
    announce(3, other, "");
    const size_t held = kept.asset_bytes;
    kept.asset_bytes = PAL_RELAY_ASSETS_BYTES - 2;
    CHECK_INT(pal_relay_take_asset(&kept, other, others, sizeof others), PAL_ERR_FULL);
    kept.asset_bytes = held;
    CHECK_INT(pal_relay_take_asset(&kept, other, others, sizeof others), PAL_ERR_OK);
    asset_late = false;
    end_relay();
}

/* a part that is edited again and again, and never complete, leaves nothing behind; nor does its old frame */
static void edits_leave_no_assets_and_frames_behind(void)
{
    uint8_t bytes[4] = {0};
    char path[PAL_WIRE_NAME_BYTES];
    begin(true, (pal_relay_options){.max_viewers = 2});
    for (int i = 0; i < 10 && !kept.frame[0].packet; i++) turn(FRAME_NS, NULL, NULL, NULL);
    const size_t before = kept_assets();
    CHECK(kept.frame[0].packet != NULL);
    asset_late = true;
    for (uint8_t i = 0; i < 20; i++) {
        bytes[0] = i;
        path_of("/asset/", bytes, sizeof bytes, path);
        announce(2 + i, path, "/asset/00112233445566778899aabbccddeeff");
        CHECK_INT(pal_relay_take_asset(&kept, path, bytes, sizeof bytes), PAL_ERR_OK);
        CHECK_INT(kept_assets(), before + 1);
    }
    CHECK(kept.frame[0].packet != NULL); /* what is shown is still of the first epoch */
    announce(40, path, "");
    CHECK_INT(kept_assets(), before + 1);
    CHECK_INT(kept.epoch[0], 40);
    CHECK(kept.frame[0].packet == NULL);
    /* epochs only grow */
    announce(39, path, "");
    CHECK_INT(kept.epoch[0], 40);
    asset_late = false;
    end_relay();
}

/* the server would refuse the whole request, and so keep other viewers from other fields */
static void a_field_that_an_edit_takes_away_is_not_asked_for(void)
{
    static const uint8_t bytes[] = {1, 2, 3};
    static mem_client a; /* too large for the stack */
    char path[PAL_WIRE_NAME_BYTES];
    pal_relay_view wanted;
    begin(false, (pal_relay_options){.max_viewers = 2});
    mem_join(&a, down, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 5; i++) turn(FRAME_NS, NULL, &a, NULL);
    mem_text(&a, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\",\"interior\":true}");
    turn(FRAME_NS, NULL, &a, NULL);
    CHECK_INT(kept.values[0].asked.fields, 1u << PAL_WIRE_FIELD_DISPLACEMENT_M);
    asset_late = true;
    path_of("/asset/", bytes, sizeof bytes, path);
    announce(2, path, ""); /* a model without fields */
    CHECK_INT(pal_relay_take_asset(&kept, path, bytes, sizeof bytes), PAL_ERR_OK);
    CHECK_INT(pal_relay_next_request(&kept, 0, &wanted), 0);
    CHECK_INT(wanted.fields + wanted.interior, 0);
    CHECK_INT(pal_relay_next_request(&kept, 0, &wanted), PAL_WIRE_PART_MAX);
    asset_late = false;
    mem_end(&a);
    end_relay();
}

int main(void)
{
    if (!small_scene_make(&organ, "small")) return 1;
    RUN(viewers_see_what_the_server_sends);
    RUN(a_newcomer_gets_a_key_frame_of_a_part_at_rest);
    RUN(a_slow_viewer_costs_the_others_nothing);
    RUN(a_viewer_that_reads_nothing_is_closed);
    RUN(one_address_keeps_no_others_out);
    RUN(nothing_that_a_viewer_says_goes_up);
    RUN(parts_that_adapt_are_shown_right);
    RUN(viewers_see_the_fields_that_they_ask_for);
    RUN(tickets_are_checked_with_the_keys);
    RUN(places_are_limited_and_nobody_comes_before_the_session);
    RUN(viewers_outlive_a_lost_line_but_not_the_run);
    RUN(what_upstream_offers_and_nothing_names_is_refused);
    RUN(edits_leave_no_assets_and_frames_behind);
    RUN(a_field_that_an_edit_takes_away_is_not_asked_for);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
