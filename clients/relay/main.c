/* palpate-relay: one session of a server, shown to many viewers. The main thread has the way up and waits for signals,
 * a second one serves the viewers. */
#include "clients/relay/relay_upstream.h"
#include "clients/relay/relay_viewers.h"
#include "clients/relay/tuning.h"
#include "server/base/flags.h"
#include "server/base/json_members.h"
#include "server/base/log.h"
#include "server/base/thread.h"
#include "server/net/transport/host_name.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

typedef struct relay {
    pal_relay_kept kept;
    pal_relay_options options;
    pal_listen_address address;
    pal_loop *loop;
    pal_site *site;
    pal_relay_viewers *viewers;
    pal_transport *transport;
    pal_link_loop *up;
    pal_relay_upstream *upstream;
    pthread_t net;
} relay;

static void news(void *user)
{
    pal_loop_wake(((relay *)user)->loop);
}

static void *net_main(void *user)
{
    relay *r = user;
    const char *reason = "";
    (void)pal_loop_run(r->loop);
    const int code = pal_relay_upstream_ended(r->upstream, &reason);
    const uint64_t end = pal_loop_now_ns(r->loop) + PAL_RELAY_GOODBYE_NS;
    pal_relay_viewers_end(r->viewers, code ? code : PAL_WIRE_CLOSE_GOING_AWAY, code ? reason : "the relay ends");
    while (pal_relay_viewers_here(r->viewers) && pal_loop_now_ns(r->loop) < end) (void)pal_loop_step(r->loop, end);
    return NULL;
}

static pal_err open_relay(relay *r, const char *url, const char *page, pal_diagnostic *diag)
{
    pal_peer_events events;
    if (!r->address.remote && !pal_address_is_loopback(r->address.ip))
        return PAL_REFUSE(diag, "listening on %.60s lets other machines in: add --allow-remote if that is meant",
                          r->address.ip);
    if (!r->address.tls_certificate != !r->address.tls_key)
        return PAL_REFUSE(diag, "--tls-cert and --tls-key belong together");
    if (page) PAL_TRY(pal_site_open(page, diag, &r->site));
    r->options.site = r->site;
    r->options.health_on_main = !r->address.remote;
    r->address.max_socket = pal_relay_sockets(&r->options);
    PAL_TRY(pal_loop_create(true, r->address.max_socket, r->address.tls_certificate != NULL, &pal_clock_monotonic, diag,
                            &r->loop));
    pal_relay_kept_init(&r->kept, news, r);
    PAL_TRY(pal_relay_viewers_create(r->loop, &r->kept, &r->options, diag, &r->viewers));
    pal_relay_viewers_events(r->viewers, &events);
    PAL_TRY(pal_ws_transport.open(r->loop, &r->address, &events, diag, &r->transport));
    PAL_TRY(pal_link_loop_create(&r->up));
    PAL_TRY(pal_relay_upstream_open(r->up, url, &r->kept, diag, &r->upstream));
    PAL_TRY(pal_link_stop_on_signals(r->up));
    return pal_thread_start(&r->net, net_main, r) ? PAL_ERR_INTERNAL : PAL_ERR_OK;
}

static void close_relay(relay *r)
{
    pal_link_loop_destroy(r->up);
    pal_loop_shut(r->loop);
    if (r->transport) pal_ws_transport.close(r->transport);
    pal_relay_viewers_destroy(r->viewers);
    pal_relay_upstream_close(r->upstream);
    if (r->loop) pal_relay_kept_free(&r->kept);
    pal_loop_destroy(r->loop);
    pal_site_close(r->site);
}

static void announce(const relay *r, const pal_flag_common *common)
{
    char url[128];
    snprintf(url, sizeof url, strchr(r->address.ip, ':') ? "%s://[%s]:%d/" : "%s://%s:%d/",
             r->address.tls_certificate ? "https" : "http", r->address.ip, r->address.port);
    if (common->json)
        (void)pal_json_write(stdout, PAL_JSON({"url", JSON_TEXT(url)}, {"port", JSON_NUMBER(r->address.port)},
                                              {"pid", JSON_NUMBER(getpid())}));
    else if (!common->quiet)
        printf("palpate-relay: open %s\n", url), fflush(stdout);
}

int main(int argc, char **argv)
{
    static relay r; /* too large for the stack */
    const char *upstream[1], *page = NULL;
    double seconds = 0;
    pal_flag_common common;
    pal_diagnostic diag = {""};
    r.address = (pal_listen_address){.ip = "127.0.0.1", .port = 8092};
    r.options.max_viewers = PAL_RELAY_VIEWERS;
    const pal_flag flag[] = {
        {"--listen", "ADDRESS", PAL_FLAG_TEXT, &r.address.ip, 0, 0, "address to listen on (127.0.0.1)"},
        {"--port", "N", PAL_FLAG_COUNT, &r.address.port, 0, 65535, "port; 0 takes any free one (8092)"},
        {"--allow-remote", NULL, PAL_FLAG_SWITCH, &r.address.remote, 0, 1, "let other machines connect"},
        {"--hosts", "NAME,...", PAL_FLAG_TEXT, &r.address.hosts, 0, 0,
         "names by which other machines reach this one (its addresses and its own name)"},
        {"--tls-cert", "FILE", PAL_FLAG_TEXT, &r.address.tls_certificate, 0, 0,
         "certificate, or chain of them, in PEM: serve https and wss (none)"},
        {"--tls-key", "FILE", PAL_FLAG_TEXT, &r.address.tls_key, 0, 0, "key of that certificate, in PEM"},
        {"--keys", "FILE", PAL_FLAG_TEXT, &r.options.keys, 0, 0, "check tickets with this key file (they are not)"},
        {"--viewer", "FOLDER", PAL_FLAG_TEXT, &page, 0, 0, "files of the page (none)"},
        {"--relays", "URL,...", PAL_FLAG_TEXT, &r.options.relays, 0, 0,
         "other relays, to which pages go that find no place here (none)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 1e9, "end after so long (a signal ends it)"},
        {"--max-viewers", "N", PAL_FLAG_COUNT, &r.options.max_viewers, 1, 10000, "viewers at once (1000)"},
    };
    const pal_flag_table table = {
        .program = "palpate-relay",
        .usage = "UPSTREAM [flags]",
        .about = "Shows a session of a server, or of another relay, to many viewers: one connection up, many down.\n"
                 "UPSTREAM is the address that the server prints, as http://127.0.0.1:8090/?session=NAME.\n",
        .example = "palpate relay http://127.0.0.1:8090/ --port 0 --seconds 1\n",
        PAL_FLAGS(flag),
        .operands = {1, 1}};
    const int usage = pal_flags_parse(&table, argc, argv, &common, upstream, NULL);
    if (usage >= 0) return usage;
    pal_log_set_level(common.quiet || common.json ? PAL_LOG_WARN : PAL_LOG_INFO);
    pal_err err = open_relay(&r, upstream[0], page, &diag);
    const char *reason = "";
    int code = 0;
    if (!err) {
        announce(&r, &common);
        pal_link_run_for(r.up, seconds);
        pal_loop_stop(r.loop);
        pthread_join(r.net, NULL);
        code = pal_relay_upstream_ended(r.upstream, &reason);
        if (code) fprintf(stderr, "palpate-relay: upstream has ended it with %d: %s\n", code, reason);
    } else
        fprintf(stderr, "palpate-relay: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
    close_relay(&r);
    return err || code ? 1 : 0;
}
