/* palpate-lcm between a session and a bus that are stand-ins: frames follow the triangles that they are shown with, and
 * states of tools are passed on as far as their numbers allow. */
#include "clients/lcm_bridge/lcm_bridge.h"
#include "clients/lcm_bridge/tuning.h"
#include "clients/link/asset_store.h"
#include "clients/link/lcm_convert.h"
#include "clients/link/tuning.h"
#include "palpate_body_frame_t.h"
#include "palpate_session_status_t.h"
#include "palpate_triangles_t.h"
#include "protocol/topology_delta_codec.h"
#include "server/base/clock.h"
#include "tests/check.h"

enum { VERTICES = 4, SLOTS = 4, KEPT = 64 };

static float rest[3 * VERTICES] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
static uint32_t load_tri[3 * SLOTS] = {0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3};
static pal_asset asset = {.n_triangle = SLOTS, .rest_m = rest, .triangle = load_tri};
static pal_frame_encoder *encoder;
static pal_stored_asset stored;
static uint64_t now_ns = 1000000000;
static pal_lcm_bridge *bridge;
/* what the bridge has opened */
static const pal_link_events *watcher;
static void *watcher_user;
static void (*tidy)(void *user);
static void (*asset_changed)(void *user, const pal_stored_asset *a);
static const pal_lcm_events *bus;
static pal_wire_pose pose;
static int n_pose;
/* what it has published: 'T' triangles, 'B' body, 'S' status */
static int n_heard;
static struct {
    char kind;
    int64_t change;
    int epoch, part, n;
} heard[KEPT];

/* ---- stand-ins ---- */

uint64_t __wrap_pal_clock_ns(void);
pal_err __wrap_pal_link_open(pal_link_loop *loop, const pal_link_options *o, pal_diagnostic *diag, pal_link **out);
void __wrap_pal_link_close(pal_link *link);
pal_link_state __wrap_pal_link_current_state(const pal_link *link);
int __wrap_pal_link_tool(const pal_link *link);
pal_err __wrap_pal_link_send_pose(pal_link *link, const pal_wire_pose *p);
pal_link_timer *__wrap_pal_link_add_timer(pal_link_loop *loop, uint64_t us, void (*fn)(void *user), void *user);
pal_asset_store *__wrap_pal_asset_store_create(pal_link_loop *loop, const char *url,
                                               void (*changed)(void *user, const pal_stored_asset *a), void *user);
pal_stored_asset *__wrap_pal_asset_store_request(pal_asset_store *store, const char *path);
void __wrap_pal_asset_store_destroy(pal_asset_store *store);
pal_err __real_pal_lcm_link_open(pal_link_loop *loop, const pal_lcm_options *options, const pal_lcm_events *events,
                                 void *user, pal_diagnostic *diag, pal_lcm_link **out);
pal_err __wrap_pal_lcm_link_open(pal_link_loop *loop, const pal_lcm_options *options, const pal_lcm_events *events,
                                 void *user, pal_diagnostic *diag, pal_lcm_link **out);
pal_err __wrap_pal_lcm_link_publish(pal_lcm_link *link, const char *session, const char *what, int n,
                                    const lcm_type_info_t *type, const void *message);

static char member[2]; /* watcher, tool 0 */

uint64_t __wrap_pal_clock_ns(void)
{
    return now_ns;
}

pal_err __wrap_pal_link_open(pal_link_loop *loop, const pal_link_options *o, pal_diagnostic *diag, pal_link **out)
{
    (void)loop, (void)diag;
    const bool is_tool = o->tool != PAL_WIRE_TOOL_NONE;
    if (!is_tool) watcher = o->events, watcher_user = o->user;
    *out = (pal_link *)&member[is_tool];
    return PAL_ERR_OK;
}

void __wrap_pal_link_close(pal_link *link)
{
    (void)link;
}

pal_link_state __wrap_pal_link_current_state(const pal_link *link)
{
    (void)link;
    return PAL_LINK_JOINED;
}

int __wrap_pal_link_tool(const pal_link *link)
{
    (void)link;
    return 0;
}

