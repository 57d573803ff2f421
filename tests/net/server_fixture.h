/* A session served to peers inside the process, as tests of the hub use it: opened, turned, closed. One of them at a
 * time. The clock of session and hub is the test's own: frames after a number of turns are exact. */
#ifndef TESTS_NET_SERVED_H
#define TESTS_NET_SERVED_H
#include "server/net/server.h"
#include "tests/fixtures/manual_clock.h"
#include "tests/net/mem_client.h"

#define FRAME_NS 16666667ull

static pal_session *session;
static pal_server *server;
static pal_server_gate gate;
static pal_transport *transport;
static bool served_guarded; /* without a ticket a client is a viewer; else it is what it asks to be */
static manual_clock served_clock;
static uint64_t served_step_ns; /* of the scene as opened */

static inline void served_session(const pal_scene *scene, pal_session_options options)
{
    pal_diagnostic diag = {""};
    manual_clock_init(&served_clock, 1000000000u);
    served_step_ns = (uint64_t)(1e9 * scene->step_s + 0.5);
    options.clock = &served_clock.clock;
    options.lease_s = 60, options.wake = pal_server_gate_wake, options.user = &gate;
    if (pal_session_open(scene, &options, &diag, &session)) CHECK_FAIL("no session: %s", diag.text);
    manual_clock_settle(&served_clock, 1);
}

/* the session that is there */
static inline void served_open(pal_server_options net)
{
    pal_diagnostic diag = {""};
    net.transport = &pal_mem_transport;
    net.open = !served_guarded;
    if (pal_server_open(&net, &session, 1, &diag, &server)) CHECK_FAIL("no server: %s", diag.text);
    pal_server_connect(server, &gate);
    transport = pal_server_transport(server);
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
    CHECK_INT(pal_packet_total(), 0);
}

static inline void served_serve(mem_client *a, mem_client *b)
{
    pal_server_advance(server);
    if (a) mem_pull(a, 1000);
    if (b) mem_pull(b, 1000);
}

/* The time goes on by ns: every step that is due is made, then the loop is turned and the clients read, or their queues
 * would fill. Not while a job replaces the session, whose thread then stands still. */
static inline void served_turn(uint64_t ns, mem_client *a, mem_client *b)
{
    for (uint64_t part; ns > 0; ns -= part) {
        part = ns < served_step_ns ? ns : served_step_ns;
        manual_clock_advance(&served_clock, part);
        manual_clock_settle(&served_clock, 1);
    }
    served_serve(a, b);
}

#define UNTIL(condition, a, b)                                                                                         \
    do {                                                                                                               \
        for (int turns = 0; !(condition) && turns < 10000; turns++) turn(a, b);                                        \
        CHECK(condition);                                                                                              \
    } while (0)

/* For what another thread (a job, an estimator) does at its own pace: turns after each of its wakes, or after each step
 * of a session that runs. The time goes on by a frame, but not beyond the step that is due next, and never while one is
 * made: a session is never late, however long the other thread takes. */
#define WAIT_UNTIL(condition, a, b)                                                                                    \
    for (;;) {                                                                                                         \
        uint64_t wakes = manual_clock_wakes(&served_clock), events = manual_clock_events(&served_clock);               \
        bool sleeps = manual_clock_advance_to_due(&served_clock, FRAME_NS);                                            \
        served_serve(a, b);                                                                                            \
        if (condition) break;                                                                                          \
        if (sleeps)                                                                                                    \
            manual_clock_wait_wake(&served_clock, wakes);                                                              \
        else                                                                                                           \
            manual_clock_wait_event(&served_clock, events);                                                            \
    }
#endif
