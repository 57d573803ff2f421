/* The loop. libwebsockets 4.1.6 facts it rests on (measured): lws_service ignores its timeout and sleeps until a socket
 * or timer is ready; only lws_cancel_service may be called from other threads, it raises EVENT_WAIT_CANCELLED on every
 * protocol of every vhost; a timer callback runs before the sleep of the next lws_service call. */
#include "server/net/transport/loop.h"

#include "server/base/log.h"

#include <libwebsockets.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

/* files beside sockets: logs, recordings, scenes that are read. A socket with a higher number is closed at once */
enum { OTHER_FILES = 1024 };

struct pal_loop {
    struct lws_context *context;
    lws_sorted_usec_list_t tick_timer, due_timer;
    pal_loop_events events;
    _Atomic bool woken, stopped;
    const pal_clock *clock;
    uint64_t due_ns, tick_ns; /* without sockets; due_ns 0: none */
};

static void serve_wake(pal_loop *loop)
{
    /* cleared before serving, so that a wake during the service is served again */
    if (atomic_exchange(&loop->woken, false) && loop->events.wake) loop->events.wake(loop->events.user);
}

static int wake_callback(struct lws *wsi, enum lws_callback_reasons reason, void *own, void *in, size_t n_byte)
{
    (void)own, (void)in, (void)n_byte;
    if (reason == LWS_CALLBACK_EVENT_WAIT_CANCELLED) serve_wake(lws_context_user(lws_get_context(wsi)));
    return 0;
}

static const struct lws_protocols wake_protocols[] = {{"palpate-wake", wake_callback, 0, 0, 0, NULL, 0},
                                                      {NULL, NULL, 0, 0, 0, NULL, 0}};

/* lws' own lines: hostile input must not flood the log, so the loudest level is our debug */
static void lws_line(int level, const char *line)
{
    size_t n = strcspn(line, "\n");
    (void)level;
    pal_log(PAL_LOG_DEBUG, "lws", "%.*s", (int)n, line);
}

static void tick_due(lws_sorted_usec_list_t *timer)
{
    pal_loop *loop = lws_container_of(timer, pal_loop, tick_timer);
    lws_sul_schedule(loop->context, 0, &loop->tick_timer, tick_due, PAL_LOOP_TICK_NS / 1000);
    if (loop->events.tick) loop->events.tick(loop->events.user);
}

static void wake_due(lws_sorted_usec_list_t *timer)
{
    pal_loop *loop = lws_container_of(timer, pal_loop, due_timer);
    if (loop->events.wake) loop->events.wake(loop->events.user);
}

/* Sets how many files the process may have: systems begin with some hundred and let it raise that; what is refused
 * shows when they are used up. The result is the number before; 0: unknown */
static rlim_t allow_files(rlim_t n)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit)) return 0;
    const rlim_t before = limit.rlim_cur;
    limit.rlim_cur = n < limit.rlim_max ? n : limit.rlim_max;
    (void)setrlimit(RLIMIT_NOFILE, &limit);
    return before;
}

/* lws finds a socket by its number in a table of as many entries as the process may have files, which may be a thousand
 * million; with a limit of its own it searches all sockets for each event instead. So the limit is that of the process
 * while the table is made */
static struct lws_context *create_context(const struct lws_context_creation_info *info, int max_socket)
{
    const rlim_t n = (rlim_t)max_socket + OTHER_FILES, before = allow_files(n);
    struct lws_context *context = lws_create_context(info);
    if (before > n) (void)allow_files(before);
    return context;
}

static pal_err open_context(pal_loop *loop, int max_socket, bool tls, pal_diagnostic *diag)
{
    struct lws_context_creation_info info;
    memset(&info, 0, sizeof info);
    lws_set_log_level(LLL_ERR | LLL_WARN, lws_line);
    /* with it every host loads the certificates of all authorities, and only one that speaks TLS frees them */
    info.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | (tls ? LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT : 0);
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.user = loop;
    /* one per socket, made on demand: with fewer, that many idle connections keep everybody else waiting */
    info.max_http_header_pool = (unsigned short)(max_socket < 4096 ? max_socket : 4096);
    info.timeout_secs = 5;
    loop->context = create_context(&info, max_socket);
    if (!loop->context) return pal_diagnostic_set(diag, PAL_ERR_IO, "the network context could not be made");
    /* requests are matched to vhosts by port: this one must not look like a server */
    info.port = CONTEXT_PORT_NO_LISTEN;
    info.vhost_name = "wake";
    info.protocols = wake_protocols;
    if (!lws_create_vhost(loop->context, &info))
        return pal_diagnostic_set(diag, PAL_ERR_IO, "the network context has no wake");
    return PAL_ERR_OK;
}