pal_err __wrap_pal_link_send_pose(pal_link *link, const pal_wire_pose *p)
{
    (void)link;
    pose = *p;
    n_pose++;
    return PAL_ERR_OK;
}

pal_link_timer *__wrap_pal_link_add_timer(pal_link_loop *loop, uint64_t us, void (*fn)(void *user), void *user)
{
    (void)loop, (void)us, (void)user;
    tidy = fn;
    return (pal_link_timer *)&member[0];
}

pal_asset_store *__wrap_pal_asset_store_create(pal_link_loop *loop, const char *url,
                                               void (*changed)(void *user, const pal_stored_asset *a), void *user)
{
    (void)loop, (void)url, (void)user;
    asset_changed = changed;
    return (pal_asset_store *)&member[0];
}

pal_stored_asset *__wrap_pal_asset_store_request(pal_asset_store *store, const char *path)
{
    (void)store;
    snprintf(stored.path, sizeof stored.path, "%s", path);
    return &stored;
}

void __wrap_pal_asset_store_destroy(pal_asset_store *store)
{
    (void)store;
}

pal_err __wrap_pal_lcm_link_open(pal_link_loop *loop, const pal_lcm_options *options, const pal_lcm_events *events,
                                 void *user, pal_diagnostic *diag, pal_lcm_link **out)
{
    bus = events;
    return __real_pal_lcm_link_open(loop, options, events, user, diag, out);
}

pal_err __wrap_pal_lcm_link_publish(pal_lcm_link *link, const char *session, const char *what, int n,
                                    const lcm_type_info_t *type, const void *message)
{
    (void)link, (void)type;
    CHECK_TEXT(session, "main");
    if (n_heard == KEPT) return PAL_ERR_FULL;
    heard[n_heard].kind = what[0], heard[n_heard].part = n;
    if (what[0] == 'T') {
        const palpate_triangles_t *t = message;
        heard[n_heard].change = t->change, heard[n_heard].epoch = t->epoch, heard[n_heard].n = t->n_corner / 3;
    } else if (what[0] == 'B') {
        const palpate_body_frame_t *f = message;
        CHECK(f->size > 0);
        heard[n_heard].change = f->change, heard[n_heard].epoch = f->epoch, heard[n_heard].n = f->seq;
    } else if (what[0] == 'S') {
        const palpate_session_status_t *s = message;
        heard[n_heard].epoch = s->epoch[0], heard[n_heard].n = s->role;
    }
    n_heard++;
    return PAL_ERR_OK;
}

/* ---- the session ---- */

static pal_wire_part_info part_info(uint32_t epoch, bool is_adaptive)
{
    pal_wire_part_info info = {.name = "a",
                               .epoch = epoch,
                               .n_vertex = VERTICES,
                               .n_triangle = SLOTS,
                               .error_m = 1e-4,
                               .is_adaptive = is_adaptive};
    snprintf(info.asset, sizeof info.asset, "/asset/%u", epoch);
    return info;
}

static void hello(bool is_adaptive)
{
    static pal_control c;
    c = (pal_control){.type = PAL_CONTROL_HELLO,
                      .hello = {.session = "main", .n_tool = 1, .n_part = 2, .you_role = PAL_WIRE_ROLE_TRAINEE}};
    c.hello.part[0] = part_info(1, is_adaptive);
    c.hello.part[1] = part_info(1, false);
    watcher->control(watcher_user, &c);
}

static void frame(uint16_t part, uint32_t epoch, uint32_t seq)
{
    static uint8_t bytes[4096];
    float shown[3 * VERTICES];
    pal_frame_result result;
    pal_wire_head head;
    for (int i = 0; i < 3 * VERTICES; i++) shown[i] = rest[i] + 0.001f * (float)seq;
    const pal_frame_input given = {.part = part, .epoch = epoch, .seq = seq, .error_m = 1e-4, .position_m = shown};
    REQUIRE(pal_frame_put(encoder, &given, bytes, sizeof bytes, &result) == 0);
    REQUIRE(pal_wire_get_head(bytes, result.n_byte, &head) == 0);
    watcher->message(watcher_user, &head, bytes, result.n_byte);
}

