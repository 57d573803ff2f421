/* The event loop of the clients: one libwebsockets context with timers, wake, watched descriptors and addresses.
 * libwebsockets 4.1.6 facts used: lws_cancel_service is the one call allowed from other threads and raises
 * EVENT_WAIT_CANCELLED on every protocol; a flag set inside a timer needs it too, because timers run before the sleep
 * of the next service call; adopted descriptors are closed by the library, so a copy is handed over; extensions stay
 * NULL (permessage-deflate can abort a process). */
#include "clients/link/link_core.h"
#include "server/base/clock.h"
#include "server/base/log.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct link_watch {
    link_watch *next;
    void (*fn)(void *user);
    void *user;
};

static int link_watch_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t len)
{
    (void)user, (void)in, (void)len;
    link_watch *watch = lws_get_opaque_user_data(wsi);
    if (reason == LWS_CALLBACK_RAW_RX_FILE && watch) watch->fn(watch->user);
    return 0;
}

static const struct lws_protocols link_protocols[] = {
    /* the first one is also called for connections that are bound to none yet */
    {LINK_LOCAL_WATCH, link_watch_callback, 0, 0, 0, NULL, 0},
    {PAL_PROTOCOL_NAME, link_ws_callback, 0, LINK_RX_BYTES, 0, NULL, 0},
    {LINK_LOCAL_GET, link_get_callback, 0, LINK_RX_BYTES, 0, NULL, 0},
    {NULL, NULL, 0, 0, 0, NULL, 0},
};

static void link_library_log(int level, const char *line)
{
    const size_t n = strcspn(line, "\n");
    pal_log(PAL_LOG_DEBUG, level & LLL_ERR ? "lws_error" : "lws", "%.*s", (int)n, line);
}

pal_err pal_link_loop_create(pal_link_loop **out)
{
    pal_link_loop *loop = calloc(1, sizeof *loop);
    if (!loop) return PAL_ERR_MEMORY;
    lws_set_log_level(LLL_ERR | LLL_WARN, link_library_log);
    struct lws_context_creation_info info = {0};
    info.port = CONTEXT_PORT_NO_LISTEN;
    info.protocols = link_protocols;
    info.extensions = NULL;
    info.options = LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
    info.client_ssl_ca_filepath = getenv("PALPATE_CA");
    info.pt_serv_buf_size = LINK_RX_BYTES;
    info.timeout_secs = 5;
    info.user = loop;
    info.gid = -1, info.uid = -1;
    info.vhost_name = "client";
    loop->context = lws_create_context(&info);
    loop->vhost = loop->context ? lws_get_vhost_by_name(loop->context, "client") : NULL;
    if (!loop->vhost) {
        if (loop->context) lws_context_destroy(loop->context);
        free(loop);
        return PAL_ERR_MEMORY;
    }
    *out = loop;
    return PAL_ERR_OK;
}

void pal_link_loop_destroy(pal_link_loop *loop)
{
    if (!loop) return;
    while (loop->timers) pal_link_remove_timer(loop->timers);
    /* goodbyes get a fifth of a second; a cancelled wait keeps the service call from sleeping longer */
    const uint64_t end = pal_clock_ns() + 200000000;
    while (link_close_all(loop) && pal_clock_ns() < end) {
        lws_cancel_service(loop->context);
        lws_service(loop->context, 0);
    }
    lws_context_destroy(loop->context);
    link_free_all(loop);
    link_get_free_all(loop);
    for (link_watch *watch = loop->watches, *next; watch; watch = next) {
        next = watch->next;
        free(watch);
    }
    free(loop);
}

void pal_link_run(pal_link_loop *loop)
{
    while (!atomic_load(&loop->stop) && lws_service(loop->context, 0) >= 0) {
    }
}

static void link_time_is_up(void *loop)
{
    pal_link_stop(loop);
}

void pal_link_run_for(pal_link_loop *loop, double seconds)
{
    if (seconds <= 0) {
        pal_link_run(loop);
        return;
    }
    pal_link_timer *timer = pal_link_add_timer(loop, (uint64_t)(seconds * 1e6), link_time_is_up, loop);
    if (timer) pal_link_run(loop);
    pal_link_remove_timer(timer);
    atomic_store(&loop->stop, false);
}

void pal_link_stop(pal_link_loop *loop)
{
    atomic_store(&loop->stop, true);
    lws_cancel_service(loop->context);
}

/* a handler runs on any thread: lock-free atomics are safe there, and between threads as well */
static atomic_int link_signal;

static void link_on_signal(int number)
{
    link_signal = number;
}

static void link_check_signal(void *loop)
{
    if (link_signal) pal_link_stop(loop);
}

