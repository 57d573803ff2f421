/* A session served on mem:// as tests of the hub use it: opened, turned, closed. One of them at a time. */
#ifndef TESTS_NET_SERVED_H
#define TESTS_NET_SERVED_H
#include "server/net/server.h"
#include "tests/net/mem_client.h"

#include <time.h>

#define FRAME_NS 16666667ull

static pal_session *session;
static pal_server *server;
static pal_server_gate *gate;
static pal_transport *transport;
static uint64_t now_ns;

static inline void served_session(const pal_scene *scene, pal_session_options options)
{
    pal_diagnostic diag = {""};
    gate = pal_server_gate_create();
    options.lease_s = 60, options.wake = pal_server_gate_wake, options.user = gate;
    if (pal_session_open(scene, &options, &diag, &session)) CHECK_FAIL("no session: %s", diag.text);
}

/* the session that is there */
static inline void served_open(pal_server_options net)
{
    pal_diagnostic diag = {""};
    net.transport = "mem";
    if (pal_server_open(&net, &session, 1, &diag, &server)) CHECK_FAIL("no server: %s", diag.text);
    pal_server_connect(server, gate);
    transport = pal_server_transport(server);
    now_ns = 1000000000ull;
}

static inline void served_begin(const pal_scene *scene, pal_session_options options, pal_server_options net)
{
    served_session(scene, options);
    served_open(net);
}

static inline void end(void)
{
    pal_server_close(server);
    pal_session_close(session);
    pal_server_gate_destroy(gate);
    CHECK_INT(pal_packet_total(), 0);
}

/* the loop goes on by step_ns; clients read, or their queues would fill */
static inline void served_turn(uint64_t step_ns, mem_client *a, mem_client *b)
{
    now_ns += step_ns;
    pal_server_advance(server, now_ns);
    if (a) mem_pull(a, 1000);
    if (b) mem_pull(b, 1000);
    nanosleep(&(struct timespec){0, step_ns > FRAME_NS ? 2000000 : 500000}, NULL);
}

#define UNTIL(condition, a, b)                                                                                         \
    do {                                                                                                               \
        for (int turns = 0; !(condition) && turns < 10000; turns++) turn(a, b);                                        \
        CHECK(condition);                                                                                              \
    } while (0)
#endif