/* the first n slots are empty from now on */
static void change(uint32_t epoch, uint64_t revision, uint32_t n)
{
    static uint8_t bytes[4096], work[PAL_TOPOLOGY_DELTA_WORK_BYTES(SLOTS)];
    const uint32_t slot[SLOTS] = {0, 1, 2, 3};
    uint32_t table[3 * SLOTS] = {0};
    size_t n_byte;
    pal_wire_head head;
    memcpy(table + 3 * n, load_tri + 3 * n, sizeof table - 12 * n);
    pal_topology_delta_head delta = {.part = 0, .epoch = epoch, .n_changed = SLOTS, .revision = revision};
    REQUIRE(pal_topology_delta_put(slot, table, &delta, work, bytes, sizeof bytes, &n_byte) == 0);
    REQUIRE(pal_wire_get_head(bytes, n_byte, &head) == 0);
    watcher->message(watcher_user, &head, bytes, n_byte);
}

static void begin(void)
{
    static const pal_lcm_bridge_options options = {.server = "ws://127.0.0.1:1/ws", .lcm = {.url = "memq://"}};
    pal_lcm_bridge_close(bridge);
    stored = (pal_stored_asset){.asset = &asset};
    now_ns += 60000000000u;
    REQUIRE(pal_lcm_bridge_open(NULL, &options, NULL, &bridge) == PAL_ERR_OK);
    n_heard = n_pose = 0;
}

static void asset_comes(void)
{
    stored.ready = true;
    asset_changed(watcher_user, &stored);
}

/* kinds of what was heard since the last call */
static const char *kinds(void)
{
    static char text[KEPT + 1];
    for (int i = 0; i < n_heard; i++) text[i] = heard[i].kind;
    text[n_heard] = 0;
    n_heard = 0;
    return text;
}

/* ---- frames and triangles ---- */

static void a_frame_waits_for_its_asset(void)
{
    begin();
    hello(true);
    CHECK_TEXT(kinds(), "S");
    CHECK_INT(heard[0].n, 1);
    frame(0, 1, 1);
    frame(0, 1, 2);
    tidy(watcher_user);
    CHECK_INT(n_heard, 0);
    frame(1, 1, 1); /* a part that does not adapt has nothing to wait for */
    CHECK_TEXT(kinds(), "B");
    asset_comes();
    CHECK_TEXT(kinds(), "TB");
    CHECK_INT(heard[0].n, SLOTS);
    CHECK_INT(heard[0].change, 0);
    CHECK_INT(heard[1].n, 2); /* the newest */
    frame(0, 1, 3);
    CHECK_TEXT(kinds(), "B");
}

static void without_its_asset_it_is_shown_without_triangles(void)
{
    begin();
    hello(true);
    frame(0, 1, 1);
    change(1, 5, 1);
    frame(0, 1, 2);
    CHECK_TEXT(kinds(), "S");
    stored.failed = true;
    asset_changed(watcher_user, &stored);
    frame(0, 1, 3);
    CHECK_TEXT(kinds(), "BB");
    CHECK_INT(heard[0].change, 0);
}

static void triangles_come_before_the_first_frame_of_theirs(void)
{
    begin();
    stored.ready = true;
    hello(true);
    frame(0, 1, 1);
    CHECK_TEXT(kinds(), "STB");
    for (uint32_t k = 1; k < 4; k++) {
        now_ns += 16666667;
        change(1, 10 * k, k);
        /* their frame comes next: until then the last one is repeated, which is for the triangles of before */
        now_ns += 2000000000u;
        tidy(watcher_user);
        CHECK_TEXT(kinds(), "B");
        CHECK_INT(heard[0].change, 10 * (k - 1));
        frame(0, 1, k + 1);
        CHECK_TEXT(kinds(), "TB");
        CHECK_INT(heard[0].change, 10 * k);
        CHECK_INT(heard[0].n, SLOTS - k);
        CHECK_INT(heard[1].change, 10 * k);
        CHECK_INT(heard[1].n, k + 1);
        frame(0, 1, k + 1);
        CHECK_TEXT(kinds(), "B");
    }
}

