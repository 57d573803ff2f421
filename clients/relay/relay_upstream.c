#include "clients/relay/relay_upstream.h"

#include "clients/relay/tuning.h"
#include "protocol/asset.h"
#include "server/base/clock.h"
#include "server/base/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* an asset on its way */
typedef struct fetch {
    pal_relay_upstream *of;
    struct fetch *next;
    char path[PAL_WIRE_NAME_BYTES];
} fetch;

struct pal_relay_upstream {
    pal_link_loop *loop;
    pal_link *link;
    pal_relay_kept *kept;
    uint64_t heard_ns; /* when it said something last */
    char url[512];
    fetch *fetches;
    uint32_t next_part; /* whose fields are asked for next */
    int end_code;
    char end_reason[128];
};

static void got(void *user, int status, const uint8_t *bytes, size_t n_byte, const char *reason)
{
    fetch *f = user;
    pal_relay_upstream *u = f->of;
    for (fetch **at = &u->fetches; *at; at = &(*at)->next)
        if (*at == f) {
            *at = f->next;
            break;
        }
    if (status != 200)
        pal_log(PAL_LOG_WARN, "asset", "%s does not come: %s", f->path, reason && reason[0] ? reason : "refused");
    else if (pal_relay_take_asset(u->kept, f->path, bytes, n_byte))
        pal_log(PAL_LOG_WARN, "asset", "%s is not what its name says", f->path);
    free(f);
}

static void want(void *user, const char *path)
{
    pal_relay_upstream *u = user;
    for (const fetch *f = u->fetches; f; f = f->next)
        if (!strcmp(f->path, path)) return;
    fetch *f = calloc(1, sizeof *f);
    if (!f) return;
    *f = (fetch){.of = u, .next = u->fetches};
    snprintf(f->path, sizeof f->path, "%s", path);
    u->fetches = f;
    /* the URL has been read before: only memory can fail, and the next try comes */
    if (pal_link_get(u->loop, u->url, path, PAL_ASSET_BYTES_MAX, got, f, NULL)) {
        u->fetches = f->next;
        free(f);
    }
}

static void end(pal_relay_upstream *u, int code, const char *reason)
{
    u->end_code = code;
    snprintf(u->end_reason, sizeof u->end_reason, "%s", reason);
    pal_link_stop(u->loop);
}

static void state(void *user, pal_link_state now, int code, const char *reason)
{
    pal_relay_upstream *u = user;
    u->heard_ns = pal_clock_ns();
    if (now == PAL_LINK_JOINED) pal_relay_forget_requests(u->kept);
    if (now == PAL_LINK_JOINED) pal_log(PAL_LOG_INFO, "upstream", "%s is relayed", u->kept->session);
    if (now != PAL_LINK_LOST && now != PAL_LINK_ENDED) return;
    pal_log(PAL_LOG_WARN, "upstream", "lost: %s", reason[0] ? reason : "no connection");
    pal_relay_lost(u->kept);
    if (now == PAL_LINK_ENDED) end(u, code ? code : PAL_WIRE_CLOSE_GOING_AWAY, reason);
}

/* the link goes there by itself: this is for assets, and for the next link */
static void follow(pal_relay_upstream *u, const pal_wire_move *to)
{
    char own[sizeof to->ticket] = "";
    const char *mark = strchr(u->url, '#');
    if (mark) snprintf(own, sizeof own, "%s", mark + 1);
    const char *ticket = to->ticket[0] ? to->ticket : own;
    snprintf(u->url, sizeof u->url, "%s?session=%s%s%s", to->address, to->session, ticket[0] ? "#" : "", ticket);
    pal_log(PAL_LOG_INFO, "upstream", "%s goes on at %s", to->session, to->address);
}

static void text(void *user, const pal_control *decoded, const char *bytes, size_t n_byte)
{
    pal_relay_upstream *u = user;
    u->heard_ns = pal_clock_ns();
    if (decoded->type == PAL_CONTROL_MOVE) follow(u, &decoded->move);
    pal_relay_take_text(u->kept, decoded, bytes, n_byte);
}

