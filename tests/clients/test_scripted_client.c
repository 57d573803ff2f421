/* What the client programs are made of and needs no server: addresses, flags, scripts, samples. */
#include "clients/link/asset_store.h"
#include "clients/link/end_condition.h"
#include "clients/link/link.h"
#include "clients/scripted_client/orders.h"
#include "clients/scripted_client/samples.h"
#include "clients/scripted_client/script.h"
#include "clients/scripted_client/scripted_client.h"
#include "server/base/flags.h"
#include "tests/check.h"

#include <pthread.h>

static void addresses_are_understood_or_refused_by_name(void)
{
    static const pal_link_events events = {.state = NULL};
    pal_link_loop *loop = NULL;
    REQUIRE(pal_link_loop_create(&loop) == PAL_ERR_OK);
    const char *const good[] = {
        "ws://127.0.0.1:8090/ws",          "http://localhost", "ws://[::1]:1/ws?session=x", "ws://h/", "wss://h/ws",
        "https://h:8443/?session=x#ticket"};
    const char *const bad[] = {
        "",          "ftp://h/ws",        "ws://", "ws://:80", "ws://h:0", "ws://h:70000", "ws://h:1x/ws",
        "ws://[::1", "file:///etc/passwd"};
    for (int i = 0; i < 6; i++) {
        pal_link *link = NULL;
        CHECK_INT(pal_link_open(loop, &(pal_link_options){.url = good[i], .events = &events}, NULL, &link), PAL_ERR_OK);
        pal_link_close(link);
    }
    for (int i = 0; i < 9; i++) {
        pal_link *link = NULL;
        pal_diagnostic diag = {""};
        CHECK_INT(pal_link_open(loop, &(pal_link_options){.url = bad[i], .events = &events}, &diag, &link),
                  PAL_ERR_REFUSED);
        CHECK(link == NULL && strstr(diag.text, bad[i]) != NULL);
    }
    pal_link_loop_destroy(loop);
}

typedef struct seen {
    pal_link_loop *loop;
    int connecting, lost, ticks, ticks_between;
} seen;
static void on_state(void *user, pal_link_state state, int code, const char *reason)
{
    seen *s = user;
    (void)code;
    s->connecting += state == PAL_LINK_CONNECTING;
    /* timers fire in the order of their times: one of 5 ms comes before the next try */
    if (state == PAL_LINK_CONNECTING && s->lost > 0) CHECK(s->ticks > s->ticks_between);
    s->ticks_between = s->ticks;
    s->lost += state == PAL_LINK_LOST;
    if (state == PAL_LINK_LOST) CHECK(reason[0] != 0);
    if (s->lost == 3) pal_link_stop(s->loop);
}
static void on_tick(void *user)
{
    ((seen *)user)->ticks++;
}

/* nobody listens on port 1: tries follow each other with growing pauses, other work goes on meanwhile */
static void link_without_a_server_tries_again_and_blocks_nobody(void)
{
    static const pal_link_events events = {.state = on_state};
    seen s = {0};
    pal_link *link = NULL;
    REQUIRE(pal_link_loop_create(&s.loop) == PAL_ERR_OK);
    pal_link_options o = {.url = "ws://127.0.0.1:1/ws", .events = &events, .user = &s};
    REQUIRE(pal_link_open(s.loop, &o, NULL, &link) == PAL_ERR_OK);
    CHECK(pal_link_add_timer(s.loop, 5000, on_tick, &s) != NULL);
    CHECK_INT(pal_link_send_pose(link, &(pal_wire_pose){.quaternion = {1, 0, 0, 0}}), PAL_ERR_STATE);
    pal_link_run_for(s.loop, 150);
    CHECK_INT(s.lost, 3);
    CHECK_INT(s.connecting, 3);
    pal_link_close(link);
    pal_link_loop_destroy(s.loop);
}

static void *stop_from_outside(void *loop)
{
    pal_link_stop(loop);
    return NULL;
}
static void another_thread_may_stop_the_loop(void)
{
    seen s = {0};
    pthread_t thread;
    REQUIRE(pal_link_loop_create(&s.loop) == PAL_ERR_OK);
    REQUIRE(pthread_create(&thread, NULL, stop_from_outside, s.loop) == 0);
    pal_link_run(s.loop);
    pthread_join(thread, NULL);
    pal_link_loop_destroy(s.loop);
}

