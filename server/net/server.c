/* The server puts loop, hub and transport together. */
#include "server/net/server.h"

#include "server/net/transport/host_name.h"
#include "server/net/transport/tuning.h"
#include "server/net/tuning.h"

#include <arpa/inet.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct pal_server {
    pal_loop *loop;
    pal_hub *hub;
    pal_site *site;
    const pal_transport_ops *ops;
    pal_transport *transport;
    pal_server_gate *gate;
    pal_listen_address address;
    char health_ip[64];
};

void pal_server_gate_wake(void *gate)
{
    pal_server_gate *g = gate;
    atomic_fetch_add(&g->users, 1);
    pal_loop *loop = atomic_load(&g->loop);
    if (loop) pal_loop_wake(loop);
    atomic_fetch_sub(&g->users, 1);
}

void pal_server_connect(pal_server *server, pal_server_gate *gate)
{
    server->gate = gate;
    atomic_store(&gate->loop, server->loop);
    /* frames published before */
    pal_loop_wake(server->loop);
}

/* an address alone: names of hosts and ports behind a colon are none */
static bool is_address(const char *listen)
{
    unsigned char bytes[sizeof(struct in6_addr)];
    return inet_pton(AF_INET, listen, bytes) == 1 || inet_pton(AF_INET6, listen, bytes) == 1;
}

static pal_err choose_address(const pal_server_options *options, pal_listen_address *out, pal_diagnostic *diag)
{
    const char *listen = options->listen && options->listen[0] ? options->listen : "127.0.0.1";
    if (!strcmp(listen, "localhost")) listen = "127.0.0.1";
    if (!is_address(listen))
        return PAL_REFUSE(diag, "--listen %.80s: wanted an IP address alone, as 127.0.0.1; a port is given with --port",
                          listen);
    if (!options->allow_remote && !pal_address_is_loopback(listen))
        return PAL_REFUSE(diag,
                          "listening on %s lets other machines in: add --allow-remote if that is meant, and a "
                          "certificate with --tls-cert and --tls-key",
                          listen);
    if (!options->tls_certificate != !options->tls_key)
        return PAL_REFUSE(diag, "--tls-cert and --tls-key belong together: %s is missing",
                          options->tls_key ? "the certificate" : "the key");
    *out = (pal_listen_address){.ip = listen,
                                .port = options->port,
                                .remote = options->allow_remote,
                                .hosts = options->hosts,
                                .tls_certificate = options->tls_certificate,
                                .tls_key = options->tls_key};
    return PAL_ERR_OK;
}

/* "PORT" of the loopback address, "ADDRESS:PORT" or "[ADDRESS]:PORT" */
static pal_err choose_health_address(pal_server *s, const char *health, pal_diagnostic *diag)
{
    const char *colon = strrchr(health, ':'), *port = colon ? colon + 1 : health;
    size_t n = colon ? (size_t)(colon - health) : 0;
    const bool bracket = n > 2 && health[0] == '[' && health[n - 1] == ']';
    int n_port = 0;
    snprintf(s->health_ip, sizeof s->health_ip, "%.*s", (int)(bracket ? n - 2 : n), health + bracket);
    if (!colon) snprintf(s->health_ip, sizeof s->health_ip, "127.0.0.1");
    if (sscanf(port, "%5d%n", &s->address.health_port, &n_port) != 1 || port[n_port] || !is_address(s->health_ip))
        return PAL_REFUSE(diag, "--health %.80s: wanted a port, or an address and a port as 127.0.0.1:9090", health);
    s->address.health_ip = s->health_ip;
    return PAL_ERR_OK;
}

/* a page's address, because browsers open it: "http[s]://host[:port][/]" */
static pal_err check_drain_address(const char *to, pal_diagnostic *diag)
{
    const char *host = !strncmp(to, "http://", 7) ? to + 7 : !strncmp(to, "https://", 8) ? to + 8 : "";
    const size_t n = strcspn(host, "/?# ");
    if (n == 0 || (host[n] && strcmp(host + n, "/")))
        return PAL_REFUSE(diag, "--drain-to %.120s: wanted the address of a server, as https://b.example:8090/", to);
    return PAL_ERR_OK;
}

