/* A server that ends in order: recordings are complete before anybody learns of it, members are told where to go, and
 * they find the session there as it was. */
#include "protocol/ticket.h"
#include "server/base/key_file.h"
#include "server/net/admission/ticket_keys.h"
#include "server/session/replay.h"
#include "server/session/resume.h"
#include "tests/net/command_room.h"
#include "tests/session/sculpt_body.h"

#include <time.h>
#include <unistd.h>

enum { MEMBERS = 4 };
static clay_scene clay;
static char path[] = "/tmp/palpate_drain_XXXXXX", keys_path[] = "/tmp/palpate_drain_keys_XXXXXX";
static mem_client member[MEMBERS];

/* the recordings of a test before */
static void forget(void)
{
    for (int k = 1; k < 4; k++) {
        char name[64];
        snprintf(name, sizeof name, k > 1 ? "%s.%d" : "%s", path, k);
        unlink(name);
    }
}

static void sign(uint32_t expires_s, char text[PAL_TICKET_TEXT])
{
    pal_ticket_keys keys;
    pal_diagnostic diag = {""};
    REQUIRE(!pal_ticket_keys_read(keys_path, &keys, &diag));
    const pal_ticket ticket = {
        .role = PAL_WIRE_ROLE_TRAINEE, .tool = PAL_WIRE_TOOL_ANY, .expires_s = expires_s, .nonce = expires_s};
    CHECK(pal_ticket_put(&ticket, &keys.key[keys.n - 1], text));
}

static void enter(int k, const char *ticket, bool moves)
{
    pal_control join = {
        .type = PAL_CONTROL_JOIN,
        .join = {.role = PAL_WIRE_ROLE_TRAINEE, .tool = k < 2 ? k : PAL_WIRE_TOOL_NONE, .moves = moves}};
    snprintf(join.join.name, sizeof join.join.name, "member %d", k);
    mem_connect(&member[k], transport, "", ticket);
    mem_send(&member[k], &join);
    mem_pull(&member[k], 1000);
    REQUIRE(member[k].asset);
}

static void turn_all(void)
{
    served_turn(FRAME_NS, &member[0], &member[1]);
    for (int k = 2; k < MEMBERS; k++) mem_pull(&member[k], 1000);
}

/* all messages that wait are read; the sessions may have ended */
static void read_all(void)
{
    pal_server_advance(server);
    for (int k = 0; k < MEMBERS; k++) mem_pull(&member[k], 1000);
}

/* two members press while two watch */
static void play(int n)
{
    static uint32_t seq;
    for (int i = 0; i < n; i++) {
        const double phase = 0.02 * ++seq;
        mem_pose(&member[0], 0, seq, (const double[3]){0.03 * sin(phase), 0.02, 0.055 - 0.01 * cos(phase)});
        mem_pose(&member[1], 1, seq, (const double[3]){0.055 + 0.008 * cos(phase), 0, 0.02 * sin(phase)});
        turn_all();
    }
}

typedef struct last_state {
    double x[3 * 4096];
    int n;
} last_state;
static last_state exact, resumed;
static pal_replay_report report;

static void keep_state(void *user, const pal_world *world)
{
    last_state *to = user;
    const pal_body *body = pal_world_view_body(world, 0);
    to->n = body->n_dof < 4096 ? body->n_dof : 4096;
    memcpy(to->x, body->x, 3 * sizeof(double) * (size_t)to->n);
}

static bool step_on(void *user, const pal_world *world, double fraction)
{
    (void)user, (void)world, (void)fraction;
    return true;
}