static void message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    pal_relay_upstream *u = user;
    pal_relay_take_message(u->kept, head, bytes, n_byte);
    if (head->kind == PAL_WIRE_TOOLS) pal_link_acknowledge(u->link, bytes, n_byte);
}

static pal_err connect_up(pal_relay_upstream *u, pal_diagnostic *diag)
{
    static const pal_link_events events = {.state = state, .text = text, .message = message};
    const pal_link_options options = {.url = u->url,
                                      .name = "relay",
                                      .role = PAL_WIRE_ROLE_VIEWER,
                                      .tool = PAL_WIRE_TOOL_NONE,
                                      .topology_deltas = true,
                                      .events = &events,
                                      .user = u};
    u->heard_ns = pal_clock_ns();
    return pal_link_open(u->loop, &options, diag, &u->link);
}

/* a machine that is gone closes no connection */
static void call_again(pal_relay_upstream *u)
{
    const pal_link_state now = pal_link_current_state(u->link);
    if (now != PAL_LINK_OPEN && now != PAL_LINK_JOINED) return;
    if (pal_clock_ns() - u->heard_ns < PAL_RELAY_SILENT_NS) return;
    pal_log(PAL_LOG_WARN, "upstream", "silent: it is called again");
    pal_relay_lost(u->kept);
    pal_link_close(u->link);
    if (connect_up(u, NULL)) end(u, PAL_WIRE_CLOSE_INTERNAL, pal_err_text(PAL_ERR_MEMORY));
}

/* asks for what viewers want to see: one part at a time */
static void ask(void *user)
{
    pal_relay_upstream *u = user;
    pal_relay_view wanted;
    if (pal_link_current_state(u->link) != PAL_LINK_JOINED) return;
    const uint32_t part = pal_relay_next_request(u->kept, u->next_part, &wanted);
    if (part == PAL_WIRE_PART_MAX) return;
    pal_control request = {.type = PAL_CONTROL_SUBSCRIBE_FIELD};
    request.field_subscription.part = part;
    request.field_subscription.interior = wanted.interior;
    request.field_subscription.energy = wanted.energy;
    pal_wire_field_put_set(wanted.fields, request.field_subscription.field);
    /* a full queue: all is asked for again */
    if (pal_link_send_control(u->link, &request)) pal_relay_forget_requests(u->kept);
    u->next_part = part + 1;
}

static void look_after(void *user)
{
    pal_relay_upstream *u = user;
    call_again(u);
    pal_relay_want_missing(u->kept);
}

pal_err pal_relay_upstream_open(pal_link_loop *loop, const char *url, pal_relay_kept *kept, pal_diagnostic *diag,
                                pal_relay_upstream **out)
{
    pal_relay_upstream *u = calloc(1, sizeof *u);
    if (!u) return PAL_ERR_MEMORY;
    *u = (pal_relay_upstream){.loop = loop, .kept = kept};
    snprintf(u->url, sizeof u->url, "%s", url);
    pal_relay_kept_fetch_by(kept, want, u);
    pal_err err = connect_up(u, diag);
    if (!err && !pal_link_add_timer(loop, PAL_RELAY_LOOK_US, look_after, u)) err = PAL_ERR_MEMORY;
    if (!err && !pal_link_add_timer(loop, PAL_RELAY_ASK_US, ask, u)) err = PAL_ERR_MEMORY;
    if (err) return pal_relay_upstream_close(u), err;
    *out = u;
    return PAL_ERR_OK;
}

int pal_relay_upstream_ended(const pal_relay_upstream *u, const char **reason)
{
    *reason = u->end_reason;
    return u->end_code;
}

void pal_relay_upstream_close(pal_relay_upstream *u)
{
    if (!u) return;
    for (fetch *f = u->fetches, *after; f; f = after) {
        after = f->next;
        free(f);
    }
    free(u);
}