static void flags_are_taken_from_the_table_and_the_rest_refused(void)
{
    bool loud = false;
    double rate = 5;
    const char *name = "x", *stall = NULL, *operand[1] = {NULL};
    pal_flag_common common;
    const pal_flag flag[] = {{"--loud", NULL, PAL_FLAG_SWITCH, &loud, 0, 0, ""},
                             {"--rate", "HZ", PAL_FLAG_NUMBER, &rate, 1, 100, ""},
                             {"--name", "N", PAL_FLAG_TEXT, &name, 0, 0, ""},
                             {"--stall", "S", PAL_FLAG_OPTIONAL, &stall, 0, 0, ""}};
    const pal_flag_table table = {.program = "test", .usage = "URL", .about = "", PAL_FLAGS(flag), .operands = {1, 1}};
    char *good[] = {"test", "--rate=7", "url", "--stall", "--loud", "--name", "Ada"};
    CHECK_INT(pal_flags_parse(&table, 7, good, &common, operand, NULL), -1);
    CHECK(loud && rate == 7);
    CHECK_TEXT(operand[0], "url");
    CHECK_TEXT(name, "Ada");
    CHECK_TEXT(stall, "");
    char *const bad[][3] = {{"test", "url", "--rat"},    {"test", "url", "--rate=0"}, {"test", "url", "--rate=x"},
                            {"test", "url", "--loud=1"}, {"test", "url", "url2"},     {"test", "--loud", "--loud"},
                            {"test", "url", "--name"}};
    FILE *quiet = freopen("/dev/null", "w", stderr);
    CHECK(quiet != NULL);
    for (int i = 0; i < 7; i++) {
        char *words[3] = {bad[i][0], bad[i][1], bad[i][2]};
        CHECK_INT(pal_flags_parse(&table, 3, words, &common, operand, NULL), 2);
    }
}

static void scripts_go_through_their_points_and_repeat(void)
{
    pal_script script;
    double offset[3];
    uint32_t buttons;
    REQUIRE(pal_script_load(&script, "press", 0.01, 0.005, NULL) == PAL_ERR_OK);
    pal_script_at(&script, 1.0, offset, &buttons);
    CHECK_NEAR(offset[2], 0.005, 1e-12);
    CHECK_INT(buttons, 0);
    pal_script_at(&script, 0.4, offset, &buttons);
    CHECK_NEAR(offset[2], (0.02 + 0.005) / 2, 1e-12);
    pal_script_at(&script, 2.4, offset, &buttons);
    CHECK_NEAR(offset[2], (0.02 + 0.005) / 2, 1e-12);
    REQUIRE(pal_script_load(&script, "pull", 0.01, 0.005, NULL) == PAL_ERR_OK);
    pal_script_at(&script, 1.7, offset, &buttons);
    CHECK_INT(buttons, 1);
    CHECK_NEAR(offset[2], 0.02, 1e-12);
    REQUIRE(pal_script_load(&script, "circle", 0.01, 0.004, NULL) == PAL_ERR_OK);
    for (int i = 0; i < 30; i++) {
        pal_script_at(&script, 0.1 * i, offset, &buttons);
        CHECK_NEAR(hypot(offset[0] + 0.006, offset[1]), 0.006, 1e-4);
    }
}

static void script_files_are_refused_with_their_line(void)
{
    char path[] = "/tmp/palpate_scriptXXXXXX";
    const int fd = mkstemp(path);
    REQUIRE(fd >= 0);
    const char *const text[] = {"0 0 0 0 0\n1 0 0 nan 0\n", "0 0 0 0 0\n\n# x\n0 0 0 0 1\n", "0 0 0\n", "\n"};
    const char *const where[] = {":2:", ":4:", ":1:", "has no line"};
    for (int i = 0; i < 4; i++) {
        pal_script script;
        pal_diagnostic diag = {""};
        CHECK(ftruncate(fd, 0) == 0 && pwrite(fd, text[i], strlen(text[i]), 0) == (ssize_t)strlen(text[i]));
        CHECK_INT(pal_script_load(&script, path, 0.01, 0.01, &diag), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, where[i]) != NULL);
    }
    close(fd);
    unlink(path);
    pal_script script;
    CHECK_INT(pal_script_load(&script, path, 0.01, 0.01, NULL), PAL_ERR_IO);
}