static pal_err open_parts(pal_server *s, const pal_server_options *options, pal_session **session, int n_session,
                          pal_diagnostic *diag)
{
    pal_peer_events events;
    PAL_TRY(choose_address(options, &s->address, diag));
    if (options->drain_to && options->drain_to[0]) PAL_TRY(check_drain_address(options->drain_to, diag));
    if (options->health && options->health[0]) PAL_TRY(choose_health_address(s, options->health, diag));
    if (options->viewer_folder) PAL_TRY(pal_site_open(options->viewer_folder, diag, &s->site));
    /* besides members and viewers: sockets kept for the health listener, connections that do not join, page loads, and
     * what lws needs itself */
    const int max_socket = s->address.max_socket = (options->max_clients > 0 ? options->max_clients : PAL_HUB_CLIENTS) +
                                                   (options->max_viewers > 0 ? options->max_viewers : PAL_HUB_VIEWERS) +
                                                   PAL_UNJOINED_PLACES + 128 + PAL_HEALTH_SOCKETS;
    PAL_TRY(pal_loop_create(s->ops->sockets, max_socket, options->tls_certificate != NULL,
                            n_session ? pal_session_clock(session[0]) : &pal_clock_monotonic, diag, &s->loop));
    PAL_TRY(pal_hub_create(s->loop, options, s->site, session, n_session, diag, &s->hub));
    pal_hub_events(s->hub, &events);
    return s->ops->open(s->loop, &s->address, &events, diag, &s->transport);
}

pal_err pal_server_open(const pal_server_options *options, pal_session **session, int n_session, pal_diagnostic *diag,
                        pal_server **out)
{
    if (n_session < 1 && !options->source) return PAL_REFUSE(diag, "a server needs a session");
    pal_server *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    s->ops = options->transport ? options->transport : &pal_ws_transport;
    pal_err err = open_parts(s, options, session, n_session, diag);
    if (err) return pal_server_close(s), err;
    *out = s;
    return PAL_ERR_OK;
}

pal_err pal_server_run(pal_server *server)
{
    pal_err err = pal_loop_run(server->loop);
    if (err) return err;
    pal_hub_drain(server->hub);
    /* clients get the reason; those that do not read it within PAL_GOODBYE_NS are cut off */
    uint64_t end = pal_loop_now_ns(server->loop) + PAL_GOODBYE_NS;
    while (!pal_hub_moves_sent(server->hub) && pal_loop_now_ns(server->loop) < end) pal_loop_step(server->loop, end);
    pal_hub_goodbye(server->hub);
    end += PAL_GOODBYE_NS;
    while (pal_hub_clients(server->hub) && pal_loop_now_ns(server->loop) < end) pal_loop_step(server->loop, end);
    return PAL_ERR_OK;
}

void pal_server_stop(pal_server *server)
{
    pal_loop_stop(server->loop);
}

void pal_server_start_ticket(const pal_server *server, pal_wire_role role, char text[PAL_TICKET_TEXT])
{
    pal_hub_start_ticket(server->hub, role, text);
}

int pal_server_record_error(const pal_server *server)
{
    return pal_hub_record_error(server->hub);
}

bool pal_server_has_ended(const pal_server *server, int i)
{
    return pal_hub_has_ended(server->hub, i);
}

pal_hub_pulse pal_server_pulse(const pal_server *server)
{
    return pal_hub_read_pulse(server->hub);
}

int pal_server_port(const pal_server *server)
{
    return server->address.port;
}

int pal_server_health_port(const pal_server *server)
{
    return server->address.health_ip ? server->address.health_port : -1;
}

void pal_server_close(pal_server *server)
{
    if (!server) return;
    if (server->gate) atomic_store(&server->gate->loop, NULL);
    while (server->gate && atomic_load(&server->gate->users)) sched_yield();
    pal_loop_shut(server->loop);
    if (server->transport) server->ops->close(server->transport);
    pal_hub_destroy(server->hub);
    pal_loop_destroy(server->loop);
    pal_site_close(server->site);
    free(server);
}

pal_transport *pal_server_transport(pal_server *server)
{
    return server->transport;
}

void pal_server_advance(pal_server *server)
{
    pal_loop_advance(server->loop);
}

void pal_server_drain(pal_server *server)
{
    pal_hub_drain(server->hub);
}

void pal_server_goodbye(pal_server *server)
{
    pal_hub_goodbye(server->hub);
}