/* the file is whole, and whoever goes on from it has the last state to the bit */
static void check_recording(void)
{
    pal_diagnostic diag = {""};
    pal_resume *resume = NULL;
    pal_err err = pal_replay_run(path, &clay.scene, &(pal_replay_watch){step_on, &exact, keep_state}, &report, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    CHECK_TEXT(report.cut, "");
    CHECK_INT(report.n_hash_equal, report.n_hash);
    REQUIRE(!pal_resume_open(path, &clay.scene, &diag, &resume) && resume);
    pal_world *world = pal_resume_take_world(resume);
    keep_state(&resumed, world);
    CHECK_INT(resumed.n, exact.n);
    CHECK(exact.n > 0 && !memcmp(resumed.x, exact.x, 3 * sizeof(double) * (size_t)exact.n));
    pal_world_destroy(world);
    pal_resume_free(resume);
}

static void members_are_sent_to_a_session_that_is_complete(void)
{
    char lasting[PAL_TICKET_TEXT], short_lived[PAL_TICKET_TEXT];
    const uint32_t now_s = (uint32_t)time(NULL);
    sign(now_s + 86400, lasting);
    sign(now_s + 30, short_lived);
    forget();
    served_guarded = true;
    served_begin(&clay.scene, (pal_session_options){.record_path = path},
                 (pal_server_options){.drain_to = "https://b.example/", .key_file = keys_path});
    enter(0, lasting, true), enter(1, short_lived, true), enter(2, "", true), enter(3, "", false);
    play(80);
    pal_server_drain(server);
    check_recording();
    for (int k = 0; k < MEMBERS; k++) {
        mem_pull(&member[k], 1000);
        const pal_wire_move *move = &member[k].last[PAL_CONTROL_MOVE].move;
        CHECK_INT(member[k].n_text[PAL_CONTROL_MOVE], k < 3);
        CHECK_INT(pal_mem_code(member[k].peer), 0);
        if (k == 3) continue; /* it does not know the message */
        CHECK_TEXT(move->address, "https://b.example/");
        CHECK_TEXT(move->session, "clay");
        CHECK_INT(move->ticket[0] != 0, k == 1); /* the only one whose ticket would not last */
    }
    /* nothing is taken any more */
    const int n_error = member[0].n_text[PAL_CONTROL_ERROR];
    send(&member[0], "pause", "");
    read_all();
    CHECK_INT(member[0].n_text[PAL_CONTROL_ERROR], n_error);
    pal_mem_peer *late = pal_mem_connect(transport, "");
    CHECK_INT(pal_mem_code(late), PAL_WIRE_CLOSE_GOING_AWAY);
    pal_reply reply;
    pal_mem_get(transport, "/readyz", &reply);
    CHECK_INT(reply.status, 503);
    pal_packet_drop(reply.body);
    pal_server_goodbye(server);
    for (int k = 0; k < MEMBERS; k++) CHECK_INT(pal_mem_code(member[k].peer), PAL_WIRE_CLOSE_GOING_AWAY);
    for (int k = 0; k < MEMBERS; k++) mem_end(&member[k]);
    end();
}

/* the other server, from the file alone: the members come in, their picture is the last state, and it moves on */
static void they_come_back_into_it(void)
{
    pal_diagnostic diag = {""};
    pal_resume *resume = NULL;
    REQUIRE(!pal_resume_open(path, &clay.scene, &diag, &resume) && resume);
    const double time_s = pal_resume_time_s(resume);
    served_guarded = false;
    served_session(pal_resume_scene(resume), (pal_session_options){.record_path = path, .resume = resume});
    served_open((pal_server_options){.resume = &resume});
    for (int k = 0; k < MEMBERS; k++) enter(k, "", true);
    CHECK_INT(member[3].last[PAL_CONTROL_HELLO].hello.n_tool, 2);
    play(30);
    CHECK_INT(member[0].last[PAL_CONTROL_MEMBERS].members.n_member, MEMBERS);
    CHECK(member[0].last[PAL_CONTROL_STATUS].status.sim_time_s > time_s);
    for (int k = 0; k < MEMBERS; k++) CHECK(member[k].n_tools > 10 && member[k].n_bad == 0);
    for (int k = 0; k < MEMBERS; k++) mem_end(&member[k]);
    end();
    pal_resume_free(resume);
}

/* without an address the server says goodbye alone, and the recording is complete all the same */
static void without_an_address_nobody_is_sent_away(void)
{
    forget();
    served_guarded = false;
    served_begin(&clay.scene, (pal_session_options){.record_path = path}, (pal_server_options){0});
    for (int k = 0; k < MEMBERS; k++) enter(k, "", true);
    play(20);
    pal_server_drain(server);
    pal_server_drain(server); /* twice is once */
    check_recording();
    for (int k = 0; k < MEMBERS; k++) {
        mem_pull(&member[k], 1000);
        CHECK_INT(member[k].n_text[PAL_CONTROL_MOVE], 0);
    }
    pal_server_goodbye(server);
    for (int k = 0; k < MEMBERS; k++) CHECK_INT(pal_mem_code(member[k].peer), PAL_WIRE_CLOSE_GOING_AWAY);
    for (int k = 0; k < MEMBERS; k++) mem_end(&member[k]);
    end();
}

/* a job that is under way ends first, and what it made of the session is what the recording ends with */
static void an_edit_under_way_is_waited_for(void)
{
    forget();
    served_begin(&clay.scene, (pal_session_options){.record_path = path}, (pal_server_options){0});
    for (int k = 0; k < MEMBERS; k++) enter(k, "", true);
    play(20);
    send(&member[0], "extrude", "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.05,\"distance_m\":0.03");
    send(&member[1], "extrude", "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.08,\"distance_m\":0.03");
    pal_server_drain(server);
    read_all();
    pal_server_goodbye(server);
    CHECK_INT(member[0].n_text[PAL_CONTROL_ANSWER], 1);
    CHECK_INT(member[1].n_text[PAL_CONTROL_ANSWER], 0); /* it waited behind the other */
    const int n_before = exact.n;
    check_recording();
    CHECK_INT((int)report.n_change, 1);
    CHECK(exact.n > n_before);
    for (int k = 0; k < MEMBERS; k++) mem_end(&member[k]);
    end();
}

static void addresses_are_checked(void)
{
    static const char *const bad[] = {"b.example", "wss://b.example", "https://",
                                      "http:///x", "http://b/x",      "http://b?x"};
    static const char *const good[] = {"http://b", "https://b.example:8090/", "http://[::1]:8090"};
    served_session(&clay.scene, (pal_session_options){0});
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        pal_diagnostic diag = {""};
        pal_server *none = NULL;
        const pal_server_options options = {.transport = &pal_mem_transport, .drain_to = bad[k]};
        CHECK_INT(pal_server_open(&options, &session, 1, &diag, &none), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "--drain-to") && strstr(diag.text, bad[k]));
    }
    for (size_t k = 0; k < sizeof good / sizeof *good; k++) {
        served_open((pal_server_options){.drain_to = good[k]});
        pal_server_close(server);
    }
    pal_session_close(session);
}

int main(void)
{
    int id;
    pal_diagnostic diag = {""};
    const int fd = mkstemp(path), keys = mkstemp(keys_path);
    if (fd < 0 || keys < 0 || close(fd) || close(keys) || unlink(keys_path)) return 1;
    if (pal_key_file_add(keys_path, &id, &diag)) return 1;
    clay_make(&clay, 1, 0.1);
    RUN(members_are_sent_to_a_session_that_is_complete);
    RUN(they_come_back_into_it);
    RUN(without_an_address_nobody_is_sent_away);
    RUN(an_edit_under_way_is_waited_for);
    RUN(addresses_are_checked);
    clay_free(&clay);
    unlink(keys_path);
    forget();
    return check_report();
}