/* who begins to listen while a part is at rest */
static void a_late_listener_gets_both(void)
{
    begin();
    stored.ready = true;
    hello(true);
    change(1, 7, 2);
    frame(0, 1, 1);
    CHECK_TEXT(kinds(), "STB");
    for (int k = 0; k < 8; k++) {
        now_ns += 250000001;
        tidy(watcher_user);
    }
    CHECK_TEXT(kinds(), "TBTB");
    CHECK_INT(heard[2].change, 7);
    CHECK_INT(heard[2].n, SLOTS - 2);
    CHECK_INT(heard[3].change, 7);
}

/* frames wait while more triangles change than the bus should carry, and the last one is not forgotten */
static void large_tables_are_bounded(void)
{
    const uint64_t table_ns = (uint64_t)(12e9 * (SLOTS - 1) / PAL_TRIANGLES_BYTES_S);
    begin();
    stored.ready = true;
    hello(true);
    n_heard = 0;
    int n_table = 0;
    for (uint32_t k = 1; k <= 100; k++) {
        n_heard = 0;
        change(1, k, 1);
        frame(0, 1, k);
        CHECK(n_heard == 0 || n_heard == 2);
        CHECK(n_heard == 0 || (heard[0].kind == 'T' && heard[1].change == heard[0].change && heard[1].n == (int)k));
        n_table += n_heard / 2;
        now_ns += table_ns / 10;
    }
    CHECK_INT(n_table, 10);
    now_ns += table_ns;
    n_heard = 0;
    tidy(watcher_user);
    CHECK_TEXT(kinds(), "TB");
    CHECK_INT(heard[1].change, 100);
}

static void an_edit_names_its_asset_before_its_frames(void)
{
    static pal_control c;
    begin();
    stored.ready = true;
    hello(true);
    change(1, 9, 1);
    frame(0, 1, 1);
    n_heard = 0;
    c = (pal_control){.type = PAL_CONTROL_TOPOLOGY, .topology = {.n_part = 2}};
    c.topology.part[0] = part_info(2, true);
    c.topology.part[1] = part_info(2, false);
    stored.ready = false;
    watcher->control(watcher_user, &c);
    CHECK_TEXT(kinds(), "S");
    CHECK_INT(heard[0].epoch, 2);
    frame(0, 1, 2); /* on its way when the topology changed */
    frame(1, 1, 2);
    now_ns += 2000000000u;
    tidy(watcher_user);
    CHECK_INT(n_heard, 0);
    change(2, 1, 3); /* from the new asset on */
    frame(0, 2, 3);
    frame(1, 2, 3);
    CHECK_TEXT(kinds(), "B");
    CHECK_INT(heard[0].part, 1);
    asset_comes();
    CHECK_TEXT(kinds(), "TB");
    CHECK_INT(heard[0].epoch, 2);
    CHECK_INT(heard[0].change, 1);
    CHECK_INT(heard[0].n, 1);
    CHECK_INT(heard[1].epoch, 2);
}

static void what_was_lost_with_the_server_is_not_repeated(void)
{
    begin();
    hello(true);
    frame(0, 1, 1);
    watcher->state(watcher_user, PAL_LINK_LOST, 1006, "");
    n_heard = 0;
    asset_comes();
    now_ns += 2000000000u;
    tidy(watcher_user);
    CHECK_INT(n_heard, 0);
}

/* ---- states of tools ---- */

static bool pressed; /* its button */

static void state(uint32_t seq, uint64_t source)
{
    uint8_t bytes[256];
    palpate_tool_state_t s;
    pal_lcm_from_pose(
        &(pal_wire_pose){.seq = seq, .quaternion = {1}, .stamp_us = 1, .buttons = pressed ? PAL_WIRE_GRASP : 0}, &s);
    const int n = palpate_tool_state_t_encode(bytes, 0, sizeof bytes, &s);
    REQUIRE(n > 0);
    bus->message(watcher_user, "PALPATE1/main/TOOL/0", bytes, (size_t)n, source);
}