pal_err pal_loop_create(bool sockets, int max_socket, bool tls, const pal_clock *clock, pal_diagnostic *diag,
                        pal_loop **out)
{
    pal_loop *loop = calloc(1, sizeof *loop);
    if (!loop) return PAL_ERR_MEMORY;
    loop->clock = clock;
    if (sockets) {
        pal_err err = open_context(loop, max_socket, tls, diag);
        if (err) return pal_loop_destroy(loop), err;
        lws_sul_schedule(loop->context, 0, &loop->tick_timer, tick_due, PAL_LOOP_TICK_NS / 1000);
    }
    *out = loop;
    return PAL_ERR_OK;
}

void pal_loop_shut(pal_loop *loop)
{
    if (!loop || !loop->context) return;
    lws_sul_schedule(loop->context, 0, &loop->tick_timer, NULL, LWS_SET_TIMER_USEC_CANCEL);
    lws_sul_schedule(loop->context, 0, &loop->due_timer, NULL, LWS_SET_TIMER_USEC_CANCEL);
    lws_context_destroy(loop->context);
    loop->context = NULL;
}

void pal_loop_destroy(pal_loop *loop)
{
    pal_loop_shut(loop);
    free(loop);
}

void pal_loop_listen(pal_loop *loop, const pal_loop_events *events)
{
    loop->events = *events;
}

uint64_t pal_loop_now_ns(const pal_loop *loop)
{
    return pal_clock_now_ns(loop->clock);
}

void pal_loop_set_due(pal_loop *loop, uint64_t when_ns)
{
    uint64_t now = pal_loop_now_ns(loop);
    loop->due_ns = when_ns;
    if (loop->context)
        lws_sul_schedule(loop->context, 0, &loop->due_timer, wake_due,
                         when_ns > now ? (lws_usec_t)((when_ns - now) / 1000 + 1) : 1);
}

void pal_loop_wake(pal_loop *loop)
{
    bool pending = atomic_exchange(&loop->woken, true);
    /* without a context the loop is turned by who waits on the clock, which counts every wake */
    if (!loop->context)
        pal_clock_wake(loop->clock);
    else if (!pending)
        lws_cancel_service(loop->context);
}

void pal_loop_stop(pal_loop *loop)
{
    atomic_store(&loop->stopped, true);
    if (loop->context) lws_cancel_service(loop->context);
}

pal_err pal_loop_run(pal_loop *loop)
{
    if (!loop->context) return PAL_ERR_STATE;
    while (!atomic_load(&loop->stopped))
        if (lws_service(loop->context, 0) < 0) return PAL_ERR_IO;
    return PAL_ERR_OK;
}

pal_err pal_loop_step(pal_loop *loop, uint64_t until_ns)
{
    if (!loop->context) return PAL_ERR_STATE;
    pal_loop_set_due(loop, until_ns);
    return lws_service(loop->context, 0) < 0 ? PAL_ERR_IO : PAL_ERR_OK;
}

void pal_loop_advance(pal_loop *loop)
{
    PAL_ASSERT(!loop->context);
    uint64_t now_ns = pal_loop_now_ns(loop);
    if (loop->due_ns && loop->due_ns <= now_ns) {
        loop->due_ns = 0;
        atomic_store(&loop->woken, true);
    }
    serve_wake(loop);
    if (now_ns - loop->tick_ns < PAL_LOOP_TICK_NS) return;
    loop->tick_ns = now_ns;
    if (loop->events.tick) loop->events.tick(loop->events.user);
}

struct lws_context *pal_loop_context(pal_loop *loop)
{
    return loop->context;
}