static void samples_give_percentiles_and_merge(void)
{
    pal_samples a = {0}, b = {0};
    for (int i = 100; i >= 1; i--) pal_samples_add(i % 2 ? &a : &b, i);
    pal_samples_merge(&a, &b);
    CHECK_INT(a.n, 100);
    CHECK_NEAR(pal_samples_at(&a, 0.5), 51, 0);
    CHECK_NEAR(pal_samples_at(&a, 0.99), 100, 0);
    CHECK_NEAR(pal_samples_mean(&a), 50.5, 1e-12);
    CHECK_NEAR(a.max, 100, 0);
    pal_samples none = {0};
    CHECK_NEAR(pal_samples_at(&none, 0.5), 0, 0);
    pal_samples_free(&a);
    pal_samples_free(&b);
}

static void touched_point_is_the_outermost_along_up(void)
{
    float rest[] = {0, 0, 0, 0.1f, 0, 0.05f, -0.1f, 0, 0.04f, 0, 0.2f, -0.1f};
    pal_frame_order order = {.n_vertex = 4};
    const pal_asset asset = {.rest_m = rest, .order = &order};
    double point[3];
    const double up[3] = {0, 0, 1}, side[3] = {0, 1, 0}, near[3] = {-0.1, 0, 0};
    CHECK(pal_asset_extreme_vertex(&asset, up, point));
    CHECK_NEAR(point[0], 0.1, 1e-7);
    CHECK(pal_asset_extreme_vertex(&asset, side, point));
    CHECK_NEAR(point[1], 0.2, 1e-7);
    CHECK(pal_asset_extreme_vertex_near(&asset, up, near, 0.05, point));
    CHECK_NEAR(point[0], -0.1, 1e-7);
    order.n_vertex = 0;
    CHECK(!pal_asset_extreme_vertex(&asset, up, point));
}

static bool orders_of(const char *text, pal_orders *out, pal_diagnostic *diag)
{
    char path[] = "/tmp/palpate_orders_XXXXXX";
    int fd = mkstemp(path);
    FILE *file = fd < 0 ? NULL : fdopen(fd, "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0);
    pal_err err = pal_orders_load(out, path, diag);
    unlink(path);
    return !err;
}

static void orders_are_read_or_refused_with_their_line(void)
{
    static const struct {
        const char *text, *word;
    } bad[] = {{"", "has no order"},
               {"# nothing\n\n", "has no order"},
               {"0 undo\nsoon redo\n", ":2: wants"},
               {"-1 undo\n", ":1: wants"},
               {"nan undo\n", ":1: wants"},
               {"1\n", ":1: has no verb"},
               {"1 undo\n0.5 redo\n", ":2: time 0.5 s is before"},
               {"1 cut nx=\n", "\"nx=\" is no number"},
               {"1 cut nx=1e999\n", "\"nx=1e999\" is no number"},
               {"1 cut =3\n", "is not key=value"},
               {"1 delete at=none\n", "is no side"},
               {"1 x a=1 b=1 c=1 d=1 e=1 f=1 g=1 h=1 i=1 j=1 k=1 l=1 m=1 n=1 o=1 p=1 q=1\n", "one number too many"},
               {"1 cut nnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnn=1\n", "too long a name"}};
    pal_orders orders;
    pal_diagnostic diag = {""};
    REQUIRE(
        orders_of("# all\n 0.5 undo # back\n? 1 extrude at=top distance_m=0.02 target=liver\n1 bridge at=left at2=back",
                  &orders, &diag));
    CHECK_INT(orders.n_line, 3);
    CHECK_TEXT(orders.line[0].order.verb, "undo");
    CHECK(!orders.line[0].may_fail && orders.line[1].may_fail);
    CHECK_INT(orders.line[1].number, 3);
    CHECK_TEXT(orders.line[1].order.target, "liver");
    CHECK(orders.line[1].at[0] == PAL_SIDE_TOP && orders.line[2].at[1] == PAL_SIDE_BACK);
    CHECK_INT(orders.line[1].order.n_arg, 1);
    CHECK_NEAR(orders.line[1].order.arg[0].value, 0.02, 0);
    pal_orders_free(&orders);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        CHECK(!orders_of(bad[i].text, &orders, &diag));
        CHECK(strstr(diag.text, bad[i].word) != NULL);
        CHECK(orders.line == NULL);
    }
    CHECK_INT(pal_orders_load(&orders, "/nowhere/orders", &diag), PAL_ERR_IO);
}