/* a forged number far ahead used to make a sender's own states old */
static void numbers_of_states_do_not_jump(void)
{
    begin();
    hello(false);
    CHECK(bus->wants(watcher_user, "PALPATE1/main/TOOL/0"));
    CHECK(!bus->wants(watcher_user, "PALPATE1/other/TOOL/0"));
    CHECK(!bus->wants(watcher_user, "PALPATE1/main/BODY/0"));
    CHECK(!bus->wants(watcher_user, "PALPATE1/main/TOOL/32"));
    for (uint32_t seq = 1; seq <= 500; seq++) {
        state(seq, 7);
        CHECK_INT(pose.seq, seq);
        state(seq, 7);                        /* again */
        state(seq - 1, 7);                    /* older */
        state(seq + PAL_STATES_AHEAD + 2, 7); /* ahead */
        state(seq + 0x7fffffff, 7);
        now_ns += 4100000;
    }
    CHECK_INT(n_pose, 500);
    CHECK_INT(pal_lcm_bridge_count(bridge).n_state, 500);
    CHECK_INT(pal_lcm_bridge_count(bridge).n_state_refused, 2000);
    /* one that begins anew is another source (the channel was admitted to it: lcm_seal.h) */
    state(1, 8);
    CHECK_INT(pose.seq, 1);
    /* lost ones are made up for */
    now_ns += 1000000000;
    state(1 + 250 + PAL_STATES_AHEAD, 8);
    CHECK_INT(pose.seq, 1 + 250 + PAL_STATES_AHEAD);
}

/* a device that sends 1,000 states a second, of which 245 are passed on: among them each at which its button changes */
static void a_change_of_the_grasp_is_passed_on_at_once(void)
{
    begin();
    hello(false);
    for (uint32_t seq = 1; seq <= 2000; seq++) {
        pressed = seq % 100 >= 50;
        state(seq, 7);
        if (seq >= 50 && seq % 50 == 0) CHECK_INT(pose.seq, seq);
        now_ns += 1000000;
    }
    pressed = false;
    CHECK_LE(n_pose, 2 * 245 + 10);
}

/* as when palpate-lcm is started again, or the tool was given back after a silence */
static void a_sender_that_has_long_counted_is_taken(void)
{
    begin();
    hello(false);
    uint32_t seq = 100000;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 100; i++) {
            state(++seq, 7);
            CHECK_INT(pose.seq, seq);
            now_ns += 4100000;
        }
        state(seq, 7);
        CHECK_INT(n_pose, 100 * (k + 1));
        now_ns += 6000000000u;
        tidy(watcher_user);
        seq += 10000;
    }
}

static void refusals_are_counted_and_logged_once_a_second(void)
{
    begin();
    hello(false);
    for (int i = 0; i < 1000; i++) bus->refused(watcher_user, "PALPATE1/main/TOOL/0", "it is a test");
    CHECK_INT(pal_lcm_bridge_count(bridge).n_state_refused, 1000);
    CHECK_INT(pal_lcm_bridge_count(bridge).n_logged, 1);
    now_ns += 1000000000;
    bus->refused(watcher_user, "PALPATE1/main/TOOL/0", "it is a test");
    CHECK_INT(pal_lcm_bridge_count(bridge).n_logged, 2);
}

int main(void)
{
    if (pal_frame_order_create(rest, VERTICES, load_tri, SLOTS, &asset.order) ||
        pal_frame_encoder_create(rest, asset.order, &encoder))
        return 1;
    RUN(a_frame_waits_for_its_asset);
    RUN(without_its_asset_it_is_shown_without_triangles);
    RUN(triangles_come_before_the_first_frame_of_theirs);
    RUN(a_late_listener_gets_both);
    RUN(large_tables_are_bounded);
    RUN(an_edit_names_its_asset_before_its_frames);
    RUN(what_was_lost_with_the_server_is_not_repeated);
    RUN(numbers_of_states_do_not_jump);
    RUN(a_change_of_the_grasp_is_passed_on_at_once);
    RUN(a_sender_that_has_long_counted_is_taken);
    RUN(refusals_are_counted_and_logged_once_a_second);
    pal_lcm_bridge_close(bridge);
    pal_frame_encoder_destroy(encoder);
    pal_frame_order_destroy(asset.order);
    return check_report();
}