pal_err pal_link_stop_on_signals(pal_link_loop *loop)
{
    signal(SIGINT, link_on_signal);
    signal(SIGTERM, link_on_signal);
    return pal_link_add_timer(loop, 50000, link_check_signal, loop) ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static void link_timer_fired(lws_sorted_usec_list_t *sul)
{
    pal_link_timer *timer = lws_container_of(sul, pal_link_timer, sul);
    timer->fn(timer->user);
    lws_sul_schedule(timer->loop->context, 0, &timer->sul, link_timer_fired, (lws_usec_t)timer->period_us);
}

pal_link_timer *pal_link_add_timer(pal_link_loop *loop, uint64_t period_us, void (*fn)(void *user), void *user)
{
    pal_link_timer *timer = calloc(1, sizeof *timer);
    if (!timer) return NULL;
    *timer = (pal_link_timer){.next = loop->timers, .loop = loop, .fn = fn, .user = user};
    timer->period_us = period_us > 0 ? period_us : 1;
    loop->timers = timer;
    lws_sul_schedule(loop->context, 0, &timer->sul, link_timer_fired, (lws_usec_t)timer->period_us);
    return timer;
}

void pal_link_remove_timer(pal_link_timer *timer)
{
    if (!timer) return;
    pal_link_timer **place = &timer->loop->timers;
    while (*place && *place != timer) place = &(*place)->next;
    if (*place) *place = timer->next;
    lws_sul_schedule(timer->loop->context, 0, &timer->sul, link_timer_fired, LWS_SET_TIMER_USEC_CANCEL);
    free(timer);
}

pal_err pal_link_poll_fd(pal_link_loop *loop, int fd, void (*fn)(void *user), void *user)
{
    link_watch *watch = calloc(1, sizeof *watch);
    if (!watch) return PAL_ERR_MEMORY;
    *watch = (link_watch){.next = loop->watches, .fn = fn, .user = user};
    lws_sock_file_fd_type copy = {.filefd = dup(fd)};
    struct lws *wsi = copy.filefd < 0 ? NULL
                                      : lws_adopt_descriptor_vhost(loop->vhost, LWS_ADOPT_RAW_FILE_DESC, copy,
                                                                   LINK_LOCAL_WATCH, NULL);
    if (!wsi) {
        free(watch);
        return PAL_ERR_IO;
    }
    lws_set_opaque_user_data(wsi, watch);
    loop->watches = watch;
    return PAL_ERR_OK;
}

/* on this machine nobody stands between, and no certificate names it */
static const int unchecked = LCCSCF_ALLOW_SELFSIGNED | LCCSCF_SKIP_SERVER_CERT_HOSTNAME_CHECK | LCCSCF_ALLOW_INSECURE;
static bool is_loopback(const char *host)
{
    return !strncmp(host, "127.", 4) || !strcmp(host, "::1") || !strcmp(host, "localhost");
}

struct lws_client_connect_info link_connect_info(pal_link_loop *loop, const link_address *to,
                                                 const char *local_protocol, void *object, struct lws **wsi)
{
    return (struct lws_client_connect_info){.context = loop->context,
                                            .vhost = loop->vhost,
                                            .address = to->host,
                                            .host = to->host,
                                            .port = to->port,
                                            .local_protocol_name = local_protocol,
                                            .opaque_user_data = object,
                                            .ssl_connection =
                                                to->tls ? LCCSCF_USE_SSL | (is_loopback(to->host) ? unchecked : 0) : 0,
                                            .pwsi = wsi};
}

pal_err link_address_parse(const char *url, link_address *out, pal_diagnostic *diag)
{
    const char *host = NULL;
    if (!strncmp(url, "ws://", 5)) host = url + 5;
    if (!strncmp(url, "http://", 7)) host = url + 7;
    out->tls = !strncmp(url, "wss://", 6) || !strncmp(url, "https://", 8);
    if (out->tls) host = url + (url[0] == 'w' ? 6 : 8);
    if (!host) return PAL_REFUSE(diag, "%s: not a ws:// or http:// address, nor with s", url);
    const size_t n_finest = strcspn(host, "/?#"), n_all = strcspn(host, "#");
    const char *query = host + n_finest + (host[n_finest] == '/'), *ticket = host + n_all + (host[n_all] == '#');
    if (!*ticket && getenv("PALPATE_TICKET")) ticket = getenv("PALPATE_TICKET");
    /* the page's own address stands for the socket's */
    const bool is_page = query == host + n_all || *query == '?';
    const char *rest = is_page ? query : host + n_finest;
    const size_t n_rest = (size_t)(host + n_all - rest), n_path = n_rest + (is_page ? strlen("/ws") : 0);
    const char *colon = NULL;
    const bool bracket = host[0] == '[';
    const char *close = bracket ? memchr(host, ']', n_finest) : NULL;
    const size_t after = close ? (size_t)(close - host) : 0;
    colon = memchr(host + after, ':', n_finest - after);
    const size_t n_host = close ? after - 1 : (colon ? (size_t)(colon - host) : n_finest);
    if (n_host == 0 || n_host >= sizeof out->host || n_path >= sizeof out->path || (bracket && !close))
        return PAL_REFUSE(diag, "%s: host or path is empty or too long", url);
    long port = out->tls ? 443 : 80;
    if (colon) {
        char *end;
        port = strtol(colon + 1, &end, 10);
        if (end != host + n_finest || port < 1 || port > 65535)
            return PAL_REFUSE(diag, "%s: port is not a number of 1 to 65535", url);
    }
    memcpy(out->host, host + bracket, n_host);
    out->host[n_host] = 0;
    snprintf(out->path, sizeof out->path, "%s%.*s", is_page ? "/ws" : "", (int)n_rest, rest);
    out->port = (int)port;
    if (strlen(ticket) >= sizeof out->ticket)
        return PAL_REFUSE(diag, "the ticket of %.*s is too long", (int)n_all, host);
    strcpy(out->ticket, ticket);
    return PAL_ERR_OK;
}
