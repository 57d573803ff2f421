/* When the steps of a session are due, and how its thread waits for them. While nothing moves and nobody looks, it
 * rests for several steps, which are taken together afterwards; of a session that stands there are none. */
#include "server/session/session_core.h"

#include "server/session/tuning.h"

#include <time.h>

static bool is_stopped(const pal_session *s)
{
    return atomic_load_explicit(&s->stop, memory_order_acquire);
}

bool pal_session_moves(const pal_session *s)
{
    return (!s->paused || s->single > 0) && (!s->play || s->playing.state == PAL_PLAYS);
}

/* does nothing change until somebody looks, holds a tool or gives a command? */
static bool is_idle(const pal_session *s)
{
    bool idle = !s->observed;
    if (idle && pal_session_moves(s)) {
        idle = !s->play && !s->options.unpaced;
        for (int b = 0; b < pal_world_body_count(s->world) && idle; b++) idle = pal_world_body(s->world, b)->asleep;
    }
    for (int t = 0; t < s->scene->n_tool && idle; t++)
        idle = !s->tool[t].present && !pal_session_next_pose(&s->tool[t]);
    return idle;
}

/* sleeps until when_ns or a call; a clock that can be woken is, another one is the monotonic one */
static void rest(pal_session *s, uint64_t when_ns)
{
    const struct timespec when = {.tv_sec = (time_t)(when_ns / SECOND_NS), .tv_nsec = (long)(when_ns % SECOND_NS)};
    if (s->options.clock->wake) {
        s->options.clock->sleep_until_ns(s->options.clock->user, when_ns);
        return;
    }
    pthread_mutex_lock(&s->lock);
    while (!atomic_load(&s->called) && pthread_cond_timedwait(&s->call, &s->lock, &when) == 0) {
    }
    pthread_mutex_unlock(&s->lock);
}

void pal_session_call(pal_session *s)
{
    atomic_store(&s->called, true);
    if (!atomic_load(&s->rests)) return;
    pthread_mutex_lock(&s->lock);
    pthread_cond_signal(&s->call);
    pthread_mutex_unlock(&s->lock);
    pal_clock_wake(s->options.clock);
}

int pal_session_pace(pal_session *s, uint64_t *due)
{
    const pal_clock *clock = s->options.clock;
    const uint64_t began = *due, step_ns = s->play ? (uint64_t)((double)s->step_ns / s->speed) : s->step_ns;
    uint64_t now = session_now_ns(s);
    const bool rests = is_idle(s);
    int n = rests && PAL_REST_NS > step_ns ? (int)(PAL_REST_NS / step_ns) : 1;
    *due = s->options.unpaced && !s->paused ? now : *due + (uint64_t)n * step_ns;
    /* who calls after this sees that it rests, and who called before it is seen here */
    atomic_store(&s->rests, rests);
    if (rests && now < *due && !atomic_load(&s->called)) rest(s, *due);
    atomic_store(&s->rests, false);
    now = session_now_ns(s);
    if (rests && now < *due) {
        n = now > began + step_ns ? (int)((now - began + step_ns - 1) / step_ns) : 1;
        *due = began + (uint64_t)n * step_ns;
    }
    for (; now < *due && !is_stopped(s); now = session_now_ns(s)) clock->sleep_until_ns(clock->user, *due);
    if (!s->paused && now > *due + (uint64_t)(PAL_LATE_PART * (double)s->step_ns)) s->n_late++;
    if (now > *due + s->step_ns) *due = now;
    return is_stopped(s) ? 0 : n;
}
