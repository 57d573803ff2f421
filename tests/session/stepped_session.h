/* A session on a clock that the test advances step by step: what a frame holds after n steps is exact on any machine.
 * One session at a time, or one and those that replace it. */
#ifndef TESTS_SESSION_STEPPED_SESSION_H
#define TESTS_SESSION_STEPPED_SESSION_H
#include "server/session/session.h"
#include "tests/check.h"
#include "tests/fixtures/manual_clock.h"

static manual_clock stepped_clock;
static const pal_frame *stepped_frame; /* the newest one taken */

static inline uint64_t stepped_ns(const pal_session *s)
{
    return (uint64_t)(1e9 * pal_session_scene(s)->step_s + 0.5);
}

/* its thread sleeps until the first step is due; NULL: an error was reported */
static inline pal_session *stepped_open(const pal_scene *of, pal_session_options options)
{
    pal_session *session = NULL;
    pal_diagnostic diag = {""};
    manual_clock_init(&stepped_clock, 1000000000u);
    stepped_frame = NULL;
    options.clock = &stepped_clock.clock;
    if (pal_session_open(of, &options, &diag, &session)) {
        CHECK_FAIL("no session: %s", diag.text);
        return NULL;
    }
    if (!options.hold) manual_clock_settle(&stepped_clock, 1);
    return session;
}

/* the newest frame of a session, seen before or not */
static inline const pal_frame *stepped_newest(pal_session *s)
{
    const pal_frame *frame = pal_session_take_frame(s);
    if (frame) stepped_frame = frame;
    return stepped_frame;
}

/* the newest frame after n more steps; while paused they are only turns of its thread */
static inline const pal_frame *stepped_steps(pal_session *s, int n)
{
    manual_clock_steps(&stepped_clock, n, stepped_ns(s), 1);
    return stepped_newest(s);
}

/* makes `to` the session that runs */
static inline bool stepped_transfer(pal_session *to, pal_session *from, pal_session_transfer_fn *transfer, void *user)
{
    pal_diagnostic diag = {""};
    pal_session_transfer_begin(to, from, NULL, transfer, user);
    if (pal_session_transfer_end(to, from, &diag)) {
        CHECK_FAIL("no transfer: %s", diag.text);
        return false;
    }
    manual_clock_settle(&stepped_clock, 1);
    stepped_frame = NULL;
    return true;
}

static inline pal_err stepped_order(pal_session *s, pal_command_kind kind)
{
    return pal_session_command(s, &(pal_command){.kind = kind});
}
#endif