/* corners and face centres of a cube of 2 m: a side's place is in the middle of its face */
static void a_side_is_the_middle_of_what_lies_furthest(void)
{
    static const float x[][3] = {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1}, {-1, -1, 1},
                                 {1, -1, 1},   {-1, 1, 1},  {1, 1, 1},   {0, 0, 1},  {0, 0, -1},
                                 {0, -1, 0},   {0, 1, 0},   {-1, 0, 0},  {1, 0, 0}};
    const pal_order_line line = {.at = {PAL_SIDE_TOP, PAL_SIDE_LEFT}, .order = {.verb = "bridge", .n_arg = 0}};
    pal_wire_command order;
    double at[3];
    for (int side = PAL_SIDE_TOP; side < PAL_SIDE_COUNT; side++) {
        REQUIRE(pal_side_point(x[0], sizeof x / sizeof *x, (pal_side)side, at));
        const float *wanted = x[8 + side - PAL_SIDE_TOP];
        for (int c = 0; c < 3; c++) CHECK_NEAR(at[c], (double)wanted[c], 0);
    }
    CHECK(!pal_side_point(x[0], 0, PAL_SIDE_TOP, at));
    REQUIRE(pal_order_fill(&line, x[0], sizeof x / sizeof *x, &order));
    CHECK_INT(order.n_arg, 6);
    CHECK_TEXT(order.arg[3].key, "x2_m");
    CHECK_NEAR(order.arg[2].value, 1, 0);
    CHECK_NEAR(order.arg[3].value, -1, 0);
}

static pal_err until_parse(pal_end_condition *until, const char *text, pal_diagnostic *diag)
{
    return pal_end_condition_parse(until, pal_client_seen_name, PAL_CLIENT_SEEN_COUNT, text, diag);
}
static bool until_met(const pal_end_condition *until, const pal_scripted_client_result *r)
{
    double amount[PAL_CLIENT_SEEN_COUNT];
    pal_client_seen(r, amount);
    return pal_end_condition_met(until, amount);
}

static void what_is_waited_for_is_reached_when_all_of_it_is(void)
{
    pal_end_condition until;
    pal_scripted_client_result r = {.n_frame = 7, .moved_m = 0.003};
    CHECK_INT(until_parse(&until, "frames=8,moved_mm=2.5", NULL), PAL_ERR_OK);
    CHECK(!until_met(&until, &r));
    r.n_frame = 8;
    CHECK(until_met(&until, &r));
    r.moved_m = 0.0024;
    CHECK(!until_met(&until, &r));
    CHECK_INT(until_parse(&until, "", NULL), PAL_ERR_OK);
    CHECK(!until_met(&until, &r)); /* nothing is never reached: the time ends it */
    static const char *const bad[] = {"frame=1",  "frames",    "frames=", "frames=x",
                                      "frames=0", "frames=1x", "=1",      "frames=1,,"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        pal_diagnostic diag = {""};
        CHECK_INT(until_parse(&until, bad[i], &diag), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "until: \"") == diag.text);
    }
}

int main(void)
{
    RUN(addresses_are_understood_or_refused_by_name);
    RUN(link_without_a_server_tries_again_and_blocks_nobody);
    RUN(another_thread_may_stop_the_loop);
    RUN(scripts_go_through_their_points_and_repeat);
    RUN(script_files_are_refused_with_their_line);
    RUN(samples_give_percentiles_and_merge);
    RUN(touched_point_is_the_outermost_along_up);
    RUN(flags_are_taken_from_the_table_and_the_rest_refused);
    RUN(orders_are_read_or_refused_with_their_line);
    RUN(a_side_is_the_middle_of_what_lies_furthest);
    RUN(what_is_waited_for_is_reached_when_all_of_it_is);
    return check_report();
}
