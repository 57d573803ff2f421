/* Poses that a client gives to its link before the socket takes one: what arrives at the session are the newest, and
 * those at which the grasp changed or the tool left. Over a real websocket. */
#include "clients/link/link.h"
#include "server/net/server.h"
#include "tests/net/hub_scene.h"

#include <pthread.h>

enum { N_POSE = 9, ARRIVED_MAX = 16 };

static pal_link_loop *loop;
static pal_link *link_;
static uint32_t arrived[ARRIVED_MAX]; /* numbers of poses, 0: away [n_arrived]; the server's thread writes them */
static int n_arrived;

pal_err __wrap_pal_session_request_pose(pal_session *session, int tool, const pal_pose *pose);
pal_err __wrap_pal_session_request_pose(pal_session *session, int tool, const pal_pose *pose)
{
    (void)session;
    if (tool == 0 && n_arrived < ARRIVED_MAX) arrived[n_arrived++] = pose ? pose->seq : 0;
    if (pose && pose->seq == N_POSE) pal_link_stop(loop);
    return PAL_ERR_OK;
}

static void put(bool grasps, bool away)
{
    static uint32_t seq;
    const pal_wire_pose pose = {.flags = away ? PAL_WIRE_POSE_AWAY : 0,
                                .seq = ++seq,
                                .quaternion = {1},
                                .buttons = grasps ? PAL_WIRE_GRASP : 0};
    CHECK_INT(pal_link_send_pose(link_, &pose), PAL_ERR_OK);
}

/* all within one turn of the loop: free, pressed at 2, let go at 4, away at 6, back */
static void on_state(void *user, pal_link_state state, int code, const char *reason)
{
    (void)user, (void)code, (void)reason;
    if (state != PAL_LINK_JOINED) return;
    CHECK_INT(pal_link_tool(link_), 0);
    put(false, false), put(true, false), put(true, false);
    put(false, false), put(false, false);
    put(false, true), put(false, true);
    put(false, false), put(false, false);
}

static void *net_main(void *server)
{
    return pal_server_run(server) ? server : NULL;
}

static void a_link_keeps_the_newest_pose_and_the_edges_before_it(void)
{
    static const pal_link_events events = {.state = on_state};
    static small_scene organ;
    pal_session *session = NULL;
    pal_server *server = NULL;
    static pal_server_gate gate;
    pal_diagnostic diag = {""};
    pthread_t net;
    void *failed = NULL;
    char url[64];
    REQUIRE(small_scene_make(&organ, "organ"));
    const pal_session_options options = {.start_paused = true, .wake = pal_server_gate_wake, .user = &gate};
    REQUIRE(!pal_session_open(&organ.scene, &options, &diag, &session));
    REQUIRE(!pal_server_open(&(pal_server_options){.open = true}, &session, 1, &diag, &server));
    pal_server_connect(server, &gate);
    snprintf(url, sizeof url, "ws://127.0.0.1:%d/ws", pal_server_port(server));
    REQUIRE(!pal_link_loop_create(&loop));
    pthread_create(&net, NULL, net_main, server);
    const pal_link_options join = {.url = url, .role = PAL_WIRE_ROLE_TRAINEE, .tool = 0, .events = &events};
    REQUIRE(!pal_link_open(loop, &join, &diag, &link_));
    pal_link_run(loop);
    pal_server_stop(server);
    pthread_join(net, &failed);
    CHECK(!failed);
    static const uint32_t wanted[] = {2, 4, 0, N_POSE};
    REQUIRE(n_arrived >= 4);
    for (int k = 0; k < 4; k++) CHECK_INT(arrived[k], wanted[k]);
    pal_link_close(link_);
    pal_link_loop_destroy(loop);
    pal_server_close(server);
    pal_session_close(session);
    pal_prepared_free(&organ.mesh);
}

int main(void)
{
    RUN(a_link_keeps_the_newest_pose_and_the_edges_before_it);
    return check_report();
}
